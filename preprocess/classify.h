// Categories of a depth image's pixels (thesis 5.2.1, "Categorizing pixels on the depth image"),
// from which the thesis's simplification takes its vertex weights.
#pragma once
#include "status.h"
#include <stdint.h>

typedef enum hw_category {
    HW_CATEGORY_BACKGROUND,
    HW_CATEGORY_INTERIOR,
    HW_CATEGORY_SHARP_EDGE,          // C1 discontinuity
    HW_CATEGORY_INTERIOR_SILHOUETTE, // C0 discontinuity, its near side
    HW_CATEGORY_EXTERIOR_SILHOUETTE, // borders on the background
    HW_CATEGORY_COUNT
} hw_category;

// The thesis states T_C0 = 3.4e-4 and T_C1 = 1.28e-4 in units of its depth buffer,
//     z_b = f / (f - n) (1 - n / z),    dz_b = f n / (f - n) d(1 / z),
// without n, f or the distance. Ours are relative to the pixel's eye distance z,
//     dz / z = dz_b z (f - n) / (f n),
// and the defaults are the thesis's at n = 43.3 (the faces of its cell of size 50 lie at
// 50 sqrt(3) / 2), f = 2600 (the diagonal of its park) and z = 400 (eight cells away: its figure
// 5.4): 3.09e-3 and 1.16e-3.
#define HW_THESIS_T_C0 3.4e-4
#define HW_THESIS_T_C1 1.28e-4
#define HW_THESIS_NEAR 43.3
#define HW_THESIS_FAR  2600.0
#define HW_THESIS_Z    400.0

// A tolerance in depth-buffer units as one relative to the eye distance z.
double hw_classify_relative(double buffer_tolerance, double near, double far, double z);

typedef struct hw_classify_options {
    float t_c0, t_c1; // relative to the pixel's eye distance; 0 = the defaults above
} hw_classify_options;

// Categorises width x height depths (along the viewing axis, positive; INFINITY = background) into
// `categories` (hw_category, width * height of them). The first that holds, with neighbours above,
// below, left and right:
//   exterior silhouette  a neighbour is background; beyond the image's border is background too (a
//                        capture's window holds the whole object)
//   interior silhouette  a neighbour lies farther by more than t_c0
//   sharp edge           the steps to two opposite neighbours differ by more than t_c1
//   interior             the rest
// Like the thesis's depth buffer, steps are of 1 / z (times the pixel's z, hence relative), in
// which the second difference of a plane is zero however it slants. options NULL = defaults.
HW_MUST_USE hw_status hw_classify(const float *depths, uint32_t width, uint32_t height,
                                  const hw_classify_options *options, uint8_t *categories);

// 0.5, 0.4, 0.25 and 0.125 for exterior silhouette, interior silhouette, sharp edge and interior; 0
// for background (and for what is no category).
float hw_category_weight(uint8_t category);
