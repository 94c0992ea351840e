// Ambient occlusion, baked into vertex colours once per mesh.
#pragma once
#include "mesh.h"

// Multiplies each vertex colour (allocated white if NULL) by the cosine-weighted fraction of
// `rays_per_vertex` (0: 256) rays over the upper hemisphere of its normal that leave the mesh; a
// ray that leaves downwards meets the ground and counts half. Deterministic; `threads` 0 = default.
HW_MUST_USE hw_status hw_ambient_bake(hw_mesh *mesh, uint32_t rays_per_vertex, uint32_t threads);
