#include "alloc.h"
#include "bytes.h"
#include "file.h"
#include "import_check.h"
#include "json.h"
#include <string.h>

#define GLB_MAGIC      0x46546c67u // "glTF"
#define GLB_CHUNK_JSON 0x4e4f534au
#define GLB_CHUNK_BIN  0x004e4942u
#define NODE_DEPTH_MAX 500
#define COUNT_MAX      4294967295.0

enum { GL_U8 = 5121, GL_U16 = 5123, GL_U32 = 5125, GL_FLOAT = 5126 };

typedef struct gltf_buffer {
    uint64_t size;
    const uint8_t *data; // NULL for data URIs
    uint8_t *owned;      // of a file beside the model
} gltf_buffer;

typedef struct gltf_view {
    uint32_t buffer;
    uint64_t offset, size, stride;
} gltf_view;

typedef struct gltf_accessor {
    uint32_t view, component, components; // components: 1 for SCALAR, ...
    uint64_t offset, count, stride;
} gltf_accessor;

typedef struct gltf_file {
    const char *path;
    const uint8_t *bin; // the BIN chunk of a GLB
    size_t bin_size;
    bool binary;  // a GLB
    bool decoded; // a buffer's file was found by its decoded name only
    cJSON *json;
    uint32_t buffer_count, view_count, accessor_count, mesh_count, material_count, node_count;
    gltf_buffer *buffers;
    gltf_view *views;
    gltf_accessor *accessors;
} gltf_file;

// ---- JSON ---------------------------------------------------------------------------------------

static hw_status fail_at(const gltf_file *g, const char *kind, uint32_t index, const char *cause)
{
    return hw_fail(HW_FORMAT, "%s: %s %u: %s", g->path, kind, index, cause);
}

// A top-level array; NULL if absent or no array.
static const cJSON *array_of(const gltf_file *g, const char *key, uint32_t *count)
{
    const cJSON *array = cJSON_GetObjectItemCaseSensitive(g->json, key);
    *count = cJSON_IsArray(array) ? (uint32_t)cJSON_GetArraySize(array) : 0;
    return *count ? array : NULL;
}

// A whole number in [0, max]; `absent` if the key is missing. False if it is something else.
static bool get_count(const cJSON *object, const char *key, double max, uint64_t absent,
                      uint64_t *out)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
    *out = absent;
    if (!item)
        return true;
    double v = item->valuedouble;
    if (!cJSON_IsNumber(item) || !(v >= 0 && v <= max) || v != (double)(uint64_t)v)
        return false;
    *out = (uint64_t)v;
    return true;
}

// An index below `count`; *out = UINT32_MAX if the key is missing.
static bool get_index(const cJSON *object, const char *key, uint32_t count, uint32_t *out)
{
    uint64_t v;
    bool good = get_count(object, key, COUNT_MAX, UINT32_MAX, &v) && (v < count || v == UINT32_MAX);
    *out = good ? (uint32_t)v : UINT32_MAX;
    return good;
}

// ---- Buffers ------------------------------------------------------------------------------------

static bool is_external(const cJSON *uri)
{
    return cJSON_IsString(uri) && strncmp(uri->valuestring, "data:", 5) != 0;
}

// The file that a URI means, relative to the model's folder; *decoded tells that it is not the one
// of that very name. A GLB's are left to Assimp, which does not decode them.
static hw_status external_path(const gltf_file *g, const char *uri, char **out, bool *decoded)
{
    hw_status status = HW_OK;
    char *dir = NULL, *local = NULL;
    *decoded = false;
    HW_GO(hw_path_dir(&dir, g->path));
    HW_GO(hw_path_join(out, dir, uri));
    if (g->binary || hw_path_exists(*out))
        goto out;
    HW_GO(hw_strdup(&local, uri));
    hw_model_decode_path(local, true);
    *decoded = strcmp(local, uri) != 0;
    hw_free(*out);
    *out = NULL;
    HW_GO(hw_path_join(out, dir, local));
out:
    hw_free(dir);
    hw_free(local);
    return status;
}

static hw_status open_external(gltf_file *g, gltf_buffer *buffer, const char *uri)
{
    hw_status status = HW_OK;
    char *full = NULL;
    size_t size = 0;
    bool decoded;
    HW_GO(external_path(g, uri, &full, &decoded));
    if (hw_path_exists(full)) {
        g->decoded |= decoded;
        status = hw_file_read(full, 0, &buffer->owned, &size);
        if (status != HW_OK) {
            status = hw_fail_prefix(status, g->path);
            goto out;
        }
        buffer->data = buffer->owned;
    }
    if (size < buffer->size)
        status = hw_fail(HW_FORMAT, "%s: buffer %s is %s", g->path, uri,
                         buffer->owned ? "truncated" : "missing");
out:
    hw_free(full);
    return status;
}

