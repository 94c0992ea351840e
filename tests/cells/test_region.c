// clang-format off
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
// clang-format on
#include "region.h"
#include "rng.h"
#include <math.h>

static float uniform(hw_rng *rng, float low, float high)
{
    return low + (high - low) * hw_rng_float(rng);
}

static hw_vec3 random_point(hw_rng *rng, float extent)
{
    float x = uniform(rng, -extent, extent), y = uniform(rng, -extent, extent);
    return hw_v3(x, y, uniform(rng, -extent, extent));
}

// A point of the prism: a convex combination of its corners; sometimes a corner itself, or a point
// of an edge.
static void random_in_prism(hw_rng *rng, const hw_vec3 corners[HW_CELL_CORNERS], double out[3])
{
    double weights[HW_CELL_CORNERS], sum = 0;
    uint32_t few = hw_rng_below(rng, 4) == 0 ? 1 + hw_rng_below(rng, 2) : HW_CELL_CORNERS;
    for (uint32_t i = 0; i < HW_CELL_CORNERS; i++) {
        weights[i] = i < few ? (double)uniform(rng, 0.0001f, 1) : 0;
        sum += weights[i];
    }
    uint32_t shift = hw_rng_below(rng, HW_CELL_CORNERS);
    out[0] = out[1] = out[2] = 0;
    for (uint32_t i = 0; i < HW_CELL_CORNERS; i++) {
        hw_vec3 c = corners[(i + shift) % HW_CELL_CORNERS];
        out[0] += weights[i] / sum * (double)c.x;
        out[1] += weights[i] / sum * (double)c.y;
        out[2] += weights[i] / sum * (double)c.z;
    }
}

// Which side of the triangle's plane a point is on: > 0 in front.
static double side(hw_vec3 a, hw_vec3 b, hw_vec3 c, const double p[3])
{
    double u[3] = {(double)b.x - (double)a.x, (double)b.y - (double)a.y, (double)b.z - (double)a.z};
    double v[3] = {(double)c.x - (double)a.x, (double)c.y - (double)a.y, (double)c.z - (double)a.z};
    double w[3] = {p[0] - (double)a.x, p[1] - (double)a.y, p[2] - (double)a.z};
    return (u[1] * v[2] - u[2] * v[1]) * w[0] + (u[2] * v[0] - u[0] * v[2]) * w[1] +
           (u[0] * v[1] - u[1] * v[0]) * w[2];
}

static void check_seen_from_both_sides(hw_vec3 a, hw_vec3 b, hw_vec3 c,
                                       const hw_vec3 corners[HW_CELL_CORNERS])
{
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < HW_CELL_CORNERS; i++) {
        const double p[3] = {(double)corners[i].x, (double)corners[i].y, (double)corners[i].z};
        low = fmin(low, side(a, b, c, p));
        high = fmax(high, side(a, b, c, p));
    }
    assert_true(low < 1e-9 && high > -1e-9);
}

