#include "cell_file.h"
#include "alloc.h"
#include "block.h"
#include "cell_chunks.h"
#include "geometry_codec.h"
#include "mesh_file.h"
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

// Bytes of one record in the chunks NEAR, FARS, VIEW and RNGE.
#define NEAR_BYTES  8u
#define FAR_BYTES   92u
#define VIEW_BYTES  48u
#define RANGE_BYTES 8u
#define RANGES_MAX  (1u << HW_FAR_VIEWS_MAX) // of one far record
// Bytes of one 4 x 4 block of BC1.
#define BLOCK_BYTES 8u

static const uint32_t chunk_tags[HW_CELL_CHUNK_COUNT] = {
#define X(name, tag) tag,
    HW_CELL_CHUNK_LIST(X)
#undef X
};

void hw_cell_free(hw_cell *cell)
{
    if (!cell)
        return;
    hw_free(cell->near);
    hw_free(cell->far);
    hw_free(cell->vertices);
    hw_free(cell->indices);
    hw_free(cell->views);
    hw_free(cell->ranges);
    hw_free(cell->colors);
    hw_free(cell->atlas_bc1);
    hw_free(cell->coverage_bc4);
    *cell = (hw_cell){0};
}

void hw_cell_chunks_free(hw_cell_chunks *chunks)
{
    for (int i = 0; i < HW_CELL_CHUNK_COUNT; i++)
        hw_free(chunks->data[i]);
    *chunks = (hw_cell_chunks){0};
}

// ---- validation ----

static hw_status validate_counts(const hw_cell *c, const char *name)
{
    if (c->id.level < 0 || c->id.level >= HW_CELL_LEVELS_MAX)
        return hw_fail(HW_FORMAT, "%s: level %d", name, c->id.level);
    if (!hw_v3_finite(c->centre))
        return hw_fail(HW_FORMAT, "%s: the centre is not finite", name);
    if (c->near_count > HW_CELL_NEAR_MAX || c->far_count > HW_CELL_RECORDS_MAX ||
        c->vertex_count > HW_CELL_VERTICES_MAX || c->index_count > HW_CELL_INDICES_MAX ||
        c->view_count > c->far_count * (HW_FAR_VIEWS_MAX - 1) ||
        c->range_count > c->far_count * RANGES_MAX || c->color_count > c->vertex_count)
        return hw_fail(HW_FORMAT,
                       "%s: too many records, vertices, indices, views, ranges or colours", name);
    if ((c->near_count && !c->near) || (c->far_count && !c->far) ||
        (c->vertex_count && !c->vertices) || (c->index_count && !c->indices) ||
        (c->view_count && !c->views) || (c->range_count && !c->ranges) ||
        (c->color_count && !c->colors))
        return hw_fail(HW_FORMAT, "%s: an array is missing", name);
    if (c->atlas_width > HW_CELL_ATLAS_MAX || c->atlas_height > HW_CELL_ATLAS_MAX ||
        c->atlas_width % 4 || c->atlas_height % 4)
        return hw_fail(HW_FORMAT, "%s: an atlas of %u x %u", name, c->atlas_width, c->atlas_height);
    bool has_far = c->far_count > 0;
    bool has_atlas = c->atlas_width > 0 && c->atlas_height > 0;
    if (has_far != has_atlas || (!has_far && (c->atlas_width || c->atlas_height)) ||
        (has_atlas && (!c->atlas_bc1 || !c->coverage_bc4)))
        return hw_fail(HW_FORMAT, "%s: %u far objects with an atlas of %u x %u", name, c->far_count,
                       c->atlas_width, c->atlas_height);
    return HW_OK;
}

// False for NaN as well.
static bool is_range(float min, float max)
{
    return isfinite(min) && isfinite(max) && min < max;
}

static bool is_in_atlas(const hw_cell *c, const hw_rect *rect)
{
    return rect->width > 0 && rect->height > 0 &&
           (uint64_t)rect->x + rect->width <= c->atlas_width &&
           (uint64_t)rect->y + rect->height <= c->atlas_height;
}

static hw_status validate_far_place(const hw_cell *c, uint32_t index, const char *name)
{
    const hw_far_record *f = &c->far[index];
    if (f->face > 5)
        return hw_fail(HW_FORMAT, "%s: far object %u: face %u", name, index, f->face);
    if (!is_range(f->x_min, f->x_max) || !is_range(f->y_min, f->y_max) ||
        !is_range(f->iz_min, f->iz_max) || f->iz_min <= 0)
        return hw_fail(HW_FORMAT, "%s: far object %u: an image-space range is empty or not finite",
                       name, index);
    if (!hw_v3_finite(f->bounds.min) || !hw_v3_finite(f->bounds.max) ||
        f->bounds.min.x > f->bounds.max.x || f->bounds.min.y > f->bounds.max.y ||
        f->bounds.min.z > f->bounds.max.z)
        return hw_fail(HW_FORMAT, "%s: far object %u: bounds are empty or not finite", name, index);
    if (!is_in_atlas(c, &f->rect))
        return hw_fail(HW_FORMAT, "%s: far object %u: its texture lies outside of the atlas", name,
                       index);
    return HW_OK;
}