static hw_status check_buffer(gltf_file *g, const cJSON *item, uint32_t i, gltf_buffer *buffer)
{
    const cJSON *uri = cJSON_GetObjectItemCaseSensitive(item, "uri");
    if (!get_count(item, "byteLength", COUNT_MAX, 0, &buffer->size) || buffer->size == 0)
        return fail_at(g, "buffer", i, "no length");
    if (is_external(uri))
        return open_external(g, buffer, uri->valuestring);
    if (cJSON_IsString(uri))
        return strlen(uri->valuestring) / 4 * 3 + 3 >= buffer->size
                   ? HW_OK
                   : fail_at(g, "buffer", i, "its data URI is truncated");
    if (i > 0 || !g->bin || g->bin_size < buffer->size)
        return fail_at(g, "buffer", i, "its bytes are missing or truncated");
    buffer->data = g->bin;
    return HW_OK;
}

static hw_status check_buffers(gltf_file *g)
{
    const cJSON *array = array_of(g, "buffers", &g->buffer_count), *item;
    uint32_t i = 0;
    HW_TRY(HW_NEW(&g->buffers, g->buffer_count));
    cJSON_ArrayForEach(item, array)
    {
        HW_TRY(check_buffer(g, item, i, &g->buffers[i]));
        i++;
    }
    return HW_OK;
}

static hw_status check_views(gltf_file *g)
{
    const cJSON *array = array_of(g, "bufferViews", &g->view_count), *item;
    uint32_t i = 0;
    HW_TRY(HW_NEW(&g->views, g->view_count));
    cJSON_ArrayForEach(item, array)
    {
        gltf_view *view = &g->views[i];
        if (!get_index(item, "buffer", g->buffer_count, &view->buffer) ||
            view->buffer == UINT32_MAX ||
            !get_count(item, "byteOffset", COUNT_MAX, 0, &view->offset) ||
            !get_count(item, "byteLength", COUNT_MAX, 0, &view->size) ||
            !get_count(item, "byteStride", 252, 0, &view->stride) ||
            view->offset + view->size > g->buffers[view->buffer].size)
            return fail_at(g, "bufferView", i, "malformed or beyond its buffer");
        i++;
    }
    return HW_OK;
}

// ---- Accessors ----------------------------------------------------------------------------------

static uint32_t component_count(const cJSON *item)
{
    static const struct {
        const char *name;
        uint32_t count;
    } types[] = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4},
                 {"MAT2", 4},   {"MAT3", 9}, {"MAT4", 16}};
    const cJSON *type = cJSON_GetObjectItemCaseSensitive(item, "type");
    for (size_t i = 0; cJSON_IsString(type) && i < sizeof types / sizeof *types; i++)
        if (strcmp(type->valuestring, types[i].name) == 0)
            return types[i].count;
    return 0;
}

static uint32_t component_bytes(uint32_t component)
{
    static const uint8_t bytes[] = {1, 1, 2, 2, 0, 4, 4}; // 5120: i8, u8, i16, u16, -, u32, f32
    return component >= 5120 && component <= 5126 ? bytes[component - 5120] : 0;
}

static hw_status check_accessor(const gltf_file *g, const cJSON *item, uint32_t i, gltf_accessor *a)
{
    uint64_t component;
    if (cJSON_GetObjectItemCaseSensitive(item, "sparse"))
        return fail_at(g, "accessor", i, "sparse accessors are not supported");
    if (!get_index(item, "bufferView", g->view_count, &a->view) || a->view == UINT32_MAX)
        return fail_at(g, "accessor", i, "no bufferView, or out of range");
    if (!get_count(item, "componentType", 5126, 0, &component) ||
        !get_count(item, "byteOffset", COUNT_MAX, 0, &a->offset) ||
        !get_count(item, "count", COUNT_MAX - 1, 0, &a->count) || a->count == 0)
        return fail_at(g, "accessor", i, "malformed");
    const gltf_view *view = &g->views[a->view];
    a->component = (uint32_t)component;
    a->components = component_count(item);
    uint64_t bytes = (uint64_t)component_bytes(a->component) * a->components;
    if (bytes == 0)
        return fail_at(g, "accessor", i, "unknown type");
    a->stride = view->stride ? view->stride : bytes;
    if (a->stride < bytes || a->offset + a->stride * (a->count - 1) + bytes > view->size)
        return fail_at(g, "accessor", i, "beyond its bufferView");
    return HW_OK;
}

