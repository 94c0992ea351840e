// What streaming.c found, as JSON, as a section of the page, as text.
#include "alloc.h"
#include "json.h"
#include "report.h"
#include "streaming.h"
#include <math.h>
#include <string.h>

#define PLOT_POINTS 600u // frames are drawn together where there are more: what is slowest counts

static void add_run(cJSON *parent, const hw_streaming_run *run)
{
    cJSON *to = cJSON_AddObjectToObject(parent, run->key);
    cJSON *times = cJSON_AddObjectToObject(to, "frame_ms");
    hw_json_add_number(times, "first", run->first_ms);
    hw_json_add_number(times, "median", run->median_ms);
    hw_json_add_number(times, "p99", run->p99_ms);
    hw_json_add_number(times, "slowest", run->slowest_ms);
    cJSON *cpu = cJSON_AddObjectToObject(to, "frame_cpu_ms");
    hw_json_add_number(cpu, "median", run->cpu_median_ms);
    hw_json_add_number(cpu, "slowest", run->cpu_slowest_ms);
    hw_json_add_number(to, "slowest_over_median", run->slowest_ms / run->median_ms);
    hw_json_add_number(to, "frames_over_3_medians", run->slow_frames);
    hw_json_add_number(to, "frames_missing", run->frames_missing);
    hw_json_add_number(to, "stalls", run->stalls);
    hw_json_add_number(to, "bytes", (double)run->bytes);
    hw_json_add_number(to, "gpu_bytes_peak", (double)run->gpu_bytes_peak);
    hw_json_add_number(to, "ram_bytes_peak", (double)run->ram_bytes_peak);
}

void hw_streaming_add_json(const hw_streaming_report *report, cJSON *root)
{
    cJSON *to = cJSON_AddObjectToObject(root, "streaming");
    hw_json_add_number(to, "frames", report->frame_count);
    hw_json_add_number(to, "frames_per_second", HW_STREAMING_FPS);
    hw_json_add_number(to, "bandwidth", (double)report->bandwidth);
    hw_json_add_number(to, "rss_bytes_peak",
                       report->rss_bytes_peak ? (double)report->rss_bytes_peak : (double)NAN);
    cJSON *runs = cJSON_AddObjectToObject(to, "runs");
    for (uint32_t i = 0; i < report->run_count; i++)
        add_run(runs, &report->runs[i]);
}

void hw_streaming_print(const hw_streaming_report *report, FILE *out)
{
    char bytes[HW_FIGURE_CAPACITY];
    fprintf(out, "\n%-32s %8s %8s %8s %8s %8s %10s\n", "streaming", "median", "p99", "slowest",
            "missing", "stalls", "read");
    for (uint32_t i = 0; i < report->run_count; i++) {
        const hw_streaming_run *run = &report->runs[i];
        fprintf(out, "%-32s %8.2f %8.2f %8.2f %8u %8u %10s\n", run->title, run->median_ms,
                run->p99_ms, run->slowest_ms, run->frames_missing, run->stalls,
                hw_figure_bytes(bytes, (double)run->bytes));
    }
}

// ---- the page

static const char *const colors[HW_STREAMING_RUNS_MAX] = {"var(--l)", "var(--b)", "var(--c)",
                                                          "var(--a)"};

static void put_table(hw_bytes_writer *w, const hw_streaming_report *r)
{
    char a[HW_FIGURE_CAPACITY], b[HW_FIGURE_CAPACITY], c[HW_FIGURE_CAPACITY], d[HW_FIGURE_CAPACITY];
    hw_put_format(w, "<div class=\"scroll\"><table>\n<thead><tr><th></th><th>Median "
                     "<span class=\"unit\">ms</span></th><th>99th percentile</th><th>Slowest</th>"
                     "<th>Slowest / median</th><th>The same of processor time</th><th>Frames that "
                     "lack data</th><th>Stalls</th>"
                     "<th>Read</th></tr></thead>\n<tbody>\n");
    for (uint32_t i = 0; i < r->run_count; i++) {
        const hw_streaming_run *run = &r->runs[i];
        hw_put_format(w,
                      "<tr><th scope=\"row\"><span class=\"swatch\" style=\"background:%s\"></span>"
                      "%s</th><td>%s</td><td>%s</td><td>%s</td><td>%s</td>",
                      colors[i], run->title, hw_figure_number(a, run->median_ms, 3),
                      hw_figure_number(b, run->p99_ms, 3), hw_figure_number(c, run->slowest_ms, 3),
                      hw_figure_number(d, run->slowest_ms / run->median_ms, 2));
        hw_put_format(w, "<td>%s</td><td>%u</td><td>%u</td><td>%s</td></tr>\n",
                      hw_figure_number(b, run->cpu_slowest_ms / run->cpu_median_ms, 2),
                      run->frames_missing, run->stalls, hw_figure_bytes(a, (double)run->bytes));
    }
    hw_put_format(w, "</tbody></table></div>\n");
}

