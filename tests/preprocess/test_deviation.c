#include "shapes.h"

#include "appearance.h"
#include "deviation.h"

static hw_deviation surface(const hw_mesh *original, const hw_mesh *level, uint32_t samples)
{
    hw_rays *rays = NULL;
    hw_deviation deviation;
    assert_int_equal(hw_rays_create_mesh(&rays, original), HW_OK);
    assert_int_equal(hw_surface_deviation(rays, original, level, samples, 5, &deviation), HW_OK);
    hw_rays_destroy(rays);
    return deviation;
}

static void test_shifted_plane(void **state)
{
    (void)state;
    hw_mesh a = shape_plane(hw_v3(0, 0, 0), hw_v3(4, 0, 0), hw_v3(0, 3, 0), 9, 5);
    hw_mesh b = shape_plane(hw_v3(0, 0, 0.25f), hw_v3(4, 0, 0), hw_v3(0, 3, 0), 2, 3);
    hw_deviation d = surface(&a, &b, 2000);
    assert_float_equal(d.rms, 0.25, 1e-5);
    assert_float_equal(d.max, 0.25, 1e-5);
    assert_float_equal(d.mean, 0.25, 1e-5);
    d = surface(&a, &a, 2000);
    assert_float_equal(d.max, 0, 1e-5);
    hw_mesh_free(&a);
    hw_mesh_free(&b);
}

// One side alone sees nothing: half of the original is missing in the level, or the other way.
static void test_both_sides_count(void **state)
{
    (void)state;
    hw_mesh whole = shape_plane(hw_v3(0, 0, 0), hw_v3(2, 0, 0), hw_v3(0, 3, 0), 8, 8);
    hw_mesh half = shape_plane(hw_v3(0, 0, 0), hw_v3(1, 0, 0), hw_v3(0, 3, 0), 8, 8);
    for (int k = 0; k < 2; k++) {
        hw_deviation d = k ? surface(&whole, &half, 5000) : surface(&half, &whole, 5000);
        // Distances run evenly from 0 to 1 over half of the points.
        assert_float_equal(d.max, 1, 1e-5);
        assert_float_equal(d.mean, 0.25, 0.005);
        assert_float_equal(d.rms, sqrt(1.0 / 6), 0.005);
    }
    hw_mesh_free(&whole);
    hw_mesh_free(&half);
}

// Sampling goes by area: many tiny triangles in a corner must not weigh more than a large one.
static void test_area_weighting(void **state)
{
    (void)state;
    hw_mesh original = shape_plane(hw_v3(0, 0, 0), hw_v3(1, 0, 0), hw_v3(0, 1, 0), 1, 1);
    hw_mesh level = shape_plane(hw_v3(0, 0, 0), hw_v3(1, 0, 0), hw_v3(0, 0.5f, 0), 1, 1);
    hw_mesh raised = shape_plane(hw_v3(0, 0.5f, 0.1f), hw_v3(1, 0, 0), hw_v3(0, 0.5f, 0), 20, 20);
    shape_append(&level, &raised);
    hw_deviation d = surface(&original, &level, 4000);
    assert_float_equal(d.mean, 0.05, 0.001);
    assert_float_equal(d.rms, 0.1 * sqrt(0.5), 0.001);
    assert_float_equal(d.max, 0.1, 1e-5);
    hw_mesh_free(&original);
    hw_mesh_free(&level);
}

static void test_surface_of_spheres_and_seeds(void **state)
{
    (void)state;
    hw_mesh a = shape_sphere(hw_v3(0, 0, 0), 1, 128, 64);
    hw_mesh b = shape_sphere(hw_v3(0, 0, 0), 1.1f, 128, 64);
    hw_deviation d = surface(&a, &b, 3000), e = surface(&a, &b, 3000);
    assert_float_equal(d.mean, 0.1, 0.002);
    assert_memory_equal(&d, &e, sizeof d);
    hw_mesh empty = {0};
    hw_rays *rays = NULL;
    assert_int_equal(hw_rays_create_mesh(&rays, &a), HW_OK);
    assert_int_equal(hw_surface_deviation(rays, &a, &empty, 10, 0, &d), HW_USAGE);
    hw_rays_destroy(rays);
    hw_mesh_free(&a);
    hw_mesh_free(&b);
}

