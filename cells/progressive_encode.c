// The writing side of progressive_codec.h.
#include "progressive_codec.h"
#include "progressive_internal.h"
#include <assert.h>
#include <string.h>

#define FLAG_LOSSLESS 1u
#define FLAG_ORDER    2u
#define FLAG_COMPLETE 4u

// A block is large enough that its tables do not weigh, and small enough that a prefix of the file
// is useful. Strict orders can be cut anywhere; batches are not.
#define BLOCK_RECORDS_MIN    2048u
#define BLOCK_RECORDS_STRICT 65536u

bool hw_progressive_too_much_work(const hw_links *links, uint32_t end_face)
{
    return links->steps > 256 * ((uint64_t)end_face + 65536);
}

// --- Head ----------------------------------------------------------------------------------------

void hw_progressive_head_free(hw_progressive_head *head)
{
    hw_free(head->batches);
    *head = (hw_progressive_head){0};
}

static void add_block(hw_progressive_head *head, const hw_progressive *p, uint32_t first,
                      uint32_t end)
{
    assert(head->block_count < HW_PROGRESSIVE_BLOCKS_MAX);
    head->blocks[head->block_count++] = (hw_progressive_block){
        .first_record = first,
        .record_count = end - first,
        .face_count = p->first_face[end] - p->first_face[first],
    };
}

static void cut_blocks(hw_progressive_head *head, const hw_progressive *p)
{
    uint32_t n = head->info.record_count, first = 0;
    uint32_t least = head->info.batch_count ? BLOCK_RECORDS_MIN : BLOCK_RECORDS_STRICT;
    if (least < n / (HW_PROGRESSIVE_BLOCKS_MAX - 1) + 1)
        least = n / (HW_PROGRESSIVE_BLOCKS_MAX - 1) + 1;
    uint32_t end = 0;
    for (uint32_t b = 0; end < n; b++) {
        end = head->info.batch_count ? end + head->batches[b] : (n - end > least ? end + least : n);
        if (end - first < least && end < n)
            continue;
        add_block(head, p, first, end);
        first = end;
    }
}

hw_status hw_progressive_head_make(const hw_progressive *p, uint32_t records,
                                   hw_progressive_head *out)
{
    assert(records <= p->info.record_count);
    hw_progressive_head head = {.info = p->info};
    bool complete = p->info.complete && records == p->info.record_count;
    *out = (hw_progressive_head){0};
    head.info.record_count = records;
    head.info.complete = complete;
    head.info.keep_order = complete && p->info.keep_order;
    if (!complete)
        head.info.copy_count = head.info.loose_vertex_count = head.info.loose_face_count = 0;
    head.info.batch_count = 0;
    HW_TRY(HW_NEW(&head.batches, p->info.batch_count));
    for (uint32_t b = 0; b < p->info.batch_count && p->batch_first[b] < records; b++) {
        uint32_t end = p->batch_first[b + 1] < records ? p->batch_first[b + 1] : records;
        head.batches[head.info.batch_count++] = end - p->batch_first[b];
    }
    cut_blocks(&head, p);
    *out = head;
    return HW_OK;
}

// Hands over what was written, or frees it.
static hw_status finish(hw_bytes_writer *w, uint8_t **bytes, size_t *size)
{
    hw_status status = hw_bytes_writer_check(w);
    *bytes = NULL;
    *size = 0;
    if (status == HW_OK) {
        *bytes = w->data;
        *size = w->size;
        w->data = NULL;
    }
    hw_bytes_writer_free(w);
    return status;
}

hw_status hw_progressive_head_encode(const hw_progressive_head *head, uint8_t **bytes, size_t *size)
{
    const hw_progressive_info *info = &head->info;
    hw_bytes_writer w = {0};
    hw_put_u32(&w, HW_PROGRESSIVE_VERSION);
    hw_put_u32(&w, (info->grid.lossless ? FLAG_LOSSLESS : 0) | (info->keep_order ? FLAG_ORDER : 0) |
                       (info->complete ? FLAG_COMPLETE : 0));
    for (int i = 0; i < 3; i++)
        hw_put_f64(&w, info->grid.origin[i]);
    hw_put_f64(&w, info->grid.step);
    hw_put_u32(&w, info->base_vertex_count);
    hw_put_u32(&w, info->base_face_count);
    hw_put_u32(&w, info->record_count);
    hw_put_u32(&w, info->batch_count);
    hw_put_u32(&w, head->block_count);
    hw_put_u32(&w, info->copy_count);
    hw_put_u32(&w, info->loose_vertex_count);
    hw_put_u32(&w, info->loose_face_count);
    for (uint32_t i = 0; i < info->batch_count; i++)
        hw_put_u32(&w, head->batches[i]);
    for (uint32_t i = 0; i < head->block_count; i++) {
        hw_put_u32(&w, head->blocks[i].record_count);
        hw_put_u32(&w, head->blocks[i].face_count);
    }
    return finish(&w, bytes, size);
}

