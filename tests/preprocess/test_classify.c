#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include "classify.h"
#include <cmocka.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

#define SIDE 64

static float depths[SIDE * SIDE];
static uint8_t categories[SIDE * SIDE];

static uint8_t at(int x, int y)
{
    return categories[y * SIDE + x];
}

static void classify(float t_c0, float t_c1)
{
    hw_classify_options options = {t_c0, t_c1};
    memset(categories, 0xee, sizeof categories);
    assert_int_equal(hw_classify(depths, SIDE, SIDE, &options, categories), HW_OK);
}

// Perspective rays (x, y, 1) over a field of view of +-0.3.
static double ray(int i)
{
    return 0.6 * ((i + 0.5) / SIDE - 0.5);
}

static void test_sphere(void **state)
{
    (void)state;
    const double distance = 100, radius = 20;
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            double a = ray(x) * ray(x) + ray(y) * ray(y) + 1; // |t d - c|^2 = r^2
            double q = distance * distance - a * (distance * distance - radius * radius);
            depths[y * SIDE + x] = q >= 0 ? (float)((distance - sqrt(q)) / a) : INFINITY;
        }
    classify(0.05f, 0.02f);
    int exterior = 0;
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            if (isinf(depths[y * SIDE + x])) {
                assert_int_equal(at(x, y), HW_CATEGORY_BACKGROUND);
                continue;
            }
            bool border = isinf(depths[y * SIDE + x - 1]) || isinf(depths[y * SIDE + x + 1]) ||
                          isinf(depths[y * SIDE + x - SIDE]) || isinf(depths[y * SIDE + x + SIDE]);
            assert_int_equal(at(x, y) == HW_CATEGORY_EXTERIOR_SILHOUETTE, border);
            exterior += border;
            if (hypot(x - 31.5, y - 31.5) < 16) // its outline is at 21.8
                assert_int_equal(at(x, y), HW_CATEGORY_INTERIOR);
        }
    // The inner 4-border of a disc of radius 21.8: between its 8- and 4-connected outlines.
    assert_in_range(exterior, 110, 150);
}

static void test_step(void **state)
{
    (void)state;
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++)
            depths[y * SIDE + x] = x < 30 ? 100 : 101;
    classify(0.005f, 0.002f);
    for (int y = 1; y + 1 < SIDE; y++)
        for (int x = 1; x + 1 < SIDE; x++) {
            // The near side is the silhouette; the far side bends by the same step.
            uint8_t expected = x == 29   ? HW_CATEGORY_INTERIOR_SILHOUETTE
                               : x == 30 ? HW_CATEGORY_SHARP_EDGE
                                         : HW_CATEGORY_INTERIOR;
            assert_int_equal(at(x, y), expected);
        }
    // The image's border is the object's.
    assert_int_equal(at(0, 30), HW_CATEGORY_EXTERIOR_SILHOUETTE);
    assert_int_equal(at(SIDE - 1, 30), HW_CATEGORY_EXTERIOR_SILHOUETTE);
    assert_int_equal(at(30, 0), HW_CATEGORY_EXTERIOR_SILHOUETTE);
    assert_int_equal(at(30, SIDE - 1), HW_CATEGORY_EXTERIOR_SILHOUETTE);
    // A step below the tolerance is none.
    classify(0.011f, 0.011f);
    for (int x = 1; x + 1 < SIDE; x++)
        assert_int_equal(at(x, 20), HW_CATEGORY_INTERIOR);
    // Transposed: vertical neighbours count alike.
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++)
            depths[y * SIDE + x] = y < 30 ? 101 : 100;
    classify(0.005f, 0.002f);
    assert_int_equal(at(20, 30), HW_CATEGORY_INTERIOR_SILHOUETTE);
    assert_int_equal(at(20, 29), HW_CATEGORY_SHARP_EDGE);
    assert_int_equal(at(20, 31), HW_CATEGORY_INTERIOR);
}

