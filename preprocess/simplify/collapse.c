#include "collapse.h"
#include "alloc.h"
#include "metric.h"
#include "split.h"
#include <float.h>
#include <math.h>
#include <string.h>

// Lazy queue. A collapse bumps the `generation` of the merged vertex, which drops its old entries
// (new ones are pushed), and the `touched` count of its neighbours, whose entries are evaluated
// again only when they come to the top.
typedef struct queue_entry {
    float cost;
    uint32_t a, b;
    uint32_t generation, touched; // sums over both ends when evaluated
} queue_entry;

struct hw_collapse_queue {
    queue_entry *heap;
    size_t count, capacity;
    uint32_t *generation, *touched; // per vertex
    uint32_t *mark;                 // per vertex scratch
    uint32_t mark_value;
    bool filled;
};

// ---- heap ------------------------------------------------------------------------------------

static bool entry_before(const queue_entry *x, const queue_entry *y)
{
    if (x->cost != y->cost)
        return x->cost < y->cost;
    return x->a != y->a ? x->a < y->a : x->b < y->b; // ties must not depend on history
}

static void heap_sift_down(queue_entry *heap, size_t count, size_t at, queue_entry entry)
{
    for (;;) {
        size_t child = 2 * at + 1;
        if (child >= count)
            break;
        if (child + 1 < count && entry_before(&heap[child + 1], &heap[child]))
            child++;
        if (!entry_before(&heap[child], &entry))
            break;
        heap[at] = heap[child];
        at = child;
    }
    heap[at] = entry;
}

static hw_status heap_push(struct hw_collapse_queue *q, queue_entry entry)
{
    HW_TRY(HW_RESERVE(&q->heap, &q->capacity, q->count + 1));
    size_t at = q->count++;
    while (at > 0 && entry_before(&entry, &q->heap[(at - 1) / 2])) {
        q->heap[at] = q->heap[(at - 1) / 2];
        at = (at - 1) / 2;
    }
    q->heap[at] = entry;
    return HW_OK;
}

static queue_entry heap_pop(struct hw_collapse_queue *q)
{
    queue_entry top = q->heap[0];
    queue_entry last = q->heap[--q->count];
    if (q->count > 0)
        heap_sift_down(q->heap, q->count, 0, last);
    return top;
}

static void heap_build(struct hw_collapse_queue *q)
{
    for (size_t i = q->count / 2; i-- > 0;)
        heap_sift_down(q->heap, q->count, i, q->heap[i]);
}

// ---- connectivity ----------------------------------------------------------------------------

static bool face_has(const uint32_t face[3], uint32_t v)
{
    return face[0] == v || face[1] == v || face[2] == v;
}

static uint32_t shared_faces(const hw_collapser *c, uint32_t a, uint32_t b)
{
    uint32_t n = 0;
    for (uint32_t k = c->first_corner[a]; k != HW_NO_VERTEX; k = c->next_corner[k])
        n += face_has(c->faces[k / 3], b);
    return n;
}

uint32_t hw_collapser_star(const hw_collapser *c, uint32_t a, uint32_t b, uint32_t *faces,
                           uint32_t capacity)
{
    uint32_t n = 0;
    for (uint32_t k = c->first_corner[a]; k != HW_NO_VERTEX; k = c->next_corner[k]) {
        if (n < capacity)
            faces[n] = k / 3;
        n++;
    }
    if (b == HW_NO_VERTEX)
        return n;
    for (uint32_t k = c->first_corner[b]; k != HW_NO_VERTEX; k = c->next_corner[k]) {
        if (face_has(c->faces[k / 3], a))
            continue;
        if (n < capacity)
            faces[n] = k / 3;
        n++;
    }
    return n;
}

// Gives every neighbour of v a fresh mark; returns the mark.
static uint32_t mark_neighbours(const hw_collapser *c, uint32_t v)
{
    struct hw_collapse_queue *q = c->queue;
    uint32_t value = ++q->mark_value;
    for (uint32_t k = c->first_corner[v]; k != HW_NO_VERTEX; k = c->next_corner[k])
        for (int i = 0; i < 3; i++)
            q->mark[c->faces[k / 3][i]] = value;
    return value;
}

