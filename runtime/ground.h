// What every configuration draws alike: the sky (the clear colour) and the ground. Both write alpha
// 0, so that objects can be told from them.
#pragma once
#include "gpu.h"
#include "renderer.h"

typedef struct hw_ground_gl {
    bool present;
    bool hides_nothing; // no object reaches below it: drawn first, it needs no depth
    float color[3];
    GLuint program, array;
    GLint clip_location, color_location;
    hw_gpu_buffer vertices;
} hw_ground_gl;

// objects: the box of all that will be drawn on it. On failure *out is zeroed.
HW_MUST_USE hw_status hw_ground_gl_create(hw_gpu_account *account, const hw_ground *ground,
                                          hw_box objects, hw_ground_gl *out);
void hw_ground_gl_destroy(hw_gpu_account *account, hw_ground_gl *ground);
// Starts a frame: the GL state all configurations draw with (depth test less, back faces culled,
// no blending) and the sky.
void hw_ground_gl_begin(void);
// Draws the ground, counting it in *stats. Comes first in a frame.
void hw_ground_gl_draw(const hw_ground_gl *ground, const hw_mat4 *view_projection,
                       hw_frame_stats *stats);
