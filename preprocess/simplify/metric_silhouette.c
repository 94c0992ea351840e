// Memoryless quadrics weighted by silhouette importance: where outlines can be, the surface is held
// more tightly. The simplified mesh is pulled back a part of the way to the original, against the
// outward bias of free placement.
#include "alloc.h"
#include "importance.h"
#include "metrics.h"
#include "pull_back.h"
#include "rays.h"

// What halves the deviation of outlines against quadrics by area alone, for a third more distance.
#define DEFAULT_FLOOR 0.01f
#define POWER         2.0f
#define LINES         32u

typedef struct silhouette {
    hw_metric quadric;
    float *importance; // per vertex of the collapser
    hw_rays *rays;     // of the original
    hw_mesh original;  // a copy with normals
    uint32_t threads;
} silhouette;

static void prepare(void *context, hw_domain *domain)
{
    silhouette *s = context;
    s->quadric.prepare(s->importance, domain);
}

static void error(void *context, const hw_domain *domain, const hw_candidates *candidates,
                  double out[HW_CANDIDATES])
{
    silhouette *s = context;
    s->quadric.error(s->importance, domain, candidates, out);
}

static bool optimum(void *context, const hw_domain *domain, double x[3])
{
    silhouette *s = context;
    return s->quadric.optimum(s->importance, domain, x);
}

static void merge(void *context, uint32_t kept, uint32_t removed)
{
    silhouette *s = context;
    s->quadric.collapsed(s->importance, kept, removed);
}

static hw_status finish(void *context, hw_mesh *mesh)
{
    const silhouette *s = context;
    return hw_pull_back(mesh, &s->original, s->rays, HW_PULL_BACK, s->threads);
}

static void destroy(void *context)
{
    silhouette *s = context;
    if (!s)
        return;
    hw_rays_destroy(s->rays);
    hw_mesh_free(&s->original);
    hw_free(s->importance);
    hw_free(s);
}

static hw_status weigh(silhouette *s, const hw_metric_setup *setup)
{
    hw_status status;
    float *importance = NULL; // per vertex of the mesh
    const hw_collapser *c = setup->collapser;
    hw_importance_options options = {
        .lines = LINES,
        .floor = setup->importance_floor > 0 ? setup->importance_floor : DEFAULT_FLOOR,
        .power = POWER,
        .elevation_degrees = setup->elevation_degrees > 0 ? setup->elevation_degrees : 90,
        .threads = setup->threads};
    HW_GO(HW_NEW(&importance, setup->mesh->vertex_count));
    HW_GO(hw_silhouette_importance(&s->original, s->rays, &options, importance));
    for (uint32_t v = 0; v < c->vertex_count; v++)
        s->importance[v] = importance[c->source[v]];
out:
    hw_free(importance);
    return status;
}

hw_status hw_metric_silhouette(const hw_metric_setup *setup, hw_metric *out)
{
    hw_status status;
    silhouette *s = NULL;
    *out = (hw_metric){0};
    HW_GO(HW_NEW(&s, 1));
    s->threads = setup->threads;
    s->quadric = hw_metric_quadric(NULL);
    HW_GO(HW_NEW(&s->importance, setup->collapser->vertex_count));
    HW_GO(hw_mesh_copy(setup->mesh, &s->original));
    HW_GO(hw_mesh_compute_normals(&s->original));
    HW_GO(hw_rays_create_mesh(&s->rays, &s->original));
    HW_GO(weigh(s, setup));
    *out = (hw_metric){.name = "silhouette",
                       .context = s,
                       .placement = HW_PLACEMENT_OPTIMAL,
                       .prepare = prepare,
                       .error = error,
                       .optimum = optimum,
                       .collapsed = merge,
                       .finish = finish,
                       .destroy = destroy};
    s = NULL;
out:
    destroy(s);
    return status;
}
