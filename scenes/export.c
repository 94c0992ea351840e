#include "export.h"
#include "alloc.h"
#include "file.h"
#include "hash.h"
#include "image_io.h"
#include "json.h"
#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
               "arrays are written as they lie in memory");
_Static_assert(sizeof(hw_vec3) == 12 && sizeof(hw_uv) == 8 && sizeof(hw_color8) == 4, "no padding");

enum { GL_U8 = 5121, GL_U16 = 5123, GL_U32 = 5125, GL_FLOAT = 5126 };
enum { TARGET_VERTICES = 34962, TARGET_INDICES = 34963, TARGET_NONE = 0 };

// A piece of the BIN chunk; pieces are padded to 4 bytes.
typedef struct blob {
    const void *data;
    size_t bytes;  // as written
    uint32_t wide; // number of 32-bit indices to be written as 16 bits; 0 = bytes as they are
} blob;

typedef struct exporter {
    const hw_scene *scene;
    cJSON *json;
    cJSON *nodes, *meshes, *materials, *accessors, *views, *textures, *images; // in json
    bool failed;                                                               // cJSON ran out
    blob *blobs;
    size_t blob_count, blob_capacity, bin_bytes;
    uint64_t *pairs; // mesh << 32 | material, sorted, each once: the glTF meshes
    uint32_t pair_count;
    int32_t *texture_of; // per material; -1 = none
    int32_t *plain_of;   // per material: its twin without texture; -1 = none
    uint8_t **pngs;      // per material, NULL where shared or none
    hw_vec3 ground_corners[4], ground_normals[4];
    uint32_t ground_indices[6];
} exporter;

// ---- JSON ---------------------------------------------------------------------------------------

// All builders tolerate NULL and leave a note in `failed`.
static cJSON *append(exporter *e, cJSON *array)
{
    cJSON *item = cJSON_CreateObject();
    if (!item || !cJSON_AddItemToArray(array, item)) {
        e->failed = true;
        cJSON_Delete(item);
        return NULL;
    }
    return item;
}

static void put_item(exporter *e, cJSON *object, const char *key, cJSON *item)
{
    if (item && cJSON_AddItemToObject(object, key, item))
        return;
    e->failed = true;
    cJSON_Delete(item);
}

static void put_number(exporter *e, cJSON *object, const char *key, double value)
{
    put_item(e, object, key, cJSON_CreateNumber(value));
}

static void put_numbers(exporter *e, cJSON *object, const char *key, const double *v, int count)
{
    put_item(e, object, key, cJSON_CreateDoubleArray(v, count));
}

static void put_name(exporter *e, cJSON *object, const char *name)
{
    if (name && name[0] && !hw_json_add_string(object, "name", name))
        e->failed = true;
}

static cJSON *put_array(exporter *e, cJSON *object, const char *key)
{
    cJSON *array = cJSON_CreateArray();
    put_item(e, object, key, array);
    return array;
}

// ---- Buffers ------------------------------------------------------------------------------------

static size_t padded(size_t bytes)
{
    return (bytes + 3) & ~(size_t)3;
}

// Appends a piece and its bufferView; *view gets the view's index.
static hw_status add_blob(exporter *e, blob piece, int target, uint32_t *view)
{
    HW_TRY(HW_RESERVE(&e->blobs, &e->blob_capacity, e->blob_count + 1));
    cJSON *item = append(e, e->views);
    put_number(e, item, "buffer", 0);
    put_number(e, item, "byteOffset", (double)e->bin_bytes);
    put_number(e, item, "byteLength", (double)piece.bytes);
    if (target != TARGET_NONE)
        put_number(e, item, "target", target);
    *view = (uint32_t)e->blob_count;
    e->blobs[e->blob_count++] = piece;
    e->bin_bytes += padded(piece.bytes);
    return HW_OK;
}

