#include "shapes.h"

#include "surface_distance.h"

static hw_surface_distance distance(const hw_mesh *from, const hw_mesh *to, hw_distance_options o)
{
    hw_rays *a = NULL, *b = NULL;
    hw_surface_distance d;
    assert_int_equal(hw_rays_create_mesh(&a, from), HW_OK);
    assert_int_equal(hw_rays_create_mesh(&b, to), HW_OK);
    assert_int_equal(hw_surface_distance_measure(a, b, &o, &d), HW_OK);
    hw_rays_destroy(a);
    hw_rays_destroy(b);
    return d;
}

static void test_parallel_planes(void **state)
{
    (void)state;
    hw_mesh a = shape_plane(hw_v3(0, 0, 0), hw_v3(4, 0, 0), hw_v3(0, 3, 0), 9, 5);
    hw_mesh b = shape_plane(hw_v3(0, 0, 0.25f), hw_v3(4, 0, 0), hw_v3(0, 3, 0), 2, 3);
    for (int k = 0; k < 2; k++) {
        hw_surface_distance d = distance(k ? &b : &a, k ? &a : &b, (hw_distance_options){0});
        assert_float_equal(d.max, 0.25, d.floor);
        assert_float_equal(d.mean, 0.25, d.floor);
        assert_float_equal(d.rms, 0.25, d.floor);
        assert_true(d.standard_error <= d.floor && d.converged);
        assert_true(d.floor < 1e-5);
    }
    hw_mesh_free(&a);
    hw_mesh_free(&b);
}

// A point at angle t from the shift s lies |sqrt(1 - 2 s cos t + s^2) - 1| = s |cos t| + O(s^2)
// from the other unit sphere; |cos t| is 1/2 on average over the sphere, its square 1/3, and the
// term of s^2 is of opposite signs in both halves.
static void test_shifted_sphere(void **state)
{
    (void)state;
    const float s = 0.05f;
    hw_mesh a = shape_sphere(hw_v3(0, 0, 0), 1, 256, 128);
    hw_mesh b = shape_sphere(hw_v3(0, 0, s), 1, 256, 128);
    hw_surface_distance d = distance(&a, &b, (hw_distance_options){.tolerance = 0.002});
    assert_true(d.converged && d.samples >= 16 * 1024);
    assert_float_equal(d.mean / (double)s, 0.5, 0.005);
    assert_float_equal(d.rms / (double)s, sqrt(1.0 / 3), 0.005);
    assert_float_equal(d.max, s, 1e-4);
    hw_mesh_free(&a);
    hw_mesh_free(&b);
}

// A roof that rises from 0 to 1 over a floor: heights are spread evenly.
static hw_mesh roof(void)
{
    return shape_plane(hw_v3(0, 0, 0), hw_v3(1, 0, 1), hw_v3(0, 1, 0), 7, 5);
}

static hw_mesh floor_below(void)
{
    return shape_plane(hw_v3(-1, -1, 0), hw_v3(3, 0, 0), hw_v3(0, 3, 0), 1, 1);
}

static void test_slanted_roof(void **state)
{
    (void)state;
    hw_mesh a = roof(), b = floor_below();
    hw_surface_distance d = distance(&a, &b, (hw_distance_options){.tolerance = 0.0005});
    assert_true(d.converged && d.standard_error <= 0.0005 * d.mean && d.standard_error > 0);
    assert_float_equal(d.mean, 0.5, 5 * d.standard_error);
    assert_float_equal(d.rms, sqrt(1.0 / 3), 0.001);
    assert_float_equal(d.max, 1, 1e-6); // at vertices
    hw_mesh_free(&a);
    hw_mesh_free(&b);
}

// Over many seeds the mean misses the truth by about its standard error: squared and in its units
// by 15/13 on average (Student's t of 15 degrees).
static void test_standard_error_is_honest(void **state)
{
    (void)state;
    hw_mesh a = roof(), b = floor_below();
    double sum = 0;
    const int seeds = 200;
    for (int seed = 0; seed < seeds; seed++) {
        hw_surface_distance d = distance(
            &a, &b,
            (hw_distance_options){.tolerance = 1e-9, .samples_max = 800, .seed = (uint64_t)seed});
        assert_int_equal(d.samples, 800);
        assert_false(d.converged);
        double miss = (d.mean - 0.5) / d.standard_error;
        sum += miss * miss;
    }
    assert_float_equal(sum / seeds, 15.0 / 13, 0.45); // its own standard error is about 0.13
    hw_mesh_free(&a);
    hw_mesh_free(&b);
}

