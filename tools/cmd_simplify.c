// hexwalk simplify: one mesh made smaller, by any metric, as a mesh or as a progressive mesh.
#include "alloc.h"
#include "export.h"
#include "file.h"
#include "import.h"
#include "json.h"
#include "log.h"
#include "options.h"
#include "outputs.h"
#include "progressive_file.h"
#include "simplify.h"
#include "system.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct {
    const char *output, *metric, *placement, *hierarchy, *progressive, *levels, *eye, *precision,
        *json;
    uint64_t faces, vertices, bytes, fit, threads;
    double ratio, error, kappa, kappa_decay, fov, height;
    bool keep_order;
} options = {.metric = "quadric",
             .placement = "default",
             .hierarchy = "linear",
             .precision = "lossless",
             .kappa_decay = 1,
             .fov = 60,
             .height = 1024};

static hw_status take_level(void *context, uint32_t batch, const hw_mesh *mesh);

// ---- options to a plan -----------------------------------------------------------------------

// "edge:0.5,quadric": each but the last ends at a share of the faces.
static hw_status parse_stages(const char *text, hw_simplify_options *out)
{
    hw_status status = HW_OK;
    char *copy = NULL, *rest;
    HW_TRY(hw_strdup(&copy, text));
    rest = copy;
    while (rest) {
        char *name = rest, *share;
        rest = strchr(rest, ',');
        if (rest)
            *rest++ = 0;
        share = strchr(name, ':');
        if (share)
            *share++ = 0;
        if (out->stage_count == HW_SIMPLIFY_STAGES_MAX)
            HW_GO(hw_fail(HW_USAGE, "--metric names more than %d", HW_SIMPLIFY_STAGES_MAX));
        hw_simplify_stage *stage = &out->stages[out->stage_count++];
        stage->metric = hw_metric_find(name);
        if (!stage->metric)
            HW_GO(hw_fail(HW_USAGE, "--metric %s: there is no metric '%s'", text, name));
        char *end = share;
        stage->until = share ? strtod(share, &end) : 0;
        if ((rest != NULL) != (share != NULL) ||
            (share && (end == share || *end || !(stage->until > 0 && stage->until < 1))))
            HW_GO(hw_fail(HW_USAGE,
                          "--metric %s: each metric but the last needs ':' and a share "
                          "of the faces between 0 and 1",
                          text));
    }
out:
    hw_free(copy);
    return status;
}

static hw_status parse_eye(const char *text, hw_vec3 *out)
{
    double v[3];
    char tail;
    if (sscanf(text, "%lf,%lf,%lf%c", &v[0], &v[1], &v[2], &tail) != 3 || !isfinite(v[0]) ||
        !isfinite(v[1]) || !isfinite(v[2]))
        return hw_fail(HW_USAGE, "--eye %s: three numbers are needed, X,Y,Z", text);
    *out = hw_v3((float)v[0], (float)v[1], (float)v[2]);
    return HW_OK;
}

// 0 for lossless.
static hw_status parse_precision(const char *text, uint32_t *bits)
{
    char *end;
    *bits = 0;
    if (strcmp(text, "lossless") == 0)
        return HW_OK;
    long value = strtol(text, &end, 10);
    if (end == text || *end || value < 8 || value > 24)
        return hw_fail(HW_USAGE, "--precision %s: 'lossless' or 8 to 24 bits", text);
    *bits = (uint32_t)value;
    return HW_OK;
}

static hw_status check_outputs(const char *const *argv)
{
    HW_TRY(hw_output_apart("json", options.json, 1, argv));
    if (!options.output && !options.progressive)
        return hw_fail(HW_USAGE, "-o MESH or --progressive FILE.hxp is needed");
    if (options.output && !hw_path_ends_with(options.output, ".ply") &&
        !hw_path_ends_with(options.output, ".glb"))
        return hw_fail(HW_USAGE, "%s: meshes are written as .ply or .glb", options.output);
    if (options.progressive && !hw_path_ends_with(options.progressive, ".hxp"))
        return hw_fail(HW_USAGE, "%s: progressive meshes end in .hxp", options.progressive);
    if (options.faces > 0 && options.ratio > 0)
        return hw_fail(HW_USAGE, "--faces and --ratio contradict each other");
    if (options.bytes > 0 && !options.progressive)
        return hw_fail(HW_USAGE, "--bytes is the size of a progressive mesh: --progressive too");
    if (options.levels && strcmp(options.hierarchy, "batched") != 0)
        return hw_fail(HW_USAGE, "--levels writes one mesh per batch: --hierarchy batched too");
    if (options.keep_order && !options.progressive)
        return hw_fail(HW_USAGE, "--keep-order is about a progressive mesh: --progressive too");
    return HW_OK;
}

