#include "streaming.h"
#include "alloc.h"
#include "log.h"
#include "renderer.h"
#include "report.h"
#include "source.h"
#include "system.h"
#include "target.h"
#include "walker.h"
#include <fcntl.h>
#include <ftw.h>
#include <glad/gl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define SLOW_MEDIANS 3.0

typedef struct plan {
    const char *key, *title;
    hw_loading loading;
    bool cold, limited;
} plan;

static const plan plans[HW_STREAMING_RUNS_MAX] = {
    {"no_prefetch", "no prefetching, cold cache", HW_LOADING_SIMULATED_WAITS, true, false},
    {"cold", "prefetching, cold cache", HW_LOADING_SIMULATED, true, false},
    {"warm", "prefetching, warm cache", HW_LOADING_SIMULATED, false, false},
    {"limited", "prefetching, limited bandwidth", HW_LOADING_SIMULATED, false, true},
};

// ---- the cache of the operating system -------------------------------------------------------

static int forget_file(const char *path, const struct stat *info, int type, struct FTW *walk)
{
    (void)info;
    (void)walk;
    if (type != FTW_F)
        return 0;
    int file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (file < 0)
        return 0;
    (void)fdatasync(file); // what is yet to be written cannot be forgotten
    (void)posix_fadvise(file, 0, 0, POSIX_FADV_DONTNEED);
    close(file);
    return 0;
}

// Makes the system forget a folder's files, as far as it will. A server's are its own affair.
static void forget_dataset(const char *dataset)
{
    char *folder = hw_location_is_url(dataset) ? NULL : realpath(dataset, NULL);
    if (folder)
        (void)nftw(folder, forget_file, 16, FTW_PHYS);
    free(folder);
}

// ---- playing ---------------------------------------------------------------------------------

static hw_camera camera_at(const hw_streaming_desc *desc, double t)
{
    hw_tour_frame frame = hw_walker_tour_at(desc->tour, t);
    const hw_tour one = {
        .fov_degrees = desc->tour->fov_degrees, .frame_count = 1, .frames = &frame};
    return hw_tour_camera(&one, 0, desc->width, desc->height);
}

static void note_frame(hw_streaming_run *run, uint32_t frame, const hw_frame_stats *stats,
                       double ms, double cpu_ms)
{
    const hw_stream_stats *s = &stats->stream;
    run->frame_ms[frame] = ms + s->waited_ms;
    run->cpu_ms[frame] = cpu_ms;
    run->missing[frame] = s->missing;
    run->read_bytes[frame] = (double)(s->read_bytes - run->bytes);
    run->bytes = s->read_bytes;
    if (s->gpu_bytes > run->gpu_bytes_peak)
        run->gpu_bytes_peak = s->gpu_bytes;
    run->ram_bytes_peak = s->ram_bytes_peak;
    if (frame == 0)
        return;
    run->stalls += stats->stalls > 0;
    run->frames_missing += s->missing > 0;
}

static hw_status play(const hw_streaming_desc *desc, hw_renderer *renderer, hw_target *target,
                      hw_streaming_report *r, hw_streaming_run *run)
{
    hw_status status = HW_OK;
    hw_progress *progress = NULL;
    HW_TRY(hw_progress_create(&progress, run->title, r->frame_count));
    for (uint32_t i = 0; i < r->frame_count; i++) {
        hw_frame_stats stats = {0};
        hw_camera camera = camera_at(desc, r->times[i]);
        hw_target_bind(target);
        glFinish();
        double start = hw_clock_ms(), cpu_start = hw_process_seconds();
        HW_GO(hw_renderer_draw(renderer, &camera, &stats));
        hw_target_resolve(target);
        glFinish();
        note_frame(run, i, &stats, hw_clock_ms() - start,
                   (hw_process_seconds() - cpu_start) * 1000);
        hw_renderer_advance(renderer, 1 / HW_STREAMING_FPS);
        hw_progress_add(progress, 1);
    }
out:
    hw_progress_destroy(progress);
    return status;
}

