// hexwalk measure: time, triangles, memory and quality of the configurations along a tour.
#include "alloc.h"
#include "bytes.h"
#include "dataset_scene.h"
#include "file.h"
#include "hybrid_options.h"
#include "json.h"
#include "log.h"
#include "measure.h"
#include "options.h"
#include "outputs.h"
#include <errno.h>
#include <fcntl.h>
#include <spawn.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

#define FRAMES_WANTED  48 // where --every is not given
#define ARGUMENTS_MAX  32
#define CHILD_TEXT_MAX 64

static struct {
    const char *tour, *configs, *output, *samples, *scene, *json, *occlusion;
    uint32_t size[2];
    uint64_t every, reference_samples, repeat, bandwidth, gpu_budget, ram_budget, near_triangles;
    double lod_error;
    bool streaming;
} options = {.configs = "A,B,L,C",
             .samples = "1",
             .size = {1024, 1024},
             .reference_samples = 16,
             .repeat = 5,
             .lod_error = 1,
             .near_triangles = HW_NEAR_TRIANGLES,
             .occlusion = "on"};

static uint32_t fill_options(hw_option *out, uint32_t capacity)
{
    const hw_option table[] = {
        {"tour", 0, HW_OPTION_STRING, &options.tour, "TOUR.json", NULL, 0, 0,
         "The camera path to measure along."},
        {"configs", 0, HW_OPTION_STRING, &options.configs, "LIST", NULL, 0, 0,
         "Configurations to measure, separated by commas: full geometry (A), with culling (B), "
         "discrete levels of detail (L), the hybrid (C)."},
        {"output", 'o', HW_OPTION_STRING, &options.output, "DIR", NULL, 0, 0,
         "Folder for the report; made if need be."},
        {"every", 0, HW_OPTION_UINT, &options.every, "N", NULL, 0, 1e9,
         "Measure every N-th frame of the tour; 0 = so that at most 48 are measured."},
        {"samples", 0, HW_OPTION_CHOICE, &options.samples, NULL, "1|4", 0, 0,
         "Samples per pixel of the configurations."},
        {"lod-error", 0, HW_OPTION_DOUBLE, &options.lod_error, "PX", NULL, 0.001, 1000,
         "Largest projected error of configuration L in pixels."},
        HW_OPTION_NEAR_TRIANGLES(&options.near_triangles),
        HW_OPTION_OCCLUSION_CULLING(&options.occlusion),
        {"reference-samples", 0, HW_OPTION_UINT, &options.reference_samples, "N", NULL, 1, 4096,
         "Samples per pixel of the reference image."},
        {"size", 0, HW_OPTION_SIZE, options.size, "WxH", NULL, 1, 16384, "Size of the images."},
        {"scene", 0, HW_OPTION_STRING, &options.scene, "SCENE", NULL, 0, 0,
         "The original scene, if it has moved since the build."},
        {"repeat", 0, HW_OPTION_UINT, &options.repeat, "N", NULL, 1, 99,
         "Rounds whose median is a frame's time."},
        {"streaming", 0, HW_OPTION_FLAG, &options.streaming, NULL, NULL, 0, 0,
         "Also play the tour at its own time by a simulated clock, and tell how the hybrid gets "
         "its "
         "data: without prefetching, with it from a cold and from a warm cache."},
        {"bandwidth", 0, HW_OPTION_BYTES, &options.bandwidth, "BYTES", NULL, 0, 0,
         "With --streaming: once more reading at most so many bytes a second, 5M for instance."},
        {"gpu-budget", 0, HW_OPTION_BYTES, &options.gpu_budget, "BYTES", NULL, 0, 0,
         "With --streaming: memory for the dataset's data on the GPU; 0: 16M for each "
         "level of cells."},
        {"ram-budget", 0, HW_OPTION_BYTES, &options.ram_budget, "BYTES", NULL, 0, 0,
         "With --streaming: memory for data on their way to the GPU; 0: 4M."},
        {"json", 0, HW_OPTION_STRING, &options.json, "FILE", NULL, 0, 0,
         "Write report.json to this file as well."},
    };
    uint32_t count = sizeof table / sizeof *table;
    for (uint32_t i = 0; i < count && i < capacity; i++)
        out[i] = table[i];
    return count;
}

static hw_status parse_configs(hw_report *report)
{
    const char *text = options.configs;
    for (;;) {
        size_t length = strcspn(text, ",");
        char name[8] = "";
        hw_config config;
        if (length > 0 && length < sizeof name)
            memcpy(name, text, length);
        if (!hw_config_parse(name, &config))
            return hw_fail(HW_USAGE, "--configs: '%.*s' is none of A, B, L, C", (int)length, text);
        if (hw_report_find(report, config))
            return hw_fail(HW_USAGE, "--configs: %s stands there twice", name);
        report->configs[report->config_count++].config = config;
        if (!text[length])
            return HW_OK;
        text += length + 1;
    }
}

