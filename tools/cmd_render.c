// hexwalk render: the frames of a tour as images, or only their figures.
#include "alloc.h"
#include "context.h"
#include "dataset_scene.h"
#include "file.h"
#include "hybrid_options.h"
#include "image_io.h"
#include "import.h"
#include "interrupts.h"
#include "json.h"
#include "log.h"
#include "manifest.h"
#include "options.h"
#include "renderer.h"
#include "report.h"
#include "system.h"
#include "target.h"
#include "tour.h"
#include "video.h"
#include "walker.h"
#include <glad/gl.h>
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

static struct {
    const char *tour, *output, *config, *samples, *scene, *frame, *json, *video, *prefetch,
        *occlusion;
    uint32_t size[2];
    uint64_t every, bandwidth, gpu_budget, ram_budget, near_triangles;
    double lod_error, fps;
    bool no_images;
} options = {.samples = "1",
             .config = "C",
             .prefetch = "off",
             .occlusion = "on",
             .size = {1024, 1024},
             .every = 1,
             .lod_error = 1,
             .near_triangles = HW_NEAR_TRIANGLES,
             .fps = 30};

// What the frames add up to.
typedef struct figures {
    uint32_t frames;
    double *frame_ms;
    uint64_t triangles, triangles_max, draws;
    uint64_t load_bytes, stalls, missing; // missing: frames that lacked data
    double load_ms;
} figures;

typedef struct render {
    hw_config config;
    hw_scene scene;
    hw_tour tour;
    uint32_t first, end; // frames of the tour, or of the video
    hw_context *context;
    hw_target *target;
    hw_renderer *renderer;
    hw_image image;
    hw_video *video; // NULL: none
    figures figures;
} render;

static uint32_t fill_options(hw_option *out, uint32_t capacity)
{
    const hw_option table[] = {
        {"tour", 0, HW_OPTION_STRING, &options.tour, "TOUR.json", NULL, 0, 0,
         "The camera path to render."},
        {"output", 'o', HW_OPTION_STRING, &options.output, "DIR", NULL, 0, 0,
         "Folder for the images; made if need be."},
        {"config", 0, HW_OPTION_CHOICE, &options.config, NULL, "A|B|L|C", 0, 0,
         "Full geometry (A), with culling (B), discrete levels of detail (L) or the hybrid (C)."},
        {"size", 0, HW_OPTION_SIZE, options.size, "WxH", NULL, 1, 16384, "Size of the images."},
        {"every", 0, HW_OPTION_UINT, &options.every, "N", NULL, 1, 1e9,
         "Render every N-th frame of the tour."},
        {"frame", 0, HW_OPTION_STRING, &options.frame, "N", NULL, 0, 0,
         "Render this frame only, counted from 0."},
        {"samples", 0, HW_OPTION_CHOICE, &options.samples, NULL, "1|4", 0, 0, "Samples per pixel."},
        {"lod-error", 0, HW_OPTION_DOUBLE, &options.lod_error, "PX", NULL, 0.001, 1000,
         "Largest projected error of configuration L in pixels."},
        HW_OPTION_NEAR_TRIANGLES(&options.near_triangles),
        HW_OPTION_OCCLUSION_CULLING(&options.occlusion),
        {"scene", 0, HW_OPTION_STRING, &options.scene, "SCENE", NULL, 0, 0,
         "The original scene for configurations A, B and L, if it has moved since the build."},
        {"prefetch", 0, HW_OPTION_CHOICE, &options.prefetch, NULL, "on|off", 0, 0,
         "on: play the tour at its own time by a simulated clock, and draw what prefetching has "
         "brought by then; off: wait for all that a frame needs."},
        {"bandwidth", 0, HW_OPTION_BYTES, &options.bandwidth, "BYTES", NULL, 0, 0,
         "With --prefetch on: read the dataset with at most so many bytes a second."},
        {"gpu-budget", 0, HW_OPTION_BYTES, &options.gpu_budget, "BYTES", NULL, 0, 0,
         "Memory for the dataset's data on the GPU; 0: 16M "
         "with prefetching, 24M without, for each level of cells."},
        {"ram-budget", 0, HW_OPTION_BYTES, &options.ram_budget, "BYTES", NULL, 0, 0,
         "Memory for data on their way to the GPU; 0: 4M."},
        {"no-images", 0, HW_OPTION_FLAG, &options.no_images, NULL, NULL, 0, 0,
         "Write no images, only measure."},
        {"video", 0, HW_OPTION_STRING, &options.video, "FILE", NULL, 0, 0,
         "Make a video (.mp4, .mkv, .mov or .webm) of the tour instead, at its own pace, however "
         "long a frame takes; needs the program ffmpeg."},
        {"fps", 0, HW_OPTION_DOUBLE, &options.fps, "N", NULL, 1, 240,
         "Frames per second of the video."},
        {"json", 0, HW_OPTION_STRING, &options.json, "FILE", NULL, 0, 0,
         "Write the figures to this file."},
    };
    uint32_t count = sizeof table / sizeof *table;
    for (uint32_t i = 0; i < count && i < capacity; i++)
        out[i] = table[i];
    return count;
}

