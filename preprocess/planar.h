// Points of a plane, and of the pixels that it is divided into.
#pragma once
#include <stdint.h>

// Twice the area of a, b, c (x and y each): positive if they turn left.
static inline double hw_turn(const double *a, const double *b, const double *c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

// A coordinate's whole part, within [0, count].
static inline uint32_t hw_clamp_index(double value, uint32_t count)
{
    return value <= 0 ? 0 : value >= count ? count : (uint32_t)value;
}
