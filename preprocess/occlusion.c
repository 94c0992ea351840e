#include "occlusion.h"
#include "alloc.h"
#include "cell_eyes.h"
#include "hash.h"
#include "inner_boxes.h"
#include "parallel.h"
#include "region.h"
#include "rng.h"
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#define WIDE     3.0 // margins round an object within which a ray is close
#define SEEDS    8u  // rays to an object that are followed up, the last found
#define STEP_MAX 0.2 // of a ray's ends when it is followed up, in cell sizes
#define OCTAVES  8.0 // by which the least step is smaller

struct hw_occlusion {
    const hw_scene *scene;
    const hw_rays *rays;
    hw_hexgrid grid;
    hw_occlusion_options options;
    bool *solid; // per mesh: closed and turned outward
    bool all_solid;
    hw_mesh inside;  // boxes inside solid objects, world space
    hw_rays *blocks; // of `inside`; NULL if there is none
    pthread_mutex_t mutex;
    bool **seen; // per cell of level 0, once asked for; guarded by mutex
};

hw_occlusion_options hw_occlusion_defaults(void)
{
    return (hw_occlusion_options){.eyes = 64, .face_eyes = 96, .margin = 0.1};
}

// ---- the scene -------------------------------------------------------------------------------

static int by_edge(const void *x, const void *y)
{
    const uint64_t a = *(const uint64_t *)x >> 1, b = *(const uint64_t *)y >> 1;
    return (a > b) - (a < b);
}

// Whether every edge is used as often in one direction as in the other, and the volume is positive.
static hw_status mesh_is_solid(const hw_mesh *mesh, bool *out)
{
    hw_status status = HW_OK;
    uint32_t *weld = NULL;
    uint64_t *edges = NULL;
    size_t n = mesh->index_count;
    *out = hw_mesh_volume(mesh) > 0;
    HW_GO(HW_NEW(&weld, mesh->vertex_count));
    HW_GO(HW_NEW(&edges, n));
    HW_GO(hw_mesh_weld_map(mesh, weld));
    for (size_t i = 0; i < n; i++) {
        uint64_t a = weld[mesh->indices[i]];
        uint64_t b = weld[mesh->indices[i % 3 == 2 ? i - 2 : i + 1]];
        // Vertices count up to 2^32, but with 2^31 a mesh would not fit into memory.
        edges[i] = a < b ? a << 33 | b << 1 : b << 33 | a << 1 | 1;
    }
    qsort(edges, n, sizeof *edges, by_edge);
    int64_t balance = 0;
    for (size_t i = 0; i < n; i++) {
        balance += edges[i] & 1 ? 1 : -1;
        if (i + 1 == n || edges[i] >> 1 != edges[i + 1] >> 1) {
            *out &= balance == 0;
            balance = 0;
        }
    }
out:
    hw_free(weld);
    hw_free(edges);
    return status;
}

// What is found out of one mesh.
typedef struct mesh_inside {
    hw_box boxes[HW_INNER_BOXES_MAX];
    uint32_t count;
} mesh_inside;

typedef struct study {
    hw_occlusion *occlusion;
    mesh_inside *insides; // per mesh
} study;

static hw_status study_mesh(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    study *s = context;
    const hw_mesh *mesh = &s->occlusion->scene->meshes[index];
    HW_TRY(mesh_is_solid(mesh, &s->occlusion->solid[index]));
    if (!s->occlusion->solid[index])
        return HW_OK;
    return hw_inner_boxes(mesh, s->insides[index].boxes, &s->insides[index].count);
}

