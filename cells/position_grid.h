// Positions as three whole numbers, so that differences of positions are exact. Two grids: the
// floats themselves (lossless), or points a step apart.
#pragma once
#include "vec.h"

// Codes of a grid with steps lie within these; positions further out are clamped.
#define HW_POSITION_CODE_MIN (-(1 << 24))
#define HW_POSITION_CODE_MAX (1 << 25)

typedef struct hw_position_grid {
    bool lossless;    // then origin and step are 0
    double origin[3]; // of code 0, units of the mesh
    double step;      // at most 24 significant bits: step * code is exact in double precision
} hw_position_grid;

// bits 0: lossless. Else 8 to 24 bits over the longest side of `bounds` (positions may leave the
// box by half of that side); the step is never below 2^-21 of the box's largest coordinate, which
// a float could not tell apart.
hw_position_grid hw_position_grid_make(hw_box bounds, uint32_t bits);
// A grid that decodes to finite positions: what a reader must ask before it uses one.
bool hw_position_grid_valid(const hw_position_grid *grid);

// The nearest code. position is finite.
void hw_position_grid_encode(const hw_position_grid *grid, const float position[3],
                             int32_t code[3]);
// (float)(origin + step * code). A code that is no finite float (lossless) gives infinity or NaN.
void hw_position_grid_decode(const hw_position_grid *grid, const int32_t code[3],
                             float position[3]);
// Moves p to what the decoder will give for it (a float's value): at most step / 2 and half a
// float's last place away per coordinate; lossless: the nearest float.
void hw_position_grid_snap(const hw_position_grid *grid, double p[3]);
// Whether encoding and decoding give the same bits back, and no coordinate exceeds
// HW_COORDINATE_MAX.
bool hw_position_grid_holds(const hw_position_grid *grid, const float position[3]);
// Whether a code is one: within the limits, of a position that does not exceed HW_COORDINATE_MAX.
bool hw_position_grid_has(const hw_position_grid *grid, const int32_t code[3]);