static hw_mesh painted_plane(uint32_t n, bool upward, uint8_t value)
{
    hw_vec3 a = hw_v3(4, 0, 0), b = hw_v3(0, 3, 0);
    hw_mesh mesh = shape_plane(hw_v3(0, 0, 0), upward ? a : b, upward ? b : a, n, n);
    assert_int_equal(HW_NEW(&mesh.colors, mesh.vertex_count), HW_OK);
    memset(mesh.colors, value, mesh.vertex_count * sizeof *mesh.colors);
    return mesh;
}

// By colour and by normal; what faces the other way is another surface.
static void test_shading(void **state)
{
    (void)state;
    hw_mesh a = painted_plane(7, true, 200), b = painted_plane(2, true, 100),
            back = painted_plane(2, false, 100);
    float light = hw_light(hw_v3(0, 0, 1));
    assert_float_equal(surface(&a, &b, 500).shading, light * 100 / 255, 1e-5);
    assert_float_equal(surface(&b, &a, 500).shading, light * 100 / 255, 1e-5);
    assert_float_equal(surface(&a, &a, 500).shading, 0, 1e-5);
    assert_float_equal(surface(&a, &back, 500).shading, 0, 0);
    for (uint32_t v = 0; v < b.vertex_count; v++) {
        b.colors[v] = a.colors[0];
        b.normals[v] = hw_v3(0.6f, 0, 0.8f);
    }
    float tilted = 0; // a light at each of eight azimuths, as if the plane stood turned
    for (int k = 0; k < 8; k++) {
        float angle = (float)k * (float)HW_PI / 4;
        float off = hw_light(hw_v3(0.6f * cosf(angle), 0.6f * sinf(angle), 0.8f)) - light;
        tilted += off * off / 8;
    }
    assert_float_equal(surface(&a, &b, 500).shading, sqrtf(tilted) * 200 / 255, 1e-5);
    hw_free(b.normals);
    b.normals = NULL;
    assert_float_equal(surface(&a, &b, 500).shading, 0, 0);
    hw_mesh_free(&a);
    hw_mesh_free(&b);
    hw_mesh_free(&back);
}

static float outline_of(const hw_outline *outline, const hw_mesh *level)
{
    float value = -1;
    assert_int_equal(hw_outline_deviation(outline, level, &value), HW_OK);
    return value;
}

// The outline of a sphere is a circle from everywhere: its length is 2 pi r, and a sphere of radius
// r + d deviates by d. Down to a hundredth of a pixel.
static void test_outline_of_scaled_spheres(void **state)
{
    (void)state;
    hw_mesh sphere = shape_sphere(hw_v3(7, -4, 2), 3, 512, 256);
    hw_outline *outline = NULL;
    assert_int_equal(hw_outline_create(&outline, &sphere, 8, 1024), HW_OK);
    assert_float_equal(hw_outline_length(outline) / (2 * HW_PI * 3), 1, 0.01);
    float pixel = hw_outline_pixel(outline);
    assert_float_equal(pixel, 6 / (1024 * 0.875), 1e-5);
    assert_float_equal(outline_of(outline, &sphere), 0, 0);
    const float shifts_px[] = {20, 5, 1, 0.3f, -0.3f, -2, 0.05f};
    for (size_t i = 0; i < sizeof shifts_px / sizeof *shifts_px; i++) {
        float shift = shifts_px[i] * pixel;
        hw_mesh level = shape_sphere(hw_v3(7, -4, 2), 3 + shift, 512, 256);
        float tolerance = i == 6 ? 0.2f : 0.03f;
        assert_float_equal(outline_of(outline, &level) / fabsf(shift), 1, tolerance);
        hw_mesh_free(&level);
    }
    hw_outline_destroy(outline);
    hw_mesh_free(&sphere);
}

// A box seen from all around and its copy raised by d: the top and bottom edges move.
static void test_outline_of_raised_box(void **state)
{
    (void)state;
    hw_mesh box = shape_box((hw_box){{-1, -1, 0}, {1, 1, 4}}, false);
    hw_mesh raised = shape_box((hw_box){{-1, -1, 0.05f}, {1, 1, 4.05f}}, false);
    hw_outline *outline = NULL;
    assert_int_equal(hw_outline_create(&outline, &box, 16, 512), HW_OK);
    // Width of the unit square's shadow averaged over directions: 4/pi per unit side (Cauchy).
    double width = 2 * 4 / HW_PI, length = 2 * width + 2 * 4;
    assert_float_equal(hw_outline_length(outline) / length, 1, 0.07);
    assert_float_equal(outline_of(outline, &raised) * hw_outline_length(outline), 2 * width * 0.05,
                       2 * width * 0.05 * 0.05);
    hw_outline_destroy(outline);
    hw_mesh_free(&box);
    hw_mesh_free(&raised);
}

