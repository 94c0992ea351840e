// Parks of made-up statues: counts, sizes, subsets, no overlap, any size, errors.
#include "bytes.h"
#include "file.h"
#include "park.h"
#include "statues.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static char folder[64], empty_folder[64];

// A box with a lopsided point on top, 10 triangles, in the three formats that statues come in; the
// numbers depend on `shape` so that statues differ.
static void box_points(uint32_t shape, float out[9][3])
{
    float size[3] = {1 + 0.1f * (float)(shape % 5), 1.5f, 1 + 0.2f * (float)(shape % 3)};
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < 3; k++)
            out[i][k] = (i >> k & 1) ? size[k] : 0;
    out[8][0] = 0.2f * size[0];
    out[8][1] = 0.3f * size[1];
    out[8][2] = 1.5f * size[2];
}

#define TRIANGLES 14
static const uint16_t triangles[TRIANGLES][3] = {
    {0, 3, 1}, {0, 2, 3}, {0, 1, 5}, {0, 5, 4}, {1, 3, 7}, {1, 7, 5}, {0, 4, 6},
    {0, 6, 2}, {2, 6, 7}, {2, 7, 3}, {4, 5, 8}, {5, 7, 8}, {7, 6, 8}, {6, 4, 8}};

static void write_text(const char *path, uint32_t shape, const char *format)
{
    char text[4096];
    float p[9][3];
    int n = 0;
    box_points(shape, p);
    bool off = !strcmp(format, "off"), obj = !strcmp(format, "obj");
    const char *head = off ? "OFF\n9 14 0\n"
                           : "ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\n"
                             "property float y\nproperty float z\nelement face 14\n"
                             "property list uchar int vertex_indices\nend_header\n";
    n += snprintf(text, sizeof text, "%s", obj ? "" : head);
    for (int i = 0; i < 9; i++)
        n += snprintf(text + n, sizeof text - (size_t)n, "%s%g %g %g\n", obj ? "v " : "",
                      (double)p[i][0], (double)p[i][1], (double)p[i][2]);
    for (int t = 0; t < TRIANGLES; t++)
        n += snprintf(text + n, sizeof text - (size_t)n, "%s%d %d %d\n", obj ? "f " : "3 ",
                      triangles[t][0] + obj, triangles[t][1] + obj, triangles[t][2] + obj);
    assert_int_equal(hw_file_write(path, text, (size_t)n), HW_OK);
}

// 3D Studio: nested chunks of a 16-bit tag and a 32-bit size.
static void write_3ds(const char *path, uint32_t shape)
{
    enum { VERTICES = 6 + 2 + 9 * 12, FACES = 6 + 2 + TRIANGLES * 8, MESH = 6 + VERTICES + FACES };
    hw_bytes_writer w = {0};
    float p[9][3];
    box_points(shape, p);
    const struct {
        uint16_t tag;
        uint32_t size;
    } heads[4] = {{0x4d4d, 6 + 6 + 6 + 2 + MESH},
                  {0x3d3d, 6 + 6 + 2 + MESH},
                  {0x4000, 6 + 2 + MESH},
                  {0x4100, MESH}};
    for (int i = 0; i < 4; i++) {
        hw_put_u16(&w, heads[i].tag);
        hw_put_u32(&w, heads[i].size);
        if (heads[i].tag == 0x4000)
            hw_put_bytes(&w, "h", 2);
    }
    hw_put_u16(&w, 0x4110);
    hw_put_u32(&w, VERTICES);
    hw_put_u16(&w, 9);
    for (int i = 0; i < 27; i++)
        hw_put_f32(&w, p[i / 3][i % 3]);
    hw_put_u16(&w, 0x4120);
    hw_put_u32(&w, FACES);
    hw_put_u16(&w, TRIANGLES);
    for (int i = 0; i < 4 * TRIANGLES; i++)
        hw_put_u16(&w, i % 4 < 3 ? triangles[i / 4][i % 4] : 7);
    assert_int_equal(hw_bytes_writer_check(&w), HW_OK);
    assert_int_equal(hw_file_write(path, w.data, w.size), HW_OK);
    hw_bytes_writer_free(&w);
}

