// clang-format off
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
// clang-format on
#include "hexgrid.h"
#include "rng.h"
#include <math.h>
#include <stdio.h>

static double uniform(hw_rng *rng, double low, double high)
{
    return low + (high - low) * (double)hw_rng_float(rng);
}

// Signed distance beyond the sides of a hexagon: at most 0 inside.
static double outside(const hw_hexgrid *grid, hw_cell_id id, double x, double y)
{
    double cx = grid->origin_x + 1.5 * grid->cell_size * id.q;
    double cy = grid->origin_y + sqrt(3) * grid->cell_size * (id.r + (id.q & 1 ? 0.5 : 0.0));
    double worst = -INFINITY;
    for (int i = 0; i < 6; i++) {
        double angle = (30 + 60 * i) * HW_PI / 180;
        double t = (x - cx) * cos(angle) + (y - cy) * sin(angle) - grid->cell_size * sqrt(3) / 2;
        worst = fmax(worst, t);
    }
    return worst;
}

static double brute_nearest(const hw_hexgrid *grid, double x, double y, double *chosen,
                            hw_cell_id id)
{
    double best = INFINITY;
    *chosen = INFINITY;
    for (int32_t q = 0; q < grid->columns; q++) {
        for (int32_t r = 0; r < grid->rows; r++) {
            double cx = grid->origin_x + 1.5 * grid->cell_size * q;
            double cy = grid->origin_y + sqrt(3) * grid->cell_size * (r + (q & 1 ? 0.5 : 0.0));
            double d = hypot(x - cx, y - cy);
            best = fmin(best, d);
            if (q == id.q && r == id.r)
                *chosen = d;
        }
    }
    return best;
}

static void check_located(const hw_hexgrid *grid, double x, double y)
{
    hw_cell_id id = hw_hexgrid_locate(grid, x, y);
    double chosen, best = brute_nearest(grid, x, y, &chosen, id);
    assert_true(hw_hexgrid_contains(grid, id));
    assert_true(chosen <= best + 1e-9 * (1 + best));
    hw_cell_id again = hw_hexgrid_locate(grid, x, y);
    assert_true(again.q == id.q && again.r == id.r && again.level == 0);
}

static void test_locate_is_nearest_centre(void **state)
{
    (void)state;
    hw_hexgrid grid = hw_hexgrid_cover(-3, 7, 60, 50, 5, 0, 2);
    hw_rng rng = hw_rng_make(1, 1);
    for (int i = 0; i < 100000; i++)
        check_located(&grid, uniform(&rng, -20, 80), uniform(&rng, -10, 70));
    // Far away, and not a number at all.
    for (int i = 0; i < 1000; i++)
        check_located(&grid, uniform(&rng, -1e4, 1e4), uniform(&rng, -1e4, 1e4));
    const double wild[] = {NAN, INFINITY, -INFINITY, 1e300, -1e300};
    for (int i = 0; i < 5; i++)
        for (int k = 0; k < 5; k++)
            assert_true(hw_hexgrid_contains(&grid, hw_hexgrid_locate(&grid, wild[i], wild[k])));
}

static void test_locate_on_borders(void **state)
{
    (void)state;
    hw_hexgrid grid = hw_hexgrid_cover(0, 0, 100, 90, 7, 0, 2);
    hw_rng rng = hw_rng_make(2, 1);
    for (uint32_t i = 0; i < hw_hexgrid_cell_count(&grid); i++) {
        hw_cell_id id = hw_hexgrid_cell(&grid, i);
        hw_vec3 c[HW_CELL_CORNERS], centre = hw_cell_centre(&grid, id);
        hw_cell_corners(&grid, id, c);
        for (int k = 0; k < 6; k++) {
            double t = uniform(&rng, 0, 1);
            check_located(&grid, (double)c[k].x, (double)c[k].y);
            check_located(&grid, (double)c[k].x * t + (double)c[(k + 1) % 6].x * (1 - t),
                          (double)c[k].y * t + (double)c[(k + 1) % 6].y * (1 - t));
        }
        hw_cell_id found = hw_hexgrid_locate(&grid, (double)centre.x, (double)centre.y);
        assert_int_equal(hw_hexgrid_index(&grid, found), i);
    }
}

