// Progressive meshes without memory (GeMS 4.1): E_pm = E_dist + E_spring, the squared distances to
// the planes of TOP and BOT, each plane alike, plus kappa times the squared distances to the base
// points.
#include "alloc.h"
#include "metrics.h"

typedef struct springs {
    double kappa;
} springs;

// A spring to v is kappa (I x^2 - 2 v x + v^2).
static void add_spring(hw_quadric *q, const double v[3], double kappa)
{
    q->a00 += kappa;
    q->a11 += kappa;
    q->a22 += kappa;
    q->b0 -= kappa * v[0];
    q->b1 -= kappa * v[1];
    q->b2 -= kappa * v[2];
    q->c += kappa * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

// Whether an earlier face of the region has the base point, or this one as its q.
static bool seen(const hw_domain *r, uint32_t face, bool second, uint32_t v)
{
    for (uint32_t i = 0; i < face; i++)
        if (r->faces[i].q == v || r->faces[i].r == v)
            return true;
    return second && r->faces[face].q == v;
}

static void prepare(void *context, hw_domain *r)
{
    const springs *s = context;
    r->scratch = (hw_quadric){0};
    for (uint32_t i = 0; i < r->walls; i++) {
        const hw_domain_face *f = &r->faces[i];
        double size2 = f->n[0] * f->n[0] + f->n[1] * f->n[1] + f->n[2] * f->n[2];
        if (size2 > 0)
            hw_quadric_add_plane(&r->scratch, f->n, f->d, 1 / size2, 1);
        for (int k = 0; k < 2 && i < r->kept; k++) {
            uint32_t v = k ? f->r : f->q;
            if (seen(r, i, k == 1, v))
                continue;
            const double *p = r->mesh->positions[v];
            const double x[3] = {p[0] - r->origin[0], p[1] - r->origin[1], p[2] - r->origin[2]};
            add_spring(&r->scratch, x, s->kappa);
        }
    }
}

static void error(void *context, const hw_domain *r, const hw_candidates *c,
                  double out[HW_CANDIDATES])
{
    (void)context;
    for (uint32_t i = 0; i < HW_CANDIDATES; i++)
        out[i] = hw_quadric_at(&r->scratch, c->x[i], c->y[i], c->z[i]);
}

static bool optimum(void *context, const hw_domain *r, double x[3])
{
    (void)context;
    const double middle[3] = {r->ends[1][0] / 2, r->ends[1][1] / 2, r->ends[1][2] / 2};
    return hw_quadric_minimise(&r->scratch, middle, x);
}

hw_status hw_metric_pm(double kappa, hw_metric *out)
{
    springs *s = NULL;
    *out = (hw_metric){0};
    HW_TRY(HW_NEW(&s, 1));
    s->kappa = kappa > 0 ? kappa : HW_PM_KAPPA;
    *out = (hw_metric){.name = "pm",
                       .context = s,
                       .placement = HW_PLACEMENT_SUBSET,
                       .prepare = prepare,
                       .error = error,
                       .optimum = optimum,
                       .destroy = hw_free};
    return HW_OK;
}
