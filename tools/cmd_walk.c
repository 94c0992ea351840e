// hexwalk walk: a window to walk through a dataset, or a scene without one.
#include "alloc.h"
#include "context.h"
#include "file.h"
#include "hud.h"
#include "image_io.h"
#include "import.h"
#include "log.h"
#include "manifest.h"
#include "options.h"
#include "renderer.h"
#include "system.h"
#include "target.h"
#include "walker.h"
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <string.h>

#define MESSAGE_MS   4000.0
#define PACE_MS      500.0 // the HUD's figures are of a window this long
#define SCENE_MARGIN 100.0 // walkable around a scene without a dataset
#define SCENE_CELL   50.0

static struct {
    const char *tour, *config, *samples, *record, *scene, *prefetch;
    uint32_t size[2];
    bool fullscreen;
    double lod_error;
    uint64_t frames, bandwidth, gpu_budget, ram_budget;
} options = {.samples = "1", .prefetch = "on", .size = {1280, 720}, .lod_error = 1};

// Imports a scene beside the walk, which goes on meanwhile.
typedef struct scene_loader {
    pthread_t thread;
    bool running, loaded; // of the walk's thread
    atomic_bool done;     // the worker's last word; what follows is the walk's from then on
    char *path;
    hw_scene scene;
    hw_status status;
    char error[HW_ERROR_CAPACITY];
    double start_ms;
} scene_loader;

// Frame times over the last half second.
typedef struct pace {
    double start_ms, last_ms, slowest_ms;
    uint32_t frames;
    double fps, frame_ms, worst_ms; // shown
} pace;

typedef struct walk {
    const char *path, *name;
    bool is_dataset;
    hw_manifest manifest;
    scene_loader loader;
    hw_context *context;
    hw_hud *hud;
    hw_renderer *renderers[4]; // by configuration, made on first use
    hw_renderer *shown;        // one of them; NULL until the first is there
    hw_config config;          // of `shown`
    hw_config wanted;          // what comes next, while `waiting`
    bool waiting, announced;
    hw_walker walker;
    bool placed; // the walker has a grid
    hw_tour tour;
    const char *record_path; // where the present recording goes
    char record_name[64];
    hw_input input;
    bool show_line, show_help, quit;
    char message[512];
    double message_until_ms;
    pace pace;
    hw_frame_stats stats;
    uint64_t frame_count, missing_count; // missing: frames that lacked data
    uint32_t problem_count;              // of the dataset's files that the visitor was told of
} walk;

// Ctrl-C in the terminal ends the walk as Escape does, so that a recording is not lost; a second
// one kills.
static volatile sig_atomic_t interrupted;

static void on_signal(int number)
{
    (void)number;
    interrupted = 1;
}

static const char *config_title(hw_config config)
{
    static const char *const titles[] = {"A full geometry", "B culled geometry",
                                         "L levels of detail", "C hybrid"};
    return titles[config];
}

// ---- Messages

static void say(walk *w, double for_ms, const char *format, ...) HW_PRINTF(3, 4);
static void say(walk *w, double for_ms, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(w->message, sizeof w->message, format, arguments);
    va_end(arguments);
    w->message_until_ms = hw_clock_ms() + for_ms;
}

// A failure that need not end the walk.
static void complain(walk *w, const char *what)
{
    say(w, 2 * MESSAGE_MS, "%s: %s", what, hw_error_text());
    hw_log_warning("%s: %s", what, hw_error_text());
}

static void show_title(walk *w)
{
    char title[256];
    snprintf(title, sizeof title, "%s - %s - Hexwalk", w->name,
             w->shown ? config_title(w->config) : "loading");
    hw_context_set_title(w->context, title);
}

// ---- What is walked through

static bool is_folder(const char *path)
{
    char *inside = NULL;
    bool folder = hw_path_join(&inside, path, ".") == HW_OK && hw_path_exists(inside);
    hw_free(inside);
    return folder;
}

