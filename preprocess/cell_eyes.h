// Points of a cell that stand for all of it: where occlusion is looked for from.
#pragma once
#include "hexgrid.h"
#include "status.h"

// Writes `count` eyes of a cell of level 0: its upper corners, its lower ones, then points spread
// over its surface, evenly however many are taken. Whatever can be seen from a cell can be seen
// from its surface: where the line of sight leaves it. A third lie on the upper rim, from where
// most is seen over things, and a fifth on the lower, from where one sees through under things.
void hw_cell_eyes(const hw_hexgrid *grid, hw_cell_id id, uint32_t count, hw_vec3 *eyes);

// Element i of an additive recurrence in dimension k (0 to 5), in [0, 1): evenly spread however
// many are taken, also over several dimensions together.
double hw_spread(uint32_t i, int k, double shift);

// The cells of level 0 of the grid that a cell of any level consists of, in a fixed order. *out is
// freed with hw_free.
HW_MUST_USE hw_status hw_cell_leaves(const hw_hexgrid *grid, hw_cell_id id, hw_cell_id **out,
                                     uint32_t *count);
