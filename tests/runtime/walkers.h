// A walker on a small grid, and ways to move it.
#pragma once
#include "alloc.h"
#include "file.h"
#include "mesh_file.h"
#include "rng.h"
#include "walker.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#define UNUSED __attribute__((unused))
#define STEP   (1.0 / 60)

static UNUSED hw_hexgrid test_grid(void)
{
    return hw_hexgrid_cover(0, 0, 400, 400, 25, 2, 40);
}

static UNUSED hw_walker test_walker(void)
{
    hw_hexgrid grid = test_grid();
    hw_walker w;
    hw_walker_init(&w, &grid);
    hw_walker_place(&w, hw_v3(200, 200, 12), hw_v3(1, 0, 0));
    return w;
}

static UNUSED void hold(hw_walker *w, const hw_key *keys, int count, double seconds, double step)
{
    hw_input input = {0};
    for (int i = 0; i < count; i++)
        input.down[keys[i]] = true;
    int steps = (int)lround(seconds / step);
    for (int i = 0; i < steps; i++)
        assert_int_equal(hw_walker_update(w, &input, step), HW_OK);
}

static UNUSED void hold_one(hw_walker *w, hw_key key, double seconds)
{
    hold(w, &key, 1, seconds, STEP);
}

static UNUSED void assert_at(const hw_walker *w, double x, double y, double z, double tolerance)
{
    assert_true(fabs(w->x - x) <= tolerance);
    assert_true(fabs(w->y - y) <= tolerance);
    assert_true(fabs(w->z - z) <= tolerance);
}

static UNUSED void assert_near_v3(hw_vec3 a, hw_vec3 b, float tolerance)
{
    assert_true(hw_v3_length(hw_v3_sub(a, b)) <= tolerance);
}

// How far (x, y) is beyond the grid, at least; 0 or less inside.
static UNUSED double outside(const hw_hexgrid *grid, double x, double y)
{
    double least = INFINITY;
    for (uint32_t i = 0; i < hw_hexgrid_cell_count(grid); i++) {
        hw_vec3 corners[HW_CELL_CORNERS];
        hw_cell_corners(grid, hw_hexgrid_cell(grid, i), corners);
        double worst = -INFINITY;
        for (int k = 0; k < 6; k++) {
            hw_vec3 a = corners[k], b = corners[(k + 1) % 6];
            double nx = (double)b.y - a.y, ny = (double)a.x - b.x;
            worst = fmax(worst, ((x - a.x) * nx + (y - a.y) * ny) / hypot(nx, ny));
        }
        least = fmin(least, worst);
    }
    return least;
}
