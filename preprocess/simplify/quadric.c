#include "quadric.h"
#include <math.h>

// The pull towards the guide, as a share of the quadric's mean stiffness: far below the weight of
// any real feature.
#define PULL 1e-3

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

double hw_quadric_at(const hw_quadric *q, double x, double y, double z)
{
    double e = x * (q->a00 * x + 2 * (q->a01 * y + q->a02 * z + q->b0)) +
               y * (q->a11 * y + 2 * (q->a12 * z + q->b1)) + z * (q->a22 * z + 2 * q->b2) + q->c;
    return e > 0 ? e : 0;
}

// The inverse of the symmetric matrix A + s I.
typedef struct inverse {
    double i00, i01, i02, i11, i12, i22;
} inverse;

static bool invert(const hw_quadric *q, double s, inverse *out)
{
    double a = q->a00 + s, b = q->a01, c = q->a02, d = q->a11 + s, e = q->a12, f = q->a22 + s;
    double c0 = d * f - e * e, c1 = c * e - b * f, c2 = b * e - c * d;
    double determinant = a * c0 + b * c1 + c * c2;
    if (!(determinant > 0))
        return false;
    double i = 1 / determinant;
    *out = (inverse){
        i * c0, i * c1, i * c2, i * (a * f - c * c), i * (b * c - a * e), i * (a * d - b * b)};
    return isfinite(i);
}

static inline void apply(const inverse *m, double x, double y, double z, double out[3])
{
    out[0] = m->i00 * x + m->i01 * y + m->i02 * z;
    out[1] = m->i01 * x + m->i11 * y + m->i12 * z;
    out[2] = m->i02 * x + m->i12 * y + m->i22 * z;
}

bool hw_quadric_minimise_on(const hw_quadric *q, const double g[3], double s, const double guide[3],
                            double x[3])
{
    double pull = PULL * (q->a00 + q->a11 + q->a22) / 3, step[3];
    inverse m;
    if (!invert(q, pull, &m))
        return false;
    apply(&m, pull * guide[0] - q->b0, pull * guide[1] - q->b1, pull * guide[2] - q->b2, x);
    apply(&m, g[0], g[1], g[2], step);
    double along = g[0] * step[0] + g[1] * step[1] + g[2] * step[2];
    if (along > 0) {
        double l = (g[0] * x[0] + g[1] * x[1] + g[2] * x[2] + s) / along;
        for (int i = 0; i < 3; i++)
            x[i] -= l * step[i];
    }
    return true;
}

bool hw_quadric_minimise(const hw_quadric *q, const double guide[3], double x[3])
{
    const double none[3] = {0, 0, 0};
    return hw_quadric_minimise_on(q, none, 0, guide, x);
}