static void test_index_round_trip(void **state)
{
    (void)state;
    hw_hexgrid grid = hw_hexgrid_cover(0, 0, 1650, 2035, 50, 0, 24);
    uint32_t count = hw_hexgrid_cell_count(&grid);
    assert_int_equal(count, (uint32_t)grid.columns * (uint32_t)grid.rows);
    for (uint32_t i = 0; i < count; i++) {
        hw_cell_id id = hw_hexgrid_cell(&grid, i);
        assert_true(hw_hexgrid_contains(&grid, id));
        assert_int_equal(hw_hexgrid_index(&grid, id), i);
    }
    // Column by column.
    hw_cell_id second = hw_hexgrid_cell(&grid, 1);
    assert_true(second.q == 0 && second.r == 1);
    assert_false(hw_hexgrid_contains(&grid, (hw_cell_id){0, grid.columns, 0}));
    assert_false(hw_hexgrid_contains(&grid, (hw_cell_id){0, 0, -1}));
    assert_false(hw_hexgrid_contains(&grid, (hw_cell_id){1, 0, 0}));
}

static void assert_close(hw_vec3 a, hw_vec3 b, double tolerance)
{
    assert_true((double)hw_v3_length(hw_v3_sub(a, b)) <= tolerance);
}

static void test_corners(void **state)
{
    (void)state;
    hw_hexgrid grid = {10, 20, 2, 1, 5, 4, 4, 1};
    hw_vec3 c[HW_CELL_CORNERS];
    hw_cell_corners(&grid, (hw_cell_id){0, 1, 2}, c);
    // Centre (10 + 3, 20 + 2 sqrt(3) 2.5).
    float cx = 13, cy = 20 + 5 * sqrtf(3);
    assert_close(c[0], hw_v3(cx + 2, cy, 1), 1e-5);
    assert_close(c[1], hw_v3(cx + 1, cy + sqrtf(3), 1), 1e-5);
    assert_close(c[3], hw_v3(cx - 2, cy, 1), 1e-5);
    assert_close(c[4], hw_v3(cx - 1, cy - sqrtf(3), 1), 1e-5);
    for (int i = 0; i < 6; i++)
        assert_close(c[i + 6], hw_v3(c[i].x, c[i].y, 5), 0);
    assert_close(hw_cell_centre(&grid, (hw_cell_id){0, 1, 2}), hw_v3(cx, cy, 3), 1e-5);
}

static void test_neighbours_share_faces(void **state)
{
    (void)state;
    hw_hexgrid grid = {-7, 3, 10, 0, 4, 20, 20, 1};
    for (int32_t level = 0; level < 1; level++) {
        for (int32_t q = -3; q < 4; q++) {
            for (int32_t r = -3; r < 4; r++) {
                hw_cell_id id = {level, q, r}, near[6], back[6];
                hw_vec3 a[HW_CELL_CORNERS], b[HW_CELL_CORNERS];
                hw_cell_neighbours(id, near);
                hw_cell_corners(&grid, id, a);
                for (int i = 0; i < 6; i++) {
                    hw_cell_corners(&grid, near[i], b);
                    assert_close(a[i], b[(i + 4) % 6], 1e-4);
                    assert_close(a[(i + 1) % 6], b[(i + 3) % 6], 1e-4);
                    hw_cell_neighbours(near[i], back);
                    assert_memory_equal(&back[(i + 3) % 6], &id, sizeof id);
                }
            }
        }
    }
}

// Also at the rectangle's corners and along its sides.
static void check_cover(const hw_hexgrid *grid, const double rect[4], hw_rng *rng)
{
    for (int i = 0; i < 300; i++) {
        double x = uniform(rng, rect[0], rect[2]), y = uniform(rng, rect[1], rect[3]);
        if (i % 3 == 0)
            x = rect[i % 2 ? 0 : 2];
        if (i % 5 == 0)
            y = rect[i % 4 ? 1 : 3];
        hw_cell_id id = hw_hexgrid_locate(grid, x, y);
        assert_true(outside(grid, id, x, y) <= 1e-6 * grid->cell_size);
    }
}

