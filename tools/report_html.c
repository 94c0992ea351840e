// report.html: one self-contained page. Sections follow each other as they are read.
#include "alloc.h"
#include "bytes.h"
#include "compare.h"
#include "file.h"
#include "image_io.h"
#include "plot.h"
#include "report.h"
#include "report_style.h"
#include <math.h>
#include <stdarg.h>
#include <string.h>

#define DIFFERENCE_GAIN 8.0f
#define PAIR_QUALITY    90
// Larger pictures are halved until they have no more pixels than this, so that the page stays
// mailable.
#define PICTURE_PIXELS_MAX 1200000u

// ---- Text

static void put_raw(hw_bytes_writer *w, const char *text)
{
    hw_put_bytes(w, text, strlen(text));
}

// Escaped.
static void put_text(hw_bytes_writer *w, const char *text)
{
    for (; *text; text++) {
        switch (*text) {
        case '&':
            put_raw(w, "&amp;");
            break;
        case '<':
            put_raw(w, "&lt;");
            break;
        case '>':
            put_raw(w, "&gt;");
            break;
        case '"':
            put_raw(w, "&quot;");
            break;
        default:
            hw_put_u8(w, (uint8_t)*text);
        }
    }
}

static void put_base64(hw_bytes_writer *w, const uint8_t *data, size_t size)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < size; i += 3) {
        size_t left = size - i;
        uint32_t v = (uint32_t)data[i] << 16;
        v |= left > 1 ? (uint32_t)data[i + 1] << 8 : 0;
        v |= left > 2 ? data[i + 2] : 0;
        hw_put_u8(w, (uint8_t)digits[v >> 18]);
        hw_put_u8(w, (uint8_t)digits[v >> 12 & 63]);
        hw_put_u8(w, (uint8_t)(left > 1 ? digits[v >> 6 & 63] : '='));
        hw_put_u8(w, (uint8_t)(left > 2 ? digits[v & 63] : '='));
    }
}

static const char *config_title(hw_config config)
{
    static const char *const titles[] = {"full geometry", "culled geometry", "levels of detail",
                                         "hybrid"};
    return titles[config];
}

static const char *config_color(hw_config config)
{
    static const char *const colors[] = {"var(--a)", "var(--b)", "var(--l)", "var(--c)"};
    return colors[config];
}

static const char *file_name(const char *path)
{
    size_t end = strlen(path);
    while (end > 1 && path[end - 1] == '/')
        end--;
    while (end > 0 && path[end - 1] != '/')
        end--;
    return path + end;
}

// ---- Header

static void put_fact(hw_bytes_writer *w, const char *name, const char *format, ...) HW_PRINTF(3, 4);
static void put_fact(hw_bytes_writer *w, const char *name, const char *format, ...)
{
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    hw_put_format(w, "<div><dt>%s</dt><dd>", name);
    put_text(w, text);
    hw_put_format(w, "</dd></div>\n");
}

static void put_facts(hw_bytes_writer *w, const hw_report *r)
{
    char a[HW_FIGURE_CAPACITY], b[HW_FIGURE_CAPACITY], c[HW_FIGURE_CAPACITY];
    hw_put_format(w, "<dl class=\"facts\">\n");
    put_fact(w, "Scene", "%s triangles in %u objects",
             hw_figure_count(a, (double)r->scene_triangles), r->object_count);
    put_fact(w, "Dataset", "%u cells of side %s, %s", r->cell_count,
             hw_figure_number(a, r->cell_size, 3), hw_figure_bytes(b, (double)r->dataset_bytes));
    put_fact(w, "In the cells", "%s of meshes, %s of textures",
             hw_figure_bytes(a, (double)r->mesh_bytes),
             hw_figure_bytes(b, (double)r->texture_bytes));
    put_fact(w, "Built in", "%s%s%s", hw_figure_seconds(c, r->build_seconds),
             *r->policy ? ", policy " : "", r->policy);
    put_fact(w, "Frames", "%u of %u of the tour, %u \u00d7 %u pixels", r->frame_count,
             r->tour_frames, r->width, r->height);
    put_fact(w, "Cell crossings on the tour", "%u", r->pops.crossing_count);
    put_fact(w, "Samples a pixel", "%u; reference %u", r->samples, r->reference_samples);
    put_fact(w, "OpenGL", "%s", r->gl_renderer);
    hw_put_format(w, "</dl>\n");
}