// The link condition: the ends of an edge share exactly the vertices opposite to it, and two border
// vertices are joined only along the border; else the collapse would pinch the surface.
static bool topology_allows(const hw_collapser *c, uint32_t a, uint32_t b, uint32_t shared)
{
    struct hw_collapse_queue *q = c->queue;
    uint32_t mark = mark_neighbours(c, a);
    uint32_t common = 0;
    for (uint32_t k = c->first_corner[b]; k != HW_NO_VERTEX; k = c->next_corner[k])
        for (int i = 0; i < 3; i++) {
            uint32_t v = c->faces[k / 3][i];
            if (v != a && v != b && q->mark[v] == mark) {
                q->mark[v] = 0;
                common++;
            }
        }
    return common == shared;
}

static void face_normal(const double *p, const double *q, const double *r, double n[3])
{
    double e[3], f[3];
    for (int i = 0; i < 3; i++) {
        e[i] = q[i] - p[i];
        f[i] = r[i] - p[i];
    }
    n[0] = e[1] * f[2] - e[2] * f[1];
    n[1] = e[2] * f[0] - e[0] * f[2];
    n[2] = e[0] * f[1] - e[1] * f[0];
}

// Face flip: no remaining face round v may turn by more than about 78 degrees (cosine 0.2) or lose
// its area.
static bool faces_stay(const hw_collapser *c, uint32_t v, uint32_t other, const double position[3])
{
    for (uint32_t k = c->first_corner[v]; k != HW_NO_VERTEX; k = c->next_corner[k]) {
        const uint32_t *face = c->faces[k / 3];
        if (face_has(face, other))
            continue;
        const double *p = c->positions[face[k % 3]];
        const double *q = c->positions[face[(k + 1) % 3]];
        const double *r = c->positions[face[(k + 2) % 3]];
        double before[3], after[3];
        face_normal(p, q, r, before);
        face_normal(position, q, r, after);
        if (c->upright && before[2] > 0 && after[2] <= 0)
            return false;
        double bb = 0, aa = 0, ab = 0;
        for (int i = 0; i < 3; i++) {
            bb += before[i] * before[i];
            aa += after[i] * after[i];
            ab += before[i] * after[i];
        }
        if (ab <= 0.2 * sqrt(aa * bb) || aa <= 1e-12 * bb)
            return false;
    }
    return true;
}

// ---- creation --------------------------------------------------------------------------------

static void link_faces(hw_collapser *c, const uint32_t *indices, uint32_t face_count)
{
    memset(c->first_corner, 0xff, c->vertex_count * sizeof *c->first_corner);
    for (uint32_t f = 0; f < face_count; f++) {
        const uint32_t *in = indices + 3 * (size_t)f;
        bool good = in[0] < c->vertex_count && in[1] < c->vertex_count && in[2] < c->vertex_count &&
                    in[0] != in[1] && in[1] != in[2] && in[2] != in[0];
        for (uint32_t i = 0; i < 3; i++) {
            c->faces[f][i] = good ? in[i] : HW_NO_VERTEX;
            if (!good)
                continue;
            c->next_corner[3 * f + i] = c->first_corner[in[i]];
            c->first_corner[in[i]] = 3 * f + i;
        }
        c->live_faces += good;
    }
}

// Marks the ends of open edges; locks the ends of edges with more than two faces, or whose two
// faces disagree in winding.
static void examine_edges(hw_collapser *c)
{
    for (uint32_t f = 0; f < c->face_count; f++) {
        if (c->faces[f][0] == HW_NO_VERTEX)
            continue;
        for (int i = 0; i < 3; i++) {
            uint32_t a = c->faces[f][i], b = c->faces[f][(i + 1) % 3];
            uint32_t same = 0, all = 0;
            for (uint32_t k = c->first_corner[a]; k != HW_NO_VERTEX; k = c->next_corner[k]) {
                const uint32_t *face = c->faces[k / 3];
                all += face_has(face, b);
                same += face[(k + 1) % 3] == b;
            }
            if (all == 1)
                c->border[a] = c->border[b] = true;
            if (all > 2 || same > 1)
                c->locked[a] = c->locked[b] = true;
        }
    }
}

