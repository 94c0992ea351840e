// A build with a hierarchy of cells: every object is drawn from one level, and nothing is lost
// against a build without.
#include "alloc.h"
#include "build.h"
#include "cell_file.h"
#include "export.h"
#include "hierarchy.h"
#include "log.h"
#include "manifest.h"
#include "rng.h"
#include "shapes.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define SCENE   "levels_scene.glb"
#define OBJECTS 40

static int make_scene(void **state)
{
    (void)state;
    hw_log_set_quiet(true);
    hw_rng rng = hw_rng_make(11, 1);
    hw_mesh meshes[OBJECTS];
    hw_mat4 transforms[OBJECTS];
    for (uint32_t i = 0; i < OBJECTS; i++) {
        meshes[i] = shape_sphere(hw_v3(0, 0, 0), 2 + (float)(i % 5), 24 + i, 16);
        transforms[i] = hw_mat4_translation(-700 + 1400 * (double)hw_rng_float(&rng),
                                            -700 + 1400 * (double)hw_rng_float(&rng), 6);
    }
    hw_scene scene = shape_scene(meshes, transforms, OBJECTS);
    hw_status status = hw_scene_export_glb(&scene, SCENE);
    hw_scene_free(&scene);
    return status == HW_OK ? 0 : -1;
}

static void build(const char *dataset, int32_t levels, hw_manifest *manifest)
{
    char command[128];
    hw_build_report report;
    snprintf(command, sizeof command, "rm -rf %s", dataset);
    assert_int_equal(system(command), 0);
    hw_build_options o = hw_build_defaults();
    o.scene_path = SCENE;
    o.dataset = dataset;
    o.cell_size = 60;
    o.levels = levels;
    o.z_min = 2;
    o.z_max = 10;
    o.threads = 2;
    if (hw_build_run(&o, &report) != HW_OK)
        fail_msg("%s", hw_error_text());
    assert_int_equal(hw_manifest_read(dataset, manifest), HW_OK);
}

// Adds the objects that the cell draws, near ones and far ones.
static void count_objects(const char *dataset, hw_cell_id id, uint32_t near[OBJECTS],
                          uint32_t far[OBJECTS])
{
    char *path;
    hw_cell cell;
    assert_int_equal(hw_cell_path(&path, dataset, id), HW_OK);
    assert_int_equal(hw_cell_read(path, &cell), HW_OK);
    hw_free(path);
    for (uint32_t i = 0; i < cell.near_count; i++)
        near[cell.near[i].object_idx]++;
    for (uint32_t i = 0; i < cell.far_count; i++)
        far[cell.far[i].object_idx]++;
    assert_true(id.level == 0 || cell.near_count == 0);
    hw_cell_free(&cell);
}

static void one_level_draws_each_object(void **state)
{
    (void)state;
    hw_manifest flat, deep;
    build("levels_1", 1, &flat);
    build("levels_3", 3, &deep);
    uint32_t from_groups = 0;
    for (uint32_t i = 0; i < flat.cell_count; i++) {
        uint32_t near[2][OBJECTS] = {{0}}, far[2][OBJECTS] = {{0}};
        hw_cell_id id = flat.cells[i].id;
        count_objects("levels_1", id, near[0], far[0]);
        for (int32_t l = 0; l < 3; l++) {
            uint32_t before = 0, after = 0;
            for (uint32_t k = 0; k < OBJECTS; k++)
                before += far[1][k];
            count_objects("levels_3", hw_cell_ancestor(id, l), near[1], far[1]);
            for (uint32_t k = 0; k < OBJECTS; k++)
                after += far[1][k];
            from_groups += l > 0 ? after - before : 0;
        }
        for (uint32_t k = 0; k < OBJECTS; k++) {
            assert_int_equal(near[0][k] + far[0][k], 1);
            assert_int_equal(near[1][k] + far[1][k], 1);
            assert_int_equal(near[0][k], near[1][k]); // what is near is so in both
        }
    }
    assert_true(from_groups > flat.cell_count); // the groups do carry objects
    uint64_t bytes[2] = {0, 0};
    for (uint32_t i = 0; i < flat.cell_count; i++)
        bytes[0] += flat.cells[i].bytes;
    for (uint32_t i = 0; i < deep.cell_count; i++)
        bytes[1] += deep.cells[i].bytes;
    assert_true(deep.cell_count > flat.cell_count && bytes[1] < bytes[0]);
    hw_manifest_free(&flat);
    hw_manifest_free(&deep);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(one_level_draws_each_object)};
    return cmocka_run_group_tests(tests, make_scene, NULL);
}
