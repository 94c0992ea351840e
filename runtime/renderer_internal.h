// What a configuration provides to renderer.c.
#pragma once
#include "gpu.h"
#include "renderer.h"

typedef struct hw_renderer_backend {
    // Puts the configuration's own state into *state; on failure nothing is left behind. The debug
    // view, for hw_debug_tint and hw_debug_culling_camera, stays where it is and may change between
    // frames.
    hw_status (*create)(const hw_renderer_desc *desc, hw_gpu_account *account,
                        const hw_debug_view *debug, void **state);
    void (*destroy)(void *state);
    // As in renderer.h; *stats comes zeroed. arrive and prepare may be NULL.
    hw_status (*arrive)(void *state, const hw_camera *camera, bool *ready);
    hw_status (*prepare)(void *state, const hw_camera *camera, hw_frame_stats *stats);
    hw_status (*draw)(void *state, const hw_camera *camera, hw_frame_stats *stats);
    void (*advance)(void *state, double dt_s); // may be NULL
} hw_renderer_backend;

extern const hw_renderer_backend hw_draw_all, hw_draw_culled, hw_draw_lod, hw_draw_hybrid;