static void test_cover(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(9, 1);
    for (int i = 0; i < 2000; i++) {
        double c = uniform(&rng, 0.5, 20), x = uniform(&rng, -50, 50), y = uniform(&rng, -50, 50);
        double rect[4] = {x, y, x + uniform(&rng, 0, 90), y + uniform(&rng, 0, 90)};
        if (i % 7 == 0)
            rect[2] = rect[0] + c * (i % 5); // whole multiples
        hw_hexgrid grid = hw_hexgrid_cover(rect[0], rect[1], rect[2], rect[3], c, 0, 1);
        check_cover(&grid, rect, &rng);
        // The smallest: n columns cover 1.5 c n - c / 2 without gaps; rows, one half row less than
        // twice their number, or exactly that for a single column.
        double width = rect[2] - rect[0], height = rect[3] - rect[1], half_row = c * sqrt(3) / 2;
        if (grid.columns > 1)
            assert_true(width > 1.5 * c * (grid.columns - 1) - 0.5 * c - 1e-6);
        double rows = 2.0 * (grid.rows - 1) - (grid.columns > 1 ? 1 : 0);
        if (grid.rows > 1)
            assert_true(height > rows * half_row - 1e-6);
    }
    hw_hexgrid point = hw_hexgrid_cover(3, 4, 3, 4, 1, 0, 0);
    assert_int_equal(hw_hexgrid_cell_count(&point), 1);
    hw_hexgrid huge = hw_hexgrid_cover(0, 0, 1e30, 1e30, 1e-3, 0, 0);
    assert_true(huge.columns == HW_GRID_SIDE_MAX && huge.rows == HW_GRID_SIDE_MAX);
    assert_true(hw_hexgrid_cell_count(&huge) == 65535u * 65535u);
}

static void test_faces(void **state)
{
    (void)state;
    hw_hexgrid grid = {0, 0, 3, 0, 1, 9, 9, 1};
    for (int face = 0; face < 6; face++) {
        hw_vec3 axis, right, up, corner[HW_CELL_CORNERS];
        hw_face_basis(face, &axis, &right, &up);
        assert_close(hw_v3_cross(right, up), hw_v3_scale(axis, -1), 1e-6);
        assert_true(fabs((double)hw_v3_length(axis) - 1) < 1e-6);
        assert_true(fabs((double)hw_v3_length(right) - 1) < 1e-6);
        assert_close(up, hw_v3(0, 0, 1), 0);
        hw_cell_corners(&grid, (hw_cell_id){0, 0, 0}, corner);
        hw_vec3 middle = hw_v3_scale(hw_v3_add(corner[face], corner[(face + 1) % 6]), 0.5f);
        middle.z = 0;
        assert_close(hw_v3_normalize(middle), axis, 1e-6);
        assert_int_equal(hw_face_towards((double)axis.x, (double)axis.y), face);
    }
    hw_rng rng = hw_rng_make(4, 4);
    for (int i = 0; i < 10000; i++) {
        double angle = uniform(&rng, 0.0001, 359.9999);
        if (fabs(angle - 60 * round(angle / 60)) < 1e-6)
            continue;
        double radians = angle * HW_PI / 180;
        assert_int_equal(hw_face_towards(5 * cos(radians), 5 * sin(radians)), (int)(angle / 60));
    }
    assert_int_equal(hw_face_towards(1, 0), 0);
    assert_int_equal(hw_face_towards(-1, 0), 3);
    assert_in_range(hw_face_towards(0, 0), 0, 5);
}

// A point's depth in the cell that holds it is half of what the nearest other centre is farther
// away along the line between both; in all others it is below 0.
static void test_depth(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(3, 9);
    hw_hexgrid grid = hw_hexgrid_cover(-200, -150, 200, 150, 50, 0, 10);
    for (int i = 0; i < 2000; i++) {
        double x = uniform(&rng, -120, 120), y = uniform(&rng, -70, 70), least = INFINITY;
        hw_cell_id id = hw_hexgrid_locate(&grid, x, y);
        hw_vec3 own = hw_cell_centre(&grid, id);
        for (uint32_t k = 0; k < hw_hexgrid_cell_count(&grid); k++) {
            hw_vec3 c = hw_cell_centre(&grid, hw_hexgrid_cell(&grid, k));
            if (k == hw_hexgrid_index(&grid, id))
                continue;
            least = fmin(least, hypot(c.x - x, c.y - y));
            assert_true(hw_cell_depth(&grid, hw_hexgrid_cell(&grid, k), x, y) < 1e-3);
        }
        double step = 50 * sqrt(3), from = hypot(own.x - x, own.y - y);
        double wanted = (least * least - from * from) / (2 * step);
        assert_true(fabs(hw_cell_depth(&grid, id, x, y) - wanted) < 1e-3);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_locate_is_nearest_centre),
        cmocka_unit_test(test_locate_on_borders),
        cmocka_unit_test(test_index_round_trip),
        cmocka_unit_test(test_corners),
        cmocka_unit_test(test_neighbours_share_faces),
        cmocka_unit_test(test_cover),
        cmocka_unit_test(test_faces),
        cmocka_unit_test(test_depth),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
