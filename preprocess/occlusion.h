// Regional occlusion culling (thesis 5.2.1): which objects can be seen from some point of a cell,
// so that the others need not be stored in it, and which faces of those that can.
//
// Rays go from many eyes on the cell's surface to each object, in packets. The first one that
// arrives proves that the object can be seen; most objects need one packet, only hidden ones all.
// That none arrives proves nothing, so each object is taken for larger than it is, by its box and a
// margin round it: what begins to show between others shows by the margin first. And since a line
// of sight leaves the cell into a neighbour that then sees the same, what neighbours see is looked
// for much longer, from the sides that they share. A group of cells sees what its cells see.
#pragma once
#include "hexgrid.h"
#include "sight_faces.h"

typedef struct hw_occlusion_options {
    uint32_t eyes;      // of a cell, from which no object is seen that counts as hidden
    uint32_t more;      // packets for each eye that what neighbours see beside it then shares
    uint32_t face_eyes; // of a cell, from which no face is seen that counts as hidden
    double margin;      // round an object's box, in cell sizes; half as much above
} hw_occlusion_options;
hw_occlusion_options hw_occlusion_defaults(void);

typedef struct hw_occlusion hw_occlusion;

// For the cells of one scene; borrows scene and rays (of hw_rays_create_scene). What follows is
// thread-safe.
HW_MUST_USE hw_status hw_occlusion_create(hw_occlusion **out, const hw_scene *scene,
                                          const hw_rays *rays, const hw_hexgrid *grid,
                                          const hw_occlusion_options *options);
void hw_occlusion_destroy(hw_occlusion *occlusion);
// seen[i] tells whether object i may be seen from the cell, of any level; object_count of them.
// Objects that meet a cell are. Surfaces hide what is behind them from their front only, as they
// are drawn (closed meshes, turned outward, from all sides). Searches the cells round it too,
// two rings of them, and remembers what is seen from each cell of level 0: three bytes for each of
// them and each object.
HW_MUST_USE hw_status hw_occlusion_query(hw_occlusion *occlusion, hw_cell_id id, bool *seen);

// seen[i] tells whether face i of a surface that stands for an object may be seen from the cell
// past other objects, as hw_sights_faces has it.
HW_MUST_USE hw_status hw_occlusion_faces(const hw_occlusion *occlusion, hw_cell_id id,
                                         const hw_sight_surface *surface, bool *seen);
