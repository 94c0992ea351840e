#include "park.h"
#include "alloc.h"
#include "court.h"
#include "rng.h"
#include "statues.h"
#include <stdlib.h>
#include <string.h>

enum { DEMO, PARK_2M, PARK_4M, PARK_8M, COURT, PRESET_COUNT };

// Thesis, table 5.2: how many of each kind the three parks hold, and its largest dimension. Where
// the thesis has a statue that nobody can download, one of about its face count and size stands in:
// man for "statue", bull for "cattle", homer for "easter", head for "venus". The courts hold the
// statues of 4m but its dragons.
typedef struct park_kind {
    const char *statue;
    float largest; // units
    uint32_t counts[PRESET_COUNT];
} park_kind;

static const park_kind kinds[] = {
    {"dragon", 57.3f, {0, 4, 10, 18, 0}},    {"bunny", 43.6f, {2, 7, 12, 26, 12}},
    {"man", 23.4f, {4, 13, 21, 40, 21}},     {"bull", 40.8f, {4, 9, 19, 42, 19}},
    {"horse", 82.6f, {5, 13, 29, 51, 29}},   {"homer", 30.8f, {4, 6, 14, 22, 14}},
    {"camel", 49.4f, {4, 4, 14, 26, 14}},    {"head", 21.9f, {3, 8, 13, 28, 13}},
    {"elephant", 60.0f, {1, 0, 0, 0, 0}},    {"armadillo", 40.0f, {2, 0, 0, 0, 0}},
    {"guardian", 45.0f, {5, 0, 0, 0, 0}},    {"lion", 30.0f, {3, 0, 0, 0, 0}},
    {"devil", 26.0f, {3, 0, 0, 0, 0}},       {"cow", 36.0f, {4, 0, 0, 0, 0}},
    {"diplodocus", 75.0f, {2, 0, 0, 0, 0}},  {"dinosaur", 50.0f, {3, 0, 0, 0, 0}},
    {"triceratops", 52.0f, {3, 0, 0, 0, 0}}, {"fist", 18.0f, {2, 0, 0, 0, 0}},
};
#define KIND_COUNT ((uint32_t)(sizeof kinds / sizeof *kinds))

#define THESIS_WIDTH   1650.0 // thesis 5.3, "Scene statistics"
#define THESIS_DEPTH   2035.0
#define THESIS_OBJECTS 253.0
#define GROUND_MARGIN  400.0f
#define GAP            4.0f // between the bounds of two objects
#define ATTEMPTS_MAX   4000 // per object, before the area counts as full
#define COURT_ATTEMPTS 200  // per object and court
#define COURT_COLUMNS  7u   // as many that the courts are as dense as the thesis's parks
#define COURT_ROWS     7u
#define COURT_STEP     19u // coprime to their number

typedef struct tint {
    const char *name;
    float color[3];
} tint;
static const tint tints[] = {
    {"limestone", {0.97f, 0.93f, 0.83f}},        {"sandstone", {0.95f, 0.81f, 0.61f}},
    {"granite", {0.79f, 0.78f, 0.79f}},          {"marble", {1.00f, 0.99f, 0.97f}},
    {"weathered bronze", {0.63f, 0.75f, 0.65f}}, {"terracotta", {0.95f, 0.65f, 0.50f}},
};
#define TINT_COUNT ((uint32_t)(sizeof tints / sizeof *tints))
static const float ground_color[3] = {0.55f, 0.56f, 0.43f};

// What is to be placed: the kinds in order, and where.
typedef struct plan {
    uint32_t *kinds;
    uint32_t count;
    double width, depth;
    uint64_t seed;
    bool in_courts;
} plan;

static void add_to_plan(plan *p, uint32_t kind, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        p->kinds[p->count++] = kind;
}

static uint32_t preset_total(int preset)
{
    uint32_t total = 0;
    for (uint32_t k = 0; k < KIND_COUNT; k++)
        total += kinds[k].counts[preset];
    return total;
}

