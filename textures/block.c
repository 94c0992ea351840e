#include "block.h"
#include <assert.h>
#include <string.h>

// stb_dxt 1.12: constant tables only, no global initialisation, so that any thread may encode.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wcast-qual"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wundef"
#define STB_DXT_IMPLEMENTATION
#define STB_DXT_STATIC
#include <stb/stb_dxt.h>
#pragma GCC diagnostic pop

#define BLOCK_BYTES 8u

size_t hw_bc1_bytes(uint32_t width, uint32_t height)
{
    return (size_t)(width / 4) * (height / 4) * BLOCK_BYTES;
}

static void gather_block(const hw_image *image, uint32_t x, uint32_t y, uint8_t rgba[64])
{
    for (uint32_t i = 0; i < 16; i++) {
        size_t pixel = (size_t)(y + i / 4) * image->width + x + i % 4;
        memcpy(rgba + (size_t)i * 4, image->data + pixel * image->channels, 3);
        rgba[i * 4 + 3] = 255;
    }
}

void hw_bc1_encode(const hw_image *image, uint8_t *out)
{
    assert(image->channels >= 3 && image->width % 4 == 0 && image->height % 4 == 0);
    uint8_t rgba[64];
    for (uint32_t y = 0; y < image->height; y += 4) {
        for (uint32_t x = 0; x < image->width; x += 4) {
            gather_block(image, x, y, rgba);
            stb_compress_dxt_block(out, rgba, 0, STB_DXT_HIGHQUAL);
            out += BLOCK_BYTES;
        }
    }
}

// 5:6:5 to 8 bits a channel by repeating the high bits.
static void expand_565(uint32_t c, uint8_t rgb[3])
{
    uint32_t r = c >> 11 & 31, g = c >> 5 & 63, b = c & 31;
    rgb[0] = (uint8_t)(r << 3 | r >> 2);
    rgb[1] = (uint8_t)(g << 2 | g >> 4);
    rgb[2] = (uint8_t)(b << 3 | b >> 2);
}

// The four colours of a block (EXT_texture_compression_s3tc): two thirds in between, whichever of
// the two is the larger; a half and black there are in BC1 alone, not in BC3. Divisions of the
// 8-bit values truncate, as in Mesa's and Microsoft's reference decoders.
static void block_palette(const uint8_t *block, uint8_t palette[4][3])
{
    uint32_t c0 = block[0] | (uint32_t)block[1] << 8, c1 = block[2] | (uint32_t)block[3] << 8;
    expand_565(c0, palette[0]);
    expand_565(c1, palette[1]);
    for (int k = 0; k < 3; k++) {
        uint32_t a = palette[0][k], b = palette[1][k];
        palette[2][k] = (uint8_t)((2 * a + b) / 3);
        palette[3][k] = (uint8_t)((a + 2 * b) / 3);
    }
}

// The colours of four rows of four pixels of RGBA; the rows are `pitch` bytes apart.
static void decode_colors(const uint8_t *block, size_t pitch, uint8_t *rgba)
{
    uint8_t palette[4][3];
    block_palette(block, palette);
    for (uint32_t i = 0; i < 16; i++) {
        uint32_t code = block[4 + i / 4] >> (i % 4 * 2) & 3;
        memcpy(rgba + i / 4 * pitch + (size_t)(i % 4) * 4, palette[code], 3);
    }
}

void hw_bc4_encode(const hw_image *image, uint32_t channel, uint8_t *out)
{
    assert(channel < image->channels && image->width % 4 == 0 && image->height % 4 == 0);
    uint8_t values[16];
    for (uint32_t y = 0; y < image->height; y += 4) {
        for (uint32_t x = 0; x < image->width; x += 4, out += BLOCK_BYTES) {
            for (uint32_t i = 0; i < 16; i++) {
                size_t pixel = (size_t)(y + i / 4) * image->width + x + i % 4;
                values[i] = image->data[pixel * image->channels + channel];
            }
            stb_compress_bc4_block(out, values);
        }
    }
}

// The eight values of a block (EXT_texture_compression_rgtc, red): v0 > v1 gives sixths in between,
// else fifths, 0 and 255.
static void block_values(const uint8_t *block, uint8_t values[8])
{
    uint32_t v0 = block[0], v1 = block[1], steps = v0 > v1 ? 7 : 5;
    values[0] = block[0];
    values[1] = block[1];
    values[6] = 0;
    values[7] = 255;
    for (uint32_t k = 1; k < steps; k++)
        values[k + 1] = (uint8_t)((v0 * (steps - k) + v1 * k + steps / 2) / steps);
}

// The alpha of the same.
static void decode_values(const uint8_t *block, size_t pitch, uint8_t *rgba)
{
    uint8_t values[8];
    uint64_t codes = 0;
    block_values(block, values);
    for (uint32_t i = 0; i < 6; i++)
        codes |= (uint64_t)block[2 + i] << (8 * i);
    for (uint32_t i = 0; i < 16; i++, codes >>= 3)
        rgba[i / 4 * pitch + (size_t)(i % 4) * 4 + 3] = values[codes & 7];
}

size_t hw_bc3_bytes(uint32_t width, uint32_t height)
{
    return 2 * hw_bc1_bytes(width, height);
}

void hw_bc3_join(const uint8_t *bc1, const uint8_t *bc4, size_t bytes, uint8_t *out)
{
    for (size_t i = 0; 2 * i < bytes; i += BLOCK_BYTES) {
        memcpy(out + 2 * i, bc4 + i, BLOCK_BYTES);
        memcpy(out + 2 * i + BLOCK_BYTES, bc1 + i, BLOCK_BYTES);
    }
}

void hw_bc3_decode(const uint8_t *blocks, uint32_t width, uint32_t height, uint8_t *rgba)
{
    assert(width % 4 == 0 && height % 4 == 0);
    size_t pitch = (size_t)width * 4;
    for (uint32_t y = 0; y < height; y += 4)
        for (uint32_t x = 0; x < width; x += 4, blocks += 2 * BLOCK_BYTES) {
            uint8_t *out = rgba + y * pitch + (size_t)x * 4;
            decode_colors(blocks + BLOCK_BYTES, pitch, out);
            decode_values(blocks, pitch, out);
        }
}
