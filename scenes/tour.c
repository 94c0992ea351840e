#include "tour.h"
#include "alloc.h"
#include "file.h"
#include "json.h"
#include "tour_path.h"
#include <stdio.h>
#include <stdlib.h>

#define TOUR_BYTES_MAX (UINT64_C(1) << 30)
#define SPAN_SECONDS   125.0 // of the course's width + depth, at full speed
#define SPAN_SIZES     80.0  // but at least as many median objects
#define ACCELERATION   1.0   // full speed is reached in this many seconds
#define LOOK_SMOOTHING 0.2   // seconds over which the view direction is averaged, twice
#define PARALLEL_SINE  1e-4

void hw_tour_free(hw_tour *tour)
{
    hw_free(tour->frames);
    *tour = (hw_tour){0};
}

hw_camera hw_tour_camera(const hw_tour *tour, uint32_t frame, uint32_t width, uint32_t height)
{
    const hw_tour_frame *f = &tour->frames[frame];
    return (hw_camera){.eye = f->eye,
                       .forward = f->forward,
                       .up = f->up,
                       .fov_degrees = (float)tour->fov_degrees,
                       .width = width,
                       .height = height};
}

// ---- Files

static hw_status read_vector(const char *name, const cJSON *frame, const char *key, hw_vec3 *out)
{
    double v[3];
    HW_TRY(hw_json_numbers(name, frame, key, v, 3));
    *out = hw_v3((float)v[0], (float)v[1], (float)v[2]);
    if (!hw_v3_finite(*out))
        return hw_fail(HW_FORMAT, "%s: \"%s\" is too large", name, key);
    return HW_OK;
}

static hw_status read_frame(const char *name, const cJSON *json, hw_tour_frame *out)
{
    HW_TRY(hw_json_number(name, json, "t", &out->t));
    HW_TRY(read_vector(name, json, "eye", &out->eye));
    HW_TRY(read_vector(name, json, "forward", &out->forward));
    HW_TRY(read_vector(name, json, "up", &out->up));
    hw_vec3 forward = hw_v3_normalize(out->forward), up = hw_v3_normalize(out->up);
    // Also false for vectors that are zero or overflow when squared.
    if (!(hw_v3_length(hw_v3_cross(forward, up)) > PARALLEL_SINE))
        return hw_fail(HW_FORMAT, "%s: \"forward\" and \"up\" span no plane", name);
    return HW_OK;
}

static hw_status read_frames(const char *name, const cJSON *array, hw_tour *tour)
{
    int count = cJSON_GetArraySize(array);
    if (count <= 0 || (uint32_t)count > HW_TOUR_FRAMES_MAX)
        return hw_fail(HW_FORMAT, "%s: \"frames\" has %d elements, 1 to %u make a tour", name,
                       count, HW_TOUR_FRAMES_MAX);
    HW_TRY(HW_NEW(&tour->frames, (size_t)count));
    const cJSON *json;
    cJSON_ArrayForEach(json, array)
    {
        char place[HW_ERROR_CAPACITY];
        hw_tour_frame *frame = &tour->frames[tour->frame_count];
        snprintf(place, sizeof place, "%.900s: frames[%u]", name, tour->frame_count);
        if (!cJSON_IsObject(json))
            return hw_fail(HW_FORMAT, "%s: not an object", place);
        HW_TRY(read_frame(place, json, frame));
        if (tour->frame_count > 0 && frame->t < frame[-1].t)
            return hw_fail(HW_FORMAT, "%s: \"t\" falls", place);
        tour->frame_count++;
    }
    return HW_OK;
}

static hw_status read_document(const char *name, const cJSON *json, hw_tour *out)
{
    hw_status status = HW_OK;
    hw_tour tour = {0};
    const cJSON *frames;
    if (!cJSON_IsObject(json)) {
        status = hw_fail(HW_FORMAT, "%s: not a tour (no JSON object)", name);
        goto out;
    }
    HW_GO(hw_json_number(name, json, "fov_degrees", &tour.fov_degrees));
    if (!(tour.fov_degrees > 0 && tour.fov_degrees < 180)) {
        status = hw_fail(HW_FORMAT, "%s: \"fov_degrees\" must lie between 0 and 180", name);
        goto out;
    }
    HW_GO(hw_json_array(name, json, "frames", &frames));
    HW_GO(read_frames(name, frames, &tour));
    *out = tour;
    tour = (hw_tour){0};
out:
    hw_tour_free(&tour);
    return status;
}

