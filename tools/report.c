#include "report.h"
#include "alloc.h"
#include "bytes.h"
#include "file.h"
#include "json.h"
#include "log.h"
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#define NOTE_CAPACITY 512

void hw_report_free(hw_report *report)
{
    if (!report)
        return;
    char **strings[] = {&report->command, &report->scene_path, &report->dataset_path,
                        &report->gl_renderer, &report->policy};
    for (size_t i = 0; i < sizeof strings / sizeof *strings; i++)
        hw_free(*strings[i]);
    hw_streaming_free(&report->streaming);
    hw_free(report->frames);
    hw_pops_free(&report->pops);
    for (uint32_t i = 0; i < HW_REPORT_CONFIGS; i++)
        hw_free(report->configs[i].samples);
    for (uint32_t i = 0; i < HW_REPORT_PICTURES; i++) {
        hw_image_free(&report->pictures[i].truth);
        hw_image_free(&report->pictures[i].image);
    }
    for (uint32_t i = 0; i < HW_REPORT_NOTES; i++)
        hw_free(report->notes[i]);
    *report = (hw_report){0};
}

hw_status hw_report_make_samples(hw_report *report, uint32_t frame_count)
{
    HW_TRY(HW_NEW(&report->frames, frame_count));
    report->frame_count = frame_count;
    for (uint32_t c = 0; c < report->config_count; c++) {
        HW_TRY(HW_NEW(&report->configs[c].samples, frame_count));
        for (uint32_t i = 0; i < frame_count; i++)
            for (int m = 0; m < HW_METRIC_COUNT; m++)
                report->configs[c].samples[i].values[m] = (double)NAN;
    }
    return HW_OK;
}

static hw_status add_note(hw_report *report, bool warns, const char *format, va_list arguments)
{
    char text[NOTE_CAPACITY];
    vsnprintf(text, sizeof text, format, arguments);
    if (warns)
        hw_log_warning("%s", text);
    if (report->note_count == HW_REPORT_NOTES)
        return HW_OK;
    HW_TRY(hw_strdup(&report->notes[report->note_count], text));
    report->note_count++;
    return HW_OK;
}

hw_status hw_report_note(hw_report *report, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    hw_status status = add_note(report, false, format, arguments);
    va_end(arguments);
    return status;
}

hw_status hw_report_warn(hw_report *report, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    hw_status status = add_note(report, true, format, arguments);
    va_end(arguments);
    return status;
}

const char *hw_metric_name(hw_metric metric)
{
    static const char *const names[] = {
#define X(name, column) #column,
        HW_METRIC_LIST(X)
#undef X
    };
    return names[metric];
}

// ---- Summaries

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

hw_status hw_summarize(const double *values, size_t stride, uint32_t count, hw_summary *out)
{
    double *sorted, nan = (double)NAN;
    *out = (hw_summary){nan, nan, nan, nan, nan, nan, 0};
    HW_TRY(HW_NEW(&sorted, count));
    uint32_t n = 0;
    double sum = 0;
    for (uint32_t i = 0; i < count; i++) {
        double v = values[i * stride];
        if (isinf(v) && v > 0)
            out->infinite++;
        if (!isfinite(v))
            continue;
        sorted[n++] = v;
        sum += v;
    }
    if (n > 0) {
        qsort(sorted, n, sizeof *sorted, compare_doubles);
        out->sum = sum;
        out->mean = sum / n;
        out->median = (sorted[(n - 1) / 2] + sorted[n / 2]) / 2;
        out->p99 = sorted[((uint64_t)n * 99 + 99) / 100 - 1];
        out->min = sorted[0];
        out->max = sorted[n - 1];
    }
    hw_free(sorted);
    return HW_OK;
}

