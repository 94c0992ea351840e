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

float hw_viewcell_weight(bool front, double depth, float pixel_depth, uint8_t category)
{
    if (!front)
        return WEIGHT_BACK_FACING;
    if (depth > (double)pixel_depth * (1 + VISIBLE_TOLERANCE))
        return WEIGHT_INVISIBLE;
    return hw_category_weight(category == HW_CATEGORY_BACKGROUND ? HW_CATEGORY_EXTERIOR_SILHOUETTE
                                                                 : category);
}

static void error(void *context, const hw_domain *domain, const hw_candidates *c,
                  double out[HW_CANDIDATES])
{
    const hw_viewcell_metric *m = context;
    uint32_t a = domain->a, b = domain->b;
    const float *na = m->normals[a], *nb = m->normals[b];
    double turn = 1.5 - ((double)na[0] * nb[0] + (double)na[1] * nb[1] + (double)na[2] * nb[2]);
    double dx = (double)m->image[a][0] - m->image[b][0],
           dy = (double)m->image[a][1] - m->image[b][1];
    double cost = turn * turn * sqrt(dx * dx + dy * dy) * ((double)m->weights[a] + m->weights[b]);
    int8_t end = m->weights[a] < m->weights[b] ? 1 : 0;
    for (uint32_t i = 0; i < HW_CANDIDATES; i++)
        out[i] = c->end[i] == end || c->count == 1 ? cost : INFINITY; // one: the other end is held
}

hw_metric hw_metric_viewcell(hw_viewcell_metric *context)
{
    return (hw_metric){.name = "viewcell",
                       .context = context,
                       .placement = HW_PLACEMENT_ENDS,
                       .edge_only = true,
                       .error = error};
}