static hw_status check_usage(hw_report *report)
{
    if (!options.tour)
        return hw_fail(HW_USAGE, "measure needs --tour");
    if (!options.output)
        return hw_fail(HW_USAGE, "measure needs -o DIR");
    if ((options.bandwidth || options.gpu_budget || options.ram_budget) && !options.streaming)
        return hw_fail(HW_USAGE,
                       "--bandwidth, --gpu-budget and --ram-budget are for measure --streaming");
    const char *const inputs[] = {options.tour, options.scene};
    HW_TRY(hw_output_apart("json", options.json, 2, inputs));
    return parse_configs(report);
}

// ---- The command line, for the report

// In quotes where a shell would need them.
static void put_argument(hw_bytes_writer *w, const char *text)
{
    static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
                                "-_=+./,:@%";
    bool quoted = !*text || text[strspn(text, plain)];
    if (quoted)
        hw_put_u8(w, '\'');
    for (; *text; text++) {
        if (*text == '\'')
            hw_put_bytes(w, "'\\'", 3);
        hw_put_u8(w, (uint8_t)*text);
    }
    if (quoted)
        hw_put_u8(w, '\'');
}

static hw_status read_command_line(char **out)
{
    char arguments[16384];
    hw_bytes_writer w = {0};
    int file = open("/proc/self/cmdline", O_RDONLY | O_CLOEXEC);
    ssize_t size = file < 0 ? -1 : read(file, arguments, sizeof arguments - 1);
    if (file >= 0)
        close(file);
    if (size <= 0)
        return hw_strdup(out, "hexwalk measure");
    arguments[size] = 0;
    hw_put_bytes(&w, "hexwalk", 7);
    for (const char *p = arguments + strlen(arguments) + 1; p < arguments + size;
         p += strlen(p) + 1) {
        hw_put_u8(&w, ' ');
        put_argument(&w, p);
    }
    hw_put_u8(&w, 0);
    hw_status status = hw_bytes_writer_check(&w);
    if (status == HW_OK)
        status = hw_strdup(out, (const char *)w.data);
    hw_bytes_writer_free(&w);
    return status;
}

// ---- Inputs

static hw_status fill_facts(hw_report *r, const char *dataset, const hw_manifest *manifest,
                            const hw_scene *scene, const hw_tour *tour)
{
    const char *scene_path = options.scene ? options.scene : manifest->scene_path;
    HW_TRY(hw_strdup(&r->scene_path, scene_path));
    HW_TRY(hw_strdup(&r->dataset_path, dataset));
    HW_TRY(hw_strdup(&r->policy, manifest->policy ? manifest->policy : ""));
    HW_TRY(read_command_line(&r->command));
    r->scene_triangles = hw_scene_triangle_count(scene);
    r->object_count = scene->object_count;
    r->cell_count = manifest->cell_count;
    r->cell_size = manifest->grid.cell_size;
    r->dataset_bytes = manifest->near_bytes;
    for (uint32_t i = 0; i < manifest->cell_count; i++)
        r->dataset_bytes += manifest->cells[i].bytes;
    r->mesh_bytes = manifest->mesh_bytes;
    r->texture_bytes = manifest->texture_bytes;
    r->build_seconds = manifest->build_seconds;
    r->width = options.size[0];
    r->height = options.size[1];
    r->samples = options.samples[0] == '4' ? 4 : 1;
    r->reference_samples = (uint32_t)options.reference_samples;
    r->repeat = (uint32_t)options.repeat;
    r->lod_error_px = options.lod_error;
    r->tour_frames = tour->frame_count;
    r->near_triangles = (uint32_t)options.near_triangles;
    r->hide = strcmp(options.occlusion, "on") == 0;
    r->every = (uint32_t)options.every;
    if (r->every == 0)
        r->every = (tour->frame_count + FRAMES_WANTED - 1) / FRAMES_WANTED;
    return HW_OK;
}

// ---- Memory of each configuration alone: a process of its own draws the same frames

typedef struct child_text {
    char every[CHILD_TEXT_MAX], size[CHILD_TEXT_MAX], lod_error[CHILD_TEXT_MAX];
    char gpu[CHILD_TEXT_MAX], ram[CHILD_TEXT_MAX], near[CHILD_TEXT_MAX];
} child_text;