static hw_status note_infinite(hw_report *report, const hw_report_config *c, hw_metric metric,
                               const char *truth)
{
    uint32_t count = c->summaries[metric].infinite;
    if (count == 0)
        return HW_OK;
    const char *name = hw_config_name(c->config);
    if (count == report->frame_count)
        return hw_report_note(report,
                              "Configuration %s equals %s in every frame: its PSNR against it is "
                              "infinite, written as null.",
                              name, truth);
    return hw_report_note(report,
                          "Configuration %s equals %s in %u of %u frames; these infinite values "
                          "are left out of its means and minima, which are of other frames than "
                          "those of other configurations.",
                          name, truth, count, report->frame_count);
}

static hw_status summarize_pops(hw_report *report)
{
    const hw_pop none = {0}, *first = report->pops.count ? report->pops.items : &none;
    size_t stride = sizeof none / sizeof(double);
    uint32_t count = report->pops.count;
    hw_pop_summaries *s = &report->pop_summaries;
    HW_TRY(hw_summarize(&first->soft, stride, count, &s->soft));
    HW_TRY(hw_summarize(&first->hard, stride, count, &s->hard));
    HW_TRY(hw_summarize(&first->soft_jump, stride, count, &s->soft_jump));
    HW_TRY(hw_summarize(&first->hard_jump, stride, count, &s->hard_jump));
    return hw_summarize(&first->usual_jump, stride, count, &s->usual_jump);
}

hw_status hw_report_summarize(hw_report *report)
{
    HW_TRY(summarize_pops(report));
    for (uint32_t c = 0; c < report->config_count; c++) {
        hw_report_config *config = &report->configs[c];
        for (int m = 0; m < HW_METRIC_COUNT; m++)
            HW_TRY(hw_summarize(&config->samples[0].values[m],
                                sizeof *config->samples / sizeof(double), report->frame_count,
                                &config->summaries[m]));
        HW_TRY(note_infinite(report, config, HW_METRIC_PSNR_1SPP, "the one-sample ground truth"));
        HW_TRY(note_infinite(report, config, HW_METRIC_PSNR_REFERENCE, "the reference"));
    }
    return HW_OK;
}

const hw_report_config *hw_report_find(const hw_report *report, hw_config config)
{
    for (uint32_t c = 0; c < report->config_count; c++)
        if (report->configs[c].config == config)
            return &report->configs[c];
    return NULL;
}

double hw_report_ratio(const hw_report *report, hw_config config)
{
    const hw_report_config *of = hw_report_find(report, config);
    const hw_report_config *hybrid = hw_report_find(report, HW_CONFIG_C);
    if (!of || !hybrid)
        return (double)NAN;
    return of->summaries[HW_METRIC_FRAME_MS].mean / hybrid->summaries[HW_METRIC_FRAME_MS].mean;
}

// ---- report.json

// Seven significant digits of what is no whole number: more is not measured, and a reader wants no
// noise.
static void add_number(cJSON *object, const char *key, double value)
{
    if (isfinite(value) && value != floor(value)) {
        double scale = pow(10, 6 - floor(log10(fabs(value))));
        double rounded = round(value * scale) / scale;
        value = isfinite(rounded) ? rounded : value;
    }
    hw_json_add_number(object, key, value);
}

static void add_count(cJSON *object, const char *key, uint64_t value)
{
    hw_json_add_number(object, key, (double)value);
}

// Keys are the names of hw_summary's members, separated by commas.
static void add_summary(cJSON *object, const char *key, const hw_summary *s, const char *members)
{
    cJSON *to = cJSON_AddObjectToObject(object, key);
    const struct {
        const char *name;
        double value;
    } all[] = {{"mean", s->mean},
               {"median", s->median},
               {"p99", s->p99},
               {"min", s->min},
               {"max", s->max}};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (strstr(members, all[i].name))
            add_number(to, all[i].name, all[i].value);
}

