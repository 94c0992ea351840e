// clang-format off
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>
// clang-format on
#include "checks.h"
#include "json.h"
#include "shard.h"
#include <errno.h>

#define FOLDER "manifest-set"
#define PATH   FOLDER "/manifest.json"

static void write_sample(void)
{
    hw_manifest m;
    must(hw_dir_make(FOLDER));
    fixture_manifest(&m, 5, 7);
    must(hw_manifest_write(FOLDER, &m));
    hw_manifest_free(&m);
}

static hw_status read_set(const char *folder)
{
    hw_manifest m;
    hw_status status = hw_manifest_read(folder, &m);
    if (status != HW_OK)
        assert_null(m.objects);
    hw_manifest_free(&m);
    return status;
}

// Numbers are written with 15 digits or more: doubles may come back one unit in the last place off.
static void assert_close(double a, double b)
{
    assert_true(fabs(a - b) <= 4e-16 * fabs(a));
}

static void assert_same_grid(const hw_hexgrid *a, const hw_hexgrid *b)
{
    assert_close(a->origin_x, b->origin_x);
    assert_close(a->origin_y, b->origin_y);
    assert_close(a->cell_size, b->cell_size);
    assert_close(a->z_min, b->z_min);
    assert_close(a->z_max, b->z_max);
    assert_int_equal(a->columns, b->columns);
    assert_int_equal(a->rows, b->rows);
}

static void assert_same(const hw_manifest *a, const hw_manifest *b)
{
    assert_string_equal(a->scene_path, b->scene_path);
    assert_string_equal(a->policy, b->policy);
    assert_true(a->scene_hash == b->scene_hash && a->key == b->key);
    assert_true(a->scene_triangles == b->scene_triangles);
    assert_close(a->self_occlusion_px, b->self_occlusion_px);
    assert_close(a->edge_length_px, b->edge_length_px);
    assert_close(a->near_error_px, b->near_error_px);
    assert_close(a->build_seconds, b->build_seconds);
    assert_true(a->near_bytes == b->near_bytes);
    assert_int_equal(a->clusters, b->clusters);
    assert_int_equal(a->multi_view, b->multi_view);
    assert_true(a->mesh_bytes == b->mesh_bytes && a->texture_bytes == b->texture_bytes);
    assert_same_grid(&a->grid, &b->grid);
    assert_memory_equal(&a->ground.rect, &b->ground.rect, sizeof a->ground.rect);
    assert_memory_equal(a->ground.color, b->ground.color, sizeof a->ground.color);
    assert_int_equal(a->ground.present, b->ground.present);
    assert_int_equal(a->mesh_count, b->mesh_count);
    assert_int_equal(a->texture_count, b->texture_count);
    assert_int_equal(a->object_count, b->object_count);
    assert_int_equal(a->cell_count, b->cell_count);
    for (uint32_t i = 0; i < a->object_count; i++) {
        const hw_manifest_object *o = &a->objects[i], *p = &b->objects[i];
        assert_int_equal(o->mesh_idx, p->mesh_idx);
        assert_int_equal(o->texture_idx, p->texture_idx);
        for (int k = 0; k < 16; k++)
            assert_close(o->transform.m[k], p->transform.m[k]);
        assert_memory_equal(&o->bounds, &p->bounds, sizeof o->bounds);
        assert_memory_equal(o->color, p->color, sizeof o->color);
    }
    for (uint32_t i = 0; i < a->cell_count; i++) {
        assert_memory_equal(&a->cells[i].id, &b->cells[i].id, sizeof a->cells[i].id);
        assert_true(a->cells[i].bytes == b->cells[i].bytes);
    }
}

static void test_round_trip(void **state)
{
    (void)state;
    const uint32_t shapes[][2] = {{0, 0}, {1, 1}, {5, 7}, {300, 100}};
    must(hw_dir_make(FOLDER));
    for (int i = 0; i < 4; i++) {
        hw_manifest m, back;
        fixture_manifest(&m, shapes[i][0], shapes[i][1]);
        if (i == 0)
            m.ground = (hw_ground){0};
        m.clusters = i % 2;
        m.multi_view = i / 2;
        must(hw_manifest_write(FOLDER, &m));
        must(hw_manifest_read(FOLDER, &back));
        assert_same(&m, &back);
        hw_manifest_free(&m);
        hw_manifest_free(&back);
    }
    hw_manifest_free(NULL);
}