// `render DATASET ...` for one configuration; the strings live in `text` and in `options`.
static void fill_arguments(const char *arguments[ARGUMENTS_MAX], child_text *text,
                           const hw_report *r, hw_config config, bool prefetch, const char *json)
{
    snprintf(text->every, sizeof text->every, "%u", prefetch ? 1 : r->every);
    // Frames are measured with the defaults.
    snprintf(text->gpu, sizeof text->gpu, "%llu",
             (unsigned long long)(prefetch ? options.gpu_budget : 0));
    snprintf(text->ram, sizeof text->ram, "%llu",
             (unsigned long long)(prefetch ? options.ram_budget : 0));
    snprintf(text->near, sizeof text->near, "%u", r->near_triangles);
    snprintf(text->size, sizeof text->size, "%ux%u", r->width, r->height);
    snprintf(text->lod_error, sizeof text->lod_error, "%.9g", r->lod_error_px);
    const char *const list[] = {
        "hexwalk",
        "render",
        r->dataset_path,
        "--tour",
        options.tour,
        "--config",
        hw_config_name(config),
        "--every",
        text->every,
        "--size",
        text->size,
        "--samples",
        options.samples,
        "--lod-error",
        text->lod_error,
        "--json",
        json,
        "--prefetch",
        prefetch ? "on" : "off",
        "--gpu-budget",
        text->gpu,
        "--ram-budget",
        text->ram,
        "--near-triangles",
        text->near,
        "--occlusion-culling",
        options.occlusion,
        "--no-images",
        "--quiet",
    };
    uint32_t count = sizeof list / sizeof *list;
    memcpy(arguments, list, sizeof list);
    if (options.scene) {
        arguments[count++] = "--scene";
        arguments[count++] = options.scene;
    }
    arguments[count] = NULL;
}

// Runs this very program; its table goes nowhere, its errors to stderr.
static hw_status run_self(const char *const *arguments)
{
    posix_spawn_file_actions_t actions;
    pid_t child;
    int wait_status = 0;
    if (posix_spawn_file_actions_init(&actions) != 0)
        return hw_fail(HW_MEMORY, "out of memory");
    int error = posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    union {
        const char *const *in;
        char *const *out; // posix_spawn promises not to write
    } cast = {arguments};
    if (!error)
        error = posix_spawn(&child, "/proc/self/exe", &actions, NULL, cast.out, environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error)
        return hw_fail(HW_IO, "cannot start hexwalk again: %s", strerror(error));
    while (waitpid(child, &wait_status, 0) < 0)
        if (errno != EINTR)
            return hw_fail(HW_IO, "waiting for hexwalk: %s", strerror(errno));
    if (WIFSIGNALED(wait_status))
        return hw_fail(HW_IO, "hexwalk render was ended by signal %d", WTERMSIG(wait_status));
    if (WEXITSTATUS(wait_status) != 0)
        return hw_fail(HW_IO, "hexwalk render failed");
    return HW_OK;
}

static hw_status measure_memory_of(const hw_report *r, hw_config config, bool prefetch,
                                   uint64_t *out)
{
    const char *arguments[ARGUMENTS_MAX];
    child_text text;
    char *path = NULL, name[32];
    cJSON *json = NULL;
    double bytes = 0;
    hw_status status = HW_OK;
    snprintf(name, sizeof name, "memory_%s.json.tmp", hw_config_name(config));
    HW_GO(hw_path_join(&path, options.output, name));
    fill_arguments(arguments, &text, r, config, prefetch, path);
    HW_GO(run_self(arguments));
    HW_GO(hw_json_read(path, &json));
    HW_GO(hw_json_number(path, json, "rss_bytes_peak", &bytes));
    *out = bytes > 0 ? (uint64_t)bytes : 0;
out:
    if (path)
        (void)unlink(path);
    cJSON_Delete(json);
    hw_free(path);
    return status;
}

// Memory that cannot be told is a note, not a failure: all else can.
static hw_status try_memory_of(hw_report *r, hw_config config, bool prefetch, uint64_t *out)
{
    hw_status status = measure_memory_of(r, config, prefetch, out);
    if (status == HW_OK || status == HW_MEMORY)
        return status;
    return hw_report_warn(r, "The process memory of configuration %s%s is unknown: %s.",
                          hw_config_name(config), prefetch ? " with prefetching" : "",
                          hw_error_text());
}

