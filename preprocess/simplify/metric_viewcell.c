// The view-cell dependent cost of thesis 5.2.1 (Edge collapsing): half-edge collapse of the vertex
// of smaller weight.
#include "classify.h"
#include "metric.h"
#include <math.h>

// Weights of vertices that have no pixel (5.2.1, Assigning vertex weights).
#define WEIGHT_BACK_FACING 0.5f
#define WEIGHT_INVISIBLE   0.05f
// A vertex is visible when it lies no deeper than its pixel by more than this part of the depth.
#define VISIBLE_TOLERANCE 1e-3

bool hw_viewcell_visible(bool front, double depth, float pixel_depth)
{
    return front && depth <= (double)pixel_depth * (1 + VISIBLE_TOLERANCE);
}

float hw_viewcell_weight(bool front, double depth, float pixel_depth, uint8_t category)
{
    if (!front)
        return WEIGHT_BACK_FACING;
    if (!hw_viewcell_visible(front, depth, pixel_depth))
        return WEIGHT_INVISIBLE;
    return hw_category_weight(category == HW_CATEGORY_BACKGROUND ? HW_CATEGORY_EXTERIOR_SILHOUETTE
                                                                 : category);
}

static double length_in(const float (*image)[2], uint32_t a, uint32_t b)
{
    double dx = (double)image[a][0] - image[b][0], dy = (double)image[a][1] - image[b][1];
    return sqrt(dx * dx + dy * dy);
}

// The cost of an edge of projected length `length`: the end of smaller weight goes.
static void set_costs(const hw_viewcell_metric *m, uint32_t a, uint32_t b, double length,
                      const hw_candidates *c, double out[HW_CANDIDATES])
{
    const float *na = m->normals[a], *nb = m->normals[b];
    double turn = 1.5 - ((double)na[0] * nb[0] + (double)na[1] * nb[1] + (double)na[2] * nb[2]);
    double cost = turn * turn * length * ((double)m->weights[a] + m->weights[b]);
    int8_t end = m->weights[a] < m->weights[b] ? 1 : 0;
    for (uint32_t i = 0; i < HW_CANDIDATES; i++)
        out[i] = c->end[i] == end || c->count == 1 ? cost : INFINITY; // one: the other end is held
}

static void error(void *context, const hw_domain *domain, const hw_candidates *candidates,
                  double out[HW_CANDIDATES])
{
    const hw_viewcell_metric *m = context;
    uint32_t a = domain->a, b = domain->b;
    set_costs(m, a, b, length_in(m->image, a, b), candidates, out);
}

static void multiview_error(void *context, const hw_domain *domain,
                            const hw_candidates *candidates, double out[HW_CANDIDATES])
{
    const hw_multiview_metric *m = context;
    uint32_t a = domain->a, b = domain->b;
    bool allowed = (m->sets[a] & m->sets[b]) || !(m->sets[a] | m->sets[b]);
    double length = allowed ? 0 : INFINITY;
    for (uint32_t k = 0; k < m->view_count && allowed; k++)
        length = fmax(length, length_in(m->images[k], a, b));
    set_costs(&m->base, a, b, length, candidates, out);
}

hw_metric hw_metric_multiview(hw_multiview_metric *context)
{
    return (hw_metric){.name = "multiview",
                       .context = context,
                       .placement = HW_PLACEMENT_ENDS,
                       .edge_only = true,
                       .error = multiview_error};
}

hw_metric hw_metric_viewcell(hw_viewcell_metric *context)
{
    return (hw_metric){.name = "viewcell",
                       .context = context,
                       .placement = HW_PLACEMENT_ENDS,
                       .edge_only = true,
                       .error = error};
}
