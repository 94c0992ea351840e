// How a walk feels while its data come: a tour played at its own time, 30 frames a second of it,
// with and without prefetching (figure 5.19 of the thesis). Time is simulated: between two frames
// the prefetcher has exactly a thirtieth of a second, as on a processor of its own, in which it
// reads and decodes as fast as this machine does, or as the limit of bandwidth lets it.
#pragma once
#include "bytes.h"
#include "manifest.h"
#include "status.h"
#include "tour.h"
#include <cjson/cJSON.h>
#include <stdio.h>

#define HW_STREAMING_FPS      30.0
#define HW_STREAMING_RUNS_MAX 4u

typedef struct hw_streaming_desc {
    const char *dataset; // folder or URL
    const hw_tour *tour;
    uint32_t width, height, samples;
    uint64_t bandwidth; // of a further run, bytes a second; 0: there is none
    uint64_t gpu_budget, ram_budget;
    uint32_t near_triangles; // hw_renderer_desc, as `hide`
    bool hide;
} hw_streaming_desc;

// One way through the tour. Values are per frame.
typedef struct hw_streaming_run {
    const char *key, *title; // of JSON and page; static storage
    double *frame_ms;        // up to glFinish, with the waiting for data
    double *cpu_ms; // processor time of all threads: what else the machine does is not in it
    double *read_bytes, *missing;
    double first_ms, median_ms, p99_ms, slowest_ms; // the last three without the first frame
    double cpu_median_ms, cpu_slowest_ms;           // likewise
    uint32_t frames_missing, stalls;                // stalls: frames that waited, but the first
    uint32_t slow_frames;                           // over 3 medians
    uint64_t bytes, gpu_bytes_peak, ram_bytes_peak;
} hw_streaming_run;

typedef struct hw_streaming_report {
    uint32_t frame_count, run_count;
    double *times; // of the frames, on the tour, s
    uint64_t bandwidth;
    uint64_t rss_bytes_peak; // of a process that only plays the tour; 0 = unknown
    hw_streaming_run runs[HW_STREAMING_RUNS_MAX];
} hw_streaming_report;

// Needs a GL context.
HW_MUST_USE hw_status hw_streaming_measure(const hw_streaming_desc *desc, hw_streaming_report *out);
void hw_streaming_free(hw_streaming_report *report);
// The document of report.json's "streaming", a section of report.html, a short table.
void hw_streaming_add_json(const hw_streaming_report *report, cJSON *root);
HW_MUST_USE hw_status hw_streaming_put_html(const hw_streaming_report *report,
                                            const double *crossings, uint32_t crossing_count,
                                            hw_bytes_writer *page);
void hw_streaming_print(const hw_streaming_report *report, FILE *out);
