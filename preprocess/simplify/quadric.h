// Quadrics: sums of squared distances to weighted planes, E(x) = x'Ax + 2 b'x + c (Garland and
// Heckbert 1997), relative to an origin near the geometry so that cancellation does not eat the
// small errors.
#pragma once
#include <stdbool.h>

typedef struct hw_quadric {
    double a00, a01, a02, a11, a12, a22, b0, b1, b2, c;
    double weight; // sum of the planes' weights
} hw_quadric;

void hw_quadric_add(hw_quadric *q, const hw_quadric *other);
// Adds scale * (n . x + d)^2. For a unit normal, scale is the plane's weight; in general it is the
// weight over the normal's squared length. `weight` is what the plane counts in q->weight.
static inline void hw_quadric_add_plane(hw_quadric *q, const double n[3], double d, double scale,
                                        double weight)
{
    double x = scale * n[0], y = scale * n[1], z = scale * n[2];
    q->a00 += x * n[0];
    q->a01 += x * n[1];
    q->a02 += x * n[2];
    q->a11 += y * n[1];
    q->a12 += y * n[2];
    q->a22 += z * n[2];
    q->b0 += x * d;
    q->b1 += y * d;
    q->b2 += z * d;
    q->c += scale * d * d;
    q->weight += weight;
}
// Never below 0.
double hw_quadric_at(const hw_quadric *q, double x, double y, double z);
// The minimiser, drawn weakly towards `guide` where the quadric is flat. False if singular.
bool hw_quadric_minimise(const hw_quadric *q, const double guide[3], double x[3]);
// The same on the plane g . x + s = 0; the plane is left aside if g is 0.
bool hw_quadric_minimise_on(const hw_quadric *q, const double g[3], double s, const double guide[3],
                            double x[3]);