// --- Streams -------------------------------------------------------------------------------------

// All lowest bytes, then all second ones, and so on: the higher ones are nearly all 0.
static void put_planes(hw_bytes_writer *w, const uint32_t *values, size_t count)
{
    uint8_t some[1024];
    for (int shift = 0; shift < 32; shift += 8) {
        for (size_t i = 0; i < count;) {
            size_t n = 0;
            for (; n < sizeof some && i < count; n++, i++)
                some[n] = (uint8_t)(values[i] >> shift);
            hw_put_bytes(w, some, n);
        }
    }
}

static void put_varint(hw_bytes_writer *w, uint32_t value)
{
    for (; value >= 128; value >>= 7)
        hw_put_u8(w, (uint8_t)(value | 128));
    hw_put_u8(w, (uint8_t)value);
}

// Each against the one before, x of all, then y, then z.
static hw_status put_positions(hw_bytes_writer *w, const int32_t (*codes)[3], uint32_t count)
{
    uint32_t *values = NULL;
    HW_TRY(HW_NEW(&values, 3 * (size_t)count));
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = 0; k < 3; k++)
            values[(size_t)k * count + i] =
                hw_zigzag((uint32_t)codes[i][k] - (i ? (uint32_t)codes[i - 1][k] : 0));
    put_planes(w, values, 3 * (size_t)count);
    hw_free(values);
    return HW_OK;
}

// Zigzag differences, each to the one before.
static hw_status put_differences(hw_bytes_writer *w, const uint32_t *numbers, size_t stride,
                                 size_t count)
{
    uint32_t *values = NULL;
    HW_TRY(HW_NEW(&values, count));
    for (size_t i = 0; i < count; i++)
        values[i] = hw_zigzag(numbers[i * stride] - (i ? numbers[(i - 1) * stride] : 0));
    put_planes(w, values, count);
    hw_free(values);
    return HW_OK;
}

// --- Base ----------------------------------------------------------------------------------------

hw_status hw_progressive_writer_start(hw_progressive_writer *w, const hw_progressive *p,
                                      const hw_progressive_head *head)
{
    size_t corner_bytes = 3 * (size_t)p->face_count * sizeof *w->corners;
    size_t code_bytes = (size_t)p->vertex_count * sizeof *w->codes;
    *w = (hw_progressive_writer){.p = p, .head = head};
    HW_TRY(HW_NEW(&w->corners, 3 * (size_t)p->face_count));
    HW_TRY(HW_NEW(&w->codes, p->vertex_count));
    HW_TRY(hw_links_grow(&w->links, p->vertex_count, p->face_count));
    memcpy(w->corners, p->corners, corner_bytes);
    memcpy(w->codes, p->codes, code_bytes);
    for (uint32_t r = p->info.record_count; r-- > 0;)
        if (hw_progressive_bit(p, r))
            hw_progressive_put(p, r, false, w->corners, w->codes);
    for (uint32_t f = 0; f < p->info.base_face_count; f++)
        hw_links_add_face(&w->links, w->corners, f);
    return HW_OK;
}

void hw_progressive_writer_free(hw_progressive_writer *w)
{
    hw_free(w->corners);
    hw_free(w->codes);
    hw_links_free(&w->links);
    hw_fan_free(&w->fan);
}

