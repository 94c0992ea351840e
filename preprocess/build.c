#include "build.h"
#include "alloc.h"
#include "file.h"
#include "hash.h"
#include "hierarchy.h"
#include "image_io.h"
#include "import.h"
#include "log.h"
#include "manifest.h"
#include "mesh_file.h"
#include "parallel.h"
#include "rays.h"
#include "scene_split.h"
#include "scene_upright.h"
#include "shard.h"
#include "system.h"
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// The grid is at least this many cell sizes wide and deep, so that one can walk round a lone
// statue.
#define GRID_SIDE_MIN 5.0

// Left to itself, a build has one level where that takes no more than some hundred megabytes:
// groups halve the bytes, but pictures are a little less true, and crossings between groups show
// more.
#define ONE_LEVEL_CELLS_MAX 1000u
#define GROUPED_LEVELS      3

// A cell, and its place among all.
typedef struct cell_turn {
    hw_cell_id id;
    uint32_t place;
} cell_turn;

typedef struct build {
    const hw_build_options *options;
    hw_build_report *report;
    uint32_t threads;
    hw_scene scene;
    hw_chain *chains;
    hw_rays *rays;
    hw_details *details;
    hw_capturer *capturer;
    hw_occlusion *occlusion; // NULL without culling
    hw_hexgrid grid;
    hw_cell_id *cells; // of all levels, as in the manifest
    uint32_t cell_count;
    bool *wanted;                              // per cell; NULL: all are
    uint64_t scene_hash, key, scene_triangles; // of the scene as it was read
    int32_t *texture_of_material, texture_count;
    hw_progress *progress;
    hw_budget *budget;     // NULL: no bound
    uint32_t *mesh_order;  // by falling size
    uint32_t *order;       // objects by mesh, with a bound
    bool *backwards;       // per thread: the way of its last cell
    hw_groups **groups;    // per thread
    cell_turn *turns;      // in which the cells are made
    pthread_mutex_t mutex; // guards what the report adds up
    uint64_t far_records, far_triangles, near_records;
} build;

hw_build_options hw_build_defaults(void)
{
    return (hw_build_options){
        .cell_size = 50,
        .levels = 0,
        .z_min = 8,
        .z_max = 16,
        .piece_cells = 1,
        .near_error_px = 0.36,
        .far = {.policy = &hw_policy_screen,
                .self_occlusion_px = 20,
                .edge_length_px = 4.5,
                .outline_px = 0.045,
                .interior_px = 5,
                .multi_textured_px = 120,
                .multi_view_count = 3,
                .multi_blend = false,
                .multi_outline_px = 0.03,
                .multi_interior_px = 3,
                .impostor_px = 1,
                .relief_px = 0.12,
                .capture_side_max = 1024,
                .capture_samples = 2},
        .chain = {.face_floor = 40, .importance_floor = 0.05f, .pull_back = 0.25f},
        .cull = HW_OCCLUSION_OFF,
        .occlusion = hw_occlusion_defaults(),
        .cluster_error_px = 10,
    };
}

// ---- inputs ----------------------------------------------------------------------------------

static uint64_t hash_number(uint64_t h, double value)
{
    return hw_hash(h, &value, sizeof value);
}

// Culling does, and clusters, whose members hide each other.
static bool needs_occlusion(const hw_build_options *o)
{
    return o->cull != HW_OCCLUSION_OFF || o->clusters;
}

// Everything the content depends on, and nothing else (not threads, shards, paths).
static uint64_t make_key(const build *b)
{
    const hw_build_options *o = b->options;
    const double numbers[] = {HW_BUILD_VERSION,
                              o->cell_size,
                              b->grid.levels,
                              o->z_min,
                              o->z_max,
                              o->near_error_px,
                              o->far.self_occlusion_px,
                              o->far.edge_length_px,
                              o->far.outline_px,
                              o->far.interior_px,
                              o->far.multi_view_px,
                              o->far.multi_textured_px,
                              o->far.multi_view_count,
                              o->far.multi_blend,
                              o->far.multi_outline_px,
                              o->far.multi_interior_px,
                              o->far.impostor_px,
                              o->far.relief_px,
                              o->far.capture_side_max,
                              o->far.capture_samples,
                              o->chain.face_floor,
                              o->chain.importance_floor,
                              o->chain.pull_back,
                              o->cull,
                              o->cull ? o->occlusion.eyes : 0,
                              o->cull ? o->occlusion.more : 0,
                              needs_occlusion(o) ? o->occlusion.face_eyes : 0,
                              o->cull ? o->occlusion.margin : 0,
                              o->clusters,
                              o->clusters ? o->cluster_error_px : 0};
    uint64_t key = hw_hash(b->scene_hash, o->far.policy->name, strlen(o->far.policy->name));
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        key = hash_number(key, numbers[i]);
    return b->report->meshes_cut > 0 ? hash_number(key, o->piece_cells) : key;
}

