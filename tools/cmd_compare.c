// hexwalk compare: how far a simplified mesh is from its original.
#include "export.h"
#include "import.h"
#include "json.h"
#include "measures.h"
#include "options.h"
#include "outputs.h"
#include <stdlib.h>
#include <string.h>

static struct {
    const char *heatmap, *json;
    uint64_t samples, threads, seed;
    double tolerance;
    bool no_images;
} options = {.samples = 4u << 20, .tolerance = 0.5};

// --- Heat map ------------------------------------------------------------------------------------

// Viridis (Smith and van der Walt 2015) at eighths: even steps look even, in print and to the
// colour-blind too.
static hw_color8 heat_color(float share)
{
    static const uint8_t ramp[9][3] = {{68, 1, 84},    {71, 44, 122},  {59, 81, 139},
                                       {44, 113, 142}, {33, 144, 141}, {39, 173, 129},
                                       {92, 200, 99},  {170, 220, 50}, {253, 231, 37}};
    float place = fminf(fmaxf(share, 0), 1) * 8;
    int i = place >= 8 ? 7 : (int)place;
    float t = place - (float)i;
    uint8_t c[3];
    for (int k = 0; k < 3; k++)
        c[k] = (uint8_t)lroundf((float)ramp[i][k] * (1 - t) + (float)ramp[i + 1][k] * t);
    return (hw_color8){c[0], c[1], c[2], 255};
}

static int by_value(const void *x, const void *y)
{
    float a = *(const float *)x, b = *(const float *)y;
    return a < b ? -1 : a > b;
}

// The distance that ends the ramp: 99 of 100 vertices stay below. By the largest one, a single
// outlier would leave all else dark.
static hw_status choose_scale(const float *distances, uint32_t count, float *out)
{
    float *sorted = NULL;
    HW_TRY(HW_NEW(&sorted, count));
    memcpy(sorted, distances, count * sizeof *sorted);
    qsort(sorted, count, sizeof *sorted, by_value);
    *out = sorted[(uint64_t)(count - 1) * 99 / 100];
    if (!(*out > 0))
        *out = sorted[count - 1];
    hw_free(sorted);
    return HW_OK;
}

// Colours A's vertices by their distance to B, from 0 to *scale (in units of the mesh).
static hw_status write_heatmap(hw_mesh *a, const hw_rays *b, float *scale)
{
    hw_status status = HW_OK;
    float *distances = NULL;
    HW_GO(HW_NEW(&distances, a->vertex_count));
    HW_GO(HW_RESIZE(&a->colors, a->vertex_count));
    HW_GO(hw_vertex_distances(a, b, (uint32_t)options.threads, distances));
    HW_GO(choose_scale(distances, a->vertex_count, scale));
    for (uint32_t i = 0; i < a->vertex_count; i++)
        a->colors[i] = heat_color(*scale > 0 ? distances[i] / *scale : 0);
    HW_GO(hw_mesh_export_ply(a, options.heatmap));
out:
    hw_free(distances);
    return status;
}

// --- Report --------------------------------------------------------------------------------------

static void add_side(cJSON *metro, const char *key, const hw_surface_distance *d, double diagonal)
{
    cJSON *side = cJSON_AddObjectToObject(metro, key);
    hw_json_add_number(side, "max", d->max / diagonal * 100);
    hw_json_add_number(side, "mean", d->mean / diagonal * 100);
    hw_json_add_number(side, "rms", d->rms / diagonal * 100);
    hw_json_add_number(side, "standard_error", d->standard_error / diagonal * 100);
    hw_json_add_number(side, "samples", (double)d->samples);
    cJSON_AddBoolToObject(side, "converged", d->converged);
}