hw_status hw_collapser_create(const double (*positions)[3], uint32_t vertex_count,
                              const uint32_t *indices, uint32_t face_count, const bool *locked,
                              hw_complex_edges complex, hw_collapser **out)
{
    hw_status status;
    hw_collapser *c = NULL;
    hw_split split = {0};
    *out = NULL;
    if (face_count > UINT32_MAX / 3 - 1)
        return hw_fail(HW_LIMIT, "a mesh of %u faces is too large to simplify", face_count);
    HW_GO(HW_NEW(&c, 1));
    if (complex == HW_COMPLEX_SPLIT) {
        HW_GO(hw_split_sheets(positions, vertex_count, indices, face_count, &split));
        indices = split.indices;
    }
    c->vertex_count = split.indices ? split.vertex_count : vertex_count;
    c->face_count = face_count;
    HW_GO(HW_NEW(&c->positions, c->vertex_count));
    HW_GO(HW_NEW(&c->source, c->vertex_count));
    HW_GO(HW_NEW(&c->faces, face_count));
    HW_GO(HW_NEW(&c->first_corner, c->vertex_count));
    HW_GO(HW_NEW(&c->next_corner, 3 * (size_t)face_count));
    HW_GO(HW_NEW(&c->locked, c->vertex_count));
    HW_GO(HW_NEW(&c->border, c->vertex_count));
    HW_GO(HW_NEW(&c->queue, 1));
    HW_GO(HW_NEW(&c->queue->generation, c->vertex_count));
    HW_GO(HW_NEW(&c->queue->touched, c->vertex_count));
    HW_GO(HW_NEW(&c->queue->mark, c->vertex_count));
    for (uint32_t v = 0; v < c->vertex_count; v++) {
        c->source[v] = split.indices ? split.source[v] : v;
        memcpy(c->positions[v], positions[c->source[v]], sizeof *positions);
        c->locked[v] = locked && locked[c->source[v]];
    }
    link_faces(c, indices, face_count);
    examine_edges(c);
    *out = c;
    c = NULL;
out:
    hw_split_free(&split);
    hw_collapser_destroy(c);
    return status;
}

void hw_collapser_destroy(hw_collapser *c)
{
    if (!c)
        return;
    if (c->queue) {
        hw_free(c->queue->heap);
        hw_free(c->queue->generation);
        hw_free(c->queue->touched);
        hw_free(c->queue->mark);
        hw_free(c->queue);
    }
    hw_free(c->positions);
    hw_free(c->source);
    hw_free(c->faces);
    hw_free(c->first_corner);
    hw_free(c->next_corner);
    hw_free(c->locked);
    hw_free(c->border);
    hw_free(c);
}

// ---- running ---------------------------------------------------------------------------------

static queue_entry make_entry(const hw_collapser *c, const hw_metric *metric, uint32_t a,
                              uint32_t b)
{
    if (a > b) {
        uint32_t t = a;
        a = b;
        b = t;
    }
    const struct hw_collapse_queue *q = c->queue;
    hw_collapse collapse = {.cost = INFINITY};
    if (!(c->locked[a] && c->locked[b]))
        metric->evaluate(metric->context, c, a, b, &collapse);
    return (queue_entry){(float)collapse.cost, a, b, q->generation[a] + q->generation[b],
                         q->touched[a] + q->touched[b]};
}

static hw_status fill_queue(hw_collapser *c, const hw_metric *metric)
{
    struct hw_collapse_queue *q = c->queue;
    HW_TRY(HW_RESERVE(&q->heap, &q->capacity, (size_t)c->live_faces * 3 / 2 + 16));
    for (uint32_t v = 0; v < c->vertex_count; v++) {
        if (c->first_corner[v] == HW_NO_VERTEX)
            continue;
        uint32_t seen = ++q->mark_value;
        for (uint32_t k = c->first_corner[v]; k != HW_NO_VERTEX; k = c->next_corner[k])
            for (int i = 0; i < 3; i++) {
                uint32_t w = c->faces[k / 3][i];
                if (w <= v || q->mark[w] == seen)
                    continue;
                q->mark[w] = seen;
                queue_entry entry = make_entry(c, metric, v, w);
                if (!(entry.cost < INFINITY))
                    continue;
                HW_TRY(HW_RESERVE(&q->heap, &q->capacity, q->count + 1));
                q->heap[q->count++] = entry;
            }
    }
    heap_build(q);
    q->filled = true;
    return HW_OK;
}

