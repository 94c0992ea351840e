// Evaluation of an edge under a metric: the candidates of its placement, the best of them.
#include "metric.h"
#include <math.h>
#include <string.h>

// A merged vertex stays within this many edge lengths of the edge's middle.
#define REACH 2.0
// Among flat places the shorter edge goes first: this share of its squared length keeps faces well
// shaped.
#define SHAPE 1e-9

static void add_candidate(hw_candidates *c, const double p[3], int8_t end)
{
    uint32_t i = c->count++;
    c->x[i] = p[0];
    c->y[i] = p[1];
    c->z[i] = p[2];
    c->end[i] = end;
}

static void fill_lanes(hw_candidates *c)
{
    for (uint32_t i = c->count; i < HW_CANDIDATES; i++) {
        c->x[i] = c->x[0];
        c->y[i] = c->y[0];
        c->z[i] = c->z[0];
        c->end[i] = c->end[0];
    }
}

static bool own_or_quadric_optimum(const hw_metric *m, const hw_domain *r, const double middle[3],
                                   double x[3])
{
    if (m->optimum)
        return m->optimum(m->context, r, x);
    hw_quadric q;
    hw_domain_quadric(r, &q);
    return hw_quadric_minimise(&q, middle, x);
}

static bool within_reach(const hw_domain *r, const double middle[3], const double x[3])
{
    double d2 = 0;
    for (int i = 0; i < 3; i++)
        d2 += (x[i] - middle[i]) * (x[i] - middle[i]);
    return d2 <= REACH * REACH * r->length2;
}

// The end that the merged vertex must stay at, -1 if neither: a locked one, or the one on a border
// that the other is not on.
static int fixed_end(const hw_domain *r)
{
    const hw_collapser *c = r->mesh;
    if (c->locked[r->a] || c->locked[r->b])
        return c->locked[r->b];
    if (c->border[r->a] != c->border[r->b])
        return c->border[r->b];
    return -1;
}

static void propose(const hw_metric *m, const hw_domain *r, hw_candidates *c)
{
    double middle[3], x[3];
    int fixed = fixed_end(r);
    c->count = 0;
    for (int i = 0; i < 3; i++)
        middle[i] = r->ends[1][i] / 2;
    if (fixed >= 0) {
        add_candidate(c, r->ends[fixed], (int8_t)fixed);
    } else {
        if (m->placement == HW_PLACEMENT_OPTIMAL && own_or_quadric_optimum(m, r, middle, x) &&
            within_reach(r, middle, x))
            add_candidate(c, x, -1);
        bool alone = c->count > 0 && m->optimum; // nothing is better than the metric's own optimum
        if (m->placement != HW_PLACEMENT_ENDS && !alone)
            add_candidate(c, middle, -1);
        if (m->placement != HW_PLACEMENT_MIDPOINT && !alone) {
            add_candidate(c, r->ends[0], 0);
            add_candidate(c, r->ends[1], 1);
        }
    }
    fill_lanes(c);
}

void hw_scratch_error(void *context, const hw_domain *domain, const hw_candidates *c,
                      double error[HW_CANDIDATES])
{
    (void)context;
    const hw_quadric *q = &domain->scratch;
    for (uint32_t i = 0; i < HW_CANDIDATES; i++)
        error[i] =
            hw_quadric_at(q, c->x[i], c->y[i], c->z[i]) + SHAPE * domain->length2 * q->weight;
}

bool hw_scratch_optimum(void *context, const hw_domain *domain, double x[3])
{
    (void)context;
    const double middle[3] = {domain->ends[1][0] / 2, domain->ends[1][1] / 2,
                              domain->ends[1][2] / 2};
    return hw_quadric_minimise(&domain->scratch, middle, x);
}

void hw_metric_evaluate(const hw_metric *m, const hw_collapser *collapser, uint32_t a, uint32_t b,
                        hw_collapse *out)
{
    hw_domain r;
    hw_candidates c;
    double error[HW_CANDIDATES];
    out->cost = INFINITY;
    out->kept = a;
    out->removed = b;
    if (collapser->locked[a] && collapser->locked[b])
        return;
    bool own_place = m->optimum || m->placement != HW_PLACEMENT_OPTIMAL;
    if (m->edge_only && own_place)
        hw_domain_edge(collapser, a, b, &r);
    else if (!hw_domain_gather(collapser, a, b, &r))
        return;
    if (m->prepare)
        m->prepare(m->context, &r);
    propose(m, &r, &c);
    m->error(m->context, &r, &c, error);
    uint32_t best = 0;
    for (uint32_t i = 1; i < c.count; i++)
        if (error[i] < error[best])
            best = i;
    out->cost = error[best] >= 0 ? error[best] : 0;
    if (c.end[best] == 1) {
        out->kept = b;
        out->removed = a;
    }
    if (c.end[best] >= 0) { // exactly, not through the region's origin
        memcpy(out->position, collapser->positions[out->kept], sizeof out->position);
        return;
    }
    out->position[0] = c.x[best] + r.origin[0];
    out->position[1] = c.y[best] + r.origin[1];
    out->position[2] = c.z[best] + r.origin[2];
}
