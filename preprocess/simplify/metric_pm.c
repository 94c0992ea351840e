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

// Whether an earlier face of the domain has the base point.
static bool seen(const hw_domain *domain, uint32_t face, uint32_t v)
{
    for (uint32_t i = 0; i < face; i++)
        if (domain->faces[i].q == v || domain->faces[i].r == v)
            return true;
    return false;
}

static void prepare(void *context, hw_domain *domain)
{
    const springs *s = context;
    // In the midst of the surface the rim is a cycle: every base point is the q of one face.
    const hw_collapser *c = domain->mesh;
    bool cycle = !c->border[domain->a] && !c->border[domain->b] && !c->locked[domain->a] &&
                 !c->locked[domain->b];
    domain->scratch = (hw_quadric){0};
    for (uint32_t i = 0; i < domain->walls; i++) {
        const hw_domain_face *f = &domain->faces[i];
        double size2 = f->n[0] * f->n[0] + f->n[1] * f->n[1] + f->n[2] * f->n[2];
        if (size2 > 0)
            hw_quadric_add_plane(&domain->scratch, f->n, f->d, 1 / size2, 1);
        if (i >= domain->kept)
            continue;
        if (cycle || !seen(domain, i, f->q))
            add_spring(&domain->scratch, f->at_q, s->kappa);
        if (!cycle && !seen(domain, i, f->r))
            add_spring(&domain->scratch, f->at_r, s->kappa);
    }
}

static void error(void *context, const hw_domain *r, const hw_candidates *c,
                  double out[HW_CANDIDATES])
{
    (void)context;
    for (uint32_t i = 0; i < HW_CANDIDATES; i++)
        out[i] = hw_quadric_at(&r->scratch, c->x[i], c->y[i], c->z[i]);
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
                       .optimum = hw_scratch_optimum,
                       .destroy = hw_free};
    return HW_OK;
}
