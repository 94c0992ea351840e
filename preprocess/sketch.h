// Sketches: what a capture will tell of an object's outline and depth, drawn from a level of
// detail. They cost little beside rays and serve to find out whether these are worth casting.
#pragma once
#include "svmesh.h"

// Coverage and depths (NULL: colours) of a mesh whose vertices lie at `points`, world space.
// Coverage counts 4 x 4 points of a texel; depths are those at centres of texels, INFINITY where
// these are not covered. Both sides of triangles show. All points must lie in front of the plane
// through the window's centre.
HW_MUST_USE hw_status hw_sketch(const hw_mesh *mesh, const hw_vec3 *points,
                                const hw_capture_window *window, hw_capture *out);