static void add_box(hw_mesh *mesh, const hw_mat4 *transform, hw_box box)
{
    // Corner i has bit k for the upper end along axis k.
    static const uint8_t faces[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6},
                                         {0, 1, 4}, {1, 5, 4}, {2, 6, 3}, {3, 6, 7},
                                         {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    for (uint32_t i = 0; i < 36; i++)
        mesh->indices[mesh->index_count++] = mesh->vertex_count + faces[i / 3][i % 3];
    for (uint32_t i = 0; i < 8; i++)
        mesh->positions[mesh->vertex_count++] = hw_mat4_point(transform, hw_box_corner(box, i));
}

static hw_status make_blocks(hw_occlusion *o, const mesh_inside *insides)
{
    size_t count = 0;
    for (uint32_t i = 0; i < o->scene->object_count; i++)
        count += insides[o->scene->objects[i].mesh_idx].count;
    if (count == 0)
        return HW_OK;
    HW_TRY(HW_NEW(&o->inside.positions, 8 * count));
    HW_TRY(HW_NEW(&o->inside.indices, 36 * count));
    for (uint32_t i = 0; i < o->scene->object_count; i++) {
        const hw_object *object = &o->scene->objects[i];
        for (uint32_t k = 0; k < insides[object->mesh_idx].count; k++)
            add_box(&o->inside, &object->transform, insides[object->mesh_idx].boxes[k]);
    }
    return hw_rays_create_mesh(&o->blocks, &o->inside);
}

static hw_status study_scene(hw_occlusion *o)
{
    hw_status status = HW_OK;
    study s = {o, NULL};
    HW_GO(HW_NEW(&o->solid, o->scene->mesh_count));
    HW_GO(HW_NEW(&s.insides, o->scene->mesh_count));
    HW_GO(hw_parallel_for(o->scene->mesh_count, 0, study_mesh, &s, NULL));
    o->all_solid = true;
    for (uint32_t i = 0; i < o->scene->mesh_count; i++)
        o->all_solid &= o->solid[i];
    HW_GO(make_blocks(o, s.insides));
out:
    hw_free(s.insides);
    return status;
}

hw_status hw_occlusion_create(hw_occlusion **out, const hw_scene *scene, const hw_rays *rays,
                              const hw_hexgrid *grid, const hw_occlusion_options *options)
{
    hw_status status = HW_OK;
    hw_occlusion *o = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&o, 1));
    pthread_mutex_init(&o->mutex, NULL);
    o->scene = scene;
    o->rays = rays;
    o->grid = *grid;
    o->options = *options;
    HW_GO(study_scene(o));
    HW_GO(HW_NEW(&o->seen, hw_hexgrid_cell_count(grid)));
    *out = o;
    o = NULL;
out:
    hw_occlusion_destroy(o);
    return status;
}

void hw_occlusion_destroy(hw_occlusion *o)
{
    if (!o)
        return;
    for (uint32_t i = 0; o->seen && i < hw_hexgrid_cell_count(&o->grid); i++)
        hw_free(o->seen[i]);
    hw_free(o->seen);
    hw_free(o->solid);
    hw_rays_destroy(o->blocks);
    hw_mesh_free(&o->inside);
    pthread_mutex_destroy(&o->mutex);
    hw_free(o);
}

// ---- rays ------------------------------------------------------------------------------------

// Where a ray enters a box; INFINITY if it misses.
static float entry(hw_vec3 origin, hw_vec3 direction, hw_box box)
{
    const float o[3] = {origin.x, origin.y, origin.z};
    const float d[3] = {direction.x, direction.y, direction.z};
    const float low[3] = {box.min.x, box.min.y, box.min.z};
    const float high[3] = {box.max.x, box.max.y, box.max.z};
    float from = 0, to = INFINITY;
    for (int k = 0; k < 3; k++) {
        float inverse = 1 / (fabsf(d[k]) > 1e-12f ? d[k] : 1e-12f);
        float a = (low[k] - o[k]) * inverse, b = (high[k] - o[k]) * inverse;
        from = fmaxf(from, fminf(a, b));
        to = fminf(to, fmaxf(a, b));
    }
    return from <= to ? from : INFINITY;
}

// What a ray meets before the box of the object it goes to.
typedef enum sight { FREE, WEAKLY_HIDDEN, HIDDEN } sight;

