// Meshes as grids of cubes, and boxes found by place.
#include "box_grid.h"
#include "rng.h"
#include "solid.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

// A box from (0, 0, 0) to (x, y, z) of 8 vertices; without its lid if `open`.
static hw_mesh box_mesh(float x, float y, float z, bool open)
{
    static const uint32_t indices[36] = {0, 2, 1, 1, 2, 3, 0, 1, 4, 1, 5, 4, 1, 3, 5, 3, 7, 5,
                                         3, 2, 7, 2, 6, 7, 2, 0, 6, 0, 4, 6, 4, 5, 6, 5, 7, 6};
    hw_mesh mesh = {.vertex_count = 8, .index_count = open ? 30 : 36};
    assert_int_equal(HW_NEW(&mesh.positions, 8), HW_OK);
    assert_int_equal(HW_NEW(&mesh.indices, 36), HW_OK);
    hw_box box = {{0, 0, 0}, {x, y, z}};
    for (uint32_t i = 0; i < 8; i++)
        mesh.positions[i] = hw_box_corner(box, i);
    memcpy(mesh.indices, indices, sizeof indices);
    return mesh;
}

// Whether the cube that holds the point is taken; outside the grid none is.
static bool taken(const hw_solid *s, double x, double y, double z)
{
    const double at[3] = {x - s->origin.x, y - s->origin.y, z - s->origin.z};
    int32_t i[3];
    for (int k = 0; k < 3; k++) {
        i[k] = (int32_t)floor(at[k] / s->side);
        if (i[k] < 0 || i[k] >= s->count[k])
            return false;
    }
    return hw_solid_has(s, i[0], i[1], i[2]);
}

static void test_box_is_filled(void **state)
{
    (void)state;
    hw_mesh mesh = box_mesh(10, 20, 30, false);
    hw_solid s;
    assert_int_equal(hw_solid_make(&s, &mesh, 1), HW_OK);
    assert_true(s.side == 1);
    for (double x = -3.25; x < 14; x += 0.5)
        for (double y = -3.25; y < 24; y += 0.5)
            for (double z = -3.25; z < 34; z += 0.5) {
                bool inside = x > 0 && y > 0 && z > 0 && x < 10 && y < 20 && z < 30;
                bool far = x < -1 || y < -1 || z < -1 || x > 11 || y > 21 || z > 31;
                if (inside)
                    assert_true(taken(&s, x, y, z));
                if (far)
                    assert_false(taken(&s, x, y, z));
            }
    hw_solid_free(&s);
    hw_solid_free(NULL);
    hw_mesh_free(&mesh);
}

// What is open at one side encloses nothing.
static void test_open_box_is_hollow(void **state)
{
    (void)state;
    hw_mesh mesh = box_mesh(20, 20, 20, true);
    hw_solid s;
    assert_int_equal(hw_solid_make(&s, &mesh, 1), HW_OK);
    assert_false(taken(&s, 10.2, 10.2, 10.2));
    assert_true(taken(&s, 10.2, 10.2, 0));
    assert_true(taken(&s, 20, 10.2, 10.2));
    hw_solid_free(&s);
    hw_mesh_free(&mesh);
}

// A wall at any angle lets no path of cubes through: both its sides are filled separately.
static void test_slanted_shells_are_tight(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(7, 0);
    for (int n = 0; n < 50; n++) {
        hw_mesh mesh = box_mesh(17, 23, 31, false);
        hw_vec3 axis = hw_v3(hw_rng_float(&rng), hw_rng_float(&rng), hw_rng_float(&rng) + 0.1f);
        hw_vec3 u = hw_v3_normalize(axis), v = hw_v3_normalize(hw_v3_cross(u, hw_v3(1, 2, -3)));
        hw_vec3 w = hw_v3_cross(u, v);
        for (uint32_t i = 0; i < 8; i++) {
            hw_vec3 p = mesh.positions[i];
            mesh.positions[i] =
                hw_v3_add(hw_v3_add(hw_v3_scale(u, p.x), hw_v3_scale(v, p.y)), hw_v3_scale(w, p.z));
        }
        hw_vec3 c = hw_v3_scale(hw_v3_add(mesh.positions[0], mesh.positions[7]), 0.5f);
        hw_solid s;
        assert_int_equal(hw_solid_make(&s, &mesh, 0.7), HW_OK);
        assert_true(taken(&s, c.x, c.y, c.z));
        hw_solid_free(&s);
        hw_mesh_free(&mesh);
    }
}

static void test_large_meshes_get_coarse_cubes(void **state)
{
    (void)state;
    hw_mesh mesh = box_mesh(1e6f, 10, 10, false);
    hw_solid s;
    assert_int_equal(hw_solid_make(&s, &mesh, 1), HW_OK);
    for (int i = 0; i < 3; i++)
        assert_true(s.count[i] >= 1 && s.count[i] <= HW_SOLID_SIDE_MAX);
    assert_true(taken(&s, 5e5, 5, 5));
    hw_solid_free(&s);
    hw_mesh_free(&mesh);
    mesh = box_mesh(0, 0, 0, false); // a point
    assert_int_equal(hw_solid_make(&s, &mesh, 1), HW_OK);
    assert_true(taken(&s, 0, 0, 0));
    hw_solid_free(&s);
    hw_mesh_free(&mesh);
}

