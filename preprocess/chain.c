#include "chain.h"
#include "alloc.h"
#include "deviation.h"
#include "fit_shading.h"
#include "importance.h"
#include "parallel.h"
#include "pull_back.h"
#include "rays.h"
#include "simplify.h"
#include <math.h>
#include <string.h>

#define LEVEL_STEP         0.8408964152537146 // 2^(-1/4)
#define IMPORTANCE_LINES   32u
#define OUTLINE_VIEWS      8u
#define OUTLINE_RESOLUTION 1024u
#define DEVIATION_SAMPLES  4000u
#define SAMPLES_A_FACE     2u // of the original are enough
#define DEVIATION_LEAST    500u

typedef struct maker {
    const hw_mesh *original;
    hw_mesh welded; // its positions: what the engine works on
    hw_chain_options options;
    hw_rays *rays;
    hw_outline *outline;
    float *importance;
    hw_chain *chain;
} maker;

void hw_chain_free(hw_chain *chain)
{
    if (!chain)
        return;
    for (uint32_t i = 0; i < chain->level_count; i++)
        hw_mesh_free(&chain->levels[i]);
    hw_free(chain->levels);
    hw_free(chain->infos);
    memset(chain, 0, sizeof *chain);
}

static bool is_drawn(const maker *m, uint32_t level)
{
    return m->options.shade_step && level % m->options.shade_step == 0;
}

// Of a picture's squared error, shading that is off by s gives area * s^2, and an outline that is
// off by d gives its length * d * contrast^2. So s is as bad as an outline at full contrast that is
// off by s^2 times area / length; what a convex body shows from all sides is on average a quarter
// of its surface (Cauchy).
static float shading_as_length(const maker *m, float shading)
{
    double length = (double)hw_outline_length(m->outline);
    double area = hw_mesh_area(m->original) / 4;
    if (!(length > 0))
        length = 4 * sqrt(area); // of a sheet that lies flat
    return (float)(area / length * (double)shading * (double)shading);
}

static uint32_t samples_of(const hw_mesh *mesh)
{
    uint32_t faces = mesh->index_count / 3;
    if (faces >= DEVIATION_SAMPLES / SAMPLES_A_FACE)
        return DEVIATION_SAMPLES;
    return faces * SAMPLES_A_FACE > DEVIATION_LEAST ? faces * SAMPLES_A_FACE : DEVIATION_LEAST;
}

// Pulls vertices back, takes shading over, and measures.
static hw_status finish_level(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    maker *m = context;
    uint32_t l = (uint32_t)index + 1;
    hw_mesh *level = &m->chain->levels[l];
    hw_mesh_level_info *info = &m->chain->infos[l];
    HW_TRY(hw_pull_back(level, m->original, m->rays, m->options.pull_back, 1));
    HW_TRY(hw_mesh_compute_normals(level));
    if (is_drawn(m, l))
        HW_TRY(hw_fit_shading(level, m->original, m->rays));
    hw_deviation surface;
    float outline;
    HW_TRY(hw_surface_deviation(m->rays, m->original, level, samples_of(m->original), l, &surface));
    HW_TRY(hw_outline_deviation(m->outline, level, &outline));
    if (!(hw_outline_length(m->outline) > 0)) // a flat sheet: its rim is a small part of it
        outline = surface.max;
    *info = (hw_mesh_level_info){level->vertex_count,
                                 level->index_count,
                                 surface.rms,
                                 surface.p99,
                                 outline,
                                 is_drawn(m, l) ? shading_as_length(m, surface.shading) : 0};
    return HW_OK;
}

static hw_status collapse_levels(maker *m)
{
    hw_status status;
    hw_collapser *c = NULL;
    float *importance = NULL;
    hw_chain *chain = m->chain;
    HW_GO(hw_collapser_from_mesh(&m->welded, &c));
    HW_GO(HW_NEW(&importance, c->vertex_count));
    for (uint32_t v = 0; v < c->vertex_count; v++)
        importance[v] = m->importance[c->source[v]];
    hw_metric metric = hw_metric_quadric(importance);
    double faces = c->live_faces;
    while (chain->level_count < HW_MESH_LEVELS_MAX && faces * LEVEL_STEP >= m->options.face_floor) {
        faces *= LEVEL_STEP;
        uint32_t before = c->live_faces;
        hw_collapse_limits limits = {.faces = (uint32_t)faces, .cost = INFINITY};
        HW_GO(hw_collapser_run(c, &metric, &limits));
        if (c->live_faces == before)
            break; // nothing more can go
        HW_GO(hw_collapser_to_mesh(c, &chain->levels[chain->level_count]));
        chain->level_count++;
    }
out:
    hw_free(importance);
    hw_collapser_destroy(c);
    return status;
}

