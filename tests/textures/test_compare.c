// PSNR and SSIM against closed forms and a direct implementation.
#include "alloc.h"
#include "compare.h"
#include "rng.h"
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define WIDTH  40
#define HEIGHT 31
#define PIXELS (WIDTH * HEIGHT)

static void fill(float *plane, float value)
{
    for (size_t i = 0; i < PIXELS; i++)
        plane[i] = value;
}

static void fill_random(float *plane, uint64_t seed)
{
    hw_rng rng = hw_rng_make(seed, 1);
    for (size_t i = 0; i < PIXELS; i++)
        plane[i] = (float)hw_rng_below(&rng, 256);
}

static void test_luma(void **state)
{
    (void)state;
    uint8_t rgba[8] = {255, 0, 0, 9, 10, 20, 30, 200}, gray[2] = {7, 250};
    float luma[2];
    hw_luma(&(hw_image){2, 1, 4, rgba}, luma);
    assert_float_equal(luma[0], 76.245f, 1e-3f);
    assert_float_equal(luma[1], 2.99f + 11.74f + 3.42f, 1e-3f);
    hw_luma(&(hw_image){2, 1, 1, gray}, luma);
    assert_float_equal(luma[1], 250, 0);
}

static void test_psnr(void **state)
{
    (void)state;
    static float a[PIXELS], b[PIXELS];
    static uint8_t mask[PIXELS];
    size_t count;
    fill(a, 100);
    fill(b, 105);
    assert_float_equal(hw_squared_error(a, b, NULL, PIXELS, &count), 25.0 * PIXELS, 1e-6);
    assert_int_equal(count, PIXELS);
    // 20 log10(255 / 5)
    assert_float_equal(hw_psnr(25), 34.1514, 1e-3);
    assert_float_equal(hw_psnr(255.0 * 255.0), 0, 1e-9);
    assert_true(isinf(hw_psnr(0)) && hw_psnr(0) > 0);
    b[7] = 90;
    mask[7] = mask[9] = 1;
    assert_float_equal(hw_squared_error(a, b, mask, PIXELS, &count), 125, 1e-9);
    assert_int_equal(count, 2);
    memset(mask, 0, sizeof mask);
    assert_float_equal(hw_squared_error(a, b, mask, PIXELS, &count), 0, 0);
    assert_int_equal(count, 0);
}

static void test_ssim_of_equal_images(void **state)
{
    (void)state;
    static float a[PIXELS];
    double ssim;
    fill_random(a, 3);
    assert_int_equal(hw_ssim(a, a, WIDTH, HEIGHT, NULL, &ssim), HW_OK);
    assert_float_equal(ssim, 1, 1e-12);
}

// Without variance only the luminance term is left: (2 x y + C1) / (x^2 + y^2 + C1).
static void test_ssim_of_constants(void **state)
{
    (void)state;
    static float a[PIXELS], b[PIXELS];
    double ssim, c1 = 0.01 * 255 * 0.01 * 255, x = 60, y = 190;
    fill(a, (float)x);
    fill(b, (float)y);
    assert_int_equal(hw_ssim(a, b, WIDTH, HEIGHT, NULL, &ssim), HW_OK);
    assert_float_equal(ssim, (2 * x * y + c1) / (x * x + y * y + c1), 1e-4);
}

// Inverted contrast about the same mean: covariance is minus the variance.
static void test_ssim_of_inverse_is_negative(void **state)
{
    (void)state;
    static float a[PIXELS], b[PIXELS];
    double ssim;
    for (size_t i = 0; i < PIXELS; i++) {
        a[i] = (i + i / WIDTH) % 2 ? 228 : 28;
        b[i] = 256 - a[i];
    }
    assert_int_equal(hw_ssim(a, b, WIDTH, HEIGHT, NULL, &ssim), HW_OK);
    assert_true(ssim < -0.97 && ssim >= -1);
}