static void put_head(hw_bytes_writer *w, double value, const char *unit, const char *format, ...)
    HW_PRINTF(4, 5);
static void put_head(hw_bytes_writer *w, double value, const char *unit, const char *format, ...)
{
    char a[HW_FIGURE_CAPACITY], text[256];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    hw_put_format(w, "<div class=\"head\"><b>%s%s</b><span>%s</span></div>\n",
                  hw_figure_number(a, value, 3), unit, text);
}

// The figures that one looks for first.
static void put_heads(hw_bytes_writer *w, const hw_report *r)
{
    char a[HW_FIGURE_CAPACITY];
    const hw_report_config *c = hw_report_find(r, HW_CONFIG_C);
    const hw_config others[] = {HW_CONFIG_A, HW_CONFIG_B, HW_CONFIG_L};
    if (!c)
        return;
    const hw_summary *s = c->summaries;
    hw_put_format(w, "<div class=\"heads\">\n");
    put_head(w, s[HW_METRIC_FRAME_MS].mean, " ms", "a frame of the hybrid (C), mean");
    for (int i = 0; i < 3; i++)
        if (!isnan(hw_report_ratio(r, others[i])))
            put_head(w, hw_report_ratio(r, others[i]), "\u202f\u00d7",
                     "frame time of %s (%s) over C", hw_config_name(others[i]),
                     config_title(others[i]));
    const hw_report_config *b = hw_report_find(r, HW_CONFIG_B);
    const hw_summary *t = b ? &b->summaries[HW_METRIC_PSNR_REFERENCE] : NULL;
    if (t)
        put_head(w, s[HW_METRIC_PSNR_REFERENCE].mean, " dB",
                 "C against the %u-sample reference; B: %s dB", r->reference_samples,
                 hw_figure_fixed(a, t->mean, 1));
    else
        put_head(w, s[HW_METRIC_PSNR_REFERENCE].mean, " dB", "C against the %u-sample reference",
                 r->reference_samples);
    hw_put_format(w, "</div>\n");
}

static void put_header(hw_bytes_writer *w, const hw_report *r)
{
    hw_put_format(w, "<p class=\"kicker\">Hexwalk measurement</p>\n<h1>");
    put_text(w, file_name(r->scene_path));
    hw_put_format(w, "</h1>\n<p class=\"soft\">walked through ");
    put_text(w, file_name(r->dataset_path));
    hw_put_format(w, "</p>\n");
    put_heads(w, r);
    put_facts(w, r);
    hw_put_format(w, "<pre>");
    put_text(w, r->command);
    hw_put_format(w, "</pre>\n");
}

// ---- Table: a row per measure, a column per configuration, which fits a phone

typedef enum summary_part { PART_MEAN, PART_MEDIAN, PART_P99, PART_MIN, PART_MAX } summary_part;
typedef enum figure_style { STYLE_MS, STYLE_COUNT, STYLE_DB, STYLE_SSIM } figure_style;

typedef struct table_row {
    const char *label;
    hw_metric metric;
    summary_part part;
    figure_style style;
    bool starts_group;
} table_row;

static double part_of(const hw_summary *s, summary_part part)
{
    const double parts[] = {s->mean, s->median, s->p99, s->min, s->max};
    // Equal in every frame: infinite, not missing.
    if (isnan(s->mean) && s->infinite > 0)
        return (double)INFINITY;
    return parts[part];
}

static const char *show(char buffer[HW_FIGURE_CAPACITY], double value, figure_style style)
{
    switch (style) {
    case STYLE_MS:
        return hw_figure_number(buffer, value, 3);
    case STYLE_DB:
        return hw_figure_fixed(buffer, value, 1);
    case STYLE_SSIM:
        return hw_figure_fixed(buffer, value, 4);
    default:
        return hw_figure_count(buffer, value);
    }
}

