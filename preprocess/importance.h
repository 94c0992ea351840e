// How often a vertex stands on a silhouette seen from the side: weights for error quadrics, made
// once per mesh.
#pragma once
#include "rays.h"

typedef struct hw_importance_options {
    uint32_t lines; // tangent lines a vertex, evenly spread; 0 = 32
    float floor;    // the least importance, in [0, 1]
    float power;    // of the free fraction; 0 = 1. Above 1 what rarely shows counts less
    // Lines up to this elevation count, 0 < elevation <= 90; z is up. Walkers look about
    // horizontally.
    double elevation_degrees;
    uint32_t threads; // 0 = default; the result does not depend on it
} hw_importance_options;

#define HW_IMPORTANCE_WALKER_DEGREES 15.0

// out[vertex_count], each in [floor, 1]: the larger of `floor` and a power of the fraction of
// tangent lines at the vertex (perpendicular to its normal, within the elevation) that leave the
// object both ways without meeting it, started 1e-3 of the bounding box's diagonal off the surface
// along the normal. 1 on the outside of a convex mesh, 0 within a cavity. A vertex without a normal
// (length 0) gets `floor`.
//
// `rays` is hw_rays_create_mesh(mesh) and `mesh` has normals (HW_USAGE if not).
HW_MUST_USE hw_status hw_silhouette_importance(const hw_mesh *mesh, const hw_rays *rays,
                                               const hw_importance_options *options, float *out);
