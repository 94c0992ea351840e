#include "mesh_level.h"
#include "geometry_codec.h"

#define TABLE_HEADER_BYTES 8u
#define TABLE_ENTRY_BYTES  24u

// Streams of a level, in the order of the chunk.
enum { POSITIONS, NORMALS, COLORS, UVS, INDICES, STREAM_COUNT };
#define HAS_NORMALS 1u
#define HAS_COLORS  2u
#define HAS_UVS     4u

_Static_assert(sizeof(hw_vec3) == 12 && sizeof(hw_color8) == 4 && sizeof(hw_uv) == 8,
               "vertex streams are written as they stand in memory");

typedef struct octahedral {
    int16_t xy[2];
} octahedral;
_Static_assert(sizeof(octahedral) == 4, "a packed normal is four bytes");

static float fold(float a, float b)
{
    return (1 - fabsf(b)) * (a < 0 ? -1.0f : 1.0f);
}

void hw_octahedral_encode(hw_vec3 n, int16_t out[2])
{
    float sum = fabsf(n.x) + fabsf(n.y) + fabsf(n.z);
    float x = sum > 0 ? n.x / sum : 0, y = sum > 0 ? n.y / sum : 0;
    bool below = n.z < 0;
    out[0] = (int16_t)lrintf((below ? fold(x, y) : x) * 32767);
    out[1] = (int16_t)lrintf((below ? fold(y, x) : y) * 32767);
}

hw_vec3 hw_octahedral_decode(const int16_t in[2])
{
    float x = in[0] / 32767.0f, y = in[1] / 32767.0f;
    float z = 1 - fabsf(x) - fabsf(y);
    if (z < 0)
        return hw_v3_normalize(hw_v3(fold(x, y), fold(y, x), z));
    return hw_v3_normalize(hw_v3(x, y, z));
}

static hw_status encode_normals(const hw_mesh *mesh, uint8_t **bytes, size_t *size)
{
    octahedral *packed = NULL;
    HW_TRY(HW_NEW(&packed, mesh->vertex_count));
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        hw_octahedral_encode(mesh->normals[i], packed[i].xy);
    hw_status status = hw_vertices_encode(packed, mesh->vertex_count, sizeof *packed, bytes, size);
    hw_free(packed);
    return status;
}

static hw_status encode_streams(const hw_mesh *mesh, uint8_t *bytes[STREAM_COUNT],
                                size_t size[STREAM_COUNT])
{
    uint32_t n = mesh->vertex_count;
    HW_TRY(hw_vertices_encode(mesh->positions, n, sizeof *mesh->positions, &bytes[POSITIONS],
                              &size[POSITIONS]));
    if (mesh->normals)
        HW_TRY(encode_normals(mesh, &bytes[NORMALS], &size[NORMALS]));
    if (mesh->colors)
        HW_TRY(hw_vertices_encode(mesh->colors, n, sizeof *mesh->colors, &bytes[COLORS],
                                  &size[COLORS]));
    if (mesh->uvs)
        HW_TRY(hw_vertices_encode(mesh->uvs, n, sizeof *mesh->uvs, &bytes[UVS], &size[UVS]));
    return hw_indices_encode(mesh->indices, mesh->index_count, n, &bytes[INDICES], &size[INDICES]);
}

static void put_box(hw_bytes_writer *w, const hw_box *box)
{
    const hw_vec3 *corners[2] = {&box->min, &box->max};
    for (int i = 0; i < 2; i++) {
        hw_put_f32(w, corners[i]->x);
        hw_put_f32(w, corners[i]->y);
        hw_put_f32(w, corners[i]->z);
    }
}

static hw_vec3 get_corner(hw_bytes_reader *r)
{
    float x = hw_get_f32(r), y = hw_get_f32(r), z = hw_get_f32(r);
    return hw_v3(x, y, z);
}

hw_status hw_mesh_level_encode(const hw_mesh *mesh, const hw_inner_boxes *boxes, uint8_t **bytes,
                               size_t *size)
{
    hw_status status = HW_OK;
    hw_bytes_writer w = {0};
    uint8_t *streams[STREAM_COUNT] = {NULL};
    size_t sizes[STREAM_COUNT] = {0};
    *bytes = NULL;
    *size = 0;
    HW_GO(encode_streams(mesh, streams, sizes));
    hw_put_u32(&w, (mesh->normals ? HAS_NORMALS : 0) | (mesh->colors ? HAS_COLORS : 0) |
                       (mesh->uvs ? HAS_UVS : 0));
    uint32_t box_count = boxes ? boxes->count : 0;
    hw_put_u32(&w, box_count);
    for (int i = 0; i < STREAM_COUNT; i++)
        hw_put_u64(&w, sizes[i]);
    for (uint32_t i = 0; i < box_count; i++)
        put_box(&w, &boxes->boxes[i]);
    for (int i = 0; i < STREAM_COUNT; i++)
        if (sizes[i])
            hw_put_bytes(&w, streams[i], sizes[i]);
    HW_GO(hw_bytes_writer_check(&w));
    *bytes = w.data;
    *size = w.size;
    w.data = NULL;
out:
    for (int i = 0; i < STREAM_COUNT; i++)
        hw_free(streams[i]);
    hw_bytes_writer_free(&w);
    return status;
}

