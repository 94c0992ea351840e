// Atlas packing as properties: inside, aligned, apart, the same twice, not wasteful.
#include "alloc.h"
#include "atlas.h"
#include "rng.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define COUNT_MAX 400

static uint32_t round_up(uint32_t v, uint32_t step)
{
    return (v + step - 1) / step * step;
}

static bool apart(hw_rect a, hw_rect b)
{
    return a.x + a.width <= b.x || b.x + b.width <= a.x || a.y + a.height <= b.y ||
           b.y + b.height <= a.y;
}

static void check(const hw_rect *rects, uint32_t count, uint32_t align, uint32_t max_side,
                  uint32_t width, uint32_t height)
{
    assert_true(width % 4 == 0 && height % 4 == 0);
    assert_true(width >= 4 && width <= max_side && height >= 4 && height <= max_side);
    for (uint32_t i = 0; i < count; i++) {
        assert_true(rects[i].x % align == 0 && rects[i].y % align == 0);
        assert_true(rects[i].x + rects[i].width <= width);
        assert_true(rects[i].y + rects[i].height <= height);
        for (uint32_t j = 0; j < i; j++)
            assert_true(apart(rects[i], rects[j]));
    }
}

static void test_random_sets(void **state)
{
    (void)state;
    static hw_rect rects[COUNT_MAX], again[COUNT_MAX];
    const uint32_t aligns[] = {1, 2, 4, 8, 16};
    for (uint32_t round = 0; round < 60; round++) {
        hw_rng rng = hw_rng_make(round, 2);
        uint32_t count = 1 + hw_rng_below(&rng, COUNT_MAX - 1), align = aligns[round % 5];
        uint64_t area = 0;
        for (uint32_t i = 0; i < count; i++) {
            uint32_t large = hw_rng_below(&rng, 10) == 0 ? 200 : 40;
            rects[i] =
                (hw_rect){0, 0, 1 + hw_rng_below(&rng, large), 1 + hw_rng_below(&rng, large)};
            area += (uint64_t)round_up(rects[i].width, align) * round_up(rects[i].height, align);
        }
        memcpy(again, rects, sizeof rects);
        uint32_t width, height, width2, height2;
        assert_int_equal(hw_atlas_pack(rects, count, align, 4096, &width, &height), HW_OK);
        check(rects, count, align, 4096, width, height);
        assert_int_equal(hw_atlas_pack(again, count, align, 4096, &width2, &height2), HW_OK);
        assert_int_equal(width, width2);
        assert_int_equal(height, height2);
        assert_memory_equal(rects, again, count * sizeof *rects);
        if (count > 100)
            assert_true((double)area / ((double)width * height) > 0.8);
    }
}

// Equal squares fill a square without a gap.
static void test_perfect_fit(void **state)
{
    (void)state;
    hw_rect rects[64];
    for (int i = 0; i < 64; i++)
        rects[i] = (hw_rect){0, 0, 32, 32};
    uint32_t width, height;
    assert_int_equal(hw_atlas_pack(rects, 64, 4, 8192, &width, &height), HW_OK);
    assert_int_equal(width * height, 64 * 32 * 32);
    // A full atlas of exactly the largest size is found too.
    assert_int_equal(hw_atlas_pack(rects, 64, 4, 256, &width, &height), HW_OK);
    check(rects, 64, 4, 256, width, height);
}

static void test_corner_cases(void **state)
{
    (void)state;
    uint32_t width, height;
    assert_int_equal(hw_atlas_pack(NULL, 0, 4, 8192, &width, &height), HW_OK);
    assert_int_equal(width, 4);
    assert_int_equal(height, 4);
    hw_rect one = {9, 9, 5, 3};
    assert_int_equal(hw_atlas_pack(&one, 1, 1, 64, &width, &height), HW_OK);
    check(&one, 1, 1, 64, width, height);
    assert_int_equal(width * height, 8 * 4);
    one = (hw_rect){0, 0, 64, 64};
    assert_int_equal(hw_atlas_pack(&one, 1, 4, 64, &width, &height), HW_OK);
    one.width = 65;
    assert_int_equal(hw_atlas_pack(&one, 1, 4, 64, &width, &height), HW_LIMIT);
    one.width = UINT32_MAX;
    assert_int_equal(hw_atlas_pack(&one, 1, 16, 64, &width, &height), HW_LIMIT);
    hw_rect three[3] = {{0, 0, 40, 40}, {0, 0, 40, 40}, {0, 0, 4, 4}};
    assert_int_equal(hw_atlas_pack(three, 3, 4, 64, &width, &height), HW_LIMIT);
    assert_int_equal(hw_atlas_pack(&one, 1, 4, 3, &width, &height), HW_LIMIT);
}

static void test_allocation_failures(void **state)
{
    (void)state;
    hw_rect rects[2] = {{0, 0, 8, 8}, {0, 0, 4, 4}};
    uint32_t width, height;
    for (uint64_t n = 1; n <= 3; n++) {
        hw_alloc_fail_after(n);
        assert_int_equal(hw_atlas_pack(rects, 2, 4, 64, &width, &height), HW_MEMORY);
    }
    hw_alloc_fail_after(0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_random_sets),
        cmocka_unit_test(test_perfect_fit),
        cmocka_unit_test(test_corner_cases),
        cmocka_unit_test(test_allocation_failures),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