static void add_pops(cJSON *object, const hw_report *r)
{
    const hw_pop_summaries *s = &r->pop_summaries;
    add_summary(object, "pop", &s->soft, "mean,max");
    add_summary(object, "pop_hard", &s->hard, "mean,max");
    cJSON *jump = cJSON_AddObjectToObject(object, "jump");
    add_summary(jump, "crossing", &s->soft_jump, "mean,max");
    add_summary(jump, "crossing_hard", &s->hard_jump, "mean,max");
    add_summary(jump, "elsewhere", &s->usual_jump, "mean,max");
    cJSON *dissolve = cJSON_AddObjectToObject(object, "dissolve");
    add_number(dissolve, "frames_share", r->pops.strip_share);
    add_number(dissolve, "cost", r->pops.dissolve_cost);
}

static void add_config(cJSON *configs, const hw_report *r, const hw_report_config *c)
{
    cJSON *object = cJSON_AddObjectToObject(configs, hw_config_name(c->config));
    const hw_summary *s = c->summaries;
    add_summary(object, "frame_ms", &s[HW_METRIC_FRAME_MS], "mean,median,p99");
    add_summary(object, "triangles", &s[HW_METRIC_TRIANGLES], "mean,max");
    add_summary(object, "draws", &s[HW_METRIC_DRAWS], "mean,max");
    const hw_metric qualities[] = {HW_METRIC_PSNR_1SPP, HW_METRIC_PSNR_REFERENCE,
                                   HW_METRIC_PSNR_OBJECTS, HW_METRIC_SSIM_REFERENCE,
                                   HW_METRIC_SSIM_OBJECTS};
    for (size_t i = 0; i < sizeof qualities / sizeof *qualities; i++)
        add_summary(object, hw_metric_name(qualities[i]), &s[qualities[i]], "mean,min");
    add_count(object, "gpu_bytes_peak", c->gpu_bytes_peak);
    add_number(object, "rss_bytes_peak",
               c->rss_bytes_peak ? (double)c->rss_bytes_peak : (double)NAN);
    if (c->config != HW_CONFIG_C)
        return;
    add_summary(object, "hole_pixels", &s[HW_METRIC_HOLE_PIXELS], "mean,max");
    add_summary(object, "hole_largest", &s[HW_METRIC_HOLE_LARGEST], "mean,max");
    add_pops(object, r);
    cJSON *load = cJSON_AddObjectToObject(object, "load");
    add_number(load, "bytes", s[HW_METRIC_LOAD_BYTES].sum);
    add_number(load, "stalls", s[HW_METRIC_STALLS].sum);
    add_number(load, "seconds", s[HW_METRIC_LOAD_MS].sum / 1000);
}

static void add_facts(cJSON *root, const hw_report *r)
{
    cJSON *scene = cJSON_AddObjectToObject(root, "scene");
    add_count(scene, "triangles", r->scene_triangles);
    add_count(scene, "objects", r->object_count);
    hw_json_add_string(scene, "path", r->scene_path);
    cJSON *dataset = cJSON_AddObjectToObject(root, "dataset");
    add_count(dataset, "cells", r->cell_count);
    add_count(dataset, "bytes", r->dataset_bytes);
    add_count(dataset, "mesh_bytes", r->mesh_bytes);
    add_count(dataset, "texture_bytes", r->texture_bytes);
    add_number(dataset, "build_seconds", r->build_seconds);
    hw_json_add_string(dataset, "path", r->dataset_path);
    hw_json_add_numbers(root, "size", (const double[]){r->width, r->height}, 2);
    add_count(root, "frames", r->frame_count);
    add_count(root, "reference_samples", r->reference_samples);
    add_count(root, "samples", r->samples);
    add_count(root, "every", r->every);
    add_count(root, "repeat", r->repeat);
    add_number(root, "lod_error_px", r->lod_error_px);
    add_count(root, "cell_crossings", r->pops.crossing_count);
    hw_json_add_string(root, "gl_renderer", r->gl_renderer);
    hw_json_add_string(root, "command", r->command);
}

