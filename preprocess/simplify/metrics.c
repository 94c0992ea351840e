// The metrics by name: one row each.
#include "metric.h"
#include "metrics.h"
#include <string.h>

static hw_status make_edge(const hw_metric_setup *setup, hw_metric *out)
{
    (void)setup;
    *out = hw_metric_edge();
    return HW_OK;
}

static hw_status make_pm(const hw_metric_setup *setup, hw_metric *out)
{
    return hw_metric_pm(setup->kappa, out);
}

static hw_status make_quadric(const hw_metric_setup *setup, hw_metric *out)
{
    (void)setup;
    *out = hw_metric_quadric(NULL);
    return HW_OK;
}

static hw_status make_volume(const hw_metric_setup *setup, hw_metric *out)
{
    (void)setup;
    *out = hw_metric_volume();
    return HW_OK;
}

static hw_status make_uvol(const hw_metric_setup *setup, hw_metric *out)
{
    (void)setup;
    *out = hw_metric_uvol();
    return HW_OK;
}

static hw_status make_norm(const hw_metric_setup *setup, hw_metric *out)
{
    (void)setup;
    *out = hw_metric_norm();
    return HW_OK;
}

static hw_status make_hybrid(const hw_metric_setup *setup, hw_metric *out)
{
    (void)setup;
    *out = hw_metric_hybrid();
    return HW_OK;
}

static hw_status make_qem(const hw_metric_setup *setup, hw_metric *out)
{
    return hw_metric_qem(setup->collapser, out);
}

const hw_metric_kind hw_metric_kinds[] = {
    {"quadric", "memoryless quadrics by area (GeMS)", "area x squared distance",
     HW_PLACEMENT_OPTIMAL, false, make_quadric},
    {"volume", "least volume swept, enclosed volume kept (Lindstrom and Turk)", "squared volume",
     HW_PLACEMENT_OPTIMAL, false, make_volume},
    {"silhouette", "memoryless quadrics that hold outlines tighter", "area x squared distance",
     HW_PLACEMENT_OPTIMAL, false, hw_metric_silhouette},
    {"hybrid", "unsigned volume times normal deviation (GeMS)", "volume", HW_PLACEMENT_SUBSET,
     false, make_hybrid},
    {"uvol", "unsigned volume between old and new surface (GeMS)", "volume", HW_PLACEMENT_SUBSET,
     false, make_uvol},
    {"norm", "largest turn of a face (GeMS)", "1 - cosine", HW_PLACEMENT_SUBSET, false, make_norm},
    {"pm", "distances to planes plus springs (Hoppe, made memoryless)", "squared distance",
     HW_PLACEMENT_SUBSET, false, make_pm},
    {"edge", "edge length: fastest, even meshes, no regard for shape (GeMS)", "squared length",
     HW_PLACEMENT_MIDPOINT, false, make_edge},
    {"qem", "quadrics with memory (Garland and Heckbert)", "squared distance",
     HW_PLACEMENT_OPTIMAL, false, make_qem},
    {"screen", "deviation as seen from an eye", "px^2 x square pixels", HW_PLACEMENT_OPTIMAL, true,
     hw_metric_screen},
    {"viewcell", "the cost of view-cell dependent meshes (Chen, 5.2.1)", "pixels",
     HW_PLACEMENT_ENDS, true, hw_metric_viewcell_from_eye},
    {0},
};

const hw_metric_kind *hw_metric_find(const char *name)
{
    for (const hw_metric_kind *kind = hw_metric_kinds; kind->name; kind++)
        if (strcmp(kind->name, name) == 0)
            return kind;
    return NULL;
}

hw_status hw_metric_create(const hw_metric_kind *kind, const hw_metric_setup *setup, hw_metric *out)
{
    memset(out, 0, sizeof *out);
    if (kind->needs_eye && !(setup->focal_px > 0))
        return hw_fail(HW_USAGE, "the metric %s needs an eye to look from", kind->name);
    HW_TRY(kind->create(setup, out));
    out->placement = kind->placement;
    return HW_OK;
}

void hw_metric_destroy(hw_metric *metric)
{
    if (metric->destroy)
        metric->destroy(metric->context);
    memset(metric, 0, sizeof *metric);
}
