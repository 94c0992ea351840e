// What to fetch before it is needed, and how urgently: thesis 5.2.2 ("Prefetching scheme"), for the
// cells of all levels and for the levels of near meshes. GL thread only; never allocates once made.
#pragma once
#include "camera.h"
#include "store.h"

// The timestamp: it advances by 1 whenever the viewer has moved or turned that far.
#define HW_PREFETCH_MOVE     0.1 // cell sizes
#define HW_PREFETCH_TURN_RAD 0.2

// How the viewer moves and looks.
typedef struct hw_prefetch_view {
    hw_vec3 eye, aim;    // aim: horizontal, unit length
    hw_vec3 motion;      // horizontal, unit length; zero if the viewer stands
    double speed;        // units a second
    double half_fov_rad; // horizontal
} hw_prefetch_view;

// Priority in [0, 1) of a hexagon of the view space with this centre and this distance to the
// viewer (0: inside), in units of the cell size. Higher for what is closer, lies in the direction
// of motion, near the aiming vector, within the view frustum.
double hw_prefetch_priority(const hw_prefetch_view *view, hw_vec3 centre, double distance,
                            double cell_size);
// The point of a level-0 cell's hexagon that is closest to `from` (its own z); `from` if it is
// inside.
hw_vec3 hw_prefetch_entry(const hw_hexgrid *grid, hw_cell_id id, hw_vec3 from);

// How far a level-0 cell is for a viewer who goes on as he does: the distance from the point of his
// path that is closest to it, and half of the way there.
double hw_prefetch_distance(const hw_prefetch_view *view, const hw_hexgrid *grid, hw_cell_id id);

typedef struct hw_prefetch hw_prefetch;
// Borrows store and manifest. stretch: per object, the factor by which its transform stretches
// lengths. crossing_width: of the strips in which cells dissolve into each other (crossing.h).
HW_MUST_USE hw_status hw_prefetch_create(hw_store *store, const hw_manifest *manifest,
                                         const float *stretch, double crossing_width,
                                         hw_prefetch **out);
void hw_prefetch_destroy(hw_prefetch *prefetch);
// Once a frame, after hw_store_begin_frame: follows the viewer, and wishes for what it may need.
void hw_prefetch_update(hw_prefetch *prefetch, const hw_camera *camera, double now_s);
// The tolerance that frames choose levels by, px: the dataset's at first, a larger one where a
// budget of triangles asks for it.
void hw_prefetch_set_error(hw_prefetch *prefetch, double error_px);
// Wishes for a level that a frame lacks, before all else; for a coarser one if it does not fit on
// the GPU beside what is in use.
void hw_prefetch_urge(hw_prefetch *prefetch, hw_data_key key);

// The coarsest level whose surface error at this distance is at most the dataset's tolerance.
uint32_t hw_prefetch_level(const hw_mesh_table *table, double near_error_px, double focal_px,
                           double stretch, double distance);
