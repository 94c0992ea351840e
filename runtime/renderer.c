#include "renderer.h"
#include "alloc.h"
#include "renderer_internal.h"
#include <string.h>

struct hw_renderer {
    const hw_renderer_backend *backend;
    void *state;
    hw_gpu_account account;
    hw_debug_view debug;
};

static const struct {
    const char *name;
    const hw_renderer_backend *backend;
} configs[] = {
    [HW_CONFIG_A] = {"A", &hw_draw_all},
    [HW_CONFIG_B] = {"B", &hw_draw_culled},
    [HW_CONFIG_L] = {"L", &hw_draw_lod},
    [HW_CONFIG_C] = {"C", &hw_draw_hybrid},
};
#define CONFIG_COUNT (sizeof configs / sizeof *configs)

hw_status hw_renderer_create(const hw_renderer_desc *desc, hw_renderer **out)
{
    hw_renderer *renderer = NULL;
    *out = NULL;
    if (desc->config == HW_CONFIG_C && !desc->dataset)
        return hw_fail(HW_USAGE, "configuration C needs a dataset");
    if (desc->config != HW_CONFIG_C && !desc->scene) {
        return hw_fail(HW_USAGE, "configuration %s needs the original scene",
                       hw_config_name(desc->config));
    }
    HW_TRY(HW_NEW(&renderer, 1));
    renderer->backend = configs[desc->config].backend;
    hw_status status =
        renderer->backend->create(desc, &renderer->account, &renderer->debug, &renderer->state);
    if (status != HW_OK) {
        hw_free(renderer);
        return status;
    }
    *out = renderer;
    return HW_OK;
}

void hw_renderer_destroy(hw_renderer *renderer)
{
    if (!renderer)
        return;
    renderer->backend->destroy(renderer->state);
    hw_free(renderer);
}

hw_status hw_renderer_arrive(hw_renderer *renderer, const hw_camera *camera, bool *ready)
{
    *ready = true;
    return renderer->backend->arrive ? renderer->backend->arrive(renderer->state, camera, ready)
                                     : HW_OK;
}

hw_status hw_renderer_prepare(hw_renderer *renderer, const hw_camera *camera, hw_frame_stats *stats)
{
    hw_frame_stats own = {0};
    hw_status status = HW_OK;
    if (renderer->backend->prepare)
        status = renderer->backend->prepare(renderer->state, camera, &own);
    if (stats)
        *stats = own;
    return status;
}

hw_status hw_renderer_draw(hw_renderer *renderer, const hw_camera *camera, hw_frame_stats *stats)
{
    hw_frame_stats own = {0};
    hw_debug_begin(&renderer->debug);
    hw_status status = renderer->backend->draw(renderer->state, camera, &own);
    hw_debug_end(&renderer->debug);
    if (stats)
        *stats = own;
    HW_TRY(status);
    return hw_gpu_check("drawing a frame");
}

void hw_renderer_set_debug_view(hw_renderer *renderer, const hw_debug_view *view)
{
    renderer->debug = *view;
}

void hw_renderer_advance(hw_renderer *renderer, double dt_s)
{
    if (renderer->backend->advance)
        renderer->backend->advance(renderer->state, dt_s);
}

uint64_t hw_renderer_gpu_bytes(const hw_renderer *renderer)
{
    return renderer->account.bytes;
}

uint64_t hw_renderer_gpu_bytes_peak(const hw_renderer *renderer)
{
    return renderer->account.bytes_peak;
}

const char *hw_config_name(hw_config config)
{
    return configs[config].name;
}

bool hw_config_parse(const char *text, hw_config *out)
{
    for (size_t i = 0; i < CONFIG_COUNT; i++) {
        if (strcmp(text, configs[i].name) == 0) {
            *out = (hw_config)i;
            return true;
        }
    }
    return false;
}