static hw_status decode_normals(const uint8_t *bytes, size_t size, hw_mesh *out)
{
    void *block = NULL;
    HW_TRY(hw_vertices_decode(bytes, size, out->vertex_count, sizeof(octahedral), &block));
    const octahedral *packed = block;
    hw_status status = HW_NEW(&out->normals, out->vertex_count);
    for (uint32_t i = 0; status == HW_OK && i < out->vertex_count; i++)
        out->normals[i] = hw_octahedral_decode(packed[i].xy);
    hw_free(block);
    return status;
}

static hw_status decode_streams(const uint8_t *const bytes[STREAM_COUNT],
                                const size_t size[STREAM_COUNT], uint32_t flags, hw_mesh *out)
{
    size_t n = out->vertex_count;
    void *block = NULL;
    HW_TRY(hw_vertices_decode(bytes[POSITIONS], size[POSITIONS], n, sizeof(hw_vec3), &block));
    out->positions = block;
    if (flags & HAS_NORMALS)
        HW_TRY(decode_normals(bytes[NORMALS], size[NORMALS], out));
    if (flags & HAS_COLORS) {
        HW_TRY(hw_vertices_decode(bytes[COLORS], size[COLORS], n, sizeof(hw_color8), &block));
        out->colors = block;
    }
    if (flags & HAS_UVS) {
        HW_TRY(hw_vertices_decode(bytes[UVS], size[UVS], n, sizeof(hw_uv), &block));
        out->uvs = block;
    }
    return hw_indices_decode(bytes[INDICES], size[INDICES], out->index_count, n, &out->indices);
}

// The streams' places within the chunk; they fill it.
static hw_status find_streams(hw_bytes_reader *r, uint32_t *flags, hw_inner_boxes *boxes,
                              const uint8_t *bytes[STREAM_COUNT], size_t size[STREAM_COUNT])
{
    static const uint32_t stream_flags[STREAM_COUNT] = {0, HAS_NORMALS, HAS_COLORS, HAS_UVS, 0};
    *flags = hw_get_u32(r);
    uint32_t box_count = hw_get_u32(r);
    bool fine = *flags <= (HAS_NORMALS | HAS_COLORS | HAS_UVS);
    if (box_count > HW_INNER_BOXES_MAX)
        return hw_fail(HW_FORMAT, "%u boxes inside a level, at most %u are possible", box_count,
                       HW_INNER_BOXES_MAX);
    for (int i = 0; i < STREAM_COUNT; i++) {
        size[i] = (size_t)hw_get_u64(r);
        fine = fine && (size[i] == 0 || !stream_flags[i] || (*flags & stream_flags[i]));
    }
    for (uint32_t i = 0; i < box_count; i++) {
        boxes->boxes[i].min = get_corner(r);
        boxes->boxes[i].max = get_corner(r);
    }
    boxes->count = box_count;
    for (int i = 0; i < STREAM_COUNT; i++)
        bytes[i] = hw_get_span(r, size[i]);
    if (!fine || r->failed || hw_bytes_left(r) > 0)
        return hw_fail(HW_FORMAT, "a level's streams do not fill its chunk");
    return HW_OK;
}

static bool is_within(float low, float high, float least, float greatest)
{
    return low >= least && low <= high && high <= greatest; // false for NaN
}

hw_status hw_mesh_boxes_validate(const hw_mesh *mesh, const hw_inner_boxes *boxes)
{
    if (boxes->count > HW_INNER_BOXES_MAX)
        return hw_fail(HW_FORMAT, "%u boxes inside a level, at most %u are possible", boxes->count,
                       HW_INNER_BOXES_MAX);
    if (boxes->count == 0)
        return HW_OK;
    hw_box all = hw_mesh_bounds(mesh); // finite, as positions are
    for (uint32_t i = 0; i < boxes->count; i++) {
        const hw_box *b = &boxes->boxes[i];
        if (!is_within(b->min.x, b->max.x, all.min.x, all.max.x) ||
            !is_within(b->min.y, b->max.y, all.min.y, all.max.y) ||
            !is_within(b->min.z, b->max.z, all.min.z, all.max.z))
            return hw_fail(HW_FORMAT, "box %u is not inside its level", i);
    }
    return HW_OK;
}

