// hexwalk info: what is in a scene, dataset, cell, mesh, progressive mesh or tour. One JSON object
// serves both the file and what is printed.
#include "alloc.h"
#include "bytes.h"
#include "cell_chunks.h"
#include "file.h"
#include "image_io.h"
#include "import.h"
#include "json.h"
#include "manifest.h"
#include "map.h"
#include "mesh_file.h"
#include "options.h"
#include "outputs.h"
#include "progressive_file.h"
#include "tour.h"
#include <math.h>
#include <string.h>
#include <sys/stat.h>

#define ROWS_SHOWN     40
#define NARROW_COLUMNS 7

static const char *json_file, *map_file, *map_by = "bytes";
static uint64_t map_side = 1200;

static uint32_t options(hw_option *out, uint32_t capacity)
{
    const hw_option table[] = {
        {"json", 0, HW_OPTION_STRING, &json_file, "FILE", NULL, 0, 0,
         "write the same as JSON, complete and unabridged"},
        {"map", 0, HW_OPTION_STRING, &map_file, "OUT.png", NULL, 0, 0,
         "of a dataset: draw its cells from above, dark where they hold little and bright where "
         "they hold much; objects are dots"},
        {"map-by", 0, HW_OPTION_CHOICE, &map_by, "WHAT", HW_MAP_QUANTITIES, 0, 0,
         "what the colours of the map tell: bytes, triangles of far objects, or how many objects "
         "are far or near"},
        {"map-side", 0, HW_OPTION_UINT, &map_side, "PX", NULL, 64, 16384, "longer side of the map"},
    };
    uint32_t count = sizeof table / sizeof *table;
    memcpy(out, table, (count < capacity ? count : capacity) * sizeof *table);
    return count;
}

// --- Gathering ----------------------------------------------------------------------------------

static void add_hex(cJSON *json, const char *key, uint64_t value)
{
    char text[32];
    snprintf(text, sizeof text, "%016llx", (unsigned long long)value);
    cJSON_AddStringToObject(json, key, text);
}

static void add_integer(cJSON *json, const char *key, uint64_t value)
{
    cJSON_AddNumberToObject(json, key, (double)value);
}

static void add_vector(cJSON *json, const char *key, hw_vec3 v)
{
    const double values[] = {(double)v.x, (double)v.y, (double)v.z};
    hw_json_add_numbers(json, key, values, 3);
}

static void add_file_bytes(cJSON *json, const char *path)
{
    struct stat info;
    if (stat(path, &info) == 0)
        add_integer(json, "file_bytes", (uint64_t)info.st_size);
}

static hw_status add_mesh_rows(cJSON *json, const hw_scene *scene)
{
    uint32_t *uses;
    HW_TRY(HW_NEW(&uses, scene->mesh_count));
    for (uint32_t i = 0; i < scene->object_count; i++)
        uses[scene->objects[i].mesh_idx]++;
    cJSON *rows = cJSON_AddArrayToObject(json, "mesh_list");
    for (uint32_t i = 0; i < scene->mesh_count; i++) {
        const hw_mesh *mesh = &scene->meshes[i];
        cJSON *row = cJSON_CreateObject();
        cJSON_AddItemToArray(rows, row);
        hw_json_add_string(row, "name", mesh->name && *mesh->name ? mesh->name : "-");
        add_integer(row, "vertices", mesh->vertex_count);
        add_integer(row, "triangles", mesh->index_count / 3);
        add_integer(row, "objects", uses[i]);
        cJSON_AddBoolToObject(row, "normals", mesh->normals != NULL);
        cJSON_AddBoolToObject(row, "colors", mesh->colors != NULL);
        cJSON_AddBoolToObject(row, "uvs", mesh->uvs != NULL);
    }
    hw_free(uses);
    return HW_OK;
}