// All of 2m, then what 4m adds, then what 8m adds: placed in this order from one seed, each park
// begins with the one before.
static hw_status plan_preset(const char *name, plan *out)
{
    static const char *const names[PRESET_COUNT] = {"demo", "2m", "4m", "8m", "court"};
    int preset = 0;
    while (preset < PRESET_COUNT && strcmp(name, names[preset]))
        preset++;
    if (preset == PRESET_COUNT)
        return hw_fail(HW_USAGE, "unknown park '%s' (demo, 2m, 4m, 8m, 84m or court)", name);
    uint32_t total = preset_total(preset);
    double scale = preset == DEMO ? sqrt(total / THESIS_OBJECTS) : 1;
    out->width = THESIS_WIDTH * scale;
    out->depth = THESIS_DEPTH * scale;
    out->seed = preset == DEMO ? 7 : 2006;
    out->in_courts = preset == COURT;
    if (out->in_courts) {
        out->width = COURT_COLUMNS * HW_COURT_SIDE;
        out->depth = COURT_ROWS * HW_COURT_SIDE;
    }
    HW_TRY(HW_NEW(&out->kinds, total));
    int first = preset == DEMO || preset == COURT ? preset : PARK_2M;
    for (int stage = first; stage <= preset; stage++)
        for (uint32_t k = 0; k < KIND_COUNT; k++)
            add_to_plan(out, k,
                        kinds[k].counts[stage] - (stage == first ? 0 : kinds[k].counts[stage - 1]));
    return HW_OK;
}

// Any number of objects in the proportions of a preset: each object is of the kind that lags most
// behind its share, so that every multiple of the preset's count has exactly its mix.
static hw_status plan_any(const hw_park_options *options, plan *out)
{
    if (options->object_count == 0 || options->object_count > HW_PARK_OBJECTS_MAX)
        return hw_fail(HW_USAGE, "a park has from 1 to %u objects", HW_PARK_OBJECTS_MAX);
    bool derived = options->width == 0 && options->depth == 0;
    if (!derived && !(options->width > 0 && options->depth > 0 && isfinite(options->width) &&
                      isfinite(options->depth)))
        return hw_fail(HW_USAGE, "the area of a park needs a positive width and depth");
    double scale = sqrt(options->object_count / THESIS_OBJECTS);
    out->width = derived ? THESIS_WIDTH * scale : options->width;
    out->depth = derived ? THESIS_DEPTH * scale : options->depth;
    out->seed = options->seed;
    HW_TRY(HW_NEW(&out->kinds, options->object_count));
    int mix = options->with_dragon ? PARK_8M : DEMO;
    double total = preset_total(mix);
    uint32_t placed[KIND_COUNT] = {0};
    for (uint32_t i = 0; i < options->object_count; i++) {
        uint32_t best = 0;
        double most = -INFINITY;
        for (uint32_t k = 0; k < KIND_COUNT; k++) {
            double lag = kinds[k].counts[mix] * (i + 1.0) / total - placed[k];
            if (kinds[k].counts[mix] && lag > most) {
                most = lag;
                best = k;
            }
        }
        placed[best]++;
        add_to_plan(out, best, 1);
    }
    return HW_OK;
}

// The vertices of a mesh that can be extreme in some horizontal direction, and its heights: enough
// for the exact bounds of the mesh turned about the z axis.
typedef struct outline {
    hw_vec3 *points;
    uint32_t count;
} outline;

static int compare_xy(const void *a, const void *b)
{
    const hw_vec3 *p = a, *q = b;
    if (p->x != q->x)
        return p->x < q->x ? -1 : 1;
    return (p->y > q->y) - (p->y < q->y);
}

static double turn_xy(hw_vec3 a, hw_vec3 b, hw_vec3 c)
{
    return ((double)b.x - a.x) * ((double)c.y - a.y) - ((double)b.y - a.y) * ((double)c.x - a.x);
}