static void add_mesh(cJSON *json, const char *key, const hw_mesh *mesh, const hw_measures *m, int k)
{
    cJSON *object = cJSON_AddObjectToObject(json, key);
    hw_json_add_number(object, "triangles", mesh->index_count / 3);
    hw_json_add_number(object, "volume", m->volume[k]);
    hw_json_add_number(object, "open_edges", (double)m->open_edges[k]);
    hw_json_add_number(object, "k_sliver", m->sliver[k].ratio);
}

static hw_status write_report(const hw_mesh meshes[2], const hw_measures *m, float scale)
{
    cJSON *json = cJSON_CreateObject();
    cJSON *metro = cJSON_AddObjectToObject(json, "metro");
    add_side(metro, "forward", &m->forward, m->diagonal);
    add_side(metro, "backward", &m->backward, m->diagonal);
    hw_json_add_number(json, "k_vol", m->volume_ratio);
    hw_json_add_number(json, "k_sliver", m->sliver[1].ratio);
    hw_json_add_number(json, "k_l1", m->views.l1);
    hw_json_add_number(json, "k_l2", m->views.l2);
    hw_json_add_number(json, "k_sil", m->views.silhouette);
    hw_json_add_number(json, "k_sil_share", m->views.silhouette_share);
    hw_json_add_number(json, "model_pixels", m->views.model_pixels);
    hw_json_add_number(json, "diagonal", m->diagonal);
    hw_json_add_number(json, "floor", m->forward.floor / m->diagonal * 100);
    add_mesh(json, "mesh_a", &meshes[0], m, 0);
    add_mesh(json, "mesh_b", &meshes[1], m, 1);
    if (options.heatmap)
        hw_json_add_number(json, "heatmap_max", (double)scale / m->diagonal * 100);
    cJSON_AddItemToObject(json, "options", hw_options_json(&hw_cmd_compare));
    hw_status status = hw_json_write(options.json, json);
    cJSON_Delete(json);
    return status;
}

static void print_side(const char *name, const hw_surface_distance *d, double diagonal)
{
    double percent = 100 / diagonal;
    printf("%-22s %12.6f %12.6f %12.6f   +- %.2g in the mean, %llu samples%s\n", name,
           d->max * percent, d->mean * percent, d->rms * percent, d->standard_error * percent,
           (unsigned long long)d->samples, d->converged ? "" : ", not converged");
}

static void print_meshes(const hw_mesh meshes[2], const hw_measures *m)
{
    printf("%-22s %12s %12s\n", "", "A", "B");
    printf("%-22s %12u %12u\n", "triangles", meshes[0].index_count / 3, meshes[1].index_count / 3);
    printf("%-22s %12llu %12llu\n", "open edges", (unsigned long long)m->open_edges[0],
           (unsigned long long)m->open_edges[1]);
    printf("%-22s %12.6g %12.6g\n", "volume", m->volume[0], m->volume[1]);
    printf("%-22s %12.6f %12.6f\n", "K_sliver", m->sliver[0].ratio, m->sliver[1].ratio);
}

static void print_table(const hw_mesh meshes[2], const hw_measures *m, float scale)
{
    print_meshes(meshes, m);
    printf("\n%-22s %12s %12s %12s   percent of A's diagonal\n", "K_metro", "max", "mean", "RMS");
    print_side("A to B", &m->forward, m->diagonal);
    print_side("B to A", &m->backward, m->diagonal);
    if (isfinite(m->volume_ratio))
        printf("\n%-22s %12.6f%s\n", "K_vol", m->volume_ratio,
               m->open_edges[0] || m->open_edges[1] ? "   not closed: an estimate" : "");
    else
        printf("\n%-22s %12s   A has no volume\n", "K_vol", "-");
    if (!options.no_images) {
        printf("%-22s %12.6f\n%-22s %12.6f\n", "K_L1", m->views.l1, "K_L2", m->views.l2);
        printf("%-22s %12.2f   pixels a view, %.4f %% of A's %.0f\n", "K_sil", m->views.silhouette,
               m->views.silhouette_share * 100, m->views.model_pixels);
    }
    if (options.heatmap)
        printf("%-22s %12.6f   percent and more are yellow in %s\n", "heat map",
               (double)scale / m->diagonal * 100, options.heatmap);
}