static void put_cell(hw_bytes_writer *w, const hw_report_config *c, const char *text)
{
    hw_put_format(w, "<td%s>%s</td>", c->config == HW_CONFIG_C ? " class=\"c\"" : "", text);
}

static void put_row(hw_bytes_writer *w, const hw_report *r, const table_row *row)
{
    char a[HW_FIGURE_CAPACITY];
    if (row->starts_group)
        hw_put_format(w, "</tbody><tbody class=\"group\">\n");
    hw_put_format(w, "<tr><th scope=\"row\"%s>%s</th>",
                  row->part == PART_MEAN ? "" : " class=\"sub\"", row->label);
    for (uint32_t i = 0; i < r->config_count; i++) {
        const hw_report_config *c = &r->configs[i];
        put_cell(w, c, show(a, part_of(&c->summaries[row->metric], row->part), row->style));
    }
    hw_put_format(w, "</tr>\n");
}

static void put_memory_rows(hw_bytes_writer *w, const hw_report *r)
{
    char a[HW_FIGURE_CAPACITY];
    hw_put_format(
        w, "</tbody><tbody class=\"group\">\n<tr><th scope=\"row\">OpenGL memory, peak</th>");
    for (uint32_t i = 0; i < r->config_count; i++)
        put_cell(w, &r->configs[i], hw_figure_bytes(a, (double)r->configs[i].gpu_bytes_peak));
    hw_put_format(w, "</tr>\n<tr><th scope=\"row\">Process memory, peak</th>");
    for (uint32_t i = 0; i < r->config_count; i++) {
        double bytes = (double)r->configs[i].rss_bytes_peak;
        put_cell(w, &r->configs[i], hw_figure_bytes(a, bytes > 0 ? bytes : (double)NAN));
    }
    hw_put_format(w, "</tr>\n");
}

static void put_table(hw_bytes_writer *w, const hw_report *r)
{
    static const table_row rows[] = {
        {"Frame time, mean <span class=\"unit\">ms</span>", HW_METRIC_FRAME_MS, PART_MEAN, STYLE_MS,
         false},
        {"median", HW_METRIC_FRAME_MS, PART_MEDIAN, STYLE_MS, false},
        {"99th percentile", HW_METRIC_FRAME_MS, PART_P99, STYLE_MS, false},
        {"Triangles sent, mean", HW_METRIC_TRIANGLES, PART_MEAN, STYLE_COUNT, true},
        {"most", HW_METRIC_TRIANGLES, PART_MAX, STYLE_COUNT, false},
        {"Draw calls, mean", HW_METRIC_DRAWS, PART_MEAN, STYLE_COUNT, false},
        {"PSNR against the reference, mean <span class=\"unit\">dB</span>",
         HW_METRIC_PSNR_REFERENCE, PART_MEAN, STYLE_DB, true},
        {"least", HW_METRIC_PSNR_REFERENCE, PART_MIN, STYLE_DB, false},
        {"PSNR against one sample, mean <span class=\"unit\">dB</span>", HW_METRIC_PSNR_1SPP,
         PART_MEAN, STYLE_DB, false},
        {"least", HW_METRIC_PSNR_1SPP, PART_MIN, STYLE_DB, false},
        {"On objects only, mean <span class=\"unit\">dB</span>", HW_METRIC_PSNR_OBJECTS, PART_MEAN,
         STYLE_DB, false},
        {"least", HW_METRIC_PSNR_OBJECTS, PART_MIN, STYLE_DB, false},
        {"SSIM against the reference, mean", HW_METRIC_SSIM_REFERENCE, PART_MEAN, STYLE_SSIM, true},
        {"least", HW_METRIC_SSIM_REFERENCE, PART_MIN, STYLE_SSIM, false},
        {"SSIM on objects against one sample, mean", HW_METRIC_SSIM_OBJECTS, PART_MEAN, STYLE_SSIM,
         false},
        {"least", HW_METRIC_SSIM_OBJECTS, PART_MIN, STYLE_SSIM, false},
    };
    hw_put_format(w,
                  "<h2>Configurations</h2>\n<div class=\"scroll\"><table>\n<thead><tr><th></th>");
    for (uint32_t i = 0; i < r->config_count; i++) {
        hw_config config = r->configs[i].config;
        hw_put_format(w,
                      "<th scope=\"col\"%s><span class=\"swatch\" style=\"background:%s\"></span>%s"
                      "<small>%s</small></th>",
                      config == HW_CONFIG_C ? " class=\"c\"" : "", config_color(config),
                      hw_config_name(config), config_title(config));
    }
    hw_put_format(w, "</tr></thead>\n<tbody>\n");
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        put_row(w, r, &rows[i]);
    put_memory_rows(w, r);
    hw_put_format(w, "</tbody></table></div>\n");
}

