// How configuration C comes by its data when frames wait for them: cells and levels on demand,
// nothing allocated on a frame's path, and what broken files do.
#include "hybrid_dataset.h"

static void test_draw_allocates_nothing(void **state)
{
    fixture *f = *state;
    hw_renderer *renderer = open_renderer(f);
    for (int i = 0; i < 12; i++) {
        hw_camera camera = view(f, (float)i * 30 - 180, 0, 0);
        hw_frame_stats stats;
        hw_target_bind(f->target);
        assert_ok(hw_renderer_prepare(renderer, &camera, NULL));
        hw_alloc_fail_after(0);
        assert_ok(hw_renderer_draw(renderer, &camera, &stats));
        assert_int_equal(hw_alloc_count(), 0);
        assert_int_equal(stats.stalls, 0);
        assert_int_equal(stats.loaded_bytes, 0);
    }
    hw_renderer_destroy(renderer);
}

// Cells come on demand, and stay while there is room.
static void test_cells_come(void **state)
{
    fixture *f = *state;
    hw_renderer *renderer = open_renderer(f);
    hw_frame_stats stats;
    uint64_t first_round = 0;
    hw_target_bind(f->target);
    assert_true(f->manifest.cell_count > 20);
    for (int round = 0; round < 3; round++) {
        for (uint32_t i = 0; i < f->manifest.cell_count; i++) {
            hw_cell_id id = f->manifest.cells[i].id;
            hw_vec3 c = hw_cell_centre(&f->manifest.grid, id);
            hw_camera camera = model_camera(c, hw_v3(0, 1, 0), SIZE);
            assert_ok(hw_renderer_draw(renderer, &camera, &stats)); // without prepare: it waits
            assert_int_equal(stats.cell_q, id.q);
            assert_int_equal(stats.cell_r, id.r);
            assert_int_equal(stats.stalls, round == 0);
            assert_true(round > 0 || (stats.loaded_bytes > 0 && stats.load_ms > 0));
            assert_ok(hw_renderer_draw(renderer, &camera, &stats));
            assert_int_equal(stats.stalls, 0);
        }
        // A step back is free.
        hw_vec3 c =
            hw_cell_centre(&f->manifest.grid, f->manifest.cells[f->manifest.cell_count - 2].id);
        hw_camera camera = model_camera(c, hw_v3(0, 1, 0), SIZE);
        assert_ok(hw_renderer_prepare(renderer, &camera, &stats));
        assert_int_equal(stats.stalls, 0);
        if (round == 0)
            first_round = hw_renderer_gpu_bytes(renderer);
        assert_true(hw_renderer_gpu_bytes(renderer) <= first_round);
    }
    hw_renderer_destroy(renderer);
}

// Runs the function with the file replaced (or missing, with data NULL); puts it back.
static void check_broken(fixture *f, const char *name, const void *data, size_t size,
                         hw_status wanted)
{
    char path[96];
    uint8_t *saved = NULL;
    size_t saved_size;
    const hw_renderer_desc desc = {.config = HW_CONFIG_C, .dataset = f->folder};
    hw_camera camera = view(f, 0, 0, 0);
    hw_renderer *renderer = NULL;
    snprintf(path, sizeof path, "%s/%s", f->folder, name);
    assert_ok(hw_file_read(path, 0, &saved, &saved_size));
    if (data)
        assert_ok(hw_file_write(path, data, size));
    else
        assert_int_equal(unlink(path), 0);
    hw_status status = hw_renderer_create(&desc, &renderer);
    if (status == HW_OK)
        status = hw_renderer_prepare(renderer, &camera, NULL);
    if (status == HW_OK || (wanted != HW_OK && status != wanted))
        fail_msg("%s: %s (%s)", name, hw_status_text(status), hw_error_text());
    if (!strstr(hw_error_text(), name))
        fail_msg("\"%s\" does not name %s", hw_error_text(), name);
    assert_ok(hw_file_write(path, saved, saved_size));
    if (renderer) {
        // The renderer survives, and goes on once the file is there.
        hw_target_bind(f->target);
        assert_ok(hw_renderer_draw(renderer, &camera, NULL));
    }
    hw_renderer_destroy(renderer);
    hw_free(saved);
}

