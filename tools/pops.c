#include "pops.h"
#include "alloc.h"
#include "compare.h"
#include "crossing.h"
#include "hierarchy.h"
#include "system.h"
#include <glad/gl.h>
#include <math.h>

#define ITEMS_MAX   24  // crossings that are looked at
#define OFF_FRAMES  60  // from the border to where nothing jumps
#define NEAR_FRAMES 40  // to each side of a crossing, for which jumps are looked at
#define COST_LOOKS  400 // frames of the tour that are looked at for what dissolves cost
#define COST_ROUNDS 3

void hw_pops_free(hw_pops *pops)
{
    hw_free(pops->crossings);
    hw_free(pops->items);
    *pops = (hw_pops){0};
}

// ---- Crossings

static hw_cell_id cell_at(const hw_manifest *manifest, hw_vec3 eye)
{
    return hw_hexgrid_locate(&manifest->grid, (double)eye.x, (double)eye.y);
}

// Whether the tour changes cells between frame i and i + 1, and both are there: the dataset may
// have been built along another tour.
static bool crosses(const hw_manifest *manifest, const hw_tour *tour, uint32_t i)
{
    hw_cell_id from = cell_at(manifest, tour->frames[i].eye);
    hw_cell_id to = cell_at(manifest, tour->frames[i + 1].eye);
    return (from.q != to.q || from.r != to.r) && hw_manifest_find_cell(manifest, from, NULL) &&
           hw_manifest_find_cell(manifest, to, NULL);
}

hw_status hw_pops_find(const hw_manifest *manifest, const hw_tour *tour, hw_pops *out)
{
    *out = (hw_pops){.dissolve_cost = (double)NAN, .strip_share = (double)NAN};
    HW_TRY(HW_NEW(&out->crossings, tour->frame_count));
    for (uint32_t i = 0; i + 1 < tour->frame_count; i++)
        if (crosses(manifest, tour, i))
            out->crossings[out->crossing_count++] = (tour->frames[i].t + tour->frames[i + 1].t) / 2;
    return HW_OK;
}

// ---- Jumps

typedef struct observer {
    const hw_pops_desc *desc;
    size_t pixels;
    hw_image image;
    float *luma[2];
} observer;

static hw_camera camera_of(const hw_pops_desc *d, uint32_t frame)
{
    return hw_tour_camera(d->tour, frame, d->width, d->height);
}

static hw_status draw(const hw_pops_desc *d, hw_renderer *renderer, const hw_camera *camera)
{
    HW_TRY(hw_renderer_prepare(renderer, camera, NULL));
    hw_target_bind(d->target);
    return hw_renderer_draw(renderer, camera, NULL);
}

// The RMS change between two pictures that are drawn one after the other.
static hw_status look(observer *o, hw_renderer *renderer, const hw_camera *camera, int which)
{
    HW_TRY(draw(o->desc, renderer, camera));
    HW_TRY(hw_target_read(o->desc->target, &o->image));
    hw_luma(&o->image, o->luma[which]);
    return HW_OK;
}

static double change(const observer *o)
{
    size_t count;
    double sum = hw_squared_error(o->luma[0], o->luma[1], NULL, o->pixels, &count);
    return sqrt(sum / (double)count);
}

// From a frame to the next, as a viewer sees it.
static hw_status see(observer *o, hw_renderer *renderer, uint32_t frame, double *out)
{
    for (int i = 0; i < 2; i++) {
        hw_camera camera = camera_of(o->desc, frame + (uint32_t)i);
        HW_TRY(look(o, renderer, &camera, i));
    }
    *out = change(o);
    return HW_OK;
}

static hw_status see_hybrid(observer *o, uint32_t frame, bool hard, double *out)
{
    const hw_debug_view view = {.hard = hard};
    hw_renderer_set_debug_view(o->desc->hybrid, &view);
    return see(o, o->desc->hybrid, frame, out);
}

// What of that is not motion.
static hw_status see_jump(observer *o, uint32_t frame, bool hard, double *out)
{
    hw_camera camera = camera_of(o->desc, frame);
    for (int i = 0; i < 2; i++) {
        hw_debug_view view = {.hard = hard, .frozen = true, .camera = camera};
        view.camera.eye = o->desc->tour->frames[frame + (uint32_t)i].eye;
        hw_renderer_set_debug_view(o->desc->hybrid, &view);
        HW_TRY(look(o, o->desc->hybrid, &camera, i));
    }
    *out = change(o);
    return HW_OK;
}

// With dissolves, less (as if independent of it) the jump that the frame makes anyway because
// levels of detail change within a cell. That is looked for only where it matters: in a frame that
// jumps by more than `least`.
static hw_status see_dissolve(observer *o, uint32_t frame, double least, double *out)
{
    double levels = 0;
    HW_TRY(see_jump(o, frame, false, out));
    if (*out > least && !crosses(o->desc->manifest, o->desc->tour, frame))
        HW_TRY(see_jump(o, frame, true, &levels));
    *out = sqrt(fmax(*out * *out - levels * levels, 0));
    return HW_OK;
}

// The largest jump with dissolves of the frames round a crossing.
static hw_status see_soft_jump(observer *o, uint32_t frame, double *out)
{
    const hw_tour *tour = o->desc->tour;
    uint32_t first = frame > NEAR_FRAMES ? frame - NEAR_FRAMES : 0;
    *out = 0;
    for (uint32_t i = first; i < frame + NEAR_FRAMES && i + 1 < tour->frame_count; i++) {
        hw_cell_id id = cell_at(o->desc->manifest, tour->frames[i].eye);
        hw_cell_id next = cell_at(o->desc->manifest, tour->frames[i + 1].eye);
        double jump;
        if (!hw_manifest_find_cell(o->desc->manifest, id, NULL) ||
            !hw_manifest_find_cell(o->desc->manifest, next, NULL))
            continue;
        HW_TRY(see_dissolve(o, i, *out, &jump));
        *out = fmax(*out, jump);
    }
    return HW_OK;
}