static hw_status check_accessors(gltf_file *g)
{
    const cJSON *array = array_of(g, "accessors", &g->accessor_count), *item;
    uint32_t i = 0;
    HW_TRY(HW_NEW(&g->accessors, g->accessor_count));
    cJSON_ArrayForEach(item, array)
    {
        HW_TRY(check_accessor(g, item, i, &g->accessors[i]));
        i++;
    }
    return HW_OK;
}

// ---- Meshes -------------------------------------------------------------------------------------

static hw_status check_indices(const gltf_file *g, uint32_t mesh, const gltf_accessor *a,
                               uint64_t vertices)
{
    const gltf_view *view = &g->views[a->view];
    const uint8_t *data = g->buffers[view->buffer].data;
    if (a->components != 1 ||
        (a->component != GL_U8 && a->component != GL_U16 && a->component != GL_U32))
        return fail_at(g, "mesh", mesh, "indices that are no whole numbers");
    uint32_t bytes = component_bytes(a->component);
    for (uint64_t i = 0; data && i < a->count; i++) {
        const uint8_t *p = data + view->offset + a->offset + i * a->stride;
        uint32_t index = 0;
        for (uint32_t k = 0; k < bytes; k++)
            index |= (uint32_t)p[k] << (8 * k);
        if (index >= vertices)
            return hw_fail(HW_FORMAT, "%s: mesh %u: index %u out of range (%llu vertices)", g->path,
                           mesh, index, (unsigned long long)vertices);
    }
    return HW_OK;
}

static hw_status check_primitive(const gltf_file *g, uint32_t mesh, const cJSON *item)
{
    const cJSON *attributes = cJSON_GetObjectItemCaseSensitive(item, "attributes"), *attribute;
    uint32_t position, indices, material;
    uint64_t mode;
    if (!get_index(attributes, "POSITION", g->accessor_count, &position) || position == UINT32_MAX)
        return fail_at(g, "mesh", mesh, "a primitive without positions");
    const gltf_accessor *p = &g->accessors[position];
    if (p->component != GL_FLOAT || p->components != 3)
        return fail_at(g, "mesh", mesh, "positions that are not three floats");
    cJSON_ArrayForEach(attribute, attributes)
    {
        uint32_t a;
        if (!get_index(attributes, attribute->string, g->accessor_count, &a) || a == UINT32_MAX)
            return fail_at(g, "mesh", mesh, "an attribute's accessor is out of range");
        if (g->accessors[a].count != p->count)
            return fail_at(g, "mesh", mesh, "attributes of different lengths");
    }
    if (!get_index(item, "indices", g->accessor_count, &indices) ||
        !get_index(item, "material", g->material_count, &material) ||
        !get_count(item, "mode", 6, 4, &mode))
        return fail_at(g, "mesh", mesh, "indices, material or mode out of range");
    if (indices != UINT32_MAX)
        return check_indices(g, mesh, &g->accessors[indices], p->count);
    return HW_OK;
}

static hw_status check_meshes(gltf_file *g)
{
    const cJSON *array = array_of(g, "meshes", &g->mesh_count), *mesh, *primitive;
    uint32_t i = 0;
    (void)array_of(g, "materials", &g->material_count);
    cJSON_ArrayForEach(mesh, array)
    {
        const cJSON *primitives = cJSON_GetObjectItemCaseSensitive(mesh, "primitives");
        cJSON_ArrayForEach(primitive, primitives) HW_TRY(check_primitive(g, i, primitive));
        i++;
    }
    return i > 0 ? HW_OK : hw_fail(HW_FORMAT, "%s: no triangle", g->path);
}

// Assimp crashes over media types without a slash.
static hw_status check_images(const gltf_file *g)
{
    uint32_t count, view, i = 0;
    const cJSON *array = array_of(g, "images", &count), *item;
    cJSON_ArrayForEach(item, array)
    {
        const cJSON *type = cJSON_GetObjectItemCaseSensitive(item, "mimeType");
        if (type && (!cJSON_IsString(type) || strncmp(type->valuestring, "image/", 6) != 0))
            return fail_at(g, "image", i, "its media type is none of an image");
        if (!get_index(item, "bufferView", g->view_count, &view))
            return fail_at(g, "image", i, "its bufferView is out of range");
        i++;
    }
    return HW_OK;
}