// Every accessor but those of images has a view of its own. *item is the accessor's object, its
// index the present size of `accessors`.
static hw_status add_accessor(exporter *e, blob piece, int target, int component, const char *type,
                              uint32_t count, cJSON **item)
{
    uint32_t view;
    HW_TRY(add_blob(e, piece, target, &view));
    *item = append(e, e->accessors);
    put_number(e, *item, "bufferView", view);
    put_number(e, *item, "componentType", component);
    put_number(e, *item, "count", count);
    put_item(e, *item, "type", cJSON_CreateString(type));
    return HW_OK;
}

// Adds one vertex attribute if it is there, under `key` of the primitive's attributes.
static hw_status add_attribute(exporter *e, cJSON *attributes, const char *key, const void *data,
                               uint32_t count, cJSON **item)
{
    static const struct {
        const char *key, *type;
        int component;
        size_t bytes;
    } table[] = {{"POSITION", "VEC3", GL_FLOAT, 12},
                 {"NORMAL", "VEC3", GL_FLOAT, 12},
                 {"COLOR_0", "VEC4", GL_U8, 4},
                 {"TEXCOORD_0", "VEC2", GL_FLOAT, 8}};
    if (!data)
        return HW_OK;
    int k = 0;
    while (strcmp(table[k].key, key) != 0)
        k++;
    put_number(e, attributes, key, cJSON_GetArraySize(e->accessors));
    return add_accessor(e, (blob){data, count * table[k].bytes, 0}, TARGET_VERTICES,
                        table[k].component, table[k].type, count, item);
}

// Writes a mesh's arrays and makes the primitive (attributes and indices) that stands on them.
static hw_status add_geometry(exporter *e, const hw_mesh *mesh, cJSON *primitive)
{
    cJSON *attributes = cJSON_CreateObject(), *item = NULL;
    uint32_t n = mesh->vertex_count;
    put_item(e, primitive, "attributes", attributes);
    HW_TRY(add_attribute(e, attributes, "POSITION", mesh->positions, n, &item));
    hw_box box = hw_mesh_bounds(mesh);
    put_numbers(e, item, "min", (double[]){box.min.x, box.min.y, box.min.z}, 3);
    put_numbers(e, item, "max", (double[]){box.max.x, box.max.y, box.max.z}, 3);
    HW_TRY(add_attribute(e, attributes, "NORMAL", mesh->normals, n, &item));
    HW_TRY(add_attribute(e, attributes, "COLOR_0", mesh->colors, n, &item));
    if (mesh->colors)
        put_item(e, item, "normalized", cJSON_CreateTrue());
    HW_TRY(add_attribute(e, attributes, "TEXCOORD_0", mesh->uvs, n, &item));
    put_number(e, primitive, "indices", cJSON_GetArraySize(e->accessors));
    bool narrow = n <= UINT16_MAX; // index 65535 would mean primitive restart
    blob indices = {mesh->indices, (size_t)mesh->index_count * (narrow ? 2 : 4),
                    narrow ? mesh->index_count : 0};
    return add_accessor(e, indices, TARGET_INDICES, narrow ? GL_U16 : GL_U32, "SCALAR",
                        mesh->index_count, &item);
}

// ---- Materials ----------------------------------------------------------------------------------

static size_t image_bytes(const hw_image *image)
{
    return (size_t)image->width * image->height * image->channels;
}

static bool image_equal(const hw_image *a, const hw_image *b)
{
    return a->width == b->width && a->height == b->height && a->channels == b->channels &&
           memcmp(a->data, b->data, image_bytes(a)) == 0;
}

// The material before i with the same texture, or i.
static uint32_t same_texture(const hw_scene *scene, const uint64_t *hashes, uint32_t i)
{
    const hw_image *texture = &scene->materials[i].texture;
    for (uint32_t k = 0; k < i; k++)
        if (hashes[k] == hashes[i] && scene->materials[k].texture.data &&
            image_equal(&scene->materials[k].texture, texture))
            return k;
    return i;
}

