#include "alloc.h"
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static void blocks_are_zeroed(void **state)
{
    (void)state;
    uint32_t *array = NULL;
    assert_int_equal(HW_NEW(&array, 1000), HW_OK);
    for (int i = 0; i < 1000; i++)
        assert_int_equal(array[i], 0);
    hw_free(array);
    hw_free(NULL);
}

static void nothing_is_a_valid_block(void **state)
{
    (void)state;
    void *block = NULL;
    assert_int_equal(hw_alloc(&block, 0, 8), HW_OK);
    assert_non_null(block);
    assert_int_equal(*(uint8_t *)block, 0);
    assert_int_equal(hw_realloc(&block, 8, 0), HW_OK);
    assert_non_null(block);
    hw_free(block);
}

static void overflow_is_caught(void **state)
{
    (void)state;
    uint64_t *array = (uint64_t *)1;
    assert_int_equal(HW_NEW(&array, SIZE_MAX / 8 + 1), HW_MEMORY);
    assert_null(array);
    assert_int_equal(HW_NEW(&array, SIZE_MAX / 8), HW_MEMORY);
    assert_null(array);
    assert_int_equal(HW_NEW(&array, 4), HW_OK);
    uint64_t *before = array;
    array[3] = 77;
    assert_int_equal(HW_RESIZE(&array, SIZE_MAX / 4), HW_MEMORY);
    assert_ptr_equal(array, before);
    assert_int_equal(array[3], 77);
    size_t capacity = 4;
    assert_int_equal(HW_RESERVE(&array, &capacity, SIZE_MAX / 8 + 2), HW_MEMORY);
    assert_ptr_equal(array, before);
    assert_int_equal(capacity, 4);
    hw_free(array);
}

static void resizing_keeps_the_contents(void **state)
{
    (void)state;
    uint32_t *array = NULL;
    assert_int_equal(HW_RESIZE(&array, 3), HW_OK);
    for (uint32_t i = 0; i < 3; i++)
        array[i] = i * i;
    assert_int_equal(HW_RESIZE(&array, 100000), HW_OK);
    assert_int_equal(array[2], 4);
    assert_int_equal(HW_RESIZE(&array, 2), HW_OK);
    assert_int_equal(array[1], 1);
    hw_free(array);
}

static void reserve_doubles(void **state)
{
    (void)state;
    uint32_t *array = NULL;
    size_t capacity = 0;
    hw_alloc_fail_after(0);
    for (uint32_t i = 0; i < 100000; i++) {
        assert_int_equal(HW_RESERVE(&array, &capacity, i + 1), HW_OK);
        assert_true(capacity >= i + 1);
        array[i] = i;
    }
    assert_true(hw_alloc_count() < 20); // logarithmic
    for (uint32_t i = 0; i < 100000; i++)
        assert_int_equal(array[i], i);
    hw_free(array);
}

static void strings_are_copied(void **state)
{
    (void)state;
    char text[] = "word", *copy = NULL;
    assert_int_equal(hw_strdup(&copy, text), HW_OK);
    text[0] = 'W';
    assert_string_equal(copy, "word");
    hw_free(copy);
}

static void the_nth_allocation_fails_once(void **state)
{
    (void)state;
    for (uint64_t n = 1; n <= 5; n++) {
        hw_alloc_fail_after(n);
        for (uint64_t i = 1; i <= 6; i++) {
            char *text = NULL;
            hw_status status = hw_strdup(&text, "text");
            assert_int_equal(status, i == n ? HW_MEMORY : HW_OK);
            assert_int_equal(text == NULL, i == n);
            assert_int_equal(hw_alloc_count(), i);
            hw_free(text);
        }
    }
    void *block = NULL;
    assert_int_equal(hw_alloc(&block, 1, 1), HW_OK);
    void *before = block;
    hw_alloc_fail_after(1);
    assert_int_equal(hw_realloc(&block, 1000, 1), HW_MEMORY);
    assert_ptr_equal(block, before);
    hw_alloc_fail_after(0);
    hw_free(block);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(blocks_are_zeroed),
        cmocka_unit_test(nothing_is_a_valid_block),
        cmocka_unit_test(overflow_is_caught),
        cmocka_unit_test(resizing_keeps_the_contents),
        cmocka_unit_test(reserve_doubles),
        cmocka_unit_test(strings_are_copied),
        cmocka_unit_test(the_nth_allocation_fails_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
