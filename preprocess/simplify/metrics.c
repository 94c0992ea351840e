// The metrics by name: one row each.
#include "metrics.h"
#include "metric.h"
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
    {.name = "quadric",
     .summary = "memoryless quadrics by area (GeMS)",
     .unit = "area x squared distance",
     .placement = HW_PLACEMENT_OPTIMAL,
     .create = make_quadric},
    {.name = "volume",
     .summary = "least volume swept, enclosed volume kept (Lindstrom and Turk)",
     .unit = "squared volume",
     .placement = HW_PLACEMENT_OPTIMAL,
     .create = make_volume},
    {.name = "silhouette",
     .summary = "memoryless quadrics that hold outlines tighter",
     .unit = "area x squared distance",
     .placement = HW_PLACEMENT_OPTIMAL,
     .create = hw_metric_silhouette},
    {.name = "hybrid",
     .summary = "unsigned volume times normal deviation (GeMS)",
     .unit = "volume",
     .placement = HW_PLACEMENT_SUBSET,
     .create = make_hybrid},
    {.name = "uvol",
     .summary = "unsigned volume between the old surface and the new (GeMS)",
     .unit = "volume",
     .placement = HW_PLACEMENT_SUBSET,
     .create = make_uvol},
    {.name = "norm",
     .summary = "largest turn of a face (GeMS)",
     .unit = "1 - cosine",
     .placement = HW_PLACEMENT_SUBSET,
     .create = make_norm},
    {.name = "pm",
     .summary = "distances to planes plus springs (Hoppe, made memoryless)",
     .unit = "squared distance",
     .placement = HW_PLACEMENT_SUBSET,
     .uses_kappa = true,
     .create = make_pm},
    {.name = "edge",
     .summary = "edge length: fastest, even meshes, no regard for shape (GeMS)",
     .unit = "squared length",
     .placement = HW_PLACEMENT_MIDPOINT,
     .create = make_edge},
    {.name = "qem",
     .summary = "quadrics with memory (Garland and Heckbert)",
     .unit = "squared distance",
     .placement = HW_PLACEMENT_OPTIMAL,
     .create = make_qem},
    {.name = "screen",
     .summary = "deviation as seen from an eye",
     .unit = "pixels to the fourth",
     .placement = HW_PLACEMENT_OPTIMAL,
     .needs_eye = true,
     .create = hw_metric_screen},
    {.name = "viewcell",
     .summary = "the cost of view-cell dependent meshes (Chen, 5.2.1)",
     .unit = "pixels",
     .placement = HW_PLACEMENT_ENDS,
     .needs_eye = true,
     .create = hw_metric_viewcell_from_eye},
    {.name = NULL},
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