static hw_status add_texture(exporter *e, uint32_t i)
{
    size_t bytes;
    uint32_t view;
    HW_TRY(hw_image_encode_png(&e->scene->materials[i].texture, &e->pngs[i], &bytes));
    HW_TRY(add_blob(e, (blob){e->pngs[i], bytes, 0}, TARGET_NONE, &view));
    e->texture_of[i] = cJSON_GetArraySize(e->images);
    cJSON *image = append(e, e->images);
    put_number(e, image, "bufferView", view);
    put_item(e, image, "mimeType", cJSON_CreateString("image/png"));
    put_number(e, append(e, e->textures), "source", e->texture_of[i]);
    return HW_OK;
}

static hw_status add_textures(exporter *e)
{
    hw_status status = HW_OK;
    const hw_scene *scene = e->scene;
    uint64_t *hashes = NULL;
    HW_GO(HW_NEW(&hashes, scene->material_count));
    HW_GO(HW_NEW(&e->pngs, scene->material_count));
    HW_GO(HW_NEW(&e->texture_of, scene->material_count));
    HW_GO(HW_NEW(&e->plain_of, scene->material_count));
    for (uint32_t i = 0; i < scene->material_count; i++) {
        const hw_image *texture = &scene->materials[i].texture;
        e->texture_of[i] = e->plain_of[i] = -1;
        if (!texture->data)
            continue;
        hashes[i] = hw_hash(0, texture->data, image_bytes(texture));
        uint32_t same = same_texture(scene, hashes, i);
        if (same < i)
            e->texture_of[i] = e->texture_of[same];
        else
            HW_GO(add_texture(e, i));
    }
out:
    hw_free(hashes);
    return status;
}

static void add_material(exporter *e, const char *name, const float color[3], int32_t texture)
{
    double rgba[4] = {fminf(color[0], 1), fminf(color[1], 1), fminf(color[2], 1), 1};
    cJSON *material = append(e, e->materials), *pbr = cJSON_CreateObject();
    put_name(e, material, name);
    put_item(e, material, "pbrMetallicRoughness", pbr);
    put_numbers(e, pbr, "baseColorFactor", rgba, 4);
    put_number(e, pbr, "metallicFactor", 0);
    if (texture < 0)
        return;
    cJSON *reference = cJSON_CreateObject();
    put_item(e, pbr, "baseColorTexture", reference);
    put_number(e, reference, "index", texture);
}

// ---- Meshes -------------------------------------------------------------------------------------

static int compare_u64(const void *a, const void *b)
{
    const uint64_t *x = a, *y = b;
    return *x < *y ? -1 : *x > *y;
}

static uint64_t pair_of(const hw_object *object)
{
    return (uint64_t)object->mesh_idx << 32 | object->material_idx;
}

static hw_status collect_pairs(exporter *e)
{
    const hw_scene *scene = e->scene;
    HW_TRY(HW_NEW(&e->pairs, scene->object_count));
    for (uint32_t i = 0; i < scene->object_count; i++)
        e->pairs[i] = pair_of(&scene->objects[i]);
    qsort(e->pairs, scene->object_count, sizeof *e->pairs, compare_u64);
    for (uint32_t i = 0; i < scene->object_count; i++)
        if (i == 0 || e->pairs[i] != e->pairs[e->pair_count - 1])
            e->pairs[e->pair_count++] = e->pairs[i];
    return HW_OK;
}

// A glTF mesh with one primitive. *primitive gets it; `shared` (may be NULL) is one to copy.
static void add_mesh(exporter *e, const char *name, uint32_t material, const cJSON *shared,
                     cJSON **primitive)
{
    cJSON *mesh = append(e, e->meshes);
    put_name(e, mesh, name);
    cJSON *primitives = put_array(e, mesh, "primitives");
    *primitive = append(e, primitives);
    put_number(e, *primitive, "material", material);
    if (!shared)
        return;
    static const char *const keys[] = {"attributes", "indices"};
    for (int i = 0; i < 2; i++)
        put_item(e, *primitive, keys[i],
                 cJSON_Duplicate(cJSON_GetObjectItemCaseSensitive(shared, keys[i]), true));
}

