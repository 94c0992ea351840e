#include "measure.h"
#include "alloc.h"
#include "compare.h"
#include "context.h"
#include "log.h"
#include "system.h"
#include "target.h"
#include <glad/gl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ROUNDS_MAX 100
#define OPAQUE     128 // from this alpha on a pixel belongs to an object

// Owns everything but the description and the report.
typedef struct measurer {
    const hw_measure_desc *desc;
    hw_report *report;
    hw_context *context;
    hw_target *target;       // of the configurations
    hw_target *truth_target; // one sample; the same as `target` if that has one too
    hw_renderer *renderers[HW_REPORT_CONFIGS]; // by hw_config; B always, it draws the truth
    hw_image truth, shots[HW_REPORT_CONFIGS], scratch;
    float *luma_truth, *luma_reference, *luma[HW_REPORT_CONFIGS];
    uint32_t *sums;   // of the reference's samples, 3 a pixel
    uint8_t *mask;    // pixels that either image covers with an object
    uint8_t *holes;   // pixels that truth covers with an object and the image does not
    uint32_t *stack;  // for flooding them
    double *round_ms; // ROUNDS_MAX for each configuration
    size_t pixels;
} measurer;

// ---- Set-up

static hw_status make_renderer(measurer *m, hw_config config)
{
    const hw_renderer_desc desc = {.config = config,
                                   .dataset = m->desc->dataset,
                                   .scene = m->desc->scene,
                                   .lod_error_px = m->report->lod_error_px,
                                   .near_triangles = m->report->near_triangles,
                                   .hide = m->report->hide,
                                   .crossing_width = HW_CROSSING_WIDTH};
    return m->renderers[config] ? HW_OK : hw_renderer_create(&desc, &m->renderers[config]);
}

static hw_status make_graphics(measurer *m)
{
    const hw_report *r = m->report;
    const hw_context_desc desc = {.kind = HW_CONTEXT_OFFSCREEN, .width = 16, .height = 16};
    HW_TRY(hw_context_create(&desc, &m->context));
    HW_TRY(hw_strdup(&m->report->gl_renderer, hw_context_renderer(m->context)));
    HW_TRY(hw_target_create(&m->target, r->width, r->height, r->samples));
    if (r->samples > 1)
        HW_TRY(hw_target_create(&m->truth_target, r->width, r->height, 1));
    else
        m->truth_target = m->target;
    HW_TRY(make_renderer(m, HW_CONFIG_B));
    for (uint32_t c = 0; c < r->config_count; c++)
        HW_TRY(make_renderer(m, r->configs[c].config));
    return HW_OK;
}

static hw_status make_buffers(measurer *m)
{
    m->pixels = (size_t)m->report->width * m->report->height;
    HW_TRY(HW_NEW(&m->luma_truth, m->pixels));
    HW_TRY(HW_NEW(&m->luma_reference, m->pixels));
    for (uint32_t c = 0; c < m->report->config_count; c++)
        HW_TRY(HW_NEW(&m->luma[c], m->pixels));
    HW_TRY(hw_alloc((void **)&m->sums, m->pixels, 3 * sizeof *m->sums));
    HW_TRY(HW_NEW(&m->mask, m->pixels));
    HW_TRY(HW_NEW(&m->holes, m->pixels));
    HW_TRY(HW_NEW(&m->stack, m->pixels));
    return HW_NEW(&m->round_ms, HW_REPORT_CONFIGS * ROUNDS_MAX);
}

static void clean_up(measurer *m)
{
    for (int c = 0; c < HW_REPORT_CONFIGS; c++) {
        hw_renderer_destroy(m->renderers[c]);
        hw_image_free(&m->shots[c]);
        hw_free(m->luma[c]);
    }
    if (m->truth_target != m->target)
        hw_target_destroy(m->truth_target);
    hw_target_destroy(m->target);
    hw_context_destroy(m->context);
    hw_image_free(&m->truth);
    hw_image_free(&m->scratch);
    hw_free(m->luma_truth);
    hw_free(m->luma_reference);
    hw_free(m->sums);
    hw_free(m->mask);
    hw_free(m->round_ms);
    hw_free(m->holes);
    hw_free(m->stack);
}

static hw_camera camera_of(const measurer *m, uint32_t tour_frame)
{
    return hw_tour_camera(m->desc->tour, tour_frame, m->report->width, m->report->height);
}

// ---- Truth

static hw_status draw_image(measurer *m, hw_config config, const hw_camera *camera,
                            hw_target *target, hw_image *out)
{
    HW_TRY(hw_renderer_prepare(m->renderers[config], camera, NULL));
    hw_target_bind(target);
    HW_TRY(hw_renderer_draw(m->renderers[config], camera, NULL));
    return hw_target_read(target, out);
}

