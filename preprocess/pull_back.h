// What a simplified mesh takes from its original once it is made: a part of the way back to its
// surface, and its colours.
#pragma once
#include "rays.h"

// What worked best on statues: free placement of area-weighted quadrics leaves vertices outside
// their surface; a quarter of the way back halves that bias without denting what is between them.
#define HW_PULL_BACK 0.25f

// Each vertex goes `part` (0 to 1) of its way to the closest point of the original, whose rays
// (hw_rays_create_mesh) are given. Colours are those of that point, none if the original has none.
// Normals and uvs stay as they are. `threads` 0 = default; the result does not depend on it.
HW_MUST_USE hw_status hw_pull_back(hw_mesh *mesh, const hw_mesh *original, const hw_rays *rays,
                                   float part, uint32_t threads);
