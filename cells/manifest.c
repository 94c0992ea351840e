#include "manifest.h"
#include "alloc.h"
#include "file.h"
#include "json.h"
#include <assert.h>
#include <float.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WHOLE_MAX (INT64_C(1) << 53) // the integers that a JSON number holds exactly

void hw_manifest_free(hw_manifest *manifest)
{
    if (!manifest)
        return;
    hw_free(manifest->scene_path);
    hw_free(manifest->policy);
    hw_free(manifest->objects);
    hw_free(manifest->cells);
    *manifest = (hw_manifest){0};
}

// ---- validation, shared by writer and reader ----

static bool finite_box(hw_box b)
{
    return hw_v3_finite(b.min) && hw_v3_finite(b.max) && b.min.x <= b.max.x && b.min.y <= b.max.y &&
           b.min.z <= b.max.z;
}

static bool finite_color(const float color[3])
{
    return isfinite(color[0]) && isfinite(color[1]) && isfinite(color[2]);
}

static hw_status validate_head(const char *name, const hw_manifest *m)
{
    const hw_hexgrid *g = &m->grid;
    if (!m->scene_path || !m->policy)
        return hw_fail(HW_FORMAT, "%s: no scene or no policy", name);
    if (!isfinite(m->self_occlusion_px) || !isfinite(m->edge_length_px) ||
        !isfinite(m->near_error_px) || !isfinite(m->build_seconds))
        return hw_fail(HW_FORMAT, "%s: an option or time is not finite", name);
    if (m->scene_triangles > WHOLE_MAX || m->mesh_bytes > WHOLE_MAX ||
        m->texture_bytes > WHOLE_MAX || m->near_bytes > WHOLE_MAX)
        return hw_fail(HW_FORMAT, "%s: a count of triangles or bytes is too large", name);
    if (m->mesh_count > HW_MESH_FILES_MAX || m->texture_count > HW_MESH_FILES_MAX)
        return hw_fail(HW_FORMAT, "%s: %u meshes, %u textures: too many", name, m->mesh_count,
                       m->texture_count);
    if (!isfinite(g->origin_x) || !isfinite(g->origin_y) || !isfinite(g->cell_size) ||
        g->cell_size <= 0 || !isfinite(g->z_min) || !isfinite(g->z_max) || g->z_min > g->z_max ||
        g->columns < 1 || g->columns > HW_GRID_SIDE_MAX || g->rows < 1 ||
        g->rows > HW_GRID_SIDE_MAX || g->levels < 1 || g->levels > HW_CELL_LEVELS_MAX)
        return hw_fail(HW_FORMAT, "%s: \"grid\" is no grid", name);
    if (m->shard_count > 0 && m->shard_index >= m->shard_count)
        return hw_fail(HW_FORMAT, "%s: \"shard\" is not K of N", name);
    if (m->ground.present && (!finite_box(m->ground.rect) || !finite_color(m->ground.color)))
        return hw_fail(HW_FORMAT, "%s: \"ground\" is empty or not finite", name);
    return HW_OK;
}

static bool is_affine(const hw_mat4 *t)
{
    for (int i = 0; i < 16; i++)
        if (!isfinite(t->m[i]))
            return false;
    return t->m[3] == 0 && t->m[7] == 0 && t->m[11] == 0 && t->m[15] == 1;
}

static hw_status validate_object(const char *name, const hw_manifest *m, uint32_t index)
{
    const hw_manifest_object *o = &m->objects[index];
    if (o->mesh_idx >= m->mesh_count)
        return hw_fail(HW_FORMAT, "%s: object %u: mesh %u of %u", name, index, o->mesh_idx,
                       m->mesh_count);
    if (o->texture_idx < -1 ||
        (o->texture_idx >= 0 && (uint32_t)o->texture_idx >= m->texture_count))
        return hw_fail(HW_FORMAT, "%s: object %u: texture %d of %u", name, index, o->texture_idx,
                       m->texture_count);
    if (!is_affine(&o->transform))
        return hw_fail(HW_FORMAT, "%s: object %u: its transform is not affine", name, index);
    if (!finite_box(o->bounds) || !finite_color(o->color))
        return hw_fail(HW_FORMAT, "%s: object %u: bounds or colour", name, index);
    return HW_OK;
}

static int compare_cells(const void *a, const void *b)
{
    return hw_cell_compare(((const hw_manifest_cell *)a)->id, ((const hw_manifest_cell *)b)->id);
}

