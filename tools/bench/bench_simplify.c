// Simplification measured against meshoptimizer and, where it is installed, CGAL: distances,
// outlines, processor time and memory, all in one run.
//
//     bench_simplify STATUES [REPEATS]
#include "alloc.h"
#include "bench_cgal.h"
#include "fit.h"
#include "measures.h"
#include "meshoptimizer.h"
#include "metric.h"
#include "simplify.h"
#include "statues.h"
#include "system.h"
#include <malloc.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define REPEATS_MAX 15u
#define LEVELS      4u

// A mesh to simplify, closed as its scan allows and manifold, and what to judge by.
typedef struct subject {
    const char *name;
    hw_mesh mesh; // positions and indices, manifold
    hw_rays *rays;
    hw_views *views;
    double diagonal;
} subject;

typedef struct outcome {
    hw_mesh mesh;
    double seconds; // of this thread
} outcome;

typedef struct method {
    const char *name;
    hw_status (*run)(const struct method *method, const subject *subject, uint32_t faces,
                     outcome *out);
    const char *metric;
    uint32_t fit_rounds;
} method;

// ---- methods ---------------------------------------------------------------------------------

static hw_status run_ours(const method *m, const subject *s, uint32_t faces, outcome *out)
{
    hw_simplified result;
    const hw_simplify_options options = {.stages = {{.metric = hw_metric_find(m->metric)}},
                                         .stage_count = 1,
                                         .faces = faces,
                                         .threads = 1,
                                         .fit_rounds = m->fit_rounds};
    double start = hw_thread_seconds(); // the whole call: welding, engine, normals
    HW_TRY(hw_simplify(&s->mesh, &options, &result));
    out->seconds = hw_thread_seconds() - start;
    out->mesh = result.mesh;
    memset(&result.mesh, 0, sizeof result.mesh);
    hw_simplified_free(&result);
    return HW_OK;
}

static hw_status run_meshoptimizer(const method *m, const subject *s, uint32_t faces, outcome *out)
{
    (void)m;
    hw_mesh *mesh = &out->mesh;
    HW_TRY(hw_mesh_copy(&s->mesh, mesh));
    double start = hw_thread_seconds();
    size_t count = meshopt_simplify(mesh->indices, s->mesh.indices, s->mesh.index_count,
                                    &s->mesh.positions[0].x, s->mesh.vertex_count,
                                    sizeof *s->mesh.positions, (size_t)faces * 3, 1e9f, 0, NULL);
    out->seconds = hw_thread_seconds() - start;
    mesh->index_count = (uint32_t)count;
    return HW_OK;
}

#ifdef HW_BENCH_CGAL
static hw_status run_cgal(const method *m, const subject *s, uint32_t faces, outcome *out)
{
    hw_status status;
    double *positions = NULL;
    hw_mesh *mesh = &out->mesh;
    HW_GO(hw_mesh_copy(&s->mesh, mesh));
    HW_GO(HW_NEW(&positions, 3 * (size_t)mesh->vertex_count + 3 * (size_t)mesh->index_count));
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        positions[3 * (size_t)v] = (double)mesh->positions[v].x;
        positions[3 * (size_t)v + 1] = (double)mesh->positions[v].y;
        positions[3 * (size_t)v + 2] = (double)mesh->positions[v].z;
    }
    bench_cgal_policy policy =
        strstr(m->name, "Turk") ? BENCH_CGAL_LINDSTROM_TURK : BENCH_CGAL_GARLAND_HECKBERT;
    if (!bench_cgal_simplify(policy, positions, &mesh->vertex_count, mesh->indices,
                             &mesh->index_count, faces, &out->seconds))
        HW_GO(hw_fail(HW_FORMAT, "%s: CGAL cannot simplify it", s->name));
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        mesh->positions[v] =
            hw_v3((float)positions[3 * (size_t)v], (float)positions[3 * (size_t)v + 1],
                  (float)positions[3 * (size_t)v + 2]);
out:
    hw_free(positions);
    return status;
}
#endif

