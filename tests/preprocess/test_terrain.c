// Height fields as triangles, and the polygon that they are made over.
#include "alloc.h"
#include "outer_hull.h"
#include "rng.h"
#include "shapes.h"
#include "terrain.h"

#define WIDTH  48u
#define HEIGHT 32u
#define COUNT  (WIDTH * HEIGHT)

static const double rectangle[4][2] = {{0, 0}, {WIDTH, 0}, {WIDTH, HEIGHT}, {0, HEIGHT}};
static float heights[COUNT], tolerances[COUNT];
static const hw_height_field field = {WIDTH, HEIGHT, heights, tolerances};

static double turn(const double *a, const double *b, const double *c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

// A ball's upper half over a plain.
static double dome(double x, double y)
{
    double squared = 200 - (x - 20) * (x - 20) - (y - 15) * (y - 15);
    return 10 + (squared > 0 ? sqrt(squared) : 0);
}

static void fill(double (*height)(double x, double y), float tolerance)
{
    for (uint32_t i = 0; i < COUNT; i++) {
        heights[i] = (float)height(i % WIDTH + 0.5, i / WIDTH + 0.5);
        tolerances[i] = tolerance;
    }
}

// How many triangles hold a sample, and by how much the last of them misses it.
static uint32_t meet(const hw_terrain *t, uint32_t sample, double *error)
{
    const double p[2] = {sample % WIDTH + 0.5, sample / WIDTH + 0.5};
    uint32_t count = 0;
    for (uint32_t i = 0; i < t->triangle_count; i++) {
        double height = 0, area = 0;
        bool inside = true;
        for (int k = 0; k < 3; k++) {
            double w = turn(t->vertices[t->triangles[i][(k + 1) % 3]],
                            t->vertices[t->triangles[i][(k + 2) % 3]], p);
            inside = inside && w >= -1e-9;
            height += w * t->vertices[t->triangles[i][k]][2];
            area += w;
        }
        assert_true(area > 0); // counter-clockwise
        if (!inside)
            continue;
        count++;
        *error = fabs(height / area - (double)heights[sample]);
    }
    return count;
}

static double slope(double x, double y)
{
    return 3 + 0.25 * x - 0.5 * y;
}

static void a_plane_takes_two_triangles(void **state)
{
    (void)state;
    hw_terrain t;
    fill(slope, 1);
    assert_int_equal(hw_terrain_fit(&field, rectangle, 4, 40, &t), HW_OK);
    assert_int_equal(t.vertex_count, 4);
    assert_int_equal(t.triangle_count, 2);
    for (uint32_t v = 0; v < 4; v++) // no higher nor lower than the samples
        assert_float_equal(t.vertices[v][2], slope(t.vertices[v][0], t.vertices[v][1]), 0.4);
    assert_true(t.mean_error < 0.2);
    hw_terrain_free(&t);
}

// More vertices come closer, and each sample has its triangle.
static void a_dome_is_met_the_closer_the_more_vertices(void **state)
{
    (void)state;
    double before = INFINITY;
    for (uint32_t vertices = 16; vertices <= 64; vertices *= 2) {
        hw_terrain t;
        double sum = 0, area = 0;
        fill(dome, 0.25f);
        assert_int_equal(hw_terrain_fit(&field, rectangle, 4, vertices, &t), HW_OK);
        assert_true(t.vertex_count <= vertices);
        assert_int_equal(t.triangle_count, 2 * t.vertex_count - 6); // Euler, four on the rim
        for (uint32_t i = 0; i < t.triangle_count; i++)
            area += turn(t.vertices[t.triangles[i][0]], t.vertices[t.triangles[i][1]],
                         t.vertices[t.triangles[i][2]]) /
                    2;
        assert_float_equal(area, COUNT, 1e-6);
        for (uint32_t i = 0; i < COUNT; i++) {
            double error = 0;
            assert_in_range(meet(&t, i, &error), 1, 16);
            sum += fmin(error / 0.25, HW_TERRAIN_ERROR_MAX);
        }
        assert_float_equal(sum / COUNT, t.mean_error, 0.15); // twice on sides
        assert_true(t.mean_error < before);
        before = t.mean_error;
        hw_terrain_free(&t);
    }
    assert_true(before < 1);
}

static double middle_only(double x, double y)
{
    return x > 20 && x < 28 && y > 12 && y < 20 ? dome(x, y) : (double)NAN;
}

// What nothing is to be met in goes, but not what is next to a sample.
static void triangles_of_nothing_are_left_out(void **state)
{
    (void)state;
    hw_terrain t;
    fill(middle_only, 0.05f);
    assert_int_equal(hw_terrain_fit(&field, rectangle, 4, 40, &t), HW_OK);
    uint32_t samples = 0;
    double area = 0, error;
    for (uint32_t i = 0; i < COUNT; i++)
        if (!isnan(heights[i])) {
            samples++;
            assert_true(meet(&t, i, &error) > 0);
        }
    for (uint32_t i = 0; i < t.triangle_count; i++)
        area += turn(t.vertices[t.triangles[i][0]], t.vertices[t.triangles[i][1]],
                     t.vertices[t.triangles[i][2]]) /
                2;
    assert_int_equal(samples, 64);
    assert_true(area <= COUNT);
    hw_terrain_free(&t);

    fill(middle_only, 0.05f);
    for (uint32_t i = 0; i < COUNT; i++)
        heights[i] = NAN;
    assert_int_equal(hw_terrain_fit(&field, rectangle, 4, 40, &t), HW_OK);
    assert_int_equal(t.triangle_count, 0);
    hw_terrain_free(&t);
}

static void memory_may_end_anywhere(void **state)
{
    (void)state;
    hw_terrain t;
    fill(dome, 0.25f);
    uint64_t n = 1;
    for (;; n++) {
        hw_alloc_fail_after(n);
        hw_status status = hw_terrain_fit(&field, rectangle, 4, 20, &t);
        hw_alloc_fail_after(0);
        if (status == HW_OK)
            break;
        assert_int_equal(status, HW_MEMORY);
        assert_null(t.vertices);
        assert_null(t.triangles);
    }
    assert_true(n > 4);
    hw_terrain_free(&t);
}

static void check_hull(const bool *mask, const double (*hull)[2], uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        const double *a = hull[i], *b = hull[(i + 1) % count];
        assert_true(a[0] >= 0 && a[1] >= 0 && a[0] <= WIDTH && a[1] <= HEIGHT);
        assert_true(turn(a, b, hull[(i + 2) % count]) > 0);
        for (uint32_t pixel = 0; pixel < COUNT; pixel++)
            for (uint32_t corner = 0; mask[pixel] && corner < 4; corner++) {
                const double p[2] = {pixel % WIDTH + corner % 2, pixel / WIDTH + corner / 2};
                assert_true(turn(a, b, p) >= -1e-6);
            }
    }
}

