#include "collapse.h"
#include "collapse_queue.h"
#include "metric.h"
#include <float.h>
#include <math.h>
#include <string.h>

// ---- walks round vertices --------------------------------------------------------------------

uint32_t hw_collapser_edge_faces(const hw_collapser *c, uint32_t a, uint32_t b)
{
    uint32_t n = 0;
    for (uint32_t k = c->first_corner[a]; k != HW_NO_VERTEX; k = hw_next_corner(c, k))
        n += hw_face_has(c->faces[k / 4], b);
    return n;
}

uint32_t hw_collapser_degree(const hw_collapser *c, uint32_t v)
{
    uint32_t n = 0;
    for (uint32_t k = c->first_corner[v]; k != HW_NO_VERTEX; k = hw_next_corner(c, k))
        n++;
    return n;
}

// ---- validity --------------------------------------------------------------------------------

// The link condition: the ends of an edge share exactly the vertices opposite to it, and two border
// vertices are joined only along the border; else the collapse would pinch the surface (the test of
// GeMS 5, figure 6, made exact).
static bool topology_allows(const hw_collapser *c, uint32_t a, uint32_t b, uint32_t shared)
{
    hw_collapse_queue *q = c->queue;
    uint32_t mark = hw_collapse_queue_new_mark(q);
    for (uint32_t k = c->first_corner[a]; k != HW_NO_VERTEX; k = hw_next_corner(c, k))
        for (int i = 0; i < 3; i++)
            q->mark[c->faces[k / 4][i]] = mark;
    uint32_t common = 0;
    for (uint32_t k = c->first_corner[b]; k != HW_NO_VERTEX; k = hw_next_corner(c, k))
        for (int i = 0; i < 3; i++) {
            uint32_t v = c->faces[k / 4][i];
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

// Face flip: no remaining face round v may turn by more than about 78 degrees (cosine 0.2; GeMS
// allows 90) or lose its area.
static bool faces_stay(const hw_collapser *c, uint32_t v, uint32_t other, const double position[3])
{
    for (uint32_t k = c->first_corner[v]; k != HW_NO_VERTEX; k = hw_next_corner(c, k)) {
        const uint32_t *face = c->faces[k / 4];
        if (hw_face_has(face, other))
            continue;
        const double *p = c->positions[face[k % 4]];
        const double *q = c->positions[face[hw_next_place[k % 4]]];
        const double *r = c->positions[face[hw_last_place[k % 4]]];
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

// Whether the edge belongs to a lone closed tetrahedron, which vanishes with it.
static bool whole_component(const hw_collapser *c, uint32_t kept, uint32_t removed, uint32_t shared)
{
    return shared == 2 && !c->border[kept] && !c->border[removed] && !c->locked[kept] &&
           !c->locked[removed] && hw_collapser_degree(c, kept) == 3 &&
           hw_collapser_degree(c, removed) == 3;
}

static bool collapse_valid(const hw_collapser *c, const hw_collapse *collapse)
{
    uint32_t kept = collapse->kept, removed = collapse->removed;
    if (c->locked[removed])
        return false;
    if (c->locked[kept] &&
        memcmp(collapse->position, c->positions[kept], sizeof collapse->position) != 0)
        return false;
    uint32_t shared = hw_collapser_edge_faces(c, kept, removed);
    if (shared == 0 || shared > 2 || !topology_allows(c, kept, removed, shared))
        return false;
    if (shared == 2 && c->border[kept] && c->border[removed])
        return false;
    if (whole_component(c, kept, removed, shared)) // a closed speck may vanish, not the whole mesh
        return !c->keep_components && c->live_faces > 4;
    if (shared == 1 && hw_collapser_degree(c, kept) == 1 && hw_collapser_degree(c, removed) == 1)
        return !c->keep_components && c->live_faces > 1; // a lone triangle, alike
    return faces_stay(c, kept, removed, collapse->position) &&
           faces_stay(c, removed, kept, collapse->position);
}

// ---- carrying out ----------------------------------------------------------------------------

static void unlink_corner(hw_collapser *c, uint32_t v, uint32_t face)
{
    uint32_t *link = &c->first_corner[v];
    while (*link / 4 != face)
        link = &c->faces[*link / 4][3 + *link % 4];
    *link = hw_next_corner(c, *link);
    c->live_vertices -= c->first_corner[v] == HW_NO_VERTEX;
}

static void remove_face(hw_collapser *c, uint32_t face)
{
    uint32_t *t = c->faces[face];
    for (int i = 0; i < 3; i++)
        unlink_corner(c, t[i], face);
    t[0] = t[1] = t[2] = HW_NO_VERTEX;
    c->live_faces--;
}

static void remove_faces_of(hw_collapser *c, uint32_t v)
{
    while (c->first_corner[v] != HW_NO_VERTEX)
        remove_face(c, c->first_corner[v] / 4);
}

static void carry_out(hw_collapser *c, const hw_collapse *collapse)
{
    uint32_t kept = collapse->kept, removed = collapse->removed;
    if (whole_component(c, kept, removed, hw_collapser_edge_faces(c, kept, removed))) {
        remove_faces_of(c, kept);
        remove_faces_of(c, removed);
        return;
    }
    if (c->observer)
        c->observer(c->observer_context, c, collapse);
    // Faces on the edge vanish.
    for (uint32_t k = c->first_corner[removed], next; k != HW_NO_VERTEX; k = next) {
        next = hw_next_corner(c, k);
        if (hw_face_has(c->faces[k / 4], kept))
            remove_face(c, k / 4);
    }
    // The others move over to the kept vertex.
    uint32_t last = HW_NO_VERTEX;
    for (uint32_t k = c->first_corner[removed]; k != HW_NO_VERTEX; k = hw_next_corner(c, k)) {
        c->faces[k / 4][k % 4] = kept;
        last = k;
    }
    if (last != HW_NO_VERTEX) {
        c->live_vertices -= c->first_corner[kept] != HW_NO_VERTEX;
        c->faces[last / 4][3 + last % 4] = c->first_corner[kept];
        c->first_corner[kept] = c->first_corner[removed];
    }
    c->first_corner[removed] = HW_NO_VERTEX;
    memcpy(c->positions[kept], collapse->position, sizeof c->positions[kept]);
    c->border[kept] |= c->border[removed];
}

// ---- running ---------------------------------------------------------------------------------

static double edge_cost(const hw_collapser *c, const hw_metric *metric, uint32_t a, uint32_t b)
{
    if (c->locked[a] && c->locked[b])
        return INFINITY;
    hw_collapse collapse;
    hw_metric_evaluate(metric, c, a, b, &collapse);
    return collapse.cost;
}

static hw_queue_entry make_entry(const hw_collapser *c, const hw_metric *metric, uint32_t a,
                                 uint32_t b)
{
    if (a > b) { // so that the cost does not depend on who asks
        uint32_t t = a;
        a = b;
        b = t;
    }
    return hw_collapse_queue_entry(c->queue, a, b, edge_cost(c, metric, a, b));
}

static hw_status push_finite(hw_collapse_queue *q, hw_queue_entry entry)
{
    return entry.cost < INFINITY ? hw_collapse_queue_push(q, entry) : HW_OK;
}

static hw_status fill_queue(hw_collapser *c, const hw_metric *metric)
{
    hw_collapse_queue *q = c->queue;
    uint64_t edges = ((uint64_t)c->live_faces * 3 + c->border_edges) / 2 + c->complex_edges;
    HW_TRY(hw_collapse_queue_reset(q, (uint32_t)(edges < UINT32_MAX / 2 ? edges : UINT32_MAX / 2)));
    for (uint32_t v = 0; v < c->vertex_count; v++) {
        uint32_t seen = hw_collapse_queue_new_mark(q);
        for (uint32_t k = c->first_corner[v]; k != HW_NO_VERTEX; k = hw_next_corner(c, k))
            for (int i = 0; i < 3; i++) {
                uint32_t w = c->faces[k / 4][i];
                if (w <= v || q->mark[w] == seen)
                    continue;
                q->mark[w] = seen;
                hw_queue_entry entry = make_entry(c, metric, v, w);
                if (!(entry.cost < INFINITY))
                    continue;
                if (q->count < q->capacity)
                    hw_collapse_queue_append(q, entry);
                else
                    return hw_fail(HW_INTERNAL, "more edges than were counted");
            }
    }
    hw_collapse_queue_order(q);
    q->filled = true;
    return HW_OK;
}

void hw_collapser_forget_queue(hw_collapser *c)
{
    c->queue->filled = false;
}

// Requeues the edges of the merged vertex; those of its neighbours are only marked.
static hw_status requeue(hw_collapser *c, const hw_metric *metric, uint32_t v)
{
    hw_collapse_queue *q = c->queue;
    q->generation[v]++;
    uint32_t seen = hw_collapse_queue_new_mark(q);
    q->mark[v] = seen;
    for (uint32_t k = c->first_corner[v]; k != HW_NO_VERTEX; k = hw_next_corner(c, k))
        for (int i = 0; i < 3; i++) {
            uint32_t w = c->faces[k / 4][i];
            if (q->mark[w] == seen)
                continue;
            q->mark[w] = seen;
            q->touched[w]++;
        }
    seen = hw_collapse_queue_new_mark(q);
    q->mark[v] = seen;
    for (uint32_t k = c->first_corner[v]; k != HW_NO_VERTEX; k = hw_next_corner(c, k))
        for (int i = 0; i < 3; i++) {
            uint32_t w = c->faces[k / 4][i];
            if (q->mark[w] == seen)
                continue;
            q->mark[w] = seen;
            HW_TRY(push_finite(q, make_entry(c, metric, v, w)));
        }
    return HW_OK;
}

// A forbidden collapse may become possible when its neighbourhood has changed: it is tried again
// once the queue has reached twice its cost. Costs double each time, so that this ends (at
// infinity, or at the caller's limit).
static hw_status retry_later(hw_collapse_queue *q, hw_queue_entry entry)
{
    float next = q->count > 0 ? q->heap[0].cost : entry.cost;
    entry.cost = 2 * fmaxf(entry.cost, next) + FLT_MIN;
    return push_finite(q, entry);
}

static bool limits_met(const hw_collapser *c, const hw_collapse_limits *limits)
{
    return c->live_faces <= limits->faces || c->live_vertices <= limits->vertices ||
           c->queue->count == 0 || c->queue->heap[0].cost > limits->cost;
}

// Takes the top entry and collapses it if it is still current and allowed. *merged is the vertex,
// HW_NO_VERTEX if nothing happened.
static hw_status step(hw_collapser *c, const hw_metric *metric, bool retry, uint32_t *merged)
{
    hw_collapse_queue *q = c->queue;
    hw_queue_entry top = hw_collapse_queue_pop(q);
    *merged = HW_NO_VERTEX;
    if (c->first_corner[top.a] == HW_NO_VERTEX || c->first_corner[top.b] == HW_NO_VERTEX ||
        hw_collapse_queue_is_old(q, &top))
        return HW_OK;
    if (hw_collapse_queue_is_touched(q, &top))
        return push_finite(q, make_entry(c, metric, top.a, top.b));
    hw_collapse collapse;
    hw_metric_evaluate(metric, c, top.a, top.b, &collapse);
    if (!(collapse.cost < INFINITY))
        return HW_OK;
    if (c->snap && !c->locked[collapse.kept])
        c->snap(c->snap_context, collapse.position);
    if (!collapse_valid(c, &collapse))
        return retry ? retry_later(q, top) : HW_OK;
    carry_out(c, &collapse);
    if (metric->collapsed)
        metric->collapsed(metric->context, collapse.kept, collapse.removed);
    *merged = collapse.kept;
    return HW_OK;
}

hw_status hw_collapser_run(hw_collapser *c, const hw_metric *metric,
                           const hw_collapse_limits *limits)
{
    if (!c->queue->filled)
        HW_TRY(fill_queue(c, metric));
    while (!limits_met(c, limits)) {
        uint32_t merged;
        HW_TRY(step(c, metric, true, &merged));
        if (merged != HW_NO_VERTEX)
            HW_TRY(requeue(c, metric, merged));
    }
    return HW_OK;
}

// Drops the entries of a merged vertex and marks those of its neighbours.
static void withdraw(hw_collapser *c, uint32_t v)
{
    hw_collapse_queue *q = c->queue;
    q->generation[v]++;
    for (uint32_t k = c->first_corner[v]; k != HW_NO_VERTEX; k = hw_next_corner(c, k))
        for (int i = 0; i < 3; i++) // twice per neighbour, which does no harm
            q->touched[c->faces[k / 4][i]]++;
}

hw_status hw_collapser_run_batch(hw_collapser *c, const hw_metric *metric,
                                 const hw_collapse_limits *limits, uint32_t *collapses)
{
    *collapses = 0;
    HW_TRY(fill_queue(c, metric));
    while (!limits_met(c, limits)) {
        uint32_t merged;
        HW_TRY(step(c, metric, false, &merged));
        if (merged == HW_NO_VERTEX)
            continue;
        withdraw(c, merged);
        ++*collapses;
    }
    c->queue->filled = false;
    return HW_OK;
}
