// From what a simplifier recorded to canonical numbers. The record is played backwards, from coarse
// to fine, and checked on the way; then everything is numbered anew.
#include "progressive.h"
#include "progressive_internal.h"
#include <stdlib.h>
#include <string.h>

typedef struct maker {
    const hw_progressive_source *s;
    hw_progressive *p;
    uint32_t *removed_at;   // [vertices] the collapse that removed it, or none
    uint32_t (*corners)[3]; // [faces] as the recorder had them
    int32_t (*codes)[3];    // [vertices]
    uint8_t *used;          // [vertices] by any face at any time
    uint32_t *mark;         // [vertices] batch that it last took part in
    uint32_t *vertex_map;   // [vertices] canonical number
    uint32_t *face_map;     // [faces]
    uint8_t *turns;         // [faces] corner that became the first
    uint32_t *record_of;    // [collapses]
    uint32_t *batch_of;     // [collapses] from coarse to fine
    uint32_t *fill;         // [records]
    uint64_t *keys;         // of a batch, for sorting
} maker;

static hw_status check_counts(const hw_progressive_source *s)
{
    uint64_t sum = 0, corners = 0;
    if (s->vertex_count > HW_PROGRESSIVE_VERTICES_MAX ||
        (uint64_t)s->face_count + s->loose_face_count > HW_PROGRESSIVE_FACES_MAX)
        return hw_fail(HW_LIMIT, "a progressive mesh of %u vertices and %u faces", s->vertex_count,
                       s->face_count);
    if (s->original_vertex_count > s->vertex_count || s->collapse_count > s->vertex_count ||
        (!s->source && s->original_vertex_count != s->vertex_count))
        return hw_fail(HW_FORMAT, "%u vertices are copies of %u", s->vertex_count,
                       s->original_vertex_count);
    for (uint32_t i = 0; i < s->batch_count; i++) {
        if (s->batches[i] == 0)
            return hw_fail(HW_FORMAT, "batch %u is empty", i);
        sum += s->batches[i];
    }
    if (s->batch_count > 0 && sum != s->collapse_count)
        return hw_fail(HW_FORMAT, "the batches hold %llu collapses, there are %u",
                       (unsigned long long)sum, s->collapse_count);
    for (uint32_t i = 0; i < s->collapse_count; i++)
        corners += s->collapses[i].corner_count + 6;
    if (corners > UINT32_MAX)
        return hw_fail(HW_LIMIT, "the collapses moved %llu corners", (unsigned long long)corners);
    for (uint32_t v = 0; s->source && v < s->vertex_count; v++)
        if (v < s->original_vertex_count ? s->source[v] != v
                                         : s->source[v] >= s->original_vertex_count)
            return hw_fail(HW_FORMAT, "vertex %u is a copy of %u", v, s->source[v]);
    return HW_OK;
}

static hw_status check_collapse(const hw_progressive_source *s, uint32_t i)
{
    const hw_progressive_collapse *c = &s->collapses[i];
    bool one = c->faces[1] == HW_NO_INDEX;
    if (c->kept >= s->vertex_count || c->removed >= s->vertex_count || c->kept == c->removed ||
        c->faces[0] >= s->face_count || (!one && c->faces[1] >= s->face_count) ||
        c->faces[0] == c->faces[1])
        return hw_fail(HW_FORMAT, "collapse %u: its numbers are out of range", i);
    return HW_OK;
}

// Batches from coarse to fine, which is from last to first; and that each is a matching.
static hw_status number_batches(maker *m)
{
    const hw_progressive_source *s = m->s;
    uint32_t end = s->collapse_count, batches = s->batch_count ? s->batch_count : end;
    for (uint32_t b = 0; b < batches; b++) {
        uint32_t count = s->batch_count ? s->batches[batches - 1 - b] : 1;
        for (uint32_t i = end - count; i < end; i++) {
            const hw_progressive_collapse *c = &s->collapses[i];
            HW_TRY(check_collapse(s, i));
            if (m->removed_at[c->removed] != HW_NO_INDEX)
                return hw_fail(HW_FORMAT, "collapse %u: vertex %u is removed again", i, c->removed);
            if (m->mark[c->kept] == b + 1 || m->mark[c->removed] == b + 1)
                return hw_fail(HW_FORMAT, "collapse %u depends on another of its batch", i);
            m->mark[c->kept] = m->mark[c->removed] = b + 1;
            m->removed_at[c->removed] = i;
            m->batch_of[i] = b;
        }
        end -= count;
    }
    return HW_OK;
}

