// clang-format off
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h>
// clang-format on
#include "checks.h"
#include "mesh_level.h"
#include "parallel.h"

#define PATH "mesh.hxm"

static void free_levels(hw_mesh levels[FIXTURE_LEVELS])
{
    for (int i = 0; i < FIXTURE_LEVELS; i++)
        hw_mesh_free(&levels[i]);
}

static void write_sample(const char *path, uint32_t side)
{
    hw_mesh levels[FIXTURE_LEVELS];
    hw_mesh_level_info infos[FIXTURE_LEVELS];
    fixture_levels(levels, infos, side);
    hw_inner_boxes boxes[FIXTURE_LEVELS];
    for (uint32_t i = 0; i < FIXTURE_LEVELS; i++)
        fixture_boxes(&boxes[i], &levels[i], 2 * i);
    must(hw_mesh_file_write(path, 31, levels, infos, boxes, FIXTURE_LEVELS));
    free_levels(levels);
}

static hw_status read_all(const char *path)
{
    hw_mesh_file *file = NULL;
    HW_TRY(hw_mesh_file_open(&file, path));
    hw_status status = HW_OK;
    for (uint32_t i = 0; status == HW_OK && i < hw_mesh_file_level_count(file); i++) {
        hw_mesh mesh;
        hw_inner_boxes boxes = {.count = 9};
        status = hw_mesh_file_read(file, i, &mesh, &boxes);
        if (status != HW_OK) {
            assert_null(mesh.positions);
            assert_int_equal(boxes.count, 0);
        }
        hw_mesh_free(&mesh);
    }
    hw_mesh_file_close(file);
    return status;
}

static hw_status write_only(const char *path)
{
    (void)path;
    hw_mesh_file *file = NULL;
    hw_mesh mesh;
    hw_inner_boxes boxes;
    HW_TRY(hw_mesh_file_open(&file, PATH));
    hw_mesh_level_info info = *hw_mesh_file_level(file, 0);
    hw_status status = hw_mesh_file_read(file, 0, &mesh, &boxes);
    if (status == HW_OK)
        status = hw_mesh_file_write("mesh-2.hxm", 1, &mesh, &info, &boxes, 1);
    hw_mesh_free(&mesh);
    hw_mesh_file_close(file);
    return status;
}

static void assert_same_mesh(const hw_mesh *a, const hw_mesh *b)
{
    uint32_t n = a->vertex_count;
    assert_int_equal(b->vertex_count, n);
    assert_int_equal(b->index_count, a->index_count);
    assert_memory_equal(a->positions, b->positions, n * sizeof *a->positions);
    assert_int_equal(a->normals != NULL, b->normals != NULL);
    assert_int_equal(a->colors != NULL, b->colors != NULL);
    assert_int_equal(a->uvs != NULL, b->uvs != NULL);
    for (uint32_t i = 0; a->normals && i < n; i++) {
        assert_true((double)hw_v3_length(hw_v3_sub(a->normals[i], b->normals[i])) < 1e-4);
        assert_true(fabs((double)hw_v3_length(b->normals[i]) - 1) < 1e-6);
    }
    if (a->colors)
        assert_memory_equal(a->colors, b->colors, n * sizeof *a->colors);
    if (a->uvs)
        assert_memory_equal(a->uvs, b->uvs, n * sizeof *a->uvs);
    for (uint32_t i = 0; i < a->index_count; i += 3) {
        bool found = false;
        for (uint32_t k = 0; k < 3; k++)
            found = found || (a->indices[i] == b->indices[i + k] &&
                              a->indices[i + 1] == b->indices[i + (k + 1) % 3] &&
                              a->indices[i + 2] == b->indices[i + (k + 2) % 3]);
        assert_true(found);
    }
}

