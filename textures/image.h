// 8-bit images in memory.
#pragma once
#include "status.h"
#include <stdint.h>

// Row 0 is the top. Pixel (x, y), channel k: data[((size_t)y * width + x) * channels + k].
// Display-referred values; no colour management anywhere in Hexwalk.
typedef struct hw_image {
    uint32_t width, height, channels; // channels: 1, 3 or 4
    uint8_t *data;
} hw_image;

// Zeroed pixels. Sides from 1 to 32768. Free with hw_image_free.
HW_MUST_USE hw_status hw_image_make(hw_image *out, uint32_t width, uint32_t height,
                                    uint32_t channels);
// Frees the pixels and zeroes the struct; NULL and zeroed images are legal.
void hw_image_free(hw_image *image);
// Flips rows in place (GL reads bottom-up).
void hw_image_flip(hw_image *image);
