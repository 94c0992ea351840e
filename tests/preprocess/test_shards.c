// Builds cut into shards, merges, and bounds of memory: none of them changes a byte.
#include "alloc.h"
#include "build.h"
#include "export.h"
#include "file.h"
#include "log.h"
#include "merge.h"
#include "shapes.h"
#include "system.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define SCENE "shards_scene.glb"

// Spheres of radius 6: one in the middle, one far to the east, and one so far to the north that
// groups stand for it and captures take a coarser level.
static int make_scene(void **state)
{
    (void)state;
    hw_log_set_quiet(true);
    hw_mesh meshes[3];
    hw_mat4 transforms[3] = {hw_mat4_translation(0, 0, 6), hw_mat4_translation(400, 10, 6),
                             hw_mat4_translation(0, 1300, 6)};
    for (int i = 0; i < 3; i++)
        meshes[i] = shape_sphere(hw_v3(0, 0, 0), 6, 20 + 20 * (uint32_t)i, i == 2 ? 40 : 12);
    hw_scene scene = shape_scene(meshes, transforms, 3);
    hw_status status = hw_scene_export_glb(&scene, SCENE);
    hw_scene_free(&scene);
    return status == HW_OK ? 0 : -1;
}

static hw_build_options options_for(const char *dataset)
{
    hw_build_options o = hw_build_defaults();
    o.scene_path = SCENE;
    o.dataset = dataset;
    o.cell_size = 120;
    o.levels = 2;
    o.z_min = 2;
    o.z_max = 10;
    o.threads = 2;
    return o;
}

static void remove_tree(const char *path)
{
    char command[512];
    snprintf(command, sizeof command, "rm -rf '%s'", path);
    assert_int_equal(system(command), 0);
}

static void build(const hw_build_options *o, hw_build_report *report)
{
    hw_status status = hw_build_run(o, report);
    if (status != HW_OK)
        print_error("%s\n", hw_error_text());
    assert_int_equal(status, HW_OK);
}

// Every file of both folders has the same bytes; build.json, which tells the time it took, is left
// out.
static void assert_same_datasets(const char *a, const char *b)
{
    char command[512];
    snprintf(command, sizeof command, "diff -rq --exclude=build.json '%s' '%s'", a, b);
    assert_int_equal(system(command), 0);
}

// Makes all N shards, each with another number of threads, into folders of their own.
static void build_shards(uint32_t n, char names[][32])
{
    for (uint32_t k = 0; k < n; k++) {
        hw_build_report report;
        snprintf(names[k], 32, "sh_shard_%u", k);
        remove_tree(names[k]);
        hw_build_options o = options_for(names[k]);
        o.threads = 1 + k;
        o.shard_index = k;
        o.shard_count = n;
        build(&o, &report);
        assert_int_equal(report.cells_made + report.cells_missing, report.cells_total);
    }
}

static hw_status merge(char names[][32], uint32_t count, const char *dataset)
{
    const char *folders[8];
    hw_merge_report report;
    for (uint32_t i = 0; i < count; i++)
        folders[i] = names[i];
    return hw_merge_run(folders, count, dataset, 2, NULL, &report);
}

static void merged_shards_are_the_whole(void **state)
{
    (void)state;
    char names[8][32];
    for (uint32_t n = 1; n <= 3; n++) {
        remove_tree("sh_merged");
        build_shards(n, names);
        assert_int_equal(merge(names, n, "sh_merged"), HW_OK);
        assert_same_datasets("sh_a", "sh_merged");
        // Finished is finished.
        assert_int_equal(merge(names, n, "sh_merged"), HW_USAGE);
        assert_same_datasets("sh_a", "sh_merged");
    }
    // Two shards in one folder and one in another.
    remove_tree("sh_merged");
    assert_int_equal(system("rm -rf sh_pair && cp -r sh_shard_0 sh_pair && "
                            "cp -r sh_shard_1/. sh_pair"),
                     0);
    snprintf(names[0], 32, "sh_shard_2");
    snprintf(names[1], 32, "sh_pair");
    assert_int_equal(merge(names, 2, "sh_merged"), HW_OK);
    assert_same_datasets("sh_a", "sh_merged");
    // All shards in one folder leave nothing but the dataset.
    remove_tree("sh_merged");
    for (uint32_t k = 0; k < 3; k++) {
        hw_build_report report;
        hw_build_options o = options_for("sh_merged");
        o.shard_index = (k + 1) % 3;
        o.shard_count = 3;
        build(&o, &report);
        assert_int_equal(report.cells_missing == 0 && report.meshes_missing == 0, k == 2);
    }
    assert_same_datasets("sh_a", "sh_merged");
}

static void assert_merge_fails(char names[][32], uint32_t count, hw_status expected,
                               const char *text)
{
    hw_status status = merge(names, count, "sh_merged");
    if (status != expected || !strstr(hw_error_text(), text))
        fail_msg("%s: %s", hw_status_text(status), hw_error_text());
    assert_false(hw_path_exists("sh_merged")); // not even the folder
}

