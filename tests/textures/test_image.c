// Images in memory and in files, and the filtered sampler.
#include "alloc.h"
#include "file.h"
#include "image_io.h"
#include "rng.h"
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static char folder[] = "/tmp/hexwalk-test-image-XXXXXX";

static int set_up(void **state)
{
    (void)state;
    return mkdtemp(folder) ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    return rmdir(folder);
}

static void make_path(char out[256], const char *name)
{
    snprintf(out, 256, "%s/%s", folder, name);
}

static hw_image random_image(uint32_t width, uint32_t height, uint32_t channels)
{
    hw_image image;
    hw_rng rng = hw_rng_make(7, channels);
    assert_int_equal(hw_image_make(&image, width, height, channels), HW_OK);
    for (size_t i = 0; i < (size_t)width * height * channels; i++)
        image.data[i] = (uint8_t)hw_rng_below(&rng, 256);
    return image;
}

static void assert_same(const hw_image *a, const hw_image *b)
{
    assert_int_equal(a->width, b->width);
    assert_int_equal(a->height, b->height);
    assert_int_equal(a->channels, b->channels);
    assert_memory_equal(a->data, b->data, (size_t)a->width * a->height * a->channels);
}

static void test_make(void **state)
{
    (void)state;
    hw_image image;
    assert_int_equal(hw_image_make(&image, 0, 4, 3), HW_LIMIT);
    assert_int_equal(hw_image_make(&image, 4, 32769, 3), HW_LIMIT);
    assert_null(image.data);
    assert_int_equal(hw_image_make(&image, 32768, 1, 1), HW_OK);
    assert_int_equal(image.data[32767], 0);
    hw_image_free(&image);
    hw_image_free(&image);
    hw_image_free(NULL);
    hw_alloc_fail_after(1);
    assert_int_equal(hw_image_make(&image, 4, 4, 4), HW_MEMORY);
    hw_alloc_fail_after(0);
}

static void test_flip(void **state)
{
    (void)state;
    hw_image image = random_image(700, 3, 3), copy = random_image(700, 3, 3);
    hw_image_flip(&copy);
    assert_memory_equal(copy.data, image.data + 2 * 2100, 2100);
    assert_memory_equal(copy.data + 2100, image.data + 2100, 2100);
    hw_image_flip(&copy);
    assert_same(&image, &copy);
    hw_image_free(&copy);
    hw_image_free(&image);
}

static void test_png_round_trip(void **state)
{
    (void)state;
    const uint32_t channels[] = {1, 3, 4};
    char path[256];
    make_path(path, "round.png");
    for (int i = 0; i < 3; i++) {
        hw_image image = random_image(37, 21, channels[i]), back, decoded;
        uint8_t *bytes;
        size_t size;
        assert_int_equal(hw_image_write(path, &image), HW_OK);
        assert_int_equal(hw_image_read(path, &back), HW_OK);
        assert_same(&image, &back);
        assert_int_equal(hw_image_encode_png(&image, &bytes, &size), HW_OK);
        assert_int_equal(hw_image_decode("no extension", bytes, size, &decoded), HW_OK);
        assert_same(&image, &decoded);
        hw_free(bytes);
        hw_image_free(&decoded);
        hw_image_free(&back);
        hw_image_free(&image);
    }
    assert_int_equal(unlink(path), 0);
}

// Alpha must not be multiplied into colours: fully transparent pixels keep theirs.
static void test_alpha_is_kept_apart(void **state)
{
    (void)state;
    hw_image image, back;
    uint8_t *bytes;
    size_t size;
    assert_int_equal(hw_image_make(&image, 2, 1, 4), HW_OK);
    memcpy(image.data, (uint8_t[8]){200, 100, 50, 0, 10, 20, 30, 128}, 8);
    assert_int_equal(hw_image_encode_png(&image, &bytes, &size), HW_OK);
    assert_int_equal(hw_image_decode("alpha.png", bytes, size, &back), HW_OK);
    assert_same(&image, &back);
    hw_image_free(&back);
    hw_image_free(&image);
    hw_free(bytes);
}

