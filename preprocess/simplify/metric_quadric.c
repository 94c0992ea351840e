// Memoryless quadrics (GeMS 4.2): the quadric of an edge is made anew from the faces round it, each
// once, by area. With silhouette importance they are the metric `silhouette` (metric_silhouette.c).
#include "metric.h"

// Among flat places the shorter edge goes first: this share of its squared length keeps faces well
// shaped.
#define SHAPE 1e-9

static void prepare(void *context, hw_domain *r)
{
    const float *importance = context;
    if (!importance) {
        hw_domain_quadric(r, &r->scratch);
        return;
    }
    r->scratch = (hw_quadric){0};
    for (uint32_t i = 0; i < r->count; i++) {
        const hw_domain_face *f = &r->faces[i];
        double size = __builtin_sqrt(f->n[0] * f->n[0] + f->n[1] * f->n[1] + f->n[2] * f->n[2]);
        double weight = ((double)importance[f->p] + importance[f->q] + importance[f->r]) / 3;
        if (size > 0)
            hw_quadric_add_plane(&r->scratch, f->n, f->d, weight * 0.5 / size, weight * 0.5 * size);
    }
}

static void error(void *context, const hw_domain *r, const hw_candidates *c,
                  double out[HW_CANDIDATES])
{
    (void)context;
    for (uint32_t i = 0; i < HW_CANDIDATES; i++)
        out[i] = hw_quadric_at(&r->scratch, c->x[i], c->y[i], c->z[i]) +
                 SHAPE * r->length2 * r->scratch.weight;
}

static bool optimum(void *context, const hw_domain *r, double x[3])
{
    (void)context;
    const double middle[3] = {r->ends[1][0] / 2, r->ends[1][1] / 2, r->ends[1][2] / 2};
    return hw_quadric_minimise(&r->scratch, middle, x);
}

static void merge_importance(void *context, uint32_t kept, uint32_t removed)
{
    float *importance = context;
    if (importance && importance[removed] > importance[kept])
        importance[kept] = importance[removed];
}

hw_metric hw_metric_quadric(float *importance)
{
    return (hw_metric){.name = "quadric",
                       .context = importance,
                       .placement = HW_PLACEMENT_OPTIMAL,
                       .prepare = prepare,
                       .error = error,
                       .optimum = optimum,
                       .collapsed = merge_importance};
}
