#include "build.h"
#include "interrupts.h"
#include "json.h"
#include "log.h"
#include "options.h"
#include "outputs.h"
#include "system.h"
#include <signal.h>
#include <stdlib.h>
#include <string.h>

static const char *output, *json_file, *policy = "screen", *shard, *along, *heights = "8:16",
                                       *occlusion = "off", *clusters = "off", *mvmesh_blend = "off";
static uint64_t threads, memory, levels, texture_side = 1024, every = 1, mvmesh_views = 3;
static hw_tour tour; // of --along
static double self_occlusion;
static hw_build_options build; // begins with the defaults; tolerances go into it directly
static atomic_bool stop;

static uint32_t options(hw_option *out, uint32_t capacity)
{
    if (!build.far.policy)
        build = hw_build_defaults();
    const hw_option table[] = {
        {"output", 'o', HW_OPTION_STRING, &output, "DATASET", NULL, 0, 0,
         "folder to write (an unfinished build in it is continued)"},
        {"cell-size", 0, HW_OPTION_DOUBLE, &build.cell_size, "UNITS", NULL, 1e-3, 1e6,
         "side length of the hexagonal cells"},
        {"heights", 0, HW_OPTION_STRING, &heights, "MIN:MAX", NULL, 0, 0,
         "heights above the ground at which eyes may be"},
        {"piece-size", 0, HW_OPTION_DOUBLE, &build.piece_cells, "CELL-SIZES", NULL, 0, 1e6,
         "meshes more than four times as wide (a terrain, a building) are cut into pieces of this "
         "width; 0: none is"},
        {"policy", 0, HW_OPTION_CHOICE, &policy, "NAME", "screen|thesis", 0, 0,
         "how far objects are simplified"},
        {"self-occlusion", 0, HW_OPTION_DOUBLE, &self_occlusion, "PX", NULL, 0, 1e6,
         "T_s, largest self-occluding error of a textured stand-in; 0 means 20 with the policy "
         "screen, 5 with thesis"},
        {"mvmesh-limit", 0, HW_OPTION_DOUBLE, &build.far.multi_view_px, "PX", NULL, 0, 1e6,
         "T_mv: objects whose self-occluding error is T_s or more, but below this, are multi-view "
         "meshes instead of near objects; 0 means none"},
        {"mvmesh-textured", 0, HW_OPTION_DOUBLE, &build.far.multi_textured_px, "PX", NULL, 0, 1e6,
         "the same for textured objects, whose geometry near by has no levels of detail"},
        {"mvmesh-views", 0, HW_OPTION_UINT, &mvmesh_views, "N", NULL, 1, HW_FAR_VIEWS_MAX - 1,
         "captures of a multi-view mesh: one from the cell's centre, the others from corners"},
        {"mvmesh-blend", 0, HW_OPTION_CHOICE, &mvmesh_blend, "on|off", "on|off", 0, 0,
         "each triangle of a multi-view mesh keeps all captures that see it, to be drawn with the "
         "two nearest to the viewer's direction, not the best one only"},
        {"mvmesh-outline", 0, HW_OPTION_DOUBLE, &build.far.multi_outline_px, "PX", NULL, 1e-4, 100,
         "mean outline deviation of multi-view meshes (policy screen)"},
        {"mvmesh-interior", 0, HW_OPTION_DOUBLE, &build.far.multi_interior_px, "PX", NULL, 0, 100,
         "parallax error inside the outlines of multi-view meshes (policy screen)"},
        {"edge-length", 0, HW_OPTION_DOUBLE, &build.far.edge_length_px, "PX", NULL, 0, 1e6,
         "T_l of the policy thesis"},
        {"outline-error", 0, HW_OPTION_DOUBLE, &build.far.outline_px, "PX", NULL, 1e-4, 100,
         "mean outline deviation of far objects (policy screen)"},
        {"interior-error", 0, HW_OPTION_DOUBLE, &build.far.interior_px, "PX", NULL, 0, 100,
         "parallax error inside outlines (policy screen)"},
        {"impostor", 0, HW_OPTION_DOUBLE, &build.far.impostor_px, "PX", NULL, 0, 100,
         "objects with a smaller self-occluding error are drawn as a few triangles, cut out "
         "along their captured outlines; 0 means none"},
        {"relief", 0, HW_OPTION_DOUBLE, &build.far.relief_px, "PX", NULL, 0, 100,
         "so are those whose outlines are then off by less, seen from corners of the cell; none "
         "with the policy thesis, or with --clusters on"},
        {"near-error", 0, HW_OPTION_DOUBLE, &build.near_error_px, "PX", NULL, 0, 100,
         "surface error (99th percentile) of near objects"},
        {"texture-side", 0, HW_OPTION_UINT, &texture_side, "TEXELS", NULL, 16, 4096,
         "objects with larger captures are near"},
        {"occlusion", 0, HW_OPTION_CHOICE, &occlusion, "WHAT", "off|objects|triangles", 0, 0,
         "leave out of each cell what cannot be seen from any point of it: whole objects, or "
         "triangles of far objects too"},
        {"clusters", 0, HW_OPTION_CHOICE, &clusters, "on|off", "on|off", 0, 0,
         "draw far objects that lie near each other in the picture as one, where that takes a "
         "smaller texture"},
        {"cluster-error", 0, HW_OPTION_DOUBLE, &build.cluster_error_px, "PX", NULL, 0, 1e6,
         "largest self-occluding error of a cluster"},
        {"levels", 0, HW_OPTION_UINT, &levels, "N", NULL, 0, HW_CELL_LEVELS_MAX,
         "levels of the cell hierarchy; each groups seven cells of the one below to draw what is "
         "far away. 0: one for up to 1000 cells, else 3"},
        {"threads", 0, HW_OPTION_UINT, &threads, "N", NULL, 0, 1024,
         "threads; 0 means one per processor"},
        {"shard", 0, HW_OPTION_STRING, &shard, "K/N", NULL, 0, 0,
         "make only every N-th cell and near mesh, beginning with the K-th (K from 1); 'hexwalk "
         "merge' joins shards that were made in different folders"},
        {"along", 0, HW_OPTION_STRING, &along, "TOUR.json", NULL, 0, 0,
         "make only the cells that the tour passes: to try options out. The same command without "
         "it makes the rest"},
        {"every", 0, HW_OPTION_UINT, &every, "N", NULL, 1, UINT32_MAX,
         "of --along: only the cells that every N-th frame stands in"},
        {"memory", 0, HW_OPTION_BYTES, &memory, "BYTES", NULL, 0, 0,
         "bound of the memory used, such as 500M or 2G: what does not fit waits in a scratch file "
         "in the dataset's folder; 0 means none"},
        {"json", 0, HW_OPTION_STRING, &json_file, "FILE", NULL, 0, 0, "write the figures as JSON"},
    };
    uint32_t count = sizeof table / sizeof *table;
    memcpy(out, table, (count < capacity ? count : capacity) * sizeof *table);
    return count;
}