static hw_hexgrid make_grid(const build *b)
{
    const hw_build_options *o = b->options;
    hw_box box = hw_scene_bounds(&b->scene);
    double ground = b->scene.ground.present ? b->scene.ground.rect.min.z : box.min.z;
    double least = GRID_SIDE_MIN * o->cell_size;
    double grow_x = fmax(0, (least - (box.max.x - box.min.x)) / 2),
           grow_y = fmax(0, (least - (box.max.y - box.min.y)) / 2);
    hw_hexgrid grid =
        hw_hexgrid_cover(box.min.x - grow_x, box.min.y - grow_y, box.max.x + grow_x,
                         box.max.y + grow_y, o->cell_size, ground + o->z_min, ground + o->z_max);
    grid.levels = o->levels                                             ? o->levels
                  : hw_hexgrid_cell_count(&grid) <= ONE_LEVEL_CELLS_MAX ? 1
                                                                        : GROUPED_LEVELS;
    return grid;
}

static bool is_wanted(const build *b, uint32_t cell)
{
    return !b->wanted || b->wanted[cell];
}

// Marks the cells that the tour's frames stand in, and the groups that hold them.
static hw_status want_cells(build *b)
{
    const hw_tour *tour = b->options->along;
    if (!tour)
        return HW_OK;
    if (b->options->shard_count > 1)
        return hw_fail(HW_USAGE, "cells along a tour are not made in shards");
    HW_TRY(HW_NEW(&b->wanted, b->cell_count));
    uint32_t every = b->options->along_every ? b->options->along_every : 1;
    for (uint64_t i = 0; i < tour->frame_count; i += every) {
        hw_vec3 eye = tour->frames[i].eye;
        hw_cell_id id = hw_hexgrid_locate(&b->grid, (double)eye.x, (double)eye.y);
        for (; id.level < b->grid.levels; id = hw_cell_parent(id)) {
            uint32_t cell = hw_hierarchy_find(b->cells, b->cell_count, id);
            if (cell < b->cell_count)
                b->wanted[cell] = true;
        }
    }
    return HW_OK;
}

static hw_status load_scene(build *b)
{
    double start = hw_clock_ms();
    HW_TRY(hw_scene_import(b->options->scene_path, &b->scene));
    double area = 0;
    for (uint32_t i = 0; i < b->scene.mesh_count; i++)
        area += hw_mesh_area(&b->scene.meshes[i]);
    if (!(area > 0))
        return hw_fail(HW_FORMAT, "%s: no triangle has an area", b->options->scene_path);
    b->scene_hash = hw_scene_hash(&b->scene);
    b->scene_triangles = hw_scene_triangle_count(&b->scene);
    HW_TRY(hw_scene_stand_upright(&b->scene));
    if (b->options->piece_cells > 0)
        HW_TRY(hw_scene_split(&b->scene, b->options->piece_cells * b->options->cell_size,
                              &b->report->meshes_cut));
    b->grid = make_grid(b);
    if (b->grid.columns == HW_GRID_SIDE_MAX || b->grid.rows == HW_GRID_SIDE_MAX)
        return hw_fail(HW_LIMIT,
                       "%s: too large for cells of %g units: %d x %d of them; give a "
                       "larger --cell-size",
                       b->options->scene_path, b->options->cell_size, b->grid.columns,
                       b->grid.rows);
    b->key = make_key(b);
    HW_TRY(hw_hierarchy_cells(&b->grid, &b->cells, &b->cell_count));
    HW_TRY(want_cells(b));
    b->report->import_seconds = (hw_clock_ms() - start) / 1000;
    return HW_OK;
}

