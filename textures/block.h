// Block compression, 4x4 pixels in 8 bytes: BC1 (DXT1) for opaque colours, BC4 for one channel. A
// BC4 block followed by a BC1 block is a BC3 (DXT5) block. Encoding by stb_dxt; decoding is ours
// (no library has it in C).
#pragma once
#include "image.h"

// Bytes of a BC1 image: (width/4) * (height/4) * 8; sides are multiples of 4.
size_t hw_bc1_bytes(uint32_t width, uint32_t height);
// image: 3 or 4 channels, sides multiples of 4; out holds hw_bc1_bytes. The blocks mean the same as
// BC1 and within BC3. Deterministic. Thread-safe.
void hw_bc1_encode(const hw_image *image, uint8_t *out);
// As many bytes as BC1. `channel` of the image is encoded.
void hw_bc4_encode(const hw_image *image, uint32_t channel, uint8_t *out);

size_t hw_bc3_bytes(uint32_t width, uint32_t height); // sides are multiples of 4
// `bytes` of BC3 out of half as many each of BC1 and of BC4, the alpha.
void hw_bc3_join(const uint8_t *bc1, const uint8_t *bc4, size_t bytes, uint8_t *out);
// Into RGBA of width * height * 4 bytes: colours bit-exact with the reference decoder (always four
// in a block, as graphics cards have them in BC3), alpha within 1 of the exact interpolation.
void hw_bc3_decode(const uint8_t *blocks, uint32_t width, uint32_t height, uint8_t *rgba);