// The glTF material for a mesh: textured ones must not meet meshes without texture coordinates.
static uint32_t material_for(exporter *e, uint32_t material_idx, const hw_mesh *mesh)
{
    if (e->texture_of[material_idx] < 0 || mesh->uvs)
        return material_idx;
    if (e->plain_of[material_idx] < 0) {
        const hw_material *material = &e->scene->materials[material_idx];
        e->plain_of[material_idx] = cJSON_GetArraySize(e->materials);
        add_material(e, material->name, material->base_color, -1);
    }
    return (uint32_t)e->plain_of[material_idx];
}

// Pairs of one mesh are neighbours: its arrays are written for the first of them.
static hw_status add_meshes(exporter *e)
{
    cJSON *first = NULL, *primitive;
    for (uint32_t i = 0; i < e->pair_count; i++) {
        uint32_t mesh_idx = (uint32_t)(e->pairs[i] >> 32);
        const hw_mesh *mesh = &e->scene->meshes[mesh_idx];
        bool again = i > 0 && e->pairs[i - 1] >> 32 == mesh_idx;
        uint32_t material = material_for(e, (uint32_t)e->pairs[i], mesh);
        add_mesh(e, mesh->name, material, again ? first : NULL, &primitive);
        if (again)
            continue;
        HW_TRY(add_geometry(e, mesh, primitive));
        first = primitive;
    }
    return HW_OK;
}

// ---- Nodes --------------------------------------------------------------------------------------

static hw_status add_ground(exporter *e)
{
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    const hw_box *r = &e->scene->ground.rect;
    const hw_vec3 corners[4] = {{r->min.x, r->min.y, r->min.z},
                                {r->max.x, r->min.y, r->min.z},
                                {r->max.x, r->max.y, r->min.z},
                                {r->min.x, r->max.y, r->min.z}};
    memcpy(e->ground_corners, corners, sizeof corners);
    memcpy(e->ground_indices, indices, sizeof indices);
    for (int i = 0; i < 4; i++)
        e->ground_normals[i] = hw_v3(0, 0, 1);
    hw_mesh quad = {.vertex_count = 4,
                    .index_count = 6,
                    .positions = e->ground_corners,
                    .normals = e->ground_normals,
                    .indices = e->ground_indices};
    cJSON *primitive;
    uint32_t material = (uint32_t)cJSON_GetArraySize(e->materials);
    add_mesh(e, HW_GROUND_NAME, material, NULL, &primitive);
    add_material(e, HW_GROUND_NAME, e->scene->ground.color, -1);
    HW_TRY(add_geometry(e, &quad, primitive));
    cJSON *node = append(e, e->nodes);
    put_name(e, node, HW_GROUND_NAME);
    put_number(e, node, "mesh", e->pair_count);
    return HW_OK;
}

static void add_object(exporter *e, const hw_object *object)
{
    hw_mat4 identity = hw_mat4_identity();
    uint64_t pair = pair_of(object);
    const uint64_t *found = bsearch(&pair, e->pairs, e->pair_count, sizeof *e->pairs, compare_u64);
    cJSON *node = append(e, e->nodes);
    put_name(e, node, e->scene->meshes[object->mesh_idx].name);
    put_number(e, node, "mesh", (double)(found - e->pairs));
    if (memcmp(identity.m, object->transform.m, sizeof identity.m) != 0)
        put_numbers(e, node, "matrix", object->transform.m, 16);
}

// Node 0 turns z-up to glTF's y-up, (x, y, z) -> (x, z, -y); all others are its children.
static hw_status add_nodes(exporter *e)
{
    static const double turn[16] = {1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1};
    const hw_scene *scene = e->scene;
    hw_status status = HW_OK;
    uint32_t count = scene->object_count + scene->ground.present;
    int *children = NULL;
    HW_GO(HW_NEW(&children, count));
    cJSON *root = append(e, e->nodes);
    put_name(e, root, "z-up");
    put_numbers(e, root, "matrix", turn, 16);
    for (uint32_t i = 0; i < scene->object_count; i++)
        add_object(e, &scene->objects[i]);
    if (scene->ground.present)
        HW_GO(add_ground(e));
    for (uint32_t i = 0; i < count; i++)
        children[i] = (int)i + 1;
    put_item(e, root, "children", cJSON_CreateIntArray(children, (int)count));
out:
    hw_free(children);
    return status;
}

