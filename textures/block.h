// BC1 (DXT1) block compression: 4x4 pixels in 8 bytes, opaque. Encoding by stb_dxt; decoding is
// ours (no library has it in C).
#pragma once
#include "image.h"

// Bytes of a BC1 image: (width/4) * (height/4) * 8; sides are multiples of 4.
size_t hw_bc1_bytes(uint32_t width, uint32_t height);
// image: 3 or 4 channels, sides multiples of 4; out holds hw_bc1_bytes. Deterministic. Thread-safe.
void hw_bc1_encode(const hw_image *image, uint8_t *out);
// Into RGBA (alpha 255) of width * height * 4 bytes, bit-exact with the reference decoder of the
// format.
void hw_bc1_decode(const uint8_t *blocks, uint32_t width, uint32_t height, uint8_t *rgba);