// A frame of the same cell as this one, away from the border, that is followed by another of it;
// `frame` if there is none.
static uint32_t usual_frame(const hw_pops_desc *d, uint32_t frame)
{
    uint32_t away = frame > OFF_FRAMES ? frame - OFF_FRAMES : 0;
    hw_cell_id here = cell_at(d->manifest, d->tour->frames[frame].eye);
    while (away < frame) {
        hw_cell_id there = cell_at(d->manifest, d->tour->frames[away].eye);
        if (there.q == here.q && there.r == here.r && !crosses(d->manifest, d->tour, away))
            return away;
        away++;
    }
    return frame;
}

static hw_status observe(observer *o, uint32_t frame, hw_pop *out)
{
    const hw_debug_view plain = {0};
    const hw_pops_desc *d = o->desc;
    double truth;
    HW_TRY(see(o, d->truth, frame, &truth));
    HW_TRY(see_hybrid(o, frame, true, &out->hard));
    HW_TRY(see_hybrid(o, frame, false, &out->soft));
    out->hard -= truth;
    out->soft -= truth;
    HW_TRY(see_jump(o, frame, true, &out->hard_jump));
    uint32_t usual = usual_frame(d, frame);
    out->usual_jump = (double)NAN;
    if (usual != frame)
        HW_TRY(see_jump(o, usual, true, &out->usual_jump));
    HW_TRY(see_soft_jump(o, frame, &out->soft_jump));
    hw_renderer_set_debug_view(d->hybrid, &plain);
    return HW_OK;
}

static hw_status observe_all(observer *o, hw_pops *pops)
{
    const hw_pops_desc *d = o->desc;
    uint32_t wanted = pops->crossing_count < ITEMS_MAX ? pops->crossing_count : ITEMS_MAX;
    HW_TRY(HW_NEW(&pops->items, wanted));
    for (uint32_t i = 0, crossing = 0; i + 1 < d->tour->frame_count && pops->count < wanted; i++) {
        if (!crosses(d->manifest, d->tour, i))
            continue;
        if (crossing++ == (uint64_t)pops->count * pops->crossing_count / wanted) {
            pops->items[pops->count].t = pops->crossings[crossing - 1];
            HW_TRY(observe(o, i, &pops->items[pops->count]));
            pops->count++;
        }
    }
    return HW_OK;
}

// ---- Cost

static hw_status time_frame(const hw_pops_desc *d, const hw_camera *camera, bool hard, double *ms)
{
    const hw_debug_view view = {.hard = hard};
    hw_renderer_set_debug_view(d->hybrid, &view);
    HW_TRY(draw(d, d->hybrid, camera)); // warm
    glFinish();
    double start = hw_clock_ms();
    hw_target_bind(d->target);
    HW_TRY(hw_renderer_draw(d->hybrid, camera, NULL));
    hw_target_resolve(d->target);
    glFinish();
    *ms += hw_clock_ms() - start;
    return HW_OK;
}

static bool dissolves(const hw_manifest *manifest, hw_cell_id id, hw_vec3 eye)
{
    hw_crossing c = hw_crossing_at(&manifest->grid, id, eye, HW_CROSSING_WIDTH);
    uint32_t count = 0;
    for (uint32_t i = 0; i < c.count; i++)
        count += hw_manifest_find_cell(manifest, c.cells[i], NULL);
    return count > 1;
}

// Frames evenly over the tour: those in a strip are drawn with and without dissolves in turn;
// elsewhere there is no difference.
static hw_status measure_cost(const hw_pops_desc *d, hw_pops *pops)
{
    double soft = 0, hard = 0, elsewhere = 0;
    uint32_t looks = 0, inside = 0;
    uint32_t step = d->tour->frame_count / COST_LOOKS + 1;
    for (uint32_t i = 0; i < d->tour->frame_count; i += step) {
        hw_camera camera = camera_of(d, i);
        hw_cell_id id = cell_at(d->manifest, camera.eye);
        if (!hw_manifest_find_cell(d->manifest, id, NULL))
            continue;
        looks++;
        bool strip = dissolves(d->manifest, id, camera.eye);
        inside += strip;
        for (int round = 0; round < COST_ROUNDS; round++) {
            HW_TRY(time_frame(d, &camera, true, strip ? &hard : &elsewhere));
            if (strip)
                HW_TRY(time_frame(d, &camera, false, &soft));
        }
    }
    const hw_debug_view plain = {0};
    hw_renderer_set_debug_view(d->hybrid, &plain);
    pops->strip_share = looks ? (double)inside / looks : (double)NAN;
    pops->dissolve_cost = inside ? (soft - hard) / (hard + elsewhere) : 0;
    return HW_OK;
}

hw_status hw_pops_measure(const hw_pops_desc *desc, hw_pops *pops)
{
    observer o = {.desc = desc, .pixels = (size_t)desc->width * desc->height};
    hw_status status = HW_OK;
    HW_GO(HW_NEW(&o.luma[0], o.pixels));
    HW_GO(HW_NEW(&o.luma[1], o.pixels));
    HW_GO(observe_all(&o, pops));
    HW_GO(measure_cost(desc, pops));
out:
    hw_image_free(&o.image);
    hw_free(o.luma[0]);
    hw_free(o.luma[1]);
    return status;
}