static hw_status check_usage(void)
{
    if (!options.tour)
        return hw_fail(HW_USAGE, "render needs --tour");
    if (options.video && (options.output || options.frame || options.every != 1))
        return hw_fail(HW_USAGE, "--video takes the whole tour: no -o, --frame or --every with it");
    if (options.video && !hw_video_name_ok(options.video))
        return hw_fail(HW_USAGE, "--video: '%s' is no .mp4, .mkv, .mov or .webm", options.video);
    if (!options.video && !options.output && !options.no_images)
        return hw_fail(HW_USAGE, "render needs -o DIR (or --video FILE, or --no-images)");
    return HW_OK;
}

static hw_status choose_frame(render *r)
{
    char *stop = NULL;
    unsigned long long frame = strtoull(options.frame, &stop, 10);
    if (options.frame[0] < '0' || options.frame[0] > '9' || *stop)
        return hw_fail(HW_USAGE, "--frame: '%s' is not a whole number", options.frame);
    if (frame >= r->tour.frame_count) {
        return hw_fail(HW_USAGE, "--frame: %s has %u frames, there is no %s", options.tour,
                       r->tour.frame_count, options.frame);
    }
    r->first = (uint32_t)frame;
    r->end = r->first + 1;
    return HW_OK;
}

static hw_status read_tour(render *r)
{
    HW_TRY(hw_tour_read(options.tour, &r->tour));
    r->end = r->tour.frame_count;
    if (options.frame)
        return choose_frame(r);
    if (!options.video)
        return HW_OK;
    double seconds = r->tour.frames[r->end - 1].t - r->tour.frames[0].t;
    double count = floor(seconds * options.fps + 1e-6) + 1;
    if (count > HW_TOUR_FRAMES_MAX)
        return hw_fail(HW_LIMIT, "%s: %.0f s are too long for a video", options.tour, seconds);
    r->end = (uint32_t)count;
    return HW_OK;
}

// Frame `index` of the tour, or of the video: those lie between the tour's own.
static double frame_seconds(const render *r, uint64_t index)
{
    const hw_tour_frame *frames = r->tour.frames;
    return options.video ? frames[0].t + (double)index / options.fps : frames[index].t;
}

static hw_camera frame_camera(const render *r, uint32_t index)
{
    if (!options.video)
        return hw_tour_camera(&r->tour, index, options.size[0], options.size[1]);
    hw_tour_frame frame = hw_walker_tour_at(&r->tour, frame_seconds(r, index));
    return (hw_camera){.eye = frame.eye,
                       .forward = frame.forward,
                       .up = frame.up,
                       .fov_degrees = (float)r->tour.fov_degrees,
                       .width = options.size[0],
                       .height = options.size[1]};
}

// The scene of A, B and L: the path itself if it is no folder (or --scene), else what the dataset
// was built from. C needs the dataset alone.
static hw_status read_scene(render *r, const char *path)
{
    bool is_folder = hw_path_is_folder(path), is_dataset = is_folder || hw_location_is_url(path);
    if (r->config == HW_CONFIG_C) {
        if (!is_folder && hw_path_exists(path))
            return hw_fail(HW_USAGE, "%s: configuration C needs a dataset (hexwalk build)", path);
        return HW_OK;
    }
    if (!is_dataset)
        return hw_scene_import(options.scene ? options.scene : path, &r->scene);
    hw_manifest manifest = {0};
    HW_TRY(hw_manifest_open(path, &manifest));
    hw_status status = hw_dataset_scene_import(path, &manifest, options.scene, &r->scene);
    hw_manifest_free(&manifest);
    return status;
}

static bool prefetches(void)
{
    return strcmp(options.prefetch, "on") == 0;
}