// Convex hull in the x-y plane (Andrew's monotone chain), and a lowest and a highest point.
static hw_status outline_make(const hw_mesh *mesh, outline *out)
{
    hw_vec3 *sorted = NULL;
    uint32_t n = mesh->vertex_count, count = 0;
    hw_status status = HW_OK;
    HW_GO(HW_NEW(&sorted, n));
    HW_GO(HW_NEW(&out->points, 2 * (size_t)n + 2));
    memcpy(sorted, mesh->positions, n * sizeof *sorted);
    qsort(sorted, n, sizeof *sorted, compare_xy);
    hw_vec3 *hull = out->points;
    for (int side = 0; side < 2; side++) {
        uint32_t base = count;
        for (uint32_t i = 0; i < n; i++) {
            hw_vec3 p = sorted[side ? n - 1 - i : i];
            while (count >= base + 2 && turn_xy(hull[count - 2], hull[count - 1], p) <= 0)
                count--;
            hull[count++] = p;
        }
    }
    hw_vec3 low = sorted[0], high = sorted[0];
    for (uint32_t i = 1; i < n; i++) {
        low = sorted[i].z < low.z ? sorted[i] : low;
        high = sorted[i].z > high.z ? sorted[i] : high;
    }
    hull[count++] = low;
    hull[count++] = high;
    out->count = count;
    HW_GO(HW_RESIZE(&out->points, count));
out:
    hw_free(sorted);
    return status;
}

static hw_box outline_bounds(const outline *o, const hw_mat4 *transform)
{
    hw_box box = hw_box_empty();
    for (uint32_t i = 0; i < o->count; i++)
        hw_box_add(&box, hw_mat4_point(transform, o->points[i]));
    return box;
}

// Objects placed so far, in lists per square of a grid. A square is at least as large as the
// largest object with its gap, so that only neighbouring squares can hold a conflict.
typedef struct occupancy {
    double origin_x, origin_y, side;
    int32_t columns, rows;
    uint32_t *first, *next; // object index + 1; 0 ends a list
} occupancy;

static void occupancy_free(occupancy *o)
{
    hw_free(o->first);
    hw_free(o->next);
}

static hw_status occupancy_make(const plan *p, double largest, occupancy *out)
{
    // No more squares than a few per object, however wide the area.
    double side = fmax(largest + GAP, sqrt(p->width * p->depth / (4.0 * p->count + 16)));
    out->origin_x = -p->width / 2;
    out->origin_y = -p->depth / 2;
    // A long and narrow area still gives few squares.
    side = fmax(side, fmax(p->width, p->depth) / 1e6);
    out->side = side;
    out->columns = (int32_t)(p->width / side) + 1;
    out->rows = (int32_t)(p->depth / side) + 1;
    HW_TRY(HW_NEW(&out->first, (size_t)out->columns * (size_t)out->rows));
    return HW_NEW(&out->next, p->count);
}

static int32_t clamp_index(double value, int32_t count)
{
    return value < 0 ? 0 : value >= count ? count - 1 : (int32_t)value;
}

static void occupancy_square(const occupancy *o, hw_box box, int32_t *column, int32_t *row)
{
    hw_vec3 centre = hw_box_centre(box);
    *column = clamp_index((centre.x - o->origin_x) / o->side, o->columns);
    *row = clamp_index((centre.y - o->origin_y) / o->side, o->rows);
}

static bool too_close(hw_box a, hw_box b)
{
    return a.min.x - GAP < b.max.x && b.min.x - GAP < a.max.x && a.min.y - GAP < b.max.y &&
           b.min.y - GAP < a.max.y;
}

static bool square_is_free(const occupancy *o, const hw_object *objects, int32_t column,
                           int32_t row, hw_box box)
{
    if (column < 0 || row < 0 || column >= o->columns || row >= o->rows)
        return true;
    uint32_t i = o->first[(size_t)row * (size_t)o->columns + (size_t)column];
    for (; i; i = o->next[i - 1])
        if (too_close(objects[i - 1].bounds, box))
            return false;
    return true;
}