// What a manifest does not tell to be absent may be there.
static void test_possible_members(void **state)
{
    (void)state;
    static const char *const members[2] = {"\"clusters\"", "\"multi_view\""};
    size_t size = 0;
    write_sample();
    for (int i = 0; i < 2; i++) {
        uint8_t *text = read_bytes(PATH, &size);
        char *member = memmem(text, size, members[i], strlen(members[i]));
        hw_manifest m;
        assert_non_null(member);
        must(hw_manifest_read(FOLDER, &m));
        assert_false(m.clusters || m.multi_view);
        hw_manifest_free(&m);
        // Under another name, or the same in another case.
        member[1] = i ? 'x' : 'C';
        must(hw_manifest_parse("text", (const char *)text, size, &m));
        assert_int_equal(m.clusters, i == 0);
        assert_int_equal(m.multi_view, i == 1);
        hw_manifest_free(&m);
        hw_free(text);
    }
}

// The same bytes, in whatever order the cells are given.
static void test_cells_are_sorted(void **state)
{
    (void)state;
    hw_manifest m;
    size_t a_size = 0, b_size = 0;
    write_sample();
    uint8_t *a = read_bytes(PATH, &a_size);
    fixture_manifest(&m, 5, 7);
    hw_manifest_cell first = m.cells[0];
    m.cells[0] = m.cells[4];
    m.cells[4] = first;
    must(hw_manifest_write(FOLDER, &m));
    uint8_t *b = read_bytes(PATH, &b_size);
    assert_int_equal(a_size, b_size);
    assert_memory_equal(a, b, a_size);
    m.cells[3] = m.cells[4];
    assert_int_equal(hw_manifest_write(FOLDER, &m), HW_FORMAT); // twice the same cell
    hw_manifest_free(&m);
    hw_free(a);
    hw_free(b);
}

static hw_status parse(const char *text, size_t size)
{
    hw_manifest m;
    hw_status status = hw_manifest_parse("text", text, size, &m);
    if (status != HW_OK)
        assert_non_null(strstr(hw_error_text(), "text: "));
    hw_manifest_free(&m);
    return status;
}

// Every prefix but the whole is an error; a changed byte may be harmless (a digit), but whatever is
// accepted is valid.
static void test_damage(void **state)
{
    (void)state;
    size_t size = 0;
    write_sample();
    uint8_t *bytes = read_bytes(PATH, &size);
    assert_int_equal(parse((const char *)bytes, size), HW_OK);
    for (size_t i = 0; i + 2 < size; i++) { // the last byte is a newline
        char *prefix = malloc(i + 1);
        assert_non_null(prefix);
        memcpy(prefix, bytes, i);
        assert_int_equal(parse(prefix, i), HW_FORMAT);
        free(prefix);
    }
    const uint8_t flips[] = {0xff, 1, 0x20, 0x80};
    for (size_t i = 0; i < size * sizeof flips; i++) {
        uint8_t saved = bytes[i / sizeof flips];
        bytes[i / sizeof flips] ^= flips[i % sizeof flips];
        hw_status status = parse((const char *)bytes, size);
        assert_true(status == HW_OK || status == HW_FORMAT || status == HW_VERSION);
        bytes[i / sizeof flips] = saved;
    }
    hw_free(bytes);
}

// The sample with one member replaced or (NULL) left out. `owner`: NULL, "grid", "ground", or
// "objects" and "cells" for the second item.
static hw_status parse_changed(const char *owner, const char *key, const char *value)
{
    cJSON *json = NULL;
    must(hw_json_read(PATH, &json));
    cJSON *parent = owner ? cJSON_GetObjectItem(json, owner) : json;
    if (cJSON_IsArray(parent))
        parent = cJSON_GetArrayItem(parent, 1);
    assert_true(cJSON_HasObjectItem(parent, key));
    if (value)
        assert_true(cJSON_ReplaceItemInObject(parent, key, cJSON_Parse(value)));
    else
        cJSON_DeleteItemFromObject(parent, key);
    char *text = cJSON_Print(json);
    assert_non_null(text);
    hw_status status = parse(text, strlen(text));
    cJSON_free(text);
    cJSON_Delete(json);
    return status;
}