hw_status hw_report_json(const hw_report *report, cJSON **out)
{
    cJSON *root = cJSON_CreateObject();
    *out = root;
    if (!root)
        return hw_fail(HW_MEMORY, "report: out of memory");
    add_facts(root, report);
    cJSON *configs = cJSON_AddObjectToObject(root, "configs");
    for (uint32_t c = 0; c < report->config_count; c++)
        add_config(configs, report, &report->configs[c]);
    cJSON *ratios = cJSON_AddObjectToObject(root, "ratios");
    add_number(ratios, "A/C", hw_report_ratio(report, HW_CONFIG_A));
    add_number(ratios, "B/C", hw_report_ratio(report, HW_CONFIG_B));
    add_number(ratios, "L/C", hw_report_ratio(report, HW_CONFIG_L));
    if (report->streamed)
        hw_streaming_add_json(&report->streaming, root);
    cJSON *notes = cJSON_AddArrayToObject(root, "notes");
    for (uint32_t i = 0; i < report->note_count; i++)
        cJSON_AddItemToArray(notes, hw_json_make_string(report->notes[i]));
    return HW_OK;
}

// ---- frames.csv

static void put_row(hw_bytes_writer *w, const hw_report_frame *frame, const hw_report_config *c,
                    const hw_report_sample *sample)
{
    char text[96];
    int n = snprintf(text, sizeof text, "%u,%.6g,%d,%d,%s", frame->tour_frame, frame->t,
                     frame->cell.q, frame->cell.r, hw_config_name(c->config));
    hw_put_bytes(w, text, (size_t)n);
    for (int m = 0; m < HW_METRIC_COUNT; m++) {
        double v = sample->values[m];
        n = isnan(v) ? snprintf(text, sizeof text, ",") : snprintf(text, sizeof text, ",%.10g", v);
        hw_put_bytes(w, text, (size_t)n);
    }
    hw_put_u8(w, '\n');
}

hw_status hw_report_write_csv(const hw_report *report, const char *path)
{
    hw_bytes_writer w = {0};
    static const char head[] = "tour_frame,t,cell_q,cell_r,config";
    hw_put_bytes(&w, head, sizeof head - 1);
    for (int m = 0; m < HW_METRIC_COUNT; m++) {
        const char *name = hw_metric_name((hw_metric)m);
        hw_put_u8(&w, ',');
        hw_put_bytes(&w, name, strlen(name));
    }
    hw_put_u8(&w, '\n');
    for (uint32_t i = 0; i < report->frame_count; i++)
        for (uint32_t c = 0; c < report->config_count; c++)
            put_row(&w, &report->frames[i], &report->configs[c], &report->configs[c].samples[i]);
    hw_status status = hw_bytes_writer_check(&w);
    if (status == HW_OK)
        status = hw_file_write(path, w.data, w.size);
    hw_bytes_writer_free(&w);
    return status;
}

// ---- Figures for people

// NaN and infinities; false if the value is an ordinary one.
static bool show_special(char buffer[HW_FIGURE_CAPACITY], double value)
{
    if (isfinite(value))
        return false;
    snprintf(buffer, HW_FIGURE_CAPACITY, "%s", isnan(value) ? "-" : "\u221e");
    return true;
}

const char *hw_figure_number(char buffer[HW_FIGURE_CAPACITY], double value, int digits)
{
    if (show_special(buffer, value))
        return buffer;
    int before = value == 0 ? 1 : (int)floor(log10(fabs(value))) + 1;
    int decimals = digits - before;
    snprintf(buffer, HW_FIGURE_CAPACITY, "%.*f",
             decimals < 0   ? 0
             : decimals > 6 ? 6
                            : decimals,
             value);
    return buffer;
}

const char *hw_figure_fixed(char buffer[HW_FIGURE_CAPACITY], double value, int decimals)
{
    if (!show_special(buffer, value))
        snprintf(buffer, HW_FIGURE_CAPACITY, "%.*f", decimals, value);
    return buffer;
}