hw_status hw_tour_parse(const char *name, const char *text, size_t size, hw_tour *out)
{
    cJSON *json = NULL;
    *out = (hw_tour){0};
    HW_TRY(hw_json_parse(name, text, size, &json));
    hw_status status = read_document(name, json, out);
    cJSON_Delete(json);
    return status;
}

hw_status hw_tour_read(const char *path, hw_tour *out)
{
    uint8_t *text = NULL;
    size_t size;
    *out = (hw_tour){0};
    HW_TRY(hw_file_read(path, TOUR_BYTES_MAX, &text, &size));
    hw_status status = hw_tour_parse(path, (const char *)text, size, out);
    hw_free(text);
    return status;
}

// The double with the fewest digits that is still the same float, for short files.
static double brief(float value)
{
    char text[32];
    snprintf(text, sizeof text, "%.9g", (double)value);
    return strtod(text, NULL);
}

static void add_vector(cJSON *frame, const char *key, hw_vec3 v)
{
    const double values[3] = {brief(v.x), brief(v.y), brief(v.z)};
    hw_json_add_numbers(frame, key, values, 3);
}

hw_status hw_tour_write(const char *path, const hw_tour *tour)
{
    hw_status status = HW_OK;
    cJSON *json = cJSON_CreateObject(), *frames = NULL;
    if (!json || !cJSON_AddNumberToObject(json, "fov_degrees", tour->fov_degrees) ||
        !(frames = cJSON_AddArrayToObject(json, "frames")))
        goto memory;
    for (uint32_t i = 0; i < tour->frame_count; i++) {
        const hw_tour_frame *f = &tour->frames[i];
        cJSON *frame = cJSON_CreateObject();
        if (!frame || !cJSON_AddItemToArray(frames, frame)) {
            cJSON_Delete(frame);
            goto memory;
        }
        hw_json_add_number(frame, "t", f->t);
        add_vector(frame, "eye", f->eye);
        add_vector(frame, "forward", f->forward);
        add_vector(frame, "up", f->up);
    }
    status = hw_json_write(path, json);
    cJSON_Delete(json);
    return status;
memory:
    cJSON_Delete(json);
    return hw_fail(HW_MEMORY, "%s: out of memory", path);
}

// ---- The default tour

// Options with every default filled in.
typedef struct course_options {
    double eye_z, speed, turn_rad, frame_rate, clearance, span;
    uint64_t seed;
} course_options;

static int compare_floats(const void *a, const void *b)
{
    float p = *(const float *)a, q = *(const float *)b;
    return (p > q) - (p < q);
}

static hw_status median_size(const hw_scene *scene, double *out)
{
    float *sizes = NULL;
    HW_TRY(HW_NEW(&sizes, scene->object_count));
    for (uint32_t i = 0; i < scene->object_count; i++) {
        hw_vec3 size = hw_box_size(scene->objects[i].bounds);
        sizes[i] = fmaxf(size.x, fmaxf(size.y, size.z));
    }
    qsort(sizes, scene->object_count, sizeof *sizes, compare_floats);
    *out = sizes[scene->object_count / 2];
    hw_free(sizes);
    return HW_OK;
}

static hw_status check_option(double value, const char *name)
{
    if (!(value >= 0 && isfinite(value)))
        return hw_fail(HW_USAGE, "the %s of a tour must be positive", name);
    return HW_OK;
}

static double or_default(double value, double fallback)
{
    return value > 0 ? value : fallback;
}