static void test_hostile_members(void **state)
{
    (void)state;
    static const char *const cases[][3] = {
        {NULL, "scene", "3"},
        {NULL, "scene_hash", "\"fedcba987654321\""},
        {NULL, "scene_hash", "\"fedcba987654321 \""},
        {NULL, "key", "\"-000000000000001\""},
        {NULL, "key", "42"},
        {NULL, "scene_triangles", "-1"},
        {NULL, "scene_triangles", "1.5"},
        {NULL, "mesh_bytes", "1e300"},
        {NULL, "mesh_bytes", "1e999"},
        {NULL, "policy", "null"},
        {NULL, "mesh_count", "3"},
        {NULL, "mesh_count", "4294967296"},
        {NULL, "mesh_count", "16777217"},
        {NULL, "texture_count", "16777217"},
        {NULL, "texture_count", "1"},
        {NULL, "objects", "{}"},
        {NULL, "objects", "[1]"},
        {NULL, "cells", "[[]]"},
        {NULL, "cells", "7"},
        {NULL, "grid", "[]"},
        {"grid", "cell_size", "0"},
        {"grid", "cell_size", "-50"},
        {"grid", "heights", "[24, 0]"},
        {"grid", "heights", "[24]"},
        {"grid", "columns", "0"},
        {"grid", "columns", "65536"},
        {"grid", "rows", "1"},
        {"grid", "origin", "[0, 1e999]"},
        {"ground", "present", "1"},
        {"ground", "rect", "[1, 0, 0, 0, 1, 0]"},
        {"ground", "color", "[0, 0]"},
        {"objects", "mesh", "4"},
        {"objects", "mesh", "-1"},
        {"objects", "texture", "2"},
        {"objects", "texture", "-2"},
        {"objects", "transform", "[1,0,0,1, 0,1,0,0, 0,0,1,0, 0,0,0,1]"},
        {"objects", "transform", "[1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,0]"},
        {"objects", "transform", "[1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0]"},
        {"objects", "bounds", "[0, 0, 0, 1, -1, 1]"},
        {"objects", "bounds", "[0, 0, 0, 1, 1, 1, 1]"},
        {"objects", "color", "[0, null, 0]"},
        {"cells", "id", "[0, 0, 0]"},
        {"cells", "id", "[0, -1, 5]"},
        {"cells", "id", "[0, 9999, 5]"},
        {"cells", "id", "[-1, 0, 5]"},
        {"cells", "id", "[31, 0, 5]"},
        {"cells", "id", "[0, 0.5, 5]"},
        {"cells", "id", "[0, 1e18, 5]"},
        {"cells", "bytes", "-1"},
    };
    write_sample();
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_int_equal(parse_changed(cases[i][0], cases[i][1], cases[i][2]), HW_FORMAT);
        assert_int_equal(parse_changed(cases[i][0], cases[i][1], NULL), HW_FORMAT);
    }
    assert_int_equal(parse_changed(NULL, "mesh_count", "16777216"), HW_OK);
    assert_int_equal(parse_changed(NULL, "version", "2"), HW_OK);
    assert_int_equal(parse_changed(NULL, "version", NULL), HW_FORMAT);
    assert_int_equal(parse_changed(NULL, "version", "3"), HW_VERSION);
    assert_non_null(strstr(hw_error_text(), "dataset version 3, this program reads 2"));
}

static void test_wrong_folders(void **state)
{
    (void)state;
    assert_int_equal(read_set("no-such-set"), HW_NOT_FOUND);
    assert_non_null(strstr(hw_error_text(), "no-such-set: no such dataset"));
    // What cannot be looked at may well be there.
    char long_name[300];
    memset(long_name, 'x', sizeof long_name - 1);
    long_name[sizeof long_name - 1] = 0;
    assert_int_equal(read_set(long_name), HW_IO);
    assert_non_null(strstr(hw_error_text(), strerror(ENAMETOOLONG)));
    must(hw_dir_make("empty-set"));
    assert_int_equal(read_set("empty-set"), HW_NOT_FOUND);
    assert_non_null(strstr(hw_error_text(), "empty-set: not a finished dataset"));
    write_bytes("empty-set/manifest.json", "", 0);
    assert_int_equal(read_set("empty-set"), HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), "empty-set/manifest.json"));
    remove("empty-set/manifest.json");
    hw_manifest m;
    fixture_manifest(&m, 1, 1);
    assert_int_equal(hw_manifest_write("no-such-set", &m), HW_IO);
    m.objects[0].bounds.min.x = NAN;
    assert_int_equal(hw_manifest_write(FOLDER, &m), HW_FORMAT);
    hw_manifest_free(&m);
}

