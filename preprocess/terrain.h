// Height fields as triangles: few vertices, each where the field needs one most (greedy insertion,
// Garland and Heckbert, Fast Polygonal Approximation of Terrains and Height Fields, 1995), and
// their heights then by least squares.
#pragma once
#include "status.h"
#include <stdint.h>

// Sample (i, j), element j * width + i, lies at (i + 0.5, j + 0.5).
typedef struct hw_height_field {
    uint32_t width, height;
    const float *heights;    // NAN: there is nothing to be met there
    const float *tolerances; // how far the surface may be off, > 0; where heights has a number
} hw_height_field;

// Heights are linear over each triangle. Triangles are counter-clockwise.
typedef struct hw_terrain {
    uint32_t vertex_count, triangle_count;
    double (*vertices)[3];
    uint32_t (*triangles)[3];
    double mean_error; // of the samples in the triangles: their distance in height over the
                       // tolerance, cut off at HW_TERRAIN_ERROR_MAX
} hw_terrain;
#define HW_TERRAIN_ERROR_MAX 4.0

// Triangulates a convex counter-clockwise polygon of at least three corners, no three in one line,
// with vertices at its corners and at samples inside of it: as many as are needed for each sample
// to be met within its tolerance, but no more than vertices_max altogether, if there are fewer
// corners than that. Triangles without a sample to be met in them, or closer than one step to them,
// are left out. Fails only for want of memory; on failure *out is zeroed.
HW_MUST_USE hw_status hw_terrain_fit(const hw_height_field *field, const double (*polygon)[2],
                                     uint32_t corner_count, uint32_t vertices_max, hw_terrain *out);
void hw_terrain_free(hw_terrain *terrain);