// Vertices and indices of one record; its ranges begin where the one before ended.
static hw_status validate_far_mesh(const hw_cell *c, uint32_t index, uint32_t first_vertex,
                                   uint32_t first_index, const char *name)
{
    const hw_far_record *f = &c->far[index];
    if (f->first_vertex != first_vertex || f->vertex_count > c->vertex_count - first_vertex ||
        f->first_index != first_index || f->index_count > c->index_count - first_index ||
        f->index_count % 3)
        return hw_fail(HW_FORMAT, "%s: far object %u: vertices or indices out of place", name,
                       index);
    for (uint32_t i = 0; i < f->vertex_count; i++)
        if (c->vertices[first_vertex + i].record != index)
            return hw_fail(HW_FORMAT, "%s: vertex %u belongs to far object %u, not %u", name,
                           first_vertex + i, c->vertices[first_vertex + i].record, index);
    for (uint32_t i = 0; i < f->index_count; i++) {
        uint32_t vertex = c->indices[first_index + i];
        if (vertex < first_vertex || vertex - first_vertex >= f->vertex_count)
            return hw_fail(HW_FORMAT, "%s: index %u leaves far object %u", name, first_index + i,
                           index);
    }
    return HW_OK;
}

static hw_status validate_view(const hw_cell *c, uint32_t index, const hw_far_view *v,
                               const char *name)
{
    if (v->face > 5 || !hw_v3_finite(v->eye) || !is_range(v->x_min, v->x_max) ||
        !is_range(v->y_min, v->y_max) || !is_in_atlas(c, &v->rect))
        return hw_fail(HW_FORMAT, "%s: far object %u: a view from nowhere or of nothing", name,
                       index);
    return HW_OK;
}

// Views and ranges of one record; they begin where those of the one before ended.
static hw_status validate_far_views(const hw_cell *c, uint32_t index, uint32_t first_view,
                                    uint32_t first_range, const char *name)
{
    const hw_far_record *f = &c->far[index];
    if (f->first_view != first_view || f->view_count >= HW_FAR_VIEWS_MAX ||
        f->view_count > c->view_count - first_view || f->first_range != first_range ||
        f->range_count > RANGES_MAX || f->range_count > c->range_count - first_range ||
        (f->view_count && !f->range_count) || (f->cut_out && f->range_count))
        return hw_fail(HW_FORMAT, "%s: far object %u: views or ranges out of place", name, index);
    for (uint32_t i = 0; i < f->view_count; i++)
        HW_TRY(validate_view(c, index, &c->views[first_view + i], name));
    uint64_t indices = 0;
    for (uint32_t i = 0; i < f->range_count; i++) {
        const hw_far_range *range = &c->ranges[first_range + i];
        indices += range->index_count;
        if (range->index_count % 3 || range->views >> (f->view_count + 1))
            return hw_fail(HW_FORMAT, "%s: far object %u: range %u is broken", name, index, i);
        if (!range->views && f->first_vertex + f->vertex_count > c->color_count)
            return hw_fail(HW_FORMAT, "%s: far object %u: colours are missing", name, index);
    }
    if (f->range_count && indices != f->index_count)
        return hw_fail(HW_FORMAT, "%s: far object %u: ranges of %llu indices for %u", name, index,
                       (unsigned long long)indices, f->index_count);
    return HW_OK;
}

hw_status hw_cell_validate(const hw_cell *cell, const char *name)
{
    HW_TRY(validate_counts(cell, name));
    if (cell->id.level > 0 && cell->near_count > 0)
        return hw_fail(HW_FORMAT, "%s: near objects at level %d", name, cell->id.level);
    for (uint32_t i = 0; i < cell->near_count; i++)
        if (cell->near[i].level >= HW_MESH_LEVELS_MAX)
            return hw_fail(HW_FORMAT, "%s: near object %u: level %u", name, i, cell->near[i].level);
    for (uint32_t i = 1; i < cell->near_count; i++)
        if (cell->near[i].object_idx <= cell->near[i - 1].object_idx)
            return hw_fail(HW_FORMAT, "%s: near object %u is out of order", name, i);
    uint32_t first_vertex = 0, first_index = 0, first_view = 0, first_range = 0;
    for (uint32_t i = 0; i < cell->far_count; i++) {
        HW_TRY(validate_far_place(cell, i, name));
        HW_TRY(validate_far_mesh(cell, i, first_vertex, first_index, name));
        HW_TRY(validate_far_views(cell, i, first_view, first_range, name));
        first_vertex += cell->far[i].vertex_count;
        first_index += cell->far[i].index_count;
        first_view += cell->far[i].view_count;
        first_range += cell->far[i].range_count;
    }
    if (first_vertex != cell->vertex_count || first_index != cell->index_count)
        return hw_fail(HW_FORMAT, "%s: %u vertices and %u indices belong to no far object", name,
                       cell->vertex_count - first_vertex, cell->index_count - first_index);
    if (first_view != cell->view_count || first_range != cell->range_count)
        return hw_fail(HW_FORMAT, "%s: %u views and %u ranges belong to no far object", name,
                       cell->view_count - first_view, cell->range_count - first_range);
    return HW_OK;
}