static void test_round_trip(void **state)
{
    (void)state;
    const uint32_t sides[] = {4, 7, 40};
    for (int s = 0; s < 3; s++) {
        hw_mesh levels[FIXTURE_LEVELS];
        hw_mesh_level_info infos[FIXTURE_LEVELS];
        hw_inner_boxes boxes[FIXTURE_LEVELS] = {{.count = 0}};
        hw_mesh_file *file = NULL;
        fixture_levels(levels, infos, sides[s]);
        for (uint32_t i = 0; s > 0 && i < FIXTURE_LEVELS; i++)
            fixture_boxes(&boxes[i], &levels[i], 2 * i);
        must(hw_mesh_file_write(PATH, 31, levels, infos, s > 0 ? boxes : NULL, FIXTURE_LEVELS));
        must(hw_mesh_file_open(&file, PATH));
        assert_int_equal(hw_mesh_file_key(file), 31);
        assert_int_equal(hw_mesh_file_level_count(file), FIXTURE_LEVELS);
        // In any order.
        for (uint32_t i = FIXTURE_LEVELS; i-- > 0;) {
            hw_mesh mesh;
            assert_memory_equal(hw_mesh_file_level(file, i), &infos[i], sizeof infos[i]);
            hw_inner_boxes inside;
            must(hw_mesh_file_read(file, i, &mesh, &inside));
            assert_memory_equal(&inside, &boxes[i], sizeof inside);
            hw_mesh_free(&mesh);
            must(hw_mesh_file_read(file, i, &mesh, NULL)); // not wanted
            assert_same_mesh(&levels[i], &mesh);
            hw_mesh_free(&mesh);
        }
        hw_mesh_file_close(file);
        free_levels(levels);
    }
    hw_mesh_file_close(NULL);
}

static hw_status read_level(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    const hw_mesh_file *file = context;
    hw_mesh mesh, expected;
    uint32_t level = (uint32_t)(index % FIXTURE_LEVELS);
    HW_TRY(hw_mesh_file_read(file, level, &mesh, NULL));
    fixture_mesh(&expected, 20 - level, level < 2);
    bool same =
        mesh.vertex_count == expected.vertex_count &&
        !memcmp(mesh.positions, expected.positions, mesh.vertex_count * sizeof *mesh.positions);
    hw_mesh_free(&mesh);
    hw_mesh_free(&expected);
    return same ? HW_OK : HW_INTERNAL;
}

static void test_many_threads_read_one_file(void **state)
{
    (void)state;
    hw_mesh_file *file = NULL;
    write_sample(PATH, 20);
    must(hw_mesh_file_open(&file, PATH));
    assert_int_equal(hw_parallel_for(60, 4, read_level, file, NULL), HW_OK);
    hw_mesh_file_close(file);
}

static void test_same_bytes(void **state)
{
    (void)state;
    size_t a_size = 0, b_size = 0;
    write_sample("mesh-a.hxm", 9);
    write_sample("mesh-b.hxm", 9);
    uint8_t *a = read_bytes("mesh-a.hxm", &a_size), *b = read_bytes("mesh-b.hxm", &b_size);
    assert_int_equal(a_size, b_size);
    assert_memory_equal(a, b, a_size);
    hw_free(a);
    hw_free(b);
}

static void test_damage(void **state)
{
    (void)state;
    write_sample(PATH, 4);
    check_damage(PATH, read_all);
}

static void test_torture(void **state)
{
    (void)state;
    write_sample(PATH, 5);
    assert_true(check_torture(PATH, read_all) > 15);
    assert_true(check_torture(PATH, write_only) > 30);
}

static hw_vec3 random_unit(hw_rng *rng)
{
    for (;;) {
        float x = 2 * hw_rng_float(rng) - 1, y = 2 * hw_rng_float(rng) - 1;
        hw_vec3 v = hw_v3(x, y, 2 * hw_rng_float(rng) - 1);
        float length = hw_v3_length(v);
        if (length > 0.1f && length < 1)
            return hw_v3_scale(v, 1 / length);
    }
}

