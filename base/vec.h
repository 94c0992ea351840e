// Small vectors, boxes and double-precision 4x4 matrices. Matrices are double because image-space
// vertices go through T2 * inverse(T1) with kilometre-sized scenes and 1/32 pixel demands; they are
// cast to float only at upload.
#pragma once
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#define HW_PI 3.14159265358979323846

typedef struct hw_vec3 {
    float x, y, z;
} hw_vec3;

static inline hw_vec3 hw_v3(float x, float y, float z)
{
    return (hw_vec3){x, y, z};
}
static inline hw_vec3 hw_v3_add(hw_vec3 a, hw_vec3 b)
{
    return hw_v3(a.x + b.x, a.y + b.y, a.z + b.z);
}
static inline hw_vec3 hw_v3_sub(hw_vec3 a, hw_vec3 b)
{
    return hw_v3(a.x - b.x, a.y - b.y, a.z - b.z);
}
static inline hw_vec3 hw_v3_scale(hw_vec3 a, float s)
{
    return hw_v3(a.x * s, a.y * s, a.z * s);
}
static inline hw_vec3 hw_v3_mad(hw_vec3 a, hw_vec3 b, float s)
{
    return hw_v3(a.x + b.x * s, a.y + b.y * s, a.z + b.z * s);
}
static inline float hw_v3_dot(hw_vec3 a, hw_vec3 b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
static inline hw_vec3 hw_v3_cross(hw_vec3 a, hw_vec3 b)
{
    return hw_v3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static inline float hw_v3_length(hw_vec3 a)
{
    return sqrtf(hw_v3_dot(a, a));
}
// The zero vector stays zero.
static inline hw_vec3 hw_v3_normalize(hw_vec3 a)
{
    float l = hw_v3_length(a);
    return l > 0 ? hw_v3_scale(a, 1 / l) : a;
}
static inline hw_vec3 hw_v3_min(hw_vec3 a, hw_vec3 b)
{
    return hw_v3(fminf(a.x, b.x), fminf(a.y, b.y), fminf(a.z, b.z));
}
static inline hw_vec3 hw_v3_max(hw_vec3 a, hw_vec3 b)
{
    return hw_v3(fmaxf(a.x, b.x), fmaxf(a.y, b.y), fmaxf(a.z, b.z));
}
static inline bool hw_v3_finite(hw_vec3 a)
{
    return isfinite(a.x) && isfinite(a.y) && isfinite(a.z);
}

// Axis-aligned box; empty while min > max.
typedef struct hw_box {
    hw_vec3 min, max;
} hw_box;

static inline hw_box hw_box_empty(void)
{
    return (hw_box){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
}
static inline bool hw_box_is_empty(hw_box b)
{
    return !(b.min.x <= b.max.x);
}
static inline void hw_box_add(hw_box *b, hw_vec3 p)
{
    b->min = hw_v3_min(b->min, p);
    b->max = hw_v3_max(b->max, p);
}
static inline hw_box hw_box_union(hw_box a, hw_box b)
{
    return (hw_box){hw_v3_min(a.min, b.min), hw_v3_max(a.max, b.max)};
}
static inline hw_vec3 hw_box_centre(hw_box b)
{
    return hw_v3_scale(hw_v3_add(b.min, b.max), 0.5f);
}
static inline hw_vec3 hw_box_size(hw_box b)
{
    return hw_v3_sub(b.max, b.min);
}
static inline float hw_box_diagonal(hw_box b)
{
    return hw_v3_length(hw_box_size(b));
}
// Corner i in 0..7: bit 0 picks max x, bit 1 max y, bit 2 max z.
static inline hw_vec3 hw_box_corner(hw_box b, uint32_t i)
{
    return hw_v3(i & 1 ? b.max.x : b.min.x, i & 2 ? b.max.y : b.min.y, i & 4 ? b.max.z : b.min.z);
}

// Column-major: element (row, column) is m[column * 4 + row]; v' = M v.
typedef struct hw_mat4 {
    double m[16];
} hw_mat4;

hw_mat4 hw_mat4_identity(void);
// a * b: first b, then a.
hw_mat4 hw_mat4_mul(hw_mat4 a, hw_mat4 b);
// False (and *out the identity) when singular.
bool hw_mat4_inverse(hw_mat4 a, hw_mat4 *out);
// out = a x b, in double; out is none of them.
static inline void hw_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

// The largest factor by which an affine matrix stretches a length: exact for rotations with uniform
// scale, else an upper bound (Gershgorin's on A^T A).
double hw_mat4_stretch(const hw_mat4 *m);
// Whether it mirrors (determinant of the upper 3x3 below 0), so that front faces turn clockwise.
bool hw_mat4_mirrors(const hw_mat4 *m);
hw_mat4 hw_mat4_translation(double x, double y, double z);
hw_mat4 hw_mat4_scale(double x, double y, double z);
hw_mat4 hw_mat4_rotation_z(double angle_rad);
// Affine point and direction.
hw_vec3 hw_mat4_point(const hw_mat4 *m, hw_vec3 p);
hw_vec3 hw_mat4_direction(const hw_mat4 *m, hw_vec3 d);
// A normal under the inverse transpose of the upper 3x3 (of a non-singular m), normalised.
hw_vec3 hw_mat4_normal(const hw_mat4 *m, hw_vec3 n);
// The transformed box's bounding box.
hw_box hw_mat4_box(const hw_mat4 *m, hw_box b);
// For glUniformMatrix4fv and uniform blocks.
void hw_mat4_to_float(const hw_mat4 *m, float out[16]);
