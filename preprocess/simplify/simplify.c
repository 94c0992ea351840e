#include "simplify.h"
#include "alloc.h"
#include "fit.h"
#include "pull_back.h"
#include "rays.h"
#include "recorder.h"
#include "system.h"
#include <math.h>
#include <string.h>

// ---- meshes and collapsers -------------------------------------------------------------------

hw_status hw_mesh_weld_positions(const hw_mesh *mesh, hw_mesh *out)
{
    hw_status status;
    uint32_t *weld = NULL;
    memset(out, 0, sizeof *out);
    HW_GO(HW_NEW(&weld, mesh->vertex_count));
    HW_GO(HW_NEW(&out->positions, mesh->vertex_count));
    HW_GO(HW_NEW(&out->indices, mesh->index_count));
    HW_GO(hw_mesh_weld_map(mesh, weld));
    for (uint32_t v = 0; v < mesh->vertex_count; v++) { // a first of its place comes before others
        if (weld[v] != v) {
            weld[v] = weld[weld[v]];
            continue;
        }
        weld[v] = out->vertex_count;
        out->positions[out->vertex_count++] = mesh->positions[v];
    }
    out->index_count = mesh->index_count;
    for (uint32_t i = 0; i < mesh->index_count; i++)
        out->indices[i] = weld[mesh->indices[i]];
out:
    hw_free(weld);
    if (status != HW_OK)
        hw_mesh_free(out);
    return status;
}

hw_status hw_collapser_from_mesh(const hw_mesh *welded, hw_collapser **out)
{
    hw_status status;
    double(*positions)[3] = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&positions, welded->vertex_count));
    for (uint32_t v = 0; v < welded->vertex_count; v++) {
        positions[v][0] = (double)welded->positions[v].x;
        positions[v][1] = (double)welded->positions[v].y;
        positions[v][2] = (double)welded->positions[v].z;
    }
    HW_GO(hw_collapser_create((const double(*)[3])positions, welded->vertex_count, welded->indices,
                              welded->index_count / 3, NULL, HW_COMPLEX_SPLIT, out));
out:
    hw_free(positions);
    return status;
}

hw_status hw_collapser_to_mesh(const hw_collapser *c, hw_mesh *out)
{
    hw_status status;
    uint32_t *vertices = NULL;
    memset(out, 0, sizeof *out);
    HW_GO(HW_NEW(&vertices, c->vertex_count));
    HW_GO(HW_NEW(&out->indices, 3 * (size_t)c->live_faces));
    out->index_count = 3 * c->live_faces;
    out->vertex_count = hw_collapser_extract(c, vertices, out->indices);
    HW_GO(HW_NEW(&out->positions, out->vertex_count));
    for (uint32_t v = 0; v < out->vertex_count; v++) {
        const double *p = c->positions[vertices[v]];
        out->positions[v] = hw_v3((float)p[0], (float)p[1], (float)p[2]);
    }
out:
    hw_free(vertices);
    if (status != HW_OK)
        hw_mesh_free(out);
    return status;
}

// ---- the run ---------------------------------------------------------------------------------

typedef struct run {
    const hw_mesh *original;
    const hw_simplify_options *options;
    hw_mesh welded; // snapped to the grid, if there is one
    hw_collapser *collapser;
    hw_recorder *recorder; // may be NULL
    hw_metric metric;      // of the stage in progress
    hw_simplified *out;
    double kappa;
} run;

static hw_status start_metric(run *r, const hw_metric_kind *kind)
{
    const hw_simplify_options *o = r->options;
    const hw_metric_setup setup = {.collapser = r->collapser,
                                   .mesh = &r->welded,
                                   .kappa = r->kappa,
                                   .eye = o->eye,
                                   .focal_px = o->focal_px,
                                   .elevation_degrees = o->elevation_degrees,
                                   .threads = o->threads};
    hw_metric_destroy(&r->metric);
    HW_TRY(hw_metric_create(kind, &setup, &r->metric));
    if (o->placement_set)
        r->metric.placement = o->placement;
    hw_collapser_forget_queue(r->collapser);
    return HW_OK;
}

static hw_status collapse(run *r, const hw_collapse_limits *limits, uint32_t *collapses)
{
    double start = hw_thread_seconds();
    hw_status status;
    if (r->options->batched)
        status = hw_collapser_run_batch(r->collapser, &r->metric, limits, collapses);
    else
        status = hw_collapser_run(r->collapser, &r->metric, limits);
    r->out->facts.seconds += hw_thread_seconds() - start;
    return status;
}

static hw_status tell_level(const run *r)
{
    hw_mesh level;
    if (!r->options->level)
        return HW_OK;
    HW_TRY(hw_collapser_to_mesh(r->collapser, &level));
    hw_status status = hw_mesh_compute_normals(&level);
    if (status == HW_OK)
        status = r->options->level(r->options->level_context, r->out->facts.batches, &level);
    hw_mesh_free(&level);
    return status;
}

static hw_status run_batches(run *r, const hw_metric_kind *kind, const hw_collapse_limits *limits)
{
    for (;;) {
        uint32_t collapses = 0;
        HW_TRY(collapse(r, limits, &collapses));
        if (collapses == 0)
            return HW_OK;
        if (r->recorder)
            HW_TRY(hw_recorder_end_batch(r->recorder));
        r->out->facts.batches++;
        HW_TRY(tell_level(r));
        if (kind->uses_kappa && r->options->kappa_decay > 0) {
            r->kappa *= r->options->kappa_decay;
            HW_TRY(start_metric(r, kind));
        }
    }
}