// Alive after collapse i, seen from the fine side.
static bool alive_after(const maker *m, uint32_t vertex, uint32_t collapse)
{
    return vertex < m->s->vertex_count && m->removed_at[vertex] > collapse;
}

static bool is_triangle(const uint32_t v[3])
{
    return v[0] != v[1] && v[1] != v[2] && v[2] != v[0];
}

static hw_status start(maker *m)
{
    const hw_progressive_source *s = m->s;
    for (uint32_t v = 0; v < s->vertex_count; v++) {
        if (m->removed_at[v] != HW_NO_INDEX)
            continue;
        if (!hw_position_grid_holds(&m->p->info.grid, s->positions[v]))
            return hw_fail(HW_FORMAT, "vertex %u is not on the grid", v);
        hw_position_grid_encode(&m->p->info.grid, s->positions[v], m->codes[v]);
    }
    for (uint32_t f = 0; f < s->face_count; f++) {
        memcpy(m->corners[f], s->faces[f], sizeof m->corners[f]);
        if (s->faces[f][0] == HW_NO_INDEX)
            continue;
        for (int i = 0; i < 3; i++) {
            uint32_t v = s->faces[f][i];
            if (v >= s->vertex_count || m->removed_at[v] != HW_NO_INDEX ||
                !is_triangle(s->faces[f]))
                return hw_fail(HW_FORMAT, "face %u is none at the end", f);
            m->used[v] = 1;
        }
    }
    return HW_OK;
}

static hw_status undo_positions(maker *m, uint32_t i)
{
    const hw_progressive_collapse *c = &m->s->collapses[i];
    const hw_position_grid *grid = &m->p->info.grid;
    int32_t merged[3];
    if (!hw_position_grid_holds(grid, c->merged) || !hw_position_grid_holds(grid, c->kept_before) ||
        !hw_position_grid_holds(grid, c->removed_before))
        return hw_fail(HW_FORMAT, "collapse %u: a position is not on the grid", i);
    hw_position_grid_encode(grid, c->merged, merged);
    if (memcmp(merged, m->codes[c->kept], sizeof merged) != 0)
        return hw_fail(HW_FORMAT, "collapse %u: vertex %u was elsewhere after it", i, c->kept);
    hw_position_grid_encode(grid, c->kept_before, m->codes[c->kept]);
    hw_position_grid_encode(grid, c->removed_before, m->codes[c->removed]);
    return HW_OK;
}

static hw_status undo_faces(maker *m, uint32_t i)
{
    const hw_progressive_collapse *c = &m->s->collapses[i];
    for (uint32_t k = 0; k < c->corner_count; k++) {
        uint32_t corner = m->s->corners[c->first_corner + k];
        if (corner / 3 >= m->s->face_count || m->corners[corner / 3][0] == HW_NO_INDEX ||
            m->corners[corner / 3][corner % 3] != c->kept)
            return hw_fail(HW_FORMAT, "collapse %u: corner %u is not of its vertex", i, corner);
        m->corners[corner / 3][corner % 3] = c->removed;
    }
    for (int k = 0; k < 2 && c->faces[k] != HW_NO_INDEX; k++) {
        const uint32_t *face = c->face_corners[k];
        uint32_t ends = 0;
        if (m->corners[c->faces[k]][0] != HW_NO_INDEX)
            return hw_fail(HW_FORMAT, "collapse %u: face %u is still there", i, c->faces[k]);
        for (int j = 0; j < 3; j++) {
            if (face[j] != c->removed && !alive_after(m, face[j], i))
                return hw_fail(HW_FORMAT, "collapse %u: face %u has no vertices", i, c->faces[k]);
            ends += face[j] == c->kept || face[j] == c->removed;
            m->used[face[j]] = 1;
        }
        if (ends != 2 || !is_triangle(face))
            return hw_fail(HW_FORMAT, "collapse %u: face %u is not at its edge", i, c->faces[k]);
        memcpy(m->corners[c->faces[k]], face, sizeof *m->corners);
    }
    return HW_OK;
}

