// The reading side of progressive_codec.h. A record is accepted if it can be applied to the mesh
// that those before it have made; the lists that moves need (progressive_internal.h) are gathered
// after each batch.
#include "progressive_codec.h"
#include "progressive_internal.h"
#include <assert.h>
#include <string.h>

#define HEAD_BYTES    72u
#define BLOCK_BYTES   8u
#define FLAG_LOSSLESS 1u
#define FLAG_ORDER    2u
#define FLAG_COMPLETE 4u

// --- Head ----------------------------------------------------------------------------------------

static hw_status check_head_counts(const hw_progressive_head *head)
{
    const hw_progressive_info *info = &head->info;
    uint64_t vertices =
        (uint64_t)info->base_vertex_count + info->record_count + info->loose_vertex_count;
    uint64_t faces = (uint64_t)info->base_face_count + info->loose_face_count;
    bool loose = info->copy_count || info->loose_vertex_count || info->loose_face_count;
    if (vertices > HW_PROGRESSIVE_VERTICES_MAX || faces > HW_PROGRESSIVE_FACES_MAX ||
        info->copy_count > vertices || (!info->complete && (loose || info->keep_order)))
        return hw_fail(HW_FORMAT, "the counts of chunk HEAD contradict each other");
    return HW_OK;
}

static hw_status get_batches(hw_progressive_head *head, hw_bytes_reader *r)
{
    uint64_t sum = 0;
    HW_TRY(HW_NEW(&head->batches, head->info.batch_count));
    for (uint32_t i = 0; i < head->info.batch_count; i++) {
        head->batches[i] = hw_get_u32(r);
        sum += head->batches[i];
        if (head->batches[i] == 0)
            return hw_fail(HW_FORMAT, "batch %u is empty", i);
    }
    if (head->info.batch_count && sum != head->info.record_count)
        return hw_fail(HW_FORMAT, "the batches do not hold all records");
    return HW_OK;
}

// Blocks follow each other, end where batches end, and have one or two faces a record.
static hw_status get_blocks(hw_progressive_head *head, hw_bytes_reader *r)
{
    uint64_t records = 0, ends = 0, faces = head->info.base_face_count;
    uint32_t batch = 0;
    for (uint32_t i = 0; i < head->block_count; i++) {
        uint32_t n = hw_get_u32(r), f = hw_get_u32(r);
        head->blocks[i] = (hw_progressive_block){(uint32_t)records, n, f, 0};
        records += n;
        faces += f;
        while (batch < head->info.batch_count && ends < records)
            ends += head->batches[batch++];
        if (n == 0 || records > head->info.record_count || f < n || f > 2 * (uint64_t)n ||
            (head->info.batch_count && ends != records))
            return hw_fail(HW_FORMAT, "block %u holds %u records and %u faces", i, n, f);
    }
    if (records != head->info.record_count ||
        faces + head->info.loose_face_count > HW_PROGRESSIVE_FACES_MAX)
        return hw_fail(HW_FORMAT, "the blocks do not hold all records");
    return HW_OK;
}

static hw_status get_head(hw_bytes_reader *r, hw_progressive_head *head)
{
    hw_progressive_info *info = &head->info;
    uint32_t version = hw_get_u32(r), flags = hw_get_u32(r);
    if (r->failed)
        return hw_fail(HW_FORMAT, "chunk HEAD is too short");
    if (version != HW_PROGRESSIVE_VERSION)
        return hw_fail(HW_VERSION, "progressive version %u, this program reads %u", version,
                       HW_PROGRESSIVE_VERSION);
    info->grid.lossless = flags & FLAG_LOSSLESS;
    info->keep_order = flags & FLAG_ORDER;
    info->complete = flags & FLAG_COMPLETE;
    for (int i = 0; i < 3; i++)
        info->grid.origin[i] = hw_get_f64(r);
    info->grid.step = hw_get_f64(r);
    info->base_vertex_count = hw_get_u32(r);
    info->base_face_count = hw_get_u32(r);
    info->record_count = hw_get_u32(r);
    info->batch_count = hw_get_u32(r);
    head->block_count = hw_get_u32(r);
    info->copy_count = hw_get_u32(r);
    info->loose_vertex_count = hw_get_u32(r);
    info->loose_face_count = hw_get_u32(r);
    if (r->failed || flags > (FLAG_LOSSLESS | FLAG_ORDER | FLAG_COMPLETE) ||
        head->block_count > HW_PROGRESSIVE_BLOCKS_MAX ||
        hw_bytes_left(r) !=
            4 * (uint64_t)info->batch_count + BLOCK_BYTES * (uint64_t)head->block_count)
        return hw_fail(HW_FORMAT, "chunk HEAD has the wrong size");
    if (!hw_position_grid_valid(&info->grid))
        return hw_fail(HW_FORMAT, "no grid of positions");
    HW_TRY(check_head_counts(head));
    HW_TRY(get_batches(head, r));
    return get_blocks(head, r);
}

