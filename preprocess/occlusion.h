// Regional occlusion culling (thesis 5.2.1): which objects can be seen from some point of a cell,
// so that the others need not be stored in it.
//
// Rays go from many points of the cell's surface to each object. The first one that arrives proves
// that the object can be seen; most objects need a few, only hidden ones all. That none arrives
// proves nothing, so each object is taken for larger than it is, by its box and a margin round it:
// what begins to show between others shows by the margin first.
#pragma once
#include "hexgrid.h"
#include "rays.h"

typedef struct hw_occlusion_options {
    uint32_t rays; // to an object before it counts as hidden
    double margin; // round an object's box, in cell sizes; half as much above
} hw_occlusion_options;
hw_occlusion_options hw_occlusion_defaults(void);

typedef struct hw_occlusion hw_occlusion;

// For the cells of one scene; borrows scene and rays (of hw_rays_create_scene). Read-only
// afterwards: queries are thread-safe.
HW_MUST_USE hw_status hw_occlusion_create(hw_occlusion **out, const hw_scene *scene,
                                          const hw_rays *rays, const hw_occlusion_options *options);
void hw_occlusion_destroy(hw_occlusion *occlusion);
// seen[i] tells whether object i may be seen from the cell; object_count of them. Objects that
// meet the cell are. Surfaces hide what is behind them from their front only, as they are drawn
// (closed meshes, turned outward, from all sides).
HW_MUST_USE hw_status hw_occlusion_query(const hw_occlusion *occlusion, const hw_hexgrid *grid,
                                         hw_cell_id id, bool *seen);
