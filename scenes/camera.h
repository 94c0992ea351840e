// A pinhole camera. Right-handed, looks along `forward`, z up.
#pragma once
#include "vec.h"

typedef struct hw_camera {
    hw_vec3 eye, forward,
        up;            // forward and up need not be unit length or orthogonal, but not parallel
    float fov_degrees; // vertical
    uint32_t width, height;   // pixels
    float near, far;          // 0 = HW_CAMERA_NEAR, HW_CAMERA_FAR
    float jitter_x, jitter_y; // shift of the image in pixels, for supersampling: +1 moves it right
                              // (x) or up (y) by one pixel
} hw_camera;

#define HW_CAMERA_NEAR 0.5f
#define HW_CAMERA_FAR  20000.0f

// World to eye (x right, y up, -z forward); eye to clip (GL: depth -1..1); and clip * view.
hw_mat4 hw_camera_view(const hw_camera *camera);
hw_mat4 hw_camera_projection(const hw_camera *camera);
hw_mat4 hw_camera_view_projection(const hw_camera *camera);
// height / (2 tan(fov / 2)): pixels per unit at distance 1.
double hw_camera_focal_px(const hw_camera *camera);

// Six frustum planes (a, b, c, d), (a, b, c) of unit length, a x + b y + c z + d >= 0 inside, in
// the order left, right, bottom, top, near, far; from a view-projection matrix.
typedef struct hw_frustum {
    double planes[6][4];
} hw_frustum;
hw_frustum hw_frustum_make(const hw_mat4 *view_projection);
// Conservative: false only if the box is wholly outside one plane.
bool hw_frustum_meets_box(const hw_frustum *frustum, hw_box box);
