#include "shapes.h"

#include "fit_shading.h"
#include <stdlib.h>

#define FINE   64u
#define COARSE 4u

static hw_mesh make_plane(uint32_t n, bool colors)
{
    hw_mesh mesh = shape_plane(hw_v3(0, 0, 0), hw_v3(1, 0, 0), hw_v3(0, 1, 0), n, n);
    if (colors)
        assert_int_equal(HW_NEW(&mesh.colors, mesh.vertex_count), HW_OK);
    return mesh;
}

static void fit(hw_mesh *mesh, const hw_mesh *original)
{
    hw_rays *rays = NULL;
    assert_int_equal(hw_rays_create_mesh(&rays, original), HW_OK);
    assert_int_equal(hw_fit_shading(mesh, original, rays), HW_OK);
    hw_rays_destroy(rays);
}

// What few vertices can show is shown as it is, wherever the fit starts (a fiftieth of that stays).
static void test_ramps_come_back(void **state)
{
    (void)state;
    hw_mesh fine = make_plane(FINE, true), coarse = make_plane(COARSE, true);
    for (uint32_t v = 0; v < fine.vertex_count; v++) {
        hw_vec3 p = fine.positions[v];
        fine.colors[v] =
            (hw_color8){(uint8_t)(20 + 200 * p.x), (uint8_t)(240 - 200 * p.y), 77, 255};
        fine.normals[v] = hw_v3_normalize(hw_v3(0.3f * p.x, 0, 1));
    }
    memset(coarse.colors, 9, coarse.vertex_count * sizeof *coarse.colors);
    fit(&coarse, &fine);
    for (uint32_t v = 0; v < coarse.vertex_count; v++) {
        hw_vec3 p = coarse.positions[v];
        hw_vec3 normal = hw_v3_normalize(hw_v3(0.3f * p.x, 0, 1));
        assert_in_range(coarse.colors[v].r + 6 - (int)(20 + 200 * p.x), 0, 12);
        assert_in_range(coarse.colors[v].g + 6 - (int)(240 - 200 * p.y), 0, 12);
        assert_in_range(coarse.colors[v].b, 71, 83);
        assert_int_equal(coarse.colors[v].a, 9); // not a colour of the surface
        assert_float_equal(hw_v3_dot(coarse.normals[v], normal), 1, 1e-3);
    }
    hw_mesh_free(&fine);
    hw_mesh_free(&coarse);
}

// Stripes finer than the mesh become their mean, also at vertices that lie on a dark one.
static void test_detail_becomes_its_mean(void **state)
{
    (void)state;
    hw_mesh fine = make_plane(FINE, true), coarse = make_plane(COARSE, true);
    for (uint32_t v = 0; v < fine.vertex_count; v++) {
        uint8_t value = v % (FINE + 1) % 2 ? 200 : 100;
        fine.colors[v] = (hw_color8){value, value, value, 255};
        fine.normals[v] = hw_v3_normalize(hw_v3(value == 200 ? 0.5f : -0.5f, 0, 1));
    }
    memset(coarse.colors, 100, coarse.vertex_count * sizeof *coarse.colors);
    fit(&coarse, &fine);
    uint32_t sum = 0, off = 0;
    float tilt = 0; // 0.447 each at the original's vertices
    for (uint32_t v = 0; v < coarse.vertex_count; v++) {
        sum += coarse.colors[v].g;
        off += (uint32_t)abs(coarse.colors[v].g - 150);
        tilt += fabsf(coarse.normals[v].x);
        assert_float_equal(hw_v3_length(coarse.normals[v]), 1, 1e-5);
    }
    assert_in_range(sum / coarse.vertex_count, 140, 160);
    assert_true(tilt / (float)coarse.vertex_count < 0.15f);
    assert_in_range(off / coarse.vertex_count, 0, 15); // corners have few samples
    hw_mesh_free(&fine);
    hw_mesh_free(&coarse);
}

// The surface behind is closer than the one that the mesh stands for: it has no say.
static void test_backs_of_others_do_not_count(void **state)
{
    (void)state;
    hw_mesh front = make_plane(FINE, true), coarse = make_plane(COARSE, true);
    hw_mesh back = shape_plane(hw_v3(0, 0, -0.01f), hw_v3(0, 1, 0), hw_v3(1, 0, 0), 2, 2);
    for (uint32_t v = 0; v < front.vertex_count; v++)
        front.positions[v].z = front.positions[v].x < 0.5f ? 0.0f : 0.1f;
    uint32_t seam = front.vertex_count;
    shape_append(&front, &back);
    assert_int_equal(HW_RESIZE(&front.colors, front.vertex_count), HW_OK);
    for (uint32_t v = 0; v < front.vertex_count; v++)
        memset(&front.colors[v], v < seam ? 200 : 0, sizeof *front.colors);
    memset(coarse.colors, 200, coarse.vertex_count * sizeof *coarse.colors);
    fit(&coarse, &front);
    for (uint32_t v = 0; v < coarse.vertex_count; v++) {
        assert_in_range(coarse.colors[v].r, 190, 210);
        assert_true(coarse.normals[v].z > 0.9f);
    }
    hw_mesh_free(&front);
    hw_mesh_free(&coarse);
}

static void test_without_colours(void **state)
{
    (void)state;
    hw_mesh fine = make_plane(FINE, false), coarse = make_plane(COARSE, false);
    hw_free(coarse.normals);
    coarse.normals = NULL;
    hw_free(fine.normals);
    fine.normals = NULL;
    fit(&coarse, &fine);
    assert_null(coarse.colors);
    assert_null(fine.normals);
    for (uint32_t v = 0; v < coarse.vertex_count; v++)
        assert_float_equal(coarse.normals[v].z, 1, 1e-5);
    hw_mesh_free(&fine);
    hw_mesh_free(&coarse);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ramps_come_back),
        cmocka_unit_test(test_detail_becomes_its_mean),
        cmocka_unit_test(test_backs_of_others_do_not_count),
        cmocka_unit_test(test_without_colours),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