static void test_broken_files(void **state)
{
    fixture *f = *state;
    char cell[64], path[96];
    hw_cell_id home = hw_hexgrid_locate(&f->manifest.grid, 0, 0);
    snprintf(cell, sizeof cell, "cells/0/%d_%d.hxc", home.q, home.r);
    const char *const names[] = {"manifest.json", "meshes/0.hxm", "meshes/1.hxm",
                                 "meshes/texture_0.png", cell};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        uint8_t *data = NULL;
        size_t size;
        // hw_image_read has its own words for a missing image.
        if (i != 0)
            check_broken(f, names[i], NULL, 0, i == 3 ? HW_OK : HW_NOT_FOUND);
        check_broken(f, names[i], "rubbish", 7, HW_OK);
        snprintf(path, sizeof path, "%s/%s", f->folder, names[i]);
        assert_ok(hw_file_read(path, 0, &data, &size));
        check_broken(f, names[i], data, size / 2, HW_OK);
        hw_free(data);
    }
    hw_renderer *renderer = NULL;
    const hw_renderer_desc nowhere = {.config = HW_CONFIG_C, .dataset = "no-such-folder"};
    assert_int_equal(hw_renderer_create(&nowhere, &renderer), HW_NOT_FOUND);
    assert_non_null(strstr(hw_error_text(), "no-such-folder"));
}

// A cell of another place, with objects the manifest does not have, or of another build.
static void test_cells_that_do_not_belong(void **state)
{
    fixture *f = *state;
    char name[64], path[96];
    hw_cell_id home = hw_hexgrid_locate(&f->manifest.grid, 0, 0);
    snprintf(name, sizeof name, "cells/0/%d_%d.hxc", home.q, home.r);
    snprintf(path, sizeof path, "%s/other.hxc", f->folder);
    hw_near_record near = {OBJECTS, 0};
    for (int i = 0; i < 3; i++) {
        hw_cell cell = {.id = home, .key = f->manifest.key, .near_count = i == 1, .near = &near};
        cell.id.q += i == 0;
        cell.key += i == 2;
        uint8_t *data = NULL;
        size_t size;
        assert_ok(hw_cell_write(&cell, path));
        assert_ok(hw_file_read(path, 0, &data, &size));
        check_broken(f, name, data, size, HW_FORMAT);
        hw_free(data);
    }
}

static void test_failing_allocations(void **state)
{
    fixture *f = *state;
    const hw_renderer_desc desc = {.config = HW_CONFIG_C, .dataset = f->folder};
    hw_camera camera = view(f, 0, 0, 0);
    hw_target_bind(f->target);
    for (uint64_t n = 1;; n++) {
        hw_renderer *renderer = NULL;
        hw_alloc_fail_after(n);
        hw_status status = hw_renderer_create(&desc, &renderer);
        if (status == HW_OK)
            status = hw_renderer_draw(renderer, &camera, NULL);
        bool passed = hw_alloc_count() < n;
        hw_alloc_fail_after(0);
        if (renderer) // whatever failed, it can go on
            assert_ok(hw_renderer_draw(renderer, &camera, NULL));
        hw_renderer_destroy(renderer);
        if (passed)
            break;
        assert_true(n < 5000);
    }
}

// ---- debug views --------------------------------------------------------------------------------

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_draw_allocates_nothing),
        cmocka_unit_test(test_cells_come),
        cmocka_unit_test(test_broken_files),
        cmocka_unit_test(test_cells_that_do_not_belong),
        cmocka_unit_test(test_failing_allocations),
    };
    return cmocka_run_group_tests_name("draw_hybrid", tests, open_fixture, close_fixture);
}
