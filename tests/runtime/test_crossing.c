// Shares of cells in a picture: steady wherever the viewer walks, and complete for every object.
#include "crossing.h"
#include "hierarchy.h"
#include "models.h"
#include "rng.h"
#include <math.h>

#define WIDTH 0.2
#define SIDE  50.0

static hw_hexgrid make_grid(int32_t levels)
{
    hw_hexgrid grid = hw_hexgrid_cover(-300, -300, 300, 300, SIDE, 8, 16);
    grid.levels = levels;
    return grid;
}

static float uniform(hw_rng *rng, float min, float max)
{
    return min + (max - min) * hw_rng_float(rng);
}

static hw_crossing cross(const hw_hexgrid *grid, hw_vec3 eye, double width)
{
    hw_cell_id id = hw_hexgrid_locate(grid, (double)eye.x, (double)eye.y);
    return hw_crossing_at(grid, id, eye, width);
}

static double share(const hw_crossing *c, hw_cell_id id)
{
    for (uint32_t i = 0; i < c->count; i++)
        if (hw_cell_compare(c->cells[i], id) == 0)
            return (double)c->bounds[i + 1] - (double)c->bounds[i];
    return 0;
}

// A point of three cells, some way inside the grid.
static hw_vec3 triple_point(const hw_hexgrid *grid, hw_rng *rng)
{
    hw_vec3 corners[HW_CELL_CORNERS];
    double x = (double)uniform(rng, -150, 150), y = (double)uniform(rng, -150, 150);
    hw_cell_corners(grid, hw_hexgrid_locate(grid, x, y), corners);
    return corners[(int)(6 * hw_rng_float(rng)) % 6];
}

static void check_form(const hw_crossing *c)
{
    assert_in_range(c->count, 1, HW_CROSSING_CELLS);
    assert_true(c->bounds[0] == 0 && c->bounds[c->count] == 1);
    for (uint32_t i = 0; i < c->count; i++)
        assert_true(c->bounds[i] <= c->bounds[i + 1]);
}

// On the way over a border, away from the others.
static void test_border(void **state)
{
    (void)state;
    const hw_hexgrid grid = make_grid(1);
    const hw_cell_id id = hw_hexgrid_locate(&grid, 0, 0);
    hw_cell_id around[6];
    hw_cell_neighbours(id, around);
    const hw_vec3 from = hw_cell_centre(&grid, id);
    for (int f = 0; f < 6; f++) {
        hw_vec3 axis, right, up;
        hw_face_basis(f, &axis, &right, &up);
        for (int i = -12; i <= 12; i++) {
            float beyond = (float)i; // the border, in a strip of 10 to each side
            hw_vec3 eye = hw_v3_mad(from, axis, (float)(SIDE * sqrt(0.75)) + beyond);
            hw_crossing c = cross(&grid, eye, WIDTH);
            double wanted = fmin(fmax(0.5 + i / 20.0, 0), 1);
            check_form(&c);
            assert_true(fabs(share(&c, around[f]) - wanted) < 1e-5);
            assert_true(fabs(share(&c, id) - (1 - wanted)) < 1e-5);
            c = cross(&grid, eye, 0);
            assert_int_equal(c.count, 1);
        }
    }
}

static void test_triple_point(void **state)
{
    (void)state;
    const hw_hexgrid grid = make_grid(1);
    hw_rng rng = hw_rng_make(4, 1);
    for (int i = 0; i < 100; i++) {
        hw_crossing c = cross(&grid, triple_point(&grid, &rng), WIDTH);
        assert_int_equal(c.count, 3);
        for (int k = 0; k < 3; k++)
            assert_true(fabs(share(&c, c.cells[k]) - 1 / 3.0) < 1e-4);
    }
}

// Whichever of its cells is taken for the viewer's, the crossing is the same.
static void check_from_others(const hw_hexgrid *grid, const hw_crossing *c, hw_vec3 eye,
                              double width)
{
    for (uint32_t k = 0; k < c->count; k++) {
        hw_crossing other = hw_crossing_at(grid, c->cells[k], eye, width);
        assert_int_equal(other.count, c->count);
        for (uint32_t i = 0; i < c->count; i++) {
            assert_int_equal(hw_cell_compare(other.cells[i], c->cells[i]), 0);
            assert_true(other.bounds[i] == c->bounds[i]);
        }
    }
}