static void put_pops(hw_bytes_writer *w, const hw_report *r)
{
    const hw_pop_summaries *s = &r->pop_summaries;
    char a[HW_FIGURE_CAPACITY], b[HW_FIGURE_CAPACITY], d[HW_FIGURE_CAPACITY];
    if (r->pops.count == 0) {
        put_fact(w, "Pop at a cell crossing", "no crossing between cells that the dataset has");
        return;
    }
    put_fact(w, "Pop at a cell crossing", "mean %s, most %s luma RMS, of %u crossings",
             hw_figure_number(a, s->soft.mean, 2), hw_figure_number(b, s->soft.max, 2),
             r->pops.count);
    put_fact(w, "The same if cells did not dissolve", "mean %s, most %s",
             hw_figure_number(a, s->hard.mean, 2), hw_figure_number(b, s->hard.max, 2));
    put_fact(w, "The jump alone, without motion",
             "mean %s; if cells did not dissolve %s; elsewhere %s",
             hw_figure_number(a, s->soft_jump.mean, 2), hw_figure_number(b, s->hard_jump.mean, 2),
             hw_figure_number(d, s->usual_jump.mean, 2));
    put_fact(w, "Cost of dissolves", "%s %% of the tour's frame time, in %s %% of its frames",
             hw_figure_number(a, r->pops.dissolve_cost * 100, 1),
             hw_figure_number(b, r->pops.strip_share * 100, 1));
}

// What only the hybrid can do wrong.
static void put_hybrid(hw_bytes_writer *w, const hw_report *r)
{
    char a[HW_FIGURE_CAPACITY], b[HW_FIGURE_CAPACITY], d[HW_FIGURE_CAPACITY];
    const hw_report_config *c = hw_report_find(r, HW_CONFIG_C);
    if (!c)
        return;
    const hw_summary *s = c->summaries;
    hw_put_format(w, "<h2>The hybrid by itself</h2>\n<dl class=\"facts\">\n");
    put_fact(w, "Triangles, near / far", "%s / %s",
             hw_figure_count(a, s[HW_METRIC_NEAR_TRIANGLES].mean),
             hw_figure_count(b, s[HW_METRIC_FAR_TRIANGLES].mean));
    put_fact(w, "Hole pixels a frame", "mean %s, most %s",
             hw_figure_number(a, s[HW_METRIC_HOLE_PIXELS].mean, 3),
             hw_figure_count(b, s[HW_METRIC_HOLE_PIXELS].max));
    put_fact(w, "Largest connected hole", "mean %s, most %s pixels",
             hw_figure_number(a, s[HW_METRIC_HOLE_LARGEST].mean, 3),
             hw_figure_count(b, s[HW_METRIC_HOLE_LARGEST].max));
    put_pops(w, r);
    put_fact(w, "Read from disk", "%s in %s, %s frames waited",
             hw_figure_bytes(a, s[HW_METRIC_LOAD_BYTES].sum),
             hw_figure_seconds(b, s[HW_METRIC_LOAD_MS].sum / 1000),
             hw_figure_number(d, s[HW_METRIC_STALLS].sum, 1));
    hw_put_format(w, "</dl>\n");
}

// ---- Plots

typedef struct plot_plan {
    hw_metric metric;
    const char *title, *axis;
    bool log_y;
} plot_plan;