hw_status hw_mesh_level_decode(const char *name, const hw_mesh_level_info *info,
                               const uint8_t *bytes, size_t size, hw_mesh *out,
                               hw_inner_boxes *boxes)
{
    hw_status status = HW_OK;
    const uint8_t *streams[STREAM_COUNT];
    size_t sizes[STREAM_COUNT];
    uint32_t flags;
    hw_inner_boxes inside = {0};
    hw_bytes_reader r = hw_bytes_reader_make(bytes, size);
    *out = (hw_mesh){.vertex_count = info->vertex_count, .index_count = info->index_count};
    if (boxes)
        *boxes = (hw_inner_boxes){0};
    HW_GO(find_streams(&r, &flags, &inside, streams, sizes));
    HW_GO(decode_streams(streams, sizes, flags, out));
    HW_GO(hw_mesh_validate(out));
    HW_GO(hw_mesh_boxes_validate(out, &inside));
    if (boxes)
        *boxes = inside;
    return HW_OK;
out:
    hw_mesh_free(out);
    return hw_fail_prefix(status, name);
}

static bool error_is_fine(float error, float before)
{
    return isfinite(error) && error >= before;
}

hw_status hw_mesh_table_validate(const char *name, const hw_mesh_level_info *infos, uint32_t count)
{
    if (count == 0 || count > HW_MESH_LEVELS_MAX)
        return hw_fail(HW_FORMAT, "%s: %u levels, 1 to %u are possible", name, count,
                       HW_MESH_LEVELS_MAX);
    for (uint32_t i = 0; i < count; i++) {
        const hw_mesh_level_info *l = &infos[i];
        if (l->vertex_count > HW_MESH_VERTICES_MAX || l->index_count > HW_MESH_INDICES_MAX ||
            l->vertex_count == 0 || l->index_count == 0 || l->index_count % 3)
            return hw_fail(HW_FORMAT, "%s: level %u: %u vertices and %u indices", name, i,
                           l->vertex_count, l->index_count);
        if (!error_is_fine(l->error_rms, i ? l[-1].error_rms : 0) ||
            !error_is_fine(l->error_p99, i ? l[-1].error_p99 : 0) ||
            !error_is_fine(l->error_silhouette, 0) ||
            !error_is_fine(l->error_shading, i ? l[-1].error_shading : 0) ||
            (i == 0 && (l->error_rms > 0 || l->error_p99 > 0 || l->error_silhouette > 0 ||
                        l->error_shading > 0)))
            return hw_fail(HW_FORMAT, "%s: level %u: errors %g, %g, %g, %g", name, i,
                           (double)l->error_rms, (double)l->error_p99, (double)l->error_silhouette,
                           (double)l->error_shading);
    }
    return HW_OK;
}

hw_status hw_mesh_table_encode(const hw_mesh_level_info *infos, uint32_t count, uint8_t **bytes,
                               size_t *size)
{
    hw_bytes_writer w = {0};
    *bytes = NULL;
    *size = 0;
    hw_put_u32(&w, HW_MESH_VERSION);
    hw_put_u32(&w, count);
    for (uint32_t i = 0; i < count; i++) {
        hw_put_u32(&w, infos[i].vertex_count);
        hw_put_u32(&w, infos[i].index_count);
        hw_put_f32(&w, infos[i].error_rms);
        hw_put_f32(&w, infos[i].error_p99);
        hw_put_f32(&w, infos[i].error_silhouette);
        hw_put_f32(&w, infos[i].error_shading);
    }
    hw_status status = hw_bytes_writer_check(&w);
    if (status != HW_OK) {
        hw_bytes_writer_free(&w);
        return status;
    }
    *bytes = w.data;
    *size = w.size;
    return HW_OK;
}

hw_status hw_mesh_table_decode(const char *name, const uint8_t *bytes, size_t size,
                               hw_mesh_level_info infos[HW_MESH_LEVELS_MAX], uint32_t *count)
{
    hw_bytes_reader r = hw_bytes_reader_make(bytes, size);
    uint32_t version = hw_get_u32(&r);
    *count = hw_get_u32(&r);
    if (r.failed)
        return hw_fail(HW_FORMAT, "%s: chunk LEVS is too short", name);
    if (version != HW_MESH_VERSION)
        return hw_fail(HW_VERSION, "%s: mesh version %u, this program reads %u", name, version,
                       HW_MESH_VERSION);
    if (*count > HW_MESH_LEVELS_MAX ||
        size != TABLE_HEADER_BYTES + (size_t)*count * TABLE_ENTRY_BYTES)
        return hw_fail(HW_FORMAT, "%s: %u levels in a chunk LEVS of %zu bytes", name, *count, size);
    for (uint32_t i = 0; i < *count; i++) {
        infos[i].vertex_count = hw_get_u32(&r);
        infos[i].index_count = hw_get_u32(&r);
        infos[i].error_rms = hw_get_f32(&r);
        infos[i].error_p99 = hw_get_f32(&r);
        infos[i].error_silhouette = hw_get_f32(&r);
        infos[i].error_shading = hw_get_f32(&r);
    }
    return hw_mesh_table_validate(name, infos, *count);
}