// Chooses the first configuration; C is for datasets only.
static hw_status choose_config(walk *w)
{
    w->wanted = w->is_dataset ? HW_CONFIG_C : HW_CONFIG_B;
    if (options.config && !hw_config_parse(options.config, &w->wanted))
        return hw_fail(HW_USAGE, "--config: unknown configuration %s", options.config);
    if (w->wanted == HW_CONFIG_C && !w->is_dataset)
        return hw_fail(HW_USAGE, "%s: configuration C needs a dataset (hexwalk build makes one)",
                       w->path);
    w->waiting = true;
    return HW_OK;
}

static hw_status open_input(walk *w, const char *path)
{
    w->path = path;
    const char *slash = strrchr(path, '/');
    w->name = slash && slash[1] ? slash + 1 : path;
    w->is_dataset = hw_location_is_url(path) || is_folder(path);
    if (!w->is_dataset && !hw_path_exists(path))
        return hw_fail(HW_NOT_FOUND, "%s: no such dataset or scene", path);
    if (w->is_dataset)
        HW_TRY(hw_manifest_open(path, &w->manifest));
    HW_TRY(choose_config(w));
    const char *scene = options.scene   ? options.scene
                        : w->is_dataset ? w->manifest.scene_path
                                        : path;
    HW_TRY(hw_strdup(&w->loader.path, scene));
    if (options.tour)
        HW_TRY(hw_tour_read(options.tour, &w->tour));
    if (!options.record)
        return HW_OK;
    // Better told now than after the walk.
    char *folder = NULL;
    HW_TRY(hw_path_dir(&folder, options.record));
    bool there = is_folder(folder);
    hw_free(folder);
    return there ? HW_OK : hw_fail(HW_IO, "%s: its folder does not exist", options.record);
}

static hw_hexgrid scene_grid(const hw_scene *scene)
{
    hw_box box = hw_scene_bounds(scene);
    if (scene->ground.present)
        box = hw_box_union(box, scene->ground.rect);
    double extent = fmax((double)box.max.x - box.min.x, (double)box.max.y - box.min.y);
    return hw_hexgrid_cover(box.min.x - SCENE_MARGIN, box.min.y - SCENE_MARGIN,
                            box.max.x + SCENE_MARGIN, box.max.y + SCENE_MARGIN,
                            fmax(SCENE_CELL, extent / 256), box.min.z + 1.0,
                            box.max.z + SCENE_MARGIN);
}

// Puts the walker into the dataset's grid, or that of a scene without one.
static hw_status place_walker(walk *w)
{
    const hw_scene *scene = &w->loader.scene;
    hw_hexgrid grid = w->is_dataset ? w->manifest.grid : scene_grid(scene);
    const hw_ground *ground = w->is_dataset ? &w->manifest.ground : &scene->ground;
    uint32_t count = w->is_dataset ? w->manifest.object_count : scene->object_count;
    hw_box *boxes = NULL;
    HW_TRY(HW_NEW(&boxes, count));
    for (uint32_t i = 0; i < count; i++)
        boxes[i] = w->is_dataset ? w->manifest.objects[i].bounds : scene->objects[i].bounds;
    float ground_z = ground->present ? ground->rect.min.z : (float)grid.z_min;
    hw_walker_init(&w->walker, &grid);
    hw_walker_place_default(&w->walker, boxes, count, ground_z);
    hw_free(boxes);
    w->placed = true;
    if (w->tour.frame_count > 0)
        hw_walker_play(&w->walker, &w->tour);
    if (!options.record)
        return HW_OK;
    w->record_path = options.record;
    return hw_walker_record(&w->walker);
}

// ---- Loading

static void *load_scene(void *argument)
{
    scene_loader *loader = argument;
    loader->status = hw_scene_import(loader->path, &loader->scene);
    if (loader->status != HW_OK)
        hw_error_save(loader->error);
    atomic_store(&loader->done, true);
    return NULL;
}

static hw_status loader_start(scene_loader *loader)
{
    atomic_store(&loader->done, false);
    loader->start_ms = hw_clock_ms();
    if (pthread_create(&loader->thread, NULL, load_scene, loader) != 0)
        return hw_fail(HW_MEMORY, "%s: no thread to load it", loader->path);
    loader->running = true;
    return HW_OK;
}

static hw_status loader_finish(scene_loader *loader)
{
    pthread_join(loader->thread, NULL);
    loader->running = false;
    loader->loaded = loader->status == HW_OK;
    if (!loader->loaded)
        hw_error_restore(loader->error);
    return loader->status;
}

