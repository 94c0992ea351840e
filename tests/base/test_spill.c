#include "alloc.h"
#include "file.h"
#include "parallel.h"
#include "spill.h"
#include <dirent.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define FOLDER  "spill-folder"
#define REGIONS 40u
#define BYTES   100000u

static uint8_t expected(uint32_t region, uint32_t at)
{
    return (uint8_t)(region * 31 + at * 7 + at / 251);
}

typedef struct regions {
    hw_spill *spill;
    const uint8_t *small[REGIONS], *large[REGIONS];
} regions;

static hw_status put_one(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    regions *all = context;
    uint8_t *data = NULL, small[5];
    uint32_t region;
    HW_TRY(HW_NEW(&data, BYTES));
    for (uint32_t i = 0; i < BYTES; i++)
        data[i] = expected((uint32_t)index, i);
    memcpy(small, data, sizeof small);
    hw_spill_block blocks[4] = {
        {small, sizeof small, NULL}, {NULL, 77, NULL}, {data, BYTES, NULL}, {data, 0, NULL}};
    HW_TRY(hw_spill_put(all->spill, blocks, 4, &region));
    hw_free(data);
    assert_null(blocks[1].mapped);
    assert_true((uintptr_t)blocks[0].mapped % 64 == 0 && (uintptr_t)blocks[2].mapped % 64 == 0);
    all->small[index] = blocks[0].mapped;
    all->large[index] = blocks[2].mapped;
    hw_spill_touch(all->spill, region);
    return HW_OK;
}

// Reads a region while others are dropped.
static hw_status check_one(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    regions *all = context;
    uint32_t r = (uint32_t)(index % REGIONS);
    if (index % 3 == 0)
        hw_spill_drop(all->spill, index % 2 == 0);
    for (uint32_t i = 0; i < BYTES; i++)
        if (all->large[r][i] != expected(r, i) || (i < 5 && all->small[r][i] != expected(r, i)))
            return hw_fail(HW_INTERNAL, "region %u differs at %u", r, i);
    return HW_OK;
}

static uint32_t file_count(void)
{
    uint32_t count = 0;
    DIR *dir = opendir(FOLDER);
    for (const struct dirent *e; (e = readdir(dir));)
        count += e->d_name[0] != '.';
    closedir(dir);
    return count;
}

static void what_goes_in_comes_out(void **state)
{
    (void)state;
    regions all = {0};
    assert_int_equal(hw_dir_make(FOLDER), HW_OK);
    assert_int_equal(hw_spill_create(&all.spill, FOLDER), HW_OK);
    assert_int_equal(file_count(), 0); // the file has no name
    hw_spill_drop(all.spill, false);   // nothing yet
    assert_int_equal(hw_parallel_for(REGIONS, 4, put_one, &all, NULL), HW_OK);
    assert_true(hw_spill_bytes(all.spill) >= (uint64_t)REGIONS * BYTES);
    assert_int_equal(hw_parallel_for(5 * REGIONS, 4, check_one, &all, NULL), HW_OK);
    assert_int_equal(file_count(), 0);
    hw_spill_destroy(all.spill);
    hw_spill_destroy(NULL);
    rmdir(FOLDER);
}

static void failures_are_named(void **state)
{
    (void)state;
    hw_spill *spill = NULL;
    assert_int_equal(hw_spill_create(&spill, "no-such-folder"), HW_IO);
    assert_non_null(strstr(hw_error_text(), "no-such-folder"));
    assert_null(spill);
    assert_int_equal(hw_dir_make(FOLDER), HW_OK);
    for (uint64_t n = 1; n <= 2; n++) {
        hw_alloc_fail_after(n);
        assert_int_equal(hw_spill_create(&spill, FOLDER), HW_MEMORY);
        hw_alloc_fail_after(0);
        assert_null(spill);
    }
    rmdir(FOLDER);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_goes_in_comes_out),
        cmocka_unit_test(failures_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
