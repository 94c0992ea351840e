// Metrics made of quadrics: memoryless with free placement, and classic with memory.
#include "alloc.h"
#include "metric.h"
#include "quadric.h"
#include <math.h>
#include <string.h>

// Border edges count as planes through the edge, upright on their face, with this many times the
// area of the square on the edge.
#define BORDER_WEIGHT 4.0

static double normal_of(const hw_collapser *c, const uint32_t face[3], const double origin[3],
                        double n[3], double *d)
{
    const double *p = c->positions[face[0]], *q = c->positions[face[1]], *r = c->positions[face[2]];
    double e[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]},
           f[3] = {r[0] - p[0], r[1] - p[1], r[2] - p[2]};
    n[0] = e[1] * f[2] - e[2] * f[1];
    n[1] = e[2] * f[0] - e[0] * f[2];
    n[2] = e[0] * f[1] - e[1] * f[0];
    double l = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (l > 0)
        for (int i = 0; i < 3; i++)
            n[i] /= l;
    *d = -(n[0] * (p[0] - origin[0]) + n[1] * (p[1] - origin[1]) + n[2] * (p[2] - origin[2]));
    return l / 2; // the area
}

static uint32_t faces_on_edge(const hw_collapser *c, uint32_t a, uint32_t b)
{
    uint32_t n = 0;
    for (uint32_t k = c->first_corner[a]; k != HW_NO_VERTEX; k = c->next_corner[k]) {
        const uint32_t *face = c->faces[k / 3];
        n += face[0] == b || face[1] == b || face[2] == b;
    }
    return n;
}

// Planes through those edges of the face that have no other face.
static void add_borders(hw_quadric *q, const hw_collapser *c, const uint32_t face[3],
                        const double n[3], const double origin[3])
{
    for (int i = 0; i < 3; i++) {
        uint32_t a = face[i], b = face[(i + 1) % 3];
        if (!c->border[a] || !c->border[b] || faces_on_edge(c, a, b) != 1)
            continue;
        const double *p = c->positions[a], *r = c->positions[b];
        double e[3] = {r[0] - p[0], r[1] - p[1], r[2] - p[2]};
        double m[3] = {e[1] * n[2] - e[2] * n[1], e[2] * n[0] - e[0] * n[2],
                       e[0] * n[1] - e[1] * n[0]};
        double l = sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]);
        if (!(l > 0))
            continue;
        for (int k = 0; k < 3; k++)
            m[k] /= l;
        double d =
            -(m[0] * (p[0] - origin[0]) + m[1] * (p[1] - origin[1]) + m[2] * (p[2] - origin[2]));
        hw_quadric_add_plane(q, m, d, BORDER_WEIGHT * l * l);
    }
}

// Placement for an edge: the minimiser near the middle, else the best of both ends and the middle;
// a locked end stays.
static void place(const hw_collapser *c, const hw_quadric *q, uint32_t a, uint32_t b,
                  const double origin[3], hw_collapse *out)
{
    const double *p = c->positions[a], *r = c->positions[b];
    double ends[3][3], best[3];
    double length2 = 0;
    for (int i = 0; i < 3; i++) {
        ends[0][i] = p[i] - origin[i];
        ends[1][i] = r[i] - origin[i];
        ends[2][i] = (ends[0][i] + ends[1][i]) / 2;
        length2 += (p[i] - r[i]) * (p[i] - r[i]);
    }
    out->kept = c->locked[b] ? b : a;
    if (c->locked[a] || c->locked[b]) {
        const double *end = ends[c->locked[b]];
        out->cost = hw_quadric_at(q, end);
        memcpy(out->position, c->positions[out->kept], sizeof out->position);
        return;
    }
    if (hw_quadric_minimise(q, ends[2], 2 * sqrt(length2), best)) {
        out->cost = hw_quadric_at(q, best);
    } else {
        out->cost = INFINITY;
        for (int k = 0; k < 3; k++) {
            double cost = hw_quadric_at(q, ends[k]);
            if (cost < out->cost) {
                out->cost = cost;
                memcpy(best, ends[k], sizeof best);
            }
        }
    }
    for (int i = 0; i < 3; i++)
        out->position[i] = best[i] + origin[i];
}

