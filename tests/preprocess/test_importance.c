#include "shapes.h"

#include "importance.h"

static void measure(const hw_mesh *mesh, uint32_t samples, float floor, uint32_t threads,
                    float *out)
{
    hw_rays *rays = NULL;
    assert_int_equal(hw_rays_create_mesh(&rays, mesh), HW_OK);
    const hw_importance_options options = {samples, floor, 1, HW_IMPORTANCE_WALKER_DEGREES,
                                           threads};
    assert_int_equal(hw_silhouette_importance(mesh, rays, &options, out), HW_OK);
    hw_rays_destroy(rays);
}

static void test_convex_is_one_cavity_is_floor(void **state)
{
    (void)state;
    float importance[600];
    hw_box box = {{-1, -2, 0}, {1, 2, 3}};
    hw_mesh outside = shape_box(box, false), inside = shape_box(box, true);
    measure(&outside, 16, 0.1f, 1, importance);
    for (int i = 0; i < 8; i++)
        assert_float_equal(importance[i], 1, 0);
    measure(&inside, 16, 0.1f, 1, importance);
    for (int i = 0; i < 8; i++)
        assert_float_equal(importance[i], 0.1f, 0);
    hw_mesh_free(&outside);
    hw_mesh_free(&inside);

    hw_mesh sphere = shape_sphere(hw_v3(3, 3, 3), 2, 32, 16);
    measure(&sphere, 0, 0, 0, importance);
    for (uint32_t i = 0; i < sphere.vertex_count; i++)
        assert_float_equal(importance[i], 1, 0);
    hw_mesh_free(&sphere);
}

// A wall at distance d that reaches d to both sides hides a quarter of the horizon, so half of the
// lines, from a point on top of a small ball. Both ways count: it does so from either side.
static void test_wall_hides_half_of_the_lines(void **state)
{
    (void)state;
    for (int side = -1; side <= 1; side += 2) {
        hw_mesh mesh = shape_sphere(hw_v3(0, 0, 0), 0.5f, 16, 8);
        uint32_t pole = mesh.vertex_count - 1, flank = 3 * 16 + 0;
        hw_mesh wall = shape_plane(hw_v3((float)(10 * side), -10, -10), hw_v3(0, 20, 0),
                                   hw_v3(0, 0, 20), 1, 1);
        shape_append(&mesh, &wall);
        float importance[200];
        measure(&mesh, 400, 0, 1, importance);
        assert_float_equal(mesh.normals[pole].z, 1, 1e-6);
        assert_float_equal(importance[pole], 0.5, 0.01);
        // The flank that faces the wall has tangents parallel to it: free.
        assert_float_equal(mesh.normals[flank].x, 1, 1e-6);
        assert_float_equal(importance[flank], 1, 0);
        hw_mesh_free(&mesh);
    }
}

// Steep lines do not count: a roof above and a floor below a ball leave it fully important.
static void test_only_near_horizontal_lines(void **state)
{
    (void)state;
    hw_mesh mesh = shape_sphere(hw_v3(0, 0, 0), 0.5f, 16, 8);
    uint32_t count = mesh.vertex_count;
    hw_mesh roof = shape_plane(hw_v3(-5, -5, 2.5f), hw_v3(10, 0, 0), hw_v3(0, 10, 0), 1, 1);
    shape_append(&mesh, &roof); // from the middle it begins 26 degrees up
    float importance[200];
    measure(&mesh, 64, 0, 1, importance);
    for (uint32_t i = 0; i < count; i++)
        assert_float_equal(importance[i], 1, 0);
    hw_mesh_free(&mesh);
}

static void test_threads_and_usage(void **state)
{
    (void)state;
    hw_mesh mesh = shape_sphere(hw_v3(0, 0, 0), 1, 40, 20);
    hw_mesh other = shape_sphere(hw_v3(1.2f, 0.3f, 0.1f), 0.7f, 40, 20);
    shape_append(&mesh, &other);
    float one[2000], many[2000];
    measure(&mesh, 32, 0.02f, 1, one);
    measure(&mesh, 32, 0.02f, 3, many);
    assert_memory_equal(one, many, mesh.vertex_count * sizeof *one);
    bool between = false;
    for (uint32_t i = 0; i < mesh.vertex_count; i++) {
        assert_true(one[i] >= 0.02f && one[i] <= 1);
        between |= one[i] > 0.1f && one[i] < 0.9f;
    }
    assert_true(between);

    hw_rays *rays = NULL;
    assert_int_equal(hw_rays_create_mesh(&rays, &mesh), HW_OK);
    mesh.normals[5] = hw_v3(0, 0, 0);
    hw_importance_options options = {8, 0.25f, 1, HW_IMPORTANCE_WALKER_DEGREES, 1};
    assert_int_equal(hw_silhouette_importance(&mesh, rays, &options, one), HW_OK);
    assert_float_equal(one[5], 0.25f, 0);
    hw_free(mesh.normals);
    mesh.normals = NULL;
    assert_int_equal(hw_silhouette_importance(&mesh, rays, &options, one), HW_USAGE);
    hw_rays_destroy(rays);
    hw_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_convex_is_one_cavity_is_floor),
        cmocka_unit_test(test_wall_hides_half_of_the_lines),
        cmocka_unit_test(test_only_near_horizontal_lines),
        cmocka_unit_test(test_threads_and_usage),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
