#include "vec.h"
#include <float.h>
#include <string.h>

hw_mat4 hw_mat4_identity(void)
{
    return hw_mat4_scale(1, 1, 1);
}

hw_mat4 hw_mat4_mul(hw_mat4 a, hw_mat4 b)
{
    hw_mat4 c;
    for (int column = 0; column < 4; column++)
        for (int row = 0; row < 4; row++) {
            double sum = 0;
            for (int k = 0; k < 4; k++)
                sum += a.m[k * 4 + row] * b.m[column * 4 + k];
            c.m[column * 4 + row] = sum;
        }
    return c;
}

// Power of two that brings the largest of four values (stride apart) into [0.5, 1); 1 for zeros.
static double balance(const double *m, int stride)
{
    double largest = 0;
    for (int i = 0; i < 4; i++)
        largest = fmax(largest, fabs(m[i * stride]));
    int exponent;
    frexp(largest, &exponent);
    return largest > 0 ? ldexp(1, -exponent) : 1;
}

// Gauss-Jordan elimination with partial pivoting of the rows [a | b]. Element (row, column) is
// a[column * 4 + row].
static bool eliminate(double a[16], double b[16])
{
    for (int k = 0; k < 4; k++) {
        int pivot = k;
        for (int row = k + 1; row < 4; row++)
            if (fabs(a[k * 4 + row]) > fabs(a[k * 4 + pivot]))
                pivot = row;
        if (!(fabs(a[k * 4 + pivot]) > 4 * DBL_EPSILON))
            return false;
        for (int column = 0; column < 4; column++) {
            double s = a[column * 4 + k], t = b[column * 4 + k];
            a[column * 4 + k] = a[column * 4 + pivot];
            b[column * 4 + k] = b[column * 4 + pivot];
            a[column * 4 + pivot] = s;
            b[column * 4 + pivot] = t;
        }
        double inverse = 1 / a[k * 4 + k];
        for (int column = 0; column < 4; column++) {
            a[column * 4 + k] *= inverse;
            b[column * 4 + k] *= inverse;
        }
        for (int row = 0; row < 4; row++) {
            double factor = a[k * 4 + row];
            for (int column = 0; row != k && column < 4; column++) {
                a[column * 4 + row] -= factor * a[column * 4 + k];
                b[column * 4 + row] -= factor * b[column * 4 + k];
            }
        }
    }
    return true;
}

bool hw_mat4_inverse(hw_mat4 a, hw_mat4 *out)
{
    // Balanced first, so that the singularity threshold means the same for millimetres and
    // kilometres: with B = R A C (diagonal R, C), inverse(A) = C inverse(B) R.
    double r[4], c[4];
    hw_mat4 inverse = hw_mat4_identity();
    *out = inverse;
    for (int column = 0; column < 4; column++) {
        c[column] = balance(&a.m[column * 4], 1);
        for (int row = 0; row < 4; row++)
            a.m[column * 4 + row] *= c[column];
    }
    for (int row = 0; row < 4; row++) {
        r[row] = balance(&a.m[row], 4);
        for (int column = 0; column < 4; column++)
            a.m[column * 4 + row] *= r[row];
    }
    if (!eliminate(a.m, inverse.m))
        return false;
    for (int column = 0; column < 4; column++)
        for (int row = 0; row < 4; row++) {
            double *v = &inverse.m[column * 4 + row];
            *v *= c[row] * r[column];
            if (!isfinite(*v))
                return false;
        }
    *out = inverse;
    return true;
}

hw_mat4 hw_mat4_translation(double x, double y, double z)
{
    hw_mat4 m = hw_mat4_identity();
    m.m[12] = x;
    m.m[13] = y;
    m.m[14] = z;
    return m;
}

hw_mat4 hw_mat4_scale(double x, double y, double z)
{
    return (hw_mat4){{x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, 0, 0, 0, 1}};
}

hw_mat4 hw_mat4_rotation_z(double angle_rad)
{
    double c = cos(angle_rad), s = sin(angle_rad);
    return (hw_mat4){{c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}};
}

hw_vec3 hw_mat4_point(const hw_mat4 *m, hw_vec3 p)
{
    const double *a = m->m;
    return hw_v3((float)(a[0] * p.x + a[4] * p.y + a[8] * p.z + a[12]),
                 (float)(a[1] * p.x + a[5] * p.y + a[9] * p.z + a[13]),
                 (float)(a[2] * p.x + a[6] * p.y + a[10] * p.z + a[14]));
}

hw_vec3 hw_mat4_direction(const hw_mat4 *m, hw_vec3 d)
{
    const double *a = m->m;
    return hw_v3((float)(a[0] * d.x + a[4] * d.y + a[8] * d.z),
                 (float)(a[1] * d.x + a[5] * d.y + a[9] * d.z),
                 (float)(a[2] * d.x + a[6] * d.y + a[10] * d.z));
}

hw_vec3 hw_mat4_normal(const hw_mat4 *m, hw_vec3 n)
{
    // The inverse transpose is the cofactor matrix over the determinant; its columns are the cross
    // products of m's columns. Only the determinant's sign (a mirror) survives normalising.
    const double *x = &m->m[0], *y = &m->m[4], *z = &m->m[8];
    double yz[3], zx[3], xy[3], v[3];
    hw_cross(y, z, yz);
    hw_cross(z, x, zx);
    hw_cross(x, y, xy);
    double determinant = x[0] * yz[0] + x[1] * yz[1] + x[2] * yz[2];
    for (int i = 0; i < 3; i++)
        v[i] = yz[i] * n.x + zx[i] * n.y + xy[i] * n.z;
    double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    double s = (determinant < 0 ? -1 : 1) / (length > 0 ? length : 1);
    return hw_v3((float)(v[0] * s), (float)(v[1] * s), (float)(v[2] * s));
}

hw_box hw_mat4_box(const hw_mat4 *m, hw_box b)
{
    hw_box out = hw_box_empty();
    if (hw_box_is_empty(b))
        return out;
    for (uint32_t i = 0; i < 8; i++)
        hw_box_add(&out, hw_mat4_point(m, hw_box_corner(b, i)));
    return out;
}

void hw_mat4_to_float(const hw_mat4 *m, float out[16])
{
    for (int i = 0; i < 16; i++)
        out[i] = (float)m->m[i];
}

double hw_mat4_stretch(const hw_mat4 *m)
{
    double largest = 0;
    for (int i = 0; i < 3; i++) {
        double row = 0;
        for (int j = 0; j < 3; j++) {
            double dot = 0;
            for (int k = 0; k < 3; k++)
                dot += m->m[i * 4 + k] * m->m[j * 4 + k];
            row += fabs(dot);
        }
        largest = fmax(largest, row);
    }
    return sqrt(largest);
}

bool hw_mat4_mirrors(const hw_mat4 *m)
{
    const double *a = m->m, *b = m->m + 4, *c = m->m + 8;
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) +
               a[2] * (b[0] * c[1] - b[1] * c[0]) <
           0;
}
