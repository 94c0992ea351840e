// hexwalk walk: a window to walk through a dataset, or a scene without one.
#include "hybrid_options.h"
#include "interrupts.h"
#include "keys.h"
#include "log.h"
#include "system.h"
#include "walk.h"
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <string.h>

walk_options walk_opt = {.samples = "1",
                         .collision = "on",
                         .prefetch = "on",
                         .occlusion = "on",
                         .size = {1280, 720},
                         .lod_error = 1,
                         .near_triangles = HW_NEAR_TRIANGLES,
                         .seed = 1};

// Ctrl-C in the terminal, or its end, ends the walk as Escape does, so that a recording is not
// lost; a second time kills.
static volatile sig_atomic_t interrupted;

static void on_signal(int number)
{
    (void)number;
    interrupted = 1;
}

bool walk_interrupted(void)
{
    return interrupted;
}

uint32_t walk_samples(void)
{
    return strcmp(walk_opt.samples, "4") == 0 ? 4 : 1;
}

const char *walk_config_title(hw_config config)
{
    static const char *const titles[] = {"A full geometry", "B culled geometry",
                                         "L levels of detail", "C hybrid"};
    return titles[config];
}

void walk_say(walk *w, double for_ms, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(w->message, sizeof w->message, format, arguments);
    va_end(arguments);
    w->message_until_ms = hw_clock_ms() + for_ms;
}

void walk_complain(walk *w, const char *what)
{
    walk_say(w, 2 * WALK_MESSAGE_MS, "%s: %s", what, hw_error_text());
    hw_log_warning("%s: %s", what, hw_error_text());
}

void walk_show_title(walk *w)
{
    char title[256];
    snprintf(title, sizeof title, "%s - %s - Hexwalk", w->name,
             w->shown ? walk_config_title(w->config) : "loading");
    hw_context_set_title(w->context, title);
}

static hw_status run_frames(walk *w)
{
    double last_ms = hw_clock_ms();
    hw_context_present(w->context, &w->input); // learns the framebuffer's size
    while (!w->quit) {
        walk_handle_keys(w);
        w->quit = w->quit || interrupted;
        walk_take_obstacles(w, false);
        double now = hw_clock_ms();
        if (w->placed && !w->arriving)
            HW_TRY(hw_walker_update(&w->walker, &w->input, (now - last_ms) / 1000));
        last_ms = now;
        if (w->waiting) {
            HW_TRY(walk_pursue_config(w));
            // Time spent on loading is not walked.
            last_ms += hw_clock_ms() - now;
        }
        if (w->input.width > 0) {
            HW_TRY(walk_draw_frame(w));
            if (hw_pace_tick(&w->pace, hw_clock_ms(), w->loaded_bytes))
                w->rss_bytes = hw_rss_bytes();
        } else {
            hw_pace_pause(&w->pace);
        }
        w->quit = w->quit || (walk_opt.frames && w->frame_count >= walk_opt.frames);
        hw_context_present(w->context, &w->input);
    }
    return HW_OK;
}

// ---- The command

static hw_status open_window(walk *w)
{
    // A random walk draws into a target of its own: what the context has is only memory.
    bool random = walk_opt.random_walk > 0;
    hw_context_desc desc = {.kind = random ? HW_CONTEXT_OFFSCREEN : HW_CONTEXT_WINDOW,
                            .width = random ? 16 : walk_opt.size[0],
                            .height = random ? 16 : walk_opt.size[1],
                            .title = "Hexwalk",
                            .samples = walk_samples(),
                            .fullscreen = walk_opt.fullscreen};
    HW_TRY(hw_context_create(&desc, &w->context));
    walk_show_title(w);
    return hw_hud_create(&w->hud);
}

static hw_status walk_in_window(walk *w)
{
    double start_ms = hw_clock_ms();
    HW_TRY(run_frames(w));
    double seconds = (hw_clock_ms() - start_ms) / 1000;
    printf("%llu frames in %.1f s\n", (unsigned long long)w->frame_count, seconds);
    if (w->missing_count > 0)
        printf("%llu of them lacked data\n", (unsigned long long)w->missing_count);
    return HW_OK;
}

// A recording is kept whatever ended the walk.
static hw_status keep_recording(walk *w, hw_status status)
{
    char error[HW_ERROR_CAPACITY];
    if (!w->walker.recording)
        return status;
    if (status == HW_OK)
        return walk_keep_recording(w);
    hw_error_save(error);
    if (walk_keep_recording(w) != HW_OK)
        hw_log_warning("%s", hw_error_text());
    hw_error_restore(error);
    return status;
}

static hw_status run(int argc, const char *const *argv)
{
    (void)argc;
    static walk state;
    walk *w = &state;
    *w = (walk){.show_line = true, .seam = 0.5};
    hw_status status = HW_OK;
    HW_GO(walk_open(w, argv[0]));
    hw_memory_trim();
    HW_GO(open_window(w));
    hw_interrupts_handle(on_signal, SA_RESETHAND);
    status = walk_opt.random_walk > 0 ? walk_at_random(w) : walk_in_window(w);
    status = keep_recording(w, status);
out:
    walk_close(w);
    return status;
}