// The largest of each group of frames, for every run: `points` values each.
static void gather(const hw_streaming_report *r, uint32_t points, size_t member, double *out)
{
    for (uint32_t i = 0; i < r->run_count; i++) {
        const double *values;
        memcpy(&values, (const char *)&r->runs[i] + member, sizeof values);
        for (uint32_t k = 0; k < points; k++) {
            uint32_t first = (uint32_t)((uint64_t)k * r->frame_count / points);
            uint32_t end = (uint32_t)((uint64_t)(k + 1) * r->frame_count / points);
            double most = 0;
            // The first frame waits in any case, and would set the scale.
            for (uint32_t f = first > 0 ? first : 1; f < end; f++)
                most = fmax(most, values[f]);
            out[i * points + k] = most;
        }
    }
}

typedef struct curve {
    const char *title, *axis;
    size_t member;
    bool log_y;
} curve;

static hw_status put_curve(const hw_streaming_report *r, const curve *c, hw_plot *plot,
                           double *values, hw_bytes_writer *w)
{
    gather(r, plot->count, c->member, values);
    plot->y_label = c->axis;
    plot->log_y = c->log_y;
    plot->series_count = 0;
    for (uint32_t i = 0; i < r->run_count; i++)
        plot->series[plot->series_count++] =
            (hw_plot_series){r->runs[i].title, colors[i], values + i * plot->count, 1};
    return hw_report_put_plot(w, plot, c->title);
}

static hw_status put_curves(const hw_streaming_report *r, const double *crossings,
                            uint32_t crossing_count, hw_bytes_writer *w)
{
    static const curve curves[] = {
        {"Frame time while streaming", "ms", offsetof(hw_streaming_run, frame_ms), true},
        {"Bytes read for a frame", "bytes", offsetof(hw_streaming_run, read_bytes), false},
        {"Objects drawn with other data than wanted", "objects",
         offsetof(hw_streaming_run, missing), false},
    };
    hw_status status = HW_OK;
    uint32_t points = r->frame_count < PLOT_POINTS ? r->frame_count : PLOT_POINTS;
    double *times = NULL, *values = NULL;
    HW_GO(HW_NEW(&times, points));
    HW_GO(HW_NEW(&values, (size_t)points * HW_STREAMING_RUNS_MAX));
    for (uint32_t k = 0; k < points; k++)
        times[k] = r->times[(uint64_t)k * r->frame_count / points];
    hw_plot plot = {.x_label = "time on the tour, s",
                    .x = times,
                    .count = points,
                    .marks = crossings,
                    .mark_count = crossing_count};
    for (size_t i = 0; i < sizeof curves / sizeof *curves; i++)
        HW_GO(put_curve(r, &curves[i], &plot, values, w));
out:
    hw_free(times);
    hw_free(values);
    return status;
}

hw_status hw_streaming_put_html(const hw_streaming_report *report, const double *crossings,
                                uint32_t crossing_count, hw_bytes_writer *page)
{
    char a[HW_FIGURE_CAPACITY];
    hw_put_format(page,
                  "<h2>Streaming</h2>\n<p class=\"soft\">The hybrid, the tour played at its "
                  "own time with %g frames a second of it. Time is simulated: between "
                  "two frames the prefetcher has a thirtieth of a second, as on a processor of its "
                  "own; it reads and decodes one piece after the other, for as long as that "
                  "really takes. With prefetching "
                  "frames never wait, but may lack data; its work is not in their times. The "
                  "first frame, which waits in any case, is left out. Atlases stay blocks, which "
                  "software GL draws slower than those of the frames above.",
                  HW_STREAMING_FPS);
    if (report->bandwidth)
        hw_put_format(page, " Limited bandwidth is %s a second.",
                      hw_figure_bytes(a, (double)report->bandwidth));
    if (report->rss_bytes_peak)
        hw_put_format(page,
                      " A process that plays the tour with prefetching and no more has at "
                      "most %s of memory.",
                      hw_figure_bytes(a, (double)report->rss_bytes_peak));
    hw_put_format(page, "</p>\n");
    put_table(page, report);
    return put_curves(report, crossings, crossing_count, page);
}
