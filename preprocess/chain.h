// The chain of a mesh: levels of detail made once, each with its measured errors. Far objects are
// cut out of them per cell, near objects are drawn with them.
#pragma once
#include "mesh.h"
#include "mesh_file.h"

// levels[0] is the original. Each further level has about 2^(-1/4) times the faces of the one
// before; errors never fall with the level. Levels carry positions, normals recomputed from their
// own geometry, and colours taken from the closest point of the original, or both fitted to the
// original's (fit_shading.h). A mesh with uvs has no further levels to draw (seams cannot be kept),
// but its levels still serve as geometry of stand-ins.
typedef struct hw_chain {
    uint32_t level_count;
    hw_mesh *levels;
    hw_mesh_level_info *infos;
} hw_chain;

typedef struct hw_chain_options {
    uint32_t face_floor;    // coarsest level; 0 = 40
    float importance_floor; // of silhouette importance; 0 = 0.05, 1 switches it off
    float pull_back; // each vertex's way back to the closest point of the original; negative = 0.25
    uint32_t shade_step; // every so many-th level is to be drawn: its shading is fitted; 0: none
    uint32_t threads;    // 0 = default
} hw_chain_options;

// Near objects are drawn with every so many-th level.
#define HW_NEAR_LEVEL_STRIDE 2u

// Memoryless quadrics weighted by silhouette importance, free placement; vertices of a snapshot are
// pulled back towards the original.
HW_MUST_USE hw_status hw_chain_make(const hw_mesh *mesh, const hw_chain_options *options,
                                    hw_chain *out);
void hw_chain_free(hw_chain *chain);
// The coarsest level whose outline deviation / surface error (99th percentile) is at most the bound
// (mesh units). 0 if none but the original is.
uint32_t hw_chain_level_by_silhouette(const hw_chain *chain, double bound);
uint32_t hw_chain_level_by_error(const hw_chain *chain, double bound);
// The same by hw_mesh_level_error, of every `stride`-th level.
uint32_t hw_chain_level_to_draw(const hw_chain *chain, uint32_t stride, double bound);
