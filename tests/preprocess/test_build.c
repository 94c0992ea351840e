// The build on a small made-up scene: what it writes, that threads and interruptions do not change
// a byte, and what bad input does.
#include "alloc.h"
#include "build.h"
#include "build_cell.h"
#include "cell_file.h"
#include "export.h"
#include "file.h"
#include "import.h"
#include "log.h"
#include "manifest.h"
#include "mesh_file.h"
#include "shapes.h"
#include <dirent.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#define SCENE "build_scene.glb"

// Spheres of radius 6: one in the middle, one far to the east, one far to the north.
static int make_scene(void **state)
{
    (void)state;
    hw_log_set_quiet(true);
    hw_mesh meshes[3];
    hw_mat4 transforms[3] = {hw_mat4_translation(0, 0, 6), hw_mat4_translation(400, 10, 6),
                             hw_mat4_translation(0, 420, 6)};
    for (int i = 0; i < 3; i++)
        meshes[i] = shape_sphere(hw_v3(0, 0, 0), 6, 48 + 4 * (uint32_t)i, 32);
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

static void objects_are_near_or_far_as_they_should(void **state)
{
    (void)state;
    remove_tree("build_a");
    hw_build_options o = options_for("build_a");
    hw_build_report report;
    build(&o, &report);
    assert_int_equal(report.cells_made, report.cells_total);
    hw_manifest manifest;
    assert_int_equal(hw_manifest_read("build_a", &manifest), HW_OK);
    assert_int_equal(manifest.object_count, 3);
    assert_int_equal(manifest.cell_count, report.cells_total);
    uint32_t far_seen = 0;
    for (uint32_t i = 0; i < manifest.cell_count; i++) {
        hw_cell cell;
        char *path;
        assert_int_equal(hw_cell_path(&path, "build_a", manifest.cells[i].id), HW_OK);
        assert_int_equal(hw_cell_read(path, &cell), HW_OK);
        hw_free(path);
        // Every object is in exactly one of the two lists; one that meets the cell is near and
        // whole.
        for (uint32_t k = 0; k < 3; k++) {
            uint32_t found = 0;
            bool meets = hw_cell_meets_box(&manifest.grid, cell.id, manifest.objects[k].bounds);
            for (uint32_t n = 0; n < cell.near_count; n++) {
                found += cell.near[n].object_idx == k;
                assert_true(cell.near[n].object_idx != k || !meets || cell.near[n].level == 0);
            }
            for (uint32_t n = 0; n < cell.far_count; n++) {
                found += cell.far[n].object_idx == k;
                assert_false(cell.far[n].object_idx == k && meets);
            }
            assert_int_equal(found, 1);
        }
        far_seen += cell.far_count;
        hw_cell_free(&cell);
    }
    assert_true(far_seen > manifest.cell_count); // on average more than one of the three is far
    hw_manifest_free(&manifest);
}

// Levels of near meshes come with boxes that lie within them, and with errors.
static void near_meshes_are_filled(void **state)
{
    (void)state;
    for (uint32_t m = 0; m < 3; m++) {
        char *path;
        hw_mesh_file *file;
        assert_int_equal(hw_mesh_path(&path, "build_a", m), HW_OK);
        assert_int_equal(hw_mesh_file_open(&file, path), HW_OK);
        hw_free(path);
        uint32_t count = hw_mesh_file_level_count(file);
        assert_true(count > 5);
        for (uint32_t l = 0; l < count; l++) {
            hw_mesh mesh;
            hw_inner_boxes boxes;
            assert_int_equal(hw_mesh_file_read(file, l, &mesh, &boxes), HW_OK);
            assert_true(boxes.count > 0);
            // Levels keep the volume, so that coarse ones reach beyond the sphere.
            float reach = 6 + 2 * hw_mesh_file_level(file, l)->error_p99;
            for (uint32_t k = 0; k < 8 * boxes.count; k++)
                assert_true(hw_v3_length(hw_box_corner(boxes.boxes[k / 8], k % 8)) < reach);
            assert_true(hw_box_diagonal(boxes.boxes[0]) > 6); // of a cube in the sphere: 12
            hw_mesh_free(&mesh);
        }
        assert_true(hw_mesh_file_level(file, count - 1)->error_shading > 0);
        hw_mesh_file_close(file);
    }
}

// Vertices of every stand-in lie on the sphere it stands for, within the pixel bounds of the policy
// seen from the cell.
static void far_meshes_lie_on_their_objects(void **state)
{
    (void)state;
    hw_manifest manifest;
    assert_int_equal(hw_manifest_read("build_a", &manifest), HW_OK);
    uint32_t checked = 0;
    for (uint32_t i = 0; i < manifest.cell_count; i++) {
        hw_cell cell;
        char *path;
        assert_int_equal(hw_cell_path(&path, "build_a", manifest.cells[i].id), HW_OK);
        assert_int_equal(hw_cell_read(path, &cell), HW_OK);
        hw_free(path);
        for (uint32_t v = 0; v < cell.vertex_count; v++) {
            const hw_far_vertex *p = &cell.vertices[v];
            const hw_far_record *record = &cell.far[p->record];
            hw_mat4 m = hw_far_record_matrix(record, cell.centre);
            double h[4];
            for (int r = 0; r < 4; r++)
                h[r] = m.m[r] * p->x + m.m[4 + r] * p->y + m.m[8 + r] * p->z + m.m[12 + r];
            hw_vec3 world = hw_v3((float)(h[0] / h[3]), (float)(h[1] / h[3]), (float)(h[2] / h[3]));
            hw_vec3 centre = hw_box_centre(manifest.objects[record->object_idx].bounds);
            // Interiors may be off by interior_px of parallax, focal * cell size *
            // (1 / near - 1 / far).
            double off = fabs((double)hw_v3_length(hw_v3_sub(world, centre)) - 6);
            double depth = hw_v3_length(hw_v3_sub(centre, cell.centre));
            double parallax_px = 886.8 * manifest.grid.cell_size * off / (depth * depth);
            assert_true(parallax_px < hw_build_defaults().far.interior_px);
            checked++;
        }
        hw_cell_free(&cell);
    }
    assert_true(checked > 1000);
    hw_manifest_free(&manifest);
}

static void threads_and_shards_change_no_byte(void **state)
{
    (void)state;
    remove_tree("build_b");
    hw_build_report report;
    hw_build_options o = options_for("build_b");
    o.threads = 1;
    o.shard_count = 2;
    build(&o, &report);
    assert_true(report.cells_missing > 0);
    hw_manifest manifest;
    assert_int_equal(hw_manifest_read("build_b", &manifest), HW_NOT_FOUND); // not finished
    o.shard_index = 1;
    build(&o, &report);
    assert_int_equal(report.cells_missing, 0);
    assert_same_datasets("build_a", "build_b");
}

static void unfinished_build_goes_on(void **state)
{
    (void)state;
    // As a kill leaves it: no manifest, some cells gone, one half written under its own name, a
    // temporary file.
    remove_tree("build_c");
    assert_int_equal(system("cp -r build_a build_c && rm build_c/manifest.json"), 0);
    DIR *dir = opendir("build_c/cells/0");
    uint32_t n = 0, removed = 0;
    for (struct dirent *entry; (entry = readdir(dir));) {
        char path[600];
        snprintf(path, sizeof path, "build_c/cells/0/%s", entry->d_name);
        if (entry->d_name[0] == '.')
            continue;
        if (n % 3 == 0)
            assert_int_equal(remove(path), 0);
        else if (n % 3 == 1)
            assert_int_equal(truncate(path, 100), 0);
        removed += n++ % 3 < 2;
    }
    closedir(dir);
    assert_int_equal(system("touch build_c/cells/0/0_0.hxc.12.tmp"), 0);
    hw_build_options o = options_for("build_c");
    hw_build_report report;
    build(&o, &report);
    assert_int_equal(report.cells_made, removed);
    assert_int_equal(report.cells_kept, report.cells_total - removed);
    assert_same_datasets("build_a", "build_c");
}

static void other_options_make_everything_anew(void **state)
{
    (void)state;
    hw_build_options o = options_for("build_c");
    hw_build_report report;
    atomic_bool stop = true;
    o.far.interior_px = 1;
    // As long as nothing is replaced it is the old dataset, from the first file on it is none.
    o.stop = &stop;
    assert_int_equal(hw_build_run(&o, &report), HW_INTERRUPTED);
    bool stays = hw_path_exists("build_c/manifest.json");
    o.stop = NULL;
    hw_status status = HW_IO;
    uint32_t left = 0; // failures after which it is none
    for (uint64_t n = 10; status != HW_OK; n += 5) {
        hw_file_fail_after(n);
        status = hw_build_run(&o, &report);
        hw_file_fail_after(0);
        left += status != HW_OK && !hw_path_exists("build_c/manifest.json");
    }
    assert_true(left > 0);
    assert_true(stays);
    build(&o, &report);
    assert_int_equal(report.cells_kept, report.cells_total);
}

// With a limit above every self-occluding error, each far object is a few triangles, cut out; with
// none, no object is.
static void what_is_flat_from_afar_is_cut_out(void **state)
{
    (void)state;
    const double limits[2] = {0, 30};
    uint32_t far_count[2] = {0, 0};
    for (int i = 0; i < 2; i++) {
        remove_tree("build_j");
        hw_build_options o = options_for("build_j");
        o.far.impostor_px = limits[i];
        o.far.relief_px = 0;
        hw_build_report report;
        build(&o, &report);
        hw_manifest manifest;
        assert_int_equal(hw_manifest_read("build_j", &manifest), HW_OK);
        for (uint32_t k = 0; k < manifest.cell_count; k++) {
            hw_cell cell;
            char *path;
            assert_int_equal(hw_cell_path(&path, "build_j", manifest.cells[k].id), HW_OK);
            assert_int_equal(hw_cell_read(path, &cell), HW_OK);
            hw_free(path);
            far_count[i] += cell.far_count;
            for (uint32_t n = 0; n < cell.far_count; n++) {
                const hw_far_record *far = &cell.far[n];
                assert_int_equal(far->cut_out, i == 1);
                if (i == 0)
                    continue;
                assert_in_range(far->index_count / 3, 1, 80);
                // It stands where its object does, and is hardly larger.
                hw_box object = manifest.objects[far->object_idx].bounds;
                hw_vec3 middle = hw_box_centre(object);
                assert_true(hw_v3_length(hw_v3_sub(hw_box_centre(far->bounds), middle)) < 6);
                assert_true(hw_box_diagonal(far->bounds) < 2 * hw_box_diagonal(object));
            }
            hw_cell_free(&cell);
        }
        hw_manifest_free(&manifest);
    }
    assert_true(far_count[0] > 0);
    assert_int_equal(far_count[0], far_count[1]); // none became near
}

// Only the cells that a tour's frames stand in, then the rest; a cell made before stays listed.
static void cells_along_a_tour_come_first(void **state)
{
    (void)state;
    hw_tour_frame frames[3] = {{.eye = hw_v3(0, 0, 4), .forward = hw_v3(1, 0, 0)},
                               {.eye = hw_v3(1, 0, 4), .forward = hw_v3(1, 0, 0)},
                               {.eye = hw_v3(300, 0, 4), .forward = hw_v3(1, 0, 0)}};
    hw_tour tour = {.fov_degrees = 60, .frames = frames, .frame_count = 3};
    hw_build_report report;
    remove_tree("build_h");
    hw_build_options o = options_for("build_h");
    o.levels = 2;
    hw_build_options whole = o;
    o.along = &tour;
    o.along_every = 2; // the first and the last
    build(&o, &report);
    hw_manifest manifest;
    assert_int_equal(hw_manifest_read("build_h", &manifest), HW_OK);
    uint32_t fine = 0, made = report.cells_made;
    for (uint32_t i = 0; i < manifest.cell_count; i++)
        fine += manifest.cells[i].id.level == 0;
    assert_int_equal(fine, 2);
    assert_int_equal(manifest.cell_count, made);
    assert_int_equal(made + report.cells_left_out, report.cells_total);
    hw_manifest_free(&manifest);
    tour.frame_count = 1;
    build(&o, &report); // its cell is there
    assert_int_equal(report.cells_made, 0);
    assert_int_equal(hw_manifest_read("build_h", &manifest), HW_OK);
    assert_int_equal(manifest.cell_count, made);
    hw_manifest_free(&manifest);
    build(&whole, &report);
    assert_int_equal(report.cells_kept, made);
    assert_int_equal(report.cells_left_out, 0);
    remove_tree("build_i");
    whole.dataset = "build_i";
    build(&whole, &report);
    assert_same_datasets("build_h", "build_i");
    o.shard_count = 2;
    assert_int_equal(hw_build_run(&o, &report), HW_USAGE);
}

static void thesis_policy_builds(void **state)
{
    (void)state;
    remove_tree("build_d");
    hw_build_options o = options_for("build_d");
    hw_build_report report;
    o.far.policy = hw_policy_find("thesis");
    assert_non_null(o.far.policy);
    build(&o, &report);
    assert_true(report.far_triangles_mean > 10);
    assert_null(hw_policy_find("none"));
}

// Objects between T_s and T_mv become MVMeshes by both policies, the same with any number of
// threads, and only in cells of level 0.
static void multi_view_meshes_are_built(void **state)
{
    (void)state;
    static const char *const policies[] = {"screen", "thesis"};
    for (int i = 0; i < 2; i++) {
        hw_build_report report;
        hw_build_options o = options_for("build_k");
        o.far.policy = hw_policy_find(policies[i]);
        o.far.self_occlusion_px = 5;
        o.far.multi_view_px = 1000;
        o.far.multi_blend = i == 1;
        o.levels = 2;
        remove_tree("build_k");
        build(&o, &report);
        hw_manifest manifest;
        assert_int_equal(hw_manifest_read("build_k", &manifest), HW_OK);
        uint32_t multi_view = 0;
        for (uint32_t k = 0; k < manifest.cell_count; k++) {
            hw_cell cell;
            char *path;
            assert_int_equal(hw_cell_path(&path, "build_k", manifest.cells[k].id), HW_OK);
            assert_int_equal(hw_cell_read(path, &cell), HW_OK);
            hw_free(path);
            for (uint32_t n = 0; n < cell.far_count; n++) {
                multi_view += cell.far[n].range_count > 0;
                assert_true(cell.id.level == 0 || cell.far[n].range_count == 0);
            }
            hw_cell_free(&cell);
        }
        hw_manifest_free(&manifest);
        assert_true(multi_view > 5);
        remove_tree("build_l");
        o.dataset = "build_l";
        o.threads = 1;
        build(&o, &report);
        assert_same_datasets("build_k", "build_l");
    }
}

static void stop_is_heeded(void **state)
{
    (void)state;
    remove_tree("build_e");
    atomic_bool stop = true;
    hw_build_options o = options_for("build_e");
    hw_build_report report;
    o.stop = &stop;
    assert_int_equal(hw_build_run(&o, &report), HW_INTERRUPTED);
    assert_false(hw_path_exists("build_e/manifest.json"));
}

static void bad_input_is_named(void **state)
{
    (void)state;
    hw_build_options o = options_for("build_f");
    hw_build_report report;
    o.scene_path = "no_such_scene.glb";
    assert_int_equal(hw_build_run(&o, &report), HW_NOT_FOUND);
    assert_non_null(strstr(hw_error_text(), "no_such_scene.glb"));
    assert_false(hw_path_exists("build_f"));
    o = options_for(SCENE); // a file where the folder should be
    assert_int_equal(hw_build_run(&o, &report), HW_IO);
    assert_non_null(strstr(hw_error_text(), SCENE));
}

// One file operation fails, as on a full disk: either nothing was lost by it, or there is an error
// that names the file and no manifest; and the next run ends with the right bytes.
static void failing_writes_lose_nothing(void **state)
{
    (void)state;
    static const uint64_t failing[] = {2, 5, 13, 34, 55, 89, 144};
    uint32_t failures = 0;
    hw_build_options o = options_for("build_g");
    o.threads = 1;
    for (size_t i = 0; i < sizeof failing / sizeof *failing; i++) {
        hw_build_report report;
        remove_tree("build_g");
        hw_file_fail_after(failing[i]);
        hw_status status = hw_build_run(&o, &report);
        hw_file_fail_after(0);
        if (status != HW_OK) {
            assert_non_null(strstr(hw_error_text(), "build_"));
            assert_false(hw_path_exists("build_g/manifest.json"));
            failures++;
        }
        build(&o, &report);
        assert_same_datasets("build_a", "build_g");
    }
    assert_true(failures >= 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(objects_are_near_or_far_as_they_should),
        cmocka_unit_test(near_meshes_are_filled),
        cmocka_unit_test(far_meshes_lie_on_their_objects),
        cmocka_unit_test(threads_and_shards_change_no_byte),
        cmocka_unit_test(unfinished_build_goes_on),
        cmocka_unit_test(other_options_make_everything_anew),
        cmocka_unit_test(what_is_flat_from_afar_is_cut_out),
        cmocka_unit_test(cells_along_a_tour_come_first),
        cmocka_unit_test(thesis_policy_builds),
        cmocka_unit_test(multi_view_meshes_are_built),
        cmocka_unit_test(stop_is_heeded),
        cmocka_unit_test(bad_input_is_named),
        cmocka_unit_test(failing_writes_lose_nothing),
    };
    return cmocka_run_group_tests(tests, make_scene, NULL);
}
