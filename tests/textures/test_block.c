// BC1 and BC4: hand-worked decoder vectors, and what a round trip may lose.
#include "alloc.h"
#include "block.h"
#include "rng.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

// BC1 by itself: with full alpha. At most 64 x 64 pixels.
static void decode_colors(const uint8_t *blocks, uint32_t width, uint32_t height, uint8_t *rgba)
{
    static uint8_t full[64 * 64 / 2], joined[64 * 64];
    memset(full, 255, sizeof full); // both values are 255, and so are all codes
    hw_bc3_join(blocks, full, hw_bc3_bytes(width, height), joined);
    hw_bc3_decode(joined, width, height, rgba);
}

// BC4 by itself. At most 8 x 8 pixels.
static void decode_alpha(const uint8_t *blocks, uint32_t width, uint32_t height, uint8_t *out)
{
    uint8_t black[32] = {0}, joined[64], rgba[256];
    hw_bc3_join(black, blocks, hw_bc3_bytes(width, height), joined);
    hw_bc3_decode(joined, width, height, rgba);
    for (uint32_t i = 0; i < width * height; i++)
        out[i] = rgba[i * 4 + 3];
}

static void assert_pixel(const uint8_t *rgba, uint32_t pixel, int r, int g, int b)
{
    assert_int_equal(rgba[pixel * 4], r);
    assert_int_equal(rgba[pixel * 4 + 1], g);
    assert_int_equal(rgba[pixel * 4 + 2], b);
    assert_int_equal(rgba[pixel * 4 + 3], 255);
}

// c0 = pure red (31,0,0) = 0xf800 > c1 = pure blue 0x001f; rows of codes 0..3, lowest bits first.
static void test_four_colours(void **state)
{
    (void)state;
    const uint8_t block[8] = {0x00, 0xf8, 0x1f, 0x00, 0xe4, 0x00, 0x55, 0xff};
    uint8_t out[64];
    decode_colors(block, 4, 4, out);
    assert_pixel(out, 0, 255, 0, 0);
    assert_pixel(out, 1, 0, 0, 255);
    assert_pixel(out, 2, 170, 0, 85);
    assert_pixel(out, 3, 85, 0, 170);
    assert_pixel(out, 7, 255, 0, 0);
    assert_pixel(out, 8, 0, 0, 255);
    assert_pixel(out, 15, 85, 0, 170);
}

// The same two swapped: thirds again, for BC3 has no block of three colours and black.
static void test_swapped_colours(void **state)
{
    (void)state;
    const uint8_t block[8] = {0x1f, 0x00, 0x00, 0xf8, 0xe4, 0xaa, 0x00, 0x00};
    uint8_t out[64];
    decode_colors(block, 4, 4, out);
    assert_pixel(out, 0, 0, 0, 255);
    assert_pixel(out, 1, 255, 0, 0);
    assert_pixel(out, 2, 85, 0, 170);
    assert_pixel(out, 3, 170, 0, 85);
    assert_pixel(out, 6, 85, 0, 170);
}

// 5:6:5 = (5, 10, 20): 5 -> 41, 10 -> 40, 20 -> 165 by repeating the high bits; and (2a + b) / 3
// truncates: against white (2 * 41 + 255) / 3 = 112.
static void test_expansion_and_thirds(void **state)
{
    (void)state;
    const uint32_t c1 = 5u << 11 | 10u << 5 | 20u;
    const uint8_t block[8] = {0xff, 0xff, (uint8_t)c1, (uint8_t)(c1 >> 8), 0xe4, 0, 0, 0};
    uint8_t out[64];
    decode_colors(block, 4, 4, out);
    assert_pixel(out, 1, 41, 40, 165);
    assert_pixel(out, 2, (2 * 255 + 41) / 3, (2 * 255 + 40) / 3, (2 * 255 + 165) / 3);
    assert_pixel(out, 3, 112, (2 * 40 + 255) / 3, (2 * 165 + 255) / 3);
}

