// Area-weighted random points on a mesh, stratified: the k-th of n points lies in the k-th of n
// equal parts of the triangles' running area.
#pragma once
#include "mesh.h"
#include "rng.h"

// Read-only once made: any number of walks on any threads.
typedef struct hw_surface_sampler {
    const hw_mesh *mesh; // borrowed
    double area;         // of the whole mesh
    double *running;     // per triangle: area up to and with it
} hw_surface_sampler;

// The mesh has a triangle at least. On failure *out is zeroed.
HW_MUST_USE hw_status hw_surface_sampler_make(const hw_mesh *mesh, hw_surface_sampler *out);
void hw_surface_sampler_free(hw_surface_sampler *sampler);

typedef struct hw_surface_walk {
    const hw_surface_sampler *sampler;
    uint64_t next, count;
    uint32_t triangle;
    hw_rng rng;
} hw_surface_walk;

// `count` points; the generator makes the same ones everywhere. None on a mesh without area.
hw_surface_walk hw_surface_walk_start(const hw_surface_sampler *sampler, uint64_t count,
                                      hw_rng rng);
// False when all points were given.
bool hw_surface_walk_next(hw_surface_walk *walk, hw_vec3 *out);