static const method methods[] = {
    {"quadric", run_ours, "quadric", 0},
    {"volume", run_ours, "volume", 0},
    {"volume, fitted once", run_ours, "volume", 1},
    {"volume, fitted twice", run_ours, "volume", 2},
    {"silhouette", run_ours, "silhouette", 0},
    {"qem", run_ours, "qem", 0},
    {"meshoptimizer", run_meshoptimizer, NULL, 0},
#ifdef HW_BENCH_CGAL
    {"CGAL Lindstrom-Turk", run_cgal, NULL, 0},
    {"CGAL Garland-Heckbert", run_cgal, NULL, 0},
#endif
};
#define METHODS (sizeof methods / sizeof *methods)

// ---- subjects --------------------------------------------------------------------------------

static void subject_free(subject *s)
{
    hw_views_destroy(s->views);
    hw_rays_destroy(s->rays);
    hw_mesh_free(&s->mesh);
}

// Sheets are split before anybody starts, so that all get the same manifold.
static hw_status subject_load(const char *name, const char *folder, subject *s)
{
    hw_status status;
    hw_mesh statue = {0}, welded = {0};
    hw_collapser *c = NULL;
    const hw_statue *entry = hw_statue_find(name);
    memset(s, 0, sizeof *s);
    s->name = name;
    if (!entry)
        return hw_fail(HW_NOT_FOUND, "%s: no such statue", name);
    HW_GO(hw_statue_load(entry, folder, &statue));
    HW_GO(hw_mesh_weld_positions(&statue, &welded));
    HW_GO(hw_collapser_from_mesh(&welded, &c));
    HW_GO(hw_collapser_to_mesh(c, &s->mesh));
    HW_GO(hw_rays_create_mesh(&s->rays, &s->mesh));
    HW_GO(hw_views_create(&s->views, s->rays, hw_view_frame_fit(&s->mesh, NULL), 0));
    s->diagonal = (double)hw_box_diagonal(hw_mesh_bounds(&s->mesh));
out:
    hw_collapser_destroy(c);
    hw_mesh_free(&statue);
    hw_mesh_free(&welded);
    return status;
}

// ---- tables ----------------------------------------------------------------------------------

static int by_value(const void *x, const void *y)
{
    double a = *(const double *)x, b = *(const double *)y;
    return a < b ? -1 : a > b;
}

static hw_status silhouette_of(const subject *s, const hw_mesh *mesh, double *out)
{
    hw_rays *rays = NULL;
    hw_view_errors errors;
    HW_TRY(hw_rays_create_mesh(&rays, mesh));
    hw_status status = hw_views_compare(s->views, rays, 0, &errors);
    hw_rays_destroy(rays);
    *out = errors.silhouette;
    return status;
}

static hw_status judge(const subject *s, const method *m, const hw_mesh *mesh, double seconds)
{
    hw_status status;
    hw_rays *rays = NULL;
    hw_surface_distance there, back;
    double silhouette, percent = 100 / s->diagonal;
    HW_GO(hw_rays_create_mesh(&rays, mesh));
    HW_GO(hw_surface_distance_measure(s->rays, rays, NULL, &there));
    HW_GO(hw_surface_distance_measure(rays, s->rays, NULL, &back));
    HW_GO(silhouette_of(s, mesh, &silhouette));
    printf("%-22s %8u  %8.5f %8.5f %8.5f  %8.5f %8.5f  %10.6f  %8.2f  %8.2f\n", m->name,
           mesh->index_count / 3, there.mean * percent, back.mean * percent,
           (there.mean + back.mean) / 2 * percent, there.rms * percent, back.rms * percent,
           hw_mesh_volume(mesh) / hw_mesh_volume(&s->mesh), silhouette, seconds);
out:
    hw_rays_destroy(rays);
    return status;
}