// "A<separator>B" as two finite numbers.
static bool parse_pair(const char *text, char separator, double *a, double *b)
{
    char *end;
    *a = strtod(text, &end);
    if (end == text || *end != separator)
        return false;
    const char *second = end + 1;
    *b = strtod(second, &end);
    return end != second && *end == 0 && *a > -1e9 && *a < 1e9 && *b > -1e9 && *b < 1e9;
}

static hw_status check_options(const char *scene)
{
    static const char *const of_along[] = {"every", NULL};
    static const char *const of_clusters[] = {"cluster-error", NULL};
    const char *const inputs[] = {scene, along};
    if (!output)
        return hw_fail(HW_USAGE, "build needs -o DATASET");
    if (along && shard)
        return hw_fail(HW_USAGE, "--along and --shard do not go together");
    if (!along)
        HW_TRY(hw_options_refuse(&hw_cmd_build, of_along, "is about --along"));
    if (strcmp(clusters, "on") != 0)
        HW_TRY(hw_options_refuse(&hw_cmd_build, of_clusters, "is about --clusters on"));
    return hw_output_apart("json", json_file, 2, inputs);
}

static hw_status read_options(const char *scene)
{
    hw_build_options *o = &build;
    o->scene_path = scene;
    o->dataset = output;
    HW_TRY(check_options(scene));
    if (!parse_pair(heights, ':', &o->z_min, &o->z_max) || o->z_min > o->z_max)
        return hw_fail(HW_USAGE, "--heights wants MIN:MAX with MIN <= MAX, not '%s'", heights);
    if (shard) {
        double k, n;
        if (!parse_pair(shard, '/', &k, &n) || k < 1 || k > n || n > 1e6 || k != (uint32_t)k ||
            n != (uint32_t)n)
            return hw_fail(HW_USAGE, "--shard wants K/N with 1 <= K <= N, not '%s'", shard);
        o->shard_index = (uint32_t)k - 1;
        o->shard_count = (uint32_t)n;
    }
    o->levels = (int32_t)levels;
    o->threads = (uint32_t)threads;
    o->memory_bytes = memory;
    o->cull = strcmp(occlusion, "off") == 0       ? HW_OCCLUSION_OFF
              : strcmp(occlusion, "objects") == 0 ? HW_OCCLUSION_OBJECTS
                                                  : HW_OCCLUSION_TRIANGLES;
    o->clusters = strcmp(clusters, "on") == 0;
    o->far.policy = hw_policy_find(policy);
    o->far.multi_view_count = (uint32_t)mvmesh_views;
    o->far.multi_blend = strcmp(mvmesh_blend, "on") == 0;
    o->far.capture_side_max = (uint32_t)texture_side;
    if (self_occlusion > 0)
        o->far.self_occlusion_px = self_occlusion;
    else if (o->far.policy == &hw_policy_thesis)
        o->far.self_occlusion_px = 5;
    if (o->far.policy == &hw_policy_thesis || o->clusters) // clusters join meshes
        o->far.relief_px = 0;
    if (along)
        HW_TRY(hw_tour_read(along, &tour));
    o->along = along ? &tour : NULL;
    o->along_every = (uint32_t)every;
    o->stop = &stop;
    return HW_OK;
}