// Filling is watertight: shared edges leave no hole, however fine the triangles are.
static void test_outline_without_holes(void **state)
{
    (void)state;
    hw_mesh coarse = shape_plane(hw_v3(0, 1, 0), hw_v3(5, 0, 0), hw_v3(0, 0, 5), 1, 1);
    hw_mesh fine = shape_plane(hw_v3(0, 1, 0), hw_v3(5, 0, 0), hw_v3(0, 0, 5), 700, 500);
    for (uint32_t j = 1; j < 500; j++) // shaken, the border left alone
        for (uint32_t i = 1; i < 700; i++) {
            hw_vec3 *p = &fine.positions[j * 701 + i];
            p->x += 0.002f * sinf((float)(i * 7 + j * 13));
            p->z += 0.003f * cosf((float)(i * 11 + j * 5));
        }
    hw_outline *outline = NULL;
    assert_int_equal(hw_outline_create(&outline, &coarse, 5, 1024), HW_OK);
    // Rounding of border vertices may flip a pixel centre that lies on the border.
    double area = outline_of(outline, &fine) * hw_outline_length(outline);
    float pixel = hw_outline_pixel(outline);
    assert_true(area / (pixel * pixel) < 3);
    hw_outline_destroy(outline);
    hw_mesh_free(&coarse);
    hw_mesh_free(&fine);
}

// A small plate far from the origin, as scenes have them that keep the coordinates of a map.
static void test_outline_far_away(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        hw_vec3 at = i ? hw_v3(1e6f, 1e6f, 0) : hw_v3(0, 0, 0);
        hw_mesh plate = shape_plane(at, hw_v3(0.0625f, 0, 0), hw_v3(0, 0.0625f, 0), 1, 1);
        hw_outline *outline = NULL;
        float value;
        assert_int_equal(hw_outline_create(&outline, &plate, 0, 0), HW_OK);
        assert_int_equal(hw_outline_deviation(outline, &plate, &value), HW_OK);
        assert_true(value == 0);
        hw_outline_destroy(outline);
        hw_mesh_free(&plate);
    }
}

static void test_outline_bounds_and_errors(void **state)
{
    (void)state;
    hw_mesh box = shape_box((hw_box){{0, 0, 0}, {1, 1, 1}}, false), empty = {0};
    hw_mesh huge = shape_box((hw_box){{-1e6f, -1e6f, -1e6f}, {1e6f, 1e6f, 1e6f}}, false);
    hw_outline *outline = NULL;
    float value;
    assert_int_equal(hw_outline_create(&outline, &empty, 0, 0), HW_USAGE);
    assert_int_equal(hw_outline_create(&outline, &box, 0, 100000), HW_USAGE);
    assert_null(outline);
    for (uint64_t n = 1;; n++) {
        hw_alloc_fail_after(n);
        hw_status status = hw_outline_create(&outline, &box, 3, 100);
        hw_alloc_fail_after(0);
        if (status == HW_OK)
            break;
        assert_int_equal(status, HW_MEMORY);
    }
    hw_alloc_fail_after(2);
    assert_int_equal(hw_outline_deviation(outline, &box, &value), HW_MEMORY);
    hw_alloc_fail_after(0);
    assert_true(outline_of(outline, &huge) > 0); // clipped to the raster
    huge.positions[3].x = NAN;
    huge.positions[4].z = INFINITY;
    assert_int_equal(hw_outline_deviation(outline, &huge, &value), HW_OK);
    assert_true(outline_of(outline, &empty) > 0.1f); // all of it is missing
    hw_outline_destroy(outline);
    hw_outline_destroy(NULL);
    hw_mesh_free(&box);
    hw_mesh_free(&huge);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_shifted_plane),
        cmocka_unit_test(test_both_sides_count),
        cmocka_unit_test(test_area_weighting),
        cmocka_unit_test(test_surface_of_spheres_and_seeds),
        cmocka_unit_test(test_shading),
        cmocka_unit_test(test_outline_of_scaled_spheres),
        cmocka_unit_test(test_outline_of_raised_box),
        cmocka_unit_test(test_outline_without_holes),
        cmocka_unit_test(test_outline_far_away),
        cmocka_unit_test(test_outline_bounds_and_errors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
