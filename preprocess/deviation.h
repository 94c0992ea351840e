// How far a simplified level lies from its original: as surfaces, and as outlines against the sky.
#pragma once
#include "rays.h"

typedef struct hw_deviation {
    float rms, max, mean; // in the mesh's units
    float p99;            // the distance that 99 in 100 points stay within
    float shading; // RMS difference of what is drawn there, of a white material's 1; see below
} hw_deviation;

// Two-sided distance between surfaces, as in Metro (Cignoni et al. 1998): `samples` (0: 10000)
// area-weighted points on each surface to the closest point of the other; the larger of both sides'
// figures. `max` also takes each side's vertices into account, those of at most `samples` triangle
// corners, evenly by index. A seed gives the same points everywhere.
//
// What is drawn at a point is the mesh's colour, channel by channel, in the light of appearance.h,
// from eight sides at that light's height, made at the vertices and interpolated; points whose
// closest one faces the other way have no say. 0 unless both meshes have normals.
//
// `original_rays` is hw_rays_create_mesh(original). Thread-safe for any levels of one original.
// HW_USAGE if a mesh has no triangle. Meshes without area are sampled by their vertices alone.
HW_MUST_USE hw_status hw_surface_deviation(const hw_rays *original_rays, const hw_mesh *original,
                                           const hw_mesh *level, uint32_t samples, uint32_t seed,
                                           hw_deviation *out);

// The filled outlines of an original from a set of horizontal directions.
typedef struct hw_outline hw_outline;

// `views` (0: 8) orthographic views, horizontal, evenly over the half circle (the other half sees
// mirror images), none along x or y; each raster of `resolution` x `resolution` (0: 1024,
// rounded up to a multiple of 64, at most 8192) fits the original's outline with a
// margin of 1/16. Memory: views * resolution^2 / 8 bytes. HW_USAGE if the original has no triangle
// or no extent.
HW_MUST_USE hw_status hw_outline_create(hw_outline **out, const hw_mesh *original, uint32_t views,
                                        uint32_t resolution);
void hw_outline_destroy(hw_outline *outline);

// Mean absolute distance between the outlines of the original and of a level, in the mesh's units:
// per view the area that only one of the two covers, over the length of the original's outline;
// averaged over the views. Both are rasters of one sample a pixel, so far smaller distances than a
// pixel show, by their share of samples (standard error about sqrt(pixel * distance / length)).
// Thread-safe. A level's area outside the margin does not count.
HW_MUST_USE hw_status hw_outline_deviation(const hw_outline *outline, const hw_mesh *level,
                                           float *out);
// Length of the original's outline, averaged over the views, and the mean size of a pixel; units of
// the mesh. For tests and reports.
float hw_outline_length(const hw_outline *outline);
float hw_outline_pixel(const hw_outline *outline);
