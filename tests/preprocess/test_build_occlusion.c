// Occlusion through the whole build: what a wall hides from a cell is not in it, what rises above
// the wall is, with fewer triangles where those are asked for one by one.
#include "build.h"
#include "cell_file.h"
#include "export.h"
#include "log.h"
#include "manifest.h"
#include "shapes.h"
#include <math.h>
#include <stdlib.h>

#define SCENE "occlusion_scene.glb"

enum { WALL, HIDDEN, TOWER, OUTPOST, OBJECTS };
// The wall reaches deeper than all else: one might look below it, as there is no ground.
static const hw_vec3 centres[OBJECTS] = {{0, 0, 30}, {46, 0, 26}, {70, 0, 65}, {-300, 0, 26}};

static int make_scene(void **state)
{
    (void)state;
    hw_log_set_quiet(true);
    hw_mesh meshes[OBJECTS];
    hw_mat4 transforms[OBJECTS];
    meshes[WALL] = shape_box((hw_box){{-2, -160, -30}, {2, 160, 30}}, false);
    meshes[HIDDEN] = shape_sphere(hw_v3(0, 0, 0), 6, 32, 24);
    meshes[TOWER] = shape_sphere(hw_v3(0, 0, 0), 1, 48, 64);
    meshes[OUTPOST] = shape_sphere(hw_v3(0, 0, 0), 6, 32, 24);
    for (int i = 0; i < OBJECTS; i++) {
        transforms[i] = hw_mat4_translation(centres[i].x, centres[i].y, centres[i].z);
        if (i == TOWER)
            transforms[i] = hw_mat4_mul(transforms[i], hw_mat4_scale(5, 5, 45));
    }
    hw_scene scene = shape_scene(meshes, transforms, OBJECTS);
    hw_status status = hw_scene_export_glb(&scene, SCENE);
    hw_scene_free(&scene);
    return status == HW_OK ? 0 : -1;
}

// What the cells have of an object.
typedef struct share {
    uint32_t near, far, triangles;
} share;
typedef struct found {
    share here[OBJECTS];     // in the cell before the wall
    share anywhere[OBJECTS]; // in all cells
} found;

static uint32_t object_at(const hw_manifest *m, hw_vec3 centre)
{
    uint32_t i = 0;
    while (i < m->object_count &&
           hw_v3_length(hw_v3_sub(hw_box_centre(m->objects[i].bounds), centre)) > 1)
        i++;
    assert_true(i < m->object_count);
    return i;
}

static void add_cell(const hw_cell *cell, const uint32_t objects[OBJECTS], share out[OBJECTS])
{
    for (uint32_t k = 0; k < OBJECTS; k++) {
        for (uint32_t i = 0; i < cell->near_count; i++)
            out[k].near += cell->near[i].object_idx == objects[k];
        for (uint32_t i = 0; i < cell->far_count; i++) {
            if (cell->far[i].object_idx != objects[k])
                continue;
            out[k].far++;
            out[k].triangles += cell->far[i].index_count / 3;
        }
    }
}

static found build(hw_occlusion_mode cull, bool clusters)
{
    found f = {0};
    uint32_t objects[OBJECTS];
    hw_build_report report;
    hw_manifest m;
    hw_build_options o = hw_build_defaults();
    o.scene_path = SCENE;
    o.dataset = "occlusion_data";
    o.cell_size = 80;
    o.z_min = 22;
    o.z_max = 30;
    o.threads = 2;
    o.levels = 1;
    o.far.self_occlusion_px = 100; // the tower is far
    o.cull = cull;
    o.clusters = clusters;
    assert_int_equal(system("rm -rf occlusion_data"), 0);
    if (hw_build_run(&o, &report) != HW_OK)
        fail_msg("%s", hw_error_text());
    assert_int_equal(hw_manifest_read(o.dataset, &m), HW_OK);
    assert_int_equal(m.clusters, clusters);
    assert_int_equal(m.object_count, OBJECTS);
    for (uint32_t k = 0; k < OBJECTS; k++)
        objects[k] = object_at(&m, centres[k]);
    hw_cell_id here = hw_hexgrid_locate(&m.grid, -200, 0);
    for (uint32_t i = 0; i < m.cell_count; i++) {
        hw_cell cell;
        char *path;
        assert_int_equal(hw_cell_path(&path, o.dataset, m.cells[i].id), HW_OK);
        assert_int_equal(hw_cell_read(path, &cell), HW_OK);
        hw_free(path);
        add_cell(&cell, objects, f.anywhere);
        if (hw_cell_compare(cell.id, here) == 0)
            add_cell(&cell, objects, f.here);
        hw_cell_free(&cell);
    }
    hw_manifest_free(&m);
    return f;
}

static uint32_t records(share s)
{
    return s.near + s.far;
}

static void test_modes(void **state)
{
    (void)state;
    found off = build(HW_OCCLUSION_OFF, false);
    found objects = build(HW_OCCLUSION_OBJECTS, false);
    found triangles = build(HW_OCCLUSION_TRIANGLES, false);
    for (uint32_t k = 0; k < OBJECTS; k++) {
        assert_int_equal(records(off.here[k]), 1);
        assert_int_equal(records(objects.here[k]), k != HIDDEN);
        assert_int_equal(records(triangles.here[k]), k != HIDDEN);
        // It is seen from behind the wall.
        assert_true(records(triangles.anywhere[k]) > 3);
    }
    assert_int_equal(off.here[HIDDEN].far, 1);
    assert_int_equal(triangles.here[TOWER].far, 1);
    assert_int_equal(objects.here[TOWER].triangles, off.here[TOWER].triangles);
    assert_true(triangles.here[TOWER].triangles < objects.here[TOWER].triangles);
    assert_true(triangles.here[TOWER].triangles > objects.here[TOWER].triangles / 4);
}

// That far records may stand for several objects is written down for the renderer (see build).
static void test_clusters(void **state)
{
    (void)state;
    found f = build(HW_OCCLUSION_OBJECTS, true);
    assert_int_equal(records(f.here[HIDDEN]), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_modes),
        cmocka_unit_test(test_clusters),
    };
    return cmocka_run_group_tests(tests, make_scene, NULL);
}