static hw_status describe_scene(const char *path, cJSON *json)
{
    hw_scene scene = {0};
    HW_TRY(hw_scene_import(path, &scene));
    uint64_t textures = 0;
    for (uint32_t i = 0; i < scene.material_count; i++)
        textures += scene.materials[i].texture.data != NULL;
    hw_box bounds = hw_scene_bounds(&scene);
    cJSON_AddStringToObject(json, "kind", "scene");
    add_file_bytes(json, path);
    add_integer(json, "triangles", hw_scene_triangle_count(&scene));
    add_integer(json, "objects", scene.object_count);
    add_integer(json, "meshes", scene.mesh_count);
    add_integer(json, "materials", scene.material_count);
    add_integer(json, "textures", textures);
    cJSON_AddBoolToObject(json, "ground", scene.ground.present);
    add_vector(json, "bounds_min", bounds.min);
    add_vector(json, "bounds_max", bounds.max);
    add_hex(json, "hash", hw_scene_hash(&scene));
    hw_status status = add_mesh_rows(json, &scene);
    hw_scene_free(&scene);
    return status;
}

static hw_status draw_map(const char *path, const hw_manifest *m, cJSON *json)
{
    hw_image image = {0};
    hw_map_legend legend;
    hw_status status = hw_map_draw(path, m, map_by, (uint32_t)map_side, &image, &legend);
    if (status == HW_OK)
        status = hw_image_write(map_file, &image);
    hw_image_free(&image);
    HW_TRY(status);
    hw_json_add_string(json, "map", map_file);
    cJSON_AddStringToObject(json, "map_by", map_by);
    hw_json_add_number(json, "map_darkest", legend.least);
    hw_json_add_number(json, "map_mean", legend.mean);
    hw_json_add_number(json, "map_brightest", legend.most);
    add_integer(json, "map_cells", legend.cells);
    if (legend.missing > 0)
        add_integer(json, "map_grey_cells", legend.missing);
    return HW_OK;
}

static hw_status describe_dataset(const char *path, cJSON *json)
{
    hw_manifest m = {0};
    HW_TRY(hw_manifest_read(path, &m));
    uint64_t cell_bytes = 0;
    for (uint32_t i = 0; i < m.cell_count; i++)
        cell_bytes += m.cells[i].bytes;
    cJSON_AddStringToObject(json, "kind", "dataset");
    hw_json_add_string(json, "scene", m.scene_path ? m.scene_path : "");
    add_integer(json, "scene_triangles", m.scene_triangles);
    add_integer(json, "objects", m.object_count);
    add_integer(json, "meshes", m.mesh_count);
    add_integer(json, "textures", m.texture_count);
    add_integer(json, "cells", m.cell_count);
    add_integer(json, "levels", (uint64_t)m.grid.levels);
    hw_json_add_number(json, "cell_size", m.grid.cell_size);
    hw_json_add_numbers(json, "heights", (const double[]){m.grid.z_min, m.grid.z_max}, 2);
    add_integer(json, "columns", (uint64_t)m.grid.columns);
    add_integer(json, "rows", (uint64_t)m.grid.rows);
    add_integer(json, "bytes", cell_bytes + m.near_bytes);
    add_integer(json, "cell_bytes", cell_bytes);
    add_integer(json, "mesh_bytes", m.mesh_bytes);
    add_integer(json, "texture_bytes", m.texture_bytes);
    add_integer(json, "near_bytes", m.near_bytes);
    hw_json_add_string(json, "policy", m.policy ? m.policy : "");
    hw_json_add_number(json, "self_occlusion_px", m.self_occlusion_px);
    hw_json_add_number(json, "edge_length_px", m.edge_length_px);
    hw_json_add_number(json, "near_error_px", m.near_error_px);
    hw_json_add_number(json, "build_seconds", m.build_seconds);
    add_hex(json, "key", m.key);
    hw_status status = map_file ? draw_map(path, &m, json) : HW_OK;
    hw_manifest_free(&m);
    return status;
}

// What each chunk takes in the file and once unpacked.
static hw_status add_chunk_rows(cJSON *json, const char *path)
{
    static const struct {
        const char *name;
        uint32_t tag;
    } chunks[] = {
#define X(name, tag) {#name, tag},
        HW_CELL_CHUNK_LIST(X)
#undef X
    };
    hw_container *container = NULL;
    HW_TRY(hw_container_open(&container, path, HW_CELL_MAGIC));
    cJSON *rows = cJSON_AddArrayToObject(json, "chunk_list");
    for (size_t i = 0; i < sizeof chunks / sizeof *chunks; i++) {
        size_t raw = 0, stored = 0;
        if (hw_container_chunk_size(container, chunks[i].tag, 0, &raw, &stored) != HW_OK)
            continue;
        cJSON *row = cJSON_CreateObject();
        cJSON_AddItemToArray(rows, row);
        cJSON_AddStringToObject(row, "chunk", chunks[i].name);
        add_integer(row, "bytes", stored);
        add_integer(row, "unpacked", raw);
    }
    hw_container_close(container);
    return HW_OK;
}