// With a bound of memory, the scene moves into a scratch file.
static hw_status set_budget(build *b)
{
    if (b->options->memory_bytes == 0)
        return HW_OK;
    HW_TRY(hw_budget_create(&b->budget, b->options->memory_bytes, b->options->dataset));
    HW_TRY(hw_budget_check_peak(b->budget, "reading the scene"));
    return hw_budget_take_scene(b->budget, &b->scene);
}

static bool owns(const build *b, uint32_t item)
{
    return hw_shard_owns(b->options->shard_index, b->options->shard_count, item);
}

// ---- chains and meshes -----------------------------------------------------------------------

// About what making a chain needs at its peak, per triangle: measured, on the safe side.
#define CHAIN_BYTES  700u
#define MESH_BYTES   400u                // likewise, writing a near mesh
#define INSIDE_BYTES (UINT64_C(2) << 20) // and looking into a level of it

// Numbers from 0 by rising key; equal keys in the order of the numbers.
typedef struct keyed {
    uint32_t key, number;
} keyed;

static int by_key(const void *x, const void *y)
{
    const keyed *a = x, *b = y;
    if (a->key != b->key)
        return a->key < b->key ? -1 : 1;
    return (a->number > b->number) - (a->number < b->number);
}

static hw_status order_by_key(keyed *keys, uint32_t count, uint32_t **out)
{
    HW_TRY(HW_NEW(out, count));
    qsort(keys, count, sizeof *keys, by_key);
    for (uint32_t i = 0; i < count; i++)
        (*out)[i] = keys[i].number;
    return HW_OK;
}

static hw_status make_chain(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    build *b = context;
    uint32_t m = b->mesh_order[index], triangles = b->scene.meshes[m].index_count / 3;
    hw_chain_options options = b->options->chain;
    options.shade_step = b->scene.meshes[m].uvs ? 0 : HW_NEAR_LEVEL_STRIDE;
    options.threads = b->threads;
    uint64_t bytes = (uint64_t)triangles * CHAIN_BYTES;
    HW_TRY(hw_budget_reserve(b->budget, bytes));
    hw_status status = hw_chain_make(&b->scene.meshes[m], &options, &b->chains[m]);
    if (status == HW_OK && b->budget)
        status = hw_budget_take_chain(b->budget, m, &b->chains[m]);
    hw_budget_release(b->budget, bytes);
    hw_progress_add(b->progress, triangles);
    return status;
}

// The largest first, beside each other; the threads that the last ones leave over help with those.
static hw_status make_chains(build *b)
{
    hw_status status = HW_OK;
    double start = hw_clock_ms();
    keyed *keys = NULL;
    uint64_t total = 0;
    HW_GO(HW_NEW(&b->chains, b->scene.mesh_count));
    HW_GO(HW_NEW(&keys, b->scene.mesh_count));
    for (uint32_t i = 0; i < b->scene.mesh_count; i++) {
        keys[i] = (keyed){UINT32_MAX - b->scene.meshes[i].index_count, i};
        total += b->scene.meshes[i].index_count / 3;
    }
    HW_GO(order_by_key(keys, b->scene.mesh_count, &b->mesh_order));
    HW_GO(hw_progress_create(&b->progress, "levels of detail", total));
    HW_GO(
        hw_parallel_for(b->scene.mesh_count, b->options->threads, make_chain, b, b->options->stop));
    b->report->chain_seconds = (hw_clock_ms() - start) / 1000;
out:
    hw_free(keys);
    hw_progress_destroy(b->progress);
    b->progress = NULL;
    return status;
}

static bool mesh_file_is_current(const char *path, uint64_t key, uint32_t level_count)
{
    hw_mesh_file *file = NULL;
    bool current = hw_mesh_file_open(&file, path) == HW_OK && hw_mesh_file_key(file) == key &&
                   hw_mesh_file_level_count(file) == level_count;
    for (uint32_t l = 0; current && l < level_count; l++) {
        hw_mesh level = {0};
        current = hw_mesh_file_read(file, l, &level, NULL) == HW_OK;
        hw_mesh_free(&level);
    }
    hw_mesh_file_close(file);
    return current;
}