hw_status hw_report_put_plot(hw_bytes_writer *w, const hw_plot *plot, const char *title)
{
    char *svg = NULL;
    hw_status status = hw_plot_svg(plot, &svg);
    if (status == HW_MEMORY)
        return status;
    hw_put_format(w, "<h3>%s</h3>\n<figure class=\"plot\" role=\"img\" aria-label=\"%s\">", title,
                  title);
    if (status == HW_OK) {
        put_raw(w, svg);
    } else {
        hw_put_format(w, "<p class=\"error\">This plot is missing: ");
        put_text(w, hw_error_text());
        hw_put_format(w, "</p>");
    }
    hw_put_format(w, "</figure>\n");
    hw_free(svg);
    return HW_OK;
}

static hw_status put_metric(hw_bytes_writer *w, const hw_report *r, const double *times,
                            const plot_plan *plan)
{
    hw_plot plot = {.x_label = "time on the tour, s",
                    .y_label = plan->axis,
                    .log_y = plan->log_y,
                    .x = times,
                    .count = r->frame_count,
                    .marks = r->pops.crossings,
                    .mark_count = r->pops.crossing_count};
    for (uint32_t i = 0; i < r->config_count; i++)
        plot.series[plot.series_count++] = (hw_plot_series){
            .name = hw_config_name(r->configs[i].config),
            .css_color = config_color(r->configs[i].config),
            .y = &r->configs[i].samples[0].values[plan->metric],
            .stride = (uint32_t)(sizeof(hw_report_sample) / sizeof(double)),
        };
    return hw_report_put_plot(w, &plot, plan->title);
}

static hw_status put_pop_plot(hw_bytes_writer *w, const hw_report *r)
{
    double *times;
    const hw_pop *items = r->pops.items;
    if (r->pops.count < 2)
        return HW_OK;
    HW_TRY(HW_NEW(&times, r->pops.count));
    for (uint32_t i = 0; i < r->pops.count; i++)
        times[i] = items[i].t;
    const uint32_t stride = sizeof *items / sizeof(double);
    const hw_plot plot = {.x_label = "time on the tour, s",
                          .y_label = "luma, RMS",
                          .x = times,
                          .count = r->pops.count,
                          .series_count = 3,
                          .series = {{"crossing", "var(--c)", &items->soft_jump, stride},
                                     {"without dissolves", "var(--a)", &items->hard_jump, stride},
                                     {"elsewhere", "var(--l)", &items->usual_jump, stride}}};
    hw_status status = hw_report_put_plot(w, &plot, "Jumps at crossings, without motion");
    hw_free(times);
    return status;
}

static hw_status put_plots(hw_bytes_writer *w, const hw_report *r)
{
    static const plot_plan plans[] = {
        {HW_METRIC_FRAME_MS, "Frame time", "ms", true},
        {HW_METRIC_TRIANGLES, "Triangles sent", "triangles", true},
        {HW_METRIC_PSNR_REFERENCE, "PSNR against the reference", "dB", false},
        {HW_METRIC_PSNR_OBJECTS, "PSNR on object pixels, against one sample", "dB", false},
    };
    double *times;
    hw_status status = HW_OK;
    HW_TRY(HW_NEW(&times, r->frame_count));
    for (uint32_t i = 0; i < r->frame_count; i++)
        times[i] = r->frames[i].t;
    hw_put_format(
        w, "<h2>Along the tour</h2>\n<p class=\"soft\">Thin vertical lines mark where the tour "
           "crosses "
           "into another cell. Times and triangles have a logarithmic scale.</p>\n");
    for (size_t i = 0; i < sizeof plans / sizeof *plans; i++)
        HW_GO(put_metric(w, r, times, &plans[i]));
    HW_GO(put_pop_plot(w, r));
out:
    hw_free(times);
    return status;
}

// ---- Pictures

// The image at `factor` times fewer pixels a side, 3 channels; the mean of each block.
static hw_status shrink(const hw_image *image, uint32_t factor, hw_image *out)
{
    HW_TRY(hw_image_make(out, image->width / factor, image->height / factor, 3));
    for (uint32_t y = 0; y < out->height; y++)
        for (uint32_t x = 0; x < out->width; x++)
            for (uint32_t k = 0; k < 3; k++) {
                uint32_t sum = 0, n = factor * factor;
                for (uint32_t i = 0; i < n; i++) {
                    size_t row = (size_t)y * factor + i / factor;
                    size_t column = (size_t)x * factor + i % factor;
                    sum += image->data[(row * image->width + column) * image->channels + k];
                }
                out->data[((size_t)y * out->width + x) * 3 + k] = (uint8_t)((sum + n / 2) / n);
            }
    return HW_OK;
}

