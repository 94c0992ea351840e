// Cuts a triangle mesh into sheets: afterwards every edge has at most two faces, of opposite
// winding, wherever that can be had by giving vertices several copies. Positions are not moved.
#pragma once
#include "status.h"
#include <stdint.h>

typedef struct hw_split {
    uint32_t vertex_count;
    uint32_t *source;  // per vertex: the vertex it is a copy of; the first ones are the originals
    uint32_t *indices; // of all faces; those of pairs that enclose nothing (same vertices, opposite
                       // windings) are UINT32_MAX
} hw_split;

// Faces with bad indices are carried over untouched. O(n) for bounded degrees.
HW_MUST_USE hw_status hw_split_sheets(const double (*positions)[3], uint32_t vertex_count,
                                      const uint32_t *indices, uint32_t face_count, hw_split *out);
void hw_split_free(hw_split *split);
