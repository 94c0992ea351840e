#include "build.h"
#include "alloc.h"
#include "build_cell.h"
#include "file.h"
#include "hash.h"
#include "image_io.h"
#include "import.h"
#include "log.h"
#include "manifest.h"
#include "mesh_file.h"
#include "parallel.h"
#include "rays.h"
#include "system.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// The grid is at least this many cell sizes wide and deep, so that one can walk round a lone
// statue.
#define GRID_SIDE_MIN 5.0

typedef struct build {
    const hw_build_options *options;
    hw_build_report *report;
    hw_scene scene;
    hw_chain *chains;
    hw_rays *rays;
    hw_capturer *capturer;
    hw_occlusion *occlusion; // NULL without culling
    hw_hexgrid grid;
    uint64_t scene_hash, key;
    int32_t *texture_of_material, texture_count;
    hw_progress *progress;
    atomic_uint made, kept;
    atomic_ullong far_records, far_triangles, near_records;
} build;

hw_build_options hw_build_defaults(void)
{
    return (hw_build_options){
        .cell_size = 50,
        .z_min = 8,
        .z_max = 16,
        .near_error_px = 0.3,
        .far = {.policy = &hw_policy_screen,
                .self_occlusion_px = 30,
                .edge_length_px = 4.5,
                .outline_px = 0.09,
                .interior_px = 5,
                .capture_side_max = 1024,
                .capture_samples = 2},
        .chain = {.face_floor = 40, .importance_floor = 0.05f, .pull_back = 0.25f},
        .cull_occluded = true,
        .occlusion = hw_occlusion_defaults(),
    };
}

// ---- inputs ----------------------------------------------------------------------------------

static uint64_t hash_number(uint64_t h, double value)
{
    return hw_hash(h, &value, sizeof value);
}

// Everything the content depends on, and nothing else (not threads, shards, paths).
static uint64_t make_key(const build *b)
{
    const hw_build_options *o = b->options;
    const double numbers[] = {HW_BUILD_VERSION,
                              o->cell_size,
                              o->z_min,
                              o->z_max,
                              o->near_error_px,
                              o->far.self_occlusion_px,
                              o->far.edge_length_px,
                              o->far.outline_px,
                              o->far.interior_px,
                              o->far.capture_side_max,
                              o->far.capture_samples,
                              o->chain.face_floor,
                              o->chain.importance_floor,
                              o->chain.pull_back,
                              o->cull_occluded,
                              o->cull_occluded ? o->occlusion.rays : 0,
                              o->cull_occluded ? o->occlusion.margin : 0};
    uint64_t key = hw_hash(b->scene_hash, o->far.policy->name, strlen(o->far.policy->name));
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        key = hash_number(key, numbers[i]);
    return key;
}

static hw_hexgrid make_grid(const build *b)
{
    const hw_build_options *o = b->options;
    hw_box box = hw_scene_bounds(&b->scene);
    double ground = b->scene.ground.present ? b->scene.ground.rect.min.z : box.min.z;
    double least = GRID_SIDE_MIN * o->cell_size;
    double grow_x = fmax(0, (least - (box.max.x - box.min.x)) / 2),
           grow_y = fmax(0, (least - (box.max.y - box.min.y)) / 2);
    return hw_hexgrid_cover(box.min.x - grow_x, box.min.y - grow_y, box.max.x + grow_x,
                            box.max.y + grow_y, o->cell_size, ground + o->z_min, ground + o->z_max);
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
    b->key = make_key(b);
    b->grid = make_grid(b);
    b->report->import_seconds = (hw_clock_ms() - start) / 1000;
    return HW_OK;
}

static bool stopped(const build *b)
{
    return b->options->stop && atomic_load(b->options->stop);
}

// ---- chains and meshes -----------------------------------------------------------------------

static hw_status make_chains(build *b)
{
    hw_status status = HW_OK;
    double start = hw_clock_ms();
    hw_progress *progress = NULL;
    hw_chain_options options = b->options->chain;
    options.threads = b->options->threads;
    uint64_t total = 0;
    for (uint32_t i = 0; i < b->scene.mesh_count; i++)
        total += b->scene.meshes[i].index_count / 3;
    HW_GO(HW_NEW(&b->chains, b->scene.mesh_count));
    HW_GO(hw_progress_create(&progress, "levels of detail", total));
    for (uint32_t i = 0; i < b->scene.mesh_count; i++) {
        if (stopped(b))
            HW_GO(hw_fail(HW_INTERRUPTED, "interrupted"));
        HW_GO(hw_chain_make(&b->scene.meshes[i], &options, &b->chains[i]));
        hw_progress_add(progress, b->scene.meshes[i].index_count / 3);
    }
    b->report->chain_seconds = (hw_clock_ms() - start) / 1000;
out:
    hw_progress_destroy(progress);
    return status;
}

