// Filled outlines: square rasters of one bit a pixel, for how far two outlines lie apart.
#pragma once
#include <stdint.h>

// `size` rows of size / 64 words, from y = 0 up; bit x % 64 of word x / 64. size is a multiple of
// 64. Pixel (x, y) is set if its centre (x + 0.5, y + 0.5) is covered.
typedef struct hw_point2 {
    float x, y;
} hw_point2;

// Sets the pixels whose centres lie in the triangle (half-open to the right and upwards), so that
// triangles which share a side leave no gap. What lies outside the raster does not count.
void hw_raster_fill_triangle(uint64_t *bits, uint32_t size, hw_point2 a, hw_point2 b, hw_point2 c);
// Length of the border of the set pixels, in pixels, by the Cauchy-Crofton formula over lines in
// four directions: pi / (2 * 4) times the sum of (spacing of the lines * crossings). Exact on
// average over all orientations of a border, within 6 % for straight ones at the worst angle. The
// outermost rows and columns must be empty.
double hw_raster_border_length(const uint64_t *bits, uint32_t size);
// How many pixels are set in one of the two only.
uint64_t hw_raster_difference(const uint64_t *a, const uint64_t *b, uint32_t size);