static void add_near_rows(cJSON *json, const hw_cell *cell)
{
    cJSON *rows = cJSON_AddArrayToObject(json, "near_list");
    for (uint32_t i = 0; i < cell->near_count; i++) {
        cJSON *row = cJSON_CreateObject();
        cJSON_AddItemToArray(rows, row);
        add_integer(row, "object", cell->near[i].object_idx);
        add_integer(row, "level", cell->near[i].level);
    }
}

// Of an MVMesh: its captures, and how many triangles none of them sees.
static void add_views(cJSON *row, const hw_cell *cell, const hw_far_record *far)
{
    uint32_t unseen = 0;
    for (uint32_t i = 0; i < far->range_count; i++) {
        const hw_far_range *range = &cell->ranges[far->first_range + i];
        unseen += range->views ? 0 : range->index_count / 3;
    }
    add_integer(row, "views", far->view_count + 1);
    add_integer(row, "ranges", far->range_count);
    add_integer(row, "unseen", unseen);
}

static void add_far_rows(cJSON *json, const hw_cell *cell)
{
    cJSON *rows = cJSON_AddArrayToObject(json, "far_list");
    for (uint32_t i = 0; i < cell->far_count; i++) {
        const hw_far_record *far = &cell->far[i];
        hw_vec3 away = hw_v3_sub(hw_box_centre(far->bounds), cell->centre);
        cJSON *row = cJSON_CreateObject();
        cJSON_AddItemToArray(rows, row);
        add_integer(row, "object", far->object_idx);
        add_integer(row, "face", far->face);
        cJSON_AddBoolToObject(row, "cut_out", far->cut_out);
        hw_json_add_number(row, "distance", floor((double)hw_v3_length(away)));
        add_integer(row, "triangles", far->index_count / 3);
        add_integer(row, "vertices", far->vertex_count);
        add_integer(row, "x", far->rect.x);
        add_integer(row, "y", far->rect.y);
        add_integer(row, "width", far->rect.width);
        add_integer(row, "height", far->rect.height);
        if (far->range_count > 0)
            add_views(row, cell, far);
    }
}

static uint32_t multi_view_count(const hw_cell *cell)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < cell->far_count; i++)
        count += cell->far[i].range_count > 0;
    return count;
}

static hw_status describe_cell(const char *path, cJSON *json)
{
    hw_cell cell = {0};
    HW_TRY(hw_cell_read(path, &cell));
    const double id[] = {cell.id.level, cell.id.q, cell.id.r};
    cJSON_AddStringToObject(json, "kind", "cell");
    add_file_bytes(json, path);
    hw_json_add_numbers(json, "level_q_r", id, 3);
    add_vector(json, "centre", cell.centre);
    add_integer(json, "near_objects", cell.near_count);
    add_integer(json, "far_objects", cell.far_count);
    add_integer(json, "multi_view_objects", multi_view_count(&cell));
    add_integer(json, "vertices", cell.vertex_count);
    add_integer(json, "triangles", cell.index_count / 3);
    add_integer(json, "atlas_width", cell.atlas_width);
    add_integer(json, "atlas_height", cell.atlas_height);
    add_hex(json, "key", cell.key);
    hw_status status = add_chunk_rows(json, path);
    if (cell.near_count > 0)
        add_near_rows(json, &cell);
    if (cell.far_count > 0)
        add_far_rows(json, &cell);
    hw_cell_free(&cell);
    return status;
}