// The levels of a mesh that near objects are drawn with.
typedef struct near_mesh {
    uint32_t count;
    hw_mesh levels[HW_MESH_LEVELS_MAX]; // borrowed
    hw_mesh_level_info infos[HW_MESH_LEVELS_MAX];
    hw_inner_boxes boxes[HW_MESH_LEVELS_MAX];
} near_mesh;

// Of a level as it is drawn, so that what its boxes hide is hidden by it too.
static hw_status look_inside(void *context, uint64_t level, uint32_t thread)
{
    (void)thread;
    near_mesh *m = context;
    bool solid;
    HW_TRY(hw_mesh_is_solid(&m->levels[level], &solid));
    if (!solid)
        return HW_OK;
    HW_TRY(hw_inner_boxes_find(&m->levels[level], &m->boxes[level]));
    hw_inner_boxes_fit(&m->levels[level], &m->boxes[level]);
    return HW_OK;
}

static hw_status write_mesh(void *context, uint64_t mesh, uint32_t thread)
{
    (void)thread;
    const build *b = context;
    hw_status status = HW_OK;
    char *path = NULL;
    uint32_t mesh_idx = (uint32_t)mesh;
    if (!owns(b, mesh_idx))
        return HW_OK;
    const hw_chain *chain = &b->chains[mesh_idx];
    near_mesh near = {0};
    uint32_t chain_count = chain->levels[0].uvs ? 1 : chain->level_count;
    for (uint32_t l = 0; l < chain_count; l += HW_NEAR_LEVEL_STRIDE) {
        near.levels[near.count] = chain->levels[l];
        near.infos[near.count++] = chain->infos[l];
    }
    HW_GO(hw_mesh_path(&path, b->options->dataset, mesh_idx));
    uint64_t bytes = (uint64_t)chain->infos[0].index_count / 3 * MESH_BYTES + INSIDE_BYTES;
    HW_GO(hw_budget_reserve(b->budget, bytes));
    if (!mesh_file_is_current(path, b->key, near.count)) {
        status = hw_parallel_for(near.count, b->threads, look_inside, &near, NULL);
        if (status == HW_OK)
            status =
                hw_mesh_file_write(path, b->key, near.levels, near.infos, near.boxes, near.count);
    }
    hw_budget_release(b->budget, bytes);
out:
    hw_free(path);
    return status;
}

static hw_status write_texture(build *b, uint32_t material_idx)
{
    hw_status status = HW_OK;
    char *path = NULL;
    const hw_material *material = &b->scene.materials[material_idx];
    b->texture_of_material[material_idx] = -1;
    if (!material->texture.data)
        return HW_OK;
    int32_t texture_idx = b->texture_of_material[material_idx] = b->texture_count++;
    if (!owns(b, (uint32_t)texture_idx))
        return HW_OK;
    HW_GO(hw_texture_path(&path, b->options->dataset, (uint32_t)texture_idx));
    HW_GO(hw_image_write(path, &material->texture));
out:
    hw_free(path);
    return status;
}

static hw_status write_meshes(build *b)
{
    double start = hw_clock_ms();
    HW_TRY(HW_NEW(&b->texture_of_material, b->scene.material_count));
    HW_TRY(
        hw_parallel_for(b->scene.mesh_count, b->options->threads, write_mesh, b, b->options->stop));
    for (uint32_t i = 0; i < b->scene.material_count; i++)
        HW_TRY(write_texture(b, i));
    b->report->mesh_seconds = (hw_clock_ms() - start) / 1000;
    return HW_OK;
}

// ---- cells -----------------------------------------------------------------------------------

// Adds what was made to the report.
static void count_made(build *b, const hw_cell *cell, const hw_cell_seconds *s, double write)
{
    hw_cell_seconds *parts = &b->report->cell_parts;
    pthread_mutex_lock(&b->mutex);
    b->report->cells_made++;
    b->far_records += cell->far_count;
    b->far_triangles += cell->index_count / 3;
    b->near_records += cell->near_count;
    parts->classify += s->classify;
    parts->simplify += s->simplify;
    parts->capture += s->capture;
    parts->pack += s->pack;
    b->report->cell_write_seconds += write;
    pthread_mutex_unlock(&b->mutex);
}

