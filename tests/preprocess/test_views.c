#include "shapes.h"

#include "appearance.h"
#include "views.h"

#define PIXELS (HW_VIEW_SIZE * HW_VIEW_SIZE)

static hw_rays *rays_of(const hw_mesh *mesh)
{
    hw_rays *rays = NULL;
    assert_int_equal(hw_rays_create_mesh(&rays, mesh), HW_OK);
    return rays;
}

static hw_view_errors compare(const hw_mesh *a, const hw_mesh *b, uint32_t threads)
{
    hw_rays *rays_a = rays_of(a), *rays_b = rays_of(b);
    hw_views *views = NULL;
    hw_view_errors errors;
    assert_int_equal(hw_views_create(&views, rays_a, hw_view_frame_fit(a, b), threads), HW_OK);
    assert_int_equal(hw_views_compare(views, rays_b, threads, &errors), HW_OK);
    hw_views_destroy(views);
    hw_rays_destroy(rays_a);
    hw_rays_destroy(rays_b);
    return errors;
}

static uint32_t covered(const hw_views *views, uint32_t view)
{
    uint32_t count = 0;
    for (int i = 0; i < PIXELS; i++)
        count += hw_views_picture(views, view)[i] >= 0;
    return count;
}

static void test_directions_are_even(void **state)
{
    (void)state;
    hw_vec3 d[HW_VIEW_COUNT], sum = {0};
    hw_view_directions(d);
    for (int i = 0; i < HW_VIEW_COUNT; i++) {
        assert_float_equal(hw_v3_length(d[i]), 1, 1e-6);
        sum = hw_v3_add(sum, d[i]);
        float nearest = -1;
        for (int j = 0; j < HW_VIEW_COUNT; j++)
            nearest = j == i ? nearest : fmaxf(nearest, hw_v3_dot(d[i], d[j]));
        // Half an icosahedron's edge, 31.7 degrees, and between midpoints a tenth of a turn.
        double angle = acos((double)nearest) * 180 / HW_PI;
        assert_true(angle > 31.7 && angle < 36.01);
    }
    assert_float_equal(hw_v3_length(sum), 0, 1e-5);
}

// Concentric spheres look alike from everywhere, and their pictures are integrals over a disc:
// I(p) = ambient + directional sqrt(1 - p^2 / R^2).
static void test_concentric_spheres(void **state)
{
    (void)state;
    const double large = 1.1, step = 1e-5;
    hw_mesh a = shape_sphere(hw_v3(3, -2, 1), 1, 512, 256);
    hw_mesh b = shape_sphere(hw_v3(3, -2, 1), (float)large, 512, 256);
    hw_view_errors e = compare(&a, &b, 0);
    double pixel = 2 * large / HW_VIEW_SIZE, absolute = 0, squares = 0;
    for (double p = step / 2; p < large; p += step) {
        double own = HW_LIGHT_AMBIENT + HW_LIGHT_DIRECTIONAL * sqrt(fmax(1 - p * p, 0));
        double other =
            HW_LIGHT_AMBIENT + HW_LIGHT_DIRECTIONAL * sqrt(fmax(1 - p * p / (large * large), 0));
        double difference = p < 1 ? other - own : other;
        absolute += fabs(difference) * 2 * p * step;
        squares += difference * difference * 2 * p * step;
    }
    assert_float_equal(e.model_pixels * pixel * pixel / HW_PI, 1, 0.002);
    assert_float_equal(e.silhouette * pixel * pixel / (HW_PI * (large * large - 1)), 1, 0.01);
    assert_float_equal(e.silhouette_share, e.silhouette / e.model_pixels, 1e-12);
    assert_float_equal(e.l1 / absolute, 1, 0.01);
    assert_float_equal(e.l2 / sqrt(squares), 1, 0.01);
    hw_mesh_free(&a);
    hw_mesh_free(&b);
}

static void test_itself_and_threads(void **state)
{
    (void)state;
    hw_mesh a = shape_sphere(hw_v3(0, 0, 0), 1, 24, 12);
    hw_mesh b = shape_box((hw_box){{-1, -0.9f, -0.8f}, {0.5f, 0.6f, 0.7f}}, false);
    hw_view_errors e = compare(&a, &a, 2);
    assert_true(e.l1 == 0 && e.l2 == 0 && e.silhouette == 0 && e.silhouette_share == 0);
    assert_true(e.model_pixels > 0.7 * PIXELS * HW_PI / 4);
    hw_view_errors one = compare(&a, &b, 1), two = compare(&a, &b, 2);
    assert_memory_equal(&one, &two, sizeof one);
    assert_true(one.l1 > 0.05 && one.l2 > one.l1 && one.silhouette > 1000);
    hw_mesh_free(&a);
    hw_mesh_free(&b);
}

static int pixel_at(float x, float y) // of [-1, 1]^2, y up
{
    int column = (int)((x + 1) / 2 * HW_VIEW_SIZE), row = (int)((1 - y) / 2 * HW_VIEW_SIZE);
    return row * HW_VIEW_SIZE + column;
}