bool hw_manifest_find_cell(const hw_manifest *manifest, hw_cell_id id, uint32_t *index)
{
    const hw_manifest_cell key = {.id = id};
    const hw_manifest_cell *found = NULL;
    if (manifest->cell_count > 0)
        found = bsearch(&key, manifest->cells, manifest->cell_count, sizeof key, compare_cells);
    if (found && index)
        *index = (uint32_t)(found - manifest->cells);
    return found != NULL;
}

static hw_status validate_cell(const char *name, const hw_manifest *m, uint32_t index)
{
    const hw_manifest_cell *c = &m->cells[index];
    bool inside = hw_hexgrid_contains(&m->grid, c->id);
    if (!inside)
        return hw_fail(HW_FORMAT, "%s: cell %u (level %d, %d, %d) is not of the grid", name, index,
                       c->id.level, c->id.q, c->id.r);
    if (index > 0 && hw_cell_compare(c[-1].id, c->id) >= 0)
        return hw_fail(HW_FORMAT, "%s: cell %u is out of order", name, index);
    if (c->bytes > WHOLE_MAX)
        return hw_fail(HW_FORMAT, "%s: cell %u is too large", name, index);
    return HW_OK;
}

static hw_status validate(const char *name, const hw_manifest *m)
{
    HW_TRY(validate_head(name, m));
    for (uint32_t i = 0; i < m->object_count; i++)
        HW_TRY(validate_object(name, m, i));
    for (uint32_t i = 0; i < m->cell_count; i++)
        HW_TRY(validate_cell(name, m, i));
    return HW_OK;
}

// ---- writing ----

// 64-bit hashes do not fit a JSON number.
static void add_hash(cJSON *json, const char *key, uint64_t hash)
{
    char text[17];
    snprintf(text, sizeof text, "%016" PRIx64, hash);
    cJSON_AddStringToObject(json, key, text);
}

static void add_whole(cJSON *json, const char *key, uint64_t value)
{
    hw_json_add_number(json, key, (double)value);
}

static void add_floats(cJSON *json, const char *key, const float *values, size_t count)
{
    double wide[3];
    assert(count <= 3);
    for (size_t i = 0; i < count; i++)
        wide[i] = values[i];
    hw_json_add_numbers(json, key, wide, count);
}

static void add_box(cJSON *json, const char *key, hw_box b)
{
    const double values[6] = {b.min.x, b.min.y, b.min.z, b.max.x, b.max.y, b.max.z};
    hw_json_add_numbers(json, key, values, 6);
}

static void add_grid(cJSON *json, const hw_hexgrid *g)
{
    cJSON *grid = cJSON_AddObjectToObject(json, "grid");
    const double origin[2] = {g->origin_x, g->origin_y}, heights[2] = {g->z_min, g->z_max};
    hw_json_add_numbers(grid, "origin", origin, 2);
    hw_json_add_number(grid, "cell_size", g->cell_size);
    hw_json_add_numbers(grid, "heights", heights, 2);
    hw_json_add_number(grid, "columns", g->columns);
    hw_json_add_number(grid, "rows", g->rows);
    hw_json_add_number(grid, "levels", g->levels);
}

static void add_ground(cJSON *json, const hw_ground *g)
{
    cJSON *ground = cJSON_AddObjectToObject(json, "ground");
    cJSON_AddBoolToObject(ground, "present", g->present);
    if (!g->present)
        return;
    add_box(ground, "rect", g->rect);
    add_floats(ground, "color", g->color, 3);
}

static void add_objects(cJSON *json, const hw_manifest *m)
{
    cJSON *array = cJSON_AddArrayToObject(json, "objects");
    for (uint32_t i = 0; i < m->object_count; i++) {
        const hw_manifest_object *o = &m->objects[i];
        cJSON *item = cJSON_CreateObject();
        hw_json_add_number(item, "mesh", o->mesh_idx);
        hw_json_add_number(item, "texture", o->texture_idx);
        hw_json_add_numbers(item, "transform", o->transform.m, 16);
        add_box(item, "bounds", o->bounds);
        add_floats(item, "color", o->color, 3);
        if (!cJSON_AddItemToArray(array, item))
            cJSON_Delete(item);
    }
}

