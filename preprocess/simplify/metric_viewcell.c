// The view-cell dependent cost of thesis 5.2.1 (Edge collapsing).
#include "metric.h"
#include <math.h>
#include <string.h>

static void evaluate(void *context, const hw_collapser *c, uint32_t a, uint32_t b, hw_collapse *out)
{
    const hw_viewcell_metric *m = context;
    const float *na = m->normals[a], *nb = m->normals[b];
    double turn = 1.5 - ((double)na[0] * nb[0] + (double)na[1] * nb[1] + (double)na[2] * nb[2]);
    double dx = (double)m->image[a][0] - m->image[b][0],
           dy = (double)m->image[a][1] - m->image[b][1];
    out->cost = turn * turn * sqrt(dx * dx + dy * dy) * ((double)m->weights[a] + m->weights[b]);
    bool keep_b = m->weights[a] < m->weights[b];
    if (c->locked[a] != c->locked[b])
        keep_b = c->locked[b];
    out->kept = keep_b ? b : a;
    memcpy(out->position, c->positions[out->kept], sizeof out->position);
}

hw_metric hw_metric_viewcell(hw_viewcell_metric *context)
{
    return (hw_metric){"viewcell", context, evaluate, NULL};
}