static void test_jpeg(void **state)
{
    (void)state;
    char path[256];
    make_path(path, "smooth.jpg");
    hw_image image, back;
    assert_int_equal(hw_image_make(&image, 64, 48, 4), HW_OK);
    for (size_t i = 0; i < 64 * 48; i++)
        memcpy(image.data + i * 4, (uint8_t[4]){(uint8_t)(i % 64 * 4), 90, (uint8_t)(i / 64), 7},
               4);
    assert_int_equal(hw_image_write(path, &image), HW_OK);
    assert_int_equal(hw_image_read(path, &back), HW_OK);
    assert_int_equal(back.channels, 3);
    for (size_t i = 0; i < 64 * 48; i++)
        for (size_t k = 0; k < 3; k++)
            assert_true(abs(back.data[i * 3 + k] - image.data[i * 4 + k]) <= 8);
    hw_image_free(&back);
    uint8_t *fine, *coarse;
    size_t fine_size, coarse_size;
    assert_int_equal(hw_image_encode_jpeg(&image, 95, &fine, &fine_size), HW_OK);
    assert_int_equal(hw_image_encode_jpeg(&image, 20, &coarse, &coarse_size), HW_OK);
    assert_true(coarse_size < fine_size);
    assert_int_equal(hw_image_decode("coarse", coarse, coarse_size, &back), HW_OK);
    assert_int_equal(back.width, 64);
    hw_free(fine);
    hw_free(coarse);
    hw_image_free(&back);
    hw_image_free(&image);
    assert_int_equal(unlink(path), 0);
}

// A 2 x 1 image of 16-bit samples in each byte order, as NetPBM (no signature of ours: the name
// decides) and as hand-made TIFF.
static void test_sixteen_bits_become_eight(void **state)
{
    (void)state;
    static const uint8_t pgm[] = "P5\n2 1\n65535\n\xff\xff\x80\x80";
    static const uint8_t tiff[] = {
        'I', 'I', 42, 0, 8,    0,    0,    0,    8,   0,       // header, 8 entries
        0,   1,   3,  0, 1,    0,    0,    0,    2,   0, 0, 0, // width 2
        1,   1,   3,  0, 1,    0,    0,    0,    1,   0, 0, 0, // height 1
        2,   1,   3,  0, 1,    0,    0,    0,    16,  0, 0, 0, // 16 bits
        3,   1,   3,  0, 1,    0,    0,    0,    1,   0, 0, 0, // no compression
        6,   1,   3,  0, 1,    0,    0,    0,    1,   0, 0, 0, // black is zero
        17,  1,   4,  0, 1,    0,    0,    0,    110, 0, 0, 0, // strip at 110
        21,  1,   3,  0, 1,    0,    0,    0,    1,   0, 0, 0, // one sample
        23,  1,   4,  0, 1,    0,    0,    0,    4,   0, 0, 0, // of 4 bytes
        0,   0,   0,  0, 0xff, 0xff, 0x80, 0x80,               // no next; pixels
    };
    hw_image image;
    char path[256];
    make_path(path, "deep.pgm");
    assert_int_equal(hw_file_write(path, pgm, sizeof pgm - 1), HW_OK);
    assert_int_equal(hw_image_read(path, &image), HW_OK);
    assert_int_equal(image.channels, 1);
    assert_int_equal(image.data[0], 255);
    assert_int_equal(image.data[1], 128);
    hw_image_free(&image);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(hw_image_decode("deep", tiff, sizeof tiff, &image), HW_OK);
    assert_int_equal(image.width, 2);
    assert_int_equal(image.data[0], 255);
    assert_int_equal(image.data[1], 128);
    hw_image_free(&image);
}