// All methods in turn, `repeats` times; the median of their times.
static hw_status compare_methods(const subject *s, uint32_t faces, uint32_t repeats)
{
    hw_status status = HW_OK;
    outcome results[METHODS] = {0};
    double seconds[METHODS][REPEATS_MAX];
    printf("\n%s, %u -> %u triangles\n%-22s %8s  %8s %8s %8s  %8s %8s  %10s  %8s  %8s\n", s->name,
           s->mesh.index_count / 3, faces, "", "faces", "there", "back", "mean", "RMS th.",
           "RMS back", "volume", "K_sil", "CPU s");
    for (uint32_t r = 0; r < repeats; r++)
        for (size_t m = 0; m < METHODS; m++) {
            hw_mesh_free(&results[m].mesh);
            HW_GO(methods[m].run(&methods[m], s, faces, &results[m]));
            seconds[m][r] = results[m].seconds;
        }
    for (size_t m = 0; m < METHODS; m++) {
        qsort(seconds[m], repeats, sizeof seconds[m][0], by_value);
        HW_GO(judge(s, &methods[m], &results[m].mesh, seconds[m][repeats / 2]));
        fflush(stdout);
    }
out:
    for (size_t m = 0; m < METHODS; m++)
        hw_mesh_free(&results[m].mesh);
    return status;
}

static hw_status outline_row(const subject *s, const method *m)
{
    static const double ratios[LEVELS] = {0.25, 0.1, 0.03, 0.01};
    hw_status status = HW_OK;
    for (uint32_t l = 0; l < LEVELS && status == HW_OK; l++) {
        outcome out = {0};
        double silhouette = NAN;
        status = m->run(m, s, (uint32_t)(ratios[l] * (s->mesh.index_count / 3)), &out);
        if (status == HW_OK)
            status = silhouette_of(s, &out.mesh, &silhouette);
        hw_mesh_free(&out.mesh);
        printf(" %10.2f", silhouette);
    }
    printf("\n");
    fflush(stdout);
    return status;
}

// K_sil of four methods at four sizes.
static hw_status outline_table(const char *const *names, uint32_t count, const char *folder)
{
    static const char *const rows[] = {"silhouette", "quadric", "volume", "meshoptimizer"};
    hw_status status = HW_OK;
    printf("\nK_sil, pixels a view, at 25, 10, 3 and 1 percent of the triangles\n");
    for (uint32_t i = 0; i < count && status == HW_OK; i++) {
        subject s;
        HW_TRY(subject_load(names[i], folder, &s));
        for (uint32_t r = 0; r < 4 && status == HW_OK; r++) {
            const method *m = methods;
            while (strcmp(m->name, rows[r]) != 0)
                m++;
            printf("%-12s %-14s", r == 0 ? names[i] : "", rows[r]);
            status = outline_row(&s, m);
        }
        subject_free(&s);
    }
    return status;
}

// All measures of the metrics and placements of table 4.1 of the dissertation, and of ours.
static hw_status measure_table(const subject *s)
{
    static const struct {
        const char *metric, *bits;
        hw_placement placement;
    } rows[] = {
        {"edge", "0", HW_PLACEMENT_MIDPOINT},        {"uvol", "2", HW_PLACEMENT_SUBSET},
        {"quadric", "2", HW_PLACEMENT_SUBSET},       {"pm", "2", HW_PLACEMENT_SUBSET},
        {"hybrid", "2", HW_PLACEMENT_SUBSET},        {"hybrid", "0", HW_PLACEMENT_MIDPOINT},
        {"hybrid", "1", HW_PLACEMENT_ENDS},          {"norm", "2", HW_PLACEMENT_SUBSET},
        {"quadric", "free", HW_PLACEMENT_OPTIMAL},   {"volume", "free", HW_PLACEMENT_OPTIMAL},
        {"pm", "free", HW_PLACEMENT_OPTIMAL},        {"hybrid", "free", HW_PLACEMENT_OPTIMAL},
        {"silhouette", "free", HW_PLACEMENT_OPTIMAL}};
    printf("\n%s at a tenth of %u triangles\n%-12s %-5s %9s %9s %9s %9s %9s %9s\n", s->name,
           s->mesh.index_count / 3, "metric", "bits", "K_metro", "K_vol", "K_sliver", "K_L1",
           "K_L2", "K_sil");
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        hw_simplified out;
        hw_rays *rays = NULL;
        hw_measures m;
        const hw_simplify_options options = {.stages = {{.metric = hw_metric_find(rows[i].metric)}},
                                             .stage_count = 1,
                                             .placement_set = true,
                                             .placement = rows[i].placement,
                                             .faces = s->mesh.index_count / 30};
        HW_TRY(hw_simplify(&s->mesh, &options, &out));
        hw_status status = hw_rays_create_mesh(&rays, &out.mesh);
        if (status == HW_OK)
            status = hw_measures_take(s->rays, rays, NULL, &m);
        hw_rays_destroy(rays);
        hw_simplified_free(&out);
        HW_TRY(status);
        printf("%-12s %-5s %9.5f %9.6f %9.4f %9.5f %9.5f %9.2f\n", rows[i].metric, rows[i].bits,
               (m.forward.mean + m.backward.mean) / 2 / s->diagonal * 100, m.volume_ratio,
               m.sliver[1].ratio, m.views.l1, m.views.l2, m.views.silhouette);
        fflush(stdout);
    }
    return HW_OK;
}

