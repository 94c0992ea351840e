// How often a vertex stands on a silhouette seen from the side: weights for error quadrics, made
// once per mesh.
#pragma once
#include "rays.h"

// Walkers look about horizontally: tangent lines up to this elevation count.
#define HW_IMPORTANCE_ELEVATION_DEGREES 15.0

// out[vertex_count], each in [floor, 1]: the larger of `floor` and the fraction of near-horizontal
// tangent lines at the vertex (perpendicular to its normal, at most 15 degrees above or below the
// horizon; z is up) that leave the object both ways without meeting it, started 1e-3 of the
// bounding box's diagonal off the surface along the normal. 1 on the outside of a convex mesh, 0
// within a cavity. A vertex without a normal (length 0) gets `floor`.
//
// `rays` is hw_rays_create_mesh(mesh) and `mesh` has normals (HW_USAGE if not). `samples` lines a
// vertex, evenly spread (0: 32); floor in [0, 1]. `threads` 0 = default; the result does not depend
// on it.
HW_MUST_USE hw_status hw_silhouette_importance(const hw_mesh *mesh, const hw_rays *rays,
                                               uint32_t samples, float floor, uint32_t threads,
                                               float *out);
