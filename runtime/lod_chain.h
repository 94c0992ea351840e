// Discrete levels of detail as people make them today: meshoptimizer's simplifier, each level about
// half of the one before, always from the original (configuration L). lod_chain.c is the only file
// of the run time that includes meshoptimizer. No GL; thread-safe.
#pragma once
#include "mesh.h"

#define HW_LOD_LEVELS_MAX 24

typedef struct hw_lod_level {
    hw_mesh mesh; // compact vertices, cache-optimised indices
    float error;  // meshoptimizer's, in mesh units; 0 for the original; never falling
} hw_lod_level;

typedef struct hw_lod_chain {
    uint32_t count; // at least 1; level 0 is the original
    hw_lod_level levels[HW_LOD_LEVELS_MAX];
} hw_lod_chain;

// On failure *out is zeroed. Free with hw_lod_chain_free.
HW_MUST_USE hw_status hw_lod_chain_make(const hw_mesh *mesh, hw_lod_chain *out);
void hw_lod_chain_free(hw_lod_chain *chain);
// The coarsest level whose error is at most `error` (mesh units); 0 if none.
uint32_t hw_lod_chain_choose(const float *errors, uint32_t count, double error);

// A mesh of the triangles `indices` (index_count of them, into mesh's vertices), in an order that
// suits the vertex cache, with only the vertices they use, in the order of their use. Meshes
// without normals get smooth ones.
HW_MUST_USE hw_status hw_mesh_reorder(const hw_mesh *mesh, const uint32_t *indices,
                                      uint32_t index_count, hw_mesh *out);