static void loader_free(scene_loader *loader)
{
    if (loader->running)
        pthread_join(loader->thread, NULL);
    hw_scene_free(&loader->scene);
    hw_free(loader->path);
}

// One step towards the scene; *ready once it is there.
static hw_status advance_loading(walk *w, bool *ready)
{
    scene_loader *loader = &w->loader;
    *ready = loader->loaded;
    if (loader->loaded)
        return HW_OK;
    if (!loader->running)
        HW_TRY(loader_start(loader));
    if (!atomic_load(&loader->done)) {
        say(w, MESSAGE_MS, "Loading %s for configuration %s: %.0f s", loader->path,
            hw_config_name(w->wanted), (hw_clock_ms() - loader->start_ms) / 1000);
        return HW_OK;
    }
    HW_TRY(loader_finish(loader));
    *ready = true;
    return HW_OK;
}

static void show_config(walk *w, hw_config config)
{
    w->config = config;
    w->shown = w->renderers[config];
    w->waiting = false;
    say(w, MESSAGE_MS, "Configuration %s", config_title(config));
    show_title(w);
}

// One step towards the wanted configuration, once a frame. Making a renderer takes a while, so the
// frame before tells of it.
static hw_status advance_config(walk *w)
{
    bool ready = w->wanted == HW_CONFIG_C;
    if (!ready)
        HW_TRY(advance_loading(w, &ready));
    if (!ready)
        return HW_OK;
    if (!w->announced) {
        say(w, MESSAGE_MS, "Preparing configuration %s", config_title(w->wanted));
        w->announced = true;
        return HW_OK;
    }
    hw_renderer_desc desc = {.config = w->wanted,
                             .dataset = w->is_dataset ? w->path : NULL,
                             .scene = w->loader.loaded ? &w->loader.scene : NULL,
                             .lod_error_px = options.lod_error,
                             .streaming = {.loading = strcmp(options.prefetch, "on") == 0
                                                          ? HW_LOADING_AHEAD
                                                          : HW_LOADING_WAITS,
                                           .bytes_per_second = options.bandwidth,
                                           .gpu_budget = options.gpu_budget,
                                           .ram_budget = options.ram_budget}};
    HW_TRY(hw_renderer_create(&desc, &w->renderers[w->wanted]));
    if (!w->placed)
        HW_TRY(place_walker(w));
    show_config(w, w->wanted);
    w->pace = (pace){0}; // the pause is no slow frame
    return HW_OK;
}

// A configuration that cannot be had ends the walk only if there is nothing else to show.
static hw_status pursue_config(walk *w)
{
    hw_status status = advance_config(w);
    if (status == HW_OK || !w->shown)
        return status;
    w->waiting = false;
    complain(w, "configuration stays as it is");
    return HW_OK;
}

static void want_config(walk *w, hw_config config)
{
    if (config == HW_CONFIG_C && !w->is_dataset) {
        say(w, MESSAGE_MS, "Configuration C needs a dataset: this is a scene");
        return;
    }
    if (w->renderers[config]) {
        show_config(w, config);
        return;
    }
    w->wanted = config;
    w->waiting = true;
    w->announced = false;
}

// ---- Files made on the way

// The first free name of a numbered series in the current folder.
static hw_status free_name(const char *stem, const char *extension, char *out, size_t capacity)
{
    for (unsigned i = 1; i <= 9999; i++) {
        snprintf(out, capacity, "%s_%04u%s", stem, i, extension);
        if (!hw_path_exists(out))
            return HW_OK;
    }
    return hw_fail(HW_LIMIT, "%s_0001%s to %s_9999%s all exist", stem, extension, stem, extension);
}

// Alpha marks objects; a picture has none.
static hw_status write_opaque(const char *path, const hw_image *rgba)
{
    hw_image rgb = {0};
    HW_TRY(hw_image_make(&rgb, rgba->width, rgba->height, 3));
    size_t pixels = (size_t)rgba->width * rgba->height;
    for (size_t i = 0; i < pixels; i++)
        memcpy(rgb.data + 3 * i, rgba->data + 4 * i, 3);
    hw_status status = hw_image_write(path, &rgb);
    hw_image_free(&rgb);
    return status;
}