static hw_status make_renderer(render *r, const char *path)
{
    const hw_context_desc context = {.kind = HW_CONTEXT_OFFSCREEN, .width = 16, .height = 16};
    const hw_renderer_desc renderer = {
        .config = r->config,
        .dataset = path,
        .scene = &r->scene,
        .lod_error_px = options.lod_error,
        .near_triangles = (uint32_t)options.near_triangles,
        .crossing_width = HW_CROSSING_WIDTH,
        .hide = strcmp(options.occlusion, "on") == 0,
        .streaming = {.loading = prefetches() ? HW_LOADING_SIMULATED : HW_LOADING_WAITS,
                      .bytes_per_second = prefetches() ? options.bandwidth : 0,
                      .gpu_budget = options.gpu_budget,
                      .ram_budget = options.ram_budget}};
    HW_TRY(hw_context_create(&context, &r->context));
    HW_TRY(hw_target_create(&r->target, options.size[0], options.size[1],
                            options.samples[0] == '4' ? 4 : 1));
    return hw_renderer_create(&renderer, &r->renderer);
}

static hw_status write_frame(render *r)
{
    HW_TRY(hw_target_read(r->target, &r->image));
    return hw_video_put(r->video, &r->image);
}

static hw_status write_image(render *r, uint32_t frame)
{
    HW_TRY(hw_target_read(r->target, &r->image));
    char name[32], *path = NULL;
    snprintf(name, sizeof name, "frame_%05u.png", frame);
    HW_TRY(hw_path_join(&path, options.output, name));
    hw_status status = hw_image_write_opaque(path, &r->image);
    hw_free(path);
    return status;
}

static void count_load(figures *f, const hw_frame_stats *stats)
{
    f->load_bytes += stats->loaded_bytes;
    f->stalls += stats->stalls;
    f->load_ms += stats->load_ms;
}

// Drivers compile shaders and allocate on the first frames: one goes before those that count.
static hw_status warm_up(render *r)
{
    hw_camera camera = frame_camera(r, r->first);
    hw_frame_stats stats;
    hw_target_bind(r->target);
    HW_TRY(hw_renderer_draw(r->renderer, &camera, &stats));
    hw_target_resolve(r->target);
    glFinish();
    count_load(&r->figures, &stats);
    return HW_OK;
}

// Loading comes first and is counted apart: frame_ms is drawing up to glFinish.
static hw_status draw_frame(render *r, uint32_t frame)
{
    figures *f = &r->figures;
    hw_frame_stats load, stats;
    hw_camera camera = frame_camera(r, frame);
    HW_TRY(hw_renderer_prepare(r->renderer, &camera, &load));
    hw_target_bind(r->target);
    glFinish();
    double start = hw_clock_ms();
    HW_TRY(hw_renderer_draw(r->renderer, &camera, &stats));
    hw_target_resolve(r->target);
    glFinish();
    f->frame_ms[f->frames++] = hw_clock_ms() - start;
    f->triangles += stats.triangles;
    f->triangles_max = stats.triangles > f->triangles_max ? stats.triangles : f->triangles_max;
    f->draws += stats.draws;
    f->missing += stats.stream.missing > 0;
    count_load(f, &load);
    count_load(f, &stats);
    if (r->video)
        return write_frame(r);
    return options.no_images ? HW_OK : write_image(r, frame);
}

// Ctrl-C leaves no half of a video behind; a second one kills.
static volatile sig_atomic_t interrupted;

static void on_signal(int number)
{
    (void)number;
    interrupted = 1;
}

static hw_status draw_frames(render *r)
{
    hw_status status = HW_OK;
    hw_progress *progress = NULL;
    uint64_t step = options.every, count = (r->end - r->first + step - 1) / step;
    HW_GO(HW_NEW(&r->figures.frame_ms, count));
    HW_GO(hw_progress_create(&progress, "rendering", count));
    HW_GO(warm_up(r));
    for (uint64_t frame = r->first; frame < r->end; frame += step) {
        if (interrupted) {
            status = hw_fail(HW_INTERRUPTED, "%s: interrupted", options.tour);
            goto out;
        }
        HW_GO(draw_frame(r, (uint32_t)frame));
        if (frame + step < r->end)
            hw_renderer_advance(r->renderer,
                                frame_seconds(r, frame + step) - frame_seconds(r, frame));
        hw_progress_add(progress, 1);
    }
out:
    hw_progress_destroy(progress);
    return status;
}