static hw_status run_stage(run *r, const hw_simplify_stage *stage, bool last)
{
    const hw_simplify_options *o = r->options;
    hw_collapse_limits limits = {.faces = o->faces, .vertices = o->vertices, .cost = INFINITY};
    if (last && o->error > 0)
        limits.cost = o->error;
    uint32_t until = last ? 0 : (uint32_t)(stage->until * r->out->facts.faces_before);
    if (limits.faces < until)
        limits.faces = until;
    if (r->collapser->live_faces <= limits.faces)
        return HW_OK;
    HW_TRY(start_metric(r, stage->metric));
    if (o->batched)
        return run_batches(r, stage->metric, &limits);
    return collapse(r, &limits, NULL);
}

static hw_status prepare(run *r)
{
    const hw_position_grid *grid = r->options->grid;
    HW_TRY(hw_mesh_weld_positions(r->original, &r->welded));
    for (uint32_t v = 0; grid && v < r->welded.vertex_count; v++) {
        hw_vec3 *p = &r->welded.positions[v];
        double snapped[3] = {(double)p->x, (double)p->y, (double)p->z};
        hw_position_grid_snap(grid, snapped);
        *p = hw_v3((float)snapped[0], (float)snapped[1], (float)snapped[2]);
    }
    HW_TRY(hw_collapser_from_mesh(&r->welded, &r->collapser));
    const hw_collapser *c = r->collapser;
    r->out->facts = (hw_simplify_facts){.faces_before = r->welded.index_count / 3,
                                        .vertices_before = r->welded.vertex_count,
                                        .dropped_faces = c->dropped_faces,
                                        .split_vertices = c->vertex_count - r->welded.vertex_count,
                                        .complex_edges = c->complex_edges,
                                        .border_edges = c->border_edges};
    r->kappa = r->options->kappa > 0 ? r->options->kappa : HW_PM_KAPPA;
    if (grid)
        HW_TRY(hw_recorder_create(r->collapser, grid, &r->recorder));
    return HW_OK;
}

// What the metric still does for the mesh, fitting, colours, normals of its own.
static hw_status finish_mesh(run *r)
{
    hw_status status;
    hw_rays *rays = NULL;
    hw_mesh *mesh = &r->out->mesh;
    const hw_fit_options fit = {.rounds = r->options->fit_rounds, .threads = r->options->threads};
    HW_GO(hw_collapser_to_mesh(r->collapser, mesh));
    if (mesh->index_count > 0 && r->metric.finish)
        HW_GO(r->metric.finish(r->metric.context, mesh));
    if (mesh->index_count > 0 && (fit.rounds > 0 || r->original->colors)) {
        HW_GO(hw_rays_create_mesh(&rays, r->original));
        double start = hw_thread_seconds();
        HW_GO(hw_fit(mesh, rays, &fit));
        r->out->facts.fit_seconds = hw_thread_seconds() - start;
        HW_GO(hw_pull_back(mesh, r->original, rays, 0, r->options->threads));
    }
    HW_GO(hw_mesh_compute_normals(mesh));
    if (r->original->name)
        HW_GO(hw_strdup(&mesh->name, r->original->name));
out:
    hw_rays_destroy(rays);
    return status;
}

static hw_status check(const hw_mesh *mesh, const hw_simplify_options *o)
{
    HW_TRY(hw_mesh_validate(mesh));
    if (o->stage_count > HW_SIMPLIFY_STAGES_MAX)
        return hw_fail(HW_USAGE, "at most %d metrics may follow each other",
                       HW_SIMPLIFY_STAGES_MAX);
    for (uint32_t i = 0; i + 1 < o->stage_count; i++)
        if (!(o->stages[i].until > 0 && o->stages[i].until <= 1) ||
            (i > 0 && !(o->stages[i].until < o->stages[i - 1].until)))
            return hw_fail(HW_USAGE, "metrics must end at falling shares of the faces");
    return HW_OK;
}

hw_status hw_simplify(const hw_mesh *mesh, const hw_simplify_options *options, hw_simplified *out)
{
    hw_status status;
    run r = {.original = mesh, .options = options, .out = out};
    const hw_simplify_stage alone = {.metric = hw_metric_find("quadric")};
    memset(out, 0, sizeof *out);
    HW_GO(check(mesh, options));
    HW_GO(prepare(&r));
    if (options->stage_count == 0)
        HW_GO(run_stage(&r, &alone, true));
    for (uint32_t i = 0; i < options->stage_count; i++)
        HW_GO(run_stage(&r, &options->stages[i], i + 1 == options->stage_count));
    HW_GO(finish_mesh(&r));
    if (r.recorder)
        HW_GO(hw_recorder_finish(r.recorder, r.welded.indices, r.welded.vertex_count,
                                 options->keep_order, &out->progressive));
out:
    hw_metric_destroy(&r.metric);
    hw_recorder_destroy(r.recorder);
    hw_collapser_destroy(r.collapser);
    hw_mesh_free(&r.welded);
    if (status != HW_OK)
        hw_simplified_free(out);
    return status;
}

void hw_simplified_free(hw_simplified *s)
{
    hw_mesh_free(&s->mesh);
    hw_progressive_destroy(s->progressive);
    memset(s, 0, sizeof *s);
}
