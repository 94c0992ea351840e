// Draws MVMeshes: each by one or two of its captures, chosen by the directions from the object to
// the viewer and to where the captures were taken from (thesis 5.2.2). GL thread only.
#pragma once
#include "cell_gpu.h"
#include "crossing.h"
#include "renderer.h"

typedef struct hw_far_views_program {
    GLuint name;
    GLint clip, first, second, blend, kept;
} hw_far_views_program;

// Zero-initialise.
typedef struct hw_far_views_gl {
    hw_far_views_program single[HW_PHASES], blended[HW_PHASES], colored[HW_PHASES];
} hw_far_views_gl;

HW_MUST_USE hw_status hw_far_views_gl_create(hw_far_views_gl *out);
void hw_far_views_gl_destroy(hw_far_views_gl *gl);

// What all MVMeshes of a frame share.
typedef struct hw_far_views_frame {
    const hw_mat4 *matrix; // clip <- world
    hw_vec3 eye;
    hw_gpu_pace *pace;
    hw_frame_stats *stats;
} hw_far_views_frame;
// Draws some of the pixels of cell->records->far[index], an MVMesh. The cell's atlas and vertex
// array are bound already.
void hw_far_views_gl_draw(const hw_far_views_gl *gl, const hw_far_views_frame *frame,
                          const hw_cell_gpu *cell, uint32_t index, hw_kept kept);
