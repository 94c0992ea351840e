// A convex polygon of few corners round the set pixels of a mask.
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stdint.h>

// Pixel (x, y), element y * width + x, is the square from (x, y) to (x + 1, y + 1). *out holds the
// corners, counter-clockwise, no three in one line; free with hw_free. None, and *out = NULL, if no
// pixel is set. All set pixels lie within, and it within the mask. Corners are taken away as long
// as the polygon grows by little for each: a corner is a triangle, area is pixels.
HW_MUST_USE hw_status hw_outer_hull(const bool *mask, uint32_t width, uint32_t height,
                                    double (**out)[2], uint32_t *corner_count);