// With the shards of merged_shards_are_the_whole.
static void shards_that_do_not_fit_are_refused(void **state)
{
    (void)state;
    char names[8][32] = {"sh_shard_0", "sh_shard_1", "sh_shard_2", "sh_twice"};
    char twice[2][32] = {"sh_shard_0", "sh_twice"};
    hw_build_report report;
    remove_tree("sh_merged");
    remove_tree("sh_twice");
    assert_merge_fails(names, 2, HW_NOT_FOUND, "shard 3 of 3 is missing");
    assert_merge_fails(names, 4, HW_NOT_FOUND, "sh_twice");
    // The same shard twice.
    assert_int_equal(system("cp -r sh_shard_1 sh_twice"), 0);
    assert_merge_fails(names, 4, HW_FORMAT, "sh_twice: holds shard 2 of 3, which sh_shard_1");
    // Of another number of shards; with other options; unfinished.
    remove_tree("sh_twice");
    hw_build_options o = options_for("sh_twice");
    o.shard_index = 1;
    o.shard_count = 2;
    build(&o, &report);
    assert_merge_fails(names, 4, HW_FORMAT, "sh_twice: holds shard 2 of 2");
    remove_tree("sh_twice");
    o.shard_index = 2;
    o.shard_count = 3;
    o.far.interior_px = 1;
    build(&o, &report);
    assert_merge_fails(twice, 2, HW_FORMAT, "sh_twice: was made with other options");
    assert_int_equal(system("rm sh_twice/shard_3_of_3.json"), 0);
    assert_merge_fails(twice, 2, HW_NOT_FOUND, "sh_twice: holds no finished shard");
    // A cell that is missing, another in its place, a damaged mesh.
    assert_int_equal(system("set -- sh_shard_1/cells/0/*; mv $1 saved.hxc"), 0);
    assert_merge_fails(names, 3, HW_NOT_FOUND, "sh_shard_1/cells/0/");
    assert_int_equal(system("set -- sh_shard_0/cells/0/*; mv $1 kept.hxc; cp $2 $1"), 0);
    assert_merge_fails(names, 3, HW_FORMAT, "of another build or another cell");
    assert_int_equal(system("set -- sh_shard_0/cells/0/*; cp kept.hxc $1"), 0);
    assert_merge_fails(names, 3, HW_NOT_FOUND, "sh_shard_1/cells/0/");
    remove_tree("sh_shard_1");
    assert_int_equal(system("cp -r sh_pair sh_shard_1 && rm sh_shard_1/shard_1_of_3.json "
                            "&& truncate -s 300 sh_shard_0/meshes/0.hxm"),
                     0);
    assert_merge_fails(names, 3, HW_FORMAT, "sh_shard_0/meshes/0.hxm");
    assert_int_equal(system("cp sh_a/meshes/0.hxm sh_shard_0/meshes/0.hxm"), 0);
}

// Each file operation of a merge fails in turn: nothing is left, and then it works.
static void failing_merges_leave_nothing(void **state)
{
    (void)state;
    char names[8][32] = {"sh_shard_0", "sh_shard_1", "sh_shard_2"};
    uint32_t failures = 0;
    for (uint64_t n = 1;; n += 1 + n / 4) {
        remove_tree("sh_merged");
        hw_file_fail_after(n);
        hw_status status = merge(names, 3, "sh_merged");
        hw_file_fail_after(0);
        if (status == HW_OK)
            break;
        failures++;
        assert_non_null(strstr(hw_error_text(), "sh_"));
        assert_false(hw_path_exists("sh_merged/manifest.json"));
        assert_false(hw_path_exists("sh_merged/cells"));
    }
    assert_true(failures >= 5);
    assert_same_datasets("sh_a", "sh_merged");
}

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SLACK (UINT64_C(2) << 30) // freed memory is kept for a while
#else
#define SLACK (UINT64_C(32) << 20)
#endif

// However little memory there is: the same bytes, or an error that tells what is needed.
static void bounds_of_memory_change_no_byte(void **state)
{
    (void)state;
    static const uint64_t bounds[] = {UINT64_C(1) << 40, 0};
    for (size_t i = 0; i < sizeof bounds / sizeof *bounds; i++) {
        hw_build_report report;
        hw_build_options o = options_for("sh_bound");
        remove_tree("sh_bound");
        o.memory_bytes = bounds[i] ? bounds[i] : hw_rss_peak_bytes() + SLACK;
        build(&o, &report);
        assert_true(report.scratch_bytes > 0);
        assert_same_datasets("sh_a", "sh_bound");
    }
    hw_build_report report;
    hw_build_options o = options_for("sh_bound");
    // Culling by occlusion wants the tree of the whole scene.
    remove_tree("sh_bound");
    remove_tree("sh_culled");
    o.cull = HW_OCCLUSION_TRIANGLES;
    o.memory_bytes = UINT64_C(1) << 40;
    build(&o, &report);
    o.memory_bytes = 0;
    o.dataset = "sh_culled";
    build(&o, &report);
    assert_same_datasets("sh_culled", "sh_bound");
    o.memory_bytes = 1 << 20;
    assert_int_equal(hw_build_run(&o, &report), HW_LIMIT);
    assert_non_null(strstr(hw_error_text(), "2M of memory are not enough"));
}

static int make_whole(void **state)
{
    hw_build_report report;
    if (make_scene(state))
        return -1;
    remove_tree("sh_a");
    hw_build_options o = options_for("sh_a");
    build(&o, &report);
    assert_true(report.tree_builds > 3); // of the meshes, and of details
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(merged_shards_are_the_whole),
        cmocka_unit_test(shards_that_do_not_fit_are_refused),
        cmocka_unit_test(failing_merges_leave_nothing),
        cmocka_unit_test(bounds_of_memory_change_no_byte),
    };
    return cmocka_run_group_tests(tests, make_whole, NULL);
}