static void test_truncated_png(void **state)
{
    (void)state;
    hw_image image = random_image(23, 17, 4), back;
    uint8_t *bytes;
    size_t size;
    assert_int_equal(hw_image_encode_png(&image, &bytes, &size), HW_OK);
    assert_int_equal(hw_image_decode("whole.png", bytes, size, &back), HW_OK);
    hw_image_free(&back);
    for (size_t prefix = 0; prefix < size; prefix++) {
        assert_int_equal(hw_image_decode("cut.png", bytes, prefix, &back), HW_FORMAT);
        assert_null(back.data);
        assert_non_null(strstr(hw_error_text(), "cut.png"));
    }
    hw_free(bytes);
    hw_image_free(&image);
}

// The checksums of the chunks catch any flipped bit.
static void test_damaged_png(void **state)
{
    (void)state;
    hw_image image = random_image(9, 7, 3), back;
    uint8_t *bytes;
    size_t size;
    assert_int_equal(hw_image_encode_png(&image, &bytes, &size), HW_OK);
    for (size_t i = 0; i < size; i++) {
        bytes[i] ^= 0x10;
        assert_int_equal(hw_image_decode("bad.png", bytes, size, &back), HW_FORMAT);
        bytes[i] ^= 0x10;
    }
    hw_free(bytes);
    hw_image_free(&image);
}

// JPEG has no checksums: damage gives an error or some image, never a crash.
static void test_damaged_jpeg(void **state)
{
    (void)state;
    hw_image image = random_image(24, 16, 3), back;
    char path[256];
    uint8_t *bytes;
    size_t size;
    make_path(path, "damaged.jpg");
    assert_int_equal(hw_image_write(path, &image), HW_OK);
    assert_int_equal(hw_file_read(path, 0, &bytes, &size), HW_OK);
    for (size_t prefix = 0; prefix < size; prefix += 3)
        if (hw_image_decode("cut.jpg", bytes, prefix, &back) == HW_OK)
            hw_image_free(&back);
    assert_int_equal(hw_image_decode("cut.jpg", bytes, 100, &back), HW_FORMAT);
    hw_free(bytes);
    hw_image_free(&image);
    assert_int_equal(unlink(path), 0);
}

static void test_missing_and_foreign_files(void **state)
{
    (void)state;
    hw_image image;
    char path[256];
    make_path(path, "none.png");
    hw_status status = hw_image_read(path, &image);
    assert_true(status == HW_NOT_FOUND || status == HW_IO);
    assert_non_null(strstr(hw_error_text(), path));
    assert_int_equal(hw_file_write(path, "", 0), HW_OK);
    assert_int_equal(hw_image_read(path, &image), HW_FORMAT);
    assert_int_equal(hw_file_write(path, "plain words", 11), HW_OK);
    assert_int_equal(hw_image_read(path, &image), HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), path));
    assert_int_equal(unlink(path), 0);
    assert_int_equal(hw_image_decode("nameless", "plain words", 11, &image), HW_FORMAT);
    image = random_image(4, 4, 3);
    make_path(path, "image.unknown");
    assert_int_equal(hw_image_write(path, &image), HW_USAGE);
    assert_int_equal(hw_image_write("/nonexistent/x.png", &image), HW_IO);
    hw_image_free(&image);
}

static hw_sampler *sampler_of(const hw_image *image)
{
    hw_sampler *sampler;
    assert_int_equal(hw_sampler_create(&sampler, image), HW_OK);
    return sampler;
}

static void test_sampler_constant(void **state)
{
    (void)state;
    hw_image image;
    assert_int_equal(hw_image_make(&image, 100, 70, 4), HW_OK);
    for (size_t i = 0; i < 100 * 70; i++)
        memcpy(image.data + i * 4, (uint8_t[4]){51, 102, 204, 0}, 4);
    hw_sampler *sampler = sampler_of(&image);
    hw_image_free(&image); // the sampler has its own copy
    const float scales[] = {0, 0.001f, 0.02f, 0.3f, 4};
    for (int i = 0; i < 5; i++) {
        float rgb[3], dx[2] = {scales[i], 0}, dy[2] = {0, scales[i] * 0.2f};
        hw_sampler_lookup(sampler, -1.3f + 0.7f * (float)i, 0.99f, dx, dy, rgb);
        assert_float_equal(rgb[0], 0.2f, 1e-3f);
        assert_float_equal(rgb[1], 0.4f, 1e-3f);
        assert_float_equal(rgb[2], 0.8f, 1e-3f);
    }
    hw_sampler_destroy(sampler);
    hw_sampler_destroy(NULL);
}