static uint32_t fill_options(hw_option *out, uint32_t capacity)
{
    walk_options *o = &walk_opt;
    const hw_option table[] = {
        {"tour", 0, HW_OPTION_STRING, &o->tour, "TOUR.json", NULL, 0, 0,
         "Play this tour; any key of motion leaves it, Space goes on with it."},
        {"config", 0, HW_OPTION_CHOICE, &o->config, NULL, "A|B|L|C", 0, 0,
         "Start with this configuration: full geometry (A), with culling (B), discrete levels of "
         "detail (L) or the hybrid (C); C for a dataset, B for a scene."},
        {"size", 0, HW_OPTION_SIZE, o->size, "WxH", NULL, 160, 16384, "Size of the window."},
        {"fullscreen", 0, HW_OPTION_FLAG, &o->fullscreen, NULL, NULL, 0, 0, "Fill the screen."},
        {"samples", 0, HW_OPTION_CHOICE, &o->samples, NULL, "1|4", 0, 0, "Samples per pixel."},
        {"collision", 0, HW_OPTION_CHOICE, &o->collision, NULL, "on|off", 0, 0,
         "Whether objects stand in the way; F9 changes it."},
        {"lod-error", 0, HW_OPTION_DOUBLE, &o->lod_error, "PX", NULL, 0.01, 100,
         "Largest projected error of configuration L in pixels."},
        HW_OPTION_NEAR_TRIANGLES(&o->near_triangles),
        HW_OPTION_OCCLUSION_CULLING(&o->occlusion),
        {"record", 0, HW_OPTION_STRING, &o->record, "TOUR.json", NULL, 0, 0,
         "Record the walk as a tour from the start."},
        {"scene", 0, HW_OPTION_STRING, &o->scene, "SCENE", NULL, 0, 0,
         "The original scene for configurations A, B and L, if it has moved since the build."},
        {"prefetch", 0, HW_OPTION_CHOICE, &o->prefetch, NULL, "on|off", 0, 0,
         "Whether a thread loads what the walk may soon need; off: frames wait for what they "
         "lack."},
        {"bandwidth", 0, HW_OPTION_BYTES, &o->bandwidth, "BYTES", NULL, 0, 0,
         "Read the dataset with at most so many bytes a second, 5M for instance; 0: as fast as it "
         "comes."},
        {"gpu-budget", 0, HW_OPTION_BYTES, &o->gpu_budget, "BYTES", NULL, 0, 0,
         "Memory for the dataset's data on the GPU; 0: 16M "
         "with prefetching, 24M without, for each level of cells."},
        {"ram-budget", 0, HW_OPTION_BYTES, &o->ram_budget, "BYTES", NULL, 0, 0,
         "Memory for data on their way to the GPU; 0: 4M."},
        {"frames", 0, HW_OPTION_UINT, &o->frames, "N", NULL, 0, 1e9,
         "Quit after so many frames; 0 walks on."},
        {"random-walk", 0, HW_OPTION_DOUBLE, &o->random_walk, "SECONDS", NULL, 0, 1e6,
         "Walk at random for so long instead, without a window, 30 frames to a second but as fast "
         "as it can, and tell what it met; fails if that is a place where nobody may be. 0 opens "
         "the window."},
        {"seed", 0, HW_OPTION_UINT, &o->seed, "N", NULL, 0, 1e15, "Of the random walk."},
    };
    uint32_t count = sizeof table / sizeof *table;
    for (uint32_t i = 0; i < count && i < capacity; i++)
        out[i] = table[i];
    return count;
}

static uint32_t fill_keys(hw_command_key *out, uint32_t capacity)
{
    for (size_t i = 0; i < hw_key_row_count && i < capacity; i++) {
        hw_key_format(&hw_key_rows[i], out[i].keys, sizeof out[i].keys);
        out[i].meaning = hw_key_rows[i].meaning;
    }
    return (uint32_t)hw_key_row_count;
}

const hw_command hw_cmd_walk = {
    .name = "walk",
    .summary = "Walk through a dataset in a window.",
    .arguments = "DATASET|URL|SCENE",
    .description =
        "Opens a window on a dataset, a folder or the URL of one on a web server. W, A, S and D "
        "walk, as Up and Down do, Left and Right turn, Q and E go down and up, Shift "
        "runs, a click lets the mouse turn the view, and F1 shows all keys. One cannot walk into "
        "objects, nor out of the cells. Keys 1 to 4 switch between full geometry (A), geometry "
        "with culling (B), discrete levels of detail (L) and the hybrid (C); the first three, and "
        "the views that compare with B, load the original scene on first use. F12 writes a "
        "screenshot and R records a tour into the current folder.\n\n"
        "A scene file instead of a dataset can be walked through without building anything, in "
        "configurations A, B and L. Machines without a display have hexwalk render.",
    .options = fill_options,
    .keys = fill_keys,
    .positional_min = 1,
    .positional_max = 1,
    .run = run,
};