// No share changes more than 1.2 times as much as over the middle of a border, past borders and
// triple points.
static void test_walks(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(4, 2);
    uint32_t met[HW_CROSSING_CELLS + 1] = {0};
    for (int walk = 0; walk < 600; walk++) {
        const hw_hexgrid grid = make_grid(1 + walk % 3);
        const double width = walk % 2 ? WIDTH : HW_CROSSING_MAX;
        hw_vec3 eye = triple_point(&grid, &rng);
        float angle = uniform(&rng, 0, 6.2832f), step = 0.05f;
        hw_vec3 way = hw_v3(step * cosf(angle), step * sinf(angle), 0);
        eye = hw_v3_mad(eye, way, -300);
        eye.x += uniform(&rng, -2, 2);
        hw_crossing before = cross(&grid, eye, width);
        double most = 0.61 * (double)step / (width * SIDE) + 1e-5;
        for (int i = 0; i < 600; i++) {
            eye = hw_v3_add(eye, way);
            hw_crossing now = cross(&grid, eye, width);
            check_form(&now);
            check_from_others(&grid, &now, eye, width);
            met[now.count]++;
            for (uint32_t k = 0; k < now.count; k++)
                assert_true(fabs(share(&now, now.cells[k]) - share(&before, now.cells[k])) < most);
            for (uint32_t k = 0; k < before.count; k++)
                assert_true(fabs(share(&now, before.cells[k]) - share(&before, before.cells[k])) <
                            most);
            before = now;
        }
    }
    assert_true(met[1] > 1000 && met[2] > 1000 && met[3] > 1000);
}

// Beyond the grid there is always a cell; and cells that the grid has not have no share.
static void test_outside(void **state)
{
    (void)state;
    const hw_hexgrid grid = make_grid(1);
    hw_rng rng = hw_rng_make(4, 3);
    for (int i = 0; i < 2000; i++) {
        hw_vec3 eye = hw_v3(uniform(&rng, -800, 800), uniform(&rng, -800, 800), 10);
        hw_crossing c = cross(&grid, eye, WIDTH);
        check_form(&c);
        for (uint32_t k = 0; k < c.count; k++)
            assert_true(hw_hexgrid_contains(&grid, c.cells[k]));
    }
}

// Cells of a group follow each other, at every level: what they have in common is one interval.
static void test_groups(void **state)
{
    (void)state;
    const hw_hexgrid grid = make_grid(3);
    hw_rng rng = hw_rng_make(4, 4);
    uint32_t pairs = 0;
    for (int i = 0; i < 3000; i++) {
        hw_vec3 eye = triple_point(&grid, &rng);
        eye.x += uniform(&rng, -3, 3);
        hw_crossing c = cross(&grid, eye, WIDTH);
        for (int32_t l = 0; l < 3 && c.count == 3; l++) {
            hw_cell_id a[3];
            for (int k = 0; k < 3; k++)
                a[k] = hw_cell_ancestor(c.cells[k], l);
            bool first = hw_cell_compare(a[0], a[1]) == 0, last = hw_cell_compare(a[1], a[2]) == 0;
            assert_int_equal(hw_cell_compare(a[0], a[2]) == 0, first && last);
            pairs += first != last;
        }
    }
    assert_true(pairs > 100);
}

static void test_remove(void **state)
{
    (void)state;
    const hw_hexgrid grid = make_grid(1);
    hw_rng rng = hw_rng_make(4, 5);
    for (int i = 0; i < 300; i++) {
        hw_vec3 eye = triple_point(&grid, &rng);
        eye.x += uniform(&rng, -1, 1);
        hw_crossing all = cross(&grid, eye, WIDTH), c = all;
        uint32_t gone = (uint32_t)i % 3;
        assert_int_equal(all.count, 3);
        hw_crossing_remove(&c, gone);
        check_form(&c);
        assert_int_equal(c.count, 2);
        assert_true(share(&c, all.cells[gone]) == 0);
        double rest = 1 - share(&all, all.cells[gone]);
        for (uint32_t k = 0; k < 2; k++)
            assert_true(fabs(share(&c, c.cells[k]) - share(&all, c.cells[k]) / rest) < 1e-5);
        hw_crossing_remove(&c, 0);
        assert_true(c.count == 1 && c.bounds[0] == 0 && c.bounds[1] == 1);
    }
}