static void test_octahedral(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(1, 2);
    int16_t packed[2];
    for (int i = 0; i < 100000; i++) {
        hw_vec3 n = random_unit(&rng);
        if (i < 27) // axes, diagonals and zero
            n = hw_v3_normalize(
                hw_v3((float)(i % 3 - 1), (float)(i / 3 % 3 - 1), (float)(i / 9 - 1)));
        hw_octahedral_encode(n, packed);
        hw_vec3 back = hw_octahedral_decode(packed);
        if (hw_v3_length(n) == 0)
            n = hw_v3(0, 0, 1);
        assert_true((double)hw_v3_length(hw_v3_sub(n, back)) < 1e-4);
        assert_true(fabs((double)hw_v3_length(back) - 1) < 1e-6);
    }
    // Any 32 bits are some unit vector.
    for (int i = 0; i < 100000; i++) {
        uint32_t bits =
            i < 4 ? (uint32_t[]){0x80008000, 0x8000, 0x80000000, 0x7fff8000}[i] : hw_rng_u32(&rng);
        memcpy(packed, &bits, 4);
        assert_true(fabs((double)hw_v3_length(hw_octahedral_decode(packed)) - 1) < 1e-6);
    }
}

static void test_bad_levels(void **state)
{
    (void)state;
    hw_mesh levels[FIXTURE_LEVELS];
    hw_mesh_level_info good[FIXTURE_LEVELS], bad[FIXTURE_LEVELS];
    fixture_levels(levels, good, 5);
    for (int k = 0; k < 11; k++) {
        memcpy(bad, good, sizeof good);
        if (k == 0)
            bad[0].error_rms = 0.1f; // the original has no error
        if (k == 1)
            bad[2].error_rms = 0.4f; // falls
        if (k == 2)
            bad[2].error_p99 = NAN;
        if (k == 3)
            bad[1].error_silhouette = -1;
        if (k == 4)
            bad[1].error_p99 = INFINITY;
        if (k == 5)
            bad[1].vertex_count--;
        if (k == 6)
            bad[2].index_count -= 3;
        if (k == 7)
            bad[0].error_shading = 0.1f;
        if (k == 8)
            bad[2].error_shading = 0.1f; // falls
        if (k == 9)
            bad[2].error_shading = NAN;
        uint32_t count = k == 10 ? 0 : FIXTURE_LEVELS;
        assert_int_equal(hw_mesh_file_write("bad.hxm", 1, levels, bad, NULL, count), HW_FORMAT);
        assert_non_null(strstr(hw_error_text(), "bad.hxm: "));
    }
    assert_int_equal(hw_mesh_file_write("bad.hxm", 1, levels, good, NULL, HW_MESH_LEVELS_MAX + 1),
                     HW_FORMAT);
    levels[1].positions[3].y = NAN;
    assert_int_equal(hw_mesh_file_write("bad.hxm", 1, levels, good, NULL, FIXTURE_LEVELS),
                     HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), "bad.hxm: "));
    assert_false(hw_path_exists("bad.hxm"));
    free_levels(levels);
}

// Every chunk of a level cut anywhere, every word changed, past the checksums.
static void test_hostile_level(void **state)
{
    (void)state;
    hw_mesh mesh;
    uint8_t *bytes = NULL;
    size_t size = 0;
    fixture_mesh(&mesh, 5, true);
    hw_mesh_level_info info = {mesh.vertex_count, mesh.index_count, 0, 0, 0, 0};
    hw_inner_boxes boxes;
    fixture_boxes(&boxes, &mesh, HW_INNER_BOXES_MAX);
    must(hw_mesh_level_encode(&mesh, &boxes, &bytes, &size));
    hw_mesh_free(&mesh);
    for (size_t cut = 0; cut < size; cut++) {
        uint8_t *prefix = malloc(cut + !cut);
        assert_non_null(prefix);
        memcpy(prefix, bytes, cut);
        assert_int_equal(hw_mesh_level_decode("cut", &info, prefix, cut, &mesh, &boxes), HW_FORMAT);
        assert_int_equal(boxes.count, 0);
        assert_non_null(strstr(hw_error_text(), "cut: "));
        free(prefix);
    }
    const uint32_t values[] = {0, 1, 7, 8, 255, 0xffff, 0x7fffffff, 0xffffffff, 0x7f800000};
    for (size_t at = 0; at + 4 <= size; at++) {
        for (size_t v = 0; v < sizeof values / sizeof *values; v++) {
            uint8_t saved[4];
            memcpy(saved, bytes + at, 4);
            memcpy(bytes + at, &values[v], 4);
            if (hw_mesh_level_decode("hostile", &info, bytes, size, &mesh, &boxes) == HW_OK) {
                assert_int_equal(hw_mesh_validate(&mesh), HW_OK);
                assert_int_equal(hw_mesh_boxes_validate(&mesh, &boxes), HW_OK);
            }
            hw_mesh_free(&mesh);
            memcpy(bytes + at, saved, 4);
        }
    }
    // Counts that the streams cannot hold.
    const uint32_t counts[][2] = {{1u << 28, 96}, {25, 3u << 28}, {24, 96}, {300, 96}, {25, 93}};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        info.vertex_count = counts[i][0];
        info.index_count = counts[i][1];
        assert_int_equal(hw_mesh_level_decode("counts", &info, bytes, size, &mesh, NULL),
                         HW_FORMAT);
    }
    hw_free(bytes);
}

