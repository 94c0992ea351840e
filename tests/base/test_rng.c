#include "hash.h"
#include "rng.h"
#include "system.h"
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static void numbers_are_those_of_the_reference(void **state)
{
    (void)state;
    // The first round of the reference program pcg32-demo (seed 42, stream 54).
    static const uint32_t expected[] = {0xa15c02b7, 0x7b47f409, 0xba1d3330,
                                        0x83d2f293, 0xbfa4784b, 0xcbed606e};
    hw_rng rng = hw_rng_make(42, 54);
    for (int i = 0; i < 6; i++)
        assert_int_equal(hw_rng_u32(&rng), expected[i]);
}

static void streams_differ(void **state)
{
    (void)state;
    hw_rng a = hw_rng_make(1, 1), b = hw_rng_make(1, 2), c = hw_rng_make(2, 1);
    uint32_t same = 0;
    for (int i = 0; i < 1000; i++) {
        uint32_t v = hw_rng_u32(&a);
        same += v == hw_rng_u32(&b);
        same += v == hw_rng_u32(&c);
    }
    assert_true(same < 3);
}

static void floats_are_uniform_below_one(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(7, 0);
    double sum = 0, squares = 0;
    for (int i = 0; i < 100000; i++) {
        float v = hw_rng_float(&rng);
        assert_true(v >= 0 && v < 1);
        sum += (double)v;
        squares += (double)v * (double)v;
    }
    assert_true(sum / 100000 > 0.495 && sum / 100000 < 0.505);
    assert_true(squares / 100000 > 0.328 && squares / 100000 < 0.338);
}

static void below_is_uniform(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(3, 9);
    uint32_t counts[3] = {0};
    for (int i = 0; i < 30000; i++)
        counts[hw_rng_below(&rng, 3)]++;
    for (int i = 0; i < 3; i++)
        assert_true(counts[i] > 9500 && counts[i] < 10500);
    assert_int_equal(hw_rng_below(&rng, 1), 0);
    // With a bound of 3/4 of the range, taking the remainder would favour the lower third 2 : 1.
    uint32_t low = 0;
    for (int i = 0; i < 30000; i++) {
        uint32_t v = hw_rng_below(&rng, 0xc0000000u);
        assert_true(v < 0xc0000000u);
        low += v < 0x40000000u;
    }
    assert_true(low > 9500 && low < 10500);
}

static void hashes_are_xxh3(void **state)
{
    (void)state;
    // Published value of XXH3_64bits of no bytes with seed 0.
    assert_true(hw_hash(0, "", 0) == UINT64_C(0x2d06800538d394c2));
    assert_true(hw_hash(0, "abc", 3) != hw_hash(1, "abc", 3));
    assert_true(hw_hash(0, "abc", 3) != hw_hash(0, "abd", 3));
    assert_true(hw_hash(hw_hash(0, "ab", 2), "c", 1) != hw_hash(hw_hash(0, "a", 1), "bc", 2));
    assert_true(hw_hash(9, "abc", 3) == hw_hash(9, "abc", 3));
}

static void the_system_is_measured(void **state)
{
    (void)state;
    double before = hw_clock_ms();
    uint64_t rss = hw_rss_bytes();
    size_t size = (size_t)64 << 20;
    char *block = malloc(size);
    assert_non_null(block);
    memset(block, 1, size);
    uint64_t grown = hw_rss_bytes();
    assert_int_equal(block[size / 2], 1);
    free(block);
    assert_true(grown >= rss + size / 2);
    // The block is gone, the peak remembers it (the kernel's two counters differ by some pages).
    assert_true(hw_rss_peak_bytes() >= rss + size / 2);
    assert_true(hw_clock_ms() >= before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_are_those_of_the_reference),
        cmocka_unit_test(streams_differ),
        cmocka_unit_test(floats_are_uniform_below_one),
        cmocka_unit_test(below_is_uniform),
        cmocka_unit_test(hashes_are_xxh3),
        cmocka_unit_test(the_system_is_measured),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