static hw_status check_limits(const hw_mesh *mesh)
{
    uint64_t faces = mesh->index_count / 3;
    if (options.faces > faces)
        hw_log_warning("--faces %llu: the mesh has only %llu and stays as it is",
                       (unsigned long long)options.faces, (unsigned long long)faces);
    if (options.vertices > mesh->vertex_count)
        hw_log_warning("--vertices %llu: the mesh has only %u and stays as it is",
                       (unsigned long long)options.vertices, mesh->vertex_count);
    if (!(options.faces || options.ratio > 0 || options.vertices || options.error > 0 ||
          options.progressive || options.levels))
        return hw_fail(HW_USAGE, "how far? --faces, --ratio, --vertices or --error is needed");
    return HW_OK;
}

static uint32_t clamp_u32(uint64_t value)
{
    return value < UINT32_MAX ? (uint32_t)value : UINT32_MAX;
}

// --ratio of the faces, at least one: 0 would be no limit.
static uint32_t share_of(uint32_t faces)
{
    return (uint32_t)fmax(options.ratio * faces, 1);
}

static hw_status plan(const hw_mesh *mesh, hw_simplify_options *out, hw_position_grid *grid)
{
    static const char *const placements[] = {"0", "1", "2", "optimal"};
    uint32_t bits;
    HW_TRY(check_limits(mesh));
    HW_TRY(parse_stages(options.metric, out));
    HW_TRY(parse_precision(options.precision, &bits));
    for (uint32_t i = 0; i < 4; i++)
        if (strcmp(options.placement, placements[i]) == 0) {
            out->placement_set = true;
            out->placement = (hw_placement)i;
        }
    for (uint32_t i = 0; i < out->stage_count; i++)
        if (out->stages[i].metric->needs_eye && !options.eye)
            return hw_fail(HW_USAGE, "the metric %s needs --eye X,Y,Z",
                           out->stages[i].metric->name);
    if (options.eye)
        HW_TRY(parse_eye(options.eye, &out->eye));
    out->focal_px = options.height / 2 / tan(options.fov * HW_PI / 360);
    out->kappa = options.kappa;
    out->kappa_decay = options.kappa_decay;
    out->fit_rounds = clamp_u32(options.fit);
    out->threads = clamp_u32(options.threads);
    out->faces = options.ratio > 0 ? share_of(mesh->index_count / 3) : clamp_u32(options.faces);
    out->vertices = clamp_u32(options.vertices);
    out->error = options.error;
    out->batched = strcmp(options.hierarchy, "batched") == 0;
    out->keep_order = options.keep_order;
    if (options.progressive || bits > 0) {
        *grid = hw_position_grid_make(hw_mesh_bounds(mesh), bits);
        out->grid = grid;
    }
    if (options.levels)
        out->level = take_level;
    return HW_OK;
}

// ---- outputs ---------------------------------------------------------------------------------

static hw_status write_mesh(const char *path, const hw_mesh *mesh)
{
    if (mesh->index_count == 0)
        return hw_fail(HW_LIMIT, "%s: nothing is left of the mesh", path);
    if (hw_path_ends_with(path, ".ply"))
        return hw_mesh_export_ply(mesh, path);
    hw_material material = {.base_color = {1, 1, 1}};
    hw_object object = {.transform = hw_mat4_identity()};
    hw_mesh copy = *mesh; // borrowed
    hw_scene scene = {.mesh_count = 1,
                      .material_count = 1,
                      .object_count = 1,
                      .meshes = &copy,
                      .materials = &material,
                      .objects = &object};
    hw_scene_update_bounds(&scene);
    return hw_scene_export_glb(&scene, path);
}

// levels/level_03.ply
static hw_status take_level(void *context, uint32_t batch, const hw_mesh *mesh)
{
    (void)context;
    char name[32];
    char *path = NULL;
    if (mesh->index_count == 0)
        return HW_OK;
    snprintf(name, sizeof name, "level_%02u.ply", batch);
    HW_TRY(hw_path_join(&path, options.levels, name));
    hw_status status = write_mesh(path, mesh);
    hw_free(path);
    return status;
}

