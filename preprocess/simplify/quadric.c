#include "quadric.h"
#include <math.h>

void hw_quadric_add(hw_quadric *q, const hw_quadric *o)
{
    q->a00 += o->a00;
    q->a01 += o->a01;
    q->a02 += o->a02;
    q->a11 += o->a11;
    q->a12 += o->a12;
    q->a22 += o->a22;
    q->b0 += o->b0;
    q->b1 += o->b1;
    q->b2 += o->b2;
    q->c += o->c;
    q->weight += o->weight;
}

void hw_quadric_add_plane(hw_quadric *q, const double n[3], double d, double w)
{
    q->a00 += w * n[0] * n[0];
    q->a01 += w * n[0] * n[1];
    q->a02 += w * n[0] * n[2];
    q->a11 += w * n[1] * n[1];
    q->a12 += w * n[1] * n[2];
    q->a22 += w * n[2] * n[2];
    q->b0 += w * n[0] * d;
    q->b1 += w * n[1] * d;
    q->b2 += w * n[2] * d;
    q->c += w * d * d;
    q->weight += w;
}

double hw_quadric_at(const hw_quadric *q, const double x[3])
{
    double e = x[0] * (q->a00 * x[0] + 2 * (q->a01 * x[1] + q->a02 * x[2] + q->b0)) +
               x[1] * (q->a11 * x[1] + 2 * (q->a12 * x[2] + q->b1)) +
               x[2] * (q->a22 * x[2] + 2 * q->b2) + q->c;
    return e > 0 ? e : 0;
}

bool hw_quadric_minimise(const hw_quadric *q, const double guide[3], double radius, double x[3])
{
    // Solve (A + s I) x = -b + s guide: s is far below the weight of any real feature.
    double s = 1e-3 * (q->a00 + q->a11 + q->a22) / 3;
    double a = q->a00 + s, b = q->a01, c = q->a02, d = q->a11 + s, e = q->a12, f = q->a22 + s;
    double r0 = s * guide[0] - q->b0, r1 = s * guide[1] - q->b1, r2 = s * guide[2] - q->b2;
    double c0 = d * f - e * e, c1 = c * e - b * f, c2 = b * e - c * d;
    double determinant = a * c0 + b * c1 + c * c2;
    if (!(determinant > 0))
        return false;
    double i = 1 / determinant;
    x[0] = i * (c0 * r0 + c1 * r1 + c2 * r2);
    x[1] = i * (c1 * r0 + (a * f - c * c) * r1 + (b * c - a * e) * r2);
    x[2] = i * (c2 * r0 + (b * c - a * e) * r1 + (a * d - b * b) * r2);
    double dx = x[0] - guide[0], dy = x[1] - guide[1], dz = x[2] - guide[2];
    return dx * dx + dy * dy + dz * dz <= radius * radius;
}
