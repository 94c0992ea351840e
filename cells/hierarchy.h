// Cells in groups of seven (aperture 7): a cell of level l + 1 is a cell of level l and its six
// neighbours. Groups tile the plane, so every view point lies in exactly one cell of each level,
// and that is found by going up from level 0.
//
// With the columns' and rows' axes as complex numbers, the cells of level 0 are the Eisenstein
// integers; those of level l are the multiples of a number of norm 7^l, by turns of 2 + w and its
// conjugate so that the lattices do not turn away.
#pragma once
#include "hexgrid.h"
#include "status.h"

#define HW_CELL_CHILDREN 7

// The cell of the next level that holds the cell. May lie outside the grid where the cell does.
hw_cell_id hw_cell_parent(hw_cell_id id);
// The cells of the level below (level > 0), the middle one first. Some may lie outside the grid.
void hw_cell_children(hw_cell_id id, hw_cell_id out[HW_CELL_CHILDREN]);
hw_cell_id hw_cell_middle_child(hw_cell_id id);
// The cell of a level that holds a cell of a lower one.
hw_cell_id hw_cell_ancestor(hw_cell_id id, int32_t level);

// All cells of the grid, level by level, in rising order of q, then r. *out is freed with hw_free.
HW_MUST_USE hw_status hw_hierarchy_cells(const hw_hexgrid *grid, hw_cell_id **out, uint32_t *count);
// Index of a cell among them, `count` if it is none of them.
uint32_t hw_hierarchy_find(const hw_cell_id *cells, uint32_t count, hw_cell_id id);
