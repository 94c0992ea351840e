#include "camera.h"
#include <stddef.h>

typedef struct basis {
    double right[3], up[3], back[3];
} basis;

static void normalize(double a[3])
{
    double l = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    for (int k = 0; l > 0 && k < 3; k++)
        a[k] /= l;
}

static basis basis_of(const hw_camera *c)
{
    basis b = {.back = {-(double)c->forward.x, -(double)c->forward.y, -(double)c->forward.z}};
    const double up[3] = {c->up.x, c->up.y, c->up.z};
    normalize(b.back);
    hw_cross(up, b.back, b.right);
    normalize(b.right);
    hw_cross(b.back, b.right, b.up);
    return b;
}

hw_mat4 hw_camera_view(const hw_camera *c)
{
    basis b = basis_of(c);
    const double *rows[3] = {b.right, b.up, b.back};
    hw_mat4 v = {{0}};
    for (int r = 0; r < 3; r++) {
        for (int k = 0; k < 3; k++)
            v.m[k * 4 + r] = rows[r][k];
        v.m[12 + r] = -(rows[r][0] * c->eye.x + rows[r][1] * c->eye.y + rows[r][2] * c->eye.z);
    }
    v.m[15] = 1;
    return v;
}

static double half_tangent(const hw_camera *c)
{
    return tan((double)c->fov_degrees * HW_PI / 360);
}

hw_mat4 hw_camera_projection(const hw_camera *c)
{
    double near = c->near > 0 ? c->near : HW_CAMERA_NEAR;
    double far = c->far > 0 ? c->far : HW_CAMERA_FAR;
    double f = 1 / half_tangent(c), aspect = (double)c->width / c->height;
    hw_mat4 p = {{0}};
    p.m[0] = f / aspect;
    p.m[5] = f;
    p.m[10] = (far + near) / (near - far);
    p.m[14] = 2 * far * near / (near - far);
    p.m[11] = -1;
    // w = -z: a shift by s in normalised device coordinates is -s in the column of z.
    p.m[8] = -2 * (double)c->jitter_x / c->width;
    p.m[9] = -2 * (double)c->jitter_y / c->height;
    return p;
}

hw_mat4 hw_camera_view_projection(const hw_camera *camera)
{
    return hw_mat4_mul(hw_camera_projection(camera), hw_camera_view(camera));
}

double hw_camera_focal_px(const hw_camera *camera)
{
    return camera->height / (2 * half_tangent(camera));
}

// Gribb and Hartmann 2001: -w <= x <= w and so on are sums and differences of the matrix's rows.
hw_frustum hw_frustum_make(const hw_mat4 *view_projection)
{
    const double *m = view_projection->m;
    hw_frustum frustum;
    for (int i = 0; i < 6; i++) {
        double sign = i & 1 ? -1 : 1, *plane = frustum.planes[i];
        for (int k = 0; k < 4; k++)
            plane[k] = m[k * 4 + 3] + sign * m[k * 4 + i / 2];
        double l = sqrt(plane[0] * plane[0] + plane[1] * plane[1] + plane[2] * plane[2]);
        for (int k = 0; l > 0 && k < 4; k++)
            plane[k] /= l;
    }
    return frustum;
}

bool hw_frustum_meets_box(const hw_frustum *frustum, hw_box box)
{
    for (int i = 0; i < 6; i++) {
        const double *p =
            frustum->planes[i]; // against the corner farthest along the plane's normal
        double d = p[0] * (p[0] > 0 ? box.max.x : box.min.x) +
                   p[1] * (p[1] > 0 ? box.max.y : box.min.y) +
                   p[2] * (p[2] > 0 ? box.max.z : box.min.z) + p[3];
        if (d < 0)
            return false;
    }
    return true;
}