static hw_status measure_memory(hw_report *r, uint64_t *streaming)
{
    hw_progress *progress = NULL;
    hw_status status = HW_OK;
    HW_GO(hw_progress_create(&progress, "memory", r->config_count + options.streaming));
    for (uint32_t c = 0; c < r->config_count; c++) {
        hw_report_config *config = &r->configs[c];
        HW_GO(try_memory_of(r, config->config, false, &config->rss_bytes_peak));
        hw_progress_add(progress, 1);
    }
    if (options.streaming)
        HW_GO(try_memory_of(r, HW_CONFIG_C, true, streaming));
    hw_progress_add(progress, options.streaming);
out:
    hw_progress_destroy(progress);
    return status;
}

// ---- Outputs

// Better told now than after the measurement.
static hw_status check_output(const char *path)
{
    hw_writer *writer;
    struct stat info;
    if (stat(path, &info) == 0 && !S_ISREG(info.st_mode))
        return HW_OK; // a pipe is opened once
    HW_TRY(hw_writer_open(&writer, path));
    hw_writer_abort(writer);
    return HW_OK;
}

static hw_status check_outputs(void)
{
    char *inside = NULL;
    HW_TRY(hw_dir_make(options.output));
    HW_TRY(hw_path_join(&inside, options.output, "report.json"));
    hw_status status = check_output(inside);
    hw_free(inside);
    return status == HW_OK && options.json ? check_output(options.json) : status;
}

// report.json comes last: who finds it finds all the rest.
static hw_status write_report(const hw_report *report)
{
    char *csv = NULL, *html = NULL, *path = NULL;
    cJSON *json = NULL;
    hw_status status = HW_OK;
    HW_GO(hw_path_join(&csv, options.output, "frames.csv"));
    HW_GO(hw_path_join(&html, options.output, "report.html"));
    HW_GO(hw_path_join(&path, options.output, "report.json"));
    HW_GO(hw_report_write_csv(report, csv));
    HW_GO(hw_report_write_html(report, html));
    HW_GO(hw_report_json(report, &json));
    if (options.json)
        HW_GO(hw_json_write(options.json, json));
    HW_GO(hw_json_write(path, json));
    hw_report_print(report, stdout);
    if (report->streamed)
        hw_streaming_print(&report->streaming, stdout);
    printf("report %s\n", html);
out:
    cJSON_Delete(json);
    hw_free(csv);
    hw_free(html);
    hw_free(path);
    return status;
}

static hw_status run(int argc, const char *const *argv)
{
    hw_report report = {0};
    hw_manifest manifest = {0};
    hw_scene scene = {0};
    hw_tour tour = {0};
    uint64_t streaming_rss = 0;
    hw_status status = HW_OK;
    (void)argc;
    HW_GO(check_usage(&report));
    HW_GO(hw_manifest_open(argv[0], &manifest));
    HW_GO(hw_tour_read(options.tour, &tour));
    HW_GO(hw_dataset_scene_import(argv[0], &manifest, options.scene, &scene));
    HW_GO(fill_facts(&report, argv[0], &manifest, &scene, &tour));
    HW_GO(check_outputs());
    HW_GO(measure_memory(&report, &streaming_rss));
    const hw_streaming_desc streaming = {.dataset = argv[0],
                                         .tour = &tour,
                                         .width = report.width,
                                         .height = report.height,
                                         .samples = report.samples,
                                         .bandwidth = options.bandwidth,
                                         .gpu_budget = options.gpu_budget,
                                         .ram_budget = options.ram_budget,
                                         .near_triangles = report.near_triangles,
                                         .hide = report.hide};
    const hw_measure_desc desc = {.dataset = argv[0],
                                  .manifest = &manifest,
                                  .scene = &scene,
                                  .tour = &tour,
                                  .streaming = options.streaming ? &streaming : NULL};
    HW_GO(hw_measure_run(&desc, &report));
    report.streaming.rss_bytes_peak = streaming_rss;
    HW_GO(hw_report_summarize(&report));
    HW_GO(write_report(&report));
out:
    hw_report_free(&report);
    hw_scene_free(&scene);
    hw_tour_free(&tour);
    hw_manifest_free(&manifest);
    return status;
}

const hw_command hw_cmd_measure = {
    .name = "measure",
    .summary = "Measure speed, memory and quality along a tour.",
    .arguments = "DATASET --tour TOUR.json -o DIR",
    .description =
        "Draws frames of a tour off screen in several configurations and compares them with ground "
        "truth, which is configuration B: at one sample per pixel, and as the mean of many samples "
        "(the reference). Writes DIR/report.html, a page by itself, with tables, plots and "
        "pictures; DIR/frames.csv, a row per frame and configuration; and DIR/report.json.\n\n"
        "Frame times are whole frames up to glFinish, of one process, configurations taking turns. "
        "The plots need gnuplot.",
    .options = fill_options,
    .positional_min = 1,
    .positional_max = 1,
    .run = run,
};