hw_status hw_progressive_head_decode(const uint8_t *bytes, size_t size, hw_progressive_head *out)
{
    hw_bytes_reader r = hw_bytes_reader_make(bytes, size);
    *out = (hw_progressive_head){0};
    hw_status status = get_head(&r, out);
    if (status != HW_OK)
        hw_progressive_head_free(out);
    return status;
}

// --- Streams -------------------------------------------------------------------------------------

static uint32_t plane_value(const uint8_t *planes, size_t count, size_t i)
{
    return planes[i] | (uint32_t)planes[count + i] << 8 | (uint32_t)planes[2 * count + i] << 16 |
           (uint32_t)planes[3 * count + i] << 24;
}

static uint32_t get_varint(hw_bytes_reader *r)
{
    uint32_t value = 0;
    for (int shift = 0; shift < 32; shift += 7) {
        uint32_t byte = hw_get_u8(r);
        value |= (byte & 127) << shift;
        if (byte < 128)
            return value;
    }
    r->failed = true;
    return 0;
}

static hw_status get_positions(const hw_position_grid *grid, const uint8_t *planes,
                               int32_t (*codes)[3], uint32_t count)
{
    uint32_t code[3] = {0, 0, 0};
    for (uint32_t i = 0; i < count; i++) {
        for (uint32_t k = 0; k < 3; k++) {
            code[k] += hw_unzigzag(plane_value(planes, 3 * (size_t)count, (size_t)k * count + i));
            codes[i][k] = (int32_t)code[k];
        }
        if (!hw_position_grid_has(grid, codes[i]))
            return hw_fail(HW_FORMAT, "a vertex is at no position");
    }
    return HW_OK;
}

static void get_differences(const uint8_t *planes, uint32_t *numbers, size_t stride, size_t count)
{
    uint32_t value = 0;
    for (size_t i = 0; i < count; i++) {
        value += hw_unzigzag(plane_value(planes, count, i));
        numbers[i * stride] = value;
    }
}

// --- Base ----------------------------------------------------------------------------------------

hw_status hw_progressive_reader_start(hw_progressive_reader *r, const hw_progressive_head *head)
{
    *r = (hw_progressive_reader){.head = head};
    HW_TRY(HW_NEW(&r->p, 1));
    hw_progressive *p = r->p;
    p->info = head->info;
    p->info.record_count = p->info.batch_count = 0;
    p->info.copy_count = p->info.loose_vertex_count = p->info.loose_face_count = 0;
    p->info.complete = p->info.keep_order = false;
    r->batch_end = head->info.batch_count ? head->batches[0] : 0;
    HW_TRY(HW_NEW(&p->first_face, 1));
    HW_TRY(HW_NEW(&p->first_moved, 1));
    return HW_NEW(&p->batch_first, (size_t)head->info.batch_count + 1);
}

void hw_progressive_reader_free(hw_progressive_reader *r)
{
    hw_progressive_destroy(r->p);
    hw_links_free(&r->links);
    hw_fan_free(&r->fan);
}

