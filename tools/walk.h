// The parts of hexwalk walk: one struct that all of them work on. walk_load.c finds what is walked
// through and makes renderers, walk_task.c works beside the walk, walk_view.c draws a frame,
// walk_files.c writes files and the clipboard, walk_keys.c does what keys ask for, walk_random.c
// walks without a window, cmd_walk.c is the command.
#pragma once
#include "compare_view.h"
#include "context.h"
#include "hud.h"
#include "manifest.h"
#include "obstacles.h"
#include "options.h"
#include "pace.h"
#include "renderer.h"
#include "tour.h"
#include "walker.h"
#include <pthread.h>
#include <stdatomic.h>

#define WALK_MESSAGE_MS 4000.0

typedef struct walk_options {
    const char *tour, *config, *samples, *record, *scene, *collision, *prefetch, *occlusion;
    uint32_t size[2];
    bool fullscreen;
    double lod_error, random_walk;
    uint64_t frames, seed, bandwidth, gpu_budget, ram_budget, near_triangles;
} walk_options;
extern walk_options walk_opt;

// Something that is done beside the walk, which goes on meanwhile. Zero-initialise.
typedef struct walk_task {
    hw_status (*work)(void *context);
    void *context;
    pthread_t thread;
    bool running;     // of the walk's thread: to be joined
    atomic_bool done; // the worker's last word; what follows is the walk's from then on
    hw_status status;
    char error[HW_ERROR_CAPACITY];
} walk_task;

// The original scene.
typedef struct walk_loader {
    walk_task task;
    bool loaded;
    char *path;
    const char *dataset; // NULL: the path is what is walked through
    const hw_manifest *manifest;
    hw_scene scene;
    double start_ms;
} walk_loader;

// What a visitor bumps into.
typedef struct walk_obstacles {
    walk_task task;
    atomic_bool stop;
    hw_obstacles_desc desc;
    hw_obstacles *made;
    uint32_t missing; // meshes that could not be read
} walk_obstacles;

// What is shown besides the plain picture.
typedef enum walk_compare { WALK_PLAIN, WALK_SPLIT, WALK_ERRORS } walk_compare;

typedef struct walk {
    const char *path, *name;
    bool is_dataset;
    hw_manifest manifest;
    walk_loader loader;
    hw_context *context;
    hw_hud *hud;
    hw_renderer *renderers[4]; // by configuration, made on first use
    hw_renderer *shown;        // one of them; NULL until the first is there
    hw_config config;          // of `shown`
    // What comes next, while `waiting`. The truth to compare with is made, but not shown.
    hw_config wanted;
    bool waiting, announced, only_make;
    hw_walker walker;
    bool placed; // the walker has a grid
    walk_obstacles obstacles;
    bool collides; // once there are obstacles
    hw_box *boxes; // of the objects, for the map
    uint32_t box_count;
    hw_tour tour;
    const char *record_path; // where the present recording goes
    char record_name[64];
    hw_input input;
    bool show_line, show_help, show_map, quit;
    walk_compare compare; // `wanted_compare` once B is there
    walk_compare wanted_compare;
    hw_compare_view *compare_view;
    bool arriving; // what is shown has nothing to draw yet
    double seam;   // 0 to 1
    double psnr;   // of the last frame's difference
    hw_debug_view debug;
    char message[512];
    double message_until_ms;
    hw_pace pace;
    uint64_t rss_bytes; // of the process, when the pace's figures were made
    hw_frame_stats stats;
    uint64_t stalls;                     // so far
    uint64_t loaded_bytes, read_bytes;   // by the last frame; by the hybrid since its start
    uint64_t frame_count, missing_count; // missing: frames that lacked data
    uint32_t problem_count;              // of the dataset's files that the visitor was told of
} walk;

uint32_t walk_samples(void);
// Whether the walk was asked to end from outside.
bool walk_interrupted(void);
// "A full geometry", ...
const char *walk_config_title(hw_config config);
// A message at the bottom of the window for a while.
void walk_say(walk *w, double for_ms, const char *format, ...) HW_PRINTF(3, 4);
// A failure that need not end the walk: said, and logged.
void walk_complain(walk *w, const char *what);
void walk_show_title(walk *w);

// ---- walk_load.c

// Checks the path and the options, and reads what is small.
HW_MUST_USE hw_status walk_open(walk *w, const char *path);
// One step towards the wanted configuration, once a frame while `waiting`. One that cannot be had
// ends the walk only if there is nothing else to show.
HW_MUST_USE hw_status walk_pursue_config(walk *w);
// Switches to a configuration, at once or when it is there.
void walk_want_config(walk *w, hw_config config);
// Compares with B, at once or when it is there.
void walk_want_compare(walk *w, walk_compare compare);
// Takes the obstacles once they are there, waiting for them with `wait`; said if there are none.
void walk_take_obstacles(walk *w, bool wait);
void walk_close(walk *w);

// ---- walk_task.c

HW_MUST_USE hw_status walk_task_start(walk_task *task, hw_status (*work)(void *context),
                                      void *context);
// Whether it runs and has ended, so that joining does not wait.
bool walk_task_ended(walk_task *task);
// Waits for the end and returns its status, with its message.
HW_MUST_USE hw_status walk_task_join(walk_task *task);

// ---- walk_view.c

// The present view into the bound framebuffer, without the HUD.
HW_MUST_USE hw_status walk_draw_view(walk *w, const hw_camera *camera);
// Loads, draws and lays the HUD over it.
HW_MUST_USE hw_status walk_draw_frame(walk *w);

// ---- walk_files.c

HW_MUST_USE hw_status walk_screenshot(walk *w, const hw_camera *camera, char *name,
                                      size_t capacity);
HW_MUST_USE hw_status walk_start_recording(walk *w);
HW_MUST_USE hw_status walk_write_recording(walk *w);
// The same at the end of a walk: under another name in the current folder if it fails, which is an
// error all the same.
HW_MUST_USE hw_status walk_keep_recording(walk *w);
void walk_copy_camera(walk *w);
HW_MUST_USE hw_status walk_paste_camera(walk *w);

// ---- walk_keys.c

void walk_handle_keys(walk *w);
// "wireframe, culling frozen"; empty if all is plain.
void walk_list_views(const walk *w, char *out, size_t capacity);

// ---- walk_random.c

// Walks at random for so many seconds, off screen, in steps of a 30th; prints what it found.
// HW_FORMAT if the walker came where none may be.
HW_MUST_USE hw_status walk_at_random(walk *w);