// With a bound of memory each thread goes through the objects mesh by mesh, forth and back from
// cell to cell, so that what it used last serves it first.
static hw_status build_cell(build *b, hw_cell_id id, const char *path, uint32_t thread)
{
    hw_status status;
    hw_cell cell = {0};
    hw_cell_seconds seconds = {0};
    hw_cell_inputs inputs = {.scene = &b->scene,
                             .chains = b->chains,
                             .capturer = b->capturer,
                             .occlusion = b->occlusion,
                             .cull_objects = b->options->cull != HW_OCCLUSION_OFF,
                             .cull_faces = b->options->cull == HW_OCCLUSION_TRIANGLES,
                             .grid = &b->grid,
                             .groups = b->groups[thread],
                             .clusters = b->options->clusters,
                             .cluster_error_px = b->options->cluster_error_px,
                             .far = b->options->far,
                             .near_error_px = b->options->near_error_px,
                             .key = b->key,
                             .order = b->order,
                             .backwards = b->backwards[thread],
                             .budget = b->budget};
    b->backwards[thread] = b->budget && !b->backwards[thread];
    HW_GO(hw_build_cell(&inputs, id, &cell, &seconds));
    double start = hw_clock_ms();
    HW_GO(hw_cell_write(&cell, path));
    count_made(b, &cell, &seconds, (hw_clock_ms() - start) / 1000);
    hw_progress_add(b->progress, 1);
out:
    hw_cell_free(&cell);
    return status;
}

static hw_status make_cell(void *context, uint64_t index, uint32_t thread)
{
    build *b = context;
    hw_status status = HW_OK;
    char *path = NULL;
    uint32_t place = b->turns[index].place;
    hw_cell_id id = b->cells[place];
    if (!owns(b, place) || !is_wanted(b, place))
        return HW_OK;
    HW_GO(hw_cell_path(&path, b->options->dataset, id));
    if (hw_cell_is_current(path, b->key)) {
        pthread_mutex_lock(&b->mutex);
        b->report->cells_kept++;
        pthread_mutex_unlock(&b->mutex);
        hw_progress_skip(b->progress, 1);
    } else {
        HW_GO(build_cell(b, id, path, thread));
    }
out:
    hw_free(path);
    return status;
}

// The tree of the whole scene, which occlusion needs: within a bound it must fit as it is.
static hw_status make_whole_rays(build *b)
{
    uint64_t bytes = 0;
    for (uint32_t i = 0; i < b->scene.mesh_count; i++)
        bytes += hw_rays_build_bytes(&b->scene.meshes[i]);
    HW_TRY(hw_budget_reserve(b->budget, bytes));
    hw_status status = hw_rays_create_scene(&b->rays, &b->scene);
    hw_budget_release(b->budget, bytes);
    return status;
}

static hw_status make_rays(build *b)
{
    hw_status status = HW_OK;
    double start = hw_clock_ms();
    keyed *keys = NULL;
    if (b->budget && !needs_occlusion(b->options)) {
        HW_GO(HW_NEW(&keys, b->scene.object_count));
        for (uint32_t i = 0; i < b->scene.object_count; i++)
            keys[i] = (keyed){b->scene.objects[i].mesh_idx, i};
        HW_GO(order_by_key(keys, b->scene.object_count, &b->order));
        HW_GO(hw_budget_create_rays(b->budget, &b->scene, &b->rays));
    } else {
        HW_GO(make_whole_rays(b));
    }
    HW_GO(hw_details_create(&b->scene, b->rays, b->chains, b->budget, &b->details));
    HW_GO(hw_capturer_create(&b->scene, b->rays, b->details, &b->capturer));
    if (needs_occlusion(b->options))
        HW_GO(hw_occlusion_create(&b->occlusion, &b->scene, b->rays, &b->grid,
                                  &b->options->occlusion));
    b->report->rays_seconds = (hw_clock_ms() - start) / 1000;
out:
    hw_free(keys);
    return status;
}