// The most records whose file has at most --bytes; the whole mesh without it.
static hw_status choose_records(const hw_progressive *p, uint32_t *records)
{
    uint32_t low = 0, high = hw_progressive_get_info(p).record_count;
    uint64_t bytes;
    *records = high;
    if (options.bytes == 0)
        return HW_OK;
    HW_TRY(hw_progressive_encoded_bytes(p, high, &bytes));
    if (bytes <= options.bytes)
        return HW_OK;
    HW_TRY(hw_progressive_encoded_bytes(p, 0, &bytes));
    if (bytes > options.bytes)
        return hw_fail(HW_LIMIT, "--bytes %llu: the base mesh alone takes %llu; let it be coarser",
                       (unsigned long long)options.bytes, (unsigned long long)bytes);
    while (high - low > 1) {
        uint32_t middle = low + (high - low) / 2;
        HW_TRY(hw_progressive_encoded_bytes(p, middle, &bytes));
        if (bytes <= options.bytes)
            low = middle;
        else
            high = middle;
    }
    *records = low;
    return HW_OK;
}

// Writes the file; with --bytes the mesh becomes what the file holds at its finest.
static hw_status write_progressive(hw_simplified *s, uint64_t *bytes)
{
    uint32_t records;
    HW_TRY(choose_records(s->progressive, &records));
    HW_TRY(hw_progressive_write(s->progressive, records, options.progressive, 0));
    HW_TRY(hw_progressive_encoded_bytes(s->progressive, records, bytes));
    if (options.bytes == 0)
        return HW_OK;
    hw_mesh finest;
    hw_progressive_go(s->progressive, records);
    HW_TRY(hw_progressive_extract(s->progressive, &finest));
    hw_mesh_free(&s->mesh);
    s->mesh = finest;
    return hw_mesh_compute_normals(&s->mesh);
}

static void print_facts(const hw_mesh *mesh, const hw_simplified *s, uint64_t bytes)
{
    const hw_simplify_facts *f = &s->facts;
    printf("%s: %u triangles, %u vertices -> %u triangles, %u vertices, %.2f s\n",
           mesh->name ? mesh->name : "mesh", f->faces_before, f->vertices_before,
           s->mesh.index_count / 3, s->mesh.vertex_count, f->seconds);
    if (f->dropped_faces)
        printf("  %u degenerate triangles, or pairs back to back, took no part\n",
               f->dropped_faces);
    if (f->split_vertices)
        printf("  %u vertices were copied where sheets touch\n", f->split_vertices);
    if (f->complex_edges)
        printf("  %u edges are not manifold: their ends stay\n", f->complex_edges);
    if (f->border_edges)
        printf("  %u edges are open borders\n", f->border_edges);
    if (f->batches)
        printf("  %u batches\n", f->batches);
    if (options.progressive)
        printf("  %s: %llu bytes, %.2f a vertex\n", options.progressive, (unsigned long long)bytes,
               (double)bytes / f->vertices_before);
}

static hw_status write_report(const hw_simplified *s, uint64_t bytes)
{
    const hw_simplify_facts *f = &s->facts;
    cJSON *json = cJSON_CreateObject();
    hw_json_add_number(json, "faces_before", f->faces_before);
    hw_json_add_number(json, "vertices_before", f->vertices_before);
    hw_json_add_number(json, "faces", s->mesh.index_count / 3);
    hw_json_add_number(json, "vertices", s->mesh.vertex_count);
    hw_json_add_number(json, "dropped_faces", f->dropped_faces);
    hw_json_add_number(json, "split_vertices", f->split_vertices);
    hw_json_add_number(json, "complex_edges", f->complex_edges);
    hw_json_add_number(json, "border_edges", f->border_edges);
    hw_json_add_number(json, "batches", f->batches);
    hw_json_add_number(json, "seconds", f->seconds);
    hw_json_add_number(json, "fit_seconds", f->fit_seconds);
    hw_json_add_number(json, "rss_bytes_peak", (double)hw_rss_peak_bytes());
    if (options.progressive)
        hw_json_add_number(json, "progressive_bytes", (double)bytes);
    cJSON_AddItemToObject(json, "options", hw_options_json(&hw_cmd_simplify));
    hw_status status = hw_json_write(options.json, json);
    cJSON_Delete(json);
    return status;
}

