#include "occlusion.h"
#include "alloc.h"
#include "hash.h"
#include "region.h"
#include <stdlib.h>

#define BACKS_MAX 64  // back faces that a ray passes
#define BLOCK     16u // rays between two looks at the time: hits are likely early
#define SIDES     0.6 // share of the eyes on the cell's side faces; of the rest,
#define TOP       0.9 // this share on its top, the others on its bottom
#define EDGES     0.3 // share of a side's eyes on its upper edge; half as many on the lower

#define WIDE       3.0 // margins round an object within which a ray is close
#define WIDE_SHARE 8u  // one ray in so many decides whether any comes close

struct hw_occlusion {
    const hw_scene *scene;
    const hw_rays *rays;
    hw_occlusion_options options;
    bool *solid; // per mesh: closed and turned outward
    bool all_solid;
    hw_mat4 *inverses; // per object: world to mesh
};

hw_occlusion_options hw_occlusion_defaults(void)
{
    return (hw_occlusion_options){.rays = 4096, .margin = 0.1};
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

hw_status hw_occlusion_create(hw_occlusion **out, const hw_scene *scene, const hw_rays *rays,
                              const hw_occlusion_options *options)
{
    hw_status status = HW_OK;
    hw_occlusion *o = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&o, 1));
    o->scene = scene;
    o->rays = rays;
    o->options = *options;
    HW_GO(HW_NEW(&o->solid, scene->mesh_count));
    HW_GO(HW_NEW(&o->inverses, scene->object_count));
    o->all_solid = true;
    for (uint32_t i = 0; i < scene->mesh_count; i++) {
        HW_GO(mesh_is_solid(&scene->meshes[i], &o->solid[i]));
        o->all_solid &= o->solid[i];
    }
    for (uint32_t i = 0; i < scene->object_count; i++)
        hw_mat4_inverse(scene->objects[i].transform, &o->inverses[i]);
    *out = o;
    o = NULL;
out:
    hw_occlusion_destroy(o);
    return status;
}

void hw_occlusion_destroy(hw_occlusion *occlusion)
{
    if (!occlusion)
        return;
    hw_free(occlusion->solid);
    hw_free(occlusion->inverses);
    hw_free(occlusion);
}

// Whether the front of the triangle is what a ray of this direction met.
static bool meets_front(const hw_occlusion *o, const hw_hit *hit, hw_vec3 direction)
{
    const hw_mesh *mesh = &o->scene->meshes[o->scene->objects[hit->object_idx].mesh_idx];
    const uint32_t *t = mesh->indices + 3 * (size_t)hit->triangle_idx;
    hw_vec3 a = mesh->positions[t[0]];
    hw_vec3 n =
        hw_v3_cross(hw_v3_sub(mesh->positions[t[1]], a), hw_v3_sub(mesh->positions[t[2]], a));
    return hw_v3_dot(n, hw_mat4_direction(&o->inverses[hit->object_idx], direction)) < 0;
}

static bool hides(const hw_occlusion *o, const hw_hit *hit, hw_vec3 direction)
{
    return o->solid[o->scene->objects[hit->object_idx].mesh_idx] || meets_front(o, hit, direction);
}

// Whether something hides the end of a ray from its beginning.
static bool is_hidden(const hw_occlusion *o, hw_vec3 eye, hw_vec3 direction, float t_max)
{
    if (o->all_solid)
        return hw_rays_occluded(o->rays, eye, direction, 0, t_max);
    hw_hit hit = hw_rays_cast(o->rays, eye, direction, 0, t_max);
    for (int i = 0; i < BACKS_MAX && hit.t < INFINITY; i++) {
        if (hides(o, &hit, direction))
            return true;
        hit = hw_rays_cast(o->rays, eye, direction, hit.t * 1.00001f + 1e-5f, t_max);
    }
    return false;
}

// ---- eyes ------------------------------------------------------------------------------------

// Element i of the additive recurrence in dimension k (Roberts, The Unreasonable Effectiveness of
// Quasirandom Sequences, 2018; steps are powers of the root of x^7 = x + 1): evenly spread however
// many are taken.
static double spread(uint32_t i, int k, double shift)
{
    static const double steps[6] = {0.8992, 0.8085, 0.7270, 0.6537, 0.5878, 0.5286};
    static const double fine[6] = {0.0000177, 0.0000613, 0.0000259,
                                   0.0000417, 0.0000071, 0.0000337};
    double v = shift + (i + 1.0) * (steps[k] + fine[k]);
    return v - floor(v);
}