static hw_status summarize(const hw_streaming_report *r, hw_streaming_run *run)
{
    hw_summary s;
    run->first_ms = run->frame_ms[0];
    HW_TRY(hw_summarize(run->frame_ms + 1, 1, r->frame_count - 1, &s));
    run->median_ms = s.median;
    run->p99_ms = s.p99;
    run->slowest_ms = s.max;
    HW_TRY(hw_summarize(run->cpu_ms + 1, 1, r->frame_count - 1, &s));
    run->cpu_median_ms = s.median;
    run->cpu_slowest_ms = s.max;
    for (uint32_t i = 1; i < r->frame_count; i++)
        run->slow_frames += run->frame_ms[i] > SLOW_MEDIANS * run->median_ms;
    return HW_OK;
}

static hw_status run_plan(const hw_streaming_desc *desc, const plan *p, hw_target *target,
                          hw_streaming_report *r)
{
    hw_status status = HW_OK;
    hw_streaming_run *run = &r->runs[r->run_count++];
    hw_renderer *renderer = NULL;
    const hw_renderer_desc make = {
        .config = HW_CONFIG_C,
        .dataset = desc->dataset,
        .near_triangles = desc->near_triangles,
        .hide = desc->hide,
        .crossing_width = HW_CROSSING_WIDTH,
        .streaming = {.loading = p->loading,
                      .bytes_per_second = p->limited ? desc->bandwidth : 0,
                      .gpu_budget = desc->gpu_budget,
                      .ram_budget = desc->ram_budget}};
    run->key = p->key;
    run->title = p->title;
    HW_GO(HW_NEW(&run->frame_ms, r->frame_count));
    HW_GO(HW_NEW(&run->cpu_ms, r->frame_count));
    HW_GO(HW_NEW(&run->read_bytes, r->frame_count));
    HW_GO(HW_NEW(&run->missing, r->frame_count));
    HW_GO(hw_renderer_create(&make, &renderer));
    if (p->cold)
        forget_dataset(desc->dataset);
    HW_GO(play(desc, renderer, target, r, run));
    HW_GO(summarize(r, run));
out:
    hw_renderer_destroy(renderer);
    return status;
}

// Times from the tour's start to its end; at least two frames.
static hw_status make_times(const hw_tour *tour, hw_streaming_report *out)
{
    double start = tour->frames[0].t, length = tour->frames[tour->frame_count - 1].t - start;
    out->frame_count = (uint32_t)fmin(length * HW_STREAMING_FPS, 1e7) + 2;
    HW_TRY(HW_NEW(&out->times, out->frame_count));
    for (uint32_t i = 0; i < out->frame_count; i++)
        out->times[i] = start + fmin(i / HW_STREAMING_FPS, length);
    return HW_OK;
}

hw_status hw_streaming_measure(const hw_streaming_desc *desc, hw_streaming_report *out)
{
    hw_status status = HW_OK;
    hw_target *target = NULL;
    *out = (hw_streaming_report){.bandwidth = desc->bandwidth};
    HW_GO(make_times(desc->tour, out));
    HW_GO(hw_target_create(&target, desc->width, desc->height, desc->samples));
    for (uint32_t i = 0; i < HW_STREAMING_RUNS_MAX; i++)
        if (!plans[i].limited || desc->bandwidth)
            HW_GO(run_plan(desc, &plans[i], target, out));
out:
    hw_target_destroy(target);
    return status;
}

void hw_streaming_free(hw_streaming_report *report)
{
    if (!report)
        return;
    for (uint32_t i = 0; i < report->run_count; i++) {
        hw_free(report->runs[i].frame_ms);
        hw_free(report->runs[i].cpu_ms);
        hw_free(report->runs[i].read_bytes);
        hw_free(report->runs[i].missing);
    }
    hw_free(report->times);
    *report = (hw_streaming_report){0};
}
