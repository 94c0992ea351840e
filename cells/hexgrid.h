// The hexagonal grid of view cells: flat-top hexagons of side c; columns are 1.5 c apart, rows
// sqrt(3) c; odd columns are shifted up by half a row ("odd-q" offset coordinates: q = column, r =
// row).
#pragma once
#include "vec.h"
#include <stdint.h>

// Level 0: column q and row r. Level l > 0: the cell that groups seven cells of level l - 1, see
// hierarchy.h; q and r are axial coordinates of its level's lattice.
typedef struct hw_cell_id {
    int32_t level, q, r;
} hw_cell_id;

typedef struct hw_hexgrid {
    double origin_x, origin_y; // centre of cell (0, 0) of level 0
    double cell_size;          // side length c of level 0
    double z_min, z_max;       // heights of the prism: where eyes may be
    int32_t columns, rows;     // level 0
    int32_t levels;            // 1 to HW_CELL_LEVELS_MAX
} hw_hexgrid;

// By level, then q, then r: below, equal to or above 0, for cells in order.
static inline int hw_cell_compare(hw_cell_id a, hw_cell_id b)
{
    if (a.level != b.level)
        return a.level < b.level ? -1 : 1;
    if (a.q != b.q)
        return a.q < b.q ? -1 : 1;
    return (a.r > b.r) - (a.r < b.r);
}

#define HW_CELL_CORNERS    12    // prism corners: six below (z_min), six above (z_max)
#define HW_GRID_SIDE_MAX   65535 // columns and rows of a grid
#define HW_CELL_LEVELS_MAX 5

// The smallest grid of one level whose cells cover the rectangle, centred on it. cell_size > 0,
// z_min <= z_max. Columns and rows stop at HW_GRID_SIDE_MAX: a caller that takes cell_size from a
// user checks that neither has that value.
hw_hexgrid hw_hexgrid_cover(double x_min, double y_min, double x_max, double y_max,
                            double cell_size, double z_min, double z_max);
uint32_t hw_hexgrid_cell_count(const hw_hexgrid *grid);
// Cells of level 0 in a fixed order (column by column), and back. Index in [0, cell_count).
hw_cell_id hw_hexgrid_cell(const hw_hexgrid *grid, uint32_t index);
uint32_t hw_hexgrid_index(const hw_hexgrid *grid, hw_cell_id id);
// Whether it is a cell of the grid: of level 0 within columns and rows, or a group of such cells.
bool hw_hexgrid_contains(const hw_hexgrid *grid, hw_cell_id id);
// Side length of the hexagon that stands for a cell of the level: at level 0 the cell itself, above
// the smallest upright one that holds the group.
double hw_cell_side(const hw_hexgrid *grid, int32_t level);
// Centre of the cell at half its height.
hw_vec3 hw_cell_centre(const hw_hexgrid *grid, hw_cell_id id);
// Of the hexagon that stands for the cell. Corner i: 0..5 counter-clockwise from +x at z_min, 6..11
// the same at z_max.
void hw_cell_corners(const hw_hexgrid *grid, hw_cell_id id, hw_vec3 corners[HW_CELL_CORNERS]);
// The level-0 cell whose hexagon holds (x, y), clamped into the grid; ties go to one cell only,
// always the same.
hw_cell_id hw_hexgrid_locate(const hw_hexgrid *grid, double x, double y);
// The six neighbours of a cell of level 0 (may lie outside the grid), in the order of the faces:
// face i lies between corners i and i + 1.
void hw_cell_neighbours(hw_cell_id id, hw_cell_id out[6]);
// How far (x, y) lies inside a cell of level 0: from the nearest of the lines through its sides,
// below 0 outside.
double hw_cell_depth(const hw_hexgrid *grid, hw_cell_id id, double x, double y);
// Window basis of face i (of six): `axis` points horizontally from the centre through the middle of
// the face, right x up = -axis looking out along axis. All unit length.
void hw_face_basis(int face, hw_vec3 *axis, hw_vec3 *right, hw_vec3 *up);
// The face whose sector (60 degrees) holds the horizontal direction (x, y).
int hw_face_towards(double x, double y);