static hw_status get_base_faces(hw_progressive *p, const uint8_t *planes)
{
    size_t count = 3 * (size_t)p->face_count;
    uint32_t next = 0;
    for (size_t i = 0; i < count; i++) {
        p->corners[i] = next - plane_value(planes, count, i);
        if (p->corners[i] > next || p->corners[i] >= p->vertex_count)
            return hw_fail(HW_FORMAT, "a face of the base has no vertices");
        next += p->corners[i] == next;
        const uint32_t *face = p->corners + i - i % 3;
        if (i % 3 == 2 && (face[0] == face[1] || face[1] == face[2] || face[2] == face[0]))
            return hw_fail(HW_FORMAT, "a face of the base is no triangle");
    }
    return HW_OK;
}

hw_status hw_progressive_get_base(hw_progressive_reader *r, const uint8_t *bytes, size_t size)
{
    hw_progressive *p = r->p;
    uint32_t vertices = p->info.base_vertex_count, faces = p->info.base_face_count;
    if (size != 12 * ((uint64_t)vertices + faces))
        return hw_fail(HW_FORMAT, "chunk BASE does not hold %u vertices and %u faces", vertices,
                       faces);
    HW_TRY(HW_NEW(&p->codes, vertices));
    HW_TRY(HW_NEW(&p->corners, 3 * (size_t)faces));
    HW_TRY(hw_links_grow(&r->links, vertices, faces));
    p->vertex_count = vertices;
    p->face_count = p->first_face[0] = faces;
    HW_TRY(get_positions(&p->info.grid, bytes, p->codes, vertices));
    HW_TRY(get_base_faces(p, bytes + 12 * (size_t)vertices));
    for (uint32_t f = 0; f < faces; f++)
        hw_links_add_face(&r->links, p->corners, f);
    return HW_OK;
}

// --- Blocks --------------------------------------------------------------------------------------

typedef struct block {
    uint32_t first, count, end_face;
    const uint8_t *kinds, *s, *t, *kept, *geometry;
    hw_bytes_reader extra;
} block;

// Room for the block's records; the sizes of its chunks have been checked.
static hw_status grow(hw_progressive_reader *r, const block *b)
{
    hw_progressive *p = r->p;
    size_t n = (size_t)b->first + b->count, vertices = p->info.base_vertex_count + n;
    size_t words = n / 64 + 1, old_words = p->applied ? b->first / 64 + 1 : 0;
    HW_TRY(HW_RESIZE(&p->kept, n));
    HW_TRY(HW_RESIZE(&p->deltas, n));
    HW_TRY(HW_RESIZE(&p->first_face, n + 1));
    HW_TRY(HW_RESIZE(&p->first_moved, n + 1));
    HW_TRY(HW_RESIZE(&p->codes, vertices));
    HW_TRY(HW_RESIZE(&p->corners, 3 * (size_t)b->end_face));
    HW_TRY(HW_RESIZE(&p->applied, words));
    memset(p->applied + old_words, 0, (words - old_words) * sizeof *p->applied);
    return hw_links_grow(&r->links, (uint32_t)vertices, b->end_face);
}

static hw_status fail_record(uint32_t record, const char *what)
{
    return hw_fail(HW_FORMAT, "record %u: %s", record, what);
}

// The vertex to split: there, and in a batch beyond those of the records before, so that none is
// split twice nor made in the same batch.
static hw_status get_kept(const hw_progressive_reader *r, const block *b, uint32_t at)
{
    hw_progressive *p = r->p;
    uint32_t record = b->first + at, base = p->info.base_vertex_count;
    uint64_t value = plane_value(b->kept, b->count, at), limit = base + record;
    if (r->head->info.batch_count == 0) {
        value = (uint32_t)(hw_unzigzag((uint32_t)value) + (at ? p->kept[record - 1] : 0));
    } else {
        uint32_t batch_first = r->batch_end - r->head->batches[r->batch];
        limit = base + batch_first;
        if (record > batch_first)
            value += (uint64_t)p->kept[record - 1] + 1;
    }
    if (value >= limit)
        return fail_record(record, "splits a vertex that is not there");
    p->kept[record] = (uint32_t)value;
    return HW_OK;
}

