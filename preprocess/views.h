// How different two meshes look, from all around: K_L1, K_L2 and K_sil over 42 views (Southern,
// Marais and Blake 2001, after the image-driven simplification of Lindstrom and Turk 2000).
//
// The views look along the vertices of a once subdivided icosahedron at the original's centre,
// orthographically, on 512 x 512 pixels of one sample. Surfaces are white and smooth-shaded from
// area-weighted vertex normals by the light of appearance.h, but with the light at the viewer: a
// light that stands still would leave half of the views in the flat ambient term, where no change
// of shape shows. Both sides of a surface are lit and cover. The background is black, so that an
// outline stands out by the ambient term at least.
#pragma once
#include "rays.h"

#define HW_VIEW_COUNT 42
#define HW_VIEW_SIZE  512

// Unit vectors from the mesh towards the viewer.
void hw_view_directions(hw_vec3 out[HW_VIEW_COUNT]);

// What every picture shows: the square of this half side around the centre.
typedef struct hw_view_frame {
    hw_vec3 centre;
    float half_side;
} hw_view_frame;

// The centre of the original's box, and the sphere there that holds the original with a margin of
// 1/32; grown where `other` (may be NULL) leaves that. So all meshes within the margin share the
// frame of the original alone.
hw_view_frame hw_view_frame_fit(const hw_mesh *original, const hw_mesh *other);

// The original's pictures. Memory: 44 MB.
typedef struct hw_views hw_views;

// `original` is hw_rays_create_mesh, borrowed. threads 0: one per processor. HW_USAGE if the mesh
// has no triangle or the frame no extent.
HW_MUST_USE hw_status hw_views_create(hw_views **out, const hw_rays *original, hw_view_frame frame,
                                      uint32_t threads);
void hw_views_destroy(hw_views *views);
// Intensities in [0, 1], top row first; negative where the original does not cover the pixel.
const float *hw_views_picture(const hw_views *views, uint32_t view);

// Each the average over the views. A view where the original covers no pixel counts for the
// outline alone. NaN if no view has any.
typedef struct hw_view_errors {
    double l1;               // sum of |I1 - I2| over the pixels the original covers
    double l2;               // sqrt(sum of (I1 - I2)^2 over the same number)
    double silhouette;       // pixels that only one of both covers
    double silhouette_share; // the same over the pixels the original covers, summed over all views
    double model_pixels;     // pixels that the original covers
} hw_view_errors;

// The original's pictures against those of `other` (hw_rays_create_mesh). Only what is in the frame
// counts: HW_USAGE if `other` leaves it. The same figures with any number of threads; thread-safe.
HW_MUST_USE hw_status hw_views_compare(const hw_views *views, const hw_rays *other,
                                       uint32_t threads, hw_view_errors *out);
