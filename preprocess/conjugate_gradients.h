// Conjugate gradients (Hestenes and Stiefel, 1952) for least squares over the vertices of a mesh:
// the matrix is a function.
#pragma once
#include <stddef.h>

// out = A x, of n numbers each; A symmetric and positive definite.
typedef void hw_linear_map(const void *context, const double *x, double *out);

// x, from 0, towards A x = residual, which is used up. scratch: 2 n numbers.
void hw_conjugate_gradients(hw_linear_map *map, const void *context, size_t n, int steps,
                            double *residual, double *x, double *scratch);
double hw_inner_product(const double *a, const double *b, size_t n);