typedef struct new_faces {
    uint32_t count;
    bool along[2];
    uint32_t tip[2];
} new_faces;

static hw_status get_explicit(hw_progressive_reader *r, block *b, uint32_t record, new_faces *out)
{
    uint32_t flags = get_varint(&b->extra);
    out->count = 1 + (flags & 1);
    for (uint32_t i = 0; i < out->count; i++) {
        out->along[i] = flags >> (1 + i) & 1;
        out->tip[i] = get_varint(&b->extra);
        if (out->tip[i] >= r->p->info.base_vertex_count + record ||
            out->tip[i] == r->p->kept[record])
            return fail_record(record, "a face has no vertices");
    }
    for (uint32_t i = 0; i < r->fan.count; i += 8) {
        uint32_t bits = hw_get_u8(&b->extra);
        for (uint32_t k = 0; k < 8 && i + k < r->fan.count; k++)
            r->fan.moved[i + k] = bits >> k & 1;
    }
    if (flags > 7 || (out->count == 1 && flags > 3) || b->extra.failed)
        return fail_record(record, "cannot be read");
    return HW_OK;
}

static hw_status get_connectivity(hw_progressive_reader *r, block *b, uint32_t at, new_faces *out)
{
    uint32_t record = b->first + at, kind = b->kinds[at] & 3, s = b->s[at], t = b->t[at];
    if (kind == HW_SPLIT_EXPLICIT)
        return get_explicit(r, b, record, out);
    if (s == 255)
        s = get_varint(&b->extra);
    if (t == 255)
        t = get_varint(&b->extra);
    if (b->extra.failed)
        return fail_record(record, "cannot be read");
    if (!hw_fan_divide(&r->fan, (hw_split_kind)kind, s, t))
        return fail_record(record, "divides faces that are not there");
    *out = (new_faces){.count = 1, .along = {kind == HW_SPLIT_ALONG}, .tip = {r->fan.ring[s]}};
    if (kind != HW_SPLIT_BOTH)
        return HW_OK;
    uint32_t e = (uint32_t)(((uint64_t)s + t) % r->fan.ring_count);
    *out = (new_faces){2, {false, true}, {r->fan.ring[s], r->fan.ring[e]}};
    return HW_OK;
}

static void add_differences(const block *b, uint32_t at, uint32_t part, int32_t code[3])
{
    size_t n = 3 * (size_t)b->count;
    const uint8_t *planes = b->geometry + part * 4 * n;
    for (uint32_t i = 0; i < 3; i++)
        code[i] = (int32_t)((uint32_t)code[i] +
                            hw_unzigzag(plane_value(planes, n, (size_t)i * b->count + at)));
}

static hw_status get_geometry(hw_progressive *p, const block *b, uint32_t at,
                              const hw_ring_means *means)
{
    uint32_t record = b->first + at;
    const hw_position_grid *grid = &p->info.grid;
    hw_place place = (hw_place)(b->kinds[at] >> 2);
    int32_t *k = p->codes[p->kept[record]], *l = p->codes[p->info.base_vertex_count + record];
    int32_t kept[3];
    hw_place_kept(grid, place, k, means, kept);
    add_differences(b, at, 0, kept);
    if (!hw_position_grid_has(grid, kept))
        return fail_record(record, "a vertex is at no position");
    hw_place_removed(grid, place, k, kept, means, l);
    add_differences(b, at, 1, l);
    for (int i = 0; i < 3; i++)
        p->deltas[record][i] = (int32_t)((uint32_t)kept[i] - (uint32_t)k[i]);
    memcpy(k, kept, sizeof kept);
    return hw_position_grid_has(grid, l) ? HW_OK
                                         : fail_record(record, "a vertex is at no position");
}