// Plays the collapses backwards; codes and corners are then those of the finest level.
static hw_status play(maker *m)
{
    for (uint32_t i = m->s->collapse_count; i-- > 0;) {
        if (!alive_after(m, m->s->collapses[i].kept, i))
            return hw_fail(HW_FORMAT, "collapse %u: vertex %u is not there", i,
                           m->s->collapses[i].kept);
        HW_TRY(undo_positions(m, i));
        HW_TRY(undo_faces(m, i));
    }
    return HW_OK;
}

// --- Numbers -------------------------------------------------------------------------------------

static void number_base(maker *m)
{
    const hw_progressive_source *s = m->s;
    uint32_t vertices = 0, faces = 0;
    memset(m->vertex_map, 0xff, s->vertex_count * sizeof *m->vertex_map);
    memset(m->face_map, 0xff, s->face_count * sizeof *m->face_map);
    for (uint32_t f = 0; f < s->face_count; f++) {
        if (s->faces[f][0] == HW_NO_INDEX)
            continue;
        m->face_map[f] = faces++;
        for (int i = 0; i < 3; i++)
            if (m->vertex_map[s->faces[f][i]] == HW_NO_INDEX)
                m->vertex_map[s->faces[f][i]] = vertices++;
    }
    for (uint32_t v = 0; v < s->vertex_count; v++)
        if (m->used[v] && m->removed_at[v] == HW_NO_INDEX && m->vertex_map[v] == HW_NO_INDEX)
            m->vertex_map[v] = vertices++;
    m->p->info.base_vertex_count = vertices;
    m->p->info.base_face_count = faces;
}