// ---- writing ----

static void put_vec3(hw_bytes_writer *w, hw_vec3 v)
{
    hw_put_f32(w, v.x);
    hw_put_f32(w, v.y);
    hw_put_f32(w, v.z);
}

static void put_info(hw_bytes_writer *w, const hw_cell *c)
{
    hw_put_u32(w, HW_CELL_VERSION);
    hw_put_i32(w, c->id.level);
    hw_put_i32(w, c->id.q);
    hw_put_i32(w, c->id.r);
    put_vec3(w, c->centre);
    hw_put_u32(w, c->near_count);
    hw_put_u32(w, c->far_count);
    hw_put_u32(w, c->vertex_count);
    hw_put_u32(w, c->index_count);
    hw_put_u32(w, c->atlas_width);
    hw_put_u32(w, c->atlas_height);
    hw_put_u32(w, c->view_count);
    hw_put_u32(w, c->range_count);
    hw_put_u32(w, c->color_count);
}

static void put_near(hw_bytes_writer *w, const hw_cell *c)
{
    for (uint32_t i = 0; i < c->near_count; i++) {
        hw_put_u32(w, c->near[i].object_idx);
        hw_put_u32(w, c->near[i].level);
    }
}

// How many low bits are 0 in all of a record's x, y and z: a builder that rounds to what a pixel
// can show leaves some. Without them the vertex codec gains a quarter and more.
typedef struct shifts {
    uint8_t x, y, z;
} shifts;

static uint8_t zero_bits(uint32_t all)
{
    return (uint8_t)(all ? __builtin_ctz(all) : 0);
}

static shifts find_shifts(const hw_cell *c, const hw_far_record *f)
{
    uint32_t x = 0, y = 0, z = 0;
    for (uint32_t i = 0; i < f->vertex_count; i++) {
        const hw_far_vertex *v = &c->vertices[f->first_vertex + i];
        x |= v->x;
        y |= v->y;
        z |= v->z;
    }
    return (shifts){zero_bits(x), zero_bits(y), zero_bits(z)};
}

static void put_rect(hw_bytes_writer *w, const hw_rect *rect)
{
    hw_put_u32(w, rect->x);
    hw_put_u32(w, rect->y);
    hw_put_u32(w, rect->width);
    hw_put_u32(w, rect->height);
}

static void put_views(hw_bytes_writer *w, const hw_cell *c)
{
    for (uint32_t i = 0; i < c->view_count; i++) {
        const hw_far_view *v = &c->views[i];
        put_vec3(w, v->eye);
        hw_put_u32(w, v->face);
        hw_put_f32(w, v->x_min);
        hw_put_f32(w, v->x_max);
        hw_put_f32(w, v->y_min);
        hw_put_f32(w, v->y_max);
        put_rect(w, &v->rect);
    }
}

static void put_ranges(hw_bytes_writer *w, const hw_cell *c)
{
    for (uint32_t i = 0; i < c->range_count; i++) {
        hw_put_u32(w, c->ranges[i].views);
        hw_put_u32(w, c->ranges[i].index_count);
    }
}

// What a record begins with (its first vertex, index, view and range) is the sum of the counts
// before it: not stored.
static void put_far(hw_bytes_writer *w, const hw_far_record *f, shifts s)
{
    hw_put_u32(w, f->object_idx);
    hw_put_u16(w, (uint16_t)f->face);
    hw_put_u16(w, f->cut_out);
    hw_put_f32(w, f->x_min);
    hw_put_f32(w, f->x_max);
    hw_put_f32(w, f->y_min);
    hw_put_f32(w, f->y_max);
    hw_put_f32(w, f->iz_min);
    hw_put_f32(w, f->iz_max);
    put_vec3(w, f->bounds.min);
    put_vec3(w, f->bounds.max);
    put_rect(w, &f->rect);
    hw_put_u32(w, f->vertex_count);
    hw_put_u32(w, f->index_count);
    hw_put_u32(w, f->view_count);
    hw_put_u32(w, f->range_count);
    hw_put_u8(w, s.x);
    hw_put_u8(w, s.y);
    hw_put_u8(w, s.z);
    hw_put_u8(w, 0);
}