static hw_status make_groups(build *b)
{
    HW_TRY(HW_NEW(&b->groups, b->threads));
    for (uint32_t i = 0; i < b->threads; i++)
        HW_TRY(hw_groups_create(&b->grid, &b->scene, b->chains, &b->options->far, &b->groups[i]));
    return HW_OK;
}

// Groups first: they take longest. Cells of the same groups follow each other.
static int by_turn(const void *x, const void *y)
{
    const cell_turn *a = x, *b = y;
    if (a->id.level != b->id.level)
        return a->id.level > b->id.level ? -1 : 1;
    for (int32_t l = HW_CELL_LEVELS_MAX - 1; l >= a->id.level; l--) {
        hw_cell_id p = hw_cell_ancestor(a->id, l), q = hw_cell_ancestor(b->id, l);
        if (p.q != q.q)
            return p.q < q.q ? -1 : 1;
        if (p.r != q.r)
            return p.r < q.r ? -1 : 1;
    }
    return 0;
}

static hw_status order_cells(build *b)
{
    HW_TRY(HW_NEW(&b->turns, b->cell_count));
    for (uint32_t i = 0; i < b->cell_count; i++)
        b->turns[i] = (cell_turn){b->cells[i], i};
    qsort(b->turns, b->cell_count, sizeof *b->turns, by_turn);
    return HW_OK;
}

static hw_status make_cells(build *b)
{
    hw_status status = HW_OK;
    double start = hw_clock_ms();
    uint32_t count = b->cell_count, mine = 0;
    for (uint32_t i = 0; i < count; i++)
        mine += owns(b, i) && is_wanted(b, i);
    b->report->cells_total = count;
    HW_GO(HW_NEW(&b->backwards, b->threads));
    HW_GO(make_groups(b));
    HW_GO(order_cells(b));
    HW_GO(hw_progress_create(&b->progress, "cells", mine));
    HW_GO(hw_parallel_for(count, b->threads, make_cell, b, b->options->stop));
out:
    hw_progress_destroy(b->progress);
    b->progress = NULL;
    if (b->report->cells_made > 0) {
        double made = b->report->cells_made;
        b->report->far_records_mean = (double)b->far_records / made;
        b->report->far_triangles_mean = (double)b->far_triangles / made;
        b->report->near_records_mean = (double)b->near_records / made;
    }
    b->report->scratch_bytes = hw_budget_scratch_bytes(b->budget);
    b->report->tree_builds = hw_rays_builds(b->rays) + hw_details_builds(b->details);
    b->report->cell_seconds = (hw_clock_ms() - start) / 1000;
    return status;
}

// ---- manifest --------------------------------------------------------------------------------

// Adds up what the cell files hold; false if one is missing or of another build.
static bool count_cell(build *b, hw_cell_id id, hw_manifest_cell *out)
{
    static const uint32_t mesh_tags[] = {HW_FOURCC('V', 'E', 'R', 'T'),
                                         HW_FOURCC('I', 'N', 'D', 'X'),
                                         HW_FOURCC('C', 'O', 'L', 'R')};
    static const uint32_t texture_tags[] = {HW_FOURCC('A', 'T', 'L', 'S'),
                                            HW_FOURCC('C', 'O', 'V', 'R')};
    char *path = NULL;
    hw_container *container = NULL;
    size_t raw, stored;
    bool good = hw_cell_path(&path, b->options->dataset, id) == HW_OK &&
                hw_container_open(&container, path, HW_CELL_MAGIC) == HW_OK &&
                hw_container_key(container) == b->key;
    if (good) {
        *out = (hw_manifest_cell){id, hw_container_bytes(container)};
        b->report->bytes += out->bytes;
        for (int i = 0; i < 3; i++)
            if (hw_container_chunk_size(container, mesh_tags[i], 0, &raw, &stored) == HW_OK)
                b->report->mesh_bytes += stored;
        for (int i = 0; i < 2; i++)
            if (hw_container_chunk_size(container, texture_tags[i], 0, &raw, &stored) == HW_OK)
                b->report->texture_bytes += stored;
    }
    hw_container_close(container);
    hw_free(path);
    return good;
}

