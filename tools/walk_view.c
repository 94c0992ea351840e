#include "minimap.h"
#include "system.h"
#include "walk.h"
#include <math.h>
#include <string.h>

static hw_status draw_comparison(walk *w, const hw_camera *camera)
{
    if (!w->compare_view)
        HW_TRY(hw_compare_view_create(&w->compare_view));
    hw_compare_desc desc = {.mode = w->compare == WALK_SPLIT ? HW_COMPARE_SPLIT : HW_COMPARE_ERRORS,
                            .left = w->shown,
                            .right = w->renderers[HW_CONFIG_B],
                            .camera = camera,
                            .samples = walk_samples(),
                            .seam = w->seam,
                            .measure = w->compare == WALK_ERRORS};
    hw_compare_result result;
    HW_TRY(hw_compare_view_draw(w->compare_view, &desc, &result));
    w->stats = result.stats;
    w->psnr = result.psnr;
    return HW_OK;
}

hw_status walk_draw_view(walk *w, const hw_camera *camera)
{
    if (w->compare != WALK_PLAIN)
        return draw_comparison(w, camera);
    return hw_renderer_draw(w->shown, camera, &w->stats);
}

// ---- The HUD

static void format_line(const walk *w, const hw_camera *camera, char *out, size_t capacity)
{
    char views[256];
    walk_list_views(w, views, sizeof views);
    hw_cell_id cell = hw_hexgrid_locate(&w->walker.grid, camera->eye.x, camera->eye.y);
    const hw_stream_stats *stream = &w->stats.stream;
    hw_hud_info info = {.config = walk_config_title(w->config),
                        .fps = w->pace.fps,
                        .frame_ms = w->pace.frame_ms,
                        .p99_ms = w->pace.p99_ms,
                        .cell_q = w->config == HW_CONFIG_C ? w->stats.cell_q : cell.q,
                        .cell_r = w->config == HW_CONFIG_C ? w->stats.cell_r : cell.r,
                        .triangles = w->stats.triangles,
                        .draws = w->stats.draws,
                        .hidden = w->stats.hidden,
                        .ram_bytes = w->rss_bytes,
                        .waiting_bytes = stream->ram_bytes,
                        .waiting_budget_bytes = stream->ram_budget,
                        .gpu_bytes = hw_renderer_gpu_bytes(w->shown),
                        .gpu_budget_bytes = stream->gpu_budget,
                        .queue = stream->ram_budget > 0 ? (int64_t)stream->queued : -1,
                        .loaded_bytes_s = w->pace.bytes_s,
                        .stalls = w->stalls,
                        .late = w->missing_count,
                        .recorded_s = w->walker.recording ? w->walker.recorded_s : -1,
                        .views = views[0] ? views : NULL};
    hw_hud_format(&info, out, capacity);
}

static uint32_t error_legend(const walk *w, hw_hud_legend_row *rows)
{
    const uint32_t count = 5;
    for (uint32_t i = 0; i < count; i++) {
        double t = (double)i / (count - 1);
        hw_compare_error_color(t, rows[i].color);
        snprintf(rows[i].text, sizeof rows[i].text, "%s%.0f", i == count - 1 ? ">= " : "",
                 t * HW_COMPARE_SCALE);
    }
    rows[count] = (hw_hud_legend_row){.color = {0, 0, 0}};
    if (isfinite(w->psnr))
        snprintf(rows[count].text, sizeof rows[count].text, "PSNR %.1f dB", w->psnr);
    else
        snprintf(rows[count].text, sizeof rows[count].text, "equal");
    return count + 1;
}

static uint32_t tint_legend(const walk *w, hw_hud_legend_row *rows)
{
    static const struct {
        hw_representation first, last;
    } of[] = {[HW_CONFIG_A] = {HW_REPRESENTATION_FULL, HW_REPRESENTATION_FULL},
              [HW_CONFIG_B] = {HW_REPRESENTATION_FULL, HW_REPRESENTATION_FULL},
              [HW_CONFIG_L] = {HW_REPRESENTATION_LOD, HW_REPRESENTATION_LOD},
              [HW_CONFIG_C] = {HW_REPRESENTATION_NEAR, HW_REPRESENTATION_MVMESH}};
    uint32_t count = 0;
    for (int i = 0; i < HW_REPRESENTATION_COUNT; i++) {
        bool truth = w->compare != WALK_PLAIN && i == HW_REPRESENTATION_FULL;
        bool shown = i >= (int)of[w->config].first && i <= (int)of[w->config].last;
        if (!truth && !shown)
            continue;
        memcpy(rows[count].color, hw_representation_color((hw_representation)i),
               sizeof rows[count].color);
        snprintf(rows[count].text, sizeof rows[count].text, "%s",
                 hw_representation_name((hw_representation)i));
        count++;
    }
    return count;
}

static void draw_hud(walk *w, const hw_camera *camera)
{
    char line[768];
    hw_hud_legend_row legend[HW_HUD_LEGEND_MAX];
    bool says = hw_clock_ms() < w->message_until_ms;
    hw_hud_content content = {.message = w->arriving ? "Loading"
                                         : says      ? w->message
                                                     : NULL,
                              .help = w->show_help};
    hw_minimap map = {.grid = &w->walker.grid,
                      .boxes = w->boxes,
                      .box_count = w->box_count,
                      .camera = camera,
                      .frozen = w->debug.frozen ? &w->debug.camera : NULL};
    if (w->shown && w->show_line) {
        format_line(w, camera, line, sizeof line);
        content.line = line;
    }
    if (w->shown && w->show_map)
        content.map = &map;
    if (w->shown && w->compare == WALK_ERRORS)
        content.legend_count = error_legend(w, legend);
    else if (w->shown && w->debug.tint)
        content.legend_count = tint_legend(w, legend);
    content.legend = legend;
    hw_hud_draw(w->hud, w->input.width, w->input.height, &content);
}

// ---- The frame

// What could not be loaded: the best there is stays in view, and it is tried again.
static void watch_stream(walk *w)
{
    const hw_stream_stats *s = &w->stats.stream;
    w->loaded_bytes = 0;
    if (w->config != HW_CONFIG_C)
        return; // these have none
    w->missing_count += s->missing > 0;
    if (s->problem_count > w->problem_count)
        walk_say(w, 2 * WALK_MESSAGE_MS, "%s; it will be tried again", s->problem);
    w->problem_count = s->problem_count;
    w->loaded_bytes = s->read_bytes > w->read_bytes ? s->read_bytes - w->read_bytes : 0;
    w->read_bytes = s->read_bytes;
}

hw_status walk_draw_frame(walk *w)
{
    hw_camera camera = {0};
    hw_frame_stats load;
    bool ready = false;
    if (w->shown) {
        camera = hw_walker_camera(&w->walker, w->input.width, w->input.height);
        HW_TRY(hw_renderer_arrive(w->shown, &camera, &ready));
    }
    w->arriving = w->shown && !ready;
    if (!ready) {
        hw_hud_blank(w->hud);
        draw_hud(w, &camera);
        return HW_OK;
    }
    HW_TRY(hw_renderer_prepare(w->shown, &camera, &load));
    HW_TRY(walk_draw_view(w, &camera));
    watch_stream(w);
    w->stalls += load.stalls + w->stats.stalls;
    draw_hud(w, &camera);
    w->frame_count++;
    return HW_OK;
}