// A sheet of 4.5 million tiny triangles needs no larger cubes than one of a few.
static void test_many_triangles_stay_fine(void **state)
{
    (void)state;
    enum { SIDE = 1500 };
    hw_mesh mesh = {.vertex_count = (SIDE + 1) * (SIDE + 1), .index_count = 6 * SIDE * SIDE};
    assert_int_equal(HW_NEW(&mesh.positions, mesh.vertex_count), HW_OK);
    assert_int_equal(HW_NEW(&mesh.indices, mesh.index_count), HW_OK);
    for (uint32_t i = 0; i < mesh.vertex_count; i++)
        mesh.positions[i] =
            hw_v3(10 * (float)(i % (SIDE + 1)) / SIDE, 10 * (float)(i / (SIDE + 1)) / SIDE, 0);
    for (uint32_t i = 0; i < SIDE * SIDE; i++) {
        uint32_t a = i / SIDE * (SIDE + 1) + i % SIDE, b = a + SIDE + 1;
        const uint32_t quad[6] = {a, a + 1, b, b, a + 1, b + 1};
        memcpy(mesh.indices + 6 * (size_t)i, quad, sizeof quad);
    }
    hw_solid s;
    assert_int_equal(hw_solid_make(&s, &mesh, 1), HW_OK);
    assert_true(s.side == 1);
    assert_true(taken(&s, 5.2, 5.2, 0.1));
    assert_false(taken(&s, 5.2, 5.2, 1.6) || taken(&s, 12.6, 5.2, 0.1));
    hw_solid_free(&s);
    hw_mesh_free(&mesh);
}

static void test_solid_without_memory(void **state)
{
    (void)state;
    hw_mesh mesh = box_mesh(5, 5, 5, false);
    hw_solid s;
    for (uint64_t n = 1; n <= 3; n++) {
        hw_alloc_fail_after(n);
        assert_int_equal(hw_solid_make(&s, &mesh, 1), HW_MEMORY);
        assert_null(s.bits);
    }
    hw_alloc_fail_after(4);
    assert_int_equal(hw_solid_make(&s, &mesh, 1), HW_OK);
    hw_alloc_fail_after(0);
    hw_solid_free(&s);
    hw_mesh_free(&mesh);
}

// ---- Boxes by place

static void test_box_grid_finds_what_is_near(void **state)
{
    (void)state;
    enum { COUNT = 300 };
    const double reach = 5;
    hw_rng rng = hw_rng_make(3, 0);
    hw_box boxes[COUNT], bounds = hw_box_empty();
    for (int i = 0; i < COUNT; i++) {
        hw_vec3 p = hw_v3(1000 * hw_rng_float(&rng), 200 * hw_rng_float(&rng), 0);
        float side = 50 * hw_rng_float(&rng);
        boxes[i] = (hw_box){p, hw_v3_add(p, hw_v3(side, 2 * side, 1))};
        bounds = hw_box_union(bounds, boxes[i]);
    }
    hw_box_grid *grid;
    assert_int_equal(hw_box_grid_create(&grid, boxes, COUNT, bounds, reach), HW_OK);
    uint64_t listed = 0;
    for (int n = 0; n < 5000; n++) {
        double x = -20 + 1100 * hw_rng_float(&rng), y = -20 + 350 * hw_rng_float(&rng);
        const uint32_t *found;
        uint32_t count = hw_box_grid_at(grid, x, y, &found), at = 0;
        listed += count;
        for (uint32_t i = 0; i < COUNT; i++) {
            while (at < count && found[at] < i)
                at++;
            bool near = x >= boxes[i].min.x - reach && x <= boxes[i].max.x + reach &&
                        y >= boxes[i].min.y - reach && y <= boxes[i].max.y + reach;
            if (near)
                assert_true(at < count && found[at] == i);
        }
    }
    assert_true(listed < UINT64_C(5000) * COUNT / 10); // and not much else
    hw_box_grid_destroy(grid);
    hw_box_grid_destroy(NULL);
    assert_int_equal(hw_box_grid_create(&grid, NULL, 0, hw_box_empty(), 1), HW_OK);
    const uint32_t *found;
    assert_int_equal(hw_box_grid_at(grid, 0, 0, &found), 0);
    hw_box_grid_destroy(grid);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_box_is_filled),
        cmocka_unit_test(test_open_box_is_hollow),
        cmocka_unit_test(test_slanted_shells_are_tight),
        cmocka_unit_test(test_large_meshes_get_coarse_cubes),
        cmocka_unit_test(test_many_triangles_stay_fine),
        cmocka_unit_test(test_solid_without_memory),
        cmocka_unit_test(test_box_grid_finds_what_is_near),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
