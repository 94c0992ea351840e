// clang-format off
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h>
// clang-format on
#include "checks.h"
#include "container.h"
#include "hash.h"

#define KIND HW_FOURCC('T', 'E', 'S', 'T')
#define ABCD HW_FOURCC('A', 'B', 'C', 'D')
#define EMPT HW_FOURCC('E', 'M', 'P', 'T')
#define PATH "container.bin"

static const char text[] = "to be or not to be, that is not the question here, to be or not to be";

static void write_sample(void)
{
    const hw_chunk chunks[] = {
        {ABCD, 0, text, sizeof text}, {ABCD, 7, text, 5}, {EMPT, 0, NULL, 0}};
    must(hw_container_write(PATH, KIND, 99, chunks, 3));
}

static hw_status read_chunk(const hw_container *c, uint32_t tag, uint32_t number)
{
    uint8_t *data = NULL;
    size_t size = 0;
    hw_status status = hw_container_chunk(c, tag, number, &data, &size);
    assert_true((status == HW_OK) == (data != NULL));
    hw_free(data);
    return status;
}

static hw_status read_all(const char *path)
{
    hw_container *c = NULL;
    hw_status status = hw_container_open(&c, path, KIND);
    if (status == HW_OK)
        status = read_chunk(c, ABCD, 0);
    if (status == HW_OK)
        status = read_chunk(c, ABCD, 7);
    if (status == HW_OK)
        status = read_chunk(c, EMPT, 0);
    hw_container_close(c);
    return status;
}

static hw_status write_and_read(const char *path)
{
    (void)path;
    const hw_chunk chunks[] = {
        {ABCD, 0, text, sizeof text}, {ABCD, 7, text, 5}, {EMPT, 0, NULL, 0}};
    HW_TRY(hw_container_write("container-2.bin", KIND, 99, chunks, 3));
    return read_all("container-2.bin");
}

static void check_sample(const hw_container *c)
{
    uint8_t *data = NULL;
    size_t size = 0, raw = 0, stored = 0;
    assert_int_equal(hw_container_key(c), 99);
    assert_int_equal(hw_container_chunk_count(c), 3);
    must(hw_container_chunk(c, ABCD, 0, &data, &size));
    assert_int_equal(size, sizeof text);
    assert_memory_equal(data, text, size);
    hw_free(data);
    must(hw_container_chunk(c, ABCD, 7, &data, &size));
    assert_int_equal(size, 5);
    assert_memory_equal(data, text, 5);
    hw_free(data);
    must(hw_container_chunk(c, EMPT, 0, &data, &size));
    assert_int_equal(size, 0);
    hw_free(data);
    must(hw_container_chunk_size(c, ABCD, 0, &raw, &stored));
    assert_int_equal(raw, sizeof text);
    assert_true(stored > 0 && stored < sizeof text);
    assert_int_equal(hw_container_chunk_size(c, ABCD, 1, &raw, &stored), HW_NOT_FOUND);
    assert_int_equal(hw_container_chunk(c, KIND, 0, &data, &size), HW_NOT_FOUND);
    assert_non_null(strstr(hw_error_text(), "TEST 0"));
}

static void test_round_trip(void **state)
{
    (void)state;
    hw_container *c = NULL;
    size_t size = 0;
    write_sample();
    must(hw_container_open(&c, PATH, KIND));
    check_sample(c);
    hw_container_close(c);
    uint8_t *bytes = read_bytes(PATH, &size);
    must(hw_container_open_memory(&c, "memory", bytes, size, KIND));
    assert_int_equal(hw_container_bytes(c), size);
    check_sample(c);
    hw_container_close(c);
    hw_free(bytes);
    hw_container_close(NULL);
}

