#include "progressive.h"
#include "progressive_internal.h"
#include <assert.h>
#include <string.h>

void hw_progressive_destroy(hw_progressive *p)
{
    if (!p)
        return;
    hw_free(p->corners);
    hw_free(p->codes);
    hw_free(p->kept);
    hw_free(p->deltas);
    hw_free(p->first_face);
    hw_free(p->first_moved);
    hw_free(p->moved);
    hw_free(p->batch_first);
    hw_free(p->applied);
    hw_free(p->copies);
    hw_free(p->loose_faces);
    hw_free(p->vertex_order);
    hw_free(p->face_order);
    hw_free(p->face_turns);
    hw_free(p);
}

// --- Questions -----------------------------------------------------------------------------------

hw_progressive_info hw_progressive_get_info(const hw_progressive *p)
{
    return p->info;
}

void hw_progressive_batch(const hw_progressive *p, uint32_t batch, uint32_t *first, uint32_t *count)
{
    if (p->info.batch_count == 0) {
        assert(batch < p->info.record_count);
        *first = batch;
        *count = 1;
        return;
    }
    assert(batch < p->info.batch_count);
    *first = p->batch_first[batch];
    *count = p->batch_first[batch + 1] - *first;
}

uint32_t hw_progressive_all_vertices(const hw_progressive *p)
{
    return p->vertex_count + p->info.loose_vertex_count;
}

uint32_t hw_progressive_finest_vertices(const hw_progressive *p)
{
    return hw_progressive_all_vertices(p) - p->info.copy_count;
}

uint32_t hw_progressive_finest_faces(const hw_progressive *p)
{
    return p->face_count + p->info.loose_face_count;
}

static bool is_finest(const hw_progressive *p, uint32_t n)
{
    return n == p->info.record_count && p->info.complete;
}

uint32_t hw_progressive_faces_at(const hw_progressive *p, uint32_t n)
{
    assert(n <= p->info.record_count);
    return is_finest(p, n) ? hw_progressive_finest_faces(p) : p->first_face[n];
}

uint32_t hw_progressive_vertices_at(const hw_progressive *p, uint32_t n)
{
    assert(n <= p->info.record_count);
    return is_finest(p, n) ? hw_progressive_finest_vertices(p) : p->info.base_vertex_count + n;
}

hw_progressive_record hw_progressive_get_record(const hw_progressive *p, uint32_t record)
{
    assert(record < p->info.record_count);
    return (hw_progressive_record){.kept = p->kept[record],
                                   .removed = p->info.base_vertex_count + record,
                                   .first_face = p->first_face[record],
                                   .face_count = p->first_face[record + 1] - p->first_face[record]};
}

uint32_t hw_progressive_applied_count(const hw_progressive *p)
{
    return p->applied_count;
}

bool hw_progressive_is_applied(const hw_progressive *p, uint32_t record)
{
    assert(record < p->info.record_count);
    return hw_progressive_bit(p, record);
}

uint32_t hw_progressive_face_count(const hw_progressive *p)
{
    return is_finest(p, p->applied_count) ? hw_progressive_finest_faces(p) : p->live_faces;
}

uint32_t hw_progressive_vertex_count(const hw_progressive *p)
{
    return hw_progressive_vertices_at(p, p->applied_count);
}

// --- Moves ---------------------------------------------------------------------------------------

void hw_progressive_put(const hw_progressive *p, uint32_t record, bool split, uint32_t *corners,
                        int32_t (*codes)[3])
{
    uint32_t kept = p->kept[record];
    uint32_t vertex = split ? p->info.base_vertex_count + record : kept;
    for (uint32_t i = p->first_moved[record]; i < p->first_moved[record + 1]; i++)
        corners[p->moved[i]] = vertex;
    for (int i = 0; i < 3; i++) {
        uint32_t delta = (uint32_t)p->deltas[record][i], code = (uint32_t)codes[kept][i];
        codes[kept][i] = (int32_t)(split ? code + delta : code - delta);
    }
}

static void apply(hw_progressive *p, uint32_t record)
{
    hw_progressive_put(p, record, true, p->corners, p->codes);
    p->applied[record / 64] |= UINT64_C(1) << (record % 64);
    p->applied_count++;
    p->live_faces += p->first_face[record + 1] - p->first_face[record];
    if (record == p->gap)
        p->gap = record + 1;
    if (record >= p->top)
        p->top = record + 1;
}

static void undo(hw_progressive *p, uint32_t record)
{
    hw_progressive_put(p, record, false, p->corners, p->codes);
    p->applied[record / 64] &= ~(UINT64_C(1) << (record % 64));
    p->applied_count--;
    p->live_faces -= p->first_face[record + 1] - p->first_face[record];
    if (record < p->gap)
        p->gap = record;
    if (record + 1 == p->top)
        p->top = record;
}

