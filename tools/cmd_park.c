// hexwalk park: strews statues over an area and writes them as a scene.
#include "ambient.h"
#include "export.h"
#include "json.h"
#include "log.h"
#include "options.h"
#include "outputs.h"
#include "park.h"
#include "statues.h"
#include "system.h"
#include <stdio.h>

#define SEED_DEFAULT 1

static struct {
    const char *preset, *statues, *output, *json;
    uint64_t objects, seed;
    uint32_t area[2];
    bool flat;
} options = {.seed = SEED_DEFAULT};

static hw_status check_options(void)
{
    bool any_size = options.objects || options.area[0] || options.seed != SEED_DEFAULT;
    if (options.preset && any_size)
        return hw_fail(HW_USAGE, "--preset fixes the objects, the area and the seed: give either "
                                 "--preset or --objects, --area and --seed");
    if (!options.preset && !options.objects)
        return hw_fail(HW_USAGE, "which park? Give --preset or --objects");
    if (!options.statues)
        return hw_fail(HW_USAGE, "--statues DIR is needed (tools/fetch-statues fills it)");
    if (!options.output)
        return hw_fail(HW_USAGE, "-o SCENE.glb is needed");
    return hw_output_extension("output", options.output, ".glb");
}

static hw_status bake(hw_scene *scene)
{
    hw_progress *progress = NULL;
    uint64_t vertices = 0;
    for (uint32_t m = 0; m < scene->mesh_count; m++)
        vertices += scene->meshes[m].vertex_count;
    HW_TRY(hw_progress_create(&progress, "ambient occlusion", vertices));
    hw_status status = HW_OK;
    for (uint32_t m = 0; m < scene->mesh_count && status == HW_OK; m++) {
        status = hw_ambient_bake(&scene->meshes[m], 0, 0);
        hw_progress_add(progress, scene->meshes[m].vertex_count);
    }
    hw_progress_destroy(progress);
    return status;
}

static uint32_t count_objects(const hw_scene *scene, uint32_t mesh_idx)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < scene->object_count; i++)
        count += scene->objects[i].mesh_idx == mesh_idx;
    return count;
}

static void print_table(const hw_scene *scene)
{
    printf("%-12s %10s %8s %12s   %s\n", "statue", "triangles", "objects", "in all", "w x d x h");
    for (uint32_t m = 0; m < scene->mesh_count; m++) {
        const hw_mesh *mesh = &scene->meshes[m];
        uint32_t count = count_objects(scene, m), triangles = mesh->index_count / 3;
        hw_vec3 size = hw_box_size(hw_mesh_bounds(mesh));
        printf("%-12s %10u %8u %12llu   %.1f x %.1f x %.1f\n", mesh->name, triangles, count,
               (unsigned long long)triangles * count, size.x, size.y, size.z);
    }
    printf("%-12s %10s %8u %12llu\n", "total", "", scene->object_count,
           (unsigned long long)hw_scene_triangle_count(scene));
}

static hw_status write_report(const hw_scene *scene, double seconds)
{
    cJSON *json = cJSON_CreateObject(), *statues = cJSON_AddArrayToObject(json, "statues");
    hw_json_add_number(json, "triangles", (double)hw_scene_triangle_count(scene));
    hw_json_add_number(json, "objects", scene->object_count);
    hw_json_add_number(json, "seconds", seconds);
    for (uint32_t m = 0; m < scene->mesh_count; m++) {
        cJSON *statue = cJSON_CreateObject();
        cJSON_AddStringToObject(statue, "name", scene->meshes[m].name);
        hw_json_add_number(statue, "triangles", scene->meshes[m].index_count / 3);
        hw_json_add_number(statue, "objects", count_objects(scene, m));
        cJSON_AddItemToArray(statues, statue);
    }
    hw_status status = hw_json_write(options.json, json);
    cJSON_Delete(json);
    return status;
}