static bool place_is_free(const occupancy *o, const hw_object *objects, hw_box box)
{
    int32_t column, row;
    occupancy_square(o, box, &column, &row);
    for (int32_t r = row - 1; r <= row + 1; r++)
        for (int32_t c = column - 1; c <= column + 1; c++)
            if (!square_is_free(o, objects, c, r, box))
                return false;
    return true;
}

static void occupy(occupancy *o, uint32_t object_idx, hw_box box)
{
    int32_t column, row;
    occupancy_square(o, box, &column, &row);
    size_t square = (size_t)row * (size_t)o->columns + (size_t)column;
    o->next[object_idx] = o->first[square];
    o->first[square] = object_idx + 1;
}

// 48 bits, so that wide areas are not a raster of floats.
static double uniform(hw_rng *rng)
{
    double high = hw_rng_u32(rng) >> 8, low = hw_rng_u32(rng) >> 8;
    return (high + low / 16777216.0) / 16777216.0;
}

// Where an object may stand.
typedef struct region {
    double x_min, y_min, width, depth;
} region;

// Moves object i, turned already, to a random free place of the region; false if none was found.
static bool find_place(const region *r, const outline *shape, hw_box box, int attempts,
                       occupancy *o, hw_rng *rng, hw_object *objects, uint32_t i)
{
    hw_vec3 size = hw_box_size(box);
    double free_x = r->width - size.x, free_y = r->depth - size.y;
    for (int attempt = 0; free_x > 0 && free_y > 0 && attempt < attempts; attempt++) {
        double x = r->x_min + free_x * uniform(rng) - box.min.x;
        double y = r->y_min + free_y * uniform(rng) - box.min.y;
        hw_box moved = box;
        moved.min.x += (float)x;
        moved.max.x += (float)x;
        moved.min.y += (float)y;
        moved.max.y += (float)y;
        if (!place_is_free(o, objects, moved))
            continue;
        hw_mat4 shift = hw_mat4_translation(x, y, 0);
        objects[i].transform = hw_mat4_mul(shift, objects[i].transform);
        objects[i].bounds = outline_bounds(shape, &objects[i].transform);
        occupy(o, i, objects[i].bounds);
        return true;
    }
    return false;
}

// Turns and places object i, whose mesh is set, at random: in courts in the i-th one, counted in
// steps that visit them all, or the next where there is room.
static hw_status place_object(const plan *p, const outline *shape, occupancy *o, hw_rng *rng,
                              hw_object *objects, uint32_t i)
{
    objects[i].transform = hw_mat4_rotation_z(2 * HW_PI * uniform(rng));
    objects[i].material_idx = hw_rng_below(rng, TINT_COUNT);
    hw_box box = outline_bounds(shape, &objects[i].transform);
    region all = {-p->width / 2, -p->depth / 2, p->width, p->depth};
    if (!p->in_courts && find_place(&all, shape, box, ATTEMPTS_MAX, o, rng, objects, i))
        return HW_OK;
    const uint32_t courts = COURT_COLUMNS * COURT_ROWS;
    for (uint32_t k = 0; p->in_courts && k < courts; k++) {
        hw_court_floor f =
            hw_court_floor_of(COURT_COLUMNS, COURT_ROWS, (i + k) * COURT_STEP % courts);
        region floor = {f.x_min, f.y_min, f.side, f.side};
        if (find_place(&floor, shape, box, COURT_ATTEMPTS, o, rng, objects, i))
            return HW_OK;
    }
    return hw_fail(HW_LIMIT, "only %u of %u statues fit an area of %g x %g units", i, p->count,
                   p->width, p->depth);
}

static double largest_side(hw_box box)
{
    hw_vec3 size = hw_box_size(box);
    return fmax(size.x, fmax(size.y, size.z));
}