static bool mesh_file_is_current(const char *path, uint64_t key, uint32_t level_count)
{
    hw_mesh_file *file = NULL;
    bool current = hw_mesh_file_open(&file, path) == HW_OK && hw_mesh_file_key(file) == key &&
                   hw_mesh_file_level_count(file) == level_count;
    for (uint32_t l = 0; current && l < level_count; l++) {
        hw_mesh level = {0};
        current = hw_mesh_file_read(file, l, &level) == HW_OK;
        hw_mesh_free(&level);
    }
    hw_mesh_file_close(file);
    return current;
}

// The levels that near objects are drawn with.
static hw_status write_mesh(const build *b, uint32_t mesh_idx)
{
    hw_status status = HW_OK;
    char *path = NULL;
    const hw_chain *chain = &b->chains[mesh_idx];
    hw_mesh levels[HW_MESH_LEVELS_MAX];
    hw_mesh_level_info infos[HW_MESH_LEVELS_MAX];
    uint32_t count = 0, chain_count = chain->levels[0].uvs ? 1 : chain->level_count;
    for (uint32_t l = 0; l < chain_count; l += HW_NEAR_LEVEL_STRIDE) {
        levels[count] = chain->levels[l]; // borrowed
        infos[count++] = chain->infos[l];
    }
    HW_GO(hw_mesh_path(&path, b->options->dataset, mesh_idx));
    if (!mesh_file_is_current(path, b->key, count))
        HW_GO(hw_mesh_file_write(path, b->key, levels, infos, count));
out:
    hw_free(path);
    return status;
}

static hw_status file_bytes(const char *path, uint64_t *total)
{
    hw_reader *reader = NULL;
    HW_TRY(hw_reader_open(&reader, path));
    *total += hw_reader_size(reader);
    hw_reader_close(reader);
    return HW_OK;
}

static hw_status write_texture(build *b, uint32_t material_idx)
{
    hw_status status = HW_OK;
    char name[64], *path = NULL;
    const hw_material *material = &b->scene.materials[material_idx];
    b->texture_of_material[material_idx] = -1;
    if (!material->texture.data)
        return HW_OK;
    b->texture_of_material[material_idx] = b->texture_count++;
    snprintf(name, sizeof name, "meshes/texture_%d.png", b->texture_of_material[material_idx]);
    HW_GO(hw_path_join(&path, b->options->dataset, name));
    HW_GO(hw_image_write(path, &material->texture));
    HW_GO(file_bytes(path, &b->report->near_bytes));
out:
    hw_free(path);
    return status;
}

static hw_status write_meshes(build *b)
{
    hw_status status = HW_OK;
    double start = hw_clock_ms();
    char *path = NULL;
    HW_GO(HW_NEW(&b->texture_of_material, b->scene.material_count));
    for (uint32_t i = 0; i < b->scene.mesh_count; i++) {
        HW_GO(write_mesh(b, i));
        hw_free(path);
        path = NULL;
        HW_GO(hw_mesh_path(&path, b->options->dataset, i));
        HW_GO(file_bytes(path, &b->report->near_bytes));
    }
    for (uint32_t i = 0; i < b->scene.material_count; i++)
        HW_GO(write_texture(b, i));
    b->report->mesh_seconds = (hw_clock_ms() - start) / 1000;
out:
    hw_free(path);
    return status;
}

// ---- cells -----------------------------------------------------------------------------------

static bool in_shard(const build *b, uint32_t index)
{
    return b->options->shard_count <= 1 ||
           index % b->options->shard_count == b->options->shard_index;
}

static hw_status make_cell(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    build *b = context;
    hw_status status = HW_OK;
    char *path = NULL;
    hw_cell cell = {0};
    hw_cell_id id = hw_hexgrid_cell(&b->grid, (uint32_t)index);
    if (!in_shard(b, (uint32_t)index))
        return HW_OK;
    HW_GO(hw_cell_path(&path, b->options->dataset, id));
    if (hw_cell_is_current(path, b->key)) {
        atomic_fetch_add(&b->kept, 1);
    } else {
        hw_cell_inputs inputs = {.scene = &b->scene,
                                 .chains = b->chains,
                                 .capturer = b->capturer,
                                 .occlusion = b->occlusion,
                                 .grid = &b->grid,
                                 .far = b->options->far,
                                 .near_error_px = b->options->near_error_px,
                                 .key = b->key};
        HW_GO(hw_build_cell(&inputs, id, &cell));
        HW_GO(hw_cell_write(&cell, path));
        atomic_fetch_add(&b->made, 1);
        atomic_fetch_add(&b->far_records, cell.far_count);
        atomic_fetch_add(&b->far_triangles, cell.index_count / 3);
        atomic_fetch_add(&b->near_records, cell.near_count);
    }
    hw_progress_add(b->progress, 1);
out:
    hw_cell_free(&cell);
    hw_free(path);
    return status;
}