// -------------------------------------------------------------------------------------------------

static hw_status check_outputs(const char *const *argv)
{
    HW_TRY(hw_output_extension("heatmap", options.heatmap, ".ply"));
    HW_TRY(hw_output_apart("heatmap", options.heatmap, 2, argv));
    return hw_output_apart("json", options.json, 2, argv);
}

static hw_status run(int argc, const char *const *argv)
{
    (void)argc;
    hw_status status = HW_OK;
    hw_mesh meshes[2] = {0};
    hw_rays *rays[2] = {0};
    hw_measures measures;
    float scale = 0;
    hw_measures_options o = {.distance = {.tolerance = options.tolerance / 100,
                                          .samples_max = options.samples,
                                          .seed = options.seed,
                                          .threads = (uint32_t)options.threads},
                             .no_images = options.no_images};
    HW_TRY(check_outputs(argv));
    for (int i = 0; i < 2; i++)
        HW_GO(hw_mesh_import(argv[i], &meshes[i]));
    for (int i = 0; i < 2; i++)
        HW_GO(hw_rays_create_mesh(&rays[i], &meshes[i]));
    HW_GO(hw_measures_take(rays[0], rays[1], &o, &measures));
    if (options.heatmap)
        HW_GO(write_heatmap(&meshes[0], rays[1], &scale));
    if (options.json)
        HW_GO(write_report(meshes, &measures, scale));
    print_table(meshes, &measures, scale);
out:
    for (int i = 0; i < 2; i++) {
        hw_rays_destroy(rays[i]);
        hw_mesh_free(&meshes[i]);
    }
    return status;
}

static uint32_t fill_options(hw_option *out, uint32_t capacity)
{
    const hw_option table[] = {
        {"samples", 0, HW_OPTION_UINT, &options.samples, "N", NULL, 16, 1e9,
         "Most points to sample on each surface."},
        {"tolerance", 0, HW_OPTION_DOUBLE, &options.tolerance, "PERCENT", NULL, 1e-6, 100,
         "Sample until the standard error of the mean distance is this share of it."},
        {"seed", 0, HW_OPTION_UINT, &options.seed, "S", NULL, 0, 0, "Another seed, other points."},
        {"no-images", 0, HW_OPTION_FLAG, &options.no_images, NULL, NULL, 0, 0,
         "Leave out K_L1, K_L2 and K_sil."},
        {"heatmap", 0, HW_OPTION_STRING, &options.heatmap, "OUT.ply", NULL, 0, 0,
         "Write A with its vertices coloured by their distance to B, dark blue to yellow."},
        {"threads", 0, HW_OPTION_UINT, &options.threads, "N", NULL, 0, 1024,
         "Threads; 0 means one per processor."},
        {"json", 0, HW_OPTION_STRING, &options.json, "FILE", NULL, 0, 0,
         "Write the figures as JSON too."},
    };
    uint32_t count = sizeof table / sizeof *table;
    for (uint32_t i = 0; i < count && i < capacity; i++)
        out[i] = table[i];
    return count;
}

const hw_command hw_cmd_compare = {
    .name = "compare",
    .summary = "Measure how far a mesh is from another.",
    .arguments = "MESH_A MESH_B",
    .description =
        "Compares a mesh B with its original A: distances between their surfaces both ways "
        "(K_metro, in percent of the diagonal of A's box), the ratio of volumes (K_vol, where both "
        "are closed), the shape of triangles (K_sliver, 1 is best), and over pictures from 42 "
        "directions the mean and root mean square difference of brightness (K_L1, K_L2) and the "
        "pixels that only one of both covers (K_sil). The same seed gives the same figures with "
        "any "
        "number of threads.",
    .options = fill_options,
    .positional_min = 2,
    .positional_max = 2,
    .run = run,
};
