// Unsigned volume, normal deviation, and their product (GeMS 4.4). All places are tried lane by
// lane: the loops over HW_CANDIDATES become vector instructions.
#include "metrics.h"
#include <math.h>

// The volume between the old faces and the place: sum of |n . x + d| / 6.
static inline void add_volume(const hw_domain_face *f, const hw_candidates *c,
                              double sum[HW_CANDIDATES])
{
    for (uint32_t i = 0; i < HW_CANDIDATES; i++)
        sum[i] += fabs(f->n[0] * c->x[i] + f->n[1] * c->y[i] + f->n[2] * c->z[i] + f->d);
}

// Lowers least[] to cos |cos| of the angle that the face turns by: the square, with its sign, needs
// no root and orders as the cosine does.
static inline void lower_cosine(const hw_domain_face *f, const hw_candidates *c,
                                double least[HW_CANDIDATES])
{
    double n2 = f->n[0] * f->n[0] + f->n[1] * f->n[1] + f->n[2] * f->n[2];
    for (uint32_t i = 0; i < HW_CANDIDATES; i++) {
        double mx = f->m[0] + c->y[i] * f->e[2] - c->z[i] * f->e[1];
        double my = f->m[1] + c->z[i] * f->e[0] - c->x[i] * f->e[2];
        double mz = f->m[2] + c->x[i] * f->e[1] - c->y[i] * f->e[0];
        double along = f->n[0] * mx + f->n[1] * my + f->n[2] * mz;
        double m2 = mx * mx + my * my + mz * mz;
        double square = along * fabs(along) / (n2 * m2 + 1e-300);
        least[i] = square < least[i] ? square : least[i];
    }
}

static inline double one_minus_cosine(double square)
{
    return 1 - (square < 0 ? -sqrt(-square) : sqrt(square));
}

static void uvol(void *context, const hw_domain *r, const hw_candidates *c,
                 double out[HW_CANDIDATES])
{
    (void)context;
    double sum[HW_CANDIDATES] = {0};
    for (uint32_t i = 0; i < r->walls; i++)
        add_volume(&r->faces[i], c, sum);
    for (uint32_t i = 0; i < HW_CANDIDATES; i++)
        out[i] = sum[i] / 6;
}

static void norm(void *context, const hw_domain *r, const hw_candidates *c,
                 double out[HW_CANDIDATES])
{
    (void)context;
    double least[HW_CANDIDATES] = {1, 1, 1, 1};
    for (uint32_t i = 0; i < r->walls; i++)
        lower_cosine(&r->faces[i], c, least);
    for (uint32_t i = 0; i < HW_CANDIDATES; i++)
        out[i] = one_minus_cosine(least[i]);
}

static void hybrid(void *context, const hw_domain *r, const hw_candidates *c,
                   double out[HW_CANDIDATES])
{
    (void)context;
    double sum[HW_CANDIDATES] = {0}, least[HW_CANDIDATES] = {1, 1, 1, 1};
    for (uint32_t i = 0; i < r->walls; i++) {
        add_volume(&r->faces[i], c, sum);
        lower_cosine(&r->faces[i], c, least);
    }
    for (uint32_t i = 0; i < HW_CANDIDATES; i++)
        out[i] = sum[i] / 6 * one_minus_cosine(least[i]);
}

hw_metric hw_metric_uvol(void)
{
    return (hw_metric){.name = "uvol", .placement = HW_PLACEMENT_SUBSET, .error = uvol};
}

hw_metric hw_metric_norm(void)
{
    return (hw_metric){.name = "norm", .placement = HW_PLACEMENT_SUBSET, .error = norm};
}

hw_metric hw_metric_hybrid(void)
{
    return (hw_metric){.name = "hybrid", .placement = HW_PLACEMENT_SUBSET, .error = hybrid};
}
