#include "occlusion.h"
#include "alloc.h"
#include "cell_eyes.h"
#include "hash.h"
#include "region.h"
#include "rng.h"
#include <pthread.h>
#include <string.h>

#define WIDE       3.0 // margins round an object within which a ray is close
#define SEEDS      8u  // rays to an object that are followed up, the last found
#define FOLLOW_UPS 4u  // packets after one that came close, for each eye
#define MORE_MAX   64u // packets for each eye that are aimed at one object once more, at most
#define SIDES      6u  // of a cell
#define ROUNDS     3   // a cell by itself, then with what its neighbours saw in the round before
#define STEP_MAX   0.2 // of a ray's ends when it is followed up, in cell sizes
#define OCTAVES    8.0 // by which the least step is smaller

struct hw_occlusion {
    const hw_scene *scene;
    hw_sights *sights;
    hw_hexgrid grid;
    hw_occlusion_options options;
    pthread_mutex_t mutex;
    // What is seen from each cell of level 0, once asked for, after each round; guarded by mutex.
    bool **seen[ROUNDS];
};

hw_occlusion_options hw_occlusion_defaults(void)
{
    return (hw_occlusion_options){.eyes = 64, .more = 1024, .face_eyes = 96, .margin = 0.1};
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
    o->grid = *grid;
    o->options = *options;
    HW_GO(hw_sights_create(&o->sights, scene, rays));
    for (int r = 0; r < ROUNDS; r++)
        HW_GO(HW_NEW(&o->seen[r], hw_hexgrid_cell_count(grid)));
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
    for (int r = 0; r < ROUNDS; r++) {
        for (uint32_t i = 0; o->seen[r] && i < hw_hexgrid_cell_count(&o->grid); i++)
            hw_free(o->seen[r][i]);
        hw_free(o->seen[r]);
    }
    hw_sights_destroy(o->sights);
    pthread_mutex_destroy(&o->mutex);
    hw_free(o);
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
    hw_sight sights[HW_RAYS_PACKET];
    hw_sights_look(o->sights, eye, t->box, NULL, points, HW_RAYS_PACKET, sights);
    for (uint32_t k = 0; k < HW_RAYS_PACKET; k++) {
        if (sights[k] == HW_SIGHT_HIDDEN)
            continue;
        if (sights[k] == HW_SIGHT_FREE &&
            hw_box_entry(eye, hw_v3_sub(points[k], eye), t->grown[0]) < INFINITY)
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

// Rays near those that came close, and near those of them that come close again. Other ones in
// another pass.
static bool follow_up(const search *s, target *t, uint32_t packets, uint32_t pass)
{
    const hw_occlusion *o = s->occlusion;
    double step = STEP_MAX * s->side;
    const uint32_t place[] = {(uint32_t)s->id.q, (uint32_t)s->id.r, t->object_idx};
    hw_rng rng = hw_rng_make(7 + pass, hw_hash(7, place, sizeof place));
    for (uint32_t i = 0; i < packets && t->seed_count > 0; i++) {
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

// Drops the objects that have been found from the search.
static void drop_found(search *s)
{
    uint32_t left = 0;
    for (uint32_t k = 0; k < s->open_count; k++)
        if (!s->seen[s->open[k].object_idx])
            s->open[left++] = s->open[k];
    s->open_count = left;
}

// What a cell sees by its own rays: from everywhere on its surface, to every object.
static hw_status search_first(hw_occlusion *o, hw_cell_id id, bool *seen)
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
        seen[s.open[k].object_idx] = follow_up(&s, &s.open[k], FOLLOW_UPS * count, 0);
out:
    hw_free(s.open);
    hw_free(eyes);
    return status;
}

// ---- neighbours ------------------------------------------------------------------------------

static hw_status search_again(hw_occlusion *o, hw_cell_id id, int round, bool *seen);

// What a cell of level 0 sees after a round. Searched for once only, or by several threads to the
// same end. *out is the occlusion's.
static hw_status remember(hw_occlusion *o, int round, hw_cell_id id, const bool **out)
{
    bool **slot = &o->seen[round][hw_hexgrid_index(&o->grid, id)], *own = NULL;
    pthread_mutex_lock(&o->mutex);
    *out = *slot;
    pthread_mutex_unlock(&o->mutex);
    if (*out)
        return HW_OK;
    HW_TRY(HW_NEW(&own, o->scene->object_count));
    hw_status status = round == 0 ? search_first(o, id, own) : search_again(o, id, round, own);
    if (status != HW_OK) {
        hw_free(own);
        return status;
    }
    pthread_mutex_lock(&o->mutex);
    if (*slot)
        hw_free(own);
    else
        *slot = own;
    *out = *slot;
    pthread_mutex_unlock(&o->mutex);
    return HW_OK;
}

// Point i of a side of the cell; half of them lie on its edges, below and above.
static hw_vec3 side_eye(const hw_vec3 corners[HW_CELL_CORNERS], uint32_t side, uint32_t i)
{
    hw_vec3 a = corners[side], b = corners[(side + 1) % SIDES];
    hw_vec3 eye = hw_v3_mad(a, hw_v3_sub(b, a), (float)hw_spread(i, 5, 0));
    float low = corners[0].z, high = corners[SIDES].z;
    eye.z = i % 4 == 0 ? low : i % 4 == 1 ? high : blend(low, high, hw_spread(i, 1, 0));
    return eye;
}

// Packets from the sides with a bit in `sides` to a target.
static bool look_through(const search *s, target *t, const hw_vec3 corners[HW_CELL_CORNERS],
                         uint32_t sides, int round, uint32_t packets)
{
    uint32_t list[SIDES], count = 0;
    for (uint32_t i = 0; i < SIDES; i++)
        if (sides >> i & 1)
            list[count++] = i;
    uint32_t first = packets * (uint32_t)(round - 1); // others in each round
    for (uint32_t i = first; i < first + packets; i++) {
        hw_vec3 points[HW_RAYS_PACKET], eye = side_eye(corners, list[i % count], i / count);
        for (uint32_t n = 0; n < HW_RAYS_PACKET; n++)
            points[n] = point_at(t, n < HW_RAYS_PACKET / 2, eye, i * HW_RAYS_PACKET + n);
        if (arrives(s->occlusion, t, eye, points))
            return true;
    }
    return false;
}

// What the cells beyond its sides see after a round; NULL where there is none.
static hw_status ask_neighbours(hw_occlusion *o, int round, hw_cell_id id, const bool *seen[SIDES])
{
    hw_cell_id around[SIDES];
    hw_cell_neighbours(id, around);
    for (uint32_t i = 0; i < SIDES; i++) {
        seen[i] = NULL;
        if (hw_hexgrid_contains(&o->grid, around[i]))
            HW_TRY(remember(o, round, around[i], &seen[i]));
    }
    return HW_OK;
}

// A line of sight leaves the cell through a side, or its top: what is seen is seen from a point of
// that side, and so from the cell beyond it. So what a neighbour sees and the cell does not, as far
// as is known, is looked for from their common side, for as long as there is time.
static hw_status search_again(hw_occlusion *o, hw_cell_id id, int round, bool *seen)
{
    hw_status status = HW_OK;
    search s = {.occlusion = o, .id = id, .seen = seen};
    const bool *before, *beyond[SIDES];
    hw_vec3 corners[HW_CELL_CORNERS];
    uint32_t *sides = NULL, doubtful = 0, packets = o->options.more * o->options.eyes;
    HW_GO(remember(o, round - 1, id, &before));
    HW_GO(search_make(&s));
    memcpy(seen, before, o->scene->object_count * sizeof *seen);
    drop_found(&s);
    HW_GO(HW_NEW(&sides, s.open_count));
    if (s.open_count > 0 && packets > 0)
        HW_GO(ask_neighbours(o, round - 1, id, beyond));
    for (uint32_t k = 0; k < s.open_count && packets > 0; k++) {
        for (uint32_t i = 0; i < SIDES; i++)
            sides[k] |= (uint32_t)(beyond[i] && beyond[i][s.open[k].object_idx]) << i;
        doubtful += sides[k] != 0;
    }
    packets /= doubtful ? doubtful : 1;
    if (packets > MORE_MAX * o->options.eyes)
        packets = MORE_MAX * o->options.eyes;
    hw_cell_corners(&o->grid, id, corners);
    for (uint32_t k = 0; k < s.open_count; k++)
        if (sides[k])
            seen[s.open[k].object_idx] =
                look_through(&s, &s.open[k], corners, sides[k], round, packets) ||
                follow_up(&s, &s.open[k], packets, (uint32_t)round);
out:
    hw_free(s.open);
    hw_free(sides);
    return status;
}

// ---- cells -----------------------------------------------------------------------------------

static hw_status add_seen(hw_occlusion *o, hw_cell_id id, bool *seen)
{
    const bool *known;
    HW_TRY(remember(o, ROUNDS - 1, id, &known));
    for (uint32_t i = 0; i < o->scene->object_count; i++)
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

hw_status hw_occlusion_faces(const hw_occlusion *o, hw_cell_id id, const hw_sight_surface *surface,
                             bool *seen)
{
    hw_status status = HW_OK;
    hw_cell_id *leaves = NULL;
    hw_vec3 *eyes = NULL, *leaf_eyes = NULL;
    uint32_t count = 0, each = o->options.face_eyes * HW_SIGHT_EYE_CLASSES;
    HW_GO(hw_cell_leaves(&o->grid, id, &leaves, &count));
    HW_GO(HW_NEW(&eyes, (size_t)each * count));
    HW_GO(HW_NEW(&leaf_eyes, each));
    for (uint32_t i = 0; i < count; i++) { // the leaves take turns
        hw_cell_eyes(&o->grid, leaves[i], each, leaf_eyes);
        for (uint32_t k = 0; k < each; k++)
            eyes[(size_t)k * count + i] = leaf_eyes[k];
    }
    HW_GO(hw_sights_faces(o->sights, surface, eyes, each * count, seen));
out:
    hw_free(leaves);
    hw_free(leaf_eyes);
    hw_free(eyes);
    return status;
}