// Equal end points: all four colours are the same.
static void test_equal_end_points(void **state)
{
    (void)state;
    const uint8_t block[8] = {0xff, 0xff, 0xff, 0xff, 0xe4, 0, 0, 0};
    uint8_t out[64];
    decode_colors(block, 4, 4, out);
    assert_pixel(out, 2, 255, 255, 255);
    assert_pixel(out, 3, 255, 255, 255);
}

// Blocks go left to right, then down: four blocks of an 8 x 8 image.
static void test_block_order(void **state)
{
    (void)state;
    uint8_t blocks[32] = {0}, out[256];
    for (int i = 0; i < 4; i++)
        blocks[i * 8] = blocks[i * 8 + 2] = (uint8_t)(i + 1); // blue i + 1 of 31
    assert_int_equal(hw_bc1_bytes(8, 8), 32);
    decode_colors(blocks, 8, 8, out);
    assert_pixel(out, 0, 0, 0, 8);
    assert_pixel(out, 4, 0, 0, 16);
    assert_pixel(out, 32, 0, 0, 24);
    assert_pixel(out, 63, 0, 0, 33);
}

static hw_image make_image(uint32_t side, uint32_t channels)
{
    hw_image image;
    assert_int_equal(hw_image_make(&image, side, side, channels), HW_OK);
    return image;
}

// What is encoded has the larger colour first, or two equal ones and no black: it means the same
// in BC1, which some tools show an atlas as.
static void assert_same_in_bc1(const uint8_t *block)
{
    int c0 = block[0] | block[1] << 8, c1 = block[2] | block[3] << 8;
    bool black = false;
    for (uint32_t i = 0; i < 16; i++)
        black = black || (block[4 + i / 4] >> (i % 4 * 2) & 3) == 3;
    assert_true(c0 > c1 || (c0 == c1 && !black));
}

static void test_constant_round_trip(void **state)
{
    (void)state;
    hw_image image = make_image(4, 3);
    for (int v = 0; v < 256; v++) {
        uint8_t block[8], out[64];
        memset(image.data, v, 48);
        hw_bc1_encode(&image, block);
        assert_same_in_bc1(block);
        decode_colors(block, 4, 4, out);
        for (int i = 0; i < 64; i++)
            assert_true(i % 4 == 3 || abs(out[i] - v) <= 1);
    }
    hw_image_free(&image);
}

// Colours on a line through a smooth gradient lose little; the bound is loose but would catch a
// swapped channel, row order or palette.
static void test_gradient_round_trip(void **state)
{
    (void)state;
    for (uint32_t channels = 3; channels <= 4; channels++) {
        hw_image image = make_image(64, channels);
        for (uint32_t i = 0; i < 64 * 64; i++) {
            uint8_t *p = image.data + i * channels;
            p[0] = (uint8_t)(i % 64 * 3 + 20);
            p[1] = (uint8_t)(i % 64 * 2 + 60);
            p[2] = (uint8_t)(i / 64 * 2);
        }
        uint8_t *blocks, *again, *out;
        size_t size = hw_bc1_bytes(64, 64);
        assert_int_equal(HW_NEW(&blocks, size), HW_OK);
        assert_int_equal(HW_NEW(&again, size), HW_OK);
        assert_int_equal(HW_NEW(&out, 64 * 64 * 4), HW_OK);
        hw_bc1_encode(&image, blocks);
        hw_bc1_encode(&image, again);
        assert_memory_equal(blocks, again, size);
        decode_colors(blocks, 64, 64, out);
        double sum = 0;
        for (uint32_t i = 0; i < 64 * 64; i++)
            for (uint32_t k = 0; k < 3; k++) {
                int d = image.data[i * channels + k] - out[i * 4 + k];
                assert_true(abs(d) <= 12);
                sum += d * d;
            }
        assert_true(sum / (64 * 64 * 3) < 12);
        hw_free(blocks);
        hw_free(again);
        hw_free(out);
        hw_image_free(&image);
    }
}