// Regional back-face culling (thesis 5.2.1). Proof: let f(p) = n . (p - a) be the signed distance,
// times |n|, to the plane of a triangle with normal n. f is affine, so for p = sum w_i c_i with
// w_i >= 0 and sum w_i = 1 (every point of the convex hull of the corners c_i) f(p) = sum w_i
// f(c_i). If f(c_i) < 0 for all corners, f(p) < 0: the triangle shows its back to p. The same with
// > 0 for its front. Conversely f takes its extremes over the hull at corners, so a triangle with
// corners on both sides is seen from both sides: the test loses nothing. Below, what the test says
// is tried on random points, and where it says "mixed" there must be corners on both sides.
static void test_facing_holds_for_the_whole_cell(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(77, 1);
    uint32_t counts[3] = {0};
    for (int t = 0; t < 3000; t++) {
        hw_hexgrid grid = {(double)uniform(&rng, -50, 50),
                           (double)uniform(&rng, -50, 50),
                           (double)uniform(&rng, 1, 40),
                           0,
                           (double)uniform(&rng, 0, 30),
                           9,
                           9,
                           1};
        hw_cell_id id = {0, (int32_t)hw_rng_below(&rng, 5), (int32_t)hw_rng_below(&rng, 5)};
        hw_vec3 corners[HW_CELL_CORNERS], a = random_point(&rng, 200), b, c;
        b = hw_v3_add(a, random_point(&rng, 10));
        c = hw_v3_add(a, random_point(&rng, 10));
        hw_cell_corners(&grid, id, corners);
        hw_facing facing = hw_triangle_facing(a, b, c, corners, HW_CELL_CORNERS);
        counts[facing]++;
        double low = INFINITY, high = -INFINITY;
        for (int i = 0; i < 1000; i++) {
            double p[3];
            random_in_prism(&rng, corners, p);
            double s = side(a, b, c, p);
            low = fmin(low, s);
            high = fmax(high, s);
        }
        if (facing == HW_FACING_BACK)
            assert_true(high < 0);
        else if (facing == HW_FACING_FRONT)
            assert_true(low > 0);
        else
            check_seen_from_both_sides(a, b, c, corners);
        // The mirrored triangle faces the other way.
        hw_facing mirrored = hw_triangle_facing(a, c, b, corners, HW_CELL_CORNERS);
        assert_int_equal(mirrored, HW_FACING_FRONT - facing);
    }
    assert_true(counts[0] > 300 && counts[1] > 300 && counts[2] > 300);
}

static void test_facing_of_edge_cases(void **state)
{
    (void)state;
    const hw_vec3 corners[3] = {{0, 0, 1}, {1, 0, 2}, {0, 1, 3}};
    hw_vec3 a = {0, 0, 0}, b = {1, 0, 0}, c = {0, 1, 0};
    assert_int_equal(hw_triangle_facing(a, b, c, corners, 3), HW_FACING_FRONT);
    assert_int_equal(hw_triangle_facing(a, c, b, corners, 3), HW_FACING_BACK);
    // One corner in the plane; a point; a line; a line that rounding bends.
    const hw_vec3 touching[2] = {{0, 0, 1}, {5, 7, 0}};
    assert_int_equal(hw_triangle_facing(a, b, c, touching, 2), HW_FACING_MIXED);
    assert_int_equal(hw_triangle_facing(a, a, a, corners, 3), HW_FACING_MIXED);
    assert_int_equal(hw_triangle_facing(a, b, hw_v3(2, 0, 0), corners, 3), HW_FACING_MIXED);
    hw_vec3 d = {0.1f, 0.2f, 0.3f};
    assert_int_equal(hw_triangle_facing(a, d, hw_v3_scale(d, 2), corners, 3), HW_FACING_MIXED);
    hw_vec3 nan = {NAN, 0, 0};
    assert_int_equal(hw_triangle_facing(nan, b, c, corners, 3), HW_FACING_MIXED);
}

static double clamp(double v, double low, double high)
{
    return fmin(fmax(v, low), high);
}

static void project_to_box(hw_box box, const double p[3], double out[3])
{
    out[0] = clamp(p[0], (double)box.min.x, (double)box.max.x);
    out[1] = clamp(p[1], (double)box.min.y, (double)box.max.y);
    out[2] = clamp(p[2], (double)box.min.z, (double)box.max.z);
}

// Nearest point of the prism: inside, or on the nearest of the hexagon's sides.
static void project_to_prism(const hw_hexgrid *grid, const double centre[2], const double p[3],
                             double out[3])
{
    double best = INFINITY, c = grid->cell_size;
    bool inside = true;
    out[2] = clamp(p[2], grid->z_min, grid->z_max);
    double x = p[0] - centre[0], y = p[1] - centre[1];
    for (int i = 0; i < 6; i++) {
        double a = i * HW_PI / 3, b = a + HW_PI / 3;
        double ax = c * cos(a), ay = c * sin(a), ux = c * cos(b) - ax, uy = c * sin(b) - ay;
        inside = inside && ux * (y - ay) - uy * (x - ax) >= 0;
        double t = clamp(((x - ax) * ux + (y - ay) * uy) / (c * c), 0, 1);
        double d = hypot(x - ax - t * ux, y - ay - t * uy);
        if (d >= best)
            continue;
        best = d;
        out[0] = centre[0] + ax + t * ux;
        out[1] = centre[1] + ay + t * uy;
    }
    if (inside) {
        out[0] = p[0];
        out[1] = p[1];
    }
}