static hw_status draw_truth(measurer *m, const hw_camera *camera, hw_image *out)
{
    return draw_image(m, HW_CONFIG_B, camera, m->truth_target, out);
}

// i with its bits mirrored about the binary point (van der Corput).
static double radical_inverse(uint32_t i)
{
    double value = 0;
    for (double bit = 0.5; i; i >>= 1, bit /= 2)
        value += i & 1 ? bit : 0;
    return value;
}

// Sample i of n within the pixel, in [-0.5, 0.5]: the Hammersley set, moved so that its mean is the
// pixel's centre.
static void sample_offset(uint32_t i, uint32_t n, float out[2])
{
    double mean = 0;
    for (uint32_t k = 0; k < n; k++)
        mean += radical_inverse(k) / n;
    out[0] = (float)((i + 0.5) / n - 0.5);
    out[1] = (float)(radical_inverse(i) - mean);
}

// The mean of many one-sample images: luma_reference.
static hw_status draw_reference(measurer *m, const hw_camera *camera)
{
    uint32_t n = m->report->reference_samples;
    memset(m->sums, 0, m->pixels * 3 * sizeof *m->sums);
    for (uint32_t i = 0; i < n; i++) {
        hw_camera shifted = *camera;
        float offset[2];
        sample_offset(i, n, offset);
        shifted.jitter_x = offset[0];
        shifted.jitter_y = offset[1];
        HW_TRY(draw_truth(m, &shifted, &m->scratch));
        for (size_t p = 0; p < m->pixels; p++)
            for (size_t k = 0; k < 3; k++)
                m->sums[p * 3 + k] += m->scratch.data[p * 4 + k];
    }
    for (size_t p = 0; p < m->pixels; p++) {
        const uint32_t *s = m->sums + p * 3;
        m->luma_reference[p] = (float)((0.299 * s[0] + 0.587 * s[1] + 0.114 * s[2]) / (double)n);
    }
    return HW_OK;
}

// ---- Time

static void add(double *value, double amount)
{
    *value = isnan(*value) ? amount : *value + amount;
}

// A preparation that had to read would have been a stall without it.
static void count_loading(hw_report_sample *sample, const hw_frame_stats *stats)
{
    double *v = sample->values;
    add(&v[HW_METRIC_LOAD_BYTES], (double)stats->loaded_bytes);
    add(&v[HW_METRIC_LOAD_MS], stats->load_ms);
    if (stats->loaded_bytes > 0 || stats->stalls > 0)
        v[HW_METRIC_STALLS] = 1;
    else
        add(&v[HW_METRIC_STALLS], 0);
}

static hw_status draw_timed(measurer *m, uint32_t c, const hw_camera *camera,
                            hw_report_sample *sample, double *ms)
{
    hw_frame_stats stats = {0};
    hw_target_bind(m->target);
    glFinish();
    double start = hw_clock_ms();
    HW_TRY(hw_renderer_draw(m->renderers[m->report->configs[c].config], camera, &stats));
    hw_target_resolve(m->target);
    glFinish();
    *ms = hw_clock_ms() - start;
    double *v = sample->values;
    v[HW_METRIC_TRIANGLES] = (double)stats.triangles;
    v[HW_METRIC_DRAWS] = stats.draws;
    v[HW_METRIC_NEAR_TRIANGLES] = stats.near_triangles;
    v[HW_METRIC_FAR_TRIANGLES] = stats.far_triangles;
    count_loading(sample, &stats);
    return HW_OK;
}

// All configurations take turns. As in a walk, where the frame before was of the same
// configuration, each turn draws the frame once untimed and then timed: else a short frame would
// pay for what a long one of another configuration left in the caches. The last round leaves the
// images.
static hw_status time_frame(measurer *m, uint32_t frame, const hw_camera *camera)
{
    hw_report *r = m->report;
    for (uint32_t c = 0; c < r->config_count; c++) {
        hw_frame_stats stats = {0};
        HW_TRY(hw_renderer_prepare(m->renderers[r->configs[c].config], camera, &stats));
        count_loading(&r->configs[c].samples[frame], &stats);
    }
    for (uint32_t round = 0; round < r->repeat; round++)
        for (uint32_t c = 0; c < r->config_count; c++) {
            double *ms = &m->round_ms[c * ROUNDS_MAX + round];
            HW_TRY(draw_timed(m, c, camera, &r->configs[c].samples[frame], ms));
            HW_TRY(draw_timed(m, c, camera, &r->configs[c].samples[frame], ms));
            if (round + 1 == r->repeat)
                HW_TRY(hw_target_read(m->target, &m->shots[c]));
        }
    for (uint32_t c = 0; c < r->config_count; c++) {
        hw_summary rounds;
        HW_TRY(hw_summarize(m->round_ms + c * ROUNDS_MAX, 1, r->repeat, &rounds));
        r->configs[c].samples[frame].values[HW_METRIC_FRAME_MS] = rounds.median;
    }
    return HW_OK;
}