static hw_status put_image(hw_bytes_writer *w, const hw_image *image, const char *alt)
{
    uint8_t *bytes = NULL;
    size_t size = 0;
    uint32_t factor = 1;
    hw_image small = {0};
    hw_status status = HW_OK;
    while ((uint64_t)(image->width / factor) * (image->height / factor) > PICTURE_PIXELS_MAX)
        factor *= 2;
    HW_GO(shrink(image, factor, &small));
    HW_GO(hw_image_encode_jpeg(&small, PAIR_QUALITY, &bytes, &size));
    hw_put_format(w, "<img width=\"%u\" height=\"%u\" alt=\"%s\" src=\"data:image/jpeg;base64,",
                  small.width, small.height, alt);
    put_base64(w, bytes, size);
    hw_put_format(w, "\">");
out:
    hw_image_free(&small);
    hw_free(bytes);
    return status;
}

static void put_caption(hw_bytes_writer *w, const hw_report *r, const hw_report_picture *p)
{
    char a[HW_FIGURE_CAPACITY], b[HW_FIGURE_CAPACITY], c[HW_FIGURE_CAPACITY];
    const hw_report_frame *frame = &r->frames[p->frame];
    const double *v = hw_report_find(r, p->config)->samples[p->frame].values;
    hw_put_format(w, "<h3>%s frame of %s</h3>\n", p->rank, hw_config_name(p->config));
    hw_put_format(w, "<p class=\"soft\">Tour frame %u, %s s. ", frame->tour_frame,
                  hw_figure_fixed(a, frame->t, 1));
    hw_put_format(w, "PSNR %s dB (%s dB on objects, %s dB against the reference), ",
                  hw_figure_fixed(a, v[HW_METRIC_PSNR_1SPP], 1),
                  hw_figure_fixed(b, v[HW_METRIC_PSNR_OBJECTS], 1),
                  hw_figure_fixed(c, v[HW_METRIC_PSNR_REFERENCE], 1));
    hw_put_format(w, "SSIM %s, %s ms, %s triangles.</p>\n",
                  hw_figure_fixed(a, v[HW_METRIC_SSIM_REFERENCE], 4),
                  hw_figure_number(b, v[HW_METRIC_FRAME_MS], 3),
                  hw_figure_count(c, v[HW_METRIC_TRIANGLES]));
}

static hw_status put_pair(hw_bytes_writer *w, const hw_report *r, const hw_report_picture *p)
{
    const char *name = hw_config_name(p->config);
    hw_image difference = {0};
    hw_status status = HW_OK;
    HW_GO(hw_difference_image(&p->truth, &p->image, DIFFERENCE_GAIN, &difference));
    put_caption(w, r, p);
    hw_put_format(w, "<div class=\"pair\"><figure><div class=\"slider\">");
    HW_GO(put_image(w, &p->truth, "Ground truth"));
    HW_GO(put_image(w, &p->image, "Configuration"));
    hw_put_format(
        w,
        "<em class=\"left\">truth</em><em class=\"right\">%s</em><i></i>"
        "<input type=\"range\" min=\"0\" max=\"100\" step=\"0.5\" value=\"50\" "
        "aria-label=\"Divider between ground truth and configuration %s\"></div>"
        "<figcaption>Drag to compare: ground truth on the left, %s on the right.</figcaption>"
        "</figure>\n<figure class=\"diff\">",
        name, name, name);
    HW_GO(put_image(w, &difference, "Difference"));
    hw_put_format(w, "<figcaption>Difference, amplified %g times.</figcaption></figure></div>\n",
                  (double)DIFFERENCE_GAIN);
out:
    hw_image_free(&difference);
    return status;
}

