// What every reader of a file must stand. Include cmocka.h before.
#pragma once
#include "fixtures.h"

// A reader under test: reads and frees whatever `path` holds.
typedef hw_status (*read_fn)(const char *path);

// Every prefix and every changed byte of the file must be an error that names it.
static UNUSED void check_damage(const char *path, read_fn read)
{
    size_t size = 0;
    uint8_t *bytes = read_bytes(path, &size);
    uint8_t *bad = malloc(size + 1);
    assert_non_null(bad);
    assert_int_equal(read(path), HW_OK);
    for (size_t i = 0; i < size; i++) {
        write_bytes("damaged.bin", bytes, i);
        hw_status status = read("damaged.bin");
        assert_true(status == HW_FORMAT || status == HW_VERSION);
        assert_non_null(strstr(hw_error_text(), "damaged.bin"));
    }
    for (size_t i = 0; i < 2 * size; i++) {
        memcpy(bad, bytes, size);
        bad[i / 2] ^= i % 2 ? 0xff : (uint8_t)(1u << (i / 2 % 8));
        write_bytes("damaged.bin", bad, size);
        hw_status status = read("damaged.bin");
        assert_true(status == HW_FORMAT || status == HW_VERSION);
        assert_non_null(strstr(hw_error_text(), "damaged.bin"));
    }
    memcpy(bad, bytes, size);
    bad[size] = 0;
    write_bytes("damaged.bin", bad, size + 1);
    assert_int_equal(read("damaged.bin"), HW_FORMAT);
    free(bad);
    hw_free(bytes);
}

// Each allocation and each file operation fails in turn: a status, nothing else. Returns how many
// allocations there were.
static UNUSED uint64_t check_torture(const char *path, read_fn run)
{
    uint64_t n = 1;
    for (;; n++) {
        hw_alloc_fail_after(n);
        hw_status status = run(path);
        bool reached = hw_alloc_count() >= n;
        hw_alloc_fail_after(0);
        assert_int_equal(status, reached ? HW_MEMORY : HW_OK);
        if (!reached)
            break;
    }
    for (uint64_t k = 1;; k++) {
        hw_file_fail_after(k);
        hw_status status = run(path);
        hw_file_fail_after(0);
        if (status == HW_OK)
            break;
        assert_int_equal(status, HW_IO);
        assert_true(k < 100);
    }
    return n - 1;
}
