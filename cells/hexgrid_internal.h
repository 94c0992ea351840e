// Cells in double precision, for the other sources of this folder.
#pragma once
#include "hexgrid.h"

// Centre of a cell's hexagon.
void hw_cell_centre_2d(const hw_hexgrid *grid, hw_cell_id id, double out[2]);
// The hexagon's corners, counter-clockwise from +x.
void hw_cell_outline(const hw_hexgrid *grid, hw_cell_id id, double out[6][2]);
