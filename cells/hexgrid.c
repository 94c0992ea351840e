#include "hexgrid_internal.h"
#include "hierarchy.h"
#include <assert.h>
#include <stdlib.h>

#define SQRT_3      1.7320508075688772
#define HALF_SQRT_3 0.8660254037844386

// Unit vectors to the corners of a flat-top hexagon, counter-clockwise from +x.
static const double corner_x[6] = {1, 0.5, -0.5, -1, -0.5, 0.5};
static const double corner_y[6] = {0, HALF_SQRT_3, HALF_SQRT_3, 0, -HALF_SQRT_3, -HALF_SQRT_3};
// Unit vectors to the middles of its sides: side i lies between corners i and i + 1.
static const double face_x[6] = {HALF_SQRT_3, 0, -HALF_SQRT_3, -HALF_SQRT_3, 0, HALF_SQRT_3};
static const double face_y[6] = {0.5, 1, 0.5, -0.5, -1, -0.5};

static int32_t clamp_to_side(double value, int32_t count)
{
    // fmax before fmin: NaN becomes 0.
    return (int32_t)fmin(fmax(value, 0), count - 1);
}

// Smallest whole number of at least 1 that is not less than `value`, but for rounding.
static int32_t side_count(double value)
{
    return (int32_t)fmin(fmax(ceil(value - 1e-9), 1), HW_GRID_SIDE_MAX);
}

hw_hexgrid hw_hexgrid_cover(double x_min, double y_min, double x_max, double y_max,
                            double cell_size, double z_min, double z_max)
{
    assert(cell_size > 0 && z_min <= z_max);
    double width = fmax(x_max - x_min, 0), height = fmax(y_max - y_min, 0);
    double half_row = HALF_SQRT_3 * cell_size;
    hw_hexgrid grid = {.cell_size = cell_size, .z_min = z_min, .z_max = z_max, .levels = 1};

    // n columns cover without gaps from half a side before the first centre to half a side after
    // the last.
    grid.columns = side_count((width + 0.5 * cell_size) / (1.5 * cell_size));
    double covered_x = 1.5 * cell_size * (grid.columns - 1);
    grid.origin_x = 0.5 * (x_min + x_max) - 0.5 * covered_x;

    // One column of n rows covers 2n half rows. Two or more share only 2n - 1, from the centre of
    // the even columns' first cell (where the odd ones begin) to their last cell's upper side.
    if (grid.columns == 1) {
        grid.rows = side_count(height / (2 * half_row));
        grid.origin_y = 0.5 * (y_min + y_max) - half_row * (grid.rows - 1);
    } else {
        grid.rows = side_count((height / half_row + 1) / 2);
        grid.origin_y = 0.5 * (y_min + y_max) - half_row * (2.0 * grid.rows - 1) / 2;
    }
    return grid;
}

uint32_t hw_hexgrid_cell_count(const hw_hexgrid *grid)
{
    return (uint32_t)grid->columns * (uint32_t)grid->rows;
}

hw_cell_id hw_hexgrid_cell(const hw_hexgrid *grid, uint32_t index)
{
    assert(index < hw_hexgrid_cell_count(grid));
    uint32_t rows = (uint32_t)grid->rows;
    return (hw_cell_id){0, (int32_t)(index / rows), (int32_t)(index % rows)};
}

uint32_t hw_hexgrid_index(const hw_hexgrid *grid, hw_cell_id id)
{
    assert(hw_hexgrid_contains(grid, id));
    return (uint32_t)id.q * (uint32_t)grid->rows + (uint32_t)id.r;
}

bool hw_hexgrid_contains(const hw_hexgrid *grid, hw_cell_id id)
{
    if (id.level == 0)
        return id.q >= 0 && id.q < grid->columns && id.r >= 0 && id.r < grid->rows;
    if (id.level < 0 || id.level >= grid->levels || abs(id.q) > HW_GRID_SIDE_MAX ||
        abs(id.r) > HW_GRID_SIDE_MAX)
        return false;
    hw_cell_id children[HW_CELL_CHILDREN];
    hw_cell_children(id, children);
    for (int i = 0; i < HW_CELL_CHILDREN; i++)
        if (hw_hexgrid_contains(grid, children[i]))
            return true;
    return false;
}