// Discs of all sizes, alone and in pairs, some cut by the border, and single pixels.
static void hulls_hold_all_pixels_with_few_corners(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(5, 5);
    for (int round = 0; round < 300; round++) {
        static bool mask[COUNT];
        double discs[2][3];
        for (int d = 0; d < 2; d++) {
            discs[d][0] = (double)WIDTH * (double)hw_rng_float(&rng);
            discs[d][1] = (double)HEIGHT * (double)hw_rng_float(&rng);
            discs[d][2] = round % 3 == 2 && d == 1 ? 0 : 12 * (double)hw_rng_float(&rng);
        }
        uint32_t set = 0;
        for (uint32_t i = 0; i < COUNT; i++) {
            mask[i] = false;
            for (int d = 0; d < 2; d++)
                mask[i] |= hypot(i % WIDTH + 0.5 - discs[d][0], i / WIDTH + 0.5 - discs[d][1]) <
                           discs[d][2];
            set += mask[i];
        }
        double(*hull)[2];
        uint32_t count;
        assert_int_equal(hw_outer_hull(mask, WIDTH, HEIGHT, &hull, &count), HW_OK);
        assert_int_equal(count == 0, set == 0);
        if (set > 0) {
            assert_in_range(count, 3, 24);
            check_hull(mask, (const double(*)[2])hull, count);
        }
        hw_free(hull);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_plane_takes_two_triangles),
        cmocka_unit_test(a_dome_is_met_the_closer_the_more_vertices),
        cmocka_unit_test(triangles_of_nothing_are_left_out),
        cmocka_unit_test(memory_may_end_anywhere),
        cmocka_unit_test(hulls_hold_all_pixels_with_few_corners),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