static void add_cells(cJSON *json, const hw_manifest *m)
{
    cJSON *array = cJSON_AddArrayToObject(json, "cells");
    for (uint32_t i = 0; i < m->cell_count; i++) {
        const hw_manifest_cell *c = &m->cells[i];
        const double id[3] = {c->id.level, c->id.q, c->id.r};
        cJSON *item = cJSON_CreateObject();
        hw_json_add_numbers(item, "id", id, 3);
        add_whole(item, "bytes", c->bytes);
        if (!cJSON_AddItemToArray(array, item))
            cJSON_Delete(item);
    }
}

static cJSON *to_json(const hw_manifest *m)
{
    cJSON *json = cJSON_CreateObject();
    hw_json_add_number(json, "version", HW_MANIFEST_VERSION);
    if (m->shard_count > 0) {
        const double shard[2] = {m->shard_index + 1.0, m->shard_count};
        hw_json_add_numbers(json, "shard", shard, 2);
        hw_json_add_number(json, "seconds", m->build_seconds);
    }
    cJSON_AddStringToObject(json, "scene", m->scene_path);
    add_hash(json, "scene_hash", m->scene_hash);
    add_hash(json, "key", m->key);
    add_whole(json, "scene_triangles", m->scene_triangles);
    cJSON_AddStringToObject(json, "policy", m->policy);
    hw_json_add_number(json, "self_occlusion_px", m->self_occlusion_px);
    hw_json_add_number(json, "edge_length_px", m->edge_length_px);
    hw_json_add_number(json, "near_error_px", m->near_error_px);
    add_whole(json, "mesh_bytes", m->mesh_bytes);
    add_whole(json, "texture_bytes", m->texture_bytes);
    add_whole(json, "near_bytes", m->near_bytes);
    cJSON_AddBoolToObject(json, "clusters", m->clusters);
    cJSON_AddBoolToObject(json, "multi_view", m->multi_view);
    add_grid(json, &m->grid);
    add_ground(json, &m->ground);
    add_whole(json, "mesh_count", m->mesh_count);
    add_whole(json, "texture_count", m->texture_count);
    add_objects(json, m);
    add_cells(json, m);
    return json;
}

// ---- reading ----

static hw_status get_hash(const char *name, const cJSON *json, const char *key, uint64_t *out)
{
    const char *text;
    *out = 0;
    HW_TRY(hw_json_string(name, json, key, &text));
    if (strlen(text) != 16 || strspn(text, "0123456789abcdef") != 16)
        return hw_fail(HW_FORMAT, "%s: \"%s\" is not 16 hexadecimal digits", name, key);
    *out = strtoull(text, NULL, 16);
    return HW_OK;
}

static hw_status get_whole(const char *name, const cJSON *json, const char *key, uint64_t *out)
{
    int64_t value;
    HW_TRY(hw_json_integer(name, json, key, 0, WHOLE_MAX, &value));
    *out = (uint64_t)value;
    return HW_OK;
}

static hw_status get_u32(const char *name, const cJSON *json, const char *key, uint32_t *out)
{
    int64_t value;
    HW_TRY(hw_json_integer(name, json, key, 0, UINT32_MAX, &value));
    *out = (uint32_t)value;
    return HW_OK;
}

// Numbers beyond a float's range become its largest.
static hw_status get_floats(const char *name, const cJSON *json, const char *key, float *out,
                            size_t count)
{
    double values[6];
    assert(count <= 6);
    HW_TRY(hw_json_numbers(name, json, key, values, count));
    for (size_t i = 0; i < count; i++)
        out[i] = (float)fmax(fmin(values[i], FLT_MAX), -FLT_MAX);
    return HW_OK;
}