// Corners and faces of the record, where the fan has been divided.
static void insert_faces(hw_progressive_reader *r, uint32_t k, uint32_t l, const new_faces *faces)
{
    hw_progressive *p = r->p;
    for (uint32_t i = 0; i < r->fan.count; i++)
        if (r->fan.moved[i])
            p->corners[r->fan.corners[i]] = l;
    hw_fan_move(&r->fan, &r->links, k, l);
    for (uint32_t i = 0; i < faces->count; i++) {
        uint32_t *corners = p->corners + 3 * (size_t)p->face_count;
        corners[0] = k;
        corners[1] = faces->along[i] ? l : faces->tip[i];
        corners[2] = faces->along[i] ? faces->tip[i] : l;
        hw_links_add_face(&r->links, p->corners, p->face_count++);
    }
}

static hw_status get_record(hw_progressive_reader *r, block *b, uint32_t at)
{
    hw_progressive *p = r->p;
    uint32_t record = b->first + at;
    new_faces faces = {0};
    hw_ring_means means;
    if (b->kinds[at] >= HW_SPLIT_KINDS * HW_PLACES)
        return fail_record(record, "cannot be read");
    HW_TRY(get_kept(r, b, at));
    HW_TRY(hw_fan_look(&r->fan, &r->links, p->corners, p->kept[record]));
    if (hw_progressive_too_much_work(&r->links, b->end_face))
        return hw_fail(HW_FORMAT, "too many faces meet at a vertex again and again");
    HW_TRY(get_connectivity(r, b, at, &faces));
    if (p->face_count + faces.count > b->end_face)
        return fail_record(record, "has more faces than its block");
    hw_ring_means_find(&p->info.grid, &r->fan, p->corners, (const int32_t(*)[3])p->codes, faces.tip,
                       faces.count, &means);
    insert_faces(r, p->kept[record], p->info.base_vertex_count + record, &faces);
    p->first_face[record + 1] = p->face_count;
    return get_geometry(p, b, at, &means);
}

// Once a batch is all applied, the corners that each of its records moves are those of its vertex.
static hw_status gather_moved(hw_progressive_reader *r, uint32_t first, uint32_t end)
{
    hw_progressive *p = r->p;
    size_t n = p->first_moved[first];
    for (uint32_t record = first; record < end; record++) {
        uint32_t c = r->links.head[p->info.base_vertex_count + record];
        for (; c != HW_NO_INDEX; c = r->links.next[c]) {
            HW_TRY(HW_RESERVE(&p->moved, &r->moved_capacity, n + 1));
            p->moved[n++] = c;
        }
        if (n > UINT32_MAX)
            return hw_fail(HW_LIMIT, "the records move too many corners");
        p->first_moved[record + 1] = (uint32_t)n;
    }
    return HW_OK;
}

static hw_status get_records(hw_progressive_reader *r, block *b)
{
    const hw_progressive_head *head = r->head;
    hw_progressive *p = r->p;
    for (uint32_t at = 0; at < b->count; at++) {
        uint32_t record = b->first + at;
        HW_TRY(get_record(r, b, at));
        if (head->info.batch_count == 0) {
            HW_TRY(gather_moved(r, record, record + 1));
        } else if (record + 1 == r->batch_end) {
            HW_TRY(gather_moved(r, r->batch_end - head->batches[r->batch], r->batch_end));
            p->batch_first[++r->batch] = r->batch_end;
            p->info.batch_count = r->batch;
            if (r->batch < head->info.batch_count)
                r->batch_end += head->batches[r->batch];
        }
    }
    if (p->face_count != b->end_face || hw_bytes_left(&b->extra) > 0)
        return hw_fail(HW_FORMAT, "a block is longer than its records");
    p->info.record_count = b->first + b->count;
    p->vertex_count = p->info.base_vertex_count + p->info.record_count;
    return HW_OK;
}