static int compare_keys(const void *a, const void *b)
{
    const uint64_t *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

// Within a batch records go by their kept vertices: rising numbers are short to write, and no
// vertex can be there twice.
static void number_records(maker *m)
{
    const hw_progressive_source *s = m->s;
    hw_progressive *p = m->p;
    uint32_t end = s->collapse_count, record = 0;
    uint32_t batches = s->batch_count ? s->batch_count : end;
    for (uint32_t b = 0; b < batches; b++) {
        uint32_t count = s->batch_count ? s->batches[batches - 1 - b] : 1;
        for (uint32_t i = 0; i < count; i++)
            m->keys[i] =
                (uint64_t)m->vertex_map[s->collapses[end - 1 - i].kept] << 32 | (end - 1 - i);
        qsort(m->keys, count, sizeof *m->keys, compare_keys);
        if (s->batch_count)
            p->batch_first[b] = record;
        for (uint32_t i = 0; i < count; i++) {
            uint32_t c = (uint32_t)m->keys[i];
            p->kept[record] = (uint32_t)(m->keys[i] >> 32);
            m->record_of[c] = record;
            m->vertex_map[s->collapses[c].removed] = p->info.base_vertex_count + record++;
        }
        end -= count;
    }
    if (s->batch_count)
        p->batch_first[batches] = record;
    p->vertex_count = p->info.base_vertex_count + record;
}

static uint32_t index_of(const uint32_t face[3], uint32_t vertex)
{
    return face[0] == vertex ? 0 : face[1] == vertex ? 1 : 2;
}

// Whether the face runs from kept to removed. It lies clockwise of the edge, seen from `kept`.
static bool runs_along(const hw_progressive_collapse *c, int k)
{
    const uint32_t *face = c->face_corners[k];
    return face[(index_of(face, c->kept) + 1) % 3] == c->removed;
}

// Faces of a record: first the one that runs against the edge. Each begins at `kept`.
static void number_faces(maker *m)
{
    hw_progressive *p = m->p;
    const hw_progressive_source *s = m->s;
    uint32_t faces = p->info.base_face_count;
    for (uint32_t i = 0; i < s->collapse_count; i++)
        m->fill[m->record_of[i]] = i;
    for (uint32_t r = 0; r < s->collapse_count; r++) {
        const hw_progressive_collapse *c = &s->collapses[m->fill[r]];
        bool two = c->faces[1] != HW_NO_INDEX;
        int first = two && runs_along(c, 0) && !runs_along(c, 1);
        p->first_face[r] = faces;
        m->face_map[c->faces[first]] = faces++;
        m->turns[c->faces[first]] = (uint8_t)index_of(c->face_corners[first], c->kept);
        if (!two)
            continue;
        m->face_map[c->faces[!first]] = faces++;
        m->turns[c->faces[!first]] = (uint8_t)index_of(c->face_corners[!first], c->kept);
    }
    p->first_face[s->collapse_count] = p->face_count = faces;
}

static uint32_t canonical_corner(const maker *m, uint32_t corner)
{
    uint32_t f = corner / 3;
    return 3 * m->face_map[f] + (corner % 3 + 3 - m->turns[f]) % 3;
}

// The record of this batch whose removed vertex corner j of collapse i's face k has, once all of
// the batch is applied, without that the corner was on the list of that record; else none.
static uint32_t extra_record(const maker *m, uint32_t i, int k, int j)
{
    uint32_t by = m->removed_at[m->s->collapses[i].face_corners[k][j]];
    if (by == HW_NO_INDEX || by < i || m->batch_of[by] != m->batch_of[i])
        return HW_NO_INDEX;
    return m->record_of[by];
}

// Lists of moved corners: those that the recorder moved, and those of faces that it took away
// before it came to that collapse.
static hw_status list_moved(maker *m)
{
    hw_progressive *p = m->p;
    const hw_progressive_source *s = m->s;
    uint32_t *count = p->first_moved, sum = 0;
    for (uint32_t i = 0; i < s->collapse_count; i++) {
        const hw_progressive_collapse *c = &s->collapses[i];
        count[m->record_of[i]] += c->corner_count;
        for (int k = 0; k < 6; k++)
            if (c->faces[k / 3] != HW_NO_INDEX && extra_record(m, i, k / 3, k % 3) != HW_NO_INDEX)
                count[extra_record(m, i, k / 3, k % 3)]++;
    }
    for (uint32_t r = 0; r <= s->collapse_count; r++) {
        uint32_t n = count[r];
        count[r] = sum;
        if (r < s->collapse_count)
            m->fill[r] = sum;
        sum += n;
    }
    HW_TRY(HW_NEW(&p->moved, sum));
    for (uint32_t i = 0; i < s->collapse_count; i++) {
        const hw_progressive_collapse *c = &s->collapses[i];
        for (uint32_t k = 0; k < c->corner_count; k++)
            p->moved[m->fill[m->record_of[i]]++] =
                canonical_corner(m, s->corners[c->first_corner + k]);
        for (int k = 0; k < 6; k++)
            if (c->faces[k / 3] != HW_NO_INDEX && extra_record(m, i, k / 3, k % 3) != HW_NO_INDEX)
                p->moved[m->fill[extra_record(m, i, k / 3, k % 3)]++] =
                    canonical_corner(m, 3 * c->faces[k / 3] + (uint32_t)k % 3);
    }
    return HW_OK;
}

static void put_deltas(maker *m)
{
    for (uint32_t i = 0; i < m->s->collapse_count; i++) {
        int32_t fine[3], coarse[3];
        hw_position_grid_encode(&m->p->info.grid, m->s->collapses[i].kept_before, fine);
        hw_position_grid_encode(&m->p->info.grid, m->s->collapses[i].merged, coarse);
        for (int k = 0; k < 3; k++)
            m->p->deltas[m->record_of[i]][k] = (int32_t)((uint32_t)fine[k] - (uint32_t)coarse[k]);
    }
}

// --- The finest level ----------------------------------------------------------------------------

static void number_loose(maker *m)
{
    hw_progressive *p = m->p;
    const hw_progressive_source *s = m->s;
    for (uint32_t v = 0; v < s->original_vertex_count; v++)
        if (m->vertex_map[v] == HW_NO_INDEX)
            m->vertex_map[v] = p->vertex_count + p->info.loose_vertex_count++;
    for (uint32_t v = s->original_vertex_count; v < s->vertex_count; v++)
        p->info.copy_count += m->vertex_map[v] != HW_NO_INDEX;
    p->info.loose_face_count = s->loose_face_count;
}

static int compare_copies(const void *a, const void *b)
{
    const uint32_t *x = a, *y = b;
    return (x[0] > y[0]) - (x[0] < y[0]);
}

// Copies that no face ever used are gone.
static hw_status put_finest(maker *m)
{
    hw_progressive *p = m->p;
    const hw_progressive_source *s = m->s;
    uint32_t n = 0;
    HW_TRY(HW_NEW(&p->codes, hw_progressive_all_vertices(p)));
    HW_TRY(HW_NEW(&p->corners, 3 * (size_t)p->face_count));
    HW_TRY(HW_NEW(&p->copies, p->info.copy_count));
    HW_TRY(HW_NEW(&p->loose_faces, s->loose_face_count));
    for (uint32_t v = 0; v < s->vertex_count; v++)
        if (m->vertex_map[v] != HW_NO_INDEX)
            memcpy(p->codes[m->vertex_map[v]], m->codes[v], sizeof *p->codes);
    for (uint32_t i = 0; i < 3 * s->face_count; i++)
        if (m->face_map[i / 3] != HW_NO_INDEX)
            p->corners[canonical_corner(m, i)] = m->vertex_map[m->corners[i / 3][i % 3]];
    for (uint32_t v = s->original_vertex_count; v < s->vertex_count; v++) {
        if (m->vertex_map[v] == HW_NO_INDEX)
            continue;
        p->copies[n][0] = m->vertex_map[v];
        p->copies[n++][1] = m->vertex_map[s->source[v]];
    }
    if (n > 0)
        qsort(p->copies, n, sizeof *p->copies, compare_copies);
    for (uint32_t i = 0; i < s->loose_face_count; i++)
        for (int k = 0; k < 3; k++) {
            if (s->loose_faces[i][k] >= s->original_vertex_count)
                return hw_fail(HW_FORMAT, "loose face %u has no vertices of the original", i);
            p->loose_faces[i][k] = m->vertex_map[s->loose_faces[i][k]];
        }
    return HW_OK;
}

static void order_vertices(maker *m)
{
    hw_progressive *p = m->p;
    uint32_t all = hw_progressive_all_vertices(p), n = 0;
    // vertex_order is first the inverse of vertex_map, then without copies.
    memset(p->vertex_order, 0xff, all * sizeof *p->vertex_order);
    for (uint32_t v = 0; v < m->s->original_vertex_count; v++)
        p->vertex_order[m->vertex_map[v]] = v;
    for (uint32_t v = 0; v < all; v++)
        if (p->vertex_order[v] != HW_NO_INDEX)
            p->vertex_order[n++] = p->vertex_order[v];
}

static hw_status order_faces(maker *m)
{
    hw_progressive *p = m->p;
    const hw_progressive_source *s = m->s;
    uint32_t total = hw_progressive_finest_faces(p), next = 0;
    uint8_t *taken = NULL;
    hw_status status = HW_NEW(&taken, total);
    for (uint32_t f = 0; status == HW_OK && f < s->face_count; f++) {
        if (m->face_map[f] == HW_NO_INDEX)
            continue;
        uint32_t number = s->face_numbers ? s->face_numbers[f] : f;
        if (number >= total || taken[number]) {
            status = hw_fail(HW_FORMAT, "face %u of %u has number %u", f, total, number);
            break;
        }
        taken[number] = 1;
        p->face_order[m->face_map[f]] = number;
        p->face_turns[m->face_map[f]] = (uint8_t)((3 - m->turns[f]) % 3);
    }
    for (uint32_t i = 0; status == HW_OK && i < s->loose_face_count; i++) {
        while (taken[next])
            next++;
        p->face_order[p->face_count + i] = next++;
    }
    hw_free(taken);
    return status;
}

static hw_status put_order(maker *m)
{
    hw_progressive *p = m->p;
    if (!p->info.keep_order)
        return HW_OK;
    HW_TRY(HW_NEW(&p->vertex_order, hw_progressive_all_vertices(p)));
    HW_TRY(HW_NEW(&p->face_order, hw_progressive_finest_faces(p)));
    HW_TRY(HW_NEW(&p->face_turns, p->face_count));
    order_vertices(m);
    return order_faces(m);
}

static hw_status allocate(maker *m)
{
    const hw_progressive_source *s = m->s;
    hw_progressive *p = m->p;
    size_t v = s->vertex_count, f = s->face_count, n = s->collapse_count;
    HW_TRY(HW_NEW(&m->removed_at, v));
    HW_TRY(HW_NEW(&m->corners, f));
    HW_TRY(HW_NEW(&m->codes, v));
    HW_TRY(HW_NEW(&m->used, v));
    HW_TRY(HW_NEW(&m->mark, v));
    HW_TRY(HW_NEW(&m->vertex_map, v));
    HW_TRY(HW_NEW(&m->face_map, f));
    HW_TRY(HW_NEW(&m->turns, f));
    HW_TRY(HW_NEW(&m->record_of, n));
    HW_TRY(HW_NEW(&m->batch_of, n));
    HW_TRY(HW_NEW(&m->fill, n));
    HW_TRY(HW_NEW(&m->keys, n));
    HW_TRY(HW_NEW(&p->kept, n));
    HW_TRY(HW_NEW(&p->deltas, n));
    HW_TRY(HW_NEW(&p->first_face, n + 1));
    HW_TRY(HW_NEW(&p->first_moved, n + 1));
    HW_TRY(HW_NEW(&p->batch_first, (size_t)s->batch_count + 1));
    HW_TRY(HW_NEW(&p->applied, n / 64 + 1));
    memset(m->removed_at, 0xff, v * sizeof *m->removed_at);
    return HW_OK;
}

static void maker_free(maker *m)
{
    hw_free(m->removed_at);
    hw_free(m->corners);
    hw_free(m->codes);
    hw_free(m->used);
    hw_free(m->mark);
    hw_free(m->vertex_map);
    hw_free(m->face_map);
    hw_free(m->turns);
    hw_free(m->record_of);
    hw_free(m->batch_of);
    hw_free(m->fill);
    hw_free(m->keys);
}

static hw_status make(maker *m)
{
    HW_TRY(check_counts(m->s));
    HW_TRY(allocate(m));
    HW_TRY(number_batches(m));
    HW_TRY(start(m));
    HW_TRY(play(m));
    number_base(m);
    number_records(m);
    number_faces(m);
    HW_TRY(list_moved(m));
    put_deltas(m);
    number_loose(m);
    HW_TRY(put_finest(m));
    HW_TRY(put_order(m));
    hw_progressive_mark_all(m->p);
    return hw_progressive_check_finest(m->p);
}

hw_status hw_progressive_create(hw_progressive **out, const hw_position_grid *grid,
                                const hw_progressive_source *source, bool keep_order)
{
    maker m = {.s = source};
    *out = NULL;
    if (!hw_position_grid_valid(grid))
        return hw_fail(HW_FORMAT, "no grid of positions");
    HW_TRY(HW_NEW(&m.p, 1));
    m.p->info = (hw_progressive_info){.grid = *grid,
                                      .record_count = source->collapse_count,
                                      .batch_count = source->batch_count,
                                      .complete = true,
                                      .keep_order = keep_order};
    hw_status status = make(&m);
    maker_free(&m);
    if (status != HW_OK) {
        hw_progressive_destroy(m.p);
        return status;
    }
    *out = m.p;
    return HW_OK;
}
