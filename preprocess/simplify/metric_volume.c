// Memoryless volume (Lindstrom and Turk 1998): the merged vertex keeps the volume that the mesh
// encloses, and among the places that do so it sweeps the least: the sum over the faces of the
// squared volume between face and vertex. That weights planes by the square of their area.
#include "metrics.h"
#include <string.h>

static void prepare(void *context, hw_domain *domain)
{
    (void)context;
    hw_quadric q = {0};
    double g[4] = {0, 0, 0, 0};
    for (uint32_t i = 0; i < domain->count; i++) {
        const hw_domain_face *f = &domain->faces[i];
        double size2 = f->n[0] * f->n[0] + f->n[1] * f->n[1] + f->n[2] * f->n[2];
        hw_quadric_add_plane(&q, f->n, f->d, 1, size2);
        if (f->q == f->r) // a wall encloses nothing
            continue;
        for (int k = 0; k < 3; k++)
            g[k] += f->n[k];
        g[3] += f->d;
    }
    domain->scratch = q;
    memcpy(domain->constraint, g, sizeof g);
}

static bool optimum(void *context, const hw_domain *domain, double x[3])
{
    (void)context;
    const double middle[3] = {domain->ends[1][0] / 2, domain->ends[1][1] / 2,
                              domain->ends[1][2] / 2};
    return hw_quadric_minimise_on(&domain->scratch, domain->constraint, domain->constraint[3],
                                  middle, x);
}

hw_metric hw_metric_volume(void)
{
    return (hw_metric){.name = "volume",
                       .placement = HW_PLACEMENT_OPTIMAL,
                       .prepare = prepare,
                       .error = hw_scratch_error,
                       .optimum = optimum};
}