// The definition, window by window, in double precision.
static double direct_ssim(const float *a, const float *b, const uint8_t *mask)
{
    double taps[11], norm = 0, sum = 0;
    size_t used = 0;
    for (int i = 0; i < 11; i++)
        norm += taps[i] = exp(-(i - 5) * (i - 5) / 4.5);
    for (size_t y = 5; y + 5 < HEIGHT; y++)
        for (size_t x = 5; x + 5 < WIDTH; x++) {
            if (mask && !mask[y * WIDTH + x])
                continue;
            double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
            for (size_t j = 0; j < 11; j++)
                for (size_t i = 0; i < 11; i++) {
                    size_t p = (y + j - 5) * WIDTH + x + i - 5;
                    double w = taps[i] * taps[j] / norm / norm;
                    double va = (double)a[p], vb = (double)b[p];
                    ma += w * va;
                    mb += w * vb;
                    aa += w * va * va;
                    bb += w * vb * vb;
                    ab += w * va * vb;
                }
            double c1 = 6.5025, c2 = 58.5225;
            sum += (2 * ma * mb + c1) * (2 * (ab - ma * mb) + c2) /
                   ((ma * ma + mb * mb + c1) * (aa - ma * ma + bb - mb * mb + c2));
            used++;
        }
    return sum / (double)used;
}

static void test_ssim_against_definition(void **state)
{
    (void)state;
    static float a[PIXELS], b[PIXELS];
    static uint8_t mask[PIXELS];
    double ssim;
    fill_random(a, 11);
    fill_random(b, 12);
    for (size_t i = 0; i < PIXELS; i++) {
        b[i] = 0.7f * a[i] + 0.2f * b[i] + (float)(i % WIDTH);
        mask[i] = i % 3 == 0;
    }
    assert_int_equal(hw_ssim(a, b, WIDTH, HEIGHT, NULL, &ssim), HW_OK);
    assert_float_equal(ssim, direct_ssim(a, b, NULL), 1e-5);
    assert_true(ssim > 0.3 && ssim < 0.99);
    assert_int_equal(hw_ssim(a, b, WIDTH, HEIGHT, mask, &ssim), HW_OK);
    assert_float_equal(ssim, direct_ssim(a, b, mask), 1e-5);
}

static void test_ssim_errors(void **state)
{
    (void)state;
    static float a[PIXELS];
    static uint8_t mask[PIXELS];
    double ssim;
    assert_int_equal(hw_ssim(a, a, 10, 31, NULL, &ssim), HW_USAGE);
    assert_int_equal(hw_ssim(a, a, 31, 10, NULL, &ssim), HW_USAGE);
    assert_int_equal(hw_ssim(a, a, WIDTH, HEIGHT, mask, &ssim), HW_USAGE);
    mask[0] = 1; // no whole window is centred on a border pixel
    assert_int_equal(hw_ssim(a, a, WIDTH, HEIGHT, mask, &ssim), HW_USAGE);
    assert_int_equal(hw_ssim(a, a, 11, 11, NULL, &ssim), HW_OK);
    hw_alloc_fail_after(1);
    assert_int_equal(hw_ssim(a, a, WIDTH, HEIGHT, NULL, &ssim), HW_MEMORY);
    hw_alloc_fail_after(0);
}

static void test_difference_image(void **state)
{
    (void)state;
    uint8_t a[8] = {10, 20, 30, 255, 0, 0, 0, 0}, b[6] = {12, 10, 30, 255, 3, 100};
    hw_image out;
    assert_int_equal(hw_difference_image(&(hw_image){2, 1, 4, a}, &(hw_image){2, 1, 3, b}, 4, &out),
                     HW_OK);
    const uint8_t wanted[6] = {8, 40, 0, 255, 12, 255};
    assert_int_equal(out.channels, 3);
    assert_memory_equal(out.data, wanted, 6);
    hw_image_free(&out);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_luma),
        cmocka_unit_test(test_psnr),
        cmocka_unit_test(test_ssim_of_equal_images),
        cmocka_unit_test(test_ssim_of_constants),
        cmocka_unit_test(test_ssim_of_inverse_is_negative),
        cmocka_unit_test(test_ssim_against_definition),
        cmocka_unit_test(test_ssim_errors),
        cmocka_unit_test(test_difference_image),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