// Time of one error evaluation, all edges of the mesh in turn (GeMS, table 1).
static hw_status evaluation_table(const subject *s, uint32_t repeats)
{
    static const struct {
        const char *metric;
        hw_placement placement;
        const char *shown;
        double paper; // microseconds, Athlon 500 MHz
    } rows[] = {{"edge", HW_PLACEMENT_MIDPOINT, "fixed", 0.43},
                {"pm", HW_PLACEMENT_SUBSET, "subset", 13.0},
                {"uvol", HW_PLACEMENT_SUBSET, "subset", 0},
                {"hybrid", HW_PLACEMENT_SUBSET, "subset", 90.5},
                {"quadric", HW_PLACEMENT_OPTIMAL, "unconstrained", 218.0},
                {"volume", HW_PLACEMENT_OPTIMAL, "unconstrained", 0}};
    enum { ROWS = sizeof rows / sizeof *rows };
    hw_status status;
    hw_collapser *c = NULL;
    double times[ROWS][REPEATS_MAX], sum = 0;
    uint64_t edges = 0;
    HW_GO(hw_collapser_from_mesh(&s->mesh, &c));
    for (uint32_t r = 0; r < repeats; r++)
        for (int i = 0; i < ROWS; i++) {
            hw_metric metric;
            const hw_metric_setup setup = {.collapser = c, .mesh = &s->mesh};
            HW_GO(hw_metric_create(hw_metric_find(rows[i].metric), &setup, &metric));
            metric.placement = rows[i].placement;
            edges = 0;
            double start = hw_thread_seconds();
            for (uint32_t f = 0; f < c->face_count; f++)
                for (int k = 0; c->faces[f][0] != HW_NO_VERTEX && k < 3; k++) {
                    uint32_t a = c->faces[f][k], b = c->faces[f][(k + 1) % 3];
                    hw_collapse out;
                    if (a > b)
                        continue;
                    hw_metric_evaluate(&metric, c, a, b, &out);
                    sum += out.cost < 1e300 ? out.cost : 0;
                    edges++;
                }
            times[i][r] = (hw_thread_seconds() - start) / (double)edges;
            hw_metric_destroy(&metric);
        }
    printf(
        "\ntime of one error evaluation, %llu edges of %s (checksum %g)\n%-10s %-14s %10s %16s\n",
        (unsigned long long)edges, s->name, sum, "metric", "placement", "ns", "GeMS, ns");
    for (int i = 0; i < ROWS; i++) {
        qsort(times[i], repeats, sizeof times[i][0], by_value);
        printf("%-10s %-14s %10.1f", rows[i].metric, rows[i].shown, times[i][repeats / 2] * 1e9);
        if (rows[i].paper > 0)
            printf(" %16.0f", rows[i].paper * 1e3);
        printf("\n");
    }
out:
    hw_collapser_destroy(c);
    return status;
}

// Faces after each batch (GeMS, figure 12).
static hw_status print_level(void *context, uint32_t batch, const hw_mesh *mesh)
{
    uint32_t *before = context;
    printf(" %u (%.2f)", mesh->index_count / 3, (double)mesh->index_count / 3 / *before);
    *before = mesh->index_count / 3;
    (void)batch;
    return HW_OK;
}