static void test_documented_layout(void **state)
{
    (void)state;
    size_t size = 0;
    write_sample();
    uint8_t *bytes = read_bytes(PATH, &size);
    hw_bytes_reader r = hw_bytes_reader_make(bytes, size);
    assert_memory_equal(bytes, "TEST", 4);
    assert_int_equal(hw_get_u32(&r), KIND);
    assert_int_equal(hw_get_u32(&r), HW_CONTAINER_VERSION);
    assert_int_equal(hw_get_u64(&r), 99);
    assert_int_equal(hw_get_u32(&r), 3);
    assert_int_equal(hw_get_u32(&r), 0);
    assert_int_equal(hw_get_u64(&r), size);
    uint64_t end = 32 + 3 * 40 + 8;
    for (int i = 0; i < 3; i++) {
        assert_int_equal(hw_get_u32(&r), i < 2 ? ABCD : EMPT);
        assert_int_equal(hw_get_u32(&r), i == 1 ? 7 : 0);
        assert_int_equal(hw_get_u64(&r), end);
        uint64_t stored = hw_get_u64(&r);
        assert_int_equal(hw_get_u64(&r), i == 0 ? sizeof text : i == 1 ? 5 : 0);
        assert_true(hw_get_u64(&r) == hw_hash(0, bytes + end, stored));
        // zstd's magic number.
        assert_memory_equal(bytes + end, "\x28\xb5\x2f\xfd", 4);
        end += stored;
    }
    assert_true(hw_get_u64(&r) == hw_hash(0, bytes, 32 + 3 * 40));
    assert_int_equal(end, size);
    hw_free(bytes);
}

static void test_same_bytes(void **state)
{
    (void)state;
    size_t a_size = 0, b_size = 0;
    write_sample();
    uint8_t *a = read_bytes(PATH, &a_size);
    write_sample();
    uint8_t *b = read_bytes(PATH, &b_size);
    assert_int_equal(a_size, b_size);
    assert_memory_equal(a, b, a_size);
    hw_free(a);
    hw_free(b);
}

static void test_damage(void **state)
{
    (void)state;
    write_sample();
    check_damage(PATH, read_all);
}

static void test_torture(void **state)
{
    (void)state;
    write_sample();
    assert_true(check_torture(PATH, read_all) > 5);
    assert_true(check_torture(PATH, write_and_read) > 10);
}

// An old file stays as it is when its replacement fails.
static void test_failed_write_keeps_the_old_file(void **state)
{
    (void)state;
    const hw_chunk other = {KIND, 0, "x", 1};
    write_sample();
    for (uint64_t k = 1; k < 4; k++) {
        hw_file_fail_after(k);
        assert_int_equal(hw_container_write(PATH, KIND, 1, &other, 1), HW_IO);
        hw_file_fail_after(0);
        assert_int_equal(read_all(PATH), HW_OK);
    }
}

static void test_wrong_files(void **state)
{
    (void)state;
    hw_container *c = NULL;
    size_t size = 0;
    assert_int_equal(hw_container_open(&c, "no-such-file", KIND), HW_NOT_FOUND);
    assert_int_equal(hw_container_open(&c, ".", KIND), HW_IO);
    write_sample();
    assert_int_equal(hw_container_open(&c, PATH, ABCD), HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), PATH ": not a ABCD file"));
    write_bytes("empty.bin", "", 0);
    assert_int_equal(hw_container_open(&c, "empty.bin", KIND), HW_FORMAT);
    assert_null(c);
    uint8_t *bytes = read_bytes(PATH, &size);
    bytes[4]++;
    assert_int_equal(hw_container_open_memory(&c, "newer", bytes, size, KIND), HW_VERSION);
    assert_non_null(strstr(hw_error_text(), "newer: container version 2"));
    hw_free(bytes);
}

// Writes a number over the header's bytes at `offset` and makes the header's hash right again.
static void patch(uint8_t *bytes, uint32_t chunks, size_t offset, uint64_t value, size_t width)
{
    for (size_t i = 0; i < width; i++)
        bytes[offset + i] = (uint8_t)(value >> 8 * i);
    size_t end = 32 + chunks * 40u;
    uint64_t hash = hw_hash(0, bytes, end);
    for (size_t i = 0; i < 8; i++)
        bytes[end + i] = (uint8_t)(hash >> 8 * i);
}

