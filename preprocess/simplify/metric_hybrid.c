// Unsigned volume, normal deviation, and their product (GeMS 4.4), of all places at once.
#include "metrics.h"
#include <math.h>

typedef long long mask __attribute__((vector_size(8 * HW_CANDIDATES)));

static inline hw_lanes absolute(hw_lanes v)
{
    return (hw_lanes)((mask)v & 0x7fffffffffffffffll);
}

static inline hw_lanes least_of(hw_lanes a, hw_lanes b)
{
    mask less = a < b;
    return (hw_lanes)((less & (mask)a) | (~less & (mask)b));
}

// Six times the volume between the old face and the place: |n . x + d|.
static inline hw_lanes volume(const hw_domain_face *f, const hw_candidates *c)
{
    return absolute(f->n[0] * c->x + f->n[1] * c->y + f->n[2] * c->z + f->d);
}

// cos |cos| of the angle that the face turns by: the square, with its sign, needs no root and
// orders as the cosine does.
static inline hw_lanes signed_square(const hw_domain_face *f, const hw_candidates *c)
{
    double n2 = f->n[0] * f->n[0] + f->n[1] * f->n[1] + f->n[2] * f->n[2];
    hw_lanes m[3];
    hw_domain_normals(f, c, m);
    hw_lanes along = f->n[0] * m[0] + f->n[1] * m[1] + f->n[2] * m[2];
    return along * absolute(along) / (n2 * (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]) + 1e-300);
}

static inline double one_minus_cosine(double square)
{
    return 1 - (square < 0 ? -sqrt(-square) : sqrt(square));
}

static void uvol(void *context, const hw_domain *domain, const hw_candidates *c,
                 double out[HW_CANDIDATES])
{
    (void)context;
    hw_lanes sum = {0};
    for (uint32_t i = 0; i < domain->walls; i++)
        sum += volume(&domain->faces[i], c);
    for (uint32_t i = 0; i < HW_CANDIDATES; i++)
        out[i] = sum[i] / 6;
}

static void norm(void *context, const hw_domain *domain, const hw_candidates *c,
                 double out[HW_CANDIDATES])
{
    (void)context;
    hw_lanes least = {1, 1, 1, 1};
    for (uint32_t i = 0; i < domain->walls; i++)
        least = least_of(least, signed_square(&domain->faces[i], c));
    for (uint32_t i = 0; i < HW_CANDIDATES; i++)
        out[i] = one_minus_cosine(least[i]);
}

static void hybrid(void *context, const hw_domain *domain, const hw_candidates *c,
                   double out[HW_CANDIDATES])
{
    (void)context;
    hw_lanes sum = {0}, least = {1, 1, 1, 1};
    for (uint32_t i = 0; i < domain->walls; i++) {
        sum += volume(&domain->faces[i], c);
        least = least_of(least, signed_square(&domain->faces[i], c));
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