static hw_status batch_table(const subject *s)
{
    static const char *const metrics[] = {"quadric", "volume", "hybrid", "edge"};
    printf("\ntriangles after each batch of %s, and the ratio to the batch before\n", s->name);
    for (uint32_t i = 0; i < 4; i++) {
        hw_simplified out;
        uint32_t before = s->mesh.index_count / 3;
        const hw_simplify_options options = {.stages = {{.metric = hw_metric_find(metrics[i])}},
                                             .stage_count = 1,
                                             .batched = true,
                                             .faces = before / 200,
                                             .level = print_level,
                                             .level_context = &before};
        printf("%-10s %u", metrics[i], before);
        HW_TRY(hw_simplify(&s->mesh, &options, &out));
        printf("\n");
        hw_simplified_free(&out);
    }
    return HW_OK;
}

// From here on hw_rss_peak_bytes tells of what comes.
static void reset_peak(void)
{
    malloc_trim(0);
    FILE *file = fopen("/proc/self/clear_refs", "we");
    if (!file)
        return;
    fputs("5", file); // see proc(5)
    fclose(file);
}

// Peak memory of the engine on a large mesh, beyond the mesh itself.
static hw_status large_mesh(const char *folder)
{
    hw_status status;
    hw_mesh statue = {0}, welded = {0};
    hw_collapser *c = NULL;
    const hw_metric_kind *kind = hw_metric_find("quadric");
    HW_GO(hw_statue_load(hw_statue_find("dragon-full"), folder, &statue));
    HW_GO(hw_mesh_weld_positions(&statue, &welded));
    hw_mesh_free(&statue);
    uint32_t faces = welded.index_count / 3;
    reset_peak();
    uint64_t before = hw_rss_bytes();
    double start = hw_thread_seconds();
    HW_GO(hw_collapser_from_mesh(&welded, &c));
    const hw_metric_setup setup = {.collapser = c, .mesh = &welded};
    hw_metric metric;
    HW_GO(hw_metric_create(kind, &setup, &metric));
    const hw_collapse_limits limits = {.faces = faces / 100, .cost = INFINITY};
    HW_GO(hw_collapser_run(c, &metric, &limits));
    double seconds = hw_thread_seconds() - start;
    uint64_t peak = hw_rss_peak_bytes();
    printf(
        "dragon-full, %u -> %u triangles by %s: %.2f CPU s, %.0f MB more at the peak, %.0f bytes "
        "a triangle\n",
        faces, c->live_faces, kind->name, seconds, (double)(peak - before) / 1e6,
        (double)(peak - before) / faces);
    hw_metric_destroy(&metric);
out:
    hw_collapser_destroy(c);
    hw_mesh_free(&statue);
    hw_mesh_free(&welded);
    return status;
}

static hw_status bench(const char *folder, uint32_t repeats)
{
    static const char *const outlines[] = {"dragon", "bunny", "armadillo", "elephant"};
    hw_status status;
    subject dragon = {0}, bunny = {0};
    HW_GO(large_mesh(folder));
    HW_GO(subject_load("dragon", folder, &dragon));
    HW_GO(evaluation_table(&dragon, repeats));
    HW_GO(batch_table(&dragon));
    HW_GO(compare_methods(&dragon, 20252, repeats));
    HW_GO(compare_methods(&dragon, 2025, repeats));
    HW_GO(subject_load("bunny", folder, &bunny));
    HW_GO(compare_methods(&bunny, 6966, repeats));
    HW_GO(measure_table(&bunny));
    HW_GO(outline_table(outlines, 4, folder));
out:
    subject_free(&dragon);
    subject_free(&bunny);
    return status;
}

int main(int argc, char **argv)
{
    uint32_t repeats = argc > 2 ? (uint32_t)strtoul(argv[2], NULL, 10) : 3;
    if (argc < 2 || argc > 3 || repeats < 1 || repeats > REPEATS_MAX) {
        fprintf(stderr,
                "usage: bench_simplify STATUES [REPEATS]\n"
                "STATUES is filled by tools/fetch-statues --dragon; REPEATS 1 to %u, default 3\n",
                REPEATS_MAX);
        return 2;
    }
    printf("distances in percent of the bounding box's diagonal: there = from the original, back = "
           "to it\n");
    if (bench(argv[1], repeats) != HW_OK) {
        fprintf(stderr, "bench_simplify: %s\n", hw_error_text());
        return 1;
    }
    return 0;
}