hw_status hw_progressive_get_block(hw_progressive_reader *r, uint32_t block_idx,
                                   const uint8_t *const bytes[2], const size_t size[2])
{
    assert(block_idx < r->head->block_count);
    const hw_progressive_block *about = &r->head->blocks[block_idx];
    size_t n = about->record_count;
    block b = {.first = about->first_record,
               .count = about->record_count,
               .end_face = r->p->face_count + about->face_count};
    assert(b.first == r->p->info.record_count);
    if (size[0] < HW_CONNECTIVITY_BYTES * n || size[1] != HW_GEOMETRY_BYTES * n)
        return hw_fail(HW_FORMAT, "block %u does not hold %zu records", block_idx, n);
    b.kinds = bytes[0];
    b.s = b.kinds + n;
    b.t = b.s + n;
    b.kept = b.t + n;
    b.geometry = bytes[1];
    b.extra = hw_bytes_reader_make(b.kept + 4 * n, size[0] - HW_CONNECTIVITY_BYTES * n);
    HW_TRY(grow(r, &b));
    return get_records(r, &b);
}

// --- The finest level ----------------------------------------------------------------------------

static hw_status get_loose(hw_progressive *p, const hw_progressive_info *info, const uint8_t *bytes,
                           size_t size)
{
    size_t copies = info->copy_count, vertices = info->loose_vertex_count;
    size_t faces = info->loose_face_count;
    if (size != 8 * copies + 12 * (vertices + faces))
        return hw_fail(HW_FORMAT, "chunk LOOS has the wrong size");
    HW_TRY(HW_NEW(&p->copies, copies));
    HW_TRY(HW_NEW(&p->loose_faces, faces));
    HW_TRY(HW_RESIZE(&p->codes, p->vertex_count + vertices));
    p->info.copy_count = info->copy_count;
    p->info.loose_vertex_count = info->loose_vertex_count;
    p->info.loose_face_count = info->loose_face_count;
    get_differences(bytes, &p->copies[0][0], 2, copies);
    get_differences(bytes + 4 * copies, &p->copies[0][1], 2, copies);
    HW_TRY(get_positions(&p->info.grid, bytes + 8 * copies, p->codes + p->vertex_count,
                         info->loose_vertex_count));
    get_differences(bytes + 8 * copies + 12 * vertices, &p->loose_faces[0][0], 1, 3 * faces);
    return HW_OK;
}

static hw_status get_order(hw_progressive *p, const uint8_t *bytes, size_t size)
{
    size_t vertices = hw_progressive_finest_vertices(p), faces = hw_progressive_finest_faces(p);
    if (size != 4 * (vertices + faces) + p->face_count)
        return hw_fail(HW_FORMAT, "chunk ORDR has the wrong size");
    HW_TRY(HW_NEW(&p->vertex_order, vertices));
    HW_TRY(HW_NEW(&p->face_order, faces));
    HW_TRY(HW_NEW(&p->face_turns, p->face_count));
    get_differences(bytes, p->vertex_order, 1, vertices);
    get_differences(bytes + 4 * vertices, p->face_order, 1, faces);
    if (p->face_count > 0)
        memcpy(p->face_turns, bytes + 4 * (vertices + faces), p->face_count);
    p->info.keep_order = true;
    return HW_OK;
}

hw_status hw_progressive_get_finest(hw_progressive_reader *r, const uint8_t *loose,
                                    size_t loose_size, const uint8_t *order, size_t order_size)
{
    const hw_progressive_info *info = &r->head->info;
    assert(info->complete && r->p->info.record_count == info->record_count);
    HW_TRY(get_loose(r->p, info, loose, loose_size));
    if (info->copy_count > hw_progressive_all_vertices(r->p))
        return hw_fail(HW_FORMAT, "more copies than vertices");
    if (info->keep_order)
        HW_TRY(get_order(r->p, order, order_size));
    else if (order_size != 0)
        return hw_fail(HW_FORMAT, "chunk ORDR has the wrong size");
    r->p->info.complete = true;
    return hw_progressive_check_finest(r->p);
}

hw_status hw_progressive_reader_finish(hw_progressive_reader *r, hw_progressive **out)
{
    if (!r->p->applied)
        HW_TRY(HW_NEW(&r->p->applied, 1));
    hw_progressive_mark_all(r->p);
    *out = r->p;
    r->p = NULL;
    return HW_OK;
}
