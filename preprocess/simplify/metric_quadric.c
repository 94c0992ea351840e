// Memoryless quadrics (GeMS 4.2): the quadric of an edge is made anew from the faces round it, each
// once, by area. With silhouette importance they are the metric `silhouette` (metric_silhouette.c).
#include "metric.h"
#include <math.h>

static void prepare(void *context, hw_domain *domain)
{
    const float *importance = context;
    if (!importance) {
        hw_domain_quadric(domain, &domain->scratch);
        return;
    }
    hw_quadric q = {0};
    for (uint32_t i = 0; i < domain->count; i++) {
        const hw_domain_face *f = &domain->faces[i];
        double size = sqrt(f->n[0] * f->n[0] + f->n[1] * f->n[1] + f->n[2] * f->n[2]);
        double weight = ((double)importance[f->p] + importance[f->q] + importance[f->r]) / 3 * 0.5;
        if (size > 0)
            hw_quadric_add_plane(&q, f->n, f->d, weight / size, weight * size);
    }
    domain->scratch = q;
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
                       .error = hw_scratch_error,
                       .optimum = hw_scratch_optimum,
                       .collapsed = merge_importance};
}
