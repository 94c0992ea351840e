// Tests that hold for every view point of a cell (thesis 5.2.1).
#pragma once
#include "hexgrid.h"

// Distances from a cell (as a prism) and its centre to a box.
typedef struct hw_region_distance {
    double nearest;   // least distance from any point of the prism to the box; 0 if they meet
    double farthest;  // an upper bound on the largest distance from a point of the prism to the
                      // box's nearest point
    double effective; // d_eff: 1 / d_eff^2 = mean of 1 / d^2 over the cell, d to the box's centre,
                      // at least `nearest`; taken at 54 points of the hexagon at half height (the
                      // centroids of equal triangles)
    double centre;    // from the cell centre to the box (0 inside)
} hw_region_distance;
// `nearest` alone.
double hw_region_nearest(const hw_hexgrid *grid, hw_cell_id id, hw_box box);
hw_region_distance hw_region_distance_to(const hw_hexgrid *grid, hw_cell_id id, hw_box box);

// True if the prism and the box meet.
bool hw_cell_meets_box(const hw_hexgrid *grid, hw_cell_id id, hw_box box);

// How a triangle faces a set of corners. A triangle that is back-facing to all corners is
// back-facing to every point of their convex hull (thesis 5.2.1, regional back-face culling; the
// signed distance to its plane is linear).
typedef enum hw_facing { HW_FACING_BACK, HW_FACING_MIXED, HW_FACING_FRONT } hw_facing;
// a, b, c counter-clockwise seen from the front. Degenerate triangles (and planes through a corner)
// count as mixed.
hw_facing hw_triangle_facing(hw_vec3 a, hw_vec3 b, hw_vec3 c, const hw_vec3 *corners,
                             uint32_t corner_count);

// s = sqrt(3) c l / (2 d (d + l)) * image_res in pixels; c cell size, d distance of the object from
// the cell centre, l the object's own depth seen from there (thesis 5.2.1, self-occluding-error
// test). d <= 0 gives +inf.
double hw_self_occluding_error(double cell_size, double distance, double depth, double image_res);
