#include "conjugate_gradients.h"
#include <string.h>

double hw_inner_product(const double *a, const double *b, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

void hw_conjugate_gradients(hw_linear_map *map, const void *context, size_t n, int steps,
                            double *residual, double *x, double *scratch)
{
    double *direction = scratch, *image = scratch + n;
    memset(x, 0, n * sizeof *x);
    memcpy(direction, residual, n * sizeof *x);
    double rr = hw_inner_product(residual, residual, n);
    for (int step = 0; step < steps && rr > 0; step++) {
        map(context, direction, image);
        double along = hw_inner_product(direction, image, n);
        if (!(along > 0))
            break;
        double a = rr / along, before = rr;
        for (size_t i = 0; i < n; i++) {
            x[i] += a * direction[i];
            residual[i] -= a * image[i];
        }
        rr = hw_inner_product(residual, residual, n);
        for (size_t i = 0; i < n; i++)
            direction[i] = residual[i] + rr / before * direction[i];
    }
}