// A level's bytes with these boxes, encoded without a check.
static hw_status decode_with(const hw_mesh *mesh, const hw_inner_boxes *boxes, uint32_t count)
{
    hw_mesh_level_info info = {mesh->vertex_count, mesh->index_count, 0, 0, 0, 0};
    hw_mesh out;
    hw_inner_boxes got;
    uint8_t *bytes = NULL;
    size_t size = 0;
    must(hw_mesh_level_encode(mesh, boxes, &bytes, &size));
    memcpy(bytes + 4, &count, 4);
    hw_status status = hw_mesh_level_decode("boxes", &info, bytes, size, &out, &got);
    assert_int_equal(got.count, status == HW_OK ? count : 0);
    hw_mesh_free(&out);
    hw_free(bytes);
    return status;
}

static void test_hostile_boxes(void **state)
{
    (void)state;
    hw_mesh mesh;
    hw_inner_boxes good;
    fixture_mesh(&mesh, 5, true);
    fixture_boxes(&good, &mesh, HW_INNER_BOXES_MAX);
    assert_int_equal(decode_with(&mesh, &good, HW_INNER_BOXES_MAX), HW_OK);
    const uint32_t counts[] = {0, 3, HW_INNER_BOXES_MAX + 1, 255, UINT32_MAX};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        assert_int_equal(decode_with(&mesh, &good, counts[i]), HW_FORMAT);
    // Every coordinate, in the file and where it is written.
    float *numbers = &good.boxes[0].min.x;
    for (int at = 0; at < 24; at++) {
        bool upper = at % 6 > 2;
        const float bad[] = {NAN, INFINITY, -INFINITY, upper ? -1e9f : 1e9f, upper ? 1e9f : -1e9f};
        float saved = numbers[at];
        for (int k = 0; k < 5; k++) {
            const hw_mesh_level_info info = {mesh.vertex_count, mesh.index_count, 0, 0, 0, 0};
            numbers[at] = bad[k];
            assert_int_equal(decode_with(&mesh, &good, HW_INNER_BOXES_MAX), HW_FORMAT);
            assert_non_null(strstr(hw_error_text(), "boxes: "));
            assert_int_equal(hw_mesh_file_write("bad.hxm", 1, &mesh, &info, &good, 1), HW_FORMAT);
            assert_non_null(strstr(hw_error_text(), "bad.hxm: "));
        }
        numbers[at] = saved;
    }
    good.count = HW_INNER_BOXES_MAX + 1;
    assert_int_equal(hw_mesh_boxes_validate(&mesh, &good), HW_FORMAT);
    assert_false(hw_path_exists("bad.hxm"));
    hw_mesh_free(&mesh);
}

static void test_bad_tables(void **state)
{
    (void)state;
    hw_mesh_level_info infos[HW_MESH_LEVELS_MAX] = {{3, 3, 0, 0, 0, 0}, {3, 3, 1, 2, 3, 4}};
    uint8_t *bytes = NULL;
    size_t size = 0;
    uint32_t count = 0;
    must(hw_mesh_table_encode(infos, 2, &bytes, &size));
    must(hw_mesh_table_decode("table", bytes, size, infos, &count));
    assert_int_equal(count, 2);
    for (size_t cut = 0; cut < size; cut++)
        assert_int_equal(hw_mesh_table_decode("table", bytes, cut, infos, &count), HW_FORMAT);
    for (uint32_t n = 0; n < 256; n++) {
        bytes[4] = (uint8_t)n;
        if (n != 2)
            assert_int_equal(hw_mesh_table_decode("table", bytes, size, infos, &count), HW_FORMAT);
    }
    bytes[4] = 2;
    bytes[0] = 9;
    assert_int_equal(hw_mesh_table_decode("table", bytes, size, infos, &count), HW_VERSION);
    hw_free(bytes);
}