static hw_status describe_mesh(const char *path, cJSON *json)
{
    hw_mesh_file *file = NULL;
    HW_TRY(hw_mesh_file_open(&file, path));
    uint32_t count = hw_mesh_file_level_count(file);
    cJSON_AddStringToObject(json, "kind", "mesh");
    add_file_bytes(json, path);
    add_hex(json, "key", hw_mesh_file_key(file));
    add_integer(json, "levels", count);
    cJSON *rows = cJSON_AddArrayToObject(json, "level_list");
    hw_status status = HW_OK;
    for (uint32_t i = 0; status == HW_OK && i < count; i++) {
        const hw_mesh_level_info *level = hw_mesh_file_level(file, i);
        hw_mesh mesh;
        hw_inner_boxes boxes;
        status = hw_mesh_file_read(file, i, &mesh, &boxes);
        hw_mesh_free(&mesh);
        cJSON *row = cJSON_CreateObject();
        cJSON_AddItemToArray(rows, row);
        add_integer(row, "level", i);
        add_integer(row, "vertices", level->vertex_count);
        add_integer(row, "triangles", level->index_count / 3);
        hw_json_add_number(row, "error_rms", (double)level->error_rms);
        hw_json_add_number(row, "error_p99", (double)level->error_p99);
        hw_json_add_number(row, "error_silhouette", (double)level->error_silhouette);
        hw_json_add_number(row, "error_shading", (double)level->error_shading);
        add_integer(row, "inner_boxes", boxes.count);
    }
    hw_mesh_file_close(file);
    return status;
}

static void add_progressive_sizes(cJSON *json, const hw_progressive_file_info *info)
{
    add_integer(json, "file_bytes", info->file_bytes);
    add_integer(json, "head_bytes", info->head_bytes);
    add_integer(json, "base_bytes", info->base_bytes);
    add_integer(json, "connectivity_bytes", info->connectivity_bytes);
    add_integer(json, "geometry_bytes", info->geometry_bytes);
    add_integer(json, "loose_bytes", info->loose_bytes);
    add_integer(json, "order_bytes", info->order_bytes);
    if (info->vertex_count > 0)
        hw_json_add_number(json, "bytes_per_vertex", (double)info->file_bytes / info->vertex_count);
}

// A row for each batch with the mesh once it is applied; in a strict order for each block.
static void add_progressive_rows(cJSON *json, const hw_progressive_file *file,
                                 const hw_progressive *mesh)
{
    const hw_progressive_file_info *info = hw_progressive_file_get_info(file);
    bool batched = info->mesh.batch_count > 0;
    uint32_t rows = batched ? info->mesh.batch_count : info->block_count, records = 0;
    cJSON *list = cJSON_AddArrayToObject(json, batched ? "batch_list" : "block_list");
    for (uint32_t i = 0; i < rows; i++) {
        uint32_t count = batched ? hw_progressive_file_batches(file)[i]
                                 : hw_progressive_file_block(file, i)->record_count;
        records += count;
        cJSON *row = cJSON_CreateObject();
        cJSON_AddItemToArray(list, row);
        add_integer(row, batched ? "batch" : "block", i);
        add_integer(row, "records", count);
        add_integer(row, "vertices", hw_progressive_vertices_at(mesh, records));
        add_integer(row, "triangles", hw_progressive_faces_at(mesh, records));
    }
}

static void add_progressive(cJSON *json, const hw_progressive_file *file,
                            const hw_progressive *mesh)
{
    const hw_progressive_file_info *info = hw_progressive_file_get_info(file);
    cJSON_AddStringToObject(json, "kind", "progressive mesh");
    add_hex(json, "key", info->key);
    cJSON_AddStringToObject(json, "hierarchy", info->mesh.batch_count ? "batched" : "linear");
    cJSON_AddStringToObject(json, "grid", info->mesh.grid.lossless ? "lossless" : "steps");
    if (!info->mesh.grid.lossless)
        hw_json_add_number(json, "grid_step", info->mesh.grid.step);
    add_integer(json, "base_vertices", info->mesh.base_vertex_count);
    add_integer(json, "base_triangles", info->mesh.base_face_count);
    add_integer(json, "vertices", info->vertex_count);
    add_integer(json, "triangles", info->face_count);
    add_integer(json, "records", info->mesh.record_count);
    add_integer(json, "batches", info->mesh.batch_count);
    add_integer(json, "blocks", info->block_count);
    add_integer(json, "copies", info->mesh.copy_count);
    add_integer(json, "loose_vertices", info->mesh.loose_vertex_count);
    add_integer(json, "loose_triangles", info->mesh.loose_face_count);
    cJSON_AddBoolToObject(json, "complete", info->mesh.complete);
    cJSON_AddBoolToObject(json, "order_kept", info->mesh.keep_order);
    add_progressive_sizes(json, info);
    add_progressive_rows(json, file, mesh);
}

