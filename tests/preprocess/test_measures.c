#include "shapes.h"

#include "measures.h"

static hw_measures take(const hw_mesh *a, const hw_mesh *b, const hw_measures_options *options)
{
    hw_rays *rays_a = NULL, *rays_b = NULL;
    hw_measures m;
    assert_int_equal(hw_rays_create_mesh(&rays_a, a), HW_OK);
    assert_int_equal(hw_rays_create_mesh(&rays_b, b), HW_OK);
    assert_int_equal(hw_measures_take(rays_a, rays_b, options, &m), HW_OK);
    hw_rays_destroy(rays_a);
    hw_rays_destroy(rays_b);
    return m;
}

static const hw_measures_options no_images = {.no_images = true};

static void test_volume_of_cubes(void **state)
{
    (void)state;
    hw_mesh a = shape_box((hw_box){{10, 10, 10}, {11, 11, 11}}, false);
    hw_mesh b = shape_box((hw_box){{-2, 0, 0}, {0, 2, 2}}, false);
    hw_mesh inward = shape_box((hw_box){{-2, 0, 0}, {0, 2, 2}}, true);
    hw_measures m = take(&a, &b, &no_images);
    assert_float_equal(m.volume_ratio, 8, 1e-6);
    assert_float_equal(m.diagonal, sqrt(3), 1e-6);
    assert_float_equal(take(&a, &inward, &no_images).volume_ratio, -8, 1e-6);
    b.index_count -= 3;
    m = take(&a, &b, &no_images);
    assert_true(m.open_edges[0] == 0 && m.open_edges[1] == 3);
    assert_float_equal(m.volume_ratio, m.volume[1] / m.volume[0], 1e-12);
    m = take(&b, &a, &no_images);
    assert_true(m.open_edges[0] == 3 && m.open_edges[1] == 0);
    assert_true(isnan(m.views.l1) && isnan(m.views.silhouette) && isnan(m.pixel));
    hw_mesh_free(&a);
    hw_mesh_free(&b);
    hw_mesh_free(&inward);
}

// Closed by position, not by index; one triangle turned opens its three edges; a sheet with two
// sides is closed but has no volume.
static void test_open_edges(void **state)
{
    (void)state;
    uint64_t open;
    hw_mesh box = shape_box((hw_box){{0, 0, 0}, {1, 1, 1}}, false), split = shape_alloc(36, 36);
    for (uint32_t i = 0; i < 36; i++) {
        split.positions[i] = box.positions[box.indices[i]];
        split.indices[i] = i;
    }
    assert_int_equal(hw_mesh_open_edges(&split, &open), HW_OK);
    assert_int_equal(open, 0);
    split.indices[0] = 1;
    split.indices[1] = 0;
    assert_int_equal(hw_mesh_open_edges(&split, &open), HW_OK);
    assert_int_equal(open, 3);
    hw_mesh sheet = shape_plane(hw_v3(0, 0, 0), hw_v3(1, 0, 0), hw_v3(0, 1, 0), 3, 3);
    hw_mesh back = shape_plane(hw_v3(0, 0, 0), hw_v3(0, 1, 0), hw_v3(1, 0, 0), 3, 3);
    assert_int_equal(hw_mesh_open_edges(&sheet, &open), HW_OK);
    assert_int_equal(open, 12);
    shape_append(&sheet, &back);
    hw_measures m = take(&sheet, &box, &no_images);
    assert_int_equal(m.open_edges[0], 0);
    assert_true(isnan(m.volume_ratio));
    hw_mesh_free(&box);
    hw_mesh_free(&split);
    hw_mesh_free(&sheet);
}

static void test_sliver(void **state)
{
    (void)state;
    hw_mesh mesh = shape_alloc(5, 9);
    mesh.positions[1] = hw_v3(1, 0, 0);
    mesh.positions[2] = hw_v3(0.5f, sqrtf(0.75f), 0);
    mesh.positions[3] = hw_v3(0, 1, 0);
    mesh.positions[4] = hw_v3(1, 0, 0);
    const uint32_t indices[9] = {0, 1, 2, 0, 1, 3, 0, 1, 4};
    memcpy(mesh.indices, indices, sizeof indices);
    const double right = (2 + sqrt(2)) / 3, expected[] = {NAN, 1, (1 + right) / 2};
    for (uint32_t count = 1; count <= 2; count++) {
        mesh.index_count = 3 * count;
        assert_float_equal(hw_mesh_sliver(&mesh).ratio, expected[count], 1e-6);
        assert_int_equal(hw_mesh_sliver(&mesh).degenerate, 0);
    }
    mesh.index_count = 9; // the third has an edge of no length
    assert_float_equal(hw_mesh_sliver(&mesh).ratio, expected[2], 1e-6);
    assert_int_equal(hw_mesh_sliver(&mesh).degenerate, 1);
    memcpy(mesh.indices, indices + 6, 3 * sizeof *indices);
    mesh.index_count = 3;
    assert_true(isnan(hw_mesh_sliver(&mesh).ratio));
    hw_mesh_free(&mesh);
}

