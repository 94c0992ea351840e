#include "alloc.h"
#include "bytes.h"
#include <math.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static void put_everything(hw_bytes_writer *w)
{
    hw_put_u8(w, 0x12);
    hw_put_u16(w, 0x3456);
    hw_put_u32(w, 0x789abcde);
    hw_put_u64(w, UINT64_C(0xfedcba9876543210));
    hw_put_i32(w, -2);
    hw_put_f32(w, -0.15625f);
    hw_put_f64(w, 1e-300);
    hw_put_bytes(w, "abc", 3);
}

static const size_t ends[] = {1, 3, 7, 15, 19, 23, 31, 34};
#define FIELDS (sizeof ends / sizeof *ends)

// Reads the fields of put_everything; bit i of the result: field i held its value.
static uint32_t get_everything(hw_bytes_reader *r)
{
    uint32_t right = 0;
    char text[3] = "??";
    right |= (uint32_t)(hw_get_u8(r) == 0x12) << 0;
    right |= (uint32_t)(hw_get_u16(r) == 0x3456) << 1;
    right |= (uint32_t)(hw_get_u32(r) == 0x789abcde) << 2;
    right |= (uint32_t)(hw_get_u64(r) == UINT64_C(0xfedcba9876543210)) << 3;
    right |= (uint32_t)(hw_get_i32(r) == -2) << 4;
    right |= (uint32_t)(hw_get_f32(r) == -0.15625f) << 5;
    right |= (uint32_t)(hw_get_f64(r) == 1e-300) << 6;
    hw_get_bytes(r, text, 3);
    right |= (uint32_t)(memcmp(text, "abc", 3) == 0) << 7;
    return right;
}

static void bytes_are_little_endian(void **state)
{
    (void)state;
    static const uint8_t expected[34] = {0x12, 0x56, 0x34, 0xde, 0xbc, 0x9a, 0x78, 0x10,
                                         0x32, 0x54, 0x76, 0x98, 0xba, 0xdc, 0xfe, 0xfe,
                                         0xff, 0xff, 0xff, 0x00, 0x00, 0x20, 0xbe};
    hw_bytes_writer w = {0};
    put_everything(&w);
    assert_int_equal(hw_bytes_writer_check(&w), HW_OK);
    assert_int_equal(w.size, 34);
    assert_memory_equal(w.data, expected, 23);
    hw_bytes_writer_free(&w);
    assert_null(w.data);
}

// Every prefix, in a block of exactly that size so that a sanitizer sees one byte too many.
static void every_prefix_fails_where_it_ends(void **state)
{
    (void)state;
    hw_bytes_writer w = {0};
    put_everything(&w);
    for (size_t size = 0; size <= w.size; size++) {
        uint8_t *prefix = NULL;
        assert_int_equal(HW_NEW(&prefix, size), HW_OK);
        memcpy(prefix, w.data, size);
        hw_bytes_reader r = hw_bytes_reader_make(prefix, size);
        uint32_t expected = 0;
        for (size_t i = 0; i < FIELDS; i++)
            expected |= (uint32_t)(ends[i] <= size) << i;
        assert_int_equal(get_everything(&r), expected);
        assert_int_equal(r.failed, size < w.size);
        assert_int_equal(hw_bytes_left(&r), 0);
        hw_free(prefix);
    }
    hw_bytes_writer_free(&w);
}

static void a_failed_reader_stays_failed(void **state)
{
    (void)state;
    static const uint8_t data[4] = {1, 2, 3, 4};
    hw_bytes_reader r = hw_bytes_reader_make(data, 4);
    assert_int_equal(hw_get_u8(&r), 1);
    assert_int_equal(hw_bytes_left(&r), 3);
    assert_int_equal(hw_get_u32(&r), 0);
    assert_true(r.failed);
    assert_int_equal(hw_get_u8(&r), 0); // although a byte would be there
    assert_null(hw_get_span(&r, 0));
    uint8_t out[2] = {9, 9};
    hw_get_bytes(&r, out, 2);
    assert_int_equal(out[0] | out[1], 0);
}

static void spans_point_into_the_data(void **state)
{
    (void)state;
    static const uint8_t data[4] = {1, 2, 3, 4};
    hw_bytes_reader r = hw_bytes_reader_make(data, 4);
    assert_ptr_equal(hw_get_span(&r, 3), data);
    assert_ptr_equal(hw_get_span(&r, 1), data + 3);
    assert_non_null(hw_get_span(&r, 0));
    assert_false(r.failed);
    assert_null(hw_get_span(&r, SIZE_MAX)); // position + size would overflow
    assert_true(r.failed);
    hw_bytes_reader empty = hw_bytes_reader_make(NULL, 0);
    assert_non_null(hw_get_span(&empty, 0));
    assert_int_equal(hw_get_u8(&empty), 0);
    assert_true(empty.failed);
}

static void special_floats_survive(void **state)
{
    (void)state;
    hw_bytes_writer w = {0};
    hw_put_f32(&w, -0.0f);
    hw_put_f32(&w, INFINITY);
    hw_put_f64(&w, NAN);
    hw_bytes_reader r = hw_bytes_reader_make(w.data, w.size);
    float zero = hw_get_f32(&r);
    assert_true(zero == 0 && signbit(zero));
    assert_true(isinf(hw_get_f32(&r)));
    assert_true(isnan(hw_get_f64(&r)));
    hw_bytes_writer_free(&w);
}

static void an_exhausted_writer_tells(void **state)
{
    (void)state;
    hw_bytes_writer w = {0};
    hw_alloc_fail_after(2); // the first growth succeeds
    for (int i = 0; i < 100; i++)
        hw_put_u64(&w, 1);
    hw_alloc_fail_after(0);
    assert_int_equal(hw_bytes_writer_check(&w), HW_MEMORY);
    size_t size = w.size;
    hw_put_u8(&w, 1);
    assert_int_equal(w.size, size);
    hw_bytes_writer_free(&w);
}

static void formatted_text_is_bounded(void **state)
{
    (void)state;
    hw_bytes_writer w = {0};
    hw_put_format(&w, "%d-%s", 42, "x");
    hw_put_format(&w, "%c", '!');
    assert_int_equal(w.size, 5);
    assert_memory_equal(w.data, "42-x!", 5);
    assert_int_equal(hw_bytes_writer_check(&w), HW_OK);
    hw_put_format(&w, "%*d", 1024, 1);
    assert_int_not_equal(hw_bytes_writer_check(&w), HW_OK);
    hw_bytes_writer_free(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bytes_are_little_endian),
        cmocka_unit_test(every_prefix_fails_where_it_ends),
        cmocka_unit_test(a_failed_reader_stays_failed),
        cmocka_unit_test(spans_point_into_the_data),
        cmocka_unit_test(special_floats_survive),
        cmocka_unit_test(an_exhausted_writer_tells),
        cmocka_unit_test(formatted_text_is_bounded),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