void hw_cell_centre_2d(const hw_hexgrid *grid, hw_cell_id id, double out[2])
{
    while (id.level > 0)
        id = hw_cell_middle_child(id);
    out[0] = grid->origin_x + 1.5 * grid->cell_size * id.q;
    out[1] = grid->origin_y + SQRT_3 * grid->cell_size * (id.r + 0.5 * (id.q & 1));
}

void hw_cell_outline(const hw_hexgrid *grid, hw_cell_id id, double out[6][2])
{
    double side = hw_cell_side(grid, id.level), centre[2];
    hw_cell_centre_2d(grid, id, centre);
    for (int i = 0; i < 6; i++) {
        out[i][0] = centre[0] + side * corner_x[i];
        out[i][1] = centre[1] + side * corner_y[i];
    }
}

hw_vec3 hw_cell_centre(const hw_hexgrid *grid, hw_cell_id id)
{
    double centre[2];
    hw_cell_centre_2d(grid, id, centre);
    return hw_v3((float)centre[0], (float)centre[1], (float)(0.5 * (grid->z_min + grid->z_max)));
}

void hw_cell_corners(const hw_hexgrid *grid, hw_cell_id id, hw_vec3 corners[HW_CELL_CORNERS])
{
    double outline[6][2];
    hw_cell_outline(grid, id, outline);
    for (int i = 0; i < 6; i++) {
        corners[i] = hw_v3((float)outline[i][0], (float)outline[i][1], (float)grid->z_min);
        corners[i + 6] = hw_v3((float)outline[i][0], (float)outline[i][1], (float)grid->z_max);
    }
}

hw_cell_id hw_hexgrid_locate(const hw_hexgrid *grid, double x, double y)
{
    // Hexagons are the Voronoi cells of their centres. The nearest centre lies in the nearest
    // column or one beside it, in the row nearest within that column. The first of equals wins.
    double side = grid->cell_size, row_height = SQRT_3 * side;
    int32_t middle = clamp_to_side(round((x - grid->origin_x) / (1.5 * side)), grid->columns);
    hw_cell_id best = {0, middle, 0};
    double best_distance = INFINITY;
    for (int32_t q = middle - 1; q <= middle + 1; q++) {
        if (q < 0 || q >= grid->columns)
            continue;
        double row = (y - grid->origin_y) / row_height - 0.5 * (q & 1);
        hw_cell_id id = {0, q, clamp_to_side(round(row), grid->rows)};
        double centre[2];
        hw_cell_centre_2d(grid, id, centre);
        double distance = hypot(x - centre[0], y - centre[1]);
        if (distance < best_distance) {
            best_distance = distance;
            best = id;
        }
    }
    return best;
}

void hw_cell_neighbours(hw_cell_id id, hw_cell_id out[6])
{
    int32_t odd = id.q & 1; // odd columns stand half a row higher
    const int32_t dq[6] = {1, 0, -1, -1, 0, 1};
    const int32_t dr[6] = {odd, 1, odd, odd - 1, -1, odd - 1};
    for (int i = 0; i < 6; i++)
        out[i] = (hw_cell_id){id.level, id.q + dq[i], id.r + dr[i]};
}

double hw_cell_depth(const hw_hexgrid *grid, hw_cell_id id, double x, double y)
{
    double centre[2], farthest = 0;
    hw_cell_centre_2d(grid, id, centre);
    for (int i = 0; i < 6; i++)
        farthest = fmax(farthest, (x - centre[0]) * face_x[i] + (y - centre[1]) * face_y[i]);
    return HALF_SQRT_3 * grid->cell_size - farthest;
}

void hw_face_basis(int face, hw_vec3 *axis, hw_vec3 *right, hw_vec3 *up)
{
    assert(face >= 0 && face < 6);
    *axis = hw_v3((float)face_x[face], (float)face_y[face], 0);
    *up = hw_v3(0, 0, 1);
    *right = hw_v3_cross(*axis, *up);
}

int hw_face_towards(double x, double y)
{
    if (y < 0 || (y == 0 && x < 0))
        return hw_face_towards(-x, -y) + 3;
    if (SQRT_3 * x > y || (x == 0 && y == 0))
        return 0;
    return SQRT_3 * x > -y ? 1 : 2;
}