// Vertices are numbered by their first use: a new one is 0, others count back from there.
static hw_status put_base_faces(const hw_progressive_writer *w, hw_bytes_writer *out)
{
    size_t count = 3 * (size_t)w->p->info.base_face_count;
    uint32_t *values = NULL, next = 0;
    HW_TRY(HW_NEW(&values, count));
    for (size_t i = 0; i < count; i++) {
        values[i] = next - w->corners[i];
        next += w->corners[i] == next;
    }
    put_planes(out, values, count);
    hw_free(values);
    return HW_OK;
}

hw_status hw_progressive_put_base(const hw_progressive_writer *w, uint8_t **bytes, size_t *size)
{
    hw_bytes_writer out = {0};
    hw_status status =
        put_positions(&out, (const int32_t(*)[3])w->codes, w->p->info.base_vertex_count);
    if (status == HW_OK)
        status = put_base_faces(w, &out);
    if (status != HW_OK) {
        hw_bytes_writer_free(&out);
        *bytes = NULL;
        return status;
    }
    return finish(&out, bytes, size);
}

// --- Blocks --------------------------------------------------------------------------------------

typedef struct block {
    uint32_t first, count, at;
    uint8_t *kinds, *s, *t; // [count]
    uint32_t *kept;         // [count]
    uint32_t *geometry;     // [6][count]: x, y, z of kept, then of removed
    hw_bytes_writer extra;
} block;

static bool is_moved_corner(const hw_progressive *p, uint32_t r, uint32_t corner)
{
    for (uint32_t i = p->first_moved[r]; i < p->first_moved[r + 1]; i++)
        if (p->moved[i] == corner)
            return true;
    return false;
}

static void mark_moved(const hw_progressive *p, uint32_t r, hw_fan *fan)
{
    for (uint32_t i = p->first_moved[r]; i < p->first_moved[r + 1]; i++) {
        uint32_t low = 0, high = fan->count, corner = p->moved[i];
        while (low < high) {
            uint32_t middle = low + (high - low) / 2;
            if (fan->corners[middle] < corner)
                low = middle + 1;
            else
                high = middle;
        }
        if (low < fan->count && fan->corners[low] == corner)
            fan->moved[low] = 1;
    }
}

static uint8_t put_small(hw_bytes_writer *extra, uint32_t value)
{
    if (value < 255)
        return (uint8_t)value;
    put_varint(extra, value);
    return 255;
}

// The faces that a record brings: on which side of the edge, and their third vertices.
typedef struct new_faces {
    uint32_t count;
    bool along[2];
    uint32_t tip[2];
} new_faces;

static void find_new_faces(const hw_progressive_writer *w, uint32_t r, new_faces *out)
{
    uint32_t f = w->p->first_face[r];
    *out = (new_faces){.count = w->p->first_face[r + 1] - f};
    for (uint32_t i = 0; i < out->count; i++) {
        out->along[i] = is_moved_corner(w->p, r, 3 * (f + i) + 1);
        out->tip[i] = w->corners[3 * (f + i) + (out->along[i] ? 2 : 1)];
    }
}

static void put_explicit(const hw_progressive_writer *w, const new_faces *faces,
                         hw_bytes_writer *extra)
{
    put_varint(extra, (faces->count == 2) | (uint32_t)faces->along[0] << 1 |
                          (uint32_t)faces->along[1] << 2);
    for (uint32_t i = 0; i < faces->count; i++)
        put_varint(extra, faces->tip[i]);
    for (uint32_t i = 0; i < w->fan.count; i += 8) {
        uint32_t bits = 0;
        for (uint32_t k = 0; k < 8 && i + k < w->fan.count; k++)
            bits |= (uint32_t)w->fan.moved[i + k] << k;
        hw_put_u8(extra, (uint8_t)bits);
    }
}

static void put_connectivity(const hw_progressive_writer *w, const new_faces *faces, block *b)
{
    uint32_t s = 0, t = 0;
    const bool *along = faces->along;
    const uint32_t *tip = faces->tip;
    hw_split_kind kind = HW_SPLIT_EXPLICIT;
    if (faces->count == 1)
        kind = hw_fan_recognise(&w->fan, along[0] ? HW_NO_INDEX : tip[0],
                                along[0] ? tip[0] : HW_NO_INDEX, &s, &t);
    else if (!along[0] && along[1])
        kind = hw_fan_recognise(&w->fan, tip[0], tip[1], &s, &t);
    b->kinds[b->at] = (uint8_t)kind;
    if (kind == HW_SPLIT_EXPLICIT) {
        put_explicit(w, faces, &b->extra);
        return;
    }
    b->s[b->at] = put_small(&b->extra, s);
    b->t[b->at] = put_small(&b->extra, t);
}

