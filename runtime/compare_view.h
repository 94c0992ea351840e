// Two renderers' pictures of the same view in one: side by side with a seam, or as a map of their
// differences. GL thread only.
#pragma once
#include "renderer.h"

typedef enum hw_compare_mode { HW_COMPARE_SPLIT, HW_COMPARE_ERRORS } hw_compare_mode;

// Luma difference, of 255, at the end of the colour ramp.
#define HW_COMPARE_SCALE 32

typedef struct hw_compare_desc {
    hw_compare_mode mode;
    hw_renderer *left, *right; // errors: of the left one, the right one is the truth
    const hw_camera *camera;
    uint32_t samples; // 1 or 4
    double seam;      // 0 (left edge) to 1
    bool measure;     // fill psnr, which reads both pictures back
} hw_compare_desc;

typedef struct hw_compare_result {
    hw_frame_stats stats; // of the left picture
    double psnr;          // on luma; infinite for equal pictures
} hw_compare_result;

typedef struct hw_compare_view hw_compare_view;
HW_MUST_USE hw_status hw_compare_view_create(hw_compare_view **out);
void hw_compare_view_destroy(hw_compare_view *view);
// Draws into the bound framebuffer, of the camera's size.
HW_MUST_USE hw_status hw_compare_view_draw(hw_compare_view *view, const hw_compare_desc *desc,
                                           hw_compare_result *out);
// The ramp's colour at t in [0, 1]: blue, green, yellow, red.
void hw_compare_error_color(double t, float rgb[3]);