// All far records, and the vertices without the low bits that these name.
static hw_status put_fars(hw_bytes_writer *w, const hw_cell *c, hw_far_vertex **packed)
{
    HW_TRY(HW_NEW(packed, c->vertex_count));
    for (uint32_t i = 0; i < c->far_count; i++) {
        const hw_far_record *f = &c->far[i];
        shifts s = find_shifts(c, f);
        put_far(w, f, s);
        for (uint32_t k = f->first_vertex; k < f->first_vertex + f->vertex_count; k++) {
            const hw_far_vertex *v = &c->vertices[k];
            (*packed)[k] = (hw_far_vertex){(uint16_t)(v->x >> s.x), (uint16_t)(v->y >> s.y),
                                           (uint16_t)(v->z >> s.z), v->record};
        }
    }
    return HW_OK;
}

// A block is two 16-bit colours and 32 bits of selectors. The atlas is stored as all first colours,
// all second ones, then all selectors: apart they compress better by some hundredths.
static hw_status split_atlas(const uint8_t *blocks, size_t size, uint8_t **out)
{
    size_t count = size / BLOCK_BYTES;
    HW_TRY(HW_NEW(out, size));
    for (size_t i = 0; i < count; i++) {
        const uint8_t *block = blocks + BLOCK_BYTES * i;
        memcpy(*out + 2 * i, block, 2);
        memcpy(*out + 2 * (count + i), block + 2, 2);
        memcpy(*out + 4 * (count + i), block + 4, 4);
    }
    return HW_OK;
}

static hw_status join_atlas(const uint8_t *split, size_t size, uint8_t **out)
{
    size_t count = size / BLOCK_BYTES;
    HW_TRY(HW_NEW(out, size));
    for (size_t i = 0; i < count; i++) {
        uint8_t *block = *out + BLOCK_BYTES * i;
        memcpy(block, split + 2 * i, 2);
        memcpy(block + 2, split + 2 * (count + i), 2);
        memcpy(block + 4, split + 4 * (count + i), 4);
    }
    return HW_OK;
}

// A block of coverage is two values and 48 bits of selectors, which are kept apart too.
static hw_status split_coverage(const uint8_t *blocks, size_t size, uint8_t **out)
{
    size_t count = size / BLOCK_BYTES;
    HW_TRY(HW_NEW(out, size));
    for (size_t i = 0; i < count; i++) {
        memcpy(*out + 2 * i, blocks + BLOCK_BYTES * i, 2);
        memcpy(*out + 2 * count + 6 * i, blocks + BLOCK_BYTES * i + 2, 6);
    }
    return HW_OK;
}

static hw_status join_coverage(const uint8_t *split, size_t size, uint8_t **out)
{
    size_t count = size / BLOCK_BYTES;
    HW_TRY(HW_NEW(out, size));
    for (size_t i = 0; i < count; i++) {
        memcpy(*out + BLOCK_BYTES * i, split + 2 * i, 2);
        memcpy(*out + BLOCK_BYTES * i + 2, split + 2 * count + 6 * i, 6);
    }
    return HW_OK;
}

static size_t atlas_bytes(const hw_cell *c)
{
    return c->atlas_width ? hw_bc1_bytes(c->atlas_width, c->atlas_height) : 0;
}

static hw_status take(hw_bytes_writer *w, hw_cell_chunks *out, int chunk)
{
    HW_TRY(hw_bytes_writer_check(w));
    out->data[chunk] = w->data;
    out->size[chunk] = w->size;
    *w = (hw_bytes_writer){0};
    return HW_OK;
}