static void make_errors_monotone(hw_chain *chain)
{
    for (uint32_t l = 1; l < chain->level_count; l++) {
        hw_mesh_level_info *info = &chain->infos[l], *finer = &chain->infos[l - 1];
        info->error_rms = fmaxf(info->error_rms, finer->error_rms);
        info->error_p99 = fmaxf(info->error_p99, finer->error_p99);
        info->error_silhouette = fmaxf(info->error_silhouette, finer->error_silhouette);
        info->error_shading = fmaxf(info->error_shading, finer->error_shading);
    }
}

hw_status hw_chain_make(const hw_mesh *mesh, const hw_chain_options *options, hw_chain *out)
{
    hw_status status;
    maker m = {.original = mesh, .chain = out};
    memset(out, 0, sizeof *out);
    if (options)
        m.options = *options;
    else
        m.options.pull_back = -1;
    if (m.options.face_floor == 0)
        m.options.face_floor = 40;
    if (m.options.importance_floor == 0)
        m.options.importance_floor = 0.05f;
    if (m.options.pull_back < 0)
        m.options.pull_back = HW_PULL_BACK;
    HW_GO(HW_NEW(&out->levels, HW_MESH_LEVELS_MAX));
    HW_GO(HW_NEW(&out->infos, HW_MESH_LEVELS_MAX));
    HW_GO(hw_mesh_copy(mesh, &out->levels[0]));
    out->infos[0] =
        (hw_mesh_level_info){.vertex_count = mesh->vertex_count, .index_count = mesh->index_count};
    out->level_count = 1;
    if (!(hw_mesh_area(mesh) > 0))
        return HW_OK; // nothing to simplify, measure or see
    HW_GO(hw_rays_create_mesh(&m.rays, mesh));
    HW_GO(hw_outline_create(&m.outline, mesh, OUTLINE_VIEWS, OUTLINE_RESOLUTION));
    HW_GO(hw_mesh_weld_positions(mesh, &m.welded));
    HW_GO(hw_mesh_compute_normals(&m.welded));
    HW_GO(HW_NEW(&m.importance, m.welded.vertex_count));
    const hw_importance_options importance = {.lines = IMPORTANCE_LINES,
                                              .floor = m.options.importance_floor,
                                              .elevation_degrees = HW_IMPORTANCE_WALKER_DEGREES,
                                              .threads = m.options.threads};
    HW_GO(hw_silhouette_importance(&m.welded, m.rays, &importance, m.importance));
    HW_GO(collapse_levels(&m));
    HW_GO(hw_parallel_for(out->level_count - 1, m.options.threads, finish_level, &m, NULL));
    make_errors_monotone(out);
out:
    hw_free(m.importance);
    hw_mesh_free(&m.welded);
    hw_outline_destroy(m.outline);
    hw_rays_destroy(m.rays);
    if (status != HW_OK)
        hw_chain_free(out);
    return status;
}

uint32_t hw_chain_level_by_silhouette(const hw_chain *chain, double bound)
{
    uint32_t l = 0;
    while (l + 1 < chain->level_count && chain->infos[l + 1].error_silhouette <= bound)
        l++;
    return l;
}

uint32_t hw_chain_level_by_error(const hw_chain *chain, double bound)
{
    uint32_t l = 0;
    while (l + 1 < chain->level_count && chain->infos[l + 1].error_p99 <= bound)
        l++;
    return l;
}

uint32_t hw_chain_level_to_draw(const hw_chain *chain, uint32_t stride, double bound)
{
    uint32_t l = 0;
    while (l + stride < chain->level_count &&
           (double)hw_mesh_level_error(&chain->infos[l + stride]) <= bound)
        l += stride;
    return l;
}