// Noise, the worst case: every pixel stays between the extremes of its block, give or take
// quantisation, and the encoder beats the block's mean colour.
static void test_noise_round_trip(void **state)
{
    (void)state;
    hw_image image = make_image(4, 3);
    hw_rng rng = hw_rng_make(5, 5);
    for (int round = 0; round < 500; round++) {
        uint8_t block[8], out[64];
        double mean[3] = {0}, flat = 0, error = 0;
        for (int i = 0; i < 48; i++) {
            image.data[i] = (uint8_t)hw_rng_below(&rng, 256);
            mean[i % 3] += image.data[i] / 16.0;
        }
        hw_bc1_encode(&image, block);
        assert_same_in_bc1(block);
        decode_colors(block, 4, 4, out);
        for (int i = 0; i < 48; i++) {
            double d = image.data[i] - mean[i % 3], e = image.data[i] - out[i / 3 * 4 + i % 3];
            flat += d * d;
            error += e * e;
        }
        assert_true(error < flat);
    }
    hw_image_free(&image);
}

// Hand-worked (EXT_texture_compression_rgtc): v0 = 210 > v1 = 0 has sixths between, v0 = 0 < v1 =
// 250 fifths, then 0 and 255. Codes 0, 1, ..., 7 in the first eight pixels.
static void test_one_channel(void **state)
{
    (void)state;
    const uint8_t codes[3] = {0x88, 0xc6, 0xfa};
    const uint8_t expected[2][8] = {{210, 0, 180, 150, 120, 90, 60, 30},
                                    {0, 250, 50, 100, 150, 200, 0, 255}};
    for (int mode = 0; mode < 2; mode++) {
        uint8_t block[8] = {mode ? 0 : 210, mode ? 250 : 0}, out[16];
        memcpy(block + 2, codes, 3);
        decode_alpha(block, 4, 4, out);
        for (int i = 0; i < 8; i++)
            assert_int_equal(out[i], expected[mode][i]);
    }
}

static void test_one_channel_round_trip(void **state)
{
    (void)state;
    hw_image image = make_image(8, 4);
    uint8_t blocks[32], out[64];
    for (uint32_t i = 0; i < 64; i++)
        image.data[i * 4 + 3] = (uint8_t)(i % 8 * 20 + i / 8 * 10);
    hw_bc4_encode(&image, 3, blocks);
    decode_alpha(blocks, 8, 8, out);
    for (uint32_t i = 0; i < 64; i++)
        assert_true(abs(out[i] - image.data[i * 4 + 3]) <= 8);
    // What is full or empty stays so.
    for (uint32_t i = 0; i < 64; i++)
        image.data[i * 4 + 3] = i % 8 < 3 ? 0 : 255;
    hw_bc4_encode(&image, 3, blocks);
    decode_alpha(blocks, 8, 8, out);
    for (uint32_t i = 0; i < 64; i++)
        assert_int_equal(out[i], image.data[i * 4 + 3]);
    // Joined with colours: both as they were.
    uint8_t colors[32], joined[64], rgb[256], rgba[256];
    assert_int_equal(hw_bc3_bytes(8, 8), sizeof joined);
    hw_bc1_encode(&image, colors);
    decode_colors(colors, 8, 8, rgb);
    hw_bc3_join(colors, blocks, sizeof joined, joined);
    hw_bc3_decode(joined, 8, 8, rgba);
    for (uint32_t i = 0; i < 64; i++) {
        assert_memory_equal(rgba + i * 4, rgb + i * 4, 3);
        assert_int_equal(rgba[i * 4 + 3], out[i]);
    }
    hw_image_free(&image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_four_colours),         cmocka_unit_test(test_swapped_colours),
        cmocka_unit_test(test_expansion_and_thirds), cmocka_unit_test(test_equal_end_points),
        cmocka_unit_test(test_block_order),          cmocka_unit_test(test_constant_round_trip),
        cmocka_unit_test(test_one_channel),          cmocka_unit_test(test_one_channel_round_trip),
        cmocka_unit_test(test_gradient_round_trip),  cmocka_unit_test(test_noise_round_trip),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