hw_status hw_cell_to_chunks(const hw_cell *cell, hw_cell_chunks *out)
{
    hw_status status = HW_OK;
    hw_bytes_writer w = {0};
    hw_far_vertex *packed = NULL;
    uint8_t **data = out->data;
    put_info(&w, cell);
    HW_GO(take(&w, out, HW_CELL_CHUNK_INFO));
    put_near(&w, cell);
    HW_GO(take(&w, out, HW_CELL_CHUNK_NEAR));
    HW_GO(put_fars(&w, cell, &packed));
    HW_GO(take(&w, out, HW_CELL_CHUNK_FARS));
    HW_GO(hw_vertices_encode(packed, cell->vertex_count, sizeof *packed, &data[HW_CELL_CHUNK_VERT],
                             &out->size[HW_CELL_CHUNK_VERT]));
    HW_GO(hw_indices_encode(cell->indices, cell->index_count, cell->vertex_count,
                            &data[HW_CELL_CHUNK_INDX], &out->size[HW_CELL_CHUNK_INDX]));
    put_views(&w, cell);
    HW_GO(take(&w, out, HW_CELL_CHUNK_VIEW));
    put_ranges(&w, cell);
    HW_GO(take(&w, out, HW_CELL_CHUNK_RNGE));
    HW_GO(hw_vertices_encode(cell->colors, cell->color_count, sizeof *cell->colors,
                             &data[HW_CELL_CHUNK_COLR], &out->size[HW_CELL_CHUNK_COLR]));
    HW_GO(split_atlas(cell->atlas_bc1, atlas_bytes(cell), &data[HW_CELL_CHUNK_ATLS]));
    out->size[HW_CELL_CHUNK_ATLS] = atlas_bytes(cell);
    HW_GO(split_coverage(cell->coverage_bc4, atlas_bytes(cell), &data[HW_CELL_CHUNK_COVR]));
    out->size[HW_CELL_CHUNK_COVR] = atlas_bytes(cell);
out:
    hw_bytes_writer_free(&w);
    hw_free(packed);
    if (status != HW_OK)
        hw_cell_chunks_free(out);
    return status;
}

hw_status hw_cell_write(const hw_cell *cell, const char *path)
{
    hw_cell_chunks chunks = {0};
    HW_TRY(hw_cell_validate(cell, path));
    hw_status status = hw_cell_to_chunks(cell, &chunks);
    if (status != HW_OK)
        return hw_fail_prefix(status, path);
    hw_chunk list[HW_CELL_CHUNK_COUNT];
    for (int i = 0; i < HW_CELL_CHUNK_COUNT; i++)
        list[i] = (hw_chunk){chunk_tags[i], 0, chunks.data[i], chunks.size[i]};
    status = hw_container_write(path, HW_CELL_MAGIC, cell->key, list, HW_CELL_CHUNK_COUNT);
    hw_cell_chunks_free(&chunks);
    return status;
}

// ---- reading ----

static hw_vec3 get_vec3(hw_bytes_reader *r)
{
    float x = hw_get_f32(r), y = hw_get_f32(r), z = hw_get_f32(r);
    return hw_v3(x, y, z);
}

static hw_bytes_reader read_info(const hw_cell_chunks *chunks)
{
    return hw_bytes_reader_make(chunks->data[HW_CELL_CHUNK_INFO], chunks->size[HW_CELL_CHUNK_INFO]);
}

static hw_status check_version(const char *name, const hw_cell_chunks *chunks)
{
    hw_bytes_reader r = read_info(chunks);
    uint32_t version = hw_get_u32(&r);
    if (!r.failed && version != HW_CELL_VERSION)
        return hw_fail(HW_VERSION, "%s: cell version %u, this program reads %u", name, version,
                       HW_CELL_VERSION);
    return HW_OK;
}

static hw_status get_info(const char *name, const hw_cell_chunks *chunks, hw_cell *c)
{
    HW_TRY(check_version(name, chunks));
    hw_bytes_reader r = read_info(chunks);
    (void)hw_get_u32(&r); // the version
    c->id.level = hw_get_i32(&r);
    c->id.q = hw_get_i32(&r);
    c->id.r = hw_get_i32(&r);
    c->centre = get_vec3(&r);
    c->near_count = hw_get_u32(&r);
    c->far_count = hw_get_u32(&r);
    c->vertex_count = hw_get_u32(&r);
    c->index_count = hw_get_u32(&r);
    c->atlas_width = hw_get_u32(&r);
    c->atlas_height = hw_get_u32(&r);
    c->view_count = hw_get_u32(&r);
    c->range_count = hw_get_u32(&r);
    c->color_count = hw_get_u32(&r);
    if (r.failed || hw_bytes_left(&r) > 0)
        return hw_fail(HW_FORMAT, "%s: chunk INFO has a wrong size", name);
    return HW_OK;
}

// Counts against the sizes of the chunks, before anything is allocated from them.
static hw_status check_sizes(const char *name, const hw_cell_chunks *chunks, const hw_cell *c)
{
    if (c->near_count > HW_CELL_NEAR_MAX || c->far_count > HW_CELL_RECORDS_MAX ||
        c->vertex_count > HW_CELL_VERTICES_MAX || c->index_count > HW_CELL_INDICES_MAX ||
        c->atlas_width > HW_CELL_ATLAS_MAX || c->atlas_height > HW_CELL_ATLAS_MAX)
        return hw_fail(HW_FORMAT, "%s: a count is too large", name);
    size_t blocks = (size_t)(c->atlas_width / 4) * (c->atlas_height / 4);
    if (chunks->size[HW_CELL_CHUNK_NEAR] != (size_t)c->near_count * NEAR_BYTES ||
        chunks->size[HW_CELL_CHUNK_FARS] != (size_t)c->far_count * FAR_BYTES ||
        chunks->size[HW_CELL_CHUNK_VIEW] != (size_t)c->view_count * VIEW_BYTES ||
        chunks->size[HW_CELL_CHUNK_RNGE] != (size_t)c->range_count * RANGE_BYTES ||
        chunks->size[HW_CELL_CHUNK_ATLS] != blocks * BLOCK_BYTES ||
        chunks->size[HW_CELL_CHUNK_COVR] != blocks * BLOCK_BYTES)
        return hw_fail(HW_FORMAT, "%s: counts and sizes of chunks disagree", name);
    return HW_OK;
}