// ---- The file -----------------------------------------------------------------------------------

static void begin_document(exporter *e)
{
    const struct {
        const char *key;
        cJSON **array;
    } arrays[] = {{"nodes", &e->nodes},         {"meshes", &e->meshes},
                  {"materials", &e->materials}, {"accessors", &e->accessors},
                  {"bufferViews", &e->views},   {"textures", &e->textures},
                  {"images", &e->images}};
    e->json = cJSON_CreateObject();
    cJSON *asset = cJSON_CreateObject();
    put_item(e, e->json, "asset", asset);
    put_item(e, asset, "version", cJSON_CreateString("2.0"));
    put_item(e, asset, "generator", cJSON_CreateString("hexwalk"));
    put_number(e, e->json, "scene", 0);
    cJSON *scenes = put_array(e, e->json, "scenes");
    put_numbers(e, append(e, scenes), "nodes", (double[]){0}, 1);
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        *arrays[i].array = put_array(e, e->json, arrays[i].key);
}

// glTF forbids empty arrays.
static void end_document(exporter *e)
{
    if (cJSON_GetArraySize(e->images) == 0) {
        cJSON_DeleteItemFromObjectCaseSensitive(e->json, "images");
        cJSON_DeleteItemFromObjectCaseSensitive(e->json, "textures");
    }
    cJSON *buffers = put_array(e, e->json, "buffers");
    put_number(e, append(e, buffers), "byteLength", (double)e->bin_bytes);
}

static hw_status build_document(exporter *e)
{
    begin_document(e);
    HW_TRY(collect_pairs(e));
    HW_TRY(add_textures(e));
    for (uint32_t i = 0; i < e->scene->material_count; i++)
        add_material(e, e->scene->materials[i].name, e->scene->materials[i].base_color,
                     e->texture_of[i]);
    HW_TRY(add_meshes(e));
    HW_TRY(add_nodes(e));
    end_document(e);
    return e->failed ? hw_fail(HW_MEMORY, "out of memory for the glTF document") : HW_OK;
}

static hw_status write_u32s(hw_writer *writer, const uint32_t *values, int count)
{
    return hw_writer_put(writer, values, (size_t)count * sizeof *values);
}

static hw_status write_blob(hw_writer *writer, const blob *piece)
{
    static const uint8_t zeros[4];
    if (piece->wide == 0)
        HW_TRY(hw_writer_put(writer, piece->data, piece->bytes));
    const uint32_t *wide = piece->data;
    uint16_t narrow[4096];
    for (uint32_t i = 0; i < piece->wide;) {
        uint32_t n = 0;
        while (n < 4096 && i < piece->wide)
            narrow[n++] = (uint16_t)wide[i++];
        HW_TRY(hw_writer_put(writer, narrow, n * sizeof *narrow));
    }
    return hw_writer_put(writer, zeros, padded(piece->bytes) - piece->bytes);
}

// GLB (glTF 2.0, section 4.4): header, JSON chunk padded with spaces, BIN chunk.
static hw_status write_glb(const exporter *e, const char *path, const char *text)
{
    hw_status status = HW_OK;
    hw_writer *writer = NULL;
    size_t length = strlen(text);
    uint64_t total = 12 + 8 + (uint64_t)padded(length) + 8 + e->bin_bytes;
    if (total > UINT32_MAX)
        return hw_fail(HW_LIMIT, "%s: a GLB file ends at 4 GiB, this scene needs %llu bytes", path,
                       (unsigned long long)total);
    const uint32_t header[5] = {0x46546c67, 2, (uint32_t)total, (uint32_t)padded(length),
                                0x4e4f534a};
    const uint32_t bin_header[2] = {(uint32_t)e->bin_bytes, 0x004e4942};
    HW_GO(hw_writer_open(&writer, path));
    HW_GO(write_u32s(writer, header, 5));
    HW_GO(hw_writer_put(writer, text, length));
    HW_GO(hw_writer_put(writer, "   ", padded(length) - length));
    HW_GO(write_u32s(writer, bin_header, 2));
    for (size_t i = 0; i < e->blob_count; i++)
        HW_GO(write_blob(writer, &e->blobs[i]));
    hw_writer *finished = writer;
    writer = NULL;
    HW_GO(hw_writer_commit(finished));
out:
    hw_writer_abort(writer);
    return status;
}