static void test_itself(void **state)
{
    (void)state;
    hw_mesh a = shape_sphere(hw_v3(1, 2, 3), 1, 48, 24);
    hw_measures m = take(&a, &a, NULL);
    assert_true(m.forward.max <= m.forward.floor && m.backward.max <= m.backward.floor);
    assert_true(m.forward.converged && m.backward.converged);
    assert_true(m.volume_ratio == 1 && m.sliver[0].ratio == m.sliver[1].ratio);
    assert_true(m.views.l1 == 0 && m.views.l2 == 0 && m.views.silhouette == 0);
    assert_true(m.views.model_pixels > 0);
    hw_mesh_free(&a);
}

// Forward is from a to b; and the parts called alone say what the whole says.
static void test_sides_and_parts(void **state)
{
    (void)state;
    hw_mesh a = shape_box((hw_box){{0, 0, 0}, {1, 1, 1}}, false), b = a;
    hw_mesh chip = shape_box((hw_box){{0.4f, 0.4f, 0.9f}, {0.5f, 0.5f, 1.1f}}, false);
    hw_mesh both = shape_box((hw_box){{0, 0, 0}, {1, 1, 1}}, false);
    shape_append(&both, &chip);
    hw_measures m = take(&b, &both, NULL);
    assert_true(m.forward.max <= m.forward.floor); // all of a is in b
    assert_float_equal(m.backward.max, 0.1, 1e-6); // b's chip sticks out of a, and into it
    hw_rays *rays = NULL, *rays_b = NULL;
    hw_views *views = NULL;
    hw_view_errors e;
    assert_int_equal(hw_rays_create_mesh(&rays, &a), HW_OK);
    assert_int_equal(hw_rays_create_mesh(&rays_b, &both), HW_OK);
    assert_int_equal(hw_views_create(&views, rays, hw_view_frame_fit(&a, NULL), 2), HW_OK);
    for (int k = 0; k < 2; k++) {
        assert_int_equal(hw_views_compare(views, rays_b, 1, &e), HW_OK);
        assert_memory_equal(&e, &m.views, sizeof e);
    }
    hw_views_destroy(views);
    hw_rays_destroy(rays);
    hw_rays_destroy(rays_b);
    hw_mesh_free(&a);
    hw_mesh_free(&both);
}

static void test_failing_allocations(void **state)
{
    (void)state;
    hw_mesh a = shape_box((hw_box){{0, 0, 0}, {1, 1, 1}}, false);
    hw_mesh b = shape_box((hw_box){{0, 0, 0}, {1, 1, 0.9f}}, false);
    hw_measures_options o = {.distance = {.samples_max = 16, .threads = 1}};
    hw_rays *rays_a = NULL, *rays_b = NULL;
    hw_measures m;
    uint64_t n = 1;
    assert_int_equal(hw_rays_create_mesh(&rays_a, &a), HW_OK);
    assert_int_equal(hw_rays_create_mesh(&rays_b, &b), HW_OK);
    for (;; n++) {
        hw_alloc_fail_after(n);
        hw_status status = hw_measures_take(rays_a, rays_b, &o, &m);
        hw_alloc_fail_after(0);
        if (status == HW_OK)
            break;
        assert_int_equal(status, HW_MEMORY);
    }
    assert_true(n > 10);
    hw_rays_destroy(rays_a);
    hw_rays_destroy(rays_b);
    hw_mesh_free(&a);
    hw_mesh_free(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_volume_of_cubes), cmocka_unit_test(test_open_edges),
        cmocka_unit_test(test_sliver),          cmocka_unit_test(test_itself),
        cmocka_unit_test(test_sides_and_parts), cmocka_unit_test(test_failing_allocations),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
