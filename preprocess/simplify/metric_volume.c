// Memoryless volume (Lindstrom and Turk 1998): the merged vertex keeps the volume that the mesh
// encloses, and among the places that do so it sweeps the least: the sum over the faces of the
// squared volume between face and vertex. That weights planes by the square of their area.
#include "metrics.h"

#define SHAPE 1e-9 // as in metric_quadric.c

static void prepare(void *context, hw_domain *r)
{
    (void)context;
    double *g = r->constraint;
    r->scratch = (hw_quadric){0};
    g[0] = g[1] = g[2] = g[3] = 0;
    for (uint32_t i = 0; i < r->count; i++) {
        const hw_domain_face *f = &r->faces[i];
        bool wall = f->q == f->r;
        double size2 = f->n[0] * f->n[0] + f->n[1] * f->n[1] + f->n[2] * f->n[2];
        hw_quadric_add_plane(&r->scratch, f->n, f->d, 1, size2);
        if (wall)
            continue;
        for (int k = 0; k < 3; k++)
            g[k] += f->n[k];
        g[3] += f->d;
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
    return hw_quadric_minimise_on(&r->scratch, r->constraint, r->constraint[3], middle, x);
}

hw_metric hw_metric_volume(void)
{
    return (hw_metric){.name = "volume",
                       .placement = HW_PLACEMENT_OPTIMAL,
                       .prepare = prepare,
                       .error = error,
                       .optimum = optimum};
}
