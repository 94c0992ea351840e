// The space a mesh takes up, as a grid of cubes: for keeping a walker out of it. Coarse by intent.
#pragma once
#include "mesh.h"

#define HW_SOLID_SIDE_MAX 128 // cubes along an axis

typedef struct hw_solid {
    hw_vec3 origin; // lower corner of cube (0, 0, 0), in the mesh's space
    double side;    // of a cube
    int32_t count[3];
    uint64_t *bits; // x fastest
} hw_solid;

// Cubes that the surface passes through, and those that it encloses. `side` (> 0) grows until no
// axis has more than HW_SOLID_SIDE_MAX cubes. A cube that a triangle only grazes may be left out,
// but never so that a path from cube to neighbouring cube leads through the surface. The mesh is
// valid. On failure *out is zeroed.
HW_MUST_USE hw_status hw_solid_make(hw_solid *out, const hw_mesh *mesh, double side);
// Frees and zeroes; NULL is legal.
void hw_solid_free(hw_solid *solid);
// Whether the cube is taken; indices within count.
static inline bool hw_solid_has(const hw_solid *solid, int32_t x, int32_t y, int32_t z)
{
    size_t i =
        ((size_t)z * (size_t)solid->count[1] + (size_t)y) * (size_t)solid->count[0] + (size_t)x;
    return solid->bits[i / 64] >> i % 64 & 1;
}
// Centre of a cube, in the mesh's space.
static inline hw_vec3 hw_solid_centre(const hw_solid *solid, int32_t x, int32_t y, int32_t z)
{
    return hw_v3((float)(solid->origin.x + (x + 0.5) * solid->side),
                 (float)(solid->origin.y + (y + 0.5) * solid->side),
                 (float)(solid->origin.z + (z + 0.5) * solid->side));
}
