// Quadrics: sums of squared distances to weighted planes, E(x) = x'Ax + 2 b'x + c (Garland and
// Heckbert 1997), relative to an origin near the geometry so that cancellation does not eat the
// small errors.
#pragma once
#include <stdbool.h>

typedef struct hw_quadric {
    double a00, a01, a02, a11, a12, a22, b0, b1, b2, c, weight;
} hw_quadric;

void hw_quadric_add(hw_quadric *q, const hw_quadric *other);
// Adds weight * (squared distance to the plane n . x + d = 0), n of unit length.
void hw_quadric_add_plane(hw_quadric *q, const double n[3], double d, double weight);
double hw_quadric_at(const hw_quadric *q, const double x[3]);
// The minimiser, drawn weakly towards `guide` where the quadric is flat. False if there is no
// reasonable one within `radius` of guide.
bool hw_quadric_minimise(const hw_quadric *q, const double guide[3], double radius, double x[3]);
