// Fits the vertices of a simplified mesh to its original: least squares of the distances both ways,
// connectivity held (the vertex part of Hoppe, DeRose, Duchamp, McDonald and Stuetzle, Mesh
// Optimization, 1993, with distances to planes). Greedy collapses place each vertex once and for
// all; after the last one, all of them can still be moved together.
#pragma once
#include "rays.h"

typedef struct hw_fit_options {
    uint32_t rounds;  // of closest points and one solution each; 0: none
    uint32_t samples; // of the original's surface, per face of the mesh; 0 = 6
    uint32_t threads; // 0 = default; the result does not depend on it
} hw_fit_options;

// `original` is hw_rays_create_mesh. Moves positions alone, so normals must be recomputed; the
// enclosed volume stays as it is, to first order. A vertex
// whose step would turn a face by more than 60 degrees stays.
HW_MUST_USE hw_status hw_fit(hw_mesh *mesh, const hw_rays *original, const hw_fit_options *options);