// ---- memoryless ------------------------------------------------------------------------------

static void evaluate_memoryless(void *context, const hw_collapser *c, uint32_t a, uint32_t b,
                                hw_collapse *out)
{
    const float *importance = context;
    uint32_t star[HW_STAR_MAX];
    uint32_t count = hw_collapser_star(c, a, b, star, HW_STAR_MAX);
    out->cost = INFINITY;
    if (count > HW_STAR_MAX)
        return;
    const double *p = c->positions[a];
    const double origin[3] = {p[0], p[1], p[2]};
    hw_quadric q = {0};
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t *face = c->faces[star[i]];
        double n[3], d;
        double area = normal_of(c, face, origin, n, &d);
        double weight = 1;
        if (importance)
            weight = ((double)importance[face[0]] + importance[face[1]] + importance[face[2]]) / 3;
        hw_quadric_add_plane(&q, n, d, area * weight);
        add_borders(&q, c, face, n, origin);
    }
    place(c, &q, a, b, origin, out);
    // Among flat places the shorter edge goes first: a hundred-thousandth of its length keeps faces
    // well shaped.
    const double *r = c->positions[b];
    double l2 = (p[0] - r[0]) * (p[0] - r[0]) + (p[1] - r[1]) * (p[1] - r[1]) +
                (p[2] - r[2]) * (p[2] - r[2]);
    out->cost += 1e-9 * l2 * q.weight;
}

static void merge_importance(void *context, uint32_t kept, uint32_t removed)
{
    float *importance = context;
    if (importance && importance[removed] > importance[kept])
        importance[kept] = importance[removed];
}

hw_metric hw_metric_quadric(float *importance)
{
    return (hw_metric){"quadric", importance, evaluate_memoryless, merge_importance};
}

// ---- with memory -----------------------------------------------------------------------------

struct hw_qem {
    hw_quadric *quadrics; // per vertex, relative to the coordinates' origin
};

hw_status hw_qem_create(const hw_collapser *c, hw_qem **out)
{
    hw_status status;
    hw_qem *qem = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&qem, 1));
    HW_GO(HW_NEW(&qem->quadrics, c->vertex_count));
    const double origin[3] = {0, 0, 0};
    for (uint32_t f = 0; f < c->face_count; f++) {
        const uint32_t *face = c->faces[f];
        if (face[0] == HW_NO_VERTEX)
            continue;
        double n[3], d;
        double area = normal_of(c, face, origin, n, &d);
        hw_quadric q = {0};
        hw_quadric_add_plane(&q, n, d, area);
        for (int i = 0; i < 3; i++)
            hw_quadric_add(&qem->quadrics[face[i]], &q);
    }
    *out = qem;
    qem = NULL;
out:
    hw_qem_destroy(qem);
    return status;
}

void hw_qem_destroy(hw_qem *qem)
{
    if (!qem)
        return;
    hw_free(qem->quadrics);
    hw_free(qem);
}

static void evaluate_qem(void *context, const hw_collapser *c, uint32_t a, uint32_t b,
                         hw_collapse *out)
{
    const hw_qem *qem = context;
    const double origin[3] = {0, 0, 0};
    hw_quadric q = qem->quadrics[a];
    hw_quadric_add(&q, &qem->quadrics[b]);
    place(c, &q, a, b, origin, out);
    out->cost = q.weight > 0 ? out->cost / q.weight : 0;
}

static void merge_qem(void *context, uint32_t kept, uint32_t removed)
{
    hw_qem *qem = context;
    hw_quadric_add(&qem->quadrics[kept], &qem->quadrics[removed]);
}

hw_metric hw_metric_qem(hw_qem *qem)
{
    return (hw_metric){"qem", qem, evaluate_qem, merge_qem};
}