// ---- Quality

static double psnr(const float *a, const float *b, const uint8_t *mask, size_t pixels)
{
    size_t count;
    double sum = hw_squared_error(a, b, mask, pixels, &count);
    return count ? hw_psnr(sum / (double)count) : (double)NAN;
}

// NaN where SSIM is not defined: tiny images, no object in view.
static hw_status ssim(const measurer *m, const float *a, const float *b, const uint8_t *mask,
                      double *out)
{
    hw_status status = hw_ssim(a, b, m->report->width, m->report->height, mask, out);
    if (status == HW_USAGE)
        *out = (double)NAN;
    return status == HW_USAGE ? HW_OK : status;
}

// Clears the hole round a pixel, through its four neighbours; returns how many pixels it had.
static size_t flood_hole(measurer *m, size_t start)
{
    uint32_t width = m->report->width;
    size_t count = 0, top = 0;
    m->holes[start] = 0;
    m->stack[top++] = (uint32_t)start;
    while (top > 0) {
        size_t p = m->stack[--top], x = p % width;
        const bool inside[4] = {x > 0, x + 1 < width, p >= width, p + width < m->pixels};
        const size_t next[4] = {p - 1, p + 1, p - width, p + width};
        count++;
        for (int i = 0; i < 4; i++) {
            if (!inside[i] || !m->holes[next[i]])
                continue;
            m->holes[next[i]] = 0;
            m->stack[top++] = (uint32_t)next[i];
        }
    }
    return count;
}

static size_t largest_hole(measurer *m)
{
    size_t largest = 0;
    for (size_t p = 0; p < m->pixels; p++) {
        size_t count = m->holes[p] ? flood_hole(m, p) : 0;
        largest = count > largest ? count : largest;
    }
    return largest;
}

static hw_status judge(measurer *m, uint32_t c, double *values)
{
    const hw_image *image = &m->shots[c];
    float *luma = m->luma[c];
    size_t holes = 0;
    hw_luma(image, luma);
    for (size_t p = 0; p < m->pixels; p++) {
        uint8_t truth = m->truth.data[p * 4 + 3], own = image->data[p * 4 + 3];
        m->mask[p] = truth >= OPAQUE || own >= OPAQUE;
        m->holes[p] = truth >= OPAQUE && own == 0;
        holes += m->holes[p];
    }
    values[HW_METRIC_HOLE_PIXELS] = (double)holes;
    values[HW_METRIC_HOLE_LARGEST] = (double)largest_hole(m);
    values[HW_METRIC_PSNR_1SPP] = psnr(luma, m->luma_truth, NULL, m->pixels);
    values[HW_METRIC_PSNR_OBJECTS] = psnr(luma, m->luma_truth, m->mask, m->pixels);
    values[HW_METRIC_PSNR_REFERENCE] = psnr(luma, m->luma_reference, NULL, m->pixels);
    HW_TRY(ssim(m, luma, m->luma_reference, NULL, &values[HW_METRIC_SSIM_REFERENCE]));
    return ssim(m, luma, m->luma_truth, m->mask, &values[HW_METRIC_SSIM_OBJECTS]);
}

static hw_status measure_frame(measurer *m, uint32_t frame)
{
    hw_report *r = m->report;
    hw_camera camera = camera_of(m, r->frames[frame].tour_frame);
    HW_TRY(draw_truth(m, &camera, &m->truth));
    hw_luma(&m->truth, m->luma_truth);
    HW_TRY(draw_reference(m, &camera));
    HW_TRY(time_frame(m, frame, &camera));
    for (uint32_t c = 0; c < r->config_count; c++)
        HW_TRY(judge(m, c, r->configs[c].samples[frame].values));
    return HW_OK;
}

static hw_status choose_frames(measurer *m)
{
    hw_report *r = m->report;
    const hw_tour *tour = m->desc->tour;
    HW_TRY(hw_report_make_samples(r, (tour->frame_count + r->every - 1) / r->every));
    for (uint32_t i = 0; i < r->frame_count; i++) {
        const hw_tour_frame *from = &tour->frames[i * r->every];
        r->frames[i].tour_frame = i * r->every;
        r->frames[i].t = from->t;
        r->frames[i].cell =
            hw_hexgrid_locate(&m->desc->manifest->grid, (double)from->eye.x, (double)from->eye.y);
    }
    return HW_OK;
}