static hw_status fill_options(const hw_scene *scene, const hw_tour_options *given,
                              course_options *out)
{
    static const hw_tour_options none = {0};
    const hw_tour_options *o = given ? given : &none;
    HW_TRY(check_option(o->eye_height, "eye height"));
    HW_TRY(check_option(o->speed, "speed"));
    HW_TRY(check_option(o->turn_degrees, "turning speed"));
    HW_TRY(check_option(o->frame_rate, "frame rate"));
    HW_TRY(check_option(o->clearance, "clearance"));
    hw_box box = hw_scene_bounds(scene);
    double size;
    HW_TRY(median_size(scene, &size));
    // Flat and pointlike objects still need some distance.
    size = fmax(size, 1e-3 * (double)hw_box_diagonal(box));
    size = fmax(size, 1e-3);
    double ground = scene->ground.present ? scene->ground.rect.min.z : box.min.z;
    out->eye_z = ground + or_default(o->eye_height, 12);
    out->speed = or_default(o->speed, 30);
    out->turn_rad = or_default(o->turn_degrees, 45) * HW_PI / 180;
    out->frame_rate = or_default(o->frame_rate, 60);
    out->clearance = or_default(o->clearance, size / 4);
    out->span = fmax(SPAN_SECONDS * out->speed, SPAN_SIZES * size);
    out->seed = o->seed;
    return HW_OK;
}

// The path with a view direction at each point and the time that the way to the next one takes.
typedef struct schedule {
    uint32_t count;
    double (*points)[2]; // borrowed
    double *heading;     // radians, unwrapped; count + 1, the last one after a full round
    double *seconds;     // count
} schedule;

static void schedule_free(schedule *s)
{
    hw_free(s->heading);
    hw_free(s->seconds);
}

static double side_length(const schedule *s, uint32_t i)
{
    const double *a = s->points[i], *b = s->points[(i + 1) % s->count];
    return hypot(b[0] - a[0], b[1] - a[1]);
}

static double direction_at(const hw_tour_path *path, uint32_t i)
{
    const double *a = path->points[(i + path->count - 1) % path->count];
    const double *b = path->points[(i + 1) % path->count];
    return atan2(b[1] - a[1], b[0] - a[0]) + (path->around ? HW_PI / 2 : 0);
}

// Running mean of a periodic sequence over 2 half + 1 elements.
static void average_turns(const double *in, double *out, uint32_t count, uint32_t half)
{
    for (uint32_t i = 0; i < count; i++) {
        // Summed anew each time: a running sum would gather rounding over a long path.
        double sum = 0;
        for (uint32_t k = 0; k <= 2 * half; k++)
            sum += in[(i + count + k - half) % count];
        out[i] = sum / (2 * half + 1);
    }
}

// Headings: the turns from point to point, averaged so that corners become curves, then summed up.
static hw_status plan_headings(const hw_tour_path *path, uint32_t half, schedule *s)
{
    hw_status status = HW_OK;
    uint32_t n = path->count;
    double *turns = NULL, *other = NULL;
    HW_GO(HW_NEW(&turns, n));
    HW_GO(HW_NEW(&other, n));
    for (uint32_t i = 0; i < n; i++)
        turns[i] = remainder(direction_at(path, (i + 1) % n) - direction_at(path, i), 2 * HW_PI);
    average_turns(turns, other, n, half);
    average_turns(other, turns, n, half);
    // The constant that averaging turns leaves open: the mean deviation from the path is zero.
    double deviation = 0;
    s->heading[0] = direction_at(path, 0);
    for (uint32_t i = 0; i < n; i++) {
        s->heading[i + 1] = s->heading[i] + turns[i];
        deviation += remainder(direction_at(path, i) - s->heading[i], 2 * HW_PI) / n;
    }
    for (uint32_t i = 0; i <= n; i++)
        s->heading[i] += deviation;
out:
    hw_free(turns);
    hw_free(other);
    return status;
}

// Slows point `i` down to what `other` (the one before or after) can be reached from.
static void limit_acceleration(schedule *s, uint32_t i, uint32_t other, double acceleration)
{
    double length = side_length(s, i), before = side_length(s, other);
    if (length <= 0 || before <= 0)
        return;
    double v = before / s->seconds[other];
    double most = sqrt(v * v + acceleration * (length + before));
    s->seconds[i] = fmax(s->seconds[i], length / most);
}