static bool keeps(hw_kept kept, float n)
{
    return n >= kept.first && n < kept.end;
}

static hw_crossing random_crossing(hw_rng *rng)
{
    hw_crossing c = {.count = 1 + (uint32_t)(3 * hw_rng_float(rng)) % 3};
    float a = hw_rng_float(rng), b = hw_rng_float(rng);
    c.bounds[1] = fminf(a, b);
    c.bounds[2] = fmaxf(a, b);
    c.bounds[c.count] = 1;
    return c;
}

// The pixel n of an object is that of exactly one cell; what neighbours have in common is that of
// them together.
static void check_pixel(const hw_crossing *c, hw_turn turn, float n)
{
    int sum = 0;
    for (uint32_t m = 0; m < c->count; m++)
        sum += keeps(hw_crossing_kept(c, m, m + 1, turn), n);
    assert_int_equal(sum, 1);
    for (uint32_t m = 0; m + 1 < c->count; m++) {
        bool either = keeps(hw_crossing_kept(c, m, m + 1, turn), n) ||
                      keeps(hw_crossing_kept(c, m + 1, m + 2, turn), n);
        assert_int_equal(keeps(hw_crossing_kept(c, m, m + 2, turn), n), either);
    }
}

static void test_complete(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(4, 6);
    const float last = nextafterf(1, 0);
    for (uint32_t i = 0; i < 20000; i++) {
        hw_crossing c = random_crossing(&rng);
        float length = uniform(&rng, 0.01f, 1);
        hw_turn turn = i % 2 ? hw_object_turn(i, 1 + i % 7)
                             : (hw_turn){(1 - length) * hw_rng_float(&rng), length};
        check_pixel(&c, turn, 0);
        check_pixel(&c, turn, last);
        for (uint32_t m = 1; m < c.count; m++) { // just where two cells meet
            float n = (c.bounds[m] - turn.start) / turn.length;
            check_pixel(&c, turn, fminf(fmaxf(n, 0), last));
        }
        for (int k = 0; k < 5; k++)
            check_pixel(&c, turn, hw_rng_float(&rng));
        hw_kept all = hw_crossing_kept(&c, 0, c.count, turn);
        assert_int_equal(hw_kept_phase(all), HW_PHASE_WHOLE);
    }
}

// Objects dissolve one turn after the other: where two cells meet on the scale only the objects of
// one turn are drawn twice, and over all turns a cell has the pixels that its share says.
static void test_turns(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(4, 7);
    const uint32_t objects = 4000;
    for (int i = 0; i < 300; i++) {
        hw_crossing c = random_crossing(&rng);
        double kept[HW_CROSSING_CELLS] = {0};
        uint32_t twice = 0;
        for (uint32_t k = 0; k < objects; k++) {
            hw_turn turn = hw_object_turn(k, 4);
            uint32_t drawn = 0;
            for (uint32_t m = 0; m < c.count; m++) {
                hw_kept pixels = hw_crossing_kept(&c, m, m + 1, turn);
                kept[m] += ((double)pixels.end - (double)pixels.first) / objects;
                drawn += !hw_kept_none(pixels);
            }
            twice += drawn > 1;
        }
        assert_true(twice <= (c.count - 1) * objects * 0.26);
        for (uint32_t m = 0; m < c.count; m++)
            assert_true(fabs(kept[m] - ((double)c.bounds[m + 1] - (double)c.bounds[m])) < 0.01);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_border),   cmocka_unit_test(test_triple_point),
        cmocka_unit_test(test_walks),    cmocka_unit_test(test_outside),
        cmocka_unit_test(test_groups),   cmocka_unit_test(test_remove),
        cmocka_unit_test(test_complete), cmocka_unit_test(test_turns),
    };
    return cmocka_run_group_tests_name("crossing", tests, NULL, NULL);
}