// Draws the frame once more off screen: no HUD, and whole whatever covers the window.
static hw_status screenshot(walk *w, const hw_camera *camera, char *name, size_t capacity)
{
    hw_status status = HW_OK;
    hw_target *target = NULL;
    hw_image image = {0};
    hw_frame_stats stats = {0};
    HW_GO(free_name("hexwalk", ".png", name, capacity));
    HW_GO(hw_target_create(&target, camera->width, camera->height,
                           strcmp(options.samples, "4") == 0 ? 4 : 1));
    hw_target_bind(target);
    HW_GO(hw_renderer_draw(w->shown, camera, &stats));
    hw_target_resolve(target);
    HW_GO(hw_target_read(target, &image));
    HW_GO(write_opaque(name, &image));
out:
    hw_image_free(&image);
    hw_target_destroy(target);
    return status;
}

static hw_status write_recording(walk *w)
{
    hw_tour tour;
    hw_walker_take_recorded(&w->walker, &tour);
    hw_status status = hw_tour_write(w->record_path, &tour);
    if (status == HW_OK)
        say(w, MESSAGE_MS, "Saved %s: %u frames", w->record_path, tour.frame_count);
    hw_tour_free(&tour);
    return status;
}

static hw_status start_recording(walk *w)
{
    HW_TRY(free_name("hexwalk_tour", ".json", w->record_name, sizeof w->record_name));
    w->record_path = w->record_name;
    HW_TRY(hw_walker_record(&w->walker));
    say(w, MESSAGE_MS, "Recording %s: R ends it", w->record_path);
    return HW_OK;
}

// ---- The frame

static void pace_tick(pace *p)
{
    double now = hw_clock_ms();
    if (p->last_ms == 0) {
        p->start_ms = p->last_ms = now;
        return;
    }
    p->slowest_ms = fmax(p->slowest_ms, now - p->last_ms);
    p->last_ms = now;
    p->frames++;
    double elapsed = now - p->start_ms;
    if (elapsed < PACE_MS)
        return;
    p->frame_ms = elapsed / p->frames;
    p->fps = 1000 / p->frame_ms;
    p->worst_ms = p->slowest_ms;
    p->start_ms = now;
    p->slowest_ms = 0;
    p->frames = 0;
}

static void handle_keys(walk *w)
{
    const bool *pressed = w->input.pressed;
    w->quit = w->quit || w->input.close || pressed[HW_KEY_QUIT] || interrupted;
    if (pressed[HW_KEY_HUD])
        w->show_line = !w->show_line;
    if (pressed[HW_KEY_HELP])
        w->show_help = !w->show_help;
    for (int i = 0; i < 4; i++)
        if (pressed[HW_KEY_CONFIG_A + i])
            want_config(w, (hw_config)i);
    if (!w->placed)
        return;
    if (pressed[HW_KEY_TOUR]) {
        hw_walker_toggle_playing(&w->walker);
        say(w, MESSAGE_MS, "%s",
            !w->walker.tour     ? "No tour: start with --tour TOUR.json"
            : w->walker.playing ? "The tour goes on"
                                : "The tour rests: Space goes on");
    }
    if (pressed[HW_KEY_RECORD] &&
        (w->walker.recording ? write_recording(w) : start_recording(w)) != HW_OK)
        complain(w, "recording");
}

static void draw_hud(walk *w, const hw_camera *camera)
{
    char line[512];
    bool has_line = w->shown && w->show_line;
    if (has_line) {
        hw_cell_id cell = hw_hexgrid_locate(&w->walker.grid, camera->eye.x, camera->eye.y);
        hw_hud_info info = {.config = config_title(w->config),
                            .fps = w->pace.fps,
                            .frame_ms = w->pace.frame_ms,
                            .worst_ms = w->pace.worst_ms,
                            .cell_q = w->config == HW_CONFIG_C ? w->stats.cell_q : cell.q,
                            .cell_r = w->config == HW_CONFIG_C ? w->stats.cell_r : cell.r,
                            .triangles = w->stats.triangles,
                            .draws = w->stats.draws,
                            .gpu_bytes = hw_renderer_gpu_bytes(w->shown),
                            .recorded_s = w->walker.recording ? w->walker.recorded_s : -1};
        hw_hud_format(&info, line, sizeof line);
    }
    hw_hud_content content = {.line = has_line ? line : NULL,
                              .message = hw_clock_ms() < w->message_until_ms ? w->message : NULL,
                              .help = w->show_help};
    hw_hud_draw(w->hud, w->input.width, w->input.height, &content);
}