// Per side the least time that keeps speed and turn within their limits, then acceleration: twice
// round in both directions, so that the loop's end meets its start.
static void plan_times(const course_options *o, schedule *s)
{
    uint32_t n = s->count;
    double acceleration = o->speed / ACCELERATION;
    for (uint32_t i = 0; i < n; i++)
        s->seconds[i] = fmax(side_length(s, i) / o->speed,
                             fabs(s->heading[i + 1] - s->heading[i]) / o->turn_rad);
    for (uint32_t i = 0; i < 2 * n; i++)
        limit_acceleration(s, (i + 1) % n, i % n, acceleration);
    for (uint32_t i = 2 * n; i > 0; i--)
        limit_acceleration(s, (i - 1) % n, i % n, acceleration);
}

// Frames at even times along the schedule, stretched a little so that the loop takes a whole number
// of them.
static hw_status make_frames(const course_options *o, const schedule *s, hw_tour *out)
{
    double total = 0;
    for (uint32_t i = 0; i < s->count; i++)
        total += s->seconds[i];
    double wanted = fmax(ceil(total * o->frame_rate), 1);
    if (!(wanted <= HW_TOUR_FRAMES_MAX))
        return hw_fail(HW_LIMIT, "the tour would have more than %u frames", HW_TOUR_FRAMES_MAX);
    uint32_t count = (uint32_t)wanted, i = 0;
    HW_TRY(HW_NEW(&out->frames, count));
    out->frame_count = count;
    out->fov_degrees = 60;
    double done = 0; // seconds up to point i
    for (uint32_t f = 0; f < count; f++) {
        double t = total * f / count;
        while (i + 1 < s->count && done + s->seconds[i] <= t)
            done += s->seconds[i++];
        double part = s->seconds[i] > 0 ? fmin((t - done) / s->seconds[i], 1) : 0;
        const double *a = s->points[i], *b = s->points[(i + 1) % s->count];
        double heading = s->heading[i] + part * (s->heading[i + 1] - s->heading[i]);
        out->frames[f] = (hw_tour_frame){
            .t = f / o->frame_rate,
            .eye = hw_v3((float)(a[0] + part * (b[0] - a[0])), (float)(a[1] + part * (b[1] - a[1])),
                         (float)o->eye_z),
            .forward = hw_v3((float)cos(heading), (float)sin(heading), 0),
            .up = hw_v3(0, 0, 1),
        };
    }
    return HW_OK;
}

static hw_status drive(const course_options *o, const hw_tour_path *path, hw_tour *out)
{
    hw_status status = HW_OK;
    schedule s = {.count = path->count, .points = path->points};
    HW_GO(HW_NEW(&s.heading, (size_t)path->count + 1));
    HW_GO(HW_NEW(&s.seconds, path->count));
    double half = LOOK_SMOOTHING * o->speed / fmax(side_length(&s, 0), 1e-9) / 2;
    HW_GO(plan_headings(path, (uint32_t)fmin(half, path->count / 64.0), &s));
    plan_times(o, &s);
    HW_GO(make_frames(o, &s, out));
out:
    schedule_free(&s);
    return status;
}

hw_status hw_tour_generate(const hw_scene *scene, const hw_tour_options *options, hw_tour *out)
{
    hw_status status = HW_OK;
    hw_clearance *clearance = NULL;
    hw_tour_path path = {0};
    course_options o;
    *out = (hw_tour){0};
    if (scene->object_count == 0)
        return hw_fail(HW_FORMAT, "%s: no objects to tour", scene->path ? scene->path : "scene");
    HW_GO(fill_options(scene, options, &o));
    hw_tour_path_options course = {.clearance = o.clearance,
                                   .turn_radius = o.speed / o.turn_rad,
                                   .span = o.span,
                                   .step = o.speed / o.frame_rate / 2,
                                   .seed = o.seed};
    HW_GO(hw_clearance_create(&clearance, scene, o.eye_z, hw_tour_path_reach(scene, &course)));
    HW_GO(hw_tour_path_plan(scene, clearance, &course, &path));
    HW_GO(drive(&o, &path, out));
out:
    hw_tour_path_free(&path);
    hw_clearance_destroy(clearance);
    if (status != HW_OK)
        hw_tour_free(out);
    return status;
}