// How some points of an object, or near it, look from an eye. Most that are hidden are so by the
// inside of something; one that is hidden by nothing but the skin passes an edge closely.
static void look(const hw_occlusion *o, hw_vec3 eye, hw_box box, const hw_vec3 *points,
                 uint32_t count, sight *sights)
{
    hw_vec3 directions[HW_RAYS_PACKET];
    float t_max[HW_RAYS_PACKET];
    uint32_t place[HW_RAYS_PACKET], left = 0;
    bool blocked[HW_RAYS_PACKET] = {false};
    for (uint32_t i = 0; i < count; i++) {
        directions[i] = hw_v3_sub(points[i], eye);
        t_max[i] = fminf(entry(eye, directions[i], box) * 0.9999f, 1);
    }
    if (o->blocks)
        hw_rays_occluded_many(o->blocks, eye, directions, t_max, count, NULL, blocked);
    for (uint32_t i = 0; i < count; i++) {
        sights[i] = HIDDEN;
        directions[left] = directions[i];
        t_max[left] = t_max[i];
        place[left] = i;
        left += !blocked[i];
    }
    if (left == 0)
        return;
    hw_rays_occluded_many(o->rays, eye, directions, t_max, left, o->all_solid ? NULL : o->solid,
                          blocked);
    for (uint32_t i = 0; i < left; i++)
        sights[place[i]] = blocked[i] ? WEAKLY_HIDDEN : FREE;
}

// ---- objects ---------------------------------------------------------------------------------

// A ray from which it may not be far to one that sees the object.
typedef struct seed {
    hw_vec3 eye, point;
} seed;

typedef struct target {
    uint32_t object_idx;
    hw_box box;      // of the object
    hw_box grown[2]; // by the margin, by WIDE margins
    float band[2];   // how far from the outline of those "along" it is
    double shift[3]; // its points are others than those of other objects
    seed seeds[SEEDS];
    uint32_t seed_count; // found so far; the last SEEDS are kept
} target;

static hw_box grow_box(hw_box box, double by)
{
    hw_vec3 grow = hw_v3((float)by, (float)by, (float)by / 2);
    return (hw_box){hw_v3_sub(box.min, grow), hw_v3_add(box.max, grow)};
}

static target target_make(const hw_occlusion *o, uint32_t object_idx)
{
    target t = {.object_idx = object_idx, .box = o->scene->objects[object_idx].bounds};
    const hw_ground *ground = &o->scene->ground;
    double margin = o->options.margin * o->grid.cell_size;
    for (int wide = 0; wide < 2; wide++) {
        double by = wide ? WIDE * margin : margin;
        t.grown[wide] = grow_box(t.box, by);
        t.band[wide] = (float)(1.5 * by) + 1;
        float *bottom = &t.grown[wide].min.z; // nobody sees below the ground
        if (ground->present && *bottom < ground->rect.min.z)
            *bottom = fminf(ground->rect.min.z, t.box.max.z);
    }
    uint64_t h = hw_hash(5, &object_idx, sizeof object_idx);
    for (int k = 0; k < 3; k++)
        t.shift[k] = (double)(h >> 20 * k & 0xfffff) / 0x100000;
    return t;
}

static float blend(float low, float high, double t)
{
    return low + (high - low) * (float)t;
}

// Of the two ends of a box's outline, which lie on one diagonal or the other, the one to the right
// or left.
static void keep_end(hw_box *box, hw_vec3 eye, bool right, float band)
{
    hw_vec3 towards = hw_v3_sub(hw_box_centre(*box), eye);
    bool upper = right == ((double)towards.x * towards.y < 0);
    if (right)
        box->min.x = fmaxf(box->min.x, box->max.x - band);
    else
        box->max.x = fminf(box->max.x, box->min.x + band);
    if (upper)
        box->min.y = fmaxf(box->min.y, box->max.y - band);
    else
        box->max.y = fminf(box->max.y, box->min.y + band);
}