static hw_status open_patched(const uint8_t *bytes, size_t size, size_t offset, uint64_t value,
                              size_t width)
{
    hw_container *c = NULL;
    uint8_t *copy = malloc(size);
    assert_non_null(copy);
    memcpy(copy, bytes, size);
    patch(copy, 3, offset, value, width);
    hw_status status = hw_container_open_memory(&c, "patched", copy, size, KIND);
    // What the table does not betray must come out when the chunk is read.
    for (uint32_t i = 0; status == HW_OK && i < 3; i++)
        status = read_chunk(c, i < 2 ? ABCD : EMPT, i == 1 ? 7 : 0);
    hw_container_close(c);
    free(copy);
    return status;
}

// Hostile tables under a right header hash.
static void test_hostile_tables(void **state)
{
    (void)state;
    size_t size = 0;
    write_sample();
    uint8_t *bytes = read_bytes(PATH, &size);
    assert_int_equal(open_patched(bytes, size, 4, HW_CONTAINER_VERSION, 4), HW_OK);
    const uint64_t values[] = {
        0, 1, 3, 1000, 1u << 30, UINT32_MAX, UINT64_MAX, UINT64_MAX - 100, (UINT64_C(1) << 63)};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
        for (size_t field = 8; field < 40; field += 8) // offset, stored, raw, hash
            assert_int_equal(open_patched(bytes, size, 32 + field, values[i], 8), HW_FORMAT);
        if (values[i] != 3)
            assert_int_equal(open_patched(bytes, size, 16, values[i], 4), HW_FORMAT);
        assert_int_equal(open_patched(bytes, size, 24, values[i], 8), HW_FORMAT);
    }
    // Twice the same chunk; overlapping chunks.
    assert_int_equal(open_patched(bytes, size, 32 + 40 + 4, 0, 4), HW_FORMAT);
    assert_int_equal(open_patched(bytes, size, 32 + 40 + 8, 32 + 120 + 8, 8), HW_FORMAT);
    hw_free(bytes);
}

// A last chunk of no bytes at all, which no frame is: refused before anyone asks for its bytes.
static void test_chunk_of_no_bytes(void **state)
{
    (void)state;
    size_t size = 0;
    hw_container *c = NULL;
    write_sample();
    uint8_t *bytes = read_bytes(PATH, &size);
    const size_t entry = 32 + 2 * 40;
    hw_bytes_reader r = hw_bytes_reader_make(bytes + entry + 16, 8);
    uint64_t stored = hw_get_u64(&r);
    patch(bytes, 3, 24, size - stored, 8);
    patch(bytes, 3, entry + 16, 0, 8);
    hw_status status = hw_container_open_memory(&c, "cut", bytes, size - (size_t)stored, KIND);
    assert_int_equal(status, HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), "cut: chunk 2"));
    hw_free(bytes);
}

// A chunk may become many times larger, but a small file must not ask for gigabytes: the table is
// checked, and what is written keeps within the check.
static void test_extreme_ratios(void **state)
{
    (void)state;
    const size_t size = (size_t)40 << 20;
    uint8_t *zeros = NULL, *bytes = NULL, *data = NULL;
    size_t file_size = 0, got = 0;
    hw_container *c = NULL;
    must(HW_NEW(&zeros, size));
    const hw_chunk chunks[3] = {{ABCD, 0, zeros, size}, {ABCD, 7, text, 5}, {EMPT, 0, NULL, 0}};
    must(hw_container_encode(KIND, 0, chunks, 3, &bytes, &file_size));
    assert_true(file_size < 30000);
    must(hw_container_open_memory(&c, "zeros", bytes, file_size, KIND));
    must(hw_container_chunk(c, ABCD, 0, &data, &got));
    assert_int_equal(got, size);
    assert_memory_equal(data, zeros, size);
    hw_container_close(c);
    hw_free(data);
    assert_int_equal(open_patched(bytes, file_size, 32 + 24, UINT64_C(1) << 30, 8), HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), "claims"));
    hw_free(bytes);
    hw_free(zeros);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_documented_layout),
        cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_damage),
        cmocka_unit_test(test_torture),
        cmocka_unit_test(test_failed_write_keeps_the_old_file),
        cmocka_unit_test(test_wrong_files),
        cmocka_unit_test(test_hostile_tables),
        cmocka_unit_test(test_chunk_of_no_bytes),
        cmocka_unit_test(test_extreme_ratios),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