// ---- from a progressive mesh -----------------------------------------------------------------

// A level is in the file, or is not: how it came to be cannot be chosen any more.
static hw_status check_refine(void)
{
    static const char *const others[] = {"metric", "placement",   "fit",    "hierarchy",
                                         "eye",    "fov",         "height", "precision",
                                         "kappa",  "kappa-decay", NULL};
    if (!options.output || options.progressive || options.levels || options.vertices ||
        options.error > 0 || options.bytes)
        return hw_fail(HW_USAGE, "of a progressive mesh, -o with --faces or --ratio gives a level");
    return hw_options_refuse(&hw_cmd_simplify, others,
                             "is without effect where MESH is a progressive mesh");
}

static hw_status write_refined(const hw_mesh *mesh, uint32_t all)
{
    cJSON *json = cJSON_CreateObject();
    hw_json_add_number(json, "faces_original", all);
    hw_json_add_number(json, "faces", mesh->index_count / 3);
    hw_json_add_number(json, "vertices", mesh->vertex_count);
    hw_json_add_number(json, "rss_bytes_peak", (double)hw_rss_peak_bytes());
    cJSON_AddItemToObject(json, "options", hw_options_json(&hw_cmd_simplify));
    hw_status status = hw_json_write(options.json, json);
    cJSON_Delete(json);
    return status;
}

// The mesh of a progressive file at a number of faces.
static hw_status refine(const char *path)
{
    hw_status status;
    hw_progressive *p = NULL;
    hw_mesh mesh = {0};
    HW_TRY(check_refine());
    HW_GO(hw_progressive_read(&p, path));
    uint32_t all = hw_progressive_face_count(p);
    if (options.ratio > 0)
        hw_progressive_go_faces(p, share_of(all));
    else if (options.faces > 0)
        hw_progressive_go_faces(p, clamp_u32(options.faces));
    HW_GO(hw_progressive_extract(p, &mesh));
    HW_GO(hw_mesh_compute_normals(&mesh));
    HW_GO(write_mesh(options.output, &mesh));
    printf("%s: %u triangles of %u\n", options.output, mesh.index_count / 3, all);
    if (options.json)
        HW_GO(write_refined(&mesh, all));
out:
    hw_mesh_free(&mesh);
    hw_progressive_destroy(p);
    return status;
}

static hw_status run(int argc, const char *const *argv)
{
    (void)argc;
    hw_status status;
    hw_mesh mesh = {0};
    hw_simplified s = {0};
    hw_simplify_options o = {0};
    hw_position_grid grid;
    uint64_t bytes = 0;
    HW_TRY(check_outputs(argv));
    if (hw_path_ends_with(argv[0], ".hxp"))
        return refine(argv[0]);
    HW_GO(hw_mesh_import(argv[0], &mesh));
    HW_GO(plan(&mesh, &o, &grid));
    if (options.levels)
        HW_GO(hw_dir_make(options.levels));
    HW_GO(hw_simplify(&mesh, &o, &s));
    if (options.progressive)
        HW_GO(write_progressive(&s, &bytes));
    if (options.output)
        HW_GO(write_mesh(options.output, &s.mesh));
    print_facts(&mesh, &s, bytes);
    if (options.json)
        HW_GO(write_report(&s, bytes));
out:
    hw_simplified_free(&s);
    hw_mesh_free(&mesh);
    return status;
}

