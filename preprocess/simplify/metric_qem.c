// Quadrics with memory (Garland and Heckbert 1997), for comparison and for collapses that must stay
// within a tolerance: each vertex keeps the planes of all faces that went into it.
#include "alloc.h"
#include "metric.h"
#include <math.h>

// Quadrics lie about the mesh's first vertex, not about the coordinates' origin.
typedef struct qem {
    double origin[3];
    hw_quadric quadrics[]; // per vertex
} qem;

static void prepare(void *context, hw_domain *domain)
{
    const qem *m = context;
    domain->scratch = m->quadrics[domain->a];
    hw_quadric_add(&domain->scratch, &m->quadrics[domain->b]);
}

static void error(void *context, const hw_domain *domain, const hw_candidates *c,
                  double out[HW_CANDIDATES])
{
    const qem *m = context;
    const double *o = domain->origin, *p = m->origin;
    for (uint32_t i = 0; i < HW_CANDIDATES; i++) {
        double sum = hw_quadric_at(&domain->scratch, c->x[i] + o[0] - p[0], c->y[i] + o[1] - p[1],
                                   c->z[i] + o[2] - p[2]);
        out[i] = domain->scratch.weight > 0 ? sum / domain->scratch.weight : 0;
    }
}

static bool optimum(void *context, const hw_domain *domain, double x[3])
{
    const qem *m = context;
    double middle[3];
    for (int i = 0; i < 3; i++)
        middle[i] = domain->ends[1][i] / 2 + domain->origin[i] - m->origin[i];
    if (!hw_quadric_minimise(&domain->scratch, middle, x))
        return false;
    for (int i = 0; i < 3; i++)
        x[i] += m->origin[i] - domain->origin[i];
    return true;
}

static void merge(void *context, uint32_t kept, uint32_t removed)
{
    qem *m = context;
    hw_quadric_add(&m->quadrics[kept], &m->quadrics[removed]);
}

static void add_face(const hw_collapser *c, const uint32_t face[3], qem *m)
{
    double p[3][3], n[3];
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            p[k][i] = c->positions[face[k]][i] - m->origin[i];
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        n[i] =
            (p[1][j] - p[0][j]) * (p[2][k] - p[0][k]) - (p[1][k] - p[0][k]) * (p[2][j] - p[0][j]);
    }
    double size = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (!(size > 0))
        return;
    double d = -(n[0] * p[0][0] + n[1] * p[0][1] + n[2] * p[0][2]);
    for (int k = 0; k < 3; k++)
        hw_quadric_add_plane(&m->quadrics[face[k]], n, d, 0.5 / size, 0.5 * size);
}

hw_status hw_metric_qem(const hw_collapser *c, hw_metric *out)
{
    qem *m = NULL;
    *out = (hw_metric){0};
    HW_TRY(hw_alloc((void **)&m, sizeof *m + c->vertex_count * sizeof *m->quadrics, 1));
    for (int i = 0; i < 3 && c->vertex_count > 0; i++)
        m->origin[i] = c->positions[0][i];
    for (uint32_t f = 0; f < c->face_count; f++)
        if (c->faces[f][0] != HW_NO_VERTEX)
            add_face(c, c->faces[f], m);
    *out = (hw_metric){.name = "qem",
                       .context = m,
                       .placement = HW_PLACEMENT_OPTIMAL,
                       .edge_only = true,
                       .prepare = prepare,
                       .error = error,
                       .optimum = optimum,
                       .collapsed = merge,
                       .destroy = hw_free};
    return HW_OK;
}