static hw_status make_cells(build *b)
{
    hw_status status = HW_OK;
    double start = hw_clock_ms();
    uint32_t count = hw_hexgrid_cell_count(&b->grid), mine = 0;
    for (uint32_t i = 0; i < count; i++)
        mine += in_shard(b, i);
    HW_GO(hw_rays_create_scene(&b->rays, &b->scene));
    HW_GO(hw_capturer_create(&b->scene, b->rays, &b->capturer));
    if (b->options->cull_occluded)
        HW_GO(hw_occlusion_create(&b->occlusion, &b->scene, b->rays, &b->options->occlusion));
    HW_GO(hw_progress_create(&b->progress, "cells", mine));
    HW_GO(hw_parallel_for(count, b->options->threads, make_cell, b, b->options->stop));
out:
    hw_progress_destroy(b->progress);
    b->report->cells_total = count;
    b->report->cells_made = atomic_load(&b->made);
    b->report->cells_kept = atomic_load(&b->kept);
    if (b->report->cells_made > 0) {
        double made = b->report->cells_made;
        b->report->far_records_mean = (double)atomic_load(&b->far_records) / made;
        b->report->far_triangles_mean = (double)atomic_load(&b->far_triangles) / made;
        b->report->near_records_mean = (double)atomic_load(&b->near_records) / made;
    }
    b->report->cell_seconds = (hw_clock_ms() - start) / 1000;
    return status;
}

// ---- manifest --------------------------------------------------------------------------------

// Adds up what the cell files hold; false if one is missing or of another build.
static bool count_cell(build *b, hw_cell_id id, hw_manifest_cell *out)
{
    static const uint32_t mesh_tags[] = {HW_FOURCC('V', 'E', 'R', 'T'),
                                         HW_FOURCC('I', 'N', 'D', 'X')};
    char *path = NULL;
    hw_container *container = NULL;
    size_t raw, stored;
    bool good = hw_cell_path(&path, b->options->dataset, id) == HW_OK &&
                hw_container_open(&container, path, HW_CELL_MAGIC) == HW_OK &&
                hw_container_key(container) == b->key;
    if (good) {
        *out = (hw_manifest_cell){id, hw_container_bytes(container)};
        b->report->bytes += out->bytes;
        for (int i = 0; i < 2; i++)
            if (hw_container_chunk_size(container, mesh_tags[i], 0, &raw, &stored) == HW_OK)
                b->report->mesh_bytes += stored;
        if (hw_container_chunk_size(container, HW_FOURCC('A', 'T', 'L', 'S'), 0, &raw, &stored) ==
            HW_OK)
            b->report->texture_bytes += stored;
    }
    hw_container_close(container);
    hw_free(path);
    return good;
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

static hw_status write_manifest(build *b, double start_ms)
{
    hw_status status = HW_OK;
    const hw_build_options *o = b->options;
    hw_manifest m = {0};
    uint32_t count = hw_hexgrid_cell_count(&b->grid);
    HW_GO(HW_NEW(&m.cells, count));
    for (uint32_t i = 0; i < count; i++)
        if (!count_cell(b, hw_hexgrid_cell(&b->grid, i), &m.cells[i]))
            b->report->cells_missing++;
    b->report->bytes += b->report->near_bytes;
    b->report->total_seconds = (hw_clock_ms() - start_ms) / 1000;
    if (b->report->cells_missing > 0)
        goto out;
    m.cell_count = count;
    m.scene_path = realpath(o->scene_path, NULL);
    HW_GO(hw_strdup(&m.policy, o->far.policy->name));
    m.scene_hash = b->scene_hash;
    m.key = b->key;
    m.scene_triangles = hw_scene_triangle_count(&b->scene);
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
    HW_GO(hw_manifest_write(o->dataset, &m));
out:
    hw_manifest_free(&m);
    return status;
}

// ---- the whole -------------------------------------------------------------------------------

static hw_status make_folders(const build *b)
{
    static const char *const folders[] = {"", "cells", "cells/0", "meshes"};
    for (size_t i = 0; i < sizeof folders / sizeof *folders; i++) {
        char *path = NULL;
        HW_TRY(hw_path_join(&path, b->options->dataset, folders[i]));
        hw_status status = hw_dir_make(path);
        if (status == HW_OK)
            status = hw_dir_clean_temporary(path);
        hw_free(path);
        HW_TRY(status);
    }
    return HW_OK;
}

static void release(build *b)
{
    hw_capturer_destroy(b->capturer);
    hw_occlusion_destroy(b->occlusion);
    hw_rays_destroy(b->rays);
    for (uint32_t i = 0; b->chains && i < b->scene.mesh_count; i++)
        hw_chain_free(&b->chains[i]);
    hw_free(b->chains);
    hw_free(b->texture_of_material);
    hw_scene_free(&b->scene);
}

hw_status hw_build_run(const hw_build_options *options, hw_build_report *report)
{
    hw_status status;
    double start = hw_clock_ms();
    build b = {.options = options, .report = report};
    memset(report, 0, sizeof *report);
    HW_GO(load_scene(&b));
    HW_GO(make_folders(&b));
    HW_GO(make_chains(&b));
    HW_GO(write_meshes(&b));
    HW_GO(make_cells(&b));
    HW_GO(write_manifest(&b, start));
out:
    report->total_seconds = (hw_clock_ms() - start) / 1000;
    release(&b);
    return status;
}