// One mesh per kind that the plan uses; mesh_of[kind] is its index.
static hw_status load_meshes(const plan *p, const char *folder, hw_scene *scene, uint32_t *mesh_of)
{
    bool used[KIND_COUNT] = {false};
    for (uint32_t i = 0; i < p->count; i++)
        used[p->kinds[i]] = true;
    HW_TRY(HW_NEW(&scene->meshes, KIND_COUNT));
    for (uint32_t k = 0; k < KIND_COUNT; k++) {
        if (!used[k])
            continue;
        hw_mesh *mesh = &scene->meshes[scene->mesh_count];
        HW_TRY(hw_statue_load(hw_statue_find(kinds[k].statue), folder, mesh));
        mesh_of[k] = scene->mesh_count++;
        double s = kinds[k].largest / largest_side(hw_mesh_bounds(mesh));
        hw_mat4 scale = hw_mat4_scale(s, s, s);
        hw_mesh_transform(mesh, &scale);
    }
    return HW_OK;
}

static hw_status make_materials(hw_scene *scene)
{
    HW_TRY(HW_NEW(&scene->materials, TINT_COUNT));
    scene->material_count = TINT_COUNT;
    for (uint32_t i = 0; i < TINT_COUNT; i++) {
        HW_TRY(hw_strdup(&scene->materials[i].name, tints[i].name));
        memcpy(scene->materials[i].base_color, tints[i].color, sizeof tints[i].color);
    }
    return HW_OK;
}

static void make_ground(const plan *p, hw_ground *ground)
{
    float x = (float)(p->width / 2) + GROUND_MARGIN, y = (float)(p->depth / 2) + GROUND_MARGIN;
    ground->present = true;
    ground->rect = (hw_box){{-x, -y, 0}, {x, y, 0}};
    memcpy(ground->color, ground_color, sizeof ground_color);
}

static hw_status place_objects(const plan *p, const uint32_t *mesh_of, hw_scene *scene)
{
    hw_status status = HW_OK;
    outline outlines[KIND_COUNT] = {{0}};
    occupancy o = {0};
    double largest = 0;
    hw_rng rng = hw_rng_make(p->seed, 1);
    for (uint32_t m = 0; m < scene->mesh_count; m++) {
        HW_GO(outline_make(&scene->meshes[m], &outlines[m]));
        largest = fmax(largest, hw_box_diagonal(hw_mesh_bounds(&scene->meshes[m])));
    }
    HW_GO(occupancy_make(p, largest, &o));
    HW_GO(HW_NEW(&scene->objects, p->count));
    for (uint32_t i = 0; i < p->count; i++) {
        uint32_t mesh_idx = mesh_of[p->kinds[i]];
        scene->objects[i].mesh_idx = mesh_idx;
        HW_GO(place_object(p, &outlines[mesh_idx], &o, &rng, scene->objects, i));
        scene->object_count = i + 1;
    }
out:
    for (uint32_t k = 0; k < KIND_COUNT; k++)
        hw_free(outlines[k].points);
    occupancy_free(&o);
    return status;
}

// Ten times 8m: its mix and density on ten times the area.
static const hw_park_options tenfold = {
    .preset = "84m", .object_count = 2530, .seed = 2006, .with_dragon = true};

hw_status hw_park_make(const hw_park_options *options, hw_scene *out)
{
    hw_status status = HW_OK;
    plan p = {0};
    hw_scene scene = {0};
    uint32_t mesh_of[KIND_COUNT] = {0};
    *out = (hw_scene){0};
    if (options->preset && !strcmp(options->preset, tenfold.preset))
        HW_GO(plan_any(&tenfold, &p));
    else if (options->preset)
        HW_GO(plan_preset(options->preset, &p));
    else
        HW_GO(plan_any(options, &p));
    HW_GO(hw_strdup(&scene.path, options->preset ? options->preset : "park"));
    HW_GO(load_meshes(&p, options->statue_folder, &scene, mesh_of));
    HW_GO(make_materials(&scene));
    HW_GO(place_objects(&p, mesh_of, &scene));
    if (p.in_courts)
        HW_GO(hw_court_build(&scene, COURT_COLUMNS, COURT_ROWS, p.seed));
    make_ground(&p, &scene.ground);
    *out = scene;
    scene = (hw_scene){0};
out:
    hw_scene_free(&scene);
    hw_free(p.kinds);
    return status;
}