static hw_status describe_progressive(const char *path, cJSON *json)
{
    hw_progressive_file *file = NULL;
    hw_progressive *mesh = NULL;
    HW_TRY(hw_progressive_file_open(&file, path));
    hw_status status = hw_progressive_file_read(file, UINT32_MAX, &mesh);
    if (status == HW_OK)
        add_progressive(json, file, mesh);
    hw_progressive_destroy(mesh);
    hw_progressive_file_close(file);
    return status;
}

static hw_status describe_tour(const char *path, cJSON *json)
{
    hw_tour tour = {0};
    HW_TRY(hw_tour_read(path, &tour));
    hw_box bounds = hw_box_empty();
    double length = 0, seconds = 0;
    for (uint32_t i = 0; i < tour.frame_count; i++) {
        hw_box_add(&bounds, tour.frames[i].eye);
        if (i > 0)
            length += (double)hw_v3_length(hw_v3_sub(tour.frames[i].eye, tour.frames[i - 1].eye));
    }
    if (tour.frame_count > 0)
        seconds = tour.frames[tour.frame_count - 1].t - tour.frames[0].t;
    cJSON_AddStringToObject(json, "kind", "tour");
    add_integer(json, "frames", tour.frame_count);
    hw_json_add_number(json, "fov_degrees", tour.fov_degrees);
    hw_json_add_number(json, "seconds", seconds);
    hw_json_add_number(json, "length", length);
    add_vector(json, "bounds_min", bounds.min);
    add_vector(json, "bounds_max", bounds.max);
    hw_tour_free(&tour);
    return HW_OK;
}

// --- What kind of thing a path is ---------------------------------------------------------------

// The file type that the first four bytes tell; 0 if there are fewer.
static hw_status read_magic(const char *path, uint32_t *magic)
{
    uint8_t bytes[4] = {0};
    hw_reader *reader = NULL;
    hw_status status = HW_OK;
    HW_TRY(hw_reader_open(&reader, path));
    if (hw_reader_size(reader) == 0)
        status = hw_fail(HW_FORMAT, "%s: the file is empty", path);
    else if (hw_reader_size(reader) >= sizeof bytes)
        status = hw_reader_at(reader, 0, bytes, sizeof bytes);
    hw_reader_close(reader);
    hw_bytes_reader r = hw_bytes_reader_make(bytes, sizeof bytes);
    *magic = hw_get_u32(&r);
    return status;
}

static hw_status describe(const char *path, cJSON *json)
{
    struct stat info;
    uint32_t magic = 0;
    if (stat(path, &info) == 0 && S_ISDIR(info.st_mode))
        return describe_dataset(path, json);
    if (map_file)
        return hw_fail(HW_USAGE, "--map is for datasets, and %s is none", path);
    HW_TRY(read_magic(path, &magic));
    if (magic == HW_CELL_MAGIC || hw_path_ends_with(path, ".hxc"))
        return describe_cell(path, json);
    if (magic == HW_MESH_MAGIC || hw_path_ends_with(path, ".hxm"))
        return describe_mesh(path, json);
    if (magic == HW_PROGRESSIVE_MAGIC || hw_path_ends_with(path, ".hxp"))
        return describe_progressive(path, json);
    return hw_path_ends_with(path, ".json") ? describe_tour(path, json)
                                            : describe_scene(path, json);
}

// --- Printing -----------------------------------------------------------------------------------

// Digits of a whole number in groups of three: 8,461,322.
static void format_number(double value, char *out, size_t size)
{
    char digits[64], grouped[96];
    if (!(value >= -1e15 && value <= 1e15) || value != (double)(int64_t)value) {
        snprintf(out, size, "%.6g", value);
        return;
    }
    int length = snprintf(digits, sizeof digits, "%lld", (long long)value), n = 0;
    for (int i = 0; i < length; i++) {
        if (i > (value < 0) && (length - i) % 3 == 0)
            grouped[n++] = ',';
        grouped[n++] = digits[i];
    }
    grouped[n] = 0;
    snprintf(out, size, "%s", grouped);
}