static hw_status make_video(render *r)
{
    hw_interrupts_handle(on_signal, SA_RESETHAND);
    HW_TRY(hw_video_open(&r->video, options.video, options.size[0], options.size[1], options.fps,
                         &interrupted));
    HW_TRY(draw_frames(r));
    hw_video *video = r->video;
    r->video = NULL;
    return hw_video_commit(video);
}

static cJSON *add_object(cJSON *parent, const char *key)
{
    return cJSON_AddObjectToObject(parent, key);
}

static hw_status report(render *r)
{
    figures *f = &r->figures;
    hw_summary ms;
    HW_TRY(hw_summarize(f->frame_ms, 1, f->frames, &ms));
    printf("%s: %u frames, %.2f ms each (median %.2f, p99 %.2f), %.0f triangles\n",
           hw_config_name(r->config), f->frames, ms.mean, ms.median, ms.p99,
           (double)f->triangles / f->frames);
    if (!options.json)
        return HW_OK;
    cJSON *json = cJSON_CreateObject();
    if (!json)
        return hw_fail(HW_MEMORY, "out of memory");
    cJSON_AddStringToObject(json, "config", hw_config_name(r->config));
    cJSON_AddStringToObject(json, "renderer", hw_context_renderer(r->context));
    hw_json_add_numbers(json, "size", (double[]){options.size[0], options.size[1]}, 2);
    hw_json_add_number(json, "frames", f->frames);
    cJSON *times = add_object(json, "frame_ms");
    hw_json_add_number(times, "mean", ms.mean);
    hw_json_add_number(times, "median", ms.median);
    hw_json_add_number(times, "p99", ms.p99);
    cJSON *triangles = add_object(json, "triangles");
    hw_json_add_number(triangles, "mean", (double)f->triangles / f->frames);
    hw_json_add_number(triangles, "max", (double)f->triangles_max);
    hw_json_add_number(json, "draws", (double)f->draws / f->frames);
    hw_json_add_number(json, "gpu_bytes_peak", (double)hw_renderer_gpu_bytes_peak(r->renderer));
    hw_json_add_number(json, "rss_bytes_peak", (double)hw_rss_peak_bytes());
    cJSON *load = add_object(json, "load");
    hw_json_add_number(load, "bytes", (double)f->load_bytes);
    hw_json_add_number(load, "stalls", (double)f->stalls);
    hw_json_add_number(load, "seconds", f->load_ms / 1000);
    hw_json_add_number(load, "frames_missing", (double)f->missing);
    hw_status status = hw_json_write(options.json, json);
    cJSON_Delete(json);
    return status;
}

static hw_status run(int argc, const char *const *argv)
{
    hw_status status = HW_OK;
    render r = {0};
    (void)argc;
    HW_TRY(check_usage());
    (void)hw_config_parse(options.config, &r.config); // one of the choices
    HW_GO(read_tour(&r));
    HW_GO(read_scene(&r, argv[0]));
    hw_memory_trim();
    HW_GO(make_renderer(&r, argv[0]));
    hw_memory_trim();
    hw_rss_reset_peak(); // reading a scene takes more than drawing it
    if (options.output && !options.no_images)
        HW_GO(hw_dir_make(options.output));
    HW_GO(options.video ? make_video(&r) : draw_frames(&r));
    HW_GO(report(&r));
out:
    hw_video_abort(r.video);
    hw_renderer_destroy(r.renderer);
    hw_target_destroy(r.target);
    hw_context_destroy(r.context);
    hw_image_free(&r.image);
    hw_scene_free(&r.scene);
    hw_tour_free(&r.tour);
    hw_free(r.figures.frame_ms);
    return status;
}

const hw_command hw_cmd_render = {
    .name = "render",
    .summary = "Render the frames of a tour off screen.",
    .arguments = "DATASET|URL|SCENE --tour TOUR.json -o DIR|--video FILE",
    .description =
        "Draws a tour without a window and writes each frame as DIR/frame_NNNNN.png. Configuration "
        "C, the hybrid, reads the dataset alone; full geometry (A), geometry with culling (B) and "
        "discrete levels of detail (L) read the scene the dataset was built from. A dataset may "
        "also "
        "be the URL (http://...) of its folder on a web server.\n\n"
        "A scene file instead of a dataset can be rendered without building anything, in "
        "configurations A, B and L.",
    .options = fill_options,
    .positional_min = 1,
    .positional_max = 1,
    .run = run,
};