// Whatever can be seen from a cell can be seen from its surface: where the line of sight leaves it.
// More eyes are where most is seen from: high up, on the rim.
static hw_vec3 eye_at(const hw_vec3 corners[HW_CELL_CORNERS], hw_vec3 centre, uint32_t i)
{
    double u = spread(i, 0, 0), v = spread(i, 1, 0), w = spread(i, 2, 0) * 6;
    int side = (int)fmin(w, 5);
    double along = w - side;
    hw_vec3 a = corners[side], b = corners[(side + 1) % 6];
    hw_vec3 eye = hw_v3_mad(a, hw_v3_sub(b, a), (float)along);
    double low = corners[0].z, high = corners[6].z;
    if (u < SIDES) {
        double t = (v - EDGES) / (1 - 2 * EDGES);
        eye.z = (float)(low + (high - low) * fmin(fmax(t, 0), 1));
        return eye;
    }
    // sqrt: as many eyes on equal areas of the triangle (centre, a, b).
    eye = hw_v3_mad(centre, hw_v3_sub(eye, centre), (float)sqrt(v));
    eye.z = (float)((u - SIDES) / (1 - SIDES) < TOP ? high : low);
    return eye;
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

static double blend(double low, double high, double t)
{
    return low + (high - low) * t;
}

typedef struct target {
    uint32_t object_idx;
    bool near;       // a ray came close
    hw_box box;      // of the object
    hw_box grown[2]; // by the margin, by WIDE margins
    float band[2];   // how far from the outline of those "along" it is
    double shift[3]; // its points are others than those of other objects
} target;

static hw_box grow_box(hw_box box, double by)
{
    hw_vec3 grow = hw_v3((float)by, (float)by, (float)by / 2);
    return (hw_box){hw_v3_sub(box.min, grow), hw_v3_add(box.max, grow)};
}

static target target_make(const hw_occlusion *o, uint32_t object_idx, double margin)
{
    target t = {.object_idx = object_idx, .box = o->scene->objects[object_idx].bounds};
    const hw_ground *ground = &o->scene->ground;
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

// Point i of a target. Objects come into view at the rim: above what hides them, or beside it. So
// half of the points lie along the top and a quarter at the sides that make the outline.
static hw_vec3 point_at(const target *t, bool wide, hw_vec3 eye, uint32_t i)
{
    double x = spread(i, 3, t->shift[0]), y = spread(i, 4, t->shift[1]);
    double z = spread(i, 5, t->shift[2]);
    hw_box box = t->grown[wide];
    float band = t->band[wide];
    uint32_t kind = i / 2 % 4;
    if (kind < 2) {
        box.min.z = fmaxf(box.min.z, box.max.z - band);
    } else if (kind == 2) {
        // Of the two corners of the outline, which lie on one diagonal or the other, one in turn.
        hw_vec3 towards = hw_v3_sub(hw_box_centre(box), eye);
        bool rising = (double)towards.x * towards.y < 0;
        bool right = i / 8 % 2;
        bool upper = right == rising;
        *(right ? &box.min.x : &box.max.x) =
            right ? fmaxf(box.min.x, box.max.x - band) : fminf(box.max.x, box.min.x + band);
        *(upper ? &box.min.y : &box.max.y) =
            upper ? fmaxf(box.min.y, box.max.y - band) : fminf(box.max.y, box.min.y + band);
    }
    return hw_v3((float)blend(box.min.x, box.max.x, x), (float)blend(box.min.y, box.max.y, y),
                 (float)blend(box.min.z, box.max.z, z));
}

// The objects of a cell that no ray has reached yet.
typedef struct search {
    const hw_occlusion *occlusion;
    target *open;
    uint32_t open_count;
    bool *seen; // per object of the scene
} search;

static hw_status search_make(search *s, const hw_hexgrid *grid, hw_cell_id id)
{
    const hw_occlusion *o = s->occlusion;
    const hw_scene *scene = o->scene;
    HW_TRY(HW_NEW(&s->open, scene->object_count));
    for (uint32_t i = 0; i < scene->object_count; i++) {
        s->seen[i] = hw_cell_meets_box(grid, id, scene->objects[i].bounds);
        if (!s->seen[i])
            s->open[s->open_count++] = target_make(o, i, o->options.margin * grid->cell_size);
    }
    return HW_OK;
}

// Ray i to a target: true if it arrives at the box, or passes it by no more than the margin.
// Otherwise notes if it has come close.
static bool ray_arrives(const hw_occlusion *o, target *t, bool wide, hw_vec3 eye, uint32_t i)
{
    hw_vec3 direction = hw_v3_sub(point_at(t, wide, eye, i), eye);
    bool meets_grown = entry(eye, direction, t->grown[0]) < INFINITY;
    if (!meets_grown && t->near)
        return false; // it would tell nothing new
    float end = entry(eye, direction, t->box);
    if (is_hidden(o, eye, direction, end < INFINITY ? end * 0.9999f : 1))
        return false;
    t->near = true;
    return meets_grown;
}

// One ray from an eye to every open object.
static void look_from(search *s, bool wide, hw_vec3 eye, uint32_t i)
{
    uint32_t left = 0;
    for (uint32_t k = 0; k < s->open_count; k++) {
        target *t = &s->open[k];
        if (ray_arrives(s->occlusion, t, wide, eye, i))
            s->seen[t->object_idx] = true;
        else
            s->open[left++] = *t;
    }
    s->open_count = left;
}

// What no ray came close to is given up.
static void keep_near(search *s)
{
    uint32_t left = 0;
    for (uint32_t k = 0; k < s->open_count; k++)
        if (s->open[k].near)
            s->open[left++] = s->open[k];
    s->open_count = left;
}

hw_status hw_occlusion_query(const hw_occlusion *o, const hw_hexgrid *grid, hw_cell_id id,
                             bool *seen)
{
    hw_status status = HW_OK;
    search s = {.occlusion = o, .seen = seen};
    hw_vec3 corners[HW_CELL_CORNERS], centre = hw_cell_centre(grid, id);
    uint32_t wide_count = (o->options.rays + WIDE_SHARE - 1) / WIDE_SHARE;
    hw_cell_corners(grid, id, corners);
    HW_GO(search_make(&s, grid, id));
    for (uint32_t i = 0; i < o->options.rays && s.open_count > 0; i++) {
        if (i == wide_count)
            keep_near(&s);
        hw_vec3 eye =
            i < HW_CELL_CORNERS ? corners[HW_CELL_CORNERS - 1 - i] : eye_at(corners, centre, i);
        look_from(&s, i < wide_count, eye, i);
    }
out:
    hw_free(s.open);
    return status;
}