static void format_item(const cJSON *item, char *out, size_t size)
{
    if (cJSON_IsNumber(item))
        format_number(item->valuedouble, out, size);
    else if (cJSON_IsString(item))
        snprintf(out, size, "%s", item->valuestring);
    else if (cJSON_IsBool(item))
        snprintf(out, size, "%s", cJSON_IsTrue(item) ? "yes" : "no");
    else
        snprintf(out, size, "-");
}

// A key as words: cell_bytes becomes "cell bytes".
static void format_key(const char *key, char *out, size_t size)
{
    snprintf(out, size, "%s", key);
    for (char *p = out; *p; p++)
        *p = *p == '_' ? ' ' : *p;
}

static void print_table(const cJSON *rows)
{
    const cJSON *row, *item;
    char text[512];
    int shown = 0, count = cJSON_GetArraySize(rows);
    bool narrow = cJSON_GetArraySize(rows->child) > NARROW_COLUMNS;
    int first = narrow ? -10 : -24, other = narrow ? 10 : 16;
    printf("\n");
    cJSON_ArrayForEach(item, rows->child)
    {
        format_key(item->string, text, sizeof text);
        printf("  %*s", item == rows->child->child ? first : other, text);
    }
    printf("\n");
    cJSON_ArrayForEach(row, rows)
    {
        if (shown++ == ROWS_SHOWN)
            break;
        cJSON_ArrayForEach(item, row)
        {
            format_item(item, text, sizeof text);
            printf("  %*s", item == row->child ? first : other, text);
        }
        printf("\n");
    }
    if (count > ROWS_SHOWN)
        printf("  ... and %d more (--json FILE writes them all)\n", count - ROWS_SHOWN);
}

static void print_report(const cJSON *json)
{
    const cJSON *item, *part;
    char key[64], text[512];
    cJSON_ArrayForEach(item, json)
    {
        if (cJSON_IsArray(item) && cJSON_IsObject(item->child)) {
            print_table(item);
            continue;
        }
        format_key(item->string, key, sizeof key);
        printf("%-20s", key);
        if (!cJSON_IsArray(item)) {
            format_item(item, text, sizeof text);
            printf("%s", text);
        }
        cJSON_ArrayForEach(part, item) // no parts but of an array
        {
            format_item(part, text, sizeof text);
            printf("%s%s", part == item->child ? "" : "  ", text);
        }
        printf("\n");
    }
}

static hw_status check_options(const char *const *argv)
{
    static const char *const of_map[] = {"map-by", "map-side", NULL};
    if (!map_file)
        HW_TRY(hw_options_refuse(&hw_cmd_info, of_map, "is about --map"));
    HW_TRY(hw_output_apart("json", json_file, 1, argv));
    return hw_output_apart("map", map_file, 1, argv);
}

static hw_status run(int argc, const char *const *argv)
{
    (void)argc;
    HW_TRY(check_options(argv));
    cJSON *json = cJSON_CreateObject();
    if (!json)
        return hw_fail(HW_MEMORY, "out of memory");
    hw_json_add_string(json, "path", argv[0]);
    hw_status status = describe(argv[0], json);
    if (status == HW_OK && json_file)
        status = hw_json_write(json_file, json);
    if (status == HW_OK)
        print_report(json);
    cJSON_Delete(json);
    return status;
}

const hw_command hw_cmd_info = {
    .name = "info",
    .summary = "tell what is in a scene, dataset, cell, mesh, progressive mesh or tour",
    .arguments = "SCENE|DATASET|CELL|MESH|PROGRESSIVE|TOUR",
    .description =
        "Reads a dataset folder, a cell (.hxc), a mesh with its levels of detail (.hxm), a "
        "progressive mesh (.hxp), a tour (.json) or any scene or mesh file that can be imported, "
        "checks it, and tells what is in it.",
    .options = options,
    .positional_min = 1,
    .positional_max = 1,
    .run = run,
};