void hw_progressive_mark_all(hw_progressive *p)
{
    uint32_t n = p->info.record_count;
    for (uint32_t i = 0; i < n; i++)
        p->applied[i / 64] |= UINT64_C(1) << (i % 64);
    p->applied_count = p->gap = p->top = n;
    p->live_faces = p->face_count;
}

bool hw_progressive_refine(hw_progressive *p)
{
    while (p->gap < p->info.record_count && hw_progressive_bit(p, p->gap))
        p->gap++;
    if (p->gap == p->info.record_count)
        return false;
    apply(p, p->gap);
    return true;
}

// One more than the last applied record, 0 if none is.
static uint32_t top_of(hw_progressive *p)
{
    while (p->top > 0 && !hw_progressive_bit(p, p->top - 1))
        p->top--;
    return p->top;
}

bool hw_progressive_coarsen(hw_progressive *p)
{
    if (top_of(p) == 0)
        return false;
    undo(p, p->top - 1);
    return true;
}

void hw_progressive_go(hw_progressive *p, uint32_t n)
{
    if (n > p->info.record_count)
        n = p->info.record_count;
    while (top_of(p) > n)
        undo(p, p->top - 1);
    while (p->applied_count < n)
        (void)hw_progressive_refine(p);
}

void hw_progressive_go_faces(hw_progressive *p, uint32_t faces)
{
    uint32_t low = 0, high = p->info.record_count;
    while (low < high) {
        uint32_t middle = low + (high - low + 1) / 2;
        if (hw_progressive_faces_at(p, middle) <= faces)
            low = middle;
        else
            high = middle - 1;
    }
    hw_progressive_go(p, low);
}

// The records of the batch that holds this one.
static void batch_range(const hw_progressive *p, uint32_t record, uint32_t *first, uint32_t *end)
{
    uint32_t low = 0, high = p->info.batch_count;
    *first = record;
    *end = record + 1;
    if (high == 0)
        return;
    while (high - low > 1) {
        uint32_t middle = low + (high - low) / 2;
        if (p->batch_first[middle] <= record)
            low = middle;
        else
            high = middle;
    }
    *first = p->batch_first[low];
    *end = p->batch_first[high];
}

hw_status hw_progressive_split(hw_progressive *p, uint32_t record)
{
    uint32_t first, end;
    if (record >= p->info.record_count || hw_progressive_bit(p, record))
        return hw_fail(HW_USAGE, "record %u cannot be applied", record);
    batch_range(p, record, &first, &end);
    // Batches fill one after the other: so many records are all of those before this batch.
    if (p->applied_count < first)
        return hw_fail(HW_USAGE, "record %u belongs to a finer batch", record);
    apply(p, record);
    return HW_OK;
}

hw_status hw_progressive_collapse_record(hw_progressive *p, uint32_t record)
{
    uint32_t first, end;
    if (record >= p->info.record_count || !hw_progressive_bit(p, record))
        return hw_fail(HW_USAGE, "record %u is not applied", record);
    batch_range(p, record, &first, &end);
    if (p->applied_count > end)
        return hw_fail(HW_USAGE, "record %u belongs to a coarser batch", record);
    undo(p, record);
    return HW_OK;
}

// --- Meshes --------------------------------------------------------------------------------------

static hw_vec3 position_of(const hw_progressive *p, uint32_t vertex)
{
    float v[3];
    hw_position_grid_decode(&p->info.grid, p->codes[vertex], v);
    return hw_v3(v[0], v[1], v[2]);
}

static hw_status make_mesh(const hw_progressive *p, hw_mesh *out)
{
    *out = (hw_mesh){.vertex_count = hw_progressive_vertex_count(p),
                     .index_count = 3 * hw_progressive_face_count(p)};
    HW_TRY(HW_NEW(&out->positions, out->vertex_count));
    return HW_NEW(&out->indices, out->index_count);
}

// Numbers without the vertices that are not there.
static void extract_state(const hw_progressive *p, uint32_t *numbers, hw_mesh *out)
{
    uint32_t base = p->info.base_vertex_count, vertices = 0, indices = 0;
    for (uint32_t v = 0; v < p->vertex_count; v++) {
        if (v >= base && !hw_progressive_bit(p, v - base))
            continue;
        numbers[v] = vertices;
        out->positions[vertices++] = position_of(p, v);
    }
    for (uint32_t i = 0; i < 3 * p->info.base_face_count; i++)
        out->indices[indices++] = numbers[p->corners[i]];
    for (uint32_t r = 0; r < p->top; r++) {
        if (!hw_progressive_bit(p, r))
            continue;
        for (uint32_t i = 3 * p->first_face[r]; i < 3 * p->first_face[r + 1]; i++)
            out->indices[indices++] = numbers[p->corners[i]];
    }
    assert(vertices == out->vertex_count && indices == out->index_count);
}

