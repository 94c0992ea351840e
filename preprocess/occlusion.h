// Regional occlusion culling (thesis 5.2.1): which objects can be seen from some point of a cell,
// so that the others need not be stored in it.
//
// The method is point sampling made safe by shrunk occluders (after Wonka, Wimmer and Schmalstieg,
// Visibility Preprocessing with Occluder Fusion for Urban Walkthroughs, 2000), done in images.
// From each eye of a lattice in the cell, rays make a panorama of depths. Every eye answers for all
// points up to `delta` from it, half-way to the next one: from there, what hides at depth d may
// move by asin(delta / d) before what is behind it, so each depth is replaced by the greatest one
// within that angle, farther occluders first. An object is seen if, somewhere on its box, the
// result reaches as far as the box.
#pragma once
#include "hexgrid.h"
#include "rays.h"

typedef struct hw_occlusion_options {
    uint32_t rings; // eyes: rings of a triangular lattice round the cell's centre; 0 = it alone
    double step_degrees; // between rays, in azimuth
    double margin; // of delta: 1; 0 trusts the eyes alone, which is not safe (tests want that)
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
// (closed meshes, turned outward, from all sides); so does the ground.
HW_MUST_USE hw_status hw_occlusion_query(const hw_occlusion *occlusion, const hw_hexgrid *grid,
                                         hw_cell_id id, bool *seen);