// Planes z = d + slope X in perspective: 1 / z is linear in the image, so even steep ones have no
// edge; a roof of two such planes has one at its ridge alone.
static void test_planes_and_roof(void **state)
{
    (void)state;
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++)
            depths[y * SIDE + x] = (float)(100 / (1 - 1.5 * ray(x) + 0.7 * ray(y)));
    classify(0.5f, 1e-4f);
    for (int y = 1; y + 1 < SIDE; y++)
        for (int x = 1; x + 1 < SIDE; x++)
            assert_int_equal(at(x, y), HW_CATEGORY_INTERIOR);

    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++)
            depths[y * SIDE + x] = (float)(100 / (1 - 0.8 * fabs(ray(x) - ray(40))));
    // At the ridge the steps are 0.8 * 0.6 / 64 = 0.0075 each, 0.015 together.
    classify(0.5f, 0.014f);
    for (int y = 1; y + 1 < SIDE; y++)
        for (int x = 1; x + 1 < SIDE; x++)
            assert_int_equal(at(x, y), x == 40 ? HW_CATEGORY_SHARP_EDGE : HW_CATEGORY_INTERIOR);
    classify(0.5f, 0.016f);
    assert_int_equal(at(40, 20), HW_CATEGORY_INTERIOR);
    classify(0.007f, 0.014f); // both sides of the ridge lie farther by more than t_c0
    assert_int_equal(at(40, 20), HW_CATEGORY_INTERIOR_SILHOUETTE);
}

static void test_tolerances_are_relative(void **state)
{
    (void)state;
    uint8_t kept[SIDE * SIDE];
    for (int scale = 1; scale <= 64; scale *= 8) {
        for (int y = 0; y < SIDE; y++)
            for (int x = 0; x < SIDE; x++)
                depths[y * SIDE + x] = (float)scale * (x + y < 60 ? 10 : 10.05f);
        classify(0, 0);
        if (scale == 1)
            memcpy(kept, categories, sizeof kept);
        assert_memory_equal(kept, categories, sizeof kept);
    }
    assert_int_equal(kept[20 * SIDE + 39], HW_CATEGORY_INTERIOR_SILHOUETTE);
}

static void test_conversion_and_weights(void **state)
{
    (void)state;
    // By definition: two depths that differ by t in the buffer.
    const double n = 43.3, f = 2600, z = 400, t = 3.4e-4;
    double buffer = f / (f - n) * (1 - n / z) + t, other = n / (1 - buffer * (f - n) / f);
    assert_float_equal(hw_classify_relative(t, n, f, z), (other - z) / other, 1e-9);
    assert_float_equal(hw_classify_relative(HW_THESIS_T_C0, n, f, z), 3.09e-3, 5e-6);
    assert_float_equal(hw_classify_relative(HW_THESIS_T_C1, n, f, z), 1.16e-3, 5e-6);
    assert_float_equal(hw_category_weight(HW_CATEGORY_EXTERIOR_SILHOUETTE), 0.5, 0);
    assert_float_equal(hw_category_weight(HW_CATEGORY_INTERIOR_SILHOUETTE), 0.4f, 0);
    assert_float_equal(hw_category_weight(HW_CATEGORY_SHARP_EDGE), 0.25, 0);
    assert_float_equal(hw_category_weight(HW_CATEGORY_INTERIOR), 0.125, 0);
    assert_float_equal(hw_category_weight(HW_CATEGORY_BACKGROUND), 0, 0);
    assert_float_equal(hw_category_weight(200), 0, 0);
    // Defaults come from these.
    for (int k = 0; k < SIDE * SIDE; k++)
        depths[k] = k % SIDE < 30 ? 400 : 400 * 1.0032f;
    assert_int_equal(hw_classify(depths, SIDE, SIDE, NULL, categories), HW_OK);
    assert_int_equal(at(29, 9), HW_CATEGORY_INTERIOR_SILHOUETTE);
    for (int k = 0; k < SIDE * SIDE; k++)
        depths[k] = k % SIDE < 30 ? 400 : 400 * 1.003f;
    assert_int_equal(hw_classify(depths, SIDE, SIDE, NULL, categories), HW_OK);
    assert_int_equal(at(29, 9), HW_CATEGORY_SHARP_EDGE);
    // One pixel, and none.
    depths[0] = 5;
    assert_int_equal(hw_classify(depths, 1, 1, NULL, categories), HW_OK);
    assert_int_equal(categories[0], HW_CATEGORY_EXTERIOR_SILHOUETTE);
    assert_int_equal(hw_classify(depths, 0, 0, NULL, categories), HW_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sphere),
        cmocka_unit_test(test_step),
        cmocka_unit_test(test_planes_and_roof),
        cmocka_unit_test(test_tolerances_are_relative),
        cmocka_unit_test(test_conversion_and_weights),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