// ---- Nodes --------------------------------------------------------------------------------------

static hw_status check_numbers(const gltf_file *g, uint32_t node, const cJSON *item,
                               const char *key, int count)
{
    const cJSON *array = cJSON_GetObjectItemCaseSensitive(item, key), *number;
    if (!array)
        return HW_OK;
    bool good = cJSON_IsArray(array) && cJSON_GetArraySize(array) == count;
    cJSON_ArrayForEach(number, array) good = good && cJSON_IsNumber(number);
    return good ? HW_OK : fail_at(g, "node", node, "a malformed transform");
}

static hw_status check_node(const gltf_file *g, uint32_t i, const cJSON *item, uint32_t *parents)
{
    uint32_t mesh;
    if (!get_index(item, "mesh", g->mesh_count, &mesh))
        return fail_at(g, "node", i, "its mesh is out of range");
    HW_TRY(check_numbers(g, i, item, "matrix", 16));
    HW_TRY(check_numbers(g, i, item, "translation", 3));
    HW_TRY(check_numbers(g, i, item, "rotation", 4));
    HW_TRY(check_numbers(g, i, item, "scale", 3));
    const cJSON *children = cJSON_GetObjectItemCaseSensitive(item, "children"), *child;
    cJSON_ArrayForEach(child, children)
    {
        double c = child->valuedouble;
        if (!cJSON_IsNumber(child) || !(c >= 0 && c < g->node_count) || c != (uint32_t)c)
            return fail_at(g, "node", i, "a child is out of range");
        if (parents[(uint32_t)c] != UINT32_MAX)
            return fail_at(g, "node", (uint32_t)c, "more than one parent");
        parents[(uint32_t)c] = i;
    }
    return HW_OK;
}

// Every chain of parents must end: no cycle, and no depth that would exhaust a recursive reader.
// `depths` holds zeros; a root gets 1.
static hw_status check_depths(const gltf_file *g, const uint32_t *parents, uint32_t *depths)
{
    for (uint32_t i = 0; i < g->node_count; i++) {
        uint32_t above = 0, n = i; // steps up to a node whose depth is known, or above the root
        while (n != UINT32_MAX && depths[n] == 0 && above <= NODE_DEPTH_MAX) {
            n = parents[n];
            above++;
        }
        uint32_t depth = above + (n == UINT32_MAX ? 0 : depths[n]);
        if (depth > NODE_DEPTH_MAX)
            return fail_at(g, "node", i, "nested too deeply, or in a cycle");
        for (n = i; above > 0; above--, depth--, n = parents[n])
            depths[n] = depth;
    }
    return HW_OK;
}

static hw_status check_nodes(gltf_file *g)
{
    hw_status status = HW_OK;
    const cJSON *array = array_of(g, "nodes", &g->node_count), *item;
    uint32_t *parents = NULL, *depths = NULL, i = 0;
    HW_GO(HW_NEW(&parents, g->node_count));
    HW_GO(HW_NEW(&depths, g->node_count));
    memset(parents, 0xff, g->node_count * sizeof *parents);
    cJSON_ArrayForEach(item, array)
    {
        HW_GO(check_node(g, i, item, parents));
        i++;
    }
    HW_GO(check_depths(g, parents, depths));
out:
    hw_free(parents);
    hw_free(depths);
    return status;
}

// ---- The file -----------------------------------------------------------------------------------

// Assimp passes over those that it does not know. Materials have a colour without theirs, and
// nothing here is lit.
static hw_status check_extensions(const gltf_file *g)
{
    static const char materials[] = "KHR_materials_";
    const cJSON *array = cJSON_GetObjectItemCaseSensitive(g->json, "extensionsRequired"), *item;
    cJSON_ArrayForEach(item, array)
    {
        const char *name = cJSON_IsString(item) ? item->valuestring : "an extension without a name";
        if (strncmp(name, materials, strlen(materials)) != 0 &&
            strcmp(name, "KHR_lights_punctual") != 0)
            return hw_fail(HW_FORMAT, "%s: it needs %s, which is not supported", g->path, name);
    }
    return HW_OK;
}