static void exporter_free(exporter *e)
{
    cJSON_Delete(e->json);
    for (uint32_t i = 0; e->pngs && i < e->scene->material_count; i++)
        hw_free(e->pngs[i]);
    hw_free(e->pngs);
    hw_free(e->texture_of);
    hw_free(e->plain_of);
    hw_free(e->pairs);
    hw_free(e->blobs);
}

hw_status hw_scene_export_glb(const hw_scene *scene, const char *path)
{
    hw_status status = HW_OK;
    exporter e = {.scene = scene};
    char *text = NULL;
    HW_GO(hw_scene_validate(scene));
    status = build_document(&e);
    if (status != HW_OK) {
        status = hw_fail_prefix(status, path);
        goto out;
    }
    text = cJSON_PrintUnformatted(e.json);
    if (!text) {
        status = hw_fail(HW_MEMORY, "%s: out of memory for the glTF document", path);
        goto out;
    }
    HW_GO(write_glb(&e, path, text));
out:
    cJSON_free(text);
    exporter_free(&e);
    return status;
}

// ---- PLY ----------------------------------------------------------------------------------------

static hw_status write_ply_header(hw_writer *writer, const hw_mesh *mesh)
{
    char text[512];
    int n =
        snprintf(text, sizeof text,
                 "ply\nformat binary_little_endian 1.0\nelement vertex %u\n"
                 "property float x\nproperty float y\nproperty float z\n%s%s"
                 "element face %u\nproperty list uchar int vertex_indices\nend_header\n",
                 mesh->vertex_count,
                 mesh->normals ? "property float nx\nproperty float ny\nproperty float nz\n" : "",
                 mesh->colors ? "property uchar red\nproperty uchar green\n"
                                "property uchar blue\nproperty uchar alpha\n"
                              : "",
                 mesh->index_count / 3);
    assert(n > 0 && (size_t)n < sizeof text);
    return hw_writer_put(writer, text, (size_t)n);
}

static hw_status write_ply(hw_writer *writer, const hw_mesh *mesh)
{
    static const uint8_t corners = 3;
    HW_TRY(write_ply_header(writer, mesh));
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        HW_TRY(hw_writer_put(writer, &mesh->positions[i], sizeof *mesh->positions));
        if (mesh->normals)
            HW_TRY(hw_writer_put(writer, &mesh->normals[i], sizeof *mesh->normals));
        if (mesh->colors)
            HW_TRY(hw_writer_put(writer, &mesh->colors[i], sizeof *mesh->colors));
    }
    for (uint32_t i = 0; i + 2 < mesh->index_count; i += 3) {
        HW_TRY(hw_writer_put(writer, &corners, 1));
        HW_TRY(hw_writer_put(writer, mesh->indices + i, 3 * sizeof *mesh->indices));
    }
    return HW_OK;
}

hw_status hw_mesh_export_ply(const hw_mesh *mesh, const char *path)
{
    hw_status status = hw_mesh_validate(mesh);
    hw_writer *writer = NULL;
    if (status == HW_OK && mesh->vertex_count > INT32_MAX)
        status = hw_fail(HW_LIMIT, "too many vertices for a PLY file");
    if (status != HW_OK)
        return hw_fail_prefix(status, path);
    HW_GO(hw_writer_open(&writer, path));
    HW_GO(write_ply(writer, mesh));
    hw_writer *finished = writer;
    writer = NULL;
    HW_GO(hw_writer_commit(finished));
out:
    hw_writer_abort(writer);
    return status;
}