static uint32_t fill_options(hw_option *out, uint32_t capacity)
{
    const hw_option table[] = {
        {"output", 'o', HW_OPTION_STRING, &options.output, "MESH", NULL, 0, 0,
         "The mesh to write, .ply or .glb."},
        {"metric", 0, HW_OPTION_STRING, &options.metric, "NAME", NULL, 0, 0,
         "The error metric, see below; NAME:SHARE,NAME goes over to another when a share of the "
         "triangles is left."},
        {"placement", 0, HW_OPTION_CHOICE, &options.placement, "BITS", "default|0|1|2|optimal", 0,
         0,
         "Where merged vertices go: 0 the middle, 1 an end, 2 either, optimal anywhere; else as "
         "the metric likes it."},
        {"faces", 0, HW_OPTION_UINT, &options.faces, "N", NULL, 1, 4e9, "Stop at N triangles."},
        {"ratio", 0, HW_OPTION_DOUBLE, &options.ratio, "R", NULL, 1e-9, 1,
         "Stop at this share of the triangles."},
        {"vertices", 0, HW_OPTION_UINT, &options.vertices, "N", NULL, 1, 4e9,
         "Stop at N vertices."},
        {"error", 0, HW_OPTION_DOUBLE, &options.error, "E", NULL, 1e-30, 1e30,
         "Stop when every collapse would cost more than E, in the unit of the (last) metric."},
        {"fit", 0, HW_OPTION_UINT, &options.fit, "ROUNDS", NULL, 0, 100,
         "Afterwards fit the vertices to the original by least squares, volume kept; 1 or 2 rounds "
         "do."},
        {"hierarchy", 0, HW_OPTION_CHOICE, &options.hierarchy, "KIND", "linear|batched", 0, 0,
         "One order, or batches of independent collapses."},
        {"levels", 0, HW_OPTION_STRING, &options.levels, "DIR", NULL, 0, 0,
         "Write the mesh after each batch into this folder."},
        {"progressive", 0, HW_OPTION_STRING, &options.progressive, "FILE.hxp", NULL, 0, 0,
         "Write the way back to the original as a progressive mesh."},
        {"precision", 0, HW_OPTION_STRING, &options.precision, "BITS", NULL, 0, 0,
         "Positions of the progressive mesh: lossless, or 8 to 24 bits over the longest side."},
        {"keep-order", 0, HW_OPTION_FLAG, &options.keep_order, NULL, NULL, 0, 0,
         "The progressive mesh also gives back the order of the original's vertices and "
         "triangles."},
        {"bytes", 0, HW_OPTION_UINT, &options.bytes, "N", NULL, 1, 4e18,
         "The progressive mesh takes at most N bytes; what is written is the finest that fits."},
        {"eye", 0, HW_OPTION_STRING, &options.eye, "X,Y,Z", NULL, 0, 0,
         "Where the mesh is seen from, for the metrics screen and viewcell."},
        {"fov", 0, HW_OPTION_DOUBLE, &options.fov, "DEGREES", NULL, 1, 170,
         "Vertical field of view from the eye."},
        {"height", 0, HW_OPTION_DOUBLE, &options.height, "PX", NULL, 1, 65536,
         "Height of the picture seen from the eye."},
        {"kappa", 0, HW_OPTION_DOUBLE, &options.kappa, "K", NULL, 0, 1e6,
         "Stiffness of the springs of pm; 0 is 0.001."},
        {"kappa-decay", 0, HW_OPTION_DOUBLE, &options.kappa_decay, "F", NULL, 1e-6, 1,
         "Multiplies kappa after each batch."},
        {"threads", 0, HW_OPTION_UINT, &options.threads, "N", NULL, 0, 1024,
         "Threads for rays; 0 is one per processor."},
        {"json", 0, HW_OPTION_STRING, &options.json, "FILE", NULL, 0, 0,
         "Write the figures as JSON too."},
    };
    uint32_t count = sizeof table / sizeof *table;
    for (uint32_t i = 0; i < count && i < capacity; i++)
        out[i] = table[i];
    return count;
}

const hw_command hw_cmd_simplify = {
    .name = "simplify",
    .summary = "make a mesh smaller",
    .arguments = "MESH -o MESH",
    .description =
        "Collapses edges in order of what they cost, until one of the limits is met. The mesh may "
        "be any that Hexwalk imports; what is not manifold is cut open or kept as it is, and told. "
        "Texture coordinates and materials are left behind.\n\n"
        "Metrics: quadric (memoryless quadrics by area), volume (least volume swept, enclosed "
        "volume kept), silhouette (quadric, outlines held tighter), hybrid (volume times turn of "
        "normals), uvol, norm (its two parts), pm (distances to planes and springs), edge (edge "
        "length, fastest), qem (quadrics with memory), screen and viewcell (as seen from --eye). "
        "Units of --error: quadric and silhouette area times squared distance, volume squared "
        "volume, hybrid and uvol volume, norm 1 - cosine, pm and qem squared distance, edge "
        "squared length, viewcell pixels.\n\n"
        "Where MESH is a progressive mesh (.hxp), --faces or --ratio takes a level out of it; "
        "without them, the original.",
    .options = fill_options,
    .positional_min = 1,
    .positional_max = 1,
    .run = run,
};
