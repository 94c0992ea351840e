// Groups of seven cells: they tile the plane, children and parents agree, and the hexagon that
// stands for a group holds it.
#include "alloc.h"
#include "hierarchy.h"
#include "rng.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static bool same(hw_cell_id a, hw_cell_id b)
{
    return a.level == b.level && a.q == b.q && a.r == b.r;
}

static hw_cell_id random_cell(hw_rng *rng, int32_t level)
{
    return (hw_cell_id){level, (int32_t)hw_rng_below(rng, 401) - 200,
                        (int32_t)hw_rng_below(rng, 401) - 200};
}

// Seven different children, each of which has this parent; and a cell is among its parent's
// children.
static void parents_and_children_agree(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(5, 1);
    for (int t = 0; t < 5000; t++) {
        hw_cell_id id = random_cell(&rng, 1 + (int32_t)hw_rng_below(&rng, 3)), children[7], of[7];
        hw_cell_children(id, children);
        assert_true(same(children[0], hw_cell_middle_child(id)));
        for (int i = 0; i < 7; i++) {
            assert_true(same(hw_cell_parent(children[i]), id));
            for (int k = 0; k < i; k++)
                assert_false(same(children[i], children[k]));
        }
        hw_cell_id parent = hw_cell_parent(id);
        assert_int_equal(parent.level, id.level + 1);
        hw_cell_children(parent, of);
        int found = 0;
        for (int i = 0; i < 7; i++)
            found += same(of[i], id);
        assert_int_equal(found, 1);
    }
}

// The children of a cell of level 1 are a cell and its six neighbours, in any row and column.
static void groups_are_neighbourhoods(void **state)
{
    (void)state;
    for (int32_t q = -9; q < 10; q++)
        for (int32_t r = -9; r < 10; r++) {
            hw_cell_id children[7], near[6];
            hw_cell_children((hw_cell_id){1, q, r}, children);
            hw_cell_neighbours(children[0], near);
            for (int i = 0; i < 6; i++) {
                int found = 0;
                for (int k = 1; k < 7; k++)
                    found += same(near[i], children[k]);
                assert_int_equal(found, 1);
            }
        }
}

static bool within(const hw_hexgrid *grid, hw_cell_id id, hw_vec3 p, double slack)
{
    hw_vec3 corners[HW_CELL_CORNERS];
    hw_cell_corners(grid, id, corners);
    for (int i = 0; i < 6; i++) {
        hw_vec3 a = corners[i], b = corners[(i + 1) % 6];
        double side = (double)(b.x - a.x) * (p.y - a.y) - (double)(b.y - a.y) * (p.x - a.x);
        if (side < -slack * hypot((double)b.x - a.x, (double)b.y - a.y))
            return false;
    }
    return true;
}

// Whatever point of the grid, its cells of all levels hold it; and the hexagon is the smallest:
// some corner of the group's cells lies on its rim.
static void hexagons_hold_their_groups(void **state)
{
    (void)state;
    hw_hexgrid grid = hw_hexgrid_cover(-300, -200, 300, 200, 10, 0, 5);
    grid.levels = 4;
    hw_rng rng = hw_rng_make(6, 1);
    double least_gap[4] = {1e9, 1e9, 1e9, 1e9};
    for (int t = 0; t < 20000; t++) {
        double x = -300 + 600 * (double)hw_rng_float(&rng),
               y = -200 + 400 * (double)hw_rng_float(&rng);
        hw_cell_id id = hw_hexgrid_locate(&grid, x, y);
        hw_vec3 corners[HW_CELL_CORNERS];
        hw_cell_corners(&grid, id, corners);
        for (int32_t l = 1; l < grid.levels; l++) {
            hw_cell_id group = hw_cell_ancestor(id, l);
            assert_true(hw_hexgrid_contains(&grid, group));
            for (int i = 0; i < 6; i++) {
                assert_true(within(&grid, group, corners[i], 1e-3));
                double gap = 10;
                while (gap > 1e-3 && !within(&grid, group, corners[i], -gap))
                    gap /= 2;
                least_gap[l] = fmin(least_gap[l], gap);
            }
        }
    }
    for (int32_t l = 1; l < grid.levels; l++)
        assert_true(least_gap[l] < 0.01);
    assert_true(fabs(hw_cell_side(&grid, 1) - 30) < 1e-9); // three sides hold seven cells
}

static void all_cells_of_a_grid(void **state)
{
    (void)state;
    hw_hexgrid grid = hw_hexgrid_cover(-300, -200, 300, 200, 17, 0, 5);
    grid.levels = 3;
    hw_cell_id *cells;
    uint32_t count;
    assert_int_equal(hw_hierarchy_cells(&grid, &cells, &count), HW_OK);
    for (uint32_t i = 0; i < count; i++) {
        assert_true(hw_hexgrid_contains(&grid, cells[i]));
        if (i == 0 || cells[i].level != cells[i - 1].level)
            continue;
        assert_true(cells[i - 1].q < cells[i].q ||
                    (cells[i - 1].q == cells[i].q && cells[i - 1].r < cells[i].r));
    }
    // Every parent of a cell of the grid is there, once; nothing else is.
    for (uint32_t i = 0; i < count; i++) {
        uint32_t found = 0;
        hw_cell_id parent = hw_cell_parent(cells[i]);
        for (uint32_t k = 0; k < count && cells[i].level < 2; k++)
            found += same(cells[k], parent);
        assert_int_equal(found, cells[i].level < 2);
    }
    assert_false(hw_hexgrid_contains(&grid, (hw_cell_id){1, 100, 100}));
    assert_false(hw_hexgrid_contains(&grid, (hw_cell_id){3, 0, 0}));
    assert_false(hw_hexgrid_contains(&grid, (hw_cell_id){1, INT32_MAX, INT32_MIN}));
    hw_free(cells);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(parents_and_children_agree),
        cmocka_unit_test(groups_are_neighbourhoods),
        cmocka_unit_test(hexagons_hold_their_groups),
        cmocka_unit_test(all_cells_of_a_grid),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