static hw_status run(int argc, const char *const *argv)
{
    (void)argc;
    (void)argv;
    hw_status status = HW_OK;
    hw_scene scene = {0};
    double start_ms = hw_clock_ms();
    HW_GO(check_options());
    hw_park_options park = {.preset = options.preset,
                            .object_count = (uint32_t)options.objects,
                            .width = options.area[0],
                            .depth = options.area[1],
                            .seed = options.seed,
                            .with_dragon =
                                hw_statue_available(hw_statue_find("dragon"), options.statues),
                            .statue_folder = options.statues};
    HW_GO(hw_park_make(&park, &scene));
    if (!options.flat)
        HW_GO(bake(&scene));
    HW_GO(hw_scene_export_glb(&scene, options.output));
    double seconds = (hw_clock_ms() - start_ms) / 1000;
    print_table(&scene);
    printf("%s: %.1f s, %.0f MB of memory at most\n", options.output, seconds,
           (double)hw_rss_peak_bytes() / 1e6);
    if (options.json)
        HW_GO(write_report(&scene, seconds));
out:
    hw_scene_free(&scene);
    return status;
}

static uint32_t fill_options(hw_option *out, uint32_t capacity)
{
    const hw_option table[] = {
        {"preset", 0, HW_OPTION_CHOICE, &options.preset, "NAME", "demo|2m|4m|8m|84m|court", 0, 0,
         "A park of fixed content: 2m, 4m and 8m are those of the thesis, 84m is ten times 8m; "
         "they "
         "need the dragon. court is divided by walls and hedges."},
        {"objects", 0, HW_OPTION_UINT, &options.objects, "N", NULL, 0, HW_PARK_OBJECTS_MAX,
         "Any number of statues instead, of the mix of 8m (of demo without the dragon)."},
        {"area", 0, HW_OPTION_SIZE, options.area, "WxD", NULL, 1, 1e9,
         "Width and depth in units; without it as dense as the presets."},
        {"seed", 0, HW_OPTION_UINT, &options.seed, "S", NULL, 0, 0, "Another seed, another park."},
        {"statues", 0, HW_OPTION_STRING, &options.statues, "DIR", NULL, 0, 0,
         "The folder that tools/fetch-statues has filled."},
        {"flat", 0, HW_OPTION_FLAG, &options.flat, NULL, NULL, 0, 0,
         "Leave out the baked ambient occlusion."},
        {"output", 'o', HW_OPTION_STRING, &options.output, "SCENE.glb", NULL, 0, 0,
         "The scene to write."},
        {"json", 0, HW_OPTION_STRING, &options.json, "FILE", NULL, 0, 0,
         "Write the figures as JSON too."},
    };
    uint32_t count = sizeof table / sizeof *table;
    for (uint32_t i = 0; i < count && i < capacity; i++)
        out[i] = table[i];
    return count;
}

const hw_command hw_cmd_park = {
    .name = "park",
    .summary = "Make a statuary park.",
    .arguments = "--preset demo|2m|4m|8m|84m|court --statues DIR -o SCENE.glb",
    .description =
        "Strews statues at random over an area, none overlapping another, stands them on a ground, "
        "tints each like some stone, bakes the ambient occlusion of each kind of statue into "
        "vertex colours and writes the scene as GLB.\n\n"
        "The presets 2m, 4m and 8m hold 64, 132 and 253 statues of eight kinds (about 2, 4 and 8 "
        "million triangles), each park a part of the next; 84m holds ten times as many as 8m on "
        "ten times the area. The preset demo has about a million triangles and needs no dragon. "
        "The preset court has 122 statues in 49 courts, divided by walls, hedges and colonnades "
        "with doorways: there, little is seen from anywhere. Any other size: --objects N with "
        "--area WxD and --seed S.",
    .options = fill_options,
    .positional_min = 0,
    .positional_max = 0,
    .run = run,
};