// Point i of a target. Objects come into view at the rim: above what hides them, or beside it. So
// half of the points lie along the top and a quarter at the sides that make the outline.
static hw_vec3 point_at(const target *t, bool wide, hw_vec3 eye, uint32_t i)
{
    hw_box box = t->grown[wide];
    uint32_t kind = i % 4;
    if (kind < 2)
        box.min.z = fmaxf(box.min.z, box.max.z - t->band[wide]);
    else if (kind == 2)
        keep_end(&box, eye, i / 4 % 2, t->band[wide]);
    return hw_v3(blend(box.min.x, box.max.x, hw_spread(i, 2, t->shift[0])),
                 blend(box.min.y, box.max.y, hw_spread(i, 3, t->shift[1])),
                 blend(box.min.z, box.max.z, hw_spread(i, 4, t->shift[2])));
}

// A packet of rays to points of a target: true if one arrives at the box, or passes it by no more
// than the margin. Otherwise notes those that came close to that.
static bool arrives(const hw_occlusion *o, target *t, hw_vec3 eye, const hw_vec3 *points)
{
    sight sights[HW_RAYS_PACKET];
    look(o, eye, t->box, points, HW_RAYS_PACKET, sights);
    for (uint32_t k = 0; k < HW_RAYS_PACKET; k++) {
        if (sights[k] == HIDDEN)
            continue;
        if (sights[k] == FREE &&
            entry(eye, hw_v3_sub(points[k], eye), t->grown[0]) < INFINITY)
            return true;
        t->seeds[t->seed_count++ % SEEDS] = (seed){eye, points[k]};
    }
    return false;
}

// The objects of a cell that no ray has reached yet.
typedef struct search {
    const hw_occlusion *occlusion;
    hw_cell_id id;
    hw_vec3 centre;
    double side; // of the cell
    target *open;
    uint32_t open_count;
    bool *seen; // per object of the scene
} search;

static hw_status search_make(search *s)
{
    const hw_occlusion *o = s->occlusion;
    s->centre = hw_cell_centre(&o->grid, s->id);
    s->side = hw_cell_side(&o->grid, s->id.level);
    HW_TRY(HW_NEW(&s->open, o->scene->object_count));
    for (uint32_t i = 0; i < o->scene->object_count; i++) {
        s->seen[i] = hw_cell_meets_box(&o->grid, s->id, o->scene->objects[i].bounds);
        if (!s->seen[i])
            s->open[s->open_count++] = target_make(o, i);
    }
    return HW_OK;
}

// One packet from eye i to every open object, within the wide margins.
static void look_from(search *s, hw_vec3 eye, uint32_t i)
{
    uint32_t left = 0;
    for (uint32_t k = 0; k < s->open_count; k++) {
        target *t = &s->open[k];
        hw_vec3 points[HW_RAYS_PACKET];
        for (uint32_t n = 0; n < HW_RAYS_PACKET; n++)
            points[n] = point_at(t, n < HW_RAYS_PACKET / 2, eye, i * HW_RAYS_PACKET + n);
        if (arrives(s->occlusion, t, eye, points))
            s->seen[t->object_idx] = true;
        else
            s->open[left++] = *t;
    }
    s->open_count = left;
}

// A point near another one; the way is as likely of any length as of half of it.
static hw_vec3 step_from(hw_vec3 p, double step, hw_rng *rng)
{
    float r = (float)(step * exp2(-OCTAVES * (double)hw_rng_float(rng)));
    return hw_v3(p.x + r * (2 * hw_rng_float(rng) - 1), p.y + r * (2 * hw_rng_float(rng) - 1),
                 p.z + r * (2 * hw_rng_float(rng) - 1));
}