static void test_wrong_files(void **state)
{
    (void)state;
    assert_int_equal(read_all("no-such-mesh.hxm"), HW_NOT_FOUND);
    const hw_chunk chunk = {HW_FOURCC('L', 'E', 'V', 'L'), 0, "?", 1};
    must(hw_container_write("levels.hxm", HW_MESH_MAGIC, 0, &chunk, 1));
    assert_int_equal(read_all("levels.hxm"), HW_FORMAT);
    must(hw_container_write("levels.hxm", HW_CELL_MAGIC, 0, &chunk, 1));
    assert_int_equal(read_all("levels.hxm"), HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), "levels.hxm: not a HXWM file"));
    char *path = NULL;
    must(hw_mesh_path(&path, "set", 12));
    assert_string_equal(path, "set/meshes/12.hxm");
    hw_free(path);
    must(hw_texture_path(&path, "set", UINT32_MAX));
    assert_string_equal(path, "set/meshes/texture_4294967295.png");
    hw_free(path);
}

// ---- from pieces of a file ----

// Opens the front that `have` bytes are and reads all levels from their places in `bytes`.
static hw_status read_pieces(const uint8_t *bytes, size_t size, size_t have)
{
    hw_mesh_file *file = NULL;
    uint8_t *front = malloc(have ? have : 1);
    assert_non_null(front);
    memcpy(front, bytes, have);
    hw_status status = hw_mesh_file_open_front(&file, "pieces.hxm", front, have, size);
    free(front); // is not needed any more
    for (uint32_t i = 0; status == HW_OK && i < hw_mesh_file_level_count(file); i++) {
        hw_mesh mesh;
        uint64_t offset, length;
        hw_mesh_file_level_place(file, i, &offset, &length);
        assert_true(offset + length <= size);
        status = hw_mesh_file_decode(file, i, bytes + offset, (size_t)length, &mesh, NULL);
        hw_mesh_free(&mesh);
        if (status == HW_OK)
            assert_int_equal(
                hw_mesh_file_decode(file, i, bytes + offset, (size_t)length - 1, &mesh, NULL),
                HW_FORMAT);
    }
    hw_mesh_file_close(file);
    return status;
}

static void test_pieces(void **state)
{
    (void)state;
    size_t size = 0;
    write_sample(PATH, 20);
    uint8_t *bytes = read_bytes(PATH, &size);
    size_t front = size < HW_MESH_FRONT_BYTES ? size : HW_MESH_FRONT_BYTES;
    assert_int_equal(read_pieces(bytes, size, front), HW_OK);
    assert_int_equal(read_pieces(bytes, size + 1, front), HW_FORMAT); // the file has grown
    bool was_fine = false;
    for (size_t have = 0; have <= front; have++) {
        hw_status status = read_pieces(bytes, size, have);
        assert_true(status == HW_OK || (status == HW_FORMAT && !was_fine));
        was_fine = was_fine || status == HW_OK;
    }
    bytes[size - 20] ^= 1; // within the last level
    assert_int_equal(read_pieces(bytes, size, front), HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), "pieces.hxm"));
    hw_free(bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_many_threads_read_one_file),
        cmocka_unit_test(test_damage),
        cmocka_unit_test(test_torture),
        cmocka_unit_test(test_octahedral),
        cmocka_unit_test(test_bad_levels),
        cmocka_unit_test(test_hostile_level),
        cmocka_unit_test(test_hostile_boxes),
        cmocka_unit_test(test_bad_tables),
        cmocka_unit_test(test_wrong_files),
        cmocka_unit_test(test_pieces),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