static double distance(const double a[3], const double b[3])
{
    return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

// Least distance of two convex sets by alternating projections (Cheney and Goldstein 1959).
static double alternate(const hw_hexgrid *grid, const double centre[2], hw_box box)
{
    double p[3] = {centre[0], centre[1], grid->z_min}, q[3] = {0};
    for (int i = 0; i < 3000; i++) {
        project_to_box(box, p, q);
        project_to_prism(grid, centre, q, p);
    }
    return distance(p, q);
}

static void test_distances(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(13, 7);
    for (int t = 0; t < 400; t++) {
        hw_hexgrid grid = {0, 0, (double)uniform(&rng, 2, 30), -1, (double)uniform(&rng, 0, 20), 9,
                           9, 2};
        hw_cell_id id = {(int32_t)hw_rng_below(&rng, 2), 0, 0};
        const double centre[3] = {0, 0, 0.5 * (grid.z_min + grid.z_max)};
        hw_hexgrid scaled = grid;
        scaled.cell_size = hw_cell_side(&grid, id.level);
        hw_vec3 low = random_point(&rng, 80);
        hw_vec3 size = hw_v3(uniform(&rng, 0, 40), uniform(&rng, 0, 40), uniform(&rng, 0, 40));
        hw_box box = {low, hw_v3_add(low, size)};
        hw_region_distance d = hw_region_distance_to(&grid, id, box);
        double q[3];

        assert_true(fabs(d.nearest - alternate(&scaled, centre, box)) < 1e-3 * (1 + d.nearest));
        assert_int_equal(hw_cell_meets_box(&grid, id, box), d.nearest == 0);
        project_to_box(box, centre, q);
        assert_true(fabs(d.centre - distance(centre, q)) < 1e-9 * (1 + d.centre));
        assert_true(d.effective >= d.nearest && d.nearest <= d.centre && d.centre <= d.farthest);

        hw_vec3 corners[HW_CELL_CORNERS];
        hw_cell_corners(&grid, id, corners);
        double reached = 0;
        for (int i = 0; i < 2000; i++) {
            double p[3];
            random_in_prism(&rng, corners, p);
            project_to_box(box, p, q);
            double e = distance(p, q);
            assert_true(e >= d.nearest - 1e-4 && e <= d.farthest + 1e-4);
            reached = fmax(reached, e);
        }
        assert_true(reached > 0.9 * d.farthest || d.farthest < 1);
    }
}

static void test_distances_by_hand(void **state)
{
    (void)state;
    hw_hexgrid grid = {0, 0, 10, 0, 4, 1, 1, 1};
    hw_cell_id id = {0, 0, 0};
    // East: corner 0 at (10, 0). 3 beside and 4 above: 5.
    hw_region_distance d = hw_region_distance_to(&grid, id, (hw_box){{13, -1, 8}, {20, 1, 9}});
    assert_true(fabs(d.nearest - 5) < 1e-6);
    assert_true(fabs(d.centre - hypot(13, 6)) < 1e-6);
    // Over the middle of face 0 (30 degrees): the box's corner is nearest to a side, not to a
    // corner.
    float k = 20 * 0.8660254f;
    d = hw_region_distance_to(&grid, id, (hw_box){{k, 10, 0}, {k + 5, 15, 4}});
    assert_true(fabs(d.nearest - (20 - 10 * sqrt(3) / 2)) < 1e-5);
    // Inside.
    d = hw_region_distance_to(&grid, id, (hw_box){{-1, -1, 1}, {1, 1, 2}});
    assert_true(d.nearest == 0 && d.centre == 0);
    assert_true(hw_cell_meets_box(&grid, id, (hw_box){{10, 0, 4}, {12, 1, 5}}));
    // Beside the slanted side, where the boxes of both meet but they do not.
    assert_false(hw_cell_meets_box(&grid, id, (hw_box){{9, 8, 0}, {12, 9, 5}}));
}

// The mean of 1 / max(d, nearest)^2 over the hexagon, by many random points.
static double sampled_effective(const hw_hexgrid *grid, hw_box box, double nearest, hw_rng *rng)
{
    double sum = 0, half = 0.5 * (grid->z_min + grid->z_max), c = grid->cell_size;
    hw_vec3 m = hw_box_centre(box);
    const double target[3] = {(double)m.x, (double)m.y, (double)m.z};
    int count = 0;
    while (count < 100000) {
        double p[3] = {(double)uniform(rng, -1, 1) * c, (double)uniform(rng, -1, 1) * c, half};
        // Inside a flat-top hexagon of side c.
        if (fabs(p[1]) > c * sqrt(3) / 2 || fabs(p[0]) * sqrt(3) + fabs(p[1]) > c * sqrt(3))
            continue;
        double d = fmax(distance(p, target), nearest);
        sum += 1 / (d * d);
        count++;
    }
    return sqrt(count / sum);
}

static void test_effective_distance(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(21, 3);
    hw_hexgrid grid = {0, 0, 10, 0, 6, 1, 1, 1};
    for (int t = 0; t < 40; t++) {
        float angle = uniform(&rng, 0, 6.28f), far = uniform(&rng, 12, 60);
        hw_vec3 at = hw_v3(far * cosf(angle), far * sinf(angle), uniform(&rng, 0, 20));
        hw_box box = {hw_v3_sub(at, hw_v3(1, 1, 1)), hw_v3_add(at, hw_v3(1, 1, 1))};
        hw_region_distance d = hw_region_distance_to(&grid, (hw_cell_id){0, 0, 0}, box);
        double sampled = sampled_effective(&grid, box, d.nearest, &rng);
        assert_true(fabs(d.effective / sampled - 1) < 0.02);
    }
    // Far away it is the distance between the centres.
    hw_box box = {{9999, -1, 2}, {10001, 1, 4}};
    hw_region_distance d = hw_region_distance_to(&grid, (hw_cell_id){0, 0, 0}, box);
    assert_true(fabs(d.effective - 10000) < 0.1);
    // A cell within a huge box: whatever it is, it is finite and not negative.
    box = (hw_box){{-50, -50, -3}, {50, 50, 9}};
    d = hw_region_distance_to(&grid, (hw_cell_id){0, 0, 0}, box);
    assert_true(d.effective >= 0 && isfinite(d.effective));
}

static void test_self_occluding_error(void **state)
{
    (void)state;
    // sqrt(3) 50 20 / (2 500 520) 1024 = 1732.0508 1024 / 520000.
    assert_true(fabs(hw_self_occluding_error(50, 500, 20, 1024) - 3.4108077) < 1e-6);
    // sqrt(3) 10 30 / (2 10 40) = 519.6152 / 800.
    assert_true(fabs(hw_self_occluding_error(10, 10, 30, 1) - 0.6495191) < 1e-6);
    assert_true(hw_self_occluding_error(50, 500, 0, 1024) == 0);
    assert_true(isinf(hw_self_occluding_error(50, 0, 20, 1024)));
    assert_true(isinf(hw_self_occluding_error(50, -1, 20, 1024)));
    assert_true(isinf(hw_self_occluding_error(50, NAN, 20, 1024)));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_facing_holds_for_the_whole_cell),
        cmocka_unit_test(test_facing_of_edge_cases),
        cmocka_unit_test(test_distances),
        cmocka_unit_test(test_distances_by_hand),
        cmocka_unit_test(test_effective_distance),
        cmocka_unit_test(test_self_occluding_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