// Whether the edge belongs to a lone closed tetrahedron, which vanishes with it.
static bool whole_component(const hw_collapser *c, uint32_t kept, uint32_t removed, uint32_t shared)
{
    return shared == 2 && !c->border[kept] && !c->border[removed] && !c->locked[kept] &&
           !c->locked[removed] && hw_collapser_star(c, kept, removed, NULL, 0) == 4 &&
           hw_collapser_star(c, kept, HW_NO_VERTEX, NULL, 0) == 3 &&
           hw_collapser_star(c, removed, HW_NO_VERTEX, NULL, 0) == 3;
}

static bool collapse_valid(const hw_collapser *c, uint32_t kept, uint32_t removed,
                           const hw_collapse *collapse)
{
    if (c->locked[removed])
        return false;
    if (c->locked[kept] &&
        memcmp(collapse->position, c->positions[kept], sizeof collapse->position) != 0)
        return false;
    uint32_t shared = shared_faces(c, kept, removed);
    if (shared == 0 || shared > 2 || !topology_allows(c, kept, removed, shared))
        return false;
    if (shared == 2 && c->border[kept] && c->border[removed])
        return false;
    if (whole_component(c, kept, removed, shared))
        return c->live_faces > 4; // a closed speck may vanish, but not the whole mesh
    return faces_stay(c, kept, removed, collapse->position) &&
           faces_stay(c, removed, kept, collapse->position);
}

static void unlink_corner(hw_collapser *c, uint32_t v, uint32_t face)
{
    uint32_t *link = &c->first_corner[v];
    while (*link / 3 != face)
        link = &c->next_corner[*link];
    *link = c->next_corner[*link];
}

static void remove_face(hw_collapser *c, uint32_t face)
{
    uint32_t *t = c->faces[face];
    for (int i = 0; i < 3; i++)
        unlink_corner(c, t[i], face);
    t[0] = t[1] = t[2] = HW_NO_VERTEX;
    c->live_faces--;
}

// Removes a small component, all of whose faces touch a or b.
static void remove_component(hw_collapser *c, uint32_t a, uint32_t b)
{
    while (c->first_corner[a] != HW_NO_VERTEX)
        remove_face(c, c->first_corner[a] / 3);
    while (c->first_corner[b] != HW_NO_VERTEX)
        remove_face(c, c->first_corner[b] / 3);
}

static void carry_out(hw_collapser *c, uint32_t kept, uint32_t removed, const double position[3])
{
    if (whole_component(c, kept, removed, shared_faces(c, kept, removed))) {
        remove_component(c, kept, removed);
        return;
    }
    // Faces on the edge vanish.
    for (uint32_t k = c->first_corner[removed], next; k != HW_NO_VERTEX; k = next) {
        next = c->next_corner[k];
        if (face_has(c->faces[k / 3], kept))
            remove_face(c, k / 3);
    }
    // The others move over to the kept vertex.
    uint32_t last = HW_NO_VERTEX;
    for (uint32_t k = c->first_corner[removed]; k != HW_NO_VERTEX; k = c->next_corner[k]) {
        c->faces[k / 3][k % 3] = kept;
        last = k;
    }
    if (last != HW_NO_VERTEX) {
        c->next_corner[last] = c->first_corner[kept];
        c->first_corner[kept] = c->first_corner[removed];
    }
    c->first_corner[removed] = HW_NO_VERTEX;
    memcpy(c->positions[kept], position, sizeof c->positions[kept]);
    c->border[kept] |= c->border[removed];
}