// Moved into the cell, towards its axis.
static hw_vec3 clamp_to_cell(const search *s, hw_vec3 p)
{
    const hw_hexgrid *grid = &s->occlusion->grid;
    double x = fabs((double)p.x - (double)s->centre.x), y = fabs((double)p.y - (double)s->centre.y);
    // Of a hexagon with corners on the x axis: its sides are at half sqrt(3) of it.
    double out = fmax(y, x * sqrt(0.75) + y / 2) / (s->side * sqrt(0.75));
    if (out > 1) {
        p.x = s->centre.x + (p.x - s->centre.x) / (float)out;
        p.y = s->centre.y + (p.y - s->centre.y) / (float)out;
    }
    p.z = fminf(fmaxf(p.z, (float)grid->z_min), (float)grid->z_max);
    return p;
}

// Rays near those that came close, and near those of them that come close again.
static bool follow_up(const search *s, target *t)
{
    const hw_occlusion *o = s->occlusion;
    double step = STEP_MAX * s->side;
    const uint32_t place[] = {(uint32_t)s->id.q, (uint32_t)s->id.r, t->object_idx};
    hw_rng rng = hw_rng_make(7, hw_hash(7, place, sizeof place));
    for (uint32_t i = 0; i < o->options.eyes && t->seed_count > 0; i++) {
        const seed from = t->seeds[i % (t->seed_count < SEEDS ? t->seed_count : SEEDS)];
        hw_vec3 points[HW_RAYS_PACKET], eye = clamp_to_cell(s, step_from(from.eye, step, &rng));
        for (uint32_t n = 0; n < HW_RAYS_PACKET; n++) {
            hw_vec3 p = step_from(from.point, step, &rng);
            points[n] = hw_v3_max(hw_v3_min(p, t->grown[0].max), t->grown[0].min);
        }
        if (arrives(o, t, eye, points))
            return true;
    }
    return false;
}

static hw_status search_cell(const hw_occlusion *o, hw_cell_id id, bool *seen)
{
    hw_status status = HW_OK;
    search s = {.occlusion = o, .id = id, .seen = seen};
    uint32_t count = o->options.eyes;
    hw_vec3 *eyes = NULL;
    HW_GO(search_make(&s));
    HW_GO(HW_NEW(&eyes, count));
    hw_cell_eyes(&o->grid, id, count, eyes);
    for (uint32_t i = 0; i < count && s.open_count > 0; i++)
        look_from(&s, eyes[i], i);
    for (uint32_t k = 0; k < s.open_count; k++)
        seen[s.open[k].object_idx] = follow_up(&s, &s.open[k]);
out:
    hw_free(s.open);
    hw_free(eyes);
    return status;
}

// ---- cells -----------------------------------------------------------------------------------

// Adds what is seen from a cell of level 0. Searched for once only, or by several threads to the
// same end.
static hw_status add_seen(hw_occlusion *o, hw_cell_id id, bool *seen)
{
    uint32_t count = o->scene->object_count;
    bool **slot = &o->seen[hw_hexgrid_index(&o->grid, id)], *own = NULL;
    pthread_mutex_lock(&o->mutex);
    const bool *known = *slot;
    pthread_mutex_unlock(&o->mutex);
    if (!known) {
        HW_TRY(HW_NEW(&own, count));
        hw_status status = search_cell(o, id, own);
        if (status != HW_OK) {
            hw_free(own);
            return status;
        }
        pthread_mutex_lock(&o->mutex);
        if (*slot)
            hw_free(own);
        else
            *slot = own;
        known = *slot;
        pthread_mutex_unlock(&o->mutex);
    }
    for (uint32_t i = 0; i < count; i++)
        seen[i] |= known[i];
    return HW_OK;
}

hw_status hw_occlusion_query(hw_occlusion *o, hw_cell_id id, bool *seen)
{
    hw_status status = HW_OK;
    hw_cell_id *leaves = NULL;
    uint32_t count = 0;
    memset(seen, 0, o->scene->object_count * sizeof *seen);
    HW_GO(hw_cell_leaves(&o->grid, id, &leaves, &count));
    for (uint32_t i = 0; i < count; i++)
        HW_GO(add_seen(o, leaves[i], seen));
out:
    hw_free(leaves);
    return status;
}