static uint32_t bit_length(uint32_t value)
{
    return value ? 32 - (uint32_t)__builtin_clz(value) : 0;
}

// Differences to what `place` predicts: of kept, then of removed. Returns about how many bits.
static uint32_t differences(const hw_progressive_writer *w, hw_place place, uint32_t r,
                            const int32_t merged[3], const hw_ring_means *means, uint32_t out[6])
{
    const hw_position_grid *grid = &w->p->info.grid;
    const int32_t *k = w->codes[w->p->kept[r]], *l = w->codes[w->p->info.base_vertex_count + r];
    int32_t kept[3], removed[3];
    uint32_t bits = 0;
    hw_place_kept(grid, place, merged, means, kept);
    hw_place_removed(grid, place, merged, k, means, removed);
    for (int i = 0; i < 3; i++) {
        out[i] = hw_zigzag((uint32_t)k[i] - (uint32_t)kept[i]);
        out[i + 3] = hw_zigzag((uint32_t)l[i] - (uint32_t)removed[i]);
        bits += bit_length(out[i]) + bit_length(out[i + 3]);
    }
    return bits;
}

// Which prediction is best must be told, too: changing it costs some two bits.
static void put_geometry(hw_progressive_writer *w, uint32_t r, const int32_t merged[3],
                         const hw_ring_means *means, block *b)
{
    uint32_t best[6], other[6];
    hw_place place = HW_PLACE_REFLECT;
    if (memcmp(merged, w->codes[w->p->kept[r]], 3 * sizeof *merged) == 0)
        place = HW_PLACE_KEPT;
    else if (memcmp(merged, w->codes[w->p->info.base_vertex_count + r], 3 * sizeof *merged) == 0)
        place = HW_PLACE_REMOVED;
    uint32_t bits = differences(w, place, r, merged, means, best);
    if (place == HW_PLACE_REFLECT &&
        differences(w, HW_PLACE_RING, r, merged, means, other) + 2 < bits) {
        place = HW_PLACE_RING;
        memcpy(best, other, sizeof best);
    }
    b->kinds[b->at] |= (uint8_t)(place << 2);
    for (uint32_t i = 0; i < 6; i++)
        b->geometry[(size_t)i * b->count + b->at] = best[i];
}

static hw_status put_record(hw_progressive_writer *w, uint32_t r, block *b)
{
    const hw_progressive *p = w->p;
    uint32_t k = p->kept[r];
    int32_t merged[3];
    new_faces faces;
    hw_ring_means means;
    memcpy(merged, w->codes[k], sizeof merged);
    HW_TRY(hw_fan_look(&w->fan, &w->links, w->corners, k));
    if (hw_progressive_too_much_work(&w->links, p->first_face[b->first + b->count]))
        return hw_fail(HW_LIMIT, "too many faces meet at a vertex again and again");
    mark_moved(p, r, &w->fan);
    find_new_faces(w, r, &faces);
    put_connectivity(w, &faces, b);
    hw_ring_means_find(&p->info.grid, &w->fan, w->corners, (const int32_t(*)[3])w->codes, faces.tip,
                       faces.count, &means);
    hw_progressive_put(p, r, true, w->corners, w->codes);
    hw_fan_move(&w->fan, &w->links, k, p->info.base_vertex_count + r);
    for (uint32_t f = p->first_face[r]; f < p->first_face[r + 1]; f++)
        hw_links_add_face(&w->links, w->corners, f);
    put_geometry(w, r, merged, &means, b);
    return HW_OK;
}

// In a batch the kept vertices rise: steps between them. Else differences of either sign.
static void put_kept(const hw_progressive_writer *w, uint32_t batch, block *b)
{
    const uint32_t *kept = w->p->kept + b->first;
    if (w->head->info.batch_count == 0) {
        for (uint32_t i = 0; i < b->count; i++)
            b->kept[i] = hw_zigzag(kept[i] - (i ? kept[i - 1] : 0));
        return;
    }
    for (uint32_t i = 0; i < b->count; batch++) {
        b->kept[i] = kept[i];
        for (uint32_t k = 1; k < w->head->batches[batch]; k++)
            b->kept[i + k] = kept[i + k] - kept[i + k - 1] - 1;
        i += w->head->batches[batch];
    }
}

