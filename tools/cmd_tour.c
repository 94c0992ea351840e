// hexwalk tour: writes a default tour of a scene.
#include "clearance.h"
#include "import.h"
#include "json.h"
#include "options.h"
#include "outputs.h"
#include "tour.h"
#include <math.h>
#include <stdio.h>

static struct {
    const char *output, *json;
    double eye_height, speed, turn, clearance;
    uint64_t seed;
} options = {.eye_height = 12, .speed = 30, .turn = 45};

typedef struct figures {
    double seconds, length, closest;
} figures;

// The least distance to an object, looked for within a reach that grows until one is found.
static hw_status find_closest(const hw_scene *scene, const hw_tour *tour, double *out)
{
    double diagonal = (double)hw_box_diagonal(hw_scene_bounds(scene));
    double reach = fmax(0.01 * diagonal, 1);
    do {
        hw_clearance *clearance = NULL;
        reach *= 2;
        HW_TRY(hw_clearance_create(&clearance, scene, tour->frames[0].eye.z, reach));
        *out = INFINITY;
        for (uint32_t i = 0; i < tour->frame_count; i++) {
            hw_vec3 eye = tour->frames[i].eye;
            *out = fmin(*out, hw_clearance_at(clearance, eye.x, eye.y, NULL));
        }
        hw_clearance_destroy(clearance);
    } while (*out >= reach);
    return HW_OK;
}

static hw_status measure(const hw_scene *scene, const hw_tour *tour, figures *out)
{
    *out = (figures){.seconds = tour->frames[tour->frame_count - 1].t};
    for (uint32_t i = 0; i < tour->frame_count; i++) {
        hw_vec3 a = tour->frames[i].eye, b = tour->frames[(i + 1) % tour->frame_count].eye;
        out->length += (double)hw_v3_length(hw_v3_sub(b, a));
    }
    return find_closest(scene, tour, &out->closest);
}

static hw_status write_report(const hw_tour *tour, const figures *f)
{
    cJSON *json = cJSON_CreateObject();
    hw_json_add_number(json, "frames", tour->frame_count);
    hw_json_add_number(json, "seconds", f->seconds);
    hw_json_add_number(json, "length", f->length);
    hw_json_add_number(json, "closest", f->closest);
    hw_status status = hw_json_write(options.json, json);
    cJSON_Delete(json);
    return status;
}

static hw_status run(int argc, const char *const *argv)
{
    (void)argc;
    hw_status status = HW_OK;
    hw_scene scene = {0};
    hw_tour tour = {0};
    figures f;
    if (!options.output)
        return hw_fail(HW_USAGE, "-o TOUR.json is needed");
    HW_TRY(hw_output_apart("output", options.output, 1, argv));
    HW_TRY(hw_output_apart("json", options.json, 1, argv));
    HW_GO(hw_scene_import(argv[0], &scene));
    hw_tour_options o = {.eye_height = options.eye_height,
                         .speed = options.speed,
                         .turn_degrees = options.turn,
                         .clearance = options.clearance,
                         .seed = options.seed};
    HW_GO(hw_tour_generate(&scene, &o, &tour));
    HW_GO(hw_tour_write(options.output, &tour));
    HW_GO(measure(&scene, &tour, &f));
    printf("%s: %u frames, %.1f s, %.0f units, the nearest object at %.1f units\n", options.output,
           tour.frame_count, f.seconds, f.length, f.closest);
    if (options.json)
        HW_GO(write_report(&tour, &f));
out:
    hw_tour_free(&tour);
    hw_scene_free(&scene);
    return status;
}

static uint32_t fill_options(hw_option *out, uint32_t capacity)
{
    const hw_option table[] = {
        {"output", 'o', HW_OPTION_STRING, &options.output, "TOUR.json", NULL, 0, 0,
         "The tour to write."},
        {"eye-height", 0, HW_OPTION_DOUBLE, &options.eye_height, "H", NULL, 1e-3, 1e6,
         "Height of the eye above the ground in units."},
        {"speed", 0, HW_OPTION_DOUBLE, &options.speed, "V", NULL, 1e-3, 1e6,
         "Speed in units per second, curves may be slower."},
        {"turn", 0, HW_OPTION_DOUBLE, &options.turn, "DEGREES", NULL, 1, 360,
         "Largest turn per second."},
        {"clearance", 0, HW_OPTION_DOUBLE, &options.clearance, "UNITS", NULL, 0, 1e6,
         "Least distance to any object; 0 is a quarter of the median object size."},
        {"seed", 0, HW_OPTION_UINT, &options.seed, "S", NULL, 0, 0, "Another seed, another way."},
        {"json", 0, HW_OPTION_STRING, &options.json, "FILE", NULL, 0, 0,
         "Write the figures as JSON too."},
    };
    uint32_t count = sizeof table / sizeof *table;
    for (uint32_t i = 0; i < count && i < capacity; i++)
        out[i] = table[i];
    return count;
}

const hw_command hw_cmd_tour = {
    .name = "tour",
    .summary = "Make a tour through a scene.",
    .arguments = "SCENE -o TOUR.json",
    .description =
        "Writes a camera path: a closed loop through the scene that passes statues near and far "
        "and keeps clear of all of them, at 60 frames per second.",
    .options = fill_options,
    .positional_min = 1,
    .positional_max = 1,
    .run = run,
};
