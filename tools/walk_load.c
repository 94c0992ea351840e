#include "alloc.h"
#include "dataset_scene.h"
#include "file.h"
#include "import.h"
#include "source.h"
#include "system.h"
#include "walk.h"
#include <string.h>

#define SCENE_MARGIN 100.0 // walkable around a scene without a dataset
#define SCENE_CELL   50.0

#define OBSTACLES_PART 8u // of the bandwidth: obstacles are read beside what is drawn

// ---- What is walked through

// Chooses the first configuration; C is for datasets only.
static hw_status choose_config(walk *w)
{
    w->wanted = w->is_dataset ? HW_CONFIG_C : HW_CONFIG_B;
    if (walk_opt.config && !hw_config_parse(walk_opt.config, &w->wanted))
        return hw_fail(HW_USAGE, "--config: unknown configuration %s", walk_opt.config);
    if (w->wanted == HW_CONFIG_C && !w->is_dataset)
        return hw_fail(HW_USAGE, "%s: configuration C needs a dataset (hexwalk build makes one)",
                       w->path);
    w->waiting = true;
    return HW_OK;
}

hw_status walk_open(walk *w, const char *path)
{
    w->path = path;
    const char *slash = strrchr(path, '/');
    w->name = slash && slash[1] ? slash + 1 : path;
    w->is_dataset = hw_location_is_url(path) || hw_path_is_folder(path);
    if (!w->is_dataset && !hw_path_exists(path))
        return hw_fail(HW_NOT_FOUND, "%s: no such dataset or scene", path);
    if (w->is_dataset)
        HW_TRY(hw_manifest_open(path, &w->manifest));
    HW_TRY(choose_config(w));
    const char *scene = walk_opt.scene  ? walk_opt.scene
                        : w->is_dataset ? w->manifest.scene_path
                                        : path;
    HW_TRY(hw_strdup(&w->loader.path, scene));
    w->loader.dataset = w->is_dataset ? path : NULL;
    w->loader.manifest = &w->manifest;
    if (walk_opt.tour)
        HW_TRY(hw_tour_read(walk_opt.tour, &w->tour));
    if (!walk_opt.record)
        return HW_OK;
    // Better told now than after the walk.
    char *folder = NULL;
    HW_TRY(hw_path_dir(&folder, walk_opt.record));
    bool there = hw_path_is_folder(folder);
    hw_free(folder);
    return there ? HW_OK : hw_fail(HW_IO, "%s: its folder does not exist", walk_opt.record);
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

static hw_status keep_boxes(walk *w)
{
    const hw_scene *scene = &w->loader.scene;
    uint32_t count = w->is_dataset ? w->manifest.object_count : scene->object_count;
    HW_TRY(HW_NEW(&w->boxes, count));
    for (uint32_t i = 0; i < count; i++)
        w->boxes[i] = w->is_dataset ? w->manifest.objects[i].bounds : scene->objects[i].bounds;
    w->box_count = count;
    return HW_OK;
}

static hw_status make_obstacles(void *context)
{
    walk_obstacles *o = context;
    return hw_obstacles_create(&o->desc, &o->missing, &o->made);
}

// Of --bandwidth; 0: no limit.
static uint64_t obstacles_share(void)
{
    return (walk_opt.bandwidth + OBSTACLES_PART - 1) / OBSTACLES_PART;
}

static hw_status start_obstacles(walk *w)
{
    walk_obstacles *o = &w->obstacles;
    o->desc = (hw_obstacles_desc){.dataset = w->path,
                                  .manifest = &w->manifest,
                                  .scene = w->is_dataset ? NULL : &w->loader.scene,
                                  .bytes_per_second = obstacles_share(),
                                  .stop = &o->stop};
    w->collides = strcmp(walk_opt.collision, "on") == 0;
    return walk_task_start(&o->task, make_obstacles, o);
}

void walk_take_obstacles(walk *w, bool wait)
{
    walk_obstacles *o = &w->obstacles;
    if (!o->task.running || !(wait || walk_task_ended(&o->task)))
        return;
    // What cannot be read is no obstacle: the walk goes on.
    if (walk_task_join(&o->task) != HW_OK) {
        w->collides = false;
        walk_complain(w, "no collision");
        return;
    }
    if (o->missing > 0)
        walk_say(w, WALK_MESSAGE_MS, "%u of %u meshes cannot be read: no obstacles", o->missing,
                 w->manifest.mesh_count);
    w->walker.obstacles = w->collides ? o->made : NULL;
}

// Into the nearest cell that there is, in a dataset of which some were not made.
static void move_to_cell(walk *w)
{
    hw_tour_frame view = hw_walker_view(&w->walker);
    hw_hexgrid *grid = &w->walker.grid;
    hw_vec3 best = view.eye;
    float least = INFINITY;
    if (hw_manifest_find_cell(&w->manifest, hw_hexgrid_locate(grid, w->walker.x, w->walker.y),
                              NULL))
        return;
    for (uint32_t i = 0; i < w->manifest.cell_count; i++) {
        hw_cell_id id = w->manifest.cells[i].id;
        hw_vec3 centre = hw_cell_centre(grid, id);
        float distance = hypotf(centre.x - view.eye.x, centre.y - view.eye.y);
        if (id.level > 0 || distance >= least)
            continue;
        least = distance;
        best = hw_v3(centre.x, centre.y, view.eye.z);
    }
    hw_walker_place(&w->walker, best, view.forward);
}

// Puts the walker into the dataset's grid, or that of a scene without one.
static hw_status place_walker(walk *w)
{
    const hw_scene *scene = &w->loader.scene;
    hw_hexgrid grid = w->is_dataset ? w->manifest.grid : scene_grid(scene);
    const hw_ground *ground = w->is_dataset ? &w->manifest.ground : &scene->ground;
    float ground_z = ground->present ? ground->rect.min.z : (float)grid.z_min;
    HW_TRY(keep_boxes(w));
    hw_walker_init(&w->walker, &grid);
    hw_walker_place_default(&w->walker, w->boxes, w->box_count, ground_z);
    if (w->is_dataset)
        move_to_cell(w);
    HW_TRY(start_obstacles(w));
    w->placed = true;
    if (w->tour.frame_count > 0)
        hw_walker_play(&w->walker, &w->tour);
    if (!walk_opt.record)
        return HW_OK;
    w->record_path = walk_opt.record;
    return hw_walker_record(&w->walker);
}

// ---- Loading

static hw_status load_scene(void *context)
{
    walk_loader *loader = context;
    if (!loader->dataset)
        return hw_scene_import(loader->path, &loader->scene);
    return hw_dataset_scene_import(loader->dataset, loader->manifest, loader->path, &loader->scene);
}

// One step towards the scene; *ready once it is there.
static hw_status advance_loading(walk *w, bool *ready)
{
    walk_loader *loader = &w->loader;
    *ready = loader->loaded;
    if (loader->loaded)
        return HW_OK;
    if (!loader->task.running) {
        loader->start_ms = hw_clock_ms();
        HW_TRY(walk_task_start(&loader->task, load_scene, loader));
    }
    if (!walk_task_ended(&loader->task)) {
        walk_say(w, WALK_MESSAGE_MS, "Loading %s for configuration %s: %.0f s", loader->path,
                 hw_config_name(w->wanted), (hw_clock_ms() - loader->start_ms) / 1000);
        return HW_OK;
    }
    HW_TRY(walk_task_join(&loader->task));
    *ready = loader->loaded = true;
    return HW_OK;
}

static void show_config(walk *w, hw_config config)
{
    w->config = config;
    w->shown = w->renderers[config];
    w->waiting = false;
    w->rss_bytes = hw_rss_bytes();
    walk_say(w, WALK_MESSAGE_MS, "Configuration %s%s", walk_config_title(config),
             w->frame_count == 0 ? ": F1 lists the keys" : "");
    walk_show_title(w);
}

static void show_compare(walk *w, walk_compare compare)
{
    static const char *const texts[] = {"The plain picture",
                                        "Left as it was, right B; comma and period move the seam",
                                        "Differences in luma from B"};
    w->compare = w->wanted_compare = compare;
    walk_say(w, WALK_MESSAGE_MS, "%s", texts[compare]);
}

static hw_status make_renderer(walk *w)
{
    hw_renderer_desc desc = {
        .config = w->wanted,
        .dataset = w->is_dataset ? w->path : NULL,
        .scene = w->loader.loaded ? &w->loader.scene : NULL,
        .lod_error_px = walk_opt.lod_error,
        .near_triangles = (uint32_t)walk_opt.near_triangles,
        .hide = strcmp(walk_opt.occlusion, "on") == 0,
        .crossing_width = HW_CROSSING_WIDTH,
        .streaming = {
            .loading = strcmp(walk_opt.prefetch, "on") == 0 ? HW_LOADING_AHEAD : HW_LOADING_WAITS,
            .bytes_per_second = walk_opt.bandwidth > 1 ? walk_opt.bandwidth - obstacles_share()
                                                       : walk_opt.bandwidth,
            .gpu_budget = walk_opt.gpu_budget,
            .ram_budget = walk_opt.ram_budget}};
    HW_TRY(hw_renderer_create(&desc, &w->renderers[w->wanted]));
    hw_renderer_set_debug_view(w->renderers[w->wanted], &w->debug);
    return HW_OK;
}

// One step towards the wanted configuration. Making a renderer takes a while, so the frame before
// tells of it.
static hw_status advance_config(walk *w)
{
    bool ready = w->wanted == HW_CONFIG_C;
    if (!ready)
        HW_TRY(advance_loading(w, &ready));
    if (!ready)
        return HW_OK;
    if (!w->announced) {
        walk_say(w, WALK_MESSAGE_MS, "Preparing configuration %s", walk_config_title(w->wanted));
        w->announced = true;
        return HW_OK;
    }
    HW_TRY(make_renderer(w));
    if (!w->placed)
        HW_TRY(place_walker(w));
    w->waiting = false;
    if (w->only_make)
        show_compare(w, w->wanted_compare);
    else
        show_config(w, w->wanted);
    hw_pace_pause(&w->pace);
    return HW_OK;
}

hw_status walk_pursue_config(walk *w)
{
    hw_status status = advance_config(w);
    if (status == HW_OK || !w->shown)
        return status;
    w->waiting = false;
    w->wanted_compare = w->compare;
    walk_complain(w, "configuration stays as it is");
    return HW_OK;
}

static void wait_for(walk *w, hw_config config, bool only_make)
{
    w->wanted = config;
    w->waiting = true;
    w->announced = false;
    w->only_make = only_make;
}

void walk_want_config(walk *w, hw_config config)
{
    if (config == HW_CONFIG_C && !w->is_dataset) {
        walk_say(w, WALK_MESSAGE_MS, "Configuration C needs a dataset: this is a scene");
        return;
    }
    w->wanted_compare = w->compare; // what was waited for is forgotten
    if (w->renderers[config])
        show_config(w, config);
    else
        wait_for(w, config, false);
}

void walk_want_compare(walk *w, walk_compare compare)
{
    w->wanted_compare = compare;
    if (compare == WALK_PLAIN && w->only_make)
        w->waiting = false; // for B, which nobody wants any more
    if (compare == WALK_PLAIN || w->renderers[HW_CONFIG_B])
        show_compare(w, compare);
    else if (w->shown)
        wait_for(w, HW_CONFIG_B, true);
}

// What is under way is stopped, or waited for; how it ended does not matter any more.
static void end_tasks(walk *w)
{
    atomic_store(&w->obstacles.stop, true);
    walk_task *tasks[] = {&w->obstacles.task, &w->loader.task};
    for (int i = 0; i < 2; i++)
        if (tasks[i]->running && walk_task_join(tasks[i]) != HW_OK)
            continue;
}

// The window goes first: what is under way may take a while to end.
void walk_close(walk *w)
{
    for (int i = 0; i < 4; i++)
        hw_renderer_destroy(w->renderers[i]);
    hw_compare_view_destroy(w->compare_view);
    hw_hud_destroy(w->hud);
    hw_context_destroy(w->context);
    end_tasks(w);
    hw_scene_free(&w->loader.scene);
    hw_free(w->loader.path);
    hw_walker_free(&w->walker);
    hw_obstacles_destroy(w->obstacles.made);
    hw_free(w->boxes);
    hw_tour_free(&w->tour);
    hw_manifest_free(&w->manifest);
}
