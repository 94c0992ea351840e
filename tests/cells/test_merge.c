// Merges of a small made-up dataset: every file is checked, and a failure leaves nothing.
// clang-format off
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>
// clang-format on
#include "fixtures.h"
#include "hierarchy.h"
#include "image_io.h"
#include "log.h"
#include "merge.h"
#include <unistd.h>

#define WHOLE  "merge-whole"
#define TARGET "merge-target"
#define MESHES 2u

static void write_cells(hw_manifest *m)
{
    hw_cell_id *ids = NULL;
    must(hw_hierarchy_cells(&m->grid, &ids, &m->cell_count));
    must(HW_NEW(&m->cells, m->cell_count));
    for (uint32_t i = 0; i < m->cell_count; i++) {
        hw_cell cell;
        char *path = NULL;
        size_t size = 0;
        fixture_cell(&cell, ids[i].level == 0 ? 2 : 0, 1, 3);
        cell.id = ids[i];
        cell.key = m->key;
        must(hw_cell_path(&path, WHOLE, ids[i]));
        must(hw_cell_write(&cell, path));
        hw_free(read_bytes(path, &size));
        m->cells[i] = (hw_manifest_cell){ids[i], size};
        hw_free(path);
        hw_cell_free(&cell);
    }
    hw_free(ids);
}

static void write_meshes(const hw_manifest *m)
{
    hw_mesh levels[FIXTURE_LEVELS];
    hw_mesh_level_info infos[FIXTURE_LEVELS];
    hw_image image = {0};
    char *path = NULL;
    fixture_levels(levels, infos, 6);
    for (uint32_t i = 0; i < m->mesh_count; i++) {
        must(hw_mesh_path(&path, WHOLE, i));
        must(hw_mesh_file_write(path, m->key, levels, infos, NULL, FIXTURE_LEVELS));
        hw_free(path);
    }
    for (int i = 0; i < FIXTURE_LEVELS; i++)
        hw_mesh_free(&levels[i]);
    must(hw_image_make(&image, 16, 16, 3));
    must(hw_texture_path(&path, WHOLE, 0));
    must(hw_image_write(path, &image));
    hw_free(path);
    hw_image_free(&image);
}

static int write_whole(void **state)
{
    (void)state;
    hw_manifest m;
    hw_log_set_quiet(true);
    fixture_manifest(&m, 0, 0);
    hw_free(m.cells);
    m.grid = hw_hexgrid_cover(-40, -40, 40, 40, 50, 0, 24);
    m.grid.levels = 2;
    m.mesh_count = MESHES;
    m.texture_count = 1;
    must(hw_dir_make(WHOLE "/cells/0"));
    must(hw_dir_make(WHOLE "/cells/1"));
    must(hw_dir_make(WHOLE "/meshes"));
    write_cells(&m);
    write_meshes(&m);
    must(hw_manifest_write(WHOLE, &m));
    hw_manifest_free(&m);
    return 0;
}

static hw_status merge(void)
{
    static const char *const folders[] = {WHOLE};
    hw_merge_report report;
    return hw_merge_run(folders, 1, TARGET, 2, NULL, &report);
}

static void remove_target(void)
{
    assert_int_equal(system("rm -rf " TARGET), 0);
}

static void assert_fails(hw_status expected, const char *text)
{
    hw_status status = merge();
    if (status != expected || !strstr(hw_error_text(), text))
        fail_msg("%s: %s", hw_status_text(status), hw_error_text());
    assert_false(hw_path_exists(TARGET));
}

static void test_merged_is_the_same(void **state)
{
    (void)state;
    remove_target();
    must(merge());
    assert_int_equal(system("diff -r " WHOLE " " TARGET), 0);
    assert_int_equal(merge(), HW_USAGE);
    assert_true(hw_path_exists(TARGET "/manifest.json"));
}

// Textures are read like all else before the first file is written.
static void test_textures_are_checked(void **state)
{
    (void)state;
    size_t size = 0;
    uint8_t *bytes = read_bytes(WHOLE "/meshes/texture_0.png", &size);
    remove_target();
    write_bytes(WHOLE "/meshes/texture_0.png", bytes, size / 2);
    hw_status status = merge();
    assert_true(status == HW_FORMAT || status == HW_IO);
    assert_non_null(strstr(hw_error_text(), "merge-whole/meshes/texture_0.png"));
    assert_false(hw_path_exists(TARGET));
    remove(WHOLE "/meshes/texture_0.png");
    assert_fails(HW_NOT_FOUND, "merge-whole/meshes/texture_0.png");
    write_bytes(WHOLE "/meshes/texture_0.png", bytes, size);
    hw_free(bytes);
}

// Each file operation fails in turn, down to the very last, which comes after the manifest is in
// place: a folder that was made is gone again, one that was there is as it was.
static void test_failures_leave_nothing(void **state)
{
    (void)state;
    uint64_t n;
    for (int there = 0; there <= 2; there++) {
        for (n = 1;; n++) {
            remove_target();
            if (there)
                must(hw_dir_make(TARGET));
            if (there == 2)
                write_bytes(TARGET "/build.json", "{\"seconds\": 1}", 14);
            hw_file_fail_after(n);
            hw_status status = merge();
            hw_file_fail_after(0);
            if (status == HW_OK)
                break;
            assert_int_equal(status, HW_IO);
            assert_int_equal(hw_path_exists(TARGET), there > 0);
            assert_int_equal(hw_path_exists(TARGET "/build.json"), there == 2);
            assert_true(there == 0 || rmdir(TARGET) == (there == 2 ? -1 : 0));
            assert_false(hw_path_exists(TARGET "/manifest.json"));
            assert_false(hw_path_exists(TARGET "/cells"));
        }
        assert_true(n > 50);
        assert_int_equal(system("diff -r " WHOLE " " TARGET), 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_merged_is_the_same),
        cmocka_unit_test(test_textures_are_checked),
        cmocka_unit_test(test_failures_leave_nothing),
    };
    return cmocka_run_group_tests(tests, write_whole, NULL);
}