static hw_status put_records(hw_progressive_writer *w, block *b)
{
    uint32_t batch = 0;
    HW_TRY(HW_NEW(&b->kinds, b->count));
    HW_TRY(HW_NEW(&b->s, b->count));
    HW_TRY(HW_NEW(&b->t, b->count));
    HW_TRY(HW_NEW(&b->kept, b->count));
    HW_TRY(HW_NEW(&b->geometry, 6 * (size_t)b->count));
    for (uint32_t first = 0; w->head->info.batch_count && first < b->first;)
        first += w->head->batches[batch++];
    put_kept(w, batch, b);
    for (b->at = 0; b->at < b->count; b->at++)
        HW_TRY(put_record(w, b->first + b->at, b));
    return hw_bytes_writer_check(&b->extra);
}

static hw_status pack_block(const block *b, uint8_t *bytes[2], size_t size[2])
{
    hw_bytes_writer connectivity = {0}, geometry = {0};
    hw_put_bytes(&connectivity, b->kinds, b->count);
    hw_put_bytes(&connectivity, b->s, b->count);
    hw_put_bytes(&connectivity, b->t, b->count);
    put_planes(&connectivity, b->kept, b->count);
    if (b->extra.size)
        hw_put_bytes(&connectivity, b->extra.data, b->extra.size);
    put_planes(&geometry, b->geometry, 3 * (size_t)b->count);
    put_planes(&geometry, b->geometry + 3 * (size_t)b->count, 3 * (size_t)b->count);
    hw_status status = finish(&connectivity, &bytes[0], &size[0]);
    if (status != HW_OK) {
        hw_bytes_writer_free(&geometry);
        return status;
    }
    return finish(&geometry, &bytes[1], &size[1]);
}

hw_status hw_progressive_put_block(hw_progressive_writer *w, uint32_t block_idx, uint8_t *bytes[2],
                                   size_t size[2])
{
    block b = {.first = w->head->blocks[block_idx].first_record,
               .count = w->head->blocks[block_idx].record_count};
    bytes[0] = bytes[1] = NULL;
    hw_status status = put_records(w, &b);
    if (status == HW_OK)
        status = pack_block(&b, bytes, size);
    hw_free(b.kinds);
    hw_free(b.s);
    hw_free(b.t);
    hw_free(b.kept);
    hw_free(b.geometry);
    hw_bytes_writer_free(&b.extra);
    return status;
}

// --- The finest level ----------------------------------------------------------------------------

static hw_status fill_loose(const hw_progressive *p, hw_bytes_writer *w)
{
    const hw_progressive_info *info = &p->info;
    HW_TRY(put_differences(w, &p->copies[0][0], 2, info->copy_count));
    HW_TRY(put_differences(w, &p->copies[0][1], 2, info->copy_count));
    HW_TRY(put_positions(w, (const int32_t(*)[3])p->codes + p->vertex_count,
                         info->loose_vertex_count));
    return put_differences(w, &p->loose_faces[0][0], 1, 3 * (size_t)info->loose_face_count);
}

hw_status hw_progressive_put_loose(const hw_progressive *p, uint8_t **bytes, size_t *size)
{
    hw_bytes_writer w = {0};
    hw_status status = fill_loose(p, &w);
    if (status != HW_OK) {
        hw_bytes_writer_free(&w);
        *bytes = NULL;
        return status;
    }
    return finish(&w, bytes, size);
}

hw_status hw_progressive_put_order(const hw_progressive *p, uint8_t **bytes, size_t *size)
{
    hw_bytes_writer w = {0};
    hw_status status = put_differences(&w, p->vertex_order, 1, hw_progressive_finest_vertices(p));
    if (status == HW_OK)
        status = put_differences(&w, p->face_order, 1, hw_progressive_finest_faces(p));
    if (status != HW_OK) {
        hw_bytes_writer_free(&w);
        *bytes = NULL;
        return status;
    }
    hw_put_bytes(&w, p->face_turns, p->face_count);
    return finish(&w, bytes, size);
}