static int make_statues(void **state)
{
    (void)state;
    snprintf(folder, sizeof folder, "/tmp/hexwalk-park-XXXXXX");
    snprintf(empty_folder, sizeof empty_folder, "/tmp/hexwalk-empty-XXXXXX");
    if (!mkdtemp(folder) || !mkdtemp(empty_folder))
        return -1;
    uint32_t count;
    const hw_statue *table = hw_statue_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        char path[160];
        const char *extension = strrchr(table[i].file, '.') + 1;
        snprintf(path, sizeof path, "%s/%s", folder, table[i].file);
        if (!strcmp(extension, "3ds"))
            write_3ds(path, i);
        else
            write_text(path, i, extension);
    }
    return 0;
}

static int remove_statues(void **state)
{
    (void)state;
    uint32_t count;
    const hw_statue *table = hw_statue_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        char path[160];
        snprintf(path, sizeof path, "%s/%s", folder, table[i].file);
        unlink(path);
    }
    return rmdir(folder) | rmdir(empty_folder);
}

static void make_preset(const char *preset, hw_scene *scene)
{
    hw_park_options options = {.preset = preset, .statue_folder = folder};
    assert_int_equal(hw_park_make(&options, scene), HW_OK);
}

static void make_any(uint32_t count, double width, double depth, uint64_t seed, hw_scene *scene)
{
    hw_park_options options = {.object_count = count,
                               .width = width,
                               .depth = depth,
                               .seed = seed,
                               .with_dragon = true,
                               .statue_folder = folder};
    assert_int_equal(hw_park_make(&options, scene), HW_OK);
}

static uint32_t count_of(const hw_scene *scene, const char *statue)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < scene->object_count; i++)
        count += !strcmp(scene->meshes[scene->objects[i].mesh_idx].name, statue);
    return count;
}

// No two boxes touch, all stand on the ground within the area.
static void assert_well_placed(const hw_scene *scene, double width, double depth)
{
    for (uint32_t i = 0; i < scene->object_count; i++) {
        hw_box a = scene->objects[i].bounds;
        assert_true(a.min.x >= -width / 2 - 1e-2 && a.max.x <= width / 2 + 1e-2);
        assert_true(a.min.y >= -depth / 2 - 1e-2 && a.max.y <= depth / 2 + 1e-2);
        assert_float_equal(a.min.z, 0, 1e-4);
        for (uint32_t j = 0; j < i; j++) {
            hw_box b = scene->objects[j].bounds;
            assert_true(a.min.x > b.max.x || b.min.x > a.max.x || a.min.y > b.max.y ||
                        b.min.y > a.max.y);
        }
    }
}

static void assert_same_object(const hw_scene *a, const hw_scene *b, uint32_t i)
{
    const hw_object *p = &a->objects[i], *q = &b->objects[i];
    assert_string_equal(a->meshes[p->mesh_idx].name, b->meshes[q->mesh_idx].name);
    assert_int_equal(p->material_idx, q->material_idx);
    assert_memory_equal(&p->transform, &q->transform, sizeof p->transform);
}