static hw_status measure_frames(measurer *m)
{
    hw_progress *progress = NULL;
    hw_status status = HW_OK;
    HW_GO(hw_progress_create(&progress, "measuring", m->report->frame_count));
    for (uint32_t i = 0; i < m->report->frame_count; i++) {
        HW_GO(measure_frame(m, i));
        hw_progress_add(progress, 1);
    }
out:
    hw_progress_destroy(progress);
    return status;
}

// ---- Pops

static hw_status measure_pops(measurer *m)
{
    const hw_pops_desc desc = {.manifest = m->desc->manifest,
                               .tour = m->desc->tour,
                               .width = m->report->width,
                               .height = m->report->height,
                               .truth = m->renderers[HW_CONFIG_B],
                               .hybrid = m->renderers[HW_CONFIG_C],
                               .target = m->target};
    return desc.hybrid ? hw_pops_measure(&desc, &m->report->pops) : HW_OK;
}

// ---- Pictures

typedef struct ranked {
    double psnr;
    uint32_t frame;
} ranked;

static int compare_ranked(const void *a, const void *b)
{
    const ranked *x = a, *y = b;
    int order = (x->psnr > y->psnr) - (x->psnr < y->psnr);
    return order ? order : (x->frame > y->frame) - (x->frame < y->frame);
}

static hw_status take_picture(measurer *m, hw_config config, const char *rank, uint32_t frame)
{
    hw_report *r = m->report;
    hw_report_picture *picture = &r->pictures[r->picture_count++];
    hw_camera camera = camera_of(m, r->frames[frame].tour_frame);
    picture->config = config;
    picture->rank = rank;
    picture->frame = frame;
    HW_TRY(draw_truth(m, &camera, &picture->truth));
    return draw_image(m, config, &camera, m->target, &picture->image);
}

static hw_status take_pictures(measurer *m, hw_config config)
{
    static const char *const ranks[] = {"Worst", "Median", "Best"};
    const hw_report *r = m->report;
    const hw_report_config *c = hw_report_find(r, config);
    ranked *order = NULL;
    hw_status status = HW_OK;
    if (!c)
        return HW_OK;
    HW_TRY(HW_NEW(&order, r->frame_count));
    for (uint32_t i = 0; i < r->frame_count; i++)
        order[i] = (ranked){c->samples[i].values[HW_METRIC_PSNR_1SPP], i};
    qsort(order, r->frame_count, sizeof *order, compare_ranked);
    const uint32_t picks[] = {0, r->frame_count / 2, r->frame_count - 1};
    for (int i = 0; i < 3; i++)
        // Of few frames one may hold several ranks; it is shown once.
        if (i == 0 || picks[i] != picks[i - 1])
            HW_GO(take_picture(m, config, ranks[i], order[picks[i]].frame));
out:
    hw_free(order);
    return status;
}

static void read_gpu_peaks(measurer *m)
{
    hw_report *r = m->report;
    for (uint32_t c = 0; c < r->config_count; c++)
        r->configs[c].gpu_bytes_peak =
            hw_renderer_gpu_bytes_peak(m->renderers[r->configs[c].config]);
}

// After all else, and without the other configurations' buffers.
static hw_status measure_streaming(measurer *m)
{
    if (!m->desc->streaming)
        return HW_OK;
    for (int c = 0; c < HW_REPORT_CONFIGS; c++) {
        hw_renderer_destroy(m->renderers[c]);
        m->renderers[c] = NULL;
    }
    hw_status status = hw_streaming_measure(m->desc->streaming, &m->report->streaming);
    m->report->streamed = status == HW_OK;
    if (status == HW_OK || status == HW_MEMORY)
        return status;
    // All else is known.
    hw_streaming_free(&m->report->streaming);
    return hw_report_warn(m->report, "Streaming could not be measured: %s.", hw_error_text());
}

hw_status hw_measure_run(const hw_measure_desc *desc, hw_report *report)
{
    measurer m = {.desc = desc, .report = report};
    hw_status status = HW_OK;
    HW_GO(choose_frames(&m));
    HW_GO(hw_pops_find(desc->manifest, desc->tour, &report->pops));
    HW_GO(make_graphics(&m));
    HW_GO(make_buffers(&m));
    HW_GO(measure_frames(&m));
    HW_GO(measure_pops(&m));
    HW_GO(take_pictures(&m, HW_CONFIG_C));
    HW_GO(take_pictures(&m, HW_CONFIG_L));
    read_gpu_peaks(&m);
    HW_GO(measure_streaming(&m));
out:
    clean_up(&m);
    return status;
}