// Where each vertex goes at the finest level.
static void number_finest(const hw_progressive *p, uint32_t *numbers)
{
    uint32_t copy = 0, next = 0;
    for (uint32_t v = 0; v < hw_progressive_all_vertices(p); v++) {
        if (copy < p->info.copy_count && p->copies[copy][0] == v) {
            copy++;
            continue;
        }
        numbers[v] = p->vertex_order ? p->vertex_order[next] : next;
        next++;
    }
    for (copy = 0; copy < p->info.copy_count; copy++)
        numbers[p->copies[copy][0]] = numbers[p->copies[copy][1]];
}

static void extract_finest(const hw_progressive *p, uint32_t *numbers, hw_mesh *out)
{
    uint32_t faces = hw_progressive_finest_faces(p);
    number_finest(p, numbers);
    for (uint32_t v = 0; v < hw_progressive_all_vertices(p); v++)
        out->positions[numbers[v]] = position_of(p, v);
    for (uint32_t f = 0; f < faces; f++) {
        bool loose = f >= p->face_count;
        const uint32_t *face =
            loose ? p->loose_faces[f - p->face_count] : p->corners + 3 * (size_t)f;
        uint32_t *to = out->indices + 3 * (size_t)(p->face_order ? p->face_order[f] : f);
        uint32_t turn = p->face_turns && !loose ? p->face_turns[f] : 0;
        for (uint32_t i = 0; i < 3; i++)
            to[i] = numbers[face[(i + turn) % 3]];
    }
}

hw_status hw_progressive_extract(const hw_progressive *p, hw_mesh *out)
{
    hw_status status = HW_OK;
    uint32_t *numbers = NULL;
    HW_GO(make_mesh(p, out));
    HW_GO(HW_NEW(&numbers, hw_progressive_all_vertices(p)));
    if (is_finest(p, p->applied_count))
        extract_finest(p, numbers, out);
    else
        extract_state(p, numbers, out);
out:
    hw_free(numbers);
    if (status != HW_OK)
        hw_mesh_free(out);
    return status;
}

// --- Checks --------------------------------------------------------------------------------------

static hw_status check_copies(const hw_progressive *p, uint8_t *is_copy)
{
    for (uint32_t i = 0; i < p->info.copy_count; i++) {
        uint32_t copy = p->copies[i][0], source = p->copies[i][1];
        if (copy >= p->vertex_count || source >= hw_progressive_all_vertices(p) ||
            (i > 0 && p->copies[i - 1][0] >= copy))
            return hw_fail(HW_FORMAT, "copy %u is out of order or range", i);
        if (memcmp(p->codes[copy], p->codes[source], sizeof *p->codes) != 0)
            return hw_fail(HW_FORMAT, "copy %u is not where its source is", i);
        is_copy[copy] = 1;
    }
    for (uint32_t i = 0; i < p->info.copy_count; i++)
        if (is_copy[p->copies[i][1]])
            return hw_fail(HW_FORMAT, "copy %u is one of a copy", i);
    for (uint32_t i = 0; i < p->info.loose_face_count; i++)
        for (int k = 0; k < 3; k++)
            if (p->loose_faces[i][k] >= hw_progressive_all_vertices(p) ||
                is_copy[p->loose_faces[i][k]])
                return hw_fail(HW_FORMAT, "loose face %u has no vertices of the original", i);
    return HW_OK;
}

static bool is_permutation(const uint32_t *order, uint32_t count, uint8_t *seen)
{
    memset(seen, 0, count);
    for (uint32_t i = 0; i < count; i++) {
        if (order[i] >= count || seen[order[i]])
            return false;
        seen[order[i]] = 1;
    }
    return true;
}

static hw_status check_order(const hw_progressive *p, uint8_t *seen)
{
    bool fine = is_permutation(p->vertex_order, hw_progressive_finest_vertices(p), seen) &&
                is_permutation(p->face_order, hw_progressive_finest_faces(p), seen);
    for (uint32_t f = 0; fine && f < p->face_count; f++)
        fine = p->face_turns[f] < 3;
    return fine ? HW_OK : hw_fail(HW_FORMAT, "the original order is no permutation");
}

hw_status hw_progressive_check_finest(const hw_progressive *p)
{
    hw_status status = HW_OK;
    uint8_t *flags = NULL;
    uint32_t vertices = hw_progressive_all_vertices(p), faces = hw_progressive_finest_faces(p);
    HW_TRY(HW_NEW(&flags, vertices > faces ? vertices : faces));
    for (uint32_t v = p->vertex_count; status == HW_OK && v < vertices; v++)
        if (!hw_position_grid_has(&p->info.grid, p->codes[v]))
            status = hw_fail(HW_FORMAT, "a loose vertex is at no position");
    if (status == HW_OK)
        status = check_copies(p, flags);
    if (status == HW_OK && p->info.keep_order)
        status = check_order(p, flags);
    hw_free(flags);
    return status;
}