// What could not be loaded: the best there is stays in view, and it is tried again.
static void watch_stream(walk *w)
{
    const hw_stream_stats *s = &w->stats.stream;
    w->missing_count += s->missing > 0;
    if (s->problem_count > w->problem_count)
        say(w, 2 * MESSAGE_MS, "%s; it will be tried again", s->problem);
    w->problem_count = s->problem_count;
}

static hw_status draw_frame(walk *w)
{
    hw_camera camera = {0};
    if (!w->shown) {
        hw_hud_blank(w->hud);
        draw_hud(w, &camera);
        return HW_OK;
    }
    camera = hw_walker_camera(&w->walker, w->input.width, w->input.height);
    w->stats = (hw_frame_stats){0};
    HW_TRY(hw_renderer_prepare(w->shown, &camera, &w->stats));
    HW_TRY(hw_renderer_draw(w->shown, &camera, &w->stats));
    watch_stream(w);
    draw_hud(w, &camera);
    w->frame_count++;
    if (!w->input.pressed[HW_KEY_SCREENSHOT])
        return HW_OK;
    char name[64];
    if (screenshot(w, &camera, name, sizeof name) == HW_OK)
        say(w, MESSAGE_MS, "Saved %s", name);
    else
        complain(w, "screenshot");
    return HW_OK;
}

static hw_status run_frames(walk *w)
{
    double last_ms = hw_clock_ms();
    hw_context_present(w->context, &w->input); // learns the framebuffer's size
    while (!w->quit) {
        handle_keys(w);
        double now = hw_clock_ms();
        if (w->placed)
            HW_TRY(hw_walker_update(&w->walker, &w->input, (now - last_ms) / 1000));
        last_ms = now;
        if (w->waiting) {
            HW_TRY(pursue_config(w));
            // Time spent on loading is not walked.
            last_ms += hw_clock_ms() - now;
        }
        if (w->input.width > 0) {
            HW_TRY(draw_frame(w));
            pace_tick(&w->pace);
        } else {
            w->pace = (pace){0};
        }
        w->quit = w->quit || (options.frames && w->frame_count >= options.frames);
        hw_context_present(w->context, &w->input);
    }
    return HW_OK;
}

// ---- The command

static hw_status open_window(walk *w)
{
    hw_context_desc desc = {.kind = HW_CONTEXT_WINDOW,
                            .width = options.size[0],
                            .height = options.size[1],
                            .title = "Hexwalk",
                            .samples = strcmp(options.samples, "4") == 0 ? 4 : 1,
                            .fullscreen = options.fullscreen};
    HW_TRY(hw_context_create(&desc, &w->context));
    show_title(w);
    return hw_hud_create(&w->hud);
}

static void close_walk(walk *w)
{
    for (int i = 0; i < 4; i++)
        hw_renderer_destroy(w->renderers[i]);
    hw_hud_destroy(w->hud);
    hw_context_destroy(w->context);
    loader_free(&w->loader);
    hw_walker_free(&w->walker);
    hw_tour_free(&w->tour);
    hw_manifest_free(&w->manifest);
}