static void presets_follow_the_table(void **state)
{
    (void)state;
    // Thesis, table 5.2.
    static const struct {
        const char *statue;
        float largest;
        uint32_t counts[3];
    } rows[] = {{"dragon", 57.3f, {4, 10, 18}}, {"bunny", 43.6f, {7, 12, 26}},
                {"man", 23.4f, {13, 21, 40}},   {"bull", 40.8f, {9, 19, 42}},
                {"horse", 82.6f, {13, 29, 51}}, {"homer", 30.8f, {6, 14, 22}},
                {"camel", 49.4f, {4, 14, 26}},  {"head", 21.9f, {8, 13, 28}}};
    static const char *const names[3] = {"2m", "4m", "8m"};
    static const uint32_t totals[3] = {64, 132, 253};
    hw_scene scenes[3];
    for (int p = 0; p < 3; p++) {
        make_preset(names[p], &scenes[p]);
        assert_int_equal(scenes[p].object_count, totals[p]);
        assert_int_equal(scenes[p].mesh_count, 8);
        assert_int_equal(hw_scene_validate(&scenes[p]), HW_OK);
        assert_well_placed(&scenes[p], 1650, 2035);
        for (size_t r = 0; r < sizeof rows / sizeof *rows; r++)
            assert_int_equal(count_of(&scenes[p], rows[r].statue), rows[r].counts[p]);
        for (uint32_t m = 0; m < 8; m++) {
            hw_vec3 size = hw_box_size(hw_mesh_bounds(&scenes[p].meshes[m]));
            float largest = fmaxf(size.x, fmaxf(size.y, size.z));
            assert_string_equal(scenes[p].meshes[m].name, rows[m].statue);
            assert_float_equal(largest, rows[m].largest, 1e-3);
        }
        for (uint32_t i = 0; p > 0 && i < totals[p - 1]; i++)
            assert_same_object(&scenes[p - 1], &scenes[p], i);
    }
    for (int p = 0; p < 3; p++)
        hw_scene_free(&scenes[p]);
}

static void bounds_are_exact(void **state)
{
    (void)state;
    hw_scene scene;
    make_preset("demo", &scene);
    hw_box *before = calloc(scene.object_count, sizeof *before);
    for (uint32_t i = 0; i < scene.object_count; i++)
        before[i] = scene.objects[i].bounds;
    hw_scene_update_bounds(&scene);
    for (uint32_t i = 0; i < scene.object_count; i++) {
        hw_box a = before[i], b = scene.objects[i].bounds;
        assert_true(hw_v3_length(hw_v3_sub(a.min, b.min)) < 1e-3f);
        assert_true(hw_v3_length(hw_v3_sub(a.max, b.max)) < 1e-3f);
    }
    free(before);
    hw_scene_free(&scene);
}

static void demo_needs_no_dragon(void **state)
{
    (void)state;
    hw_scene scene;
    make_preset("demo", &scene);
    assert_int_equal(count_of(&scene, "dragon"), 0);
    assert_true(scene.mesh_count >= 12);
    assert_true(scene.ground.present);
    hw_box all = hw_scene_bounds(&scene);
    assert_true(scene.ground.rect.min.x < all.min.x - 300 && scene.ground.rect.max.y > all.max.y);
    // As dense as the parks of the thesis, within a tenth.
    double area = (scene.ground.rect.max.x * 2.0 - 800) * (scene.ground.rect.max.y * 2.0 - 800);
    assert_float_equal(area / scene.object_count / (1650.0 * 2035 / 253), 1, 0.1);
    uint32_t used[16] = {0}, tints = 0;
    for (uint32_t i = 0; i < scene.object_count; i++)
        used[scene.objects[i].material_idx]++;
    for (int i = 0; i < 16; i++)
        tints += used[i] > 0;
    assert_true(tints >= 5);
    hw_scene_free(&scene);
}

static void any_size_is_dense_and_deterministic(void **state)
{
    (void)state;
    hw_scene a, b, c;
    make_any(400, 2000, 2700, 5, &a);
    make_any(400, 2000, 2700, 5, &b);
    make_any(400, 2000, 2700, 6, &c);
    assert_int_equal(a.object_count, 400);
    assert_well_placed(&a, 2000, 2700);
    bool differs = false;
    for (uint32_t i = 0; i < 400; i++) {
        assert_same_object(&a, &b, i);
        differs |= memcmp(&a.objects[i].transform, &c.objects[i].transform, sizeof(hw_mat4)) != 0;
    }
    assert_true(differs);
    assert_true(hw_scene_hash(&a) == hw_scene_hash(&b));
    hw_scene_free(&a);
    hw_scene_free(&b);
    hw_scene_free(&c);
}