static void on_signal(int number)
{
    (void)number;
    atomic_store(&stop, true);
}

static void print_report(const hw_build_report *r)
{
    printf("cells      %u made, %u kept, %u in all\n", r->cells_made, r->cells_kept,
           r->cells_total);
    if (r->cells_made > 0)
        printf("per cell   %.0f far objects, %.0f triangles; %.1f near objects\n",
               r->far_records_mean, r->far_triangles_mean, r->near_records_mean);
    if (r->meshes_cut > 0)
        printf("pieces     of %u oversized meshes\n", r->meshes_cut);
    printf("bytes      %.1f MB: %.1f meshes, %.1f textures, %.1f near objects\n",
           (double)r->bytes / 1e6, (double)r->mesh_bytes / 1e6, (double)r->texture_bytes / 1e6,
           (double)r->near_bytes / 1e6);
    printf(
        "seconds    %.1f: import %.1f, levels of detail %.1f, near meshes %.1f, rays %.1f, cells "
        "%.1f\n",
        r->total_seconds, r->import_seconds, r->chain_seconds, r->mesh_seconds, r->rays_seconds,
        r->cell_seconds);
    if (r->cells_made > 0)
        printf(
            "           of all threads in cells: classify %.1f, simplify %.1f, capture %.1f, pack "
            "%.1f, write %.1f\n",
            r->cell_parts.classify, r->cell_parts.simplify, r->cell_parts.capture,
            r->cell_parts.pack, r->cell_write_seconds);
    printf("memory     %.0f MB at the peak\n", (double)hw_rss_peak_bytes() / 1e6);
    if (r->scratch_bytes > 0)
        printf("           %.0f MB in a scratch file, ray trees built %llu times\n",
               (double)r->scratch_bytes / 1e6, (unsigned long long)r->tree_builds);
    if (r->cells_left_out > 0)
        printf("partial    %u cells are left out: the same command without --along makes them\n",
               r->cells_left_out);
    if (r->cells_missing + r->meshes_missing > 0)
        printf("unfinished %u cells and %u meshes are left to other shards: make them in this "
               "folder too, or join them by 'hexwalk merge'\n",
               r->cells_missing, r->meshes_missing);
}