static hw_rect get_rect(hw_bytes_reader *r)
{
    uint32_t x = hw_get_u32(r), y = hw_get_u32(r), width = hw_get_u32(r), height = hw_get_u32(r);
    return (hw_rect){x, y, width, height};
}

// Returns the flags, of which only 0 and 1 are known.
static uint16_t get_far(hw_bytes_reader *r, hw_far_record *f)
{
    f->object_idx = hw_get_u32(r);
    f->face = hw_get_u16(r);
    uint16_t flags = hw_get_u16(r);
    f->cut_out = flags == 1;
    f->x_min = hw_get_f32(r);
    f->x_max = hw_get_f32(r);
    f->y_min = hw_get_f32(r);
    f->y_max = hw_get_f32(r);
    f->iz_min = hw_get_f32(r);
    f->iz_max = hw_get_f32(r);
    f->bounds.min = get_vec3(r);
    f->bounds.max = get_vec3(r);
    f->rect = get_rect(r);
    f->vertex_count = hw_get_u32(r);
    f->index_count = hw_get_u32(r);
    f->view_count = hw_get_u32(r);
    f->range_count = hw_get_u32(r);
    (void)hw_get_u32(r); // shifts: see put_back_low_bits
    return flags;
}

static hw_status get_records(const char *name, const hw_cell_chunks *chunks, hw_cell *c)
{
    HW_TRY(HW_NEW(&c->near, c->near_count));
    HW_TRY(HW_NEW(&c->far, c->far_count));
    hw_bytes_reader r =
        hw_bytes_reader_make(chunks->data[HW_CELL_CHUNK_NEAR], chunks->size[HW_CELL_CHUNK_NEAR]);
    for (uint32_t i = 0; i < c->near_count; i++) {
        c->near[i].object_idx = hw_get_u32(&r);
        c->near[i].level = hw_get_u32(&r);
    }
    r = hw_bytes_reader_make(chunks->data[HW_CELL_CHUNK_FARS], chunks->size[HW_CELL_CHUNK_FARS]);
    // May wrap: validation then stops at the record.
    uint32_t first_vertex = 0, first_index = 0, first_view = 0, first_range = 0;
    for (uint32_t i = 0; i < c->far_count; i++) {
        uint16_t flags = get_far(&r, &c->far[i]);
        if (flags > 1)
            return hw_fail(HW_FORMAT, "%s: far object %u: unknown flags %u", name, i, flags);
        c->far[i].first_vertex = first_vertex;
        c->far[i].first_index = first_index;
        c->far[i].first_view = first_view;
        c->far[i].first_range = first_range;
        first_vertex += c->far[i].vertex_count;
        first_index += c->far[i].index_count;
        first_view += c->far[i].view_count;
        first_range += c->far[i].range_count;
    }
    return HW_OK;
}

static hw_status get_views(const hw_cell_chunks *chunks, hw_cell *c)
{
    HW_TRY(HW_NEW(&c->views, c->view_count));
    HW_TRY(HW_NEW(&c->ranges, c->range_count));
    hw_bytes_reader r =
        hw_bytes_reader_make(chunks->data[HW_CELL_CHUNK_VIEW], chunks->size[HW_CELL_CHUNK_VIEW]);
    for (uint32_t i = 0; i < c->view_count; i++) {
        hw_far_view *v = &c->views[i];
        v->eye = get_vec3(&r);
        v->face = hw_get_u32(&r);
        v->x_min = hw_get_f32(&r);
        v->x_max = hw_get_f32(&r);
        v->y_min = hw_get_f32(&r);
        v->y_max = hw_get_f32(&r);
        v->rect = get_rect(&r);
    }
    r = hw_bytes_reader_make(chunks->data[HW_CELL_CHUNK_RNGE], chunks->size[HW_CELL_CHUNK_RNGE]);
    for (uint32_t i = 0; i < c->range_count; i++) {
        c->ranges[i].views = hw_get_u32(&r);
        c->ranges[i].index_count = hw_get_u32(&r);
    }
    return HW_OK;
}