static hw_status write_and_read(const char *folder)
{
    hw_manifest m;
    HW_TRY(hw_manifest_read(folder, &m));
    hw_status status = hw_manifest_write(folder, &m);
    hw_manifest_free(&m);
    return status;
}

static void test_torture(void **state)
{
    (void)state;
    write_sample();
    assert_true(check_torture(FOLDER, read_set) > 5);
    assert_true(check_torture(FOLDER, write_and_read) > 10);
    assert_int_equal(read_set(FOLDER), HW_OK);
}

// cJSON drops what it has no memory for; a manifest with less in it must not be written.
static size_t json_budget;
static void *limited_malloc(size_t size)
{
    if (json_budget == 0)
        return NULL;
    json_budget--;
    return malloc(size);
}

static void test_json_memory(void **state)
{
    (void)state;
    hw_manifest m, back;
    cJSON_Hooks hooks = {limited_malloc, free};
    write_sample();
    fixture_manifest(&m, 5, 7);
    size_t failures = 0;
    for (size_t budget = 0;; budget++) {
        json_budget = budget;
        cJSON_InitHooks(&hooks);
        hw_status status = hw_manifest_write(FOLDER, &m);
        cJSON_InitHooks(NULL);
        must(hw_manifest_read(FOLDER, &back));
        assert_same(&m, &back);
        hw_manifest_free(&back);
        if (status == HW_OK)
            break;
        assert_int_equal(status, HW_MEMORY);
        failures++;
    }
    assert_true(failures > 300);
    hw_manifest_free(&m);
}

// Shards come back in the order of their numbers, and only whole ones are datasets.
static void test_shards(void **state)
{
    (void)state;
    hw_manifest m, *back = NULL;
    uint32_t count;
    must(hw_dir_make("shard-set"));
    must(hw_shards_read("shard-set", &back, &count));
    assert_int_equal(count, 0);
    hw_free(back);
    fixture_manifest(&m, 5, 7);
    m.shard_count = 12;
    static const uint32_t made[] = {10, 0, 2};
    for (int i = 0; i < 3; i++) {
        m.shard_index = made[i];
        must(hw_shard_write("shard-set", &m));
    }
    must(hw_file_write("shard-set/shard_03_of_12.json", "{}", 2)); // not a name of ours
    must(hw_file_write("shard-set/shard_13_of_12.json", "{}", 2));
    must(hw_shards_read("shard-set", &back, &count));
    assert_int_equal(count, 3);
    for (uint32_t i = 0; i < 3; i++) {
        static const uint32_t order[] = {0, 2, 10};
        assert_int_equal(back[i].shard_index, order[i]);
        assert_int_equal(back[i].shard_count, 12);
        assert_same(&m, &back[i]);
        hw_manifest_free(&back[i]);
    }
    hw_free(back);
    // A shard under the name of another, or of the whole.
    must(hw_file_write("shard-set/shard_5_of_12.json", "{}", 2));
    assert_int_equal(hw_shards_read("shard-set", &back, &count), HW_FORMAT);
    assert_null(back);
    assert_int_equal(system("cp shard-set/shard_1_of_12.json shard-set/shard_5_of_12.json && "
                            "cp shard-set/shard_1_of_12.json shard-set/manifest.json"),
                     0);
    assert_int_equal(hw_shards_read("shard-set", &back, &count), HW_FORMAT);
    assert_int_equal(read_set("shard-set"), HW_FORMAT);
    must(hw_shards_remove("shard-set"));
    must(hw_shards_read("shard-set", &back, &count));
    assert_int_equal(count, 0);
    hw_free(back);
    assert_true(hw_path_exists("shard-set/shard_03_of_12.json"));
    assert_int_equal(hw_shards_read("no-such-set", &back, &count), HW_NOT_FOUND);
    hw_manifest_free(&m);
    assert_int_equal(system("rm -r shard-set"), 0);
    uint32_t owners = 0;
    for (uint32_t k = 0; k < 3; k++)
        owners += hw_shard_owns(k, 3, 100);
    assert_int_equal(owners, 1);
    assert_true(hw_shard_owns(0, 0, 5) && hw_shard_owns(0, 1, 5));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_round_trip),       cmocka_unit_test(test_possible_members),
        cmocka_unit_test(test_cells_are_sorted), cmocka_unit_test(test_damage),
        cmocka_unit_test(test_hostile_members),  cmocka_unit_test(test_wrong_folders),
        cmocka_unit_test(test_torture),          cmocka_unit_test(test_json_memory),
        cmocka_unit_test(test_shards),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
