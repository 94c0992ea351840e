#include "position_grid.h"
#include "mesh.h"
#include <string.h>

// A float's bits in an order that is that of the numbers: negative ones are mirrored. -0 comes just
// before +0. The map is its own inverse.
static int32_t mirror(int32_t bits)
{
    return bits < 0 ? bits ^ 0x7fffffff : bits;
}

static int32_t code_of_float(float value)
{
    int32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return mirror(bits);
}

static float float_of_code(int32_t code)
{
    int32_t bits = mirror(code);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

hw_position_grid hw_position_grid_make(hw_box bounds, uint32_t bits)
{
    if (bits == 0)
        return (hw_position_grid){.lossless = true};
    bits = bits < 8 ? 8 : bits > 24 ? 24 : bits;
    const float low[3] = {bounds.min.x, bounds.min.y, bounds.min.z};
    const float high[3] = {bounds.max.x, bounds.max.y, bounds.max.z};
    hw_position_grid grid = {0};
    double longest = 0, largest = 0;
    for (int i = 0; i < 3; i++) {
        if (!(low[i] <= high[i])) // an empty box
            continue;
        grid.origin[i] = (double)low[i];
        longest = fmax(longest, (double)high[i] - (double)low[i]);
        largest = fmax(largest, fmax(fabs((double)low[i]), fabs((double)high[i])));
    }
    // Half a float's last place, at up to twice the largest coordinate, stays below step / 2.
    double step = fmax(longest / ((1 << bits) - 1), ldexp(largest, -21));
    float rounded = nextafterf((float)step, INFINITY);
    grid.step = rounded > 0x1p-100f ? (double)rounded : 1;
    return grid;
}

bool hw_position_grid_valid(const hw_position_grid *grid)
{
    bool zero = true;
    for (int i = 0; i < 3; i++) {
        if (!(fabs(grid->origin[i]) <= (double)HW_COORDINATE_MAX))
            return false;
        zero = zero && grid->origin[i] == 0;
    }
    if (grid->lossless)
        return zero && grid->step == 0;
    return grid->step >= 0x1p-100 && grid->step <= (double)HW_COORDINATE_MAX &&
           (double)(float)grid->step == grid->step;
}

void hw_position_grid_encode(const hw_position_grid *grid, const float position[3], int32_t code[3])
{
    for (int i = 0; i < 3; i++) {
        if (grid->lossless) {
            code[i] = code_of_float(position[i]);
            continue;
        }
        double steps = rint(((double)position[i] - grid->origin[i]) / grid->step);
        steps = fmin(fmax(steps, HW_POSITION_CODE_MIN), HW_POSITION_CODE_MAX);
        code[i] = (int32_t)steps;
    }
}

void hw_position_grid_decode(const hw_position_grid *grid, const int32_t code[3], float position[3])
{
    for (int i = 0; i < 3; i++)
        position[i] = grid->lossless ? float_of_code(code[i])
                                     : (float)(grid->origin[i] + grid->step * code[i]);
}

void hw_position_grid_snap(const hw_position_grid *grid, double p[3])
{
    float position[3];
    int32_t code[3];
    for (int i = 0; i < 3; i++) {
        double steps = grid->lossless ? 0 : rint((p[i] - grid->origin[i]) / grid->step);
        code[i] = (int32_t)fmin(fmax(steps, HW_POSITION_CODE_MIN), HW_POSITION_CODE_MAX);
        position[i] = (float)p[i];
    }
    if (!grid->lossless)
        hw_position_grid_decode(grid, code, position);
    for (int i = 0; i < 3; i++)
        p[i] = (double)position[i];
}

bool hw_position_grid_has(const hw_position_grid *grid, const int32_t code[3])
{
    float position[3];
    for (int i = 0; i < 3; i++)
        if (!grid->lossless && (code[i] < HW_POSITION_CODE_MIN || code[i] > HW_POSITION_CODE_MAX))
            return false;
    hw_position_grid_decode(grid, code, position);
    return fabsf(position[0]) <= HW_COORDINATE_MAX && fabsf(position[1]) <= HW_COORDINATE_MAX &&
           fabsf(position[2]) <= HW_COORDINATE_MAX;
}

bool hw_position_grid_holds(const hw_position_grid *grid, const float position[3])
{
    int32_t code[3];
    float again[3];
    for (int i = 0; i < 3; i++)
        if (!(fabsf(position[i]) <= HW_COORDINATE_MAX))
            return false;
    hw_position_grid_encode(grid, position, code);
    hw_position_grid_decode(grid, code, again);
    return hw_position_grid_has(grid, code) && memcmp(position, again, sizeof again) == 0;
}