static hw_status get_geometry(const char *name, const hw_cell_chunks *chunks, hw_cell *c)
{
    void *vertices = NULL, *colors = NULL;
    hw_status status =
        hw_vertices_decode(chunks->data[HW_CELL_CHUNK_VERT], chunks->size[HW_CELL_CHUNK_VERT],
                           c->vertex_count, sizeof *c->vertices, &vertices);
    c->vertices = vertices;
    if (status == HW_OK)
        status =
            hw_indices_decode(chunks->data[HW_CELL_CHUNK_INDX], chunks->size[HW_CELL_CHUNK_INDX],
                              c->index_count, c->vertex_count, &c->indices);
    if (status == HW_OK)
        status =
            hw_vertices_decode(chunks->data[HW_CELL_CHUNK_COLR], chunks->size[HW_CELL_CHUNK_COLR],
                               c->color_count, sizeof *c->colors, &colors);
    c->colors = colors;
    return status == HW_OK ? HW_OK : hw_fail_prefix(status, name);
}

static bool put_back(uint16_t *value, uint32_t shift)
{
    uint32_t wide = (uint32_t)*value << shift;
    *value = (uint16_t)wide;
    return wide <= UINT16_MAX;
}

// The zeros below the vertices' coordinates. The cell is valid but for those.
static hw_status put_back_low_bits(const char *name, const hw_cell_chunks *chunks, hw_cell *c)
{
    for (uint32_t i = 0; i < c->far_count; i++) {
        const uint8_t *s =
            chunks->data[HW_CELL_CHUNK_FARS] + (size_t)FAR_BYTES * (i + 1) - 4; // x, y, z, 0
        bool fine = s[0] < 16 && s[1] < 16 && s[2] < 16 && s[3] == 0;
        for (uint32_t k = 0; fine && k < c->far[i].vertex_count; k++) {
            hw_far_vertex *v = &c->vertices[c->far[i].first_vertex + k];
            fine = put_back(&v->x, s[0]) && put_back(&v->y, s[1]) && put_back(&v->z, s[2]);
        }
        if (!fine)
            return hw_fail(HW_FORMAT, "%s: far object %u: vertices leave 16 bits", name, i);
    }
    return HW_OK;
}

hw_status hw_cell_from_chunks(const char *name, uint64_t key, const hw_cell_chunks *chunks,
                              hw_cell *out)
{
    hw_status status = HW_OK;
    *out = (hw_cell){.key = key};
    HW_GO(get_info(name, chunks, out));
    HW_GO(check_sizes(name, chunks, out));
    HW_GO(get_records(name, chunks, out));
    HW_GO(get_views(chunks, out));
    HW_GO(get_geometry(name, chunks, out));
    if (out->atlas_width) {
        HW_GO(join_atlas(chunks->data[HW_CELL_CHUNK_ATLS], chunks->size[HW_CELL_CHUNK_ATLS],
                         &out->atlas_bc1));
        HW_GO(join_coverage(chunks->data[HW_CELL_CHUNK_COVR], chunks->size[HW_CELL_CHUNK_COVR],
                            &out->coverage_bc4));
    }
    HW_GO(hw_cell_validate(out, name));
    HW_GO(put_back_low_bits(name, chunks, out));
out:
    if (status != HW_OK)
        hw_cell_free(out);
    return status;
}

static hw_status read_container(const char *name, const hw_container *container, hw_cell *out)
{
    hw_status status = HW_OK;
    hw_cell_chunks chunks = {0};
    for (int i = 0; i < HW_CELL_CHUNK_COUNT; i++) {
        status = hw_container_chunk(container, chunk_tags[i], 0, &chunks.data[i], &chunks.size[i]);
        // A missing chunk is a damaged file, not a missing one.
        if (status == HW_NOT_FOUND)
            status = HW_FORMAT;
        HW_GO(status);
        // Other versions have other chunks.
        if (i == HW_CELL_CHUNK_INFO)
            HW_GO(check_version(name, &chunks));
    }
    if (hw_container_chunk_count(container) != HW_CELL_CHUNK_COUNT) {
        status = hw_fail(HW_FORMAT, "%s: unknown chunks", name);
        goto out;
    }
    status = hw_cell_from_chunks(name, hw_container_key(container), &chunks, out);
out:
    hw_cell_chunks_free(&chunks);
    return status;
}

hw_status hw_cell_read(const char *path, hw_cell *out)
{
    hw_container *container = NULL;
    *out = (hw_cell){0};
    HW_TRY(hw_container_open(&container, path, HW_CELL_MAGIC));
    hw_status status = read_container(path, container, out);
    hw_container_close(container);
    return status;
}