static const char *show_scaled(char buffer[HW_FIGURE_CAPACITY], double value,
                               const char *const *units)
{
    char number[HW_FIGURE_CAPACITY];
    if (show_special(buffer, value))
        return buffer;
    if (fabs(value) < 1000) {
        snprintf(buffer, HW_FIGURE_CAPACITY, "%.*f%s%s", value == floor(value) ? 0 : 1, value,
                 *units[0] ? " " : "", units[0]);
        return buffer;
    }
    int unit = 0;
    for (; fabs(value) >= 999.5 && unit < 4; unit++)
        value /= 1000;
    hw_figure_number(number, value, 3);
    snprintf(buffer, HW_FIGURE_CAPACITY, "%.20s %s", number, units[unit]);
    return buffer;
}

const char *hw_figure_count(char buffer[HW_FIGURE_CAPACITY], double value)
{
    static const char *const units[] = {"", "K", "M", "G", "T"};
    return show_scaled(buffer, value, units);
}

const char *hw_figure_bytes(char buffer[HW_FIGURE_CAPACITY], double bytes)
{
    static const char *const units[] = {"bytes", "KB", "MB", "GB", "TB"};
    return show_scaled(buffer, bytes, units);
}

const char *hw_figure_seconds(char buffer[HW_FIGURE_CAPACITY], double seconds)
{
    char number[HW_FIGURE_CAPACITY];
    if (show_special(buffer, seconds))
        return buffer;
    if (seconds < 120)
        snprintf(buffer, HW_FIGURE_CAPACITY, "%.20s s", hw_figure_number(number, seconds, 3));
    else if (seconds < 7200)
        snprintf(buffer, HW_FIGURE_CAPACITY, "%.1f min", seconds / 60);
    else
        snprintf(buffer, HW_FIGURE_CAPACITY, "%.1f h", seconds / 3600);
    return buffer;
}

void hw_report_print(const hw_report *report, FILE *out)
{
    char a[HW_FIGURE_CAPACITY], b[HW_FIGURE_CAPACITY], c[HW_FIGURE_CAPACITY];
    fprintf(out, "%-7s%9s%9s%11s%10s%9s%9s%9s%10s\n", "config", "mean ms", "p99 ms", "triangles",
            "PSNR ref", "PSNR 1", "objects", "SSIM", "GPU");
    for (uint32_t i = 0; i < report->config_count; i++) {
        const hw_report_config *config = &report->configs[i];
        const hw_summary *s = config->summaries;
        fprintf(out, "%-7s%9s%9s%11s", hw_config_name(config->config),
                hw_figure_number(a, s[HW_METRIC_FRAME_MS].mean, 3),
                hw_figure_number(b, s[HW_METRIC_FRAME_MS].p99, 3),
                hw_figure_count(c, s[HW_METRIC_TRIANGLES].mean));
        fprintf(out, "%10s%9s%9s", hw_figure_fixed(a, s[HW_METRIC_PSNR_REFERENCE].mean, 1),
                hw_figure_fixed(b, s[HW_METRIC_PSNR_1SPP].mean, 1),
                hw_figure_fixed(c, s[HW_METRIC_PSNR_OBJECTS].mean, 1));
        fprintf(out, "%9s%10s\n", hw_figure_fixed(a, s[HW_METRIC_SSIM_REFERENCE].mean, 4),
                hw_figure_bytes(b, (double)config->gpu_bytes_peak));
    }
    const hw_config others[] = {HW_CONFIG_A, HW_CONFIG_B, HW_CONFIG_L};
    for (int i = 0; i < 3; i++)
        if (!isnan(hw_report_ratio(report, others[i])))
            fprintf(out, "%s/C %.3gx  ", hw_config_name(others[i]),
                    hw_report_ratio(report, others[i]));
    if (hw_report_find(report, HW_CONFIG_C) && report->config_count > 1)
        fputc('\n', out);
}
