#include "shapes.h"

#include "ambient.h"

// A sphere standing on the ground hides nothing from itself; the ground, half as bright as the sky,
// fills (1 - n.z) / 2 of the cosine-weighted hemisphere.
static void test_sphere_on_the_ground(void **state)
{
    (void)state;
    hw_mesh mesh = shape_sphere(hw_v3(5, -3, 1), 1, 48, 24);
    assert_int_equal(hw_ambient_bake(&mesh, 256, 0), HW_OK);
    assert_non_null(mesh.colors);
    double error = 0;
    for (uint32_t i = 0; i < mesh.vertex_count; i++) {
        double expected = (3 + mesh.normals[i].z) / 4, found = mesh.colors[i].r / 255.0;
        assert_float_equal(found, expected, 0.04);
        error += found - expected;
        assert_int_equal(mesh.colors[i].r, mesh.colors[i].g);
        assert_int_equal(mesh.colors[i].r, mesh.colors[i].b);
        assert_int_equal(mesh.colors[i].a, 255);
    }
    assert_float_equal(error / mesh.vertex_count, 0, 0.005);
    hw_mesh_free(&mesh);
}

// A point on the floor right below a sphere of radius r at height h keeps 1 - (r / h)^2 of the
// cosine-weighted hemisphere.
static void test_sphere_above_the_floor(void **state)
{
    (void)state;
    hw_mesh mesh = shape_plane(hw_v3(-4, -4, 0), hw_v3(8, 0, 0), hw_v3(0, 8, 0), 8, 8);
    hw_mesh sphere = shape_sphere(hw_v3(0, 0, 2), 1, 96, 48);
    uint32_t below = 4 * 9 + 4;
    assert_float_equal(mesh.positions[below].x, 0, 1e-6);
    shape_append(&mesh, &sphere);
    assert_int_equal(hw_ambient_bake(&mesh, 1024, 0), HW_OK);
    assert_float_equal(mesh.colors[below].r / 255.0, 0.75, 0.01);
    assert_true(mesh.colors[0].r > mesh.colors[below].r + 30); // a far corner of the floor
    hw_mesh_free(&mesh);
}

static void test_inside_is_dark_and_colours_multiply(void **state)
{
    (void)state;
    hw_mesh box = shape_box((hw_box){{0, 0, 0}, {1, 1, 1}}, true);
    assert_int_equal(hw_ambient_bake(&box, 64, 1), HW_OK);
    for (uint32_t i = 0; i < box.vertex_count; i++)
        assert_int_equal(box.colors[i].r, 0);
    hw_mesh_free(&box);

    hw_mesh plane = shape_plane(hw_v3(0, 0, 0), hw_v3(1, 0, 0), hw_v3(0, 1, 0), 2, 2);
    assert_int_equal(HW_NEW(&plane.colors, plane.vertex_count), HW_OK);
    for (uint32_t i = 0; i < plane.vertex_count; i++)
        plane.colors[i] = (hw_color8){200, 100, 7, 9};
    assert_int_equal(hw_ambient_bake(&plane, 0, 1), HW_OK);
    for (uint32_t i = 0; i < plane.vertex_count; i++) { // wholly open
        assert_int_equal(plane.colors[i].r, 200);
        assert_int_equal(plane.colors[i].g, 100);
        assert_int_equal(plane.colors[i].b, 7);
        assert_int_equal(plane.colors[i].a, 9);
    }
    hw_mesh_free(&plane);
}

static void test_same_for_any_threads_and_seams(void **state)
{
    (void)state;
    hw_mesh meshes[2];
    for (int k = 0; k < 2; k++) {
        meshes[k] = shape_sphere(hw_v3(0, 0, 1), 1, 32, 16);
        hw_mesh other = shape_sphere(hw_v3(0, 0, 1), 1, 32, 16); // the same places once more
        shape_append(&meshes[k], &other);
        assert_int_equal(hw_ambient_bake(&meshes[k], 0, k == 0 ? 1 : 3), HW_OK);
    }
    uint32_t half = meshes[0].vertex_count / 2;
    assert_memory_equal(meshes[0].colors, meshes[1].colors,
                        meshes[0].vertex_count * sizeof(hw_color8));
    assert_memory_equal(meshes[0].colors, meshes[0].colors + half, half * sizeof(hw_color8));
    hw_mesh_free(&meshes[0]);
    hw_mesh_free(&meshes[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sphere_on_the_ground),
        cmocka_unit_test(test_sphere_above_the_floor),
        cmocka_unit_test(test_inside_is_dark_and_colours_multiply),
        cmocka_unit_test(test_same_for_any_threads_and_seams),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