// From -y, x is to the right and z up; from +y, x is to the left. Faces are lit fully.
static void test_orientation(void **state)
{
    (void)state;
    hw_vec3 d[HW_VIEW_COUNT];
    hw_view_directions(d);
    hw_mesh a = shape_plane(hw_v3(0, 0, 0), hw_v3(1, 0, 0), hw_v3(0, 0, 1), 1, 1);
    hw_mesh low = shape_plane(hw_v3(-1, 0, -1), hw_v3(1, 0, 0), hw_v3(0, 0, 1), 1, 1);
    shape_append(&a, &low); // upper right and lower left, facing -y
    hw_rays *rays = rays_of(&a);
    hw_views *views = NULL;
    assert_int_equal(hw_views_create(&views, rays, hw_view_frame_fit(&a, NULL), 0), HW_OK);
    int checked = 0;
    for (uint32_t i = 0; i < HW_VIEW_COUNT; i++) {
        if (fabsf(d[i].y) < 0.999f)
            continue;
        const float *picture = hw_views_picture(views, i);
        float right = d[i].y < 0 ? 1 : -1;
        assert_float_equal(picture[pixel_at(right * 0.3f, 0.4f)], 1, 1e-5);
        assert_float_equal(picture[pixel_at(right * -0.3f, -0.4f)], 1, 1e-5);
        assert_true(picture[pixel_at(right * -0.3f, 0.4f)] < 0);
        assert_true(picture[pixel_at(right * 0.3f, -0.4f)] < 0);
        checked++;
    }
    assert_int_equal(checked, 2);
    hw_views_destroy(views);
    hw_rays_destroy(rays);
    hw_mesh_free(&a);
}

// A sheet covers as much from behind, and nothing edge-on, where only the outline can differ.
static void test_open_sheet(void **state)
{
    (void)state;
    hw_vec3 d[HW_VIEW_COUNT];
    hw_view_directions(d);
    hw_mesh sheet = shape_plane(hw_v3(-1, -1, 0), hw_v3(2, 0, 0), hw_v3(0, 2, 0), 4, 4);
    hw_mesh box = shape_box((hw_box){{-1, -1, -0.2f}, {1, 1, 0.2f}}, false);
    hw_rays *rays = rays_of(&sheet);
    hw_view_frame frame = hw_view_frame_fit(&sheet, &box);
    hw_views *views = NULL;
    assert_int_equal(hw_views_create(&views, rays, frame, 0), HW_OK);
    double pixel = 2 * (double)frame.half_side / HW_VIEW_SIZE;
    for (uint32_t i = 0; i < HW_VIEW_COUNT; i++) {
        double area = 4 * fabs((double)d[i].z) / (pixel * pixel);
        assert_float_equal(covered(views, i), area, 1500); // a pixel along the outline
        if (fabsf(d[i].z) < 1e-6f)
            assert_true(covered(views, i) < 1500);
    }
    hw_views_destroy(views);
    hw_rays_destroy(rays);
    hw_view_errors e = compare(&sheet, &box, 0);
    assert_true(isfinite(e.l1) && isfinite(e.l2) && e.silhouette > 0);
    hw_mesh_free(&sheet);
    hw_mesh_free(&box);
}

static void test_frame(void **state)
{
    (void)state;
    hw_mesh a = shape_box((hw_box){{-1, -1, -1}, {1, 1, 1}}, false), empty = shape_alloc(1, 0);
    hw_mesh b = shape_box((hw_box){{-1.02f, -1, -1}, {1, 1, 1}}, false);
    hw_mesh c = shape_box((hw_box){{-5, -1, -1}, {1, 1, 1}}, false);
    hw_view_frame alone = hw_view_frame_fit(&a, NULL), same = hw_view_frame_fit(&a, &b);
    assert_float_equal(alone.half_side, sqrt(3) * (1 + 1.0 / 32), 1e-5);
    assert_memory_equal(&alone, &same, sizeof alone);
    assert_float_equal(hw_view_frame_fit(&a, &c).half_side, sqrt(27), 1e-5);
    hw_rays *rays_a = rays_of(&a), *rays_c = rays_of(&c), *rays_empty = rays_of(&empty);
    hw_views *views = NULL;
    hw_view_errors e;
    assert_int_equal(hw_views_create(&views, rays_empty, alone, 0), HW_USAGE);
    assert_int_equal(hw_views_create(&views, rays_a, (hw_view_frame){{0, 0, 0}, 0}, 0), HW_USAGE);
    assert_null(views);
    assert_int_equal(hw_views_create(&views, rays_a, alone, 0), HW_OK);
    assert_int_equal(hw_views_compare(views, rays_c, 0, &e), HW_USAGE);
    assert_int_equal(hw_views_compare(views, rays_empty, 0, &e), HW_USAGE);
    hw_views_destroy(views);
    hw_views_destroy(NULL);
    hw_rays_destroy(rays_a);
    hw_rays_destroy(rays_c);
    hw_rays_destroy(rays_empty);
    hw_mesh_free(&a);
    hw_mesh_free(&b);
    hw_mesh_free(&c);
    hw_mesh_free(&empty);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_directions_are_even), cmocka_unit_test(test_concentric_spheres),
        cmocka_unit_test(test_itself_and_threads),  cmocka_unit_test(test_orientation),
        cmocka_unit_test(test_open_sheet),          cmocka_unit_test(test_frame),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