// Requeues the edges of the merged vertex; those of its neighbours are only marked.
static hw_status requeue(hw_collapser *c, const hw_metric *metric, uint32_t v)
{
    struct hw_collapse_queue *q = c->queue;
    q->generation[v]++;
    uint32_t seen = ++q->mark_value;
    q->mark[v] = seen;
    for (uint32_t k = c->first_corner[v]; k != HW_NO_VERTEX; k = c->next_corner[k])
        for (int i = 0; i < 3; i++) {
            uint32_t w = c->faces[k / 3][i];
            if (q->mark[w] == seen)
                continue;
            q->mark[w] = seen;
            q->touched[w]++;
        }
    seen = ++q->mark_value;
    q->mark[v] = seen;
    for (uint32_t k = c->first_corner[v]; k != HW_NO_VERTEX; k = c->next_corner[k])
        for (int i = 0; i < 3; i++) {
            uint32_t w = c->faces[k / 3][i];
            if (q->mark[w] == seen)
                continue;
            q->mark[w] = seen;
            queue_entry entry = make_entry(c, metric, v, w);
            if (entry.cost < INFINITY)
                HW_TRY(heap_push(q, entry));
        }
    return HW_OK;
}

// A forbidden collapse may become possible when its neighbourhood has changed: it is tried again
// once the queue has reached twice its cost. Costs double each time, so that this ends (at
// infinity, or at the caller's limit).
static hw_status retry_later(struct hw_collapse_queue *q, queue_entry entry)
{
    float next = q->count > 0 ? q->heap[0].cost : entry.cost;
    entry.cost = 2 * fmaxf(entry.cost, next) + FLT_MIN;
    return entry.cost < INFINITY ? heap_push(q, entry) : HW_OK;
}

// Takes the top entry; collapses it if it is still current and allowed.
static hw_status step(hw_collapser *c, const hw_metric *metric)
{
    struct hw_collapse_queue *q = c->queue;
    queue_entry top = heap_pop(q);
    if (c->first_corner[top.a] == HW_NO_VERTEX || c->first_corner[top.b] == HW_NO_VERTEX ||
        top.generation != q->generation[top.a] + q->generation[top.b])
        return HW_OK;
    if (top.touched != q->touched[top.a] + q->touched[top.b]) {
        queue_entry entry = make_entry(c, metric, top.a, top.b);
        return entry.cost < INFINITY ? heap_push(q, entry) : HW_OK;
    }
    hw_collapse collapse = {.cost = INFINITY};
    metric->evaluate(metric->context, c, top.a, top.b, &collapse);
    uint32_t kept = collapse.kept, removed = kept == top.a ? top.b : top.a;
    if (!(collapse.cost < INFINITY))
        return HW_OK;
    if (!collapse_valid(c, kept, removed, &collapse))
        return retry_later(q, top);
    carry_out(c, kept, removed, collapse.position);
    if (metric->collapsed)
        metric->collapsed(metric->context, kept, removed);
    return requeue(c, metric, kept);
}

hw_status hw_collapser_run(hw_collapser *c, const hw_metric *metric,
                           const hw_collapse_limits *limits)
{
    if (!c->queue->filled)
        HW_TRY(fill_queue(c, metric));
    while (c->live_faces > limits->faces && c->queue->count > 0 &&
           c->queue->heap[0].cost <= limits->cost)
        HW_TRY(step(c, metric));
    return HW_OK;
}

uint32_t hw_collapser_extract(const hw_collapser *c, uint32_t *vertices, uint32_t *indices)
{
    struct hw_collapse_queue *q = c->queue;
    uint32_t vertex_count = 0;
    for (uint32_t v = 0; v < c->vertex_count; v++) {
        if (c->first_corner[v] == HW_NO_VERTEX)
            continue;
        q->mark[v] = vertex_count; // marks are scratch; mark_value is renewed below
        vertices[vertex_count++] = v;
    }
    size_t n = 0;
    for (uint32_t f = 0; f < c->face_count; f++)
        if (c->faces[f][0] != HW_NO_VERTEX)
            for (int i = 0; i < 3; i++)
                indices[n++] = q->mark[c->faces[f][i]];
    memset(q->mark, 0, c->vertex_count * sizeof *q->mark);
    q->mark_value = 0;
    return vertex_count;
}