static void test_rounds_and_cap(void **state)
{
    (void)state;
    hw_mesh a = roof(), b = floor_below();
    hw_distance_options o = {.tolerance = 1e-9, .samples_max = 100};
    hw_surface_distance d = distance(&a, &b, o);
    assert_int_equal(d.samples, 112); // a multiple of 16
    o.samples_max = 16 * 1024 * 3;    // the last round is cut short
    d = distance(&a, &b, o);
    assert_int_equal(d.samples, o.samples_max);
    assert_false(d.converged);
    o.tolerance = 1;
    d = distance(&a, &b, o);
    assert_int_equal(d.samples, 16 * 1024);
    assert_true(d.converged);
    hw_mesh_free(&a);
    hw_mesh_free(&b);
}

static void test_vertices_count_for_max_alone(void **state)
{
    (void)state;
    hw_mesh a = shape_plane(hw_v3(0, 0, 0), hw_v3(2, 0, 0), hw_v3(0, 2, 0), 2, 2);
    hw_mesh b = floor_below();
    a.positions[4].z = 0.5f;          // the tip of a pyramid
    hw_mesh lone = shape_alloc(1, 0); // a vertex of no triangle
    lone.positions[0] = hw_v3(0, 0, 7);
    shape_append(&a, &lone);
    hw_surface_distance d = distance(&a, &b, (hw_distance_options){.samples_max = 16});
    assert_float_equal(d.max, 0.5, 1e-6);
    assert_true(d.mean < 0.4);
    hw_rays *rays = NULL;
    assert_int_equal(hw_rays_create_mesh(&rays, &b), HW_OK);
    float distances[10];
    assert_int_equal(a.vertex_count, 10);
    assert_int_equal(hw_vertex_distances(&a, rays, 2, distances), HW_OK);
    for (int i = 0; i < 10; i++)
        assert_float_equal(distances[i], i == 4 ? 0.5 : i == 9 ? 7 : 0, 1e-6);
    hw_rays_destroy(rays);
    hw_mesh_free(&a);
    hw_mesh_free(&b);
}

static void test_threads_and_seeds(void **state)
{
    (void)state;
    hw_mesh a = shape_sphere(hw_v3(0, 0, 0), 1, 24, 12);
    hw_mesh b = shape_sphere(hw_v3(0.1f, 0, 0), 1.2f, 100, 70);
    hw_distance_options o = {.threads = 1};
    hw_surface_distance one, other;
    memset(&one, 0, sizeof one);
    one = distance(&a, &b, o);
    for (o.threads = 2; o.threads < 6; o.threads += 3) {
        other = distance(&a, &b, o);
        assert_true(one.mean == other.mean && one.rms == other.rms && one.max == other.max);
        assert_true(one.standard_error == other.standard_error && one.samples == other.samples);
    }
    o.seed = 1;
    other = distance(&a, &b, o);
    assert_true(one.mean != other.mean);
    assert_float_equal(one.mean, other.mean, 6 * (one.standard_error + other.standard_error));
    hw_mesh_free(&a);
    hw_mesh_free(&b);
}

static void test_nothing_to_measure(void **state)
{
    (void)state;
    hw_mesh a = roof(), empty = shape_alloc(1, 0), flat = roof();
    for (uint32_t i = 0; i < flat.vertex_count; i++)
        flat.positions[i] = hw_v3(flat.positions[i].x, 0, 0);
    hw_rays *full = NULL, *none = NULL, *line = NULL;
    hw_surface_distance d;
    assert_int_equal(hw_rays_create_mesh(&full, &a), HW_OK);
    assert_int_equal(hw_rays_create_mesh(&none, &empty), HW_OK);
    assert_int_equal(hw_rays_create_mesh(&line, &flat), HW_OK);
    assert_int_equal(hw_surface_distance_measure(none, full, NULL, &d), HW_USAGE);
    assert_int_equal(hw_surface_distance_measure(full, none, NULL, &d), HW_USAGE);
    assert_int_equal(hw_surface_distance_measure(line, full, NULL, &d), HW_USAGE);
    assert_int_equal(hw_surface_distance_measure(full, line, NULL, &d), HW_OK);
    hw_rays_destroy(full);
    hw_rays_destroy(none);
    hw_rays_destroy(line);
    hw_mesh_free(&a);
    hw_mesh_free(&empty);
    hw_mesh_free(&flat);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_parallel_planes),
        cmocka_unit_test(test_shifted_sphere),
        cmocka_unit_test(test_slanted_roof),
        cmocka_unit_test(test_standard_error_is_honest),
        cmocka_unit_test(test_rounds_and_cap),
        cmocka_unit_test(test_vertices_count_for_max_alone),
        cmocka_unit_test(test_threads_and_seeds),
        cmocka_unit_test(test_nothing_to_measure),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