// The bytes of a near mesh (opened, but not read through) or a texture; false if it is not there.
static bool count_near(build *b, bool is_mesh, uint32_t index)
{
    char *path = NULL;
    hw_mesh_file *file = NULL;
    hw_reader *reader = NULL;
    bool good = (is_mesh ? hw_mesh_path(&path, b->options->dataset, index)
                         : hw_texture_path(&path, b->options->dataset, index)) == HW_OK;
    if (good && is_mesh)
        good = hw_mesh_file_open(&file, path) == HW_OK && hw_mesh_file_key(file) == b->key;
    if (good && hw_reader_open(&reader, path) == HW_OK)
        b->report->near_bytes += hw_reader_size(reader);
    good = good && reader;
    hw_reader_close(reader);
    hw_mesh_file_close(file);
    hw_free(path);
    return good;
}

// Sums over all that is there, or over the shard's own. Cells that were not wanted count where an
// earlier build left them.
static void count_files(build *b, bool all, hw_manifest *m)
{
    hw_build_report *r = b->report;
    uint32_t count = b->cell_count;
    r->bytes = r->mesh_bytes = r->texture_bytes = r->near_bytes = 0;
    r->cells_missing = r->meshes_missing = r->cells_left_out = m->cell_count = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (!all && !owns(b, i))
            continue;
        if (count_cell(b, b->cells[i], &m->cells[m->cell_count]))
            m->cell_count++;
        else if (is_wanted(b, i))
            r->cells_missing++;
        else
            r->cells_left_out++;
    }
    for (uint32_t i = 0; i < b->scene.mesh_count; i++)
        if (all || owns(b, i))
            r->meshes_missing += !count_near(b, true, i);
    for (uint32_t i = 0; i < (uint32_t)b->texture_count; i++)
        if (all || owns(b, i))
            r->meshes_missing += !count_near(b, false, i);
    r->bytes += r->near_bytes;
}

static hw_status fill_objects(const build *b, hw_manifest *m)
{
    HW_TRY(HW_NEW(&m->objects, b->scene.object_count));
    m->object_count = b->scene.object_count;
    for (uint32_t i = 0; i < m->object_count; i++) {
        const hw_object *o = &b->scene.objects[i];
        const hw_material *material = &b->scene.materials[o->material_idx];
        m->objects[i] =
            (hw_manifest_object){.mesh_idx = o->mesh_idx,
                                 .transform = o->transform,
                                 .bounds = o->bounds,
                                 .texture_idx = b->texture_of_material[o->material_idx]};
        memcpy(m->objects[i].color, material->base_color, sizeof m->objects[i].color);
    }
    return HW_OK;
}

// Whether objects may be MVMeshes (svmesh.h).
static bool may_have_views(const build *b)
{
    const hw_far_options *o = &b->options->far;
    bool textured = false;
    for (uint32_t i = 0; i < b->scene.mesh_count; i++)
        textured = textured || b->scene.meshes[i].uvs;
    return o->multi_view_px > o->self_occlusion_px ||
           (textured && o->multi_textured_px > o->self_occlusion_px);
}

static hw_status write_manifest(build *b, double start_ms)
{
    hw_status status = HW_OK;
    const hw_build_options *o = b->options;
    hw_manifest m = {0};
    HW_GO(HW_NEW(&m.cells, b->cell_count));
    count_files(b, true, &m);
    uint32_t cells_missing = b->report->cells_missing, meshes_missing = b->report->meshes_missing;
    bool whole = cells_missing + meshes_missing == 0;
    if (!whole) {
        count_files(b, false, &m);
        if (b->report->cells_missing + b->report->meshes_missing > 0 || o->shard_count <= 1)
            HW_GO(hw_fail(HW_IO, "%s: a file that was just made cannot be read", o->dataset));
        b->report->cells_missing = cells_missing;
        b->report->meshes_missing = meshes_missing;
        m.shard_index = o->shard_index;
        m.shard_count = o->shard_count;
    }
    b->report->total_seconds = (hw_clock_ms() - start_ms) / 1000;
    m.scene_path = realpath(o->scene_path, NULL);
    HW_GO(hw_strdup(&m.policy, o->far.policy->name));
    m.scene_hash = b->scene_hash;
    m.key = b->key;
    m.clusters = o->clusters;
    m.multi_view = may_have_views(b);
    m.scene_triangles = b->scene_triangles;
    m.self_occlusion_px = o->far.self_occlusion_px;
    m.edge_length_px = o->far.edge_length_px;
    m.near_error_px = o->near_error_px;
    m.build_seconds = b->report->total_seconds;
    m.mesh_bytes = b->report->mesh_bytes;
    m.texture_bytes = b->report->texture_bytes;
    m.near_bytes = b->report->near_bytes;
    m.grid = b->grid;
    m.ground = b->scene.ground;
    m.mesh_count = b->scene.mesh_count;
    m.texture_count = (uint32_t)b->texture_count;
    HW_GO(fill_objects(b, &m));
    if (whole) {
        HW_GO(hw_manifest_write(o->dataset, &m));
        HW_GO(hw_shards_remove(o->dataset));
    } else {
        HW_GO(hw_shard_write(o->dataset, &m));
    }
out:
    hw_manifest_free(&m);
    return status;
}