static hw_status check_document(gltf_file *g, const char *text, size_t size)
{
    HW_TRY(hw_json_parse(g->path, text, size, &g->json));
    const cJSON *asset = cJSON_GetObjectItemCaseSensitive(g->json, "asset");
    const cJSON *version = cJSON_GetObjectItemCaseSensitive(asset, "version");
    if (!cJSON_IsString(version))
        return hw_fail(HW_FORMAT, "%s: no glTF file (no asset.version)", g->path);
    if (strncmp(version->valuestring, "2.", 2) != 0)
        return hw_fail(HW_VERSION, "%s: glTF version %.16s, 2.x expected", g->path,
                       version->valuestring);
    HW_TRY(check_extensions(g));
    HW_TRY(check_buffers(g));
    HW_TRY(check_views(g));
    HW_TRY(check_accessors(g));
    HW_TRY(check_meshes(g));
    HW_TRY(check_images(g));
    return check_nodes(g);
}

// GLB: a header of 12 bytes, then chunks: length, type, data (glTF 2.0, section 4.4).
static hw_status check_container(const hw_model_bytes *file, gltf_file *g, hw_bytes_reader *r,
                                 const uint8_t **json, size_t *json_size)
{
    uint32_t version = hw_get_u32(r), length = hw_get_u32(r);
    if (!r->failed && version != 2)
        return hw_fail(HW_VERSION, "%s: GLB version %u, 2 expected", file->path, version);
    if (r->failed || length > file->size)
        return hw_fail(HW_FORMAT, "%s: truncated (%u bytes announced, %zu there)", file->path,
                       length, file->size);
    r->size = length;
    *json_size = hw_get_u32(r);
    bool is_json = hw_get_u32(r) == GLB_CHUNK_JSON;
    *json = hw_get_span(r, *json_size);
    if (r->failed || !is_json)
        return hw_fail(HW_FORMAT, "%s: its JSON chunk is missing or truncated", file->path);
    if (hw_bytes_left(r) == 0)
        return HW_OK;
    g->bin_size = hw_get_u32(r);
    bool is_bin = hw_get_u32(r) == GLB_CHUNK_BIN;
    g->bin = hw_get_span(r, g->bin_size);
    if (r->failed || !is_bin)
        return hw_fail(HW_FORMAT, "%s: its BIN chunk is malformed or truncated", file->path);
    return HW_OK;
}

static void gltf_free(gltf_file *g)
{
    cJSON_Delete(g->json);
    for (uint32_t i = 0; g->buffers && i < g->buffer_count; i++)
        hw_free(g->buffers[i].owned);
    hw_free(g->buffers);
    hw_free(g->views);
    hw_free(g->accessors);
}

// The document with the buffers' paths in place of their URIs, which Assimp takes as they are.
static hw_status rewrite_uris(gltf_file *g, hw_model_facts *facts)
{
    cJSON *item;
    hw_status status = HW_OK;
    char *full = NULL, *text = NULL;
    cJSON_ArrayForEach(item, cJSON_GetObjectItemCaseSensitive(g->json, "buffers"))
    {
        const cJSON *uri = cJSON_GetObjectItemCaseSensitive(item, "uri");
        bool decoded;
        if (!is_external(uri))
            continue;
        HW_GO(external_path(g, uri->valuestring, &full, &decoded));
        cJSON *path = cJSON_CreateString(full);
        if (!path || !cJSON_ReplaceItemInObjectCaseSensitive(item, "uri", path))
            HW_GO(hw_fail(HW_MEMORY, "out of memory"));
        hw_free(full);
        full = NULL;
    }
    text = cJSON_PrintUnformatted(g->json);
    if (!text)
        HW_GO(hw_fail(HW_MEMORY, "out of memory"));
    HW_GO(hw_strdup(&facts->text, text));
    facts->text_bytes = strlen(text);
out:
    cJSON_free(text);
    hw_free(full);
    return status;
}

hw_status hw_check_gltf(const hw_model_bytes *file, hw_model_facts *facts)
{
    hw_status status = HW_OK;
    gltf_file g = {.path = file->path};
    const uint8_t *json = file->data;
    size_t json_size = file->size;
    hw_bytes_reader r = hw_bytes_reader_make(file->data, file->size);
    g.binary = hw_get_u32(&r) == GLB_MAGIC;
    size_t name = strlen(file->path);
    if (g.binary)
        HW_GO(check_container(file, &g, &r, &json, &json_size));
    else if (file->path[name - 1] == 'b' || file->path[name - 1] == 'B') {
        status = hw_fail(HW_FORMAT, "%s: no GLB file", file->path);
        goto out;
    }
    HW_GO(check_document(&g, (const char *)json, json_size));
    if (g.decoded)
        HW_GO(rewrite_uris(&g, facts));
out:
    gltf_free(&g);
    return status;
}