// v = 0 is the top row; texel centres return their texel exactly; both directions wrap.
static void test_sampler_orientation(void **state)
{
    (void)state;
    hw_image image = random_image(16, 8, 1);
    hw_sampler *sampler = sampler_of(&image);
    const float zero[2] = {0, 0};
    for (uint32_t y = 0; y < 8; y++)
        for (uint32_t x = 0; x < 16; x++) {
            float rgb[3], wanted = (float)image.data[y * 16 + x] / 255;
            float u = ((float)x + 0.5f) / 16, v = ((float)y + 0.5f) / 8;
            hw_sampler_lookup(sampler, u, v, zero, zero, rgb);
            assert_float_equal(rgb[0], wanted, 2e-3f);
            assert_float_equal(rgb[2], rgb[0], 0);
            hw_sampler_lookup(sampler, u + 2, v - 1, zero, zero, rgb);
            assert_float_equal(rgb[1], wanted, 2e-3f);
        }
    hw_sampler_destroy(sampler);
    hw_image_free(&image);
}

static void test_sampler_minification(void **state)
{
    (void)state;
    hw_image image;
    assert_int_equal(hw_image_make(&image, 256, 256, 3), HW_OK);
    for (size_t i = 0; i < 256 * 256; i++)
        memset(image.data + i * 3, (i + i / 256) % 2 ? 255 : 0, 3);
    hw_sampler *sampler = sampler_of(&image);
    for (float size = 4.0f / 256; size < 2; size *= 2) {
        float rgb[3], dx[2] = {size, 0}, dy[2] = {0, size};
        hw_sampler_lookup(sampler, 0.37f, 0.61f, dx, dy, rgb);
        assert_float_equal(rgb[0], 0.5f, 0.02f);
    }
    float rgb[3], zero[2] = {0, 0};
    hw_sampler_lookup(sampler, 0.5f / 256, 0.5f / 256, zero, zero, rgb);
    assert_float_equal(rgb[0], 0, 1e-3f);
    hw_sampler_destroy(sampler);
    hw_image_free(&image);
}

// One texel, odd sides, a single row: each has its pyramid.
static void test_sampler_odd_sizes(void **state)
{
    (void)state;
    const uint32_t sizes[][2] = {{1, 1}, {1, 13}, {129, 9}, {65, 67}, {33, 80}};
    for (int i = 0; i < 5; i++) {
        hw_image image = random_image(sizes[i][0], sizes[i][1], 3);
        size_t pixels = (size_t)sizes[i][0] * sizes[i][1];
        double mean = 0;
        for (size_t k = 0; k < pixels; k++)
            mean += image.data[k * 3] / 255.0 / (double)pixels;
        hw_sampler *sampler = sampler_of(&image);
        float rgb[3], dx[2] = {1, 0}, dy[2] = {0, 1};
        hw_sampler_lookup(sampler, 0.5f, 0.5f, dx, dy, rgb);
        assert_float_equal(rgb[0], (float)mean, 0.05f);
        hw_sampler_destroy(sampler);
        hw_image_free(&image);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_make),
        cmocka_unit_test(test_flip),
        cmocka_unit_test(test_png_round_trip),
        cmocka_unit_test(test_alpha_is_kept_apart),
        cmocka_unit_test(test_jpeg),
        cmocka_unit_test(test_sixteen_bits_become_eight),
        cmocka_unit_test(test_truncated_png),
        cmocka_unit_test(test_damaged_png),
        cmocka_unit_test(test_damaged_jpeg),
        cmocka_unit_test(test_missing_and_foreign_files),
        cmocka_unit_test(test_sampler_constant),
        cmocka_unit_test(test_sampler_orientation),
        cmocka_unit_test(test_sampler_minification),
        cmocka_unit_test(test_sampler_odd_sizes),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