hw_status hw_cell_read_counts(const char *path, hw_cell *out)
{
    hw_container *container = NULL;
    hw_cell_chunks chunks = {0};
    *out = (hw_cell){0};
    HW_TRY(hw_container_open(&container, path, HW_CELL_MAGIC));
    hw_status status =
        hw_container_chunk(container, chunk_tags[HW_CELL_CHUNK_INFO], 0,
                           &chunks.data[HW_CELL_CHUNK_INFO], &chunks.size[HW_CELL_CHUNK_INFO]);
    if (status == HW_NOT_FOUND)
        status = HW_FORMAT;
    out->key = hw_container_key(container);
    if (status == HW_OK)
        status = get_info(path, &chunks, out);
    if (status != HW_OK)
        *out = (hw_cell){0};
    hw_cell_chunks_free(&chunks);
    hw_container_close(container);
    return status;
}

hw_status hw_cell_decode(const char *name, const void *bytes, size_t size, hw_cell *out)
{
    hw_container *container = NULL;
    *out = (hw_cell){0};
    HW_TRY(hw_container_open_memory(&container, name, bytes, size, HW_CELL_MAGIC));
    hw_status status = read_container(name, container, out);
    hw_container_close(container);
    return status;
}

bool hw_cell_is_current(const char *path, uint64_t key)
{
    hw_container *container = NULL;
    hw_cell cell = {0};
    if (hw_container_open(&container, path, HW_CELL_MAGIC) != HW_OK)
        return false;
    bool current =
        hw_container_key(container) == key && read_container(path, container, &cell) == HW_OK;
    hw_cell_free(&cell);
    hw_container_close(container);
    return current;
}

void hw_cell_name(char out[HW_FILE_NAME_BYTES], hw_cell_id id)
{
    snprintf(out, HW_FILE_NAME_BYTES, "cells/%" PRId32 "/%" PRId32 "_%" PRId32 ".hxc", id.level,
             id.q, id.r);
}

hw_status hw_cell_path(char **out, const char *dataset, hw_cell_id id)
{
    char name[HW_FILE_NAME_BYTES];
    hw_cell_name(name, id);
    return hw_path_join(out, dataset, name);
}

hw_mat4 hw_far_record_matrix(const hw_far_record *record, hw_vec3 centre)
{
    // World = C + (a + wx r + wy u) / iz. Times iz, with wx, wy, iz affine in x, y, z: the columns
    // below.
    hw_vec3 axis, right, up;
    hw_face_basis((int)record->face, &axis, &right, &up);
    const double c[3] = {centre.x, centre.y, centre.z};
    const double a[3] = {axis.x, axis.y, axis.z};
    const double r[3] = {right.x, right.y, right.z};
    const double u[3] = {up.x, up.y, up.z};
    double dx = ((double)record->x_max - record->x_min) / 65535;
    double dy = ((double)record->y_max - record->y_min) / 65535;
    double dz = ((double)record->iz_max - record->iz_min) / 65535;
    hw_mat4 m = {{0}};
    for (int i = 0; i < 3; i++) {
        m.m[i] = dx * r[i];
        m.m[4 + i] = dy * u[i];
        m.m[8 + i] = dz * c[i];
        m.m[12 + i] = record->iz_min * c[i] + a[i] + record->x_min * r[i] + record->y_min * u[i];
    }
    m.m[11] = dz;
    m.m[15] = record->iz_min;
    return m;
}

hw_mat4 hw_far_view_matrix(const hw_far_record *record, hw_vec3 centre, const hw_far_view *view)
{
    const hw_rect *rect = view ? &view->rect : &record->rect;
    hw_mat4 out = {{0}};
    if (!view) {
        out.m[0] = rect->width / 65535.0;
        out.m[5] = rect->height / 65535.0;
        out.m[12] = rect->x;
        out.m[13] = rect->y;
        out.m[15] = 1;
        return out;
    }
    hw_vec3 axis, right, up;
    hw_mat4 world = hw_far_record_matrix(record, centre);
    hw_face_basis((int)view->face, &axis, &right, &up);
    const double e[3] = {view->eye.x, view->eye.y, view->eye.z};
    const double a[3] = {axis.x, axis.y, axis.z};
    const double r[3] = {right.x, right.y, right.z};
    const double u[3] = {up.x, up.y, up.z};
    double scale_x = rect->width / ((double)view->x_max - view->x_min);
    double scale_y = rect->height / ((double)view->y_max - view->y_min);
    for (int k = 0; k < 4; k++) {
        double depth = 0, x = 0, y = 0; // of column k, seen from the eye
        for (int i = 0; i < 3; i++) {
            double rel = world.m[4 * k + i] - e[i] * world.m[4 * k + 3];
            depth += a[i] * rel;
            x += r[i] * rel;
            y += u[i] * rel;
        }
        out.m[4 * k] = (x - view->x_min * depth) * scale_x + rect->x * depth;
        out.m[4 * k + 1] = (y - view->y_min * depth) * scale_y + rect->y * depth;
        out.m[4 * k + 3] = depth;
    }
    return out;
}