static hw_status write_json(const hw_build_report *r, const cJSON *used)
{
    cJSON *json = cJSON_CreateObject();
    const struct {
        const char *key;
        double value;
    } figures[] = {
        {"import_seconds", r->import_seconds},
        {"chain_seconds", r->chain_seconds},
        {"mesh_seconds", r->mesh_seconds},
        {"rays_seconds", r->rays_seconds},
        {"cell_seconds", r->cell_seconds},
        {"cell_classify_thread_seconds", r->cell_parts.classify},
        {"cell_simplify_thread_seconds", r->cell_parts.simplify},
        {"cell_capture_thread_seconds", r->cell_parts.capture},
        {"cell_pack_thread_seconds", r->cell_parts.pack},
        {"cell_write_thread_seconds", r->cell_write_seconds},
        {"total_seconds", r->total_seconds},
        {"meshes_cut", r->meshes_cut},
        {"cells_total", r->cells_total},
        {"cells_made", r->cells_made},
        {"cells_kept", r->cells_kept},
        {"cells_missing", r->cells_missing},
        {"meshes_missing", r->meshes_missing},
        {"cells_left_out", r->cells_left_out},
        {"scratch_bytes", (double)r->scratch_bytes},
        {"tree_builds", (double)r->tree_builds},
        {"bytes", (double)r->bytes},
        {"mesh_bytes", (double)r->mesh_bytes},
        {"texture_bytes", (double)r->texture_bytes},
        {"near_bytes", (double)r->near_bytes},
        {"far_records_mean", r->far_records_mean},
        {"far_triangles_mean", r->far_triangles_mean},
        {"near_records_mean", r->near_records_mean},
        {"rss_bytes_peak", (double)hw_rss_peak_bytes()},
    };
    for (size_t i = 0; i < sizeof figures / sizeof *figures; i++)
        hw_json_add_number(json, figures[i].key, figures[i].value);
    cJSON_AddItemToObject(json, "options", cJSON_Duplicate(used, true));
    hw_status status = hw_json_write(json_file, json);
    cJSON_Delete(json);
    return status;
}

static hw_status run(int argc, const char *const *argv)
{
    (void)argc;
    hw_build_report report;
    HW_TRY(read_options(argv[0]));
    hw_interrupts_handle(on_signal, 0);
    hw_status status = hw_build_run(&build, &report);
    hw_tour_free(&tour);
    if (status == HW_INTERRUPTED)
        return hw_fail(HW_INTERRUPTED, "%s: interrupted; the same command goes on where it stopped",
                       output);
    HW_TRY(status);
    print_report(&report);
    if (!json_file)
        return HW_OK;
    cJSON *used = hw_options_json(&hw_cmd_build);
    status = write_json(&report, used);
    cJSON_Delete(used);
    return status;
}

const hw_command hw_cmd_build = {
    .name = "build",
    .summary = "precompute a scene into a dataset of view cells",
    .arguments = "SCENE -o DATASET",
    .description = "Cuts the view space into hexagonal cells and stores, for each, a textured mesh "
                   "of every far object as it looks from "
                   "there, and which near objects are to be drawn as geometry. A build that was "
                   "interrupted, by Ctrl-C or otherwise, "
                   "goes on where it stopped when the same command is given again. The same scene "
                   "and options give the same bytes with "
                   "any number of threads, any split into shards and any bound of memory.\n\n"
                   "Shards of one dataset may be made one after another or at the same time, by "
                   "several machines: in one folder, which is a dataset once the last shard is "
                   "done, or in a folder each, which 'hexwalk merge' joins.",
    .options = options,
    .positional_min = 1,
    .positional_max = 1,
    .run = run,
};
