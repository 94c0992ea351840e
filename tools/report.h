// What `hexwalk measure` found: the figures, their summaries, and the files made of them.
#pragma once
#include "bytes.h"
#include "hexgrid.h"
#include "image.h"
#include "plot.h"
#include "pops.h"
#include "renderer.h"
#include "status.h"
#include "streaming.h"
#include <cjson/cJSON.h>
#include <stdint.h>
#include <stdio.h>

#define HW_REPORT_CONFIGS  4 // A, B, L, C
#define HW_REPORT_PICTURES 6 // worst, median and best frame of C and of L
#define HW_REPORT_NOTES    16

// Figures of one frame in one configuration; the names are the columns of frames.csv. Qualities are
// +inf for equal images and NaN where there is nothing to compare.
#define HW_METRIC_LIST(X)                                                                          \
    X(FRAME_MS, frame_ms)                                                                          \
    X(TRIANGLES, triangles)                                                                        \
    X(DRAWS, draws)                                                                                \
    X(NEAR_TRIANGLES, near_triangles)                                                              \
    X(FAR_TRIANGLES, far_triangles)                                                                \
    X(PSNR_1SPP, psnr_1spp)                                                                        \
    X(PSNR_REFERENCE, psnr_reference)                                                              \
    X(PSNR_OBJECTS, psnr_objects)                                                                  \
    X(SSIM_REFERENCE, ssim_reference)                                                              \
    X(SSIM_OBJECTS, ssim_objects)                                                                  \
    X(HOLE_PIXELS, hole_pixels)                                                                    \
    X(HOLE_LARGEST, hole_largest)                                                                  \
    X(LOAD_BYTES, load_bytes)                                                                      \
    X(LOAD_MS, load_ms)                                                                            \
    X(STALLS, stalls)

typedef enum hw_metric {
#define X(name, column) HW_METRIC_##name,
    HW_METRIC_LIST(X)
#undef X
        HW_METRIC_COUNT
} hw_metric;

// Of the finite values only; all NaN when there is none.
typedef struct hw_summary {
    double mean, median, p99, min, max, sum;
    uint32_t infinite; // how many were +inf
} hw_summary;

typedef struct hw_report_sample {
    double values[HW_METRIC_COUNT];
} hw_report_sample;

typedef struct hw_report_frame {
    uint32_t tour_frame;
    double t; // seconds
    hw_cell_id cell;
} hw_report_frame;

typedef struct hw_report_config {
    hw_config config;
    hw_report_sample *samples; // frame_count of them
    uint64_t gpu_bytes_peak;
    uint64_t rss_bytes_peak; // of a process that runs this configuration alone; 0 = unknown
    hw_summary summaries[HW_METRIC_COUNT];
} hw_report_config;

// Of the crossings that were looked at (pops.h); NaN if there were none.
typedef struct hw_pop_summaries {
    hw_summary soft, hard, soft_jump, hard_jump, usual_jump;
} hw_pop_summaries;

typedef struct hw_report_picture {
    hw_config config;
    const char *rank; // "Worst", "Median", "Best"; static storage
    uint32_t frame;   // index into frames
    hw_image truth, image;
} hw_report_picture;

// Zero-initialise; free with hw_report_free. Strings are owned.
typedef struct hw_report {
    char *command, *scene_path, *dataset_path, *gl_renderer, *policy;
    uint64_t scene_triangles;
    uint32_t object_count, cell_count;
    double cell_size;
    uint64_t dataset_bytes, mesh_bytes, texture_bytes;
    double build_seconds;
    uint32_t width, height, samples, reference_samples, repeat, every, tour_frames;
    double lod_error_px;
    uint32_t near_triangles; // hw_renderer_desc
    bool hide;               // hw_renderer_desc
    uint32_t frame_count, config_count, picture_count, note_count;
    hw_report_frame *frames;
    hw_pops pops; // of the hybrid
    hw_pop_summaries pop_summaries;
    hw_report_config configs[HW_REPORT_CONFIGS];
    hw_report_picture pictures[HW_REPORT_PICTURES];
    bool streamed;
    hw_streaming_report streaming; // if streamed
    char *notes[HW_REPORT_NOTES];  // what a reader must know about the figures
} hw_report;

void hw_report_free(hw_report *report);
// Allocates frames and, for each configuration, samples (all NaN).
HW_MUST_USE hw_status hw_report_make_samples(hw_report *report, uint32_t frame_count);
// Adds a sentence; those beyond HW_REPORT_NOTES are dropped.
HW_MUST_USE hw_status hw_report_note(hw_report *report, const char *format, ...) HW_PRINTF(2, 3);
// The same for what went wrong: it is a warning too.
HW_MUST_USE hw_status hw_report_warn(hw_report *report, const char *format, ...) HW_PRINTF(2, 3);
// The column name of a metric.
const char *hw_metric_name(hw_metric metric);
// Mean, median, nearest-rank p99, ... of values[i * stride], i < count.
HW_MUST_USE hw_status hw_summarize(const double *values, size_t stride, uint32_t count,
                                   hw_summary *out);
// Fills every configuration's summaries, and notes infinite values.
HW_MUST_USE hw_status hw_report_summarize(hw_report *report);
// NULL if it was not measured.
const hw_report_config *hw_report_find(const hw_report *report, hw_config config);
// Mean frame time of `config` over that of C; NaN if either is missing.
double hw_report_ratio(const hw_report *report, hw_config config);
// The document of report.json. Free with cJSON_Delete.
HW_MUST_USE hw_status hw_report_json(const hw_report *report, cJSON **out);
// frames.csv: a row per frame and configuration; "inf", and nothing for NaN.
HW_MUST_USE hw_status hw_report_write_csv(const hw_report *report, const char *path);
// report.html, self-contained. Plots that gnuplot did not make leave a message in their place.
HW_MUST_USE hw_status hw_report_write_html(const hw_report *report, const char *path);
// For sections of the page: a heading and the plot, or the cause why it is missing.
HW_MUST_USE hw_status hw_report_put_plot(hw_bytes_writer *page, const hw_plot *plot,
                                         const char *title);
// A short table.
void hw_report_print(const hw_report *report, FILE *out);

// Sensible digits for people: "8.46 M", "475 MB", "3.1"; "-" for NaN, the infinity sign for
// infinities. Returns `buffer`.
#define HW_FIGURE_CAPACITY 32
const char *hw_figure_count(char buffer[HW_FIGURE_CAPACITY], double value);
const char *hw_figure_bytes(char buffer[HW_FIGURE_CAPACITY], double bytes);
const char *hw_figure_number(char buffer[HW_FIGURE_CAPACITY], double value, int digits);
const char *hw_figure_fixed(char buffer[HW_FIGURE_CAPACITY], double value, int decimals);
const char *hw_figure_seconds(char buffer[HW_FIGURE_CAPACITY], double seconds);
