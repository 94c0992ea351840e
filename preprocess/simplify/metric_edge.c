// Squared edge length (GeMS 4.3): knows nothing of the surface, runs very fast, makes even meshes.
#include "metrics.h"

static void error(void *context, const hw_domain *domain, const hw_candidates *c,
                  double out[HW_CANDIDATES])
{
    (void)context;
    (void)c;
    for (uint32_t i = 0; i < HW_CANDIDATES; i++)
        out[i] = domain->length2;
}

hw_metric hw_metric_edge(void)
{
    return (hw_metric){
        .name = "edge", .placement = HW_PLACEMENT_MIDPOINT, .edge_only = true, .error = error};
}
