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
#define COST_LOOKS  400 // frames of the tour that are looked at for what dissolves cost
#define COST_ROUNDS 3

void hw_pops_free(hw_pops *pops)
{
    hw_free(pops->crossings);
    hw_free(pops->items);
    *pops = (hw_pops){0};
}

// ---- Crossings

// Whether the dataset has the cell; it may have been built along another tour.
static bool has_cell(const hw_manifest *manifest, hw_cell_id id)
{
    for (uint32_t i = 0; i < manifest->cell_count; i++) {
        hw_cell_id own = manifest->cells[i].id;
        if (own.level == id.level && own.q == id.q && own.r == id.r)
            return true;
    }
    return false;
}

static hw_cell_id cell_at(const hw_manifest *manifest, hw_vec3 eye)
{
    return hw_hexgrid_locate(&manifest->grid, (double)eye.x, (double)eye.y);
}

// Whether the tour changes cells between frame i and i + 1, and both are there.
static bool crosses(const hw_manifest *manifest, const hw_tour *tour, uint32_t i)
{
    hw_cell_id from = cell_at(manifest, tour->frames[i].eye);
    hw_cell_id to = cell_at(manifest, tour->frames[i + 1].eye);
    return (from.q != to.q || from.r != to.r) && has_cell(manifest, from) && has_cell(manifest, to);
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

typedef struct picture {
    hw_image image;
    float *luma;
} picture;

typedef struct observer {
    const hw_pops_desc *desc;
    size_t pixels;
    picture truth[2], hybrid[2]; // before and after
    float *errors[2];
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

static hw_status look(observer *o, hw_renderer *renderer, uint32_t frame, picture *out)
{
    hw_camera camera = camera_of(o->desc, frame);
    HW_TRY(draw(o->desc, renderer, &camera));
    HW_TRY(hw_target_read(o->desc->target, &out->image));
    hw_luma(&out->image, out->luma);
    return HW_OK;
}

static double rms(const observer *o, const float *a, const float *b)
{
    size_t count;
    double sum = hw_squared_error(a, b, NULL, o->pixels, &count);
    return sqrt(sum / (double)count);
}

static double change(const observer *o, const picture pictures[2])
{
    return rms(o, pictures[0].luma, pictures[1].luma);
}

static double error_change(observer *o)
{
    for (int i = 0; i < 2; i++)
        for (size_t p = 0; p < o->pixels; p++)
            o->errors[i][p] = o->hybrid[i].luma[p] - o->truth[i].luma[p];
    return rms(o, o->errors[0], o->errors[1]);
}

static hw_status look_twice(observer *o, hw_renderer *renderer, uint32_t frame, picture out[2])
{
    HW_TRY(look(o, renderer, frame, &out[0]));
    return look(o, renderer, frame + 1, &out[1]);
}

static hw_status look_hard(observer *o, uint32_t frame)
{
    const hw_debug_view hard = {.hard = true}, plain = {0};
    hw_renderer_set_debug_view(o->desc->hybrid, &hard);
    hw_status status = look_twice(o, o->desc->hybrid, frame, o->hybrid);
    hw_renderer_set_debug_view(o->desc->hybrid, &plain);
    return status;
}

// A frame of the same cell as this one, away from the border; this one if there is none.
static uint32_t usual_frame(const hw_pops_desc *d, uint32_t frame)
{
    uint32_t away = frame > OFF_FRAMES ? frame - OFF_FRAMES : 0;
    hw_cell_id here = cell_at(d->manifest, d->tour->frames[frame].eye);
    while (away < frame) {
        hw_cell_id there = cell_at(d->manifest, d->tour->frames[away].eye);
        if (there.q == here.q && there.r == here.r)
            return away;
        away++;
    }
    return frame > 0 ? frame - 1 : frame;
}

static hw_status observe(observer *o, uint32_t frame, hw_pop *out)
{
    const hw_pops_desc *d = o->desc;
    HW_TRY(look_twice(o, d->truth, frame, o->truth));
    double truth = change(o, o->truth);
    HW_TRY(look_hard(o, frame));
    out->hard = change(o, o->hybrid) - truth;
    out->hard_error = error_change(o);
    HW_TRY(look_twice(o, d->hybrid, frame, o->hybrid));
    out->soft = change(o, o->hybrid) - truth;
    out->soft_error = error_change(o);
    uint32_t usual = usual_frame(d, frame);
    HW_TRY(look_twice(o, d->truth, usual, o->truth));
    HW_TRY(look_hard(o, usual));
    out->usual_error = error_change(o);
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

// Of frames evenly over the tour, those in a strip are drawn with and without dissolves in turn;
// elsewhere there is no difference.
static hw_status measure_cost(const hw_pops_desc *d, hw_pops *pops)
{
    double soft = 0, hard = 0;
    uint32_t looks = 0, inside = 0;
    uint32_t step = d->tour->frame_count / COST_LOOKS + 1;
    for (uint32_t i = 0; i < d->tour->frame_count; i += step) {
        hw_camera camera = camera_of(d, i);
        hw_cell_id id = cell_at(d->manifest, camera.eye);
        if (!has_cell(d->manifest, id))
            continue;
        looks++;
        hw_crossing c = hw_crossing_at(&d->manifest->grid, id, camera.eye, HW_CROSSING_WIDTH);
        if (c.share == 0 || !has_cell(d->manifest, c.other))
            continue;
        inside++;
        for (int round = 0; round < COST_ROUNDS; round++) {
            HW_TRY(time_frame(d, &camera, true, &hard));
            HW_TRY(time_frame(d, &camera, false, &soft));
        }
    }
    const hw_debug_view plain = {0};
    hw_renderer_set_debug_view(d->hybrid, &plain);
    pops->strip_share = looks ? (double)inside / looks : (double)NAN;
    pops->dissolve_cost = inside ? (soft / hard - 1) * pops->strip_share : 0;
    return HW_OK;
}

hw_status hw_pops_measure(const hw_pops_desc *desc, hw_pops *pops)
{
    observer o = {.desc = desc, .pixels = (size_t)desc->width * desc->height};
    hw_status status = HW_OK;
    picture *const pictures[4] = {&o.truth[0], &o.truth[1], &o.hybrid[0], &o.hybrid[1]};
    for (int i = 0; i < 4; i++)
        HW_GO(HW_NEW(&pictures[i]->luma, o.pixels));
    HW_GO(HW_NEW(&o.errors[0], o.pixels));
    HW_GO(HW_NEW(&o.errors[1], o.pixels));
    HW_GO(observe_all(&o, pops));
    HW_GO(measure_cost(desc, pops));
out:
    for (int i = 0; i < 4; i++) {
        hw_image_free(&pictures[i]->image);
        hw_free(pictures[i]->luma);
    }
    hw_free(o.errors[0]);
    hw_free(o.errors[1]);
    return status;
}