static hw_status put_pictures(hw_bytes_writer *w, const hw_report *r)
{
    if (r->picture_count == 0)
        return HW_OK;
    hw_put_format(w,
                  "<h2>Pictures</h2>\n<p class=\"soft\">Worst, median and best by PSNR against the "
                  "one-sample ground truth.</p>\n");
    for (uint32_t i = 0; i < r->picture_count; i++)
        HW_TRY(put_pair(w, r, &r->pictures[i]));
    return HW_OK;
}

// ---- How

static void put_method(hw_bytes_writer *w, const hw_report *r)
{
    char a[HW_FIGURE_CAPACITY];
    hw_put_format(w, "<h2>How this was measured</h2>\n<ul>\n");
    hw_put_format(
        w,
        "<li>A draws the full geometry; B is A with view-frustum culling; L is B with discrete "
        "levels of detail, chosen for a projected error of at most %s px; C is the hybrid.</li>\n",
        hw_figure_number(a, r->lod_error_px, 2));
    hw_put_format(
        w,
        "<li>Frame time is the whole frame up to the end of glFinish, the median of %u rounds, "
        "configurations taking turns on the same frame in one process; in each turn the frame is "
        "drawn once untimed before. Loading before a frame is not in it. C keeps its atlases "
        "decoded, as one who waits for data does; a walk that fetches ahead keeps blocks, which "
        "cost software GL about 5 %% of a frame. C draws at most %u triangles of near objects and "
        "%s what these hide.</li>\n",
        r->repeat, r->near_triangles, r->hide ? "leaves out" : "draws");
    hw_put_format(
        w,
        "<li>Ground truth is B at one sample a pixel. The reference is the mean of %u such images, "
        "each shifted within the pixel. The configurations themselves use %u sample%s.</li>\n",
        r->reference_samples, r->samples, r->samples == 1 ? "" : "s");
    hw_put_format(
        w, "<li>PSNR is of luma, 0.299 R + 0.587 G + 0.114 B, the mean over frames of decibels. "
           "Figures on objects count only pixels that either image covers with an object; SSIM "
           "uses an 11 x 11 Gaussian window.</li>\n");
    hw_put_format(
        w,
        "<li>Hole pixels are covered by an object in ground truth and left to sky or ground by the "
        "hybrid. Pop is the RMS luma change of C between the two tour frames around a cell "
        "crossing, less that of B with the same samples; below zero, C changes less than B. The "
        "jump alone is the change seen from one point, with cells and levels of detail as for a "
        "frame and as for the next: the largest of the frames near a crossing.</li>\n"
        "<li>Process memory is the most that a separate process has while it draws the same frames "
        "in this configuration alone; what reading the scene takes before is not in it.</li>\n");
    for (uint32_t i = 0; i < r->note_count; i++) {
        hw_put_format(w, "<li>");
        put_text(w, r->notes[i]);
        hw_put_format(w, "</li>\n");
    }
    hw_put_format(w, "</ul>\n<footer>Made by hexwalk " HW_PROGRAM_VERSION
                     ". The figures of every frame are in frames.csv, the summaries in report.json."
                     "</footer>\n");
}

static hw_status put_page(hw_bytes_writer *w, const hw_report *r)
{
    hw_put_format(
        w, "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
           "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n<title>");
    put_text(w, file_name(r->scene_path));
    hw_put_format(w, " - Hexwalk measurement</title>\n<style>\n");
    put_raw(w, hw_report_style);
    hw_put_format(w, "</style></head>\n<body><main>\n");
    put_header(w, r);
    put_table(w, r);
    put_hybrid(w, r);
    HW_TRY(put_plots(w, r));
    if (r->streamed)
        HW_TRY(hw_streaming_put_html(&r->streaming, r->pops.crossings, r->pops.crossing_count, w));
    HW_TRY(put_pictures(w, r));
    put_method(w, r);
    hw_put_format(w, "</main>\n<script>");
    put_raw(w, hw_report_script);
    hw_put_format(w, "</script></body></html>\n");
    return hw_bytes_writer_check(w);
}

hw_status hw_report_write_html(const hw_report *report, const char *path)
{
    hw_bytes_writer w = {0};
    hw_status status = HW_OK;
    HW_GO(put_page(&w, report));
    HW_GO(hw_file_write(path, w.data, w.size));
out:
    hw_bytes_writer_free(&w);
    return status;
}