static void mix_is_that_of_the_thesis(void **state)
{
    (void)state;
    hw_scene scene;
    make_any(25300, 0, 0, 1, &scene); // a hundred times 8m
    assert_int_equal(scene.object_count, 25300);
    assert_int_equal(count_of(&scene, "dragon"), 1800);
    assert_int_equal(count_of(&scene, "horse"), 5100);
    assert_int_equal(count_of(&scene, "head"), 2800);
    hw_box all = hw_scene_bounds(&scene);
    assert_float_equal(all.max.x - all.min.x, 16500, 300);
    assert_float_equal(all.max.y - all.min.y, 20350, 300);
    hw_scene_free(&scene);
    make_any(1, 0, 0, 1, &scene);
    assert_int_equal(scene.object_count, 1);
    hw_scene_free(&scene);
    hw_park_options options = {.object_count = 60, .statue_folder = folder};
    assert_int_equal(hw_park_make(&options, &scene), HW_OK);
    assert_int_equal(count_of(&scene, "dragon"), 0);
    hw_scene_free(&scene);
}

static void odd_areas_work(void **state)
{
    (void)state;
    hw_scene scene;
    make_any(20, 1e7, 1e7, 3, &scene);
    assert_well_placed(&scene, 1e7, 1e7);
    hw_scene_free(&scene);
    make_any(20, 100, 1e6, 3, &scene);
    assert_well_placed(&scene, 100, 1e6);
    hw_scene_free(&scene);
}

static void assert_refused(hw_park_options options, hw_status expected)
{
    hw_scene scene;
    assert_int_equal(hw_park_make(&options, &scene), expected);
    assert_true(hw_error_text()[0] != 0);
    assert_null(scene.objects);
    assert_null(scene.meshes);
}

static void senseless_parks_are_refused(void **state)
{
    (void)state;
    hw_park_options any = {.object_count = 50, .with_dragon = true, .statue_folder = folder};
    hw_park_options o = any;
    o.width = o.depth = 200;
    assert_refused(o, HW_LIMIT);
    assert_non_null(strstr(hw_error_text(), "of 50"));
    o.width = o.depth = 20; // no statue fits at all
    assert_refused(o, HW_LIMIT);
    o.width = -5;
    assert_refused(o, HW_USAGE);
    o.width = NAN;
    assert_refused(o, HW_USAGE);
    o.width = 0;
    assert_refused(o, HW_USAGE);
    o = any;
    o.object_count = 0;
    assert_refused(o, HW_USAGE);
    o = any;
    o.preset = "16m";
    assert_refused(o, HW_USAGE);
    o = any;
    o.statue_folder = empty_folder;
    assert_refused(o, HW_NOT_FOUND);
    o.preset = "demo";
    assert_refused(o, HW_NOT_FOUND);
    assert_non_null(strstr(hw_error_text(), "fetch-statues"));
}

static void exhausted_memory_is_an_error(void **state)
{
    (void)state;
    hw_park_options options = {.object_count = 2, .with_dragon = true, .statue_folder = folder};
    hw_status status = HW_MEMORY;
    uint64_t n = 1;
    for (; status != HW_OK && n < 10000; n++) {
        hw_scene scene;
        hw_alloc_fail_after(n);
        status = hw_park_make(&options, &scene);
        hw_alloc_fail_after(0);
        assert_true(status == HW_OK || status == HW_MEMORY);
        hw_scene_free(&scene);
    }
    assert_int_equal(status, HW_OK);
    assert_true(n > 20);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(presets_follow_the_table),
        cmocka_unit_test(bounds_are_exact),
        cmocka_unit_test(demo_needs_no_dragon),
        cmocka_unit_test(any_size_is_dense_and_deterministic),
        cmocka_unit_test(mix_is_that_of_the_thesis),
        cmocka_unit_test(odd_areas_work),
        cmocka_unit_test(senseless_parks_are_refused),
        cmocka_unit_test(exhausted_memory_is_an_error),
    };
    return cmocka_run_group_tests(tests, make_statues, remove_statues);
}
