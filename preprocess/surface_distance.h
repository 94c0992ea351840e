// K_metro: distances from one surface to another as Metro measures them (Cignoni, Rocchini and
// Scopigno 1998, section 3), sampled until the mean is known well enough.
#pragma once
#include "rays.h"

// Independent samples of one surface, whose means tell how far their common mean can be trusted.
#define HW_DISTANCE_REPLICATES 16

// Zero means the default.
typedef struct hw_distance_options {
    double tolerance;     // standard error of the mean to reach, as a share of the mean; 0: 0.005
    uint64_t samples_max; // per side, rounded up to a multiple of 16; 0: 4 Mi
    uint64_t seed;        // the same points for the same seed, with any number of threads
    uint32_t threads;     // 0: one per processor
} hw_distance_options;

// In the mesh's units. Closest points are single precision: a distance is right to about 4e-7 of
// the largest coordinate (`floor`), and what lies below is rounding.
typedef struct hw_surface_distance {
    double max;            // over the samples and all vertices in use
    double mean, rms;      // over the samples
    double standard_error; // of the mean: the replicates' deviation / sqrt(16)
    double floor;
    uint64_t samples;
    bool converged; // the standard error is within the tolerance, or the mean is below the floor
} hw_surface_distance;

// From points of one mesh to the closest point of the other (one side of Metro; call it both ways).
// Both are hw_rays_create_mesh. Area-weighted stratified samples, drawn in rounds that double their
// number until the standard error is within the tolerance or the cap is reached. options may be
// NULL. HW_USAGE where either mesh has no triangle or the sampled one no area. Thread-safe.
HW_MUST_USE hw_status hw_surface_distance_measure(const hw_rays *from, const hw_rays *to,
                                                  const hw_distance_options *options,
                                                  hw_surface_distance *out);
// The distance of each vertex of `mesh` (in use or not) to the surface; `out` holds vertex_count.
HW_MUST_USE hw_status hw_vertex_distances(const hw_mesh *mesh, const hw_rays *to, uint32_t threads,
                                          float *out);