static hw_status get_box(const char *name, const cJSON *json, const char *key, hw_box *out)
{
    float v[6];
    HW_TRY(get_floats(name, json, key, v, 6));
    *out = (hw_box){{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
    return HW_OK;
}

static hw_status get_string(const char *name, const cJSON *json, const char *key, char **out)
{
    const char *text;
    HW_TRY(hw_json_string(name, json, key, &text));
    return hw_strdup(out, text);
}

static hw_status get_grid(const char *name, const cJSON *json, hw_hexgrid *out)
{
    const cJSON *grid;
    double origin[2], heights[2];
    int64_t columns, rows, levels;
    HW_TRY(hw_json_object(name, json, "grid", &grid));
    HW_TRY(hw_json_numbers(name, grid, "origin", origin, 2));
    HW_TRY(hw_json_number(name, grid, "cell_size", &out->cell_size));
    HW_TRY(hw_json_numbers(name, grid, "heights", heights, 2));
    HW_TRY(hw_json_integer(name, grid, "columns", 1, HW_GRID_SIDE_MAX, &columns));
    HW_TRY(hw_json_integer(name, grid, "rows", 1, HW_GRID_SIDE_MAX, &rows));
    HW_TRY(hw_json_integer(name, grid, "levels", 1, HW_CELL_LEVELS_MAX, &levels));
    out->origin_x = origin[0];
    out->origin_y = origin[1];
    out->z_min = heights[0];
    out->z_max = heights[1];
    out->columns = (int32_t)columns;
    out->rows = (int32_t)rows;
    out->levels = (int32_t)levels;
    return HW_OK;
}

static hw_status get_ground(const char *name, const cJSON *json, hw_ground *out)
{
    const cJSON *ground;
    HW_TRY(hw_json_object(name, json, "ground", &ground));
    HW_TRY(hw_json_bool(name, ground, "present", &out->present));
    if (!out->present)
        return HW_OK;
    HW_TRY(get_box(name, ground, "rect", &out->rect));
    return get_floats(name, ground, "color", out->color, 3);
}

static hw_status get_object(const char *name, const cJSON *item, hw_manifest_object *out)
{
    int64_t texture;
    HW_TRY(get_u32(name, item, "mesh", &out->mesh_idx));
    HW_TRY(hw_json_integer(name, item, "texture", -1, INT32_MAX, &texture));
    out->texture_idx = (int32_t)texture;
    HW_TRY(hw_json_numbers(name, item, "transform", out->transform.m, 16));
    HW_TRY(get_box(name, item, "bounds", &out->bounds));
    return get_floats(name, item, "color", out->color, 3);
}

static hw_status get_cell(const char *name, const cJSON *item, hw_manifest_cell *out)
{
    double id[3];
    HW_TRY(hw_json_numbers(name, item, "id", id, 3));
    for (int i = 0; i < 3; i++)
        if (fabs(id[i]) > INT32_MAX || id[i] != floor(id[i]))
            return hw_fail(HW_FORMAT, "%s: \"id\" is not three whole numbers", name);
    out->id = (hw_cell_id){(int32_t)id[0], (int32_t)id[1], (int32_t)id[2]};
    return get_whole(name, item, "bytes", &out->bytes);
}

static hw_status get_objects(const char *name, const cJSON *json, hw_manifest *out)
{
    const cJSON *array, *item;
    HW_TRY(hw_json_array(name, json, "objects", &array));
    uint32_t count = (uint32_t)cJSON_GetArraySize(array);
    HW_TRY(HW_NEW(&out->objects, count));
    cJSON_ArrayForEach(item, array)
    {
        HW_TRY(get_object(name, item, &out->objects[out->object_count]));
        out->object_count++;
    }
    return HW_OK;
}

static hw_status get_cells(const char *name, const cJSON *json, hw_manifest *out)
{
    const cJSON *array, *item;
    HW_TRY(hw_json_array(name, json, "cells", &array));
    uint32_t count = (uint32_t)cJSON_GetArraySize(array);
    HW_TRY(HW_NEW(&out->cells, count));
    cJSON_ArrayForEach(item, array)
    {
        HW_TRY(get_cell(name, item, &out->cells[out->cell_count]));
        out->cell_count++;
    }
    return HW_OK;
}

static bool has(const cJSON *json, const char *member)
{
    return cJSON_GetObjectItemCaseSensitive(json, member) != NULL;
}

// "shard": [K, N] stands in the manifests of shards only, and with it how long the shard took.
static hw_status get_shard(const char *name, const cJSON *json, hw_manifest *out)
{
    double shard[2];
    if (!has(json, "shard"))
        return HW_OK;
    HW_TRY(hw_json_numbers(name, json, "shard", shard, 2));
    for (int i = 0; i < 2; i++)
        if (!(shard[i] >= 1 && shard[i] <= HW_SHARDS_MAX) || shard[i] != floor(shard[i]))
            return hw_fail(HW_FORMAT, "%s: \"shard\" is not K of N", name);
    out->shard_index = (uint32_t)shard[0] - 1;
    out->shard_count = (uint32_t)shard[1];
    return hw_json_number(name, json, "seconds", &out->build_seconds);
}

// What a dataset may have. Older manifests do not tell.
static hw_status get_possible(const char *name, const cJSON *json, const char *member, bool *out)
{
    *out = true;
    return has(json, member) ? hw_json_bool(name, json, member, out) : HW_OK;
}

static hw_status get_head(const char *name, const cJSON *json, hw_manifest *out)
{
    int64_t version;
    HW_TRY(hw_json_integer(name, json, "version", 0, INT32_MAX, &version));
    if (version != HW_MANIFEST_VERSION)
        return hw_fail(HW_VERSION, "%s: dataset version %d, this program reads %d", name,
                       (int)version, HW_MANIFEST_VERSION);
    HW_TRY(get_shard(name, json, out));
    HW_TRY(get_string(name, json, "scene", &out->scene_path));
    HW_TRY(get_hash(name, json, "scene_hash", &out->scene_hash));
    HW_TRY(get_hash(name, json, "key", &out->key));
    HW_TRY(get_whole(name, json, "scene_triangles", &out->scene_triangles));
    HW_TRY(get_string(name, json, "policy", &out->policy));
    HW_TRY(hw_json_number(name, json, "self_occlusion_px", &out->self_occlusion_px));
    HW_TRY(hw_json_number(name, json, "edge_length_px", &out->edge_length_px));
    HW_TRY(hw_json_number(name, json, "near_error_px", &out->near_error_px));
    HW_TRY(get_whole(name, json, "mesh_bytes", &out->mesh_bytes));
    HW_TRY(get_whole(name, json, "texture_bytes", &out->texture_bytes));
    HW_TRY(get_whole(name, json, "near_bytes", &out->near_bytes));
    HW_TRY(get_possible(name, json, "clusters", &out->clusters));
    HW_TRY(get_possible(name, json, "multi_view", &out->multi_view));
    HW_TRY(get_u32(name, json, "mesh_count", &out->mesh_count));
    return get_u32(name, json, "texture_count", &out->texture_count);
}

static hw_status from_json(const char *name, const cJSON *json, hw_manifest *out)
{
    hw_status status = HW_OK;
    *out = (hw_manifest){0};
    HW_GO(get_head(name, json, out));
    HW_GO(get_grid(name, json, &out->grid));
    HW_GO(get_ground(name, json, &out->ground));
    HW_GO(get_objects(name, json, out));
    HW_GO(get_cells(name, json, out));
    HW_GO(validate(name, out));
    return HW_OK;
out:
    hw_manifest_free(out);
    return status;
}

hw_status hw_manifest_parse(const char *name, const char *text, size_t size, hw_manifest *out)
{
    cJSON *json = NULL;
    *out = (hw_manifest){0};
    HW_TRY(hw_json_parse(name, text, size, &json));
    hw_status status = from_json(name, json, out);
    cJSON_Delete(json);
    return status;
}

// How long the build took stands in a file of its own, so that equal inputs give equal manifests.
// It may be missing.
static hw_status read_seconds(const char *dataset, double *seconds)
{
    hw_status status = HW_OK;
    char *path = NULL;
    cJSON *json = NULL;
    *seconds = 0;
    HW_TRY(hw_path_join(&path, dataset, "build.json"));
    if (!hw_path_exists(path))
        goto out;
    HW_GO(hw_json_read(path, &json));
    HW_GO(hw_json_number(path, json, "seconds", seconds));
out:
    cJSON_Delete(json);
    hw_free(path);
    return status;
}

static hw_status write_seconds(const char *dataset, double seconds)
{
    char *path = NULL;
    HW_TRY(hw_path_join(&path, dataset, "build.json"));
    cJSON *json = cJSON_CreateObject();
    hw_json_add_number(json, "seconds", seconds);
    hw_status status = has(json, "seconds")
                           ? hw_json_write(path, json)
                           : hw_fail(HW_MEMORY, "%s: out of memory while writing", path);
    cJSON_Delete(json);
    hw_free(path);
    return status;
}

// Of a whole dataset, not of a shard.
static hw_status from_whole_json(const char *name, const cJSON *json, hw_manifest *out)
{
    HW_TRY(from_json(name, json, out));
    if (out->shard_count == 0)
        return HW_OK;
    hw_manifest_free(out);
    return hw_fail(HW_FORMAT, "%s: is the manifest of a shard", name);
}

hw_status hw_manifest_read(const char *dataset, hw_manifest *out)
{
    hw_status status = HW_OK;
    char *path = NULL;
    cJSON *json = NULL;
    *out = (hw_manifest){0};
    HW_TRY(hw_path_join(&path, dataset, "manifest.json"));
    status = hw_json_read(path, &json);
    if (status == HW_NOT_FOUND)
        status =
            hw_fail(HW_NOT_FOUND, "%s: %s", dataset,
                    hw_path_exists(dataset) ? "not a finished dataset (it has no manifest.json)"
                                            : "no such dataset");
    HW_GO(status);
    HW_GO(from_whole_json(path, json, out));
    status = read_seconds(dataset, &out->build_seconds);
    if (status != HW_OK)
        hw_manifest_free(out);
out:
    cJSON_Delete(json);
    hw_free(path);
    return status;
}

// A JSON file by way of a source; its full name goes to *path.
static hw_status fetch_json(hw_source *source, const char *name, char **path, cJSON **out)
{
    hw_block block = {0};
    HW_TRY(hw_path_join(path, hw_source_location(source), name));
    HW_TRY(hw_source_read(source, name, 0, 0, &block));
    hw_status status = hw_json_parse(*path, (const char *)block.data, block.size, out);
    hw_free(block.data);
    return status;
}

hw_status hw_manifest_fetch(hw_source *source, hw_manifest *out)
{
    hw_status status = HW_OK;
    char *path = NULL, *seconds_path = NULL;
    cJSON *json = NULL, *seconds = NULL;
    *out = (hw_manifest){0};
    HW_GO(fetch_json(source, "manifest.json", &path, &json));
    HW_GO(from_whole_json(path, json, out));
    status = fetch_json(source, "build.json", &seconds_path, &seconds);
    if (status == HW_OK)
        status = hw_json_number(seconds_path, seconds, "seconds", &out->build_seconds);
    if (status == HW_NOT_FOUND) // it may be missing
        status = HW_OK;
    if (status != HW_OK)
        hw_manifest_free(out);
out:
    cJSON_Delete(json);
    cJSON_Delete(seconds);
    hw_free(path);
    hw_free(seconds_path);
    return status;
}

hw_status hw_manifest_open(const char *location, hw_manifest *out)
{
    const hw_source_desc desc = {.location = location};
    hw_source *source = NULL;
    *out = (hw_manifest){0};
    if (!hw_location_is_url(location))
        return hw_manifest_read(location, out);
    HW_TRY(hw_source_open(&source, &desc));
    hw_status status = hw_manifest_fetch(source, out);
    hw_source_close(source);
    return status;
}

// Into `path`; with a dataset, its build.json first.
static hw_status write_checked(const char *path, const char *dataset, const hw_manifest *manifest)
{
    hw_status status = HW_OK;
    cJSON *json = NULL;
    hw_manifest sorted = *manifest, check = {0};
    sorted.cells = NULL;
    HW_GO(HW_NEW(&sorted.cells, manifest->cell_count));
    if (manifest->cell_count) {
        memcpy(sorted.cells, manifest->cells, manifest->cell_count * sizeof *sorted.cells);
        qsort(sorted.cells, manifest->cell_count, sizeof *sorted.cells, compare_cells);
    }
    HW_GO(validate(path, &sorted));
    json = to_json(&sorted);
    // cJSON leaves out what it has no memory for: reading the document back finds that.
    if (from_json(path, json, &check) != HW_OK || check.object_count != sorted.object_count ||
        check.cell_count != sorted.cell_count || check.shard_count != sorted.shard_count) {
        status = hw_fail(HW_MEMORY, "%s: out of memory while writing", path);
        goto out;
    }
    if (dataset)
        HW_GO(write_seconds(dataset, manifest->build_seconds));
    HW_GO(hw_json_write(path, json)); // last: it makes the folder a dataset
out:
    hw_manifest_free(&check);
    hw_free(sorted.cells);
    cJSON_Delete(json);
    return status;
}

hw_status hw_manifest_write(const char *dataset, const hw_manifest *manifest)
{
    char *path = NULL;
    hw_manifest whole = *manifest;
    whole.shard_index = whole.shard_count = 0;
    HW_TRY(hw_path_join(&path, dataset, "manifest.json"));
    hw_status status = write_checked(path, dataset, &whole);
    hw_free(path);
    return status;
}

hw_status hw_manifest_write_file(const char *path, const hw_manifest *manifest)
{
    return write_checked(path, NULL, manifest);
}

hw_status hw_manifest_read_file(const char *path, hw_manifest *out)
{
    cJSON *json = NULL;
    *out = (hw_manifest){0};
    HW_TRY(hw_json_read(path, &json));
    hw_status status = from_json(path, json, out);
    cJSON_Delete(json);
    return status;
}