static hw_status run(int argc, const char *const *argv)
{
    (void)argc;
    static walk state;
    walk *w = &state;
    *w = (walk){.show_line = true};
    hw_status status = HW_OK;
    char error[HW_ERROR_CAPACITY];
    HW_GO(open_input(w, argv[0]));
    hw_memory_trim();
    HW_GO(open_window(w));
    struct sigaction action = {.sa_handler = on_signal, .sa_flags = SA_RESETHAND};
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    double start_ms = hw_clock_ms();
    status = run_frames(w);
    hw_error_save(error);
    // A recording is kept whatever ended the walk.
    if (w->walker.recording) {
        hw_status written = write_recording(w);
        if (status != HW_OK)
            hw_error_restore(error);
        else
            status = written;
    }
    if (status != HW_OK)
        goto out;
    double seconds = (hw_clock_ms() - start_ms) / 1000;
    printf("%llu frames in %.1f s\n", (unsigned long long)w->frame_count, seconds);
    if (w->missing_count > 0)
        printf("%llu of them lacked data\n", (unsigned long long)w->missing_count);
out:
    close_walk(w);
    return status;
}

static uint32_t fill_options(hw_option *out, uint32_t capacity)
{
    const hw_option table[] = {
        {"tour", 0, HW_OPTION_STRING, &options.tour, "TOUR.json", NULL, 0, 0,
         "Play this tour; any key of motion leaves it, Space goes on with it."},
        {"config", 0, HW_OPTION_CHOICE, &options.config, NULL, "A|B|L|C", 0, 0,
         "Start with this configuration: full geometry (A), with culling (B), discrete levels of "
         "detail (L) or the hybrid (C); C for a dataset, B for a scene."},
        {"size", 0, HW_OPTION_SIZE, options.size, "WxH", NULL, 160, 16384, "Size of the window."},
        {"fullscreen", 0, HW_OPTION_FLAG, &options.fullscreen, NULL, NULL, 0, 0,
         "Fill the screen."},
        {"samples", 0, HW_OPTION_CHOICE, &options.samples, NULL, "1|4", 0, 0, "Samples per pixel."},
        {"lod-error", 0, HW_OPTION_DOUBLE, &options.lod_error, "PX", NULL, 0.01, 100,
         "Largest projected error of configuration L in pixels."},
        {"record", 0, HW_OPTION_STRING, &options.record, "TOUR.json", NULL, 0, 0,
         "Record the walk as a tour from the start."},
        {"scene", 0, HW_OPTION_STRING, &options.scene, "SCENE", NULL, 0, 0,
         "The original scene for configurations A, B and L, if it has moved since the build."},
        {"prefetch", 0, HW_OPTION_CHOICE, &options.prefetch, NULL, "on|off", 0, 0,
         "Whether a thread loads what the walk may soon need; off: frames wait for what they "
         "lack."},
        {"bandwidth", 0, HW_OPTION_BYTES, &options.bandwidth, "BYTES", NULL, 0, 0,
         "Read the dataset with at most so many bytes a second, 5M for instance; 0: as fast as it "
         "comes."},
        {"gpu-budget", 0, HW_OPTION_BYTES, &options.gpu_budget, "BYTES", NULL, 0, 0,
         "Memory for the dataset's data on the GPU; 0: 18 MiB."},
        {"ram-budget", 0, HW_OPTION_BYTES, &options.ram_budget, "BYTES", NULL, 0, 0,
         "Memory for data on their way to the GPU; 0: 4 MiB."},
        {"frames", 0, HW_OPTION_UINT, &options.frames, "N", NULL, 0, 1e9,
         "Quit after so many frames; 0 walks on."},
    };
    uint32_t count = sizeof table / sizeof *table;
    for (uint32_t i = 0; i < count && i < capacity; i++)
        out[i] = table[i];
    return count;
}

const hw_command hw_cmd_walk = {
    .name = "walk",
    .summary = "Walk through a dataset in a window.",
    .arguments = "DATASET|URL|SCENE",
    .description =
        "Opens a window on a dataset, a folder or the URL of one on a web server. W, A, S, D or "
        "the arrows walk, Q and E go down and up, Shift "
        "runs, a click lets the mouse turn the view, and F1 shows all keys. Keys 1 to 4 switch "
        "between full geometry (A), geometry with culling (B), discrete levels of detail (L) and "
        "the hybrid (C); the first three load the original scene on first use. F12 writes a "
        "screenshot and R records a tour into the current folder.\n\n"
        "A scene file instead of a dataset can be walked through without building anything, in "
        "configurations A, B and L. Machines without a display have hexwalk render.",
    .options = fill_options,
    .positional_min = 1,
    .positional_max = 1,
    .run = run,
};