// ---- the whole -------------------------------------------------------------------------------

static hw_status make_folder(const build *b, const char *name)
{
    char *path = NULL;
    HW_TRY(hw_path_join(&path, b->options->dataset, name));
    hw_status status = hw_dir_make(path);
    if (status == HW_OK)
        status = hw_dir_clean_temporary(path);
    hw_free(path);
    return status;
}

static hw_status make_folders(const build *b)
{
    HW_TRY(make_folder(b, ""));
    HW_TRY(make_folder(b, "cells"));
    HW_TRY(make_folder(b, "meshes"));
    for (int32_t l = 0; l < b->grid.levels; l++) {
        char name[32];
        snprintf(name, sizeof name, "cells/%d", l);
        HW_TRY(make_folder(b, name));
    }
    return HW_OK;
}

// What a finished dataset of another scene or of other options held is replaced file by file: from
// now on it is none.
static hw_status leave_other(const build *b)
{
    hw_manifest manifest;
    char *path = NULL;
    hw_status status = hw_manifest_read(b->options->dataset, &manifest);
    bool other = status == HW_VERSION || (status == HW_OK && manifest.key != b->key);
    if (status == HW_OK)
        hw_manifest_free(&manifest);
    if (!other)
        return HW_OK;
    HW_TRY(hw_path_join(&path, b->options->dataset, "manifest.json"));
    status = unlink(path) == 0 || errno == ENOENT
                 ? HW_OK
                 : hw_fail(HW_IO, "%s: cannot be removed: %s", path, strerror(errno));
    hw_free(path);
    return status;
}

static void release(build *b)
{
    hw_capturer_destroy(b->capturer);
    hw_details_destroy(b->details);
    hw_occlusion_destroy(b->occlusion);
    hw_rays_destroy(b->rays);
    hw_budget_destroy(b->budget);
    for (uint32_t i = 0; b->chains && i < b->scene.mesh_count; i++)
        hw_chain_free(&b->chains[i]);
    hw_free(b->chains);
    hw_free(b->mesh_order);
    hw_free(b->order);
    hw_free(b->backwards);
    for (uint32_t i = 0; b->groups && i < b->threads; i++)
        hw_groups_destroy(b->groups[i]);
    hw_free(b->groups);
    hw_free(b->turns);
    hw_free(b->wanted);
    hw_free(b->texture_of_material);
    hw_free(b->cells);
    hw_scene_free(&b->scene);
    pthread_mutex_destroy(&b->mutex);
}

hw_status hw_build_run(const hw_build_options *options, hw_build_report *report)
{
    hw_status status;
    double start = hw_clock_ms();
    build b = {.options = options, .report = report};
    memset(report, 0, sizeof *report);
    b.threads = options->threads ? options->threads : hw_thread_count_default();
    pthread_mutex_init(&b.mutex, NULL);
    HW_GO(load_scene(&b));
    HW_GO(make_folders(&b));
    HW_GO(set_budget(&b));
    HW_GO(make_chains(&b));
    HW_GO(leave_other(&b));
    HW_GO(write_meshes(&b));
    HW_GO(make_rays(&b));
    HW_GO(make_cells(&b));
    HW_GO(write_manifest(&b, start));
out:
    report->total_seconds = (hw_clock_ms() - start) / 1000;
    release(&b);
    return status;
}
