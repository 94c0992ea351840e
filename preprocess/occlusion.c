#include "occlusion.h"
#include "alloc.h"
#include "region.h"
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#define TILE         4u    // rays are cast in tiles of 4 x 4, one packet
#define RAISE        0.436 // rad above the highest object that panoramas reach (25 degrees)
#define LOWER        0.175 // rad below the lowest one (10 degrees)
#define ELEVATION    1.2   // rad: steeper objects count as seen
#define LAYERS       8     // of depth, each twice as deep as the one before, for the erosion
#define LEVELS       7     // window sides 1, 2, ..., 64
#define PEELED       1.5   // occluders nearer than this many deltas are looked through
#define BACKS_MAX    64    // back faces that a ray passes
#define RADIUS_MAX   63    // pixels of erosion to each side
#define SQRT_3       1.7320508075688772
#define BEYOND_LIMIT 1e30f // a depth: nothing hides

struct hw_occlusion {
    const hw_scene *scene;
    const hw_rays *rays;
    hw_occlusion_options options;
    bool *solid;       // per mesh: closed and turned outward
    hw_mat4 *inverses; // per object: world to mesh
};

hw_occlusion_options hw_occlusion_defaults(void)
{
    return (hw_occlusion_options){.rings = 4, .step_degrees = 1.5, .margin = 1};
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
    for (uint32_t i = 0; i < scene->mesh_count; i++)
        HW_GO(mesh_is_solid(&scene->meshes[i], &o->solid[i]));
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

// Depth of what hides along a ray whose first hit is known.
static float depth_of(const hw_occlusion *o, hw_vec3 eye, hw_vec3 direction, hw_hit hit)
{
    for (int i = 0; i < BACKS_MAX && hit.t < INFINITY; i++) {
        if (hides(o, &hit, direction))
            return hit.t;
        hit = hw_rays_cast(o->rays, eye, direction, hit.t * 1.00001f + 1e-5f, INFINITY);
    }
    return BEYOND_LIMIT;
}

// ---- panoramas -------------------------------------------------------------------------------

// The view from one eye: columns of azimuth all round, rows of elevation from the bottom up.
typedef struct panorama {
    const hw_occlusion *occlusion;
    hw_vec3 eye;
    double delta, delta_up; // the eye answers for points this near, horizontally and vertically
    double step, step_up;   // rad
    double bottom;          // elevation of row 0's lower edge
    float t_min;            // nearer surfaces are looked through
    uint32_t columns, rows, rows_max;
    float *cosines, *sines;         // of the columns' middles
    float *row_cosines, *row_sines; // of the rows' middles
    float *raw, *eroded;            // depths; BEYOND_LIMIT where no ray was cast
    float *levels[LEVELS];          // greatest within windows of 2^l x 2^l from a pixel on
    uint8_t *layers;                // of each pixel's depth
    bool *cast, *wanted;            // per tile of columns
} panorama;

static void panorama_free(panorama *p)
{
    hw_free(p->cosines);
    hw_free(p->sines);
    hw_free(p->row_cosines);
    hw_free(p->row_sines);
    hw_free(p->raw);
    hw_free(p->eroded);
    for (int l = 0; l < LEVELS; l++)
        hw_free(p->levels[l]);
    hw_free(p->layers);
    hw_free(p->cast);
    hw_free(p->wanted);
}

static hw_status panorama_allocate(panorama *p)
{
    p->columns = (uint32_t)ceil(2 * HW_PI / p->step / TILE) * TILE;
    p->step = 2 * HW_PI / p->columns;
    p->rows_max = ((uint32_t)ceil((2 * ELEVATION + RAISE + LOWER) / p->step_up) / TILE + 2) * TILE;
    size_t pixels = (size_t)p->columns * p->rows_max;
    HW_TRY(HW_NEW(&p->cosines, p->columns));
    HW_TRY(HW_NEW(&p->sines, p->columns));
    HW_TRY(HW_NEW(&p->row_cosines, p->rows_max));
    HW_TRY(HW_NEW(&p->row_sines, p->rows_max));
    HW_TRY(HW_NEW(&p->raw, pixels));
    HW_TRY(HW_NEW(&p->eroded, pixels));
    for (int l = 0; l < LEVELS; l++)
        HW_TRY(HW_NEW(&p->levels[l], pixels));
    HW_TRY(HW_NEW(&p->layers, pixels));
    HW_TRY(HW_NEW(&p->cast, p->columns / TILE));
    HW_TRY(HW_NEW(&p->wanted, p->columns / TILE));
    for (uint32_t c = 0; c < p->columns; c++) {
        p->cosines[c] = (float)cos((c + 0.5) * p->step);
        p->sines[c] = (float)sin((c + 0.5) * p->step);
    }
    return HW_OK;
}

// Begins the view from an eye, of elevations [low, high] with some more.
static void panorama_start(panorama *p, hw_vec3 eye, double low, double high)
{
    p->eye = eye;
    p->bottom = low - LOWER;
    uint32_t rows = (uint32_t)ceil((high + RAISE - p->bottom) / p->step_up);
    p->rows = (rows / TILE + 1) * TILE;
    assert(p->rows <= p->rows_max);
    for (uint32_t r = 0; r < p->rows; r++) {
        double elevation = fmin(p->bottom + (r + 0.5) * p->step_up, HW_PI / 2);
        p->row_cosines[r] = (float)cos(elevation);
        p->row_sines[r] = (float)sin(elevation);
    }
    for (size_t i = 0; i < (size_t)p->columns * p->rows; i++)
        p->raw[i] = BEYOND_LIMIT;
    memset(p->cast, 0, p->columns / TILE * sizeof *p->cast);
    memset(p->wanted, 0, p->columns / TILE * sizeof *p->wanted);
}

static hw_vec3 pixel_direction(const panorama *p, uint32_t column, uint32_t row)
{
    return hw_v3(p->cosines[column] * p->row_cosines[row], p->sines[column] * p->row_cosines[row],
                 p->row_sines[row]);
}

// Where the ground hides what lies below it.
static float ground_depth(const panorama *p, hw_vec3 direction)
{
    const hw_ground *ground = &p->occlusion->scene->ground;
    const hw_box *rect = &ground->rect;
    if (!ground->present || direction.z >= 0 || p->eye.z <= rect->min.z)
        return BEYOND_LIMIT;
    float t = (rect->min.z - p->eye.z) / direction.z;
    hw_vec3 at = hw_v3_mad(p->eye, direction, t);
    bool on_it =
        at.x >= rect->min.x && at.x <= rect->max.x && at.y >= rect->min.y && at.y <= rect->max.y;
    return on_it ? t : BEYOND_LIMIT;
}

static void cast_tile(panorama *p, uint32_t column, uint32_t row)
{
    hw_vec3 directions[TILE * TILE];
    hw_hit hits[TILE * TILE];
    for (uint32_t i = 0; i < TILE * TILE; i++)
        directions[i] = pixel_direction(p, column + i % TILE, row + i / TILE);
    hw_rays_cast_many(p->occlusion->rays, p->eye, directions, TILE * TILE, p->t_min, hits);
    for (uint32_t i = 0; i < TILE * TILE; i++) {
        float depth = depth_of(p->occlusion, p->eye, directions[i], hits[i]);
        p->raw[(size_t)(row + i / TILE) * p->columns + column + i % TILE] =
            fminf(depth, ground_depth(p, directions[i]));
    }
}

static void cast_wanted(panorama *p)
{
    for (uint32_t tile = 0; tile < p->columns / TILE; tile++) {
        if (!p->wanted[tile] || p->cast[tile])
            continue;
        for (uint32_t row = 0; row < p->rows; row += TILE)
            cast_tile(p, tile * TILE, row);
        p->cast[tile] = true;
    }
}

// Pixels by which what hides at this depth may move, for any point that the eye answers for; one
// more for what lies between two rays.
static int erosion_radius(const panorama *p, uint32_t row, float depth)
{
    if (p->delta <= 0 || depth >= BEYOND_LIMIT)
        return 0;
    double c = p->row_cosines[row], s = fabs((double)p->row_sines[row]);
    double across = p->delta / fmax(depth * c, 1e-6);
    double up = (p->delta_up * c + p->delta * s) / fmax((double)depth, 1e-6);
    double px = fmax(asin(fmin(across, 1)) / p->step, asin(fmin(up, 1)) / p->step_up);
    return (int)fmin(ceil(px) + 1, RADIUS_MAX);
}

// ---- erosion ---------------------------------------------------------------------------------

static uint8_t layer_of(const panorama *p, float depth)
{
    if (depth >= BEYOND_LIMIT)
        return LAYERS;
    float nearest = fmaxf(p->t_min, 1e-3f);
    int layer = depth > nearest ? (int)log2f(depth / nearest) : 0;
    return (uint8_t)(layer < LAYERS ? layer : LAYERS - 1);
}

// levels[l] from levels[l - 1]; columns wrap, above the top nothing hides, below the bottom the
// ground does, if there is one.
static void make_level(panorama *p, int l)
{
    const float *in = p->levels[l - 1];
    float *out = p->levels[l];
    uint32_t shift = 1u << (l - 1), n = p->columns;
    for (uint32_t r = 0; r < p->rows; r++) {
        const float *a = in + (size_t)r * n;
        float *o = out + (size_t)r * n;
        if (r + shift >= p->rows) {
            for (uint32_t c = 0; c < n; c++)
                o[c] = BEYOND_LIMIT;
            continue;
        }
        const float *b = a + (size_t)shift * n;
        for (uint32_t c = 0; c < n - shift; c++) {
            float x = a[c] > b[c] ? a[c] : b[c];
            float y = a[c + shift] > b[c + shift] ? a[c + shift] : b[c + shift];
            o[c] = x > y ? x : y;
        }
        for (uint32_t c = n - shift; c < n; c++)
            o[c] = fmaxf(fmaxf(a[c], b[c]), fmaxf(a[c + shift - n], b[c + shift - n]));
    }
}

// The greatest of the levels within `radius` pixels.
static float window_max(const panorama *p, uint32_t column, uint32_t row, int radius)
{
    int l = 0, side = 2 * radius + 1, n = (int)p->columns;
    while (2 << l <= side)
        l++;
    int left = ((int)column - radius + n) % n, low = (int)row - radius;
    int right = (left + side - (1 << l)) % n;
    int high = low + side - (1 << l);
    if (low < 0 && !p->occlusion->scene->ground.present)
        return BEYOND_LIMIT;
    low = low < 0 ? 0 : low;
    high = high < 0 ? 0 : high;
    const float *level = p->levels[l];
    const float *below = level + (size_t)low * p->columns;
    const float *above = level + (size_t)high * p->columns;
    return fmaxf(fmaxf(below[left], below[right]), fmaxf(above[left], above[right]));
}

// One layer: its pixels take the greatest depth in their windows, where deeper layers, done
// before, count as eroded.
static void erode_layer(panorama *p, int layer, int most)
{
    size_t pixels = (size_t)p->columns * p->rows;
    for (size_t i = 0; i < pixels; i++)
        p->levels[0][i] = p->layers[i] > layer ? p->eroded[i] : p->raw[i];
    for (int l = 1; l < LEVELS && 1 << l <= 2 * most + 1; l++)
        make_level(p, l);
    for (uint32_t row = 0; row < p->rows; row++)
        for (uint32_t column = 0; column < p->columns; column++) {
            size_t i = (size_t)row * p->columns + column;
            if (p->layers[i] == layer)
                p->eroded[i] = window_max(p, column, row, erosion_radius(p, row, p->raw[i]));
        }
}

static void erode(panorama *p)
{
    int most[LAYERS + 1] = {0};
    bool used[LAYERS + 1] = {false};
    for (uint32_t row = 0; row < p->rows; row++)
        for (uint32_t column = 0; column < p->columns; column++) {
            size_t i = (size_t)row * p->columns + column;
            uint8_t layer = p->layers[i] = layer_of(p, p->raw[i]);
            p->eroded[i] = p->raw[i];
            if (layer == LAYERS)
                continue;
            int radius = erosion_radius(p, row, p->raw[i]);
            most[layer] = radius > most[layer] ? radius : most[layer];
            used[layer] = true;
        }
    for (int layer = LAYERS - 1; p->delta > 0 && layer >= 0; layer--)
        if (used[layer])
            erode_layer(p, layer, most[layer]);
}

// ---- objects ---------------------------------------------------------------------------------

// A box seen from an eye.
typedef struct outlook {
    bool around;      // the eye is in it, or so close that it may be looked through
    double low, high; // elevations
    double azimuth, width;
    double farthest;
} outlook;

static outlook look_at(const panorama *p, hw_box box)
{
    outlook v = {.low = INFINITY, .high = -INFINITY};
    hw_vec3 e = p->eye;
    double gap_x = fmax(fmax(box.min.x - e.x, e.x - box.max.x), 0);
    double gap_y = fmax(fmax(box.min.y - e.y, e.y - box.max.y), 0);
    double gap_z = fmax(fmax(box.min.z - e.z, e.z - box.max.z), 0);
    double nearest = hypot(gap_x, gap_y), farthest = 0, first = 0, least = 0, most = 0;
    v.around = hypot(nearest, gap_z) <= p->t_min || nearest <= 0;
    for (uint32_t i = 0; i < 4; i++) {
        hw_vec3 corner = hw_box_corner(box, i);
        double x = (double)corner.x - e.x, y = (double)corner.y - e.y;
        double azimuth = atan2(y, x);
        farthest = fmax(farthest, hypot(x, y));
        if (i == 0)
            first = azimuth;
        double turn = remainder(azimuth - first, 2 * HW_PI);
        least = fmin(least, turn);
        most = fmax(most, turn);
    }
    double bottom = (double)box.min.z - e.z, top = (double)box.max.z - e.z;
    v.low = atan2(bottom, bottom < 0 ? nearest : farthest);
    v.high = atan2(top, top > 0 ? nearest : farthest);
    v.azimuth = first + least;
    v.width = most - least;
    v.farthest = hypot(farthest, fmax(fabs(bottom), fabs(top)));
    return v;
}

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

static void column_range(const panorama *p, const outlook *v, int *first, int *last)
{
    *first = (int)floor(v->azimuth / p->step);
    *last = (int)floor((v->azimuth + v->width) / p->step);
}

static uint32_t wrap(const panorama *p, int column)
{
    int n = (int)p->columns;
    return (uint32_t)((column % n + n) % n);
}

static void want_columns(panorama *p, int first, int last)
{
    if (last - first + 1 >= (int)p->columns) {
        first = 0;
        last = (int)p->columns - 1;
    }
    for (int c = first; c <= last; c++)
        p->wanted[wrap(p, c) / TILE] = true;
}

static void row_range(const panorama *p, const outlook *v, uint32_t *first, uint32_t *last)
{
    double most = p->rows - 1;
    *first = (uint32_t)fmin(fmax(floor((v->low - p->bottom) / p->step_up), 0), most);
    *last = (uint32_t)fmin(fmax(floor((v->high - p->bottom) / p->step_up), 0), most);
}

// Whether the eye, or a point that it answers for, may see something in the box.
static bool may_see(const panorama *p, const outlook *v, hw_box box)
{
    int first, last;
    uint32_t low, high;
    column_range(p, v, &first, &last);
    row_range(p, v, &low, &high);
    float grow = (float)(v->farthest * p->step); // what the ray through a pixel's middle leaves out
    hw_box grown = {hw_v3_sub(box.min, hw_v3(grow, grow, grow)),
                    hw_v3_add(box.max, hw_v3(grow, grow, grow))};
    for (int c = first; c <= last; c++)
        for (uint32_t r = low; r <= high; r++) {
            uint32_t column = wrap(p, c);
            float depth = p->eroded[(size_t)r * p->columns + column];
            if (depth >= BEYOND_LIMIT ||
                depth >= 0.9999f * entry(p->eye, pixel_direction(p, column, r), grown))
                return true;
        }
    return false;
}

// ---- a cell ----------------------------------------------------------------------------------

typedef struct search {
    const hw_occlusion *occlusion;
    panorama view;
    bool *seen;
    uint32_t *open; // objects not seen yet
    uint32_t open_count;
    outlook *outlooks; // of the open ones
} search;

// Takes an eye's view of what is open: elevations, then rays where they tell something. False if
// nothing is left to look at.
static bool prepare_view(search *s, hw_vec3 eye)
{
    panorama *p = &s->view;
    double low = INFINITY, high = -INFINITY;
    uint32_t n = 0;
    p->eye = eye;
    for (uint32_t i = 0; i < s->open_count; i++) {
        uint32_t object_idx = s->open[i];
        outlook v = look_at(p, s->occlusion->scene->objects[object_idx].bounds);
        if (v.around || v.low < -ELEVATION || v.high > ELEVATION) {
            s->seen[object_idx] = true;
            continue;
        }
        low = fmin(low, v.low);
        high = fmax(high, v.high);
        s->outlooks[n] = v;
        s->open[n++] = object_idx;
    }
    s->open_count = n;
    if (n > 0)
        panorama_start(p, eye, low, high);
    return n > 0;
}

// First the columns that open objects cover, then as far as erosion can reach from there, twice:
// a window may look into another one behind it.
static void cast_view(search *s)
{
    panorama *p = &s->view;
    int first, last;
    for (uint32_t i = 0; i < s->open_count; i++) {
        column_range(p, &s->outlooks[i], &first, &last);
        want_columns(p, first, last);
    }
    cast_wanted(p);
    for (uint32_t i = 0; p->delta > 0 && i < s->open_count; i++) {
        uint32_t low, high;
        int radius = 0;
        column_range(p, &s->outlooks[i], &first, &last);
        row_range(p, &s->outlooks[i], &low, &high);
        for (int c = first; c <= last; c++)
            for (uint32_t r = low; r <= high; r++) {
                float depth = p->raw[(size_t)r * p->columns + wrap(p, c)];
                int pixel_radius = erosion_radius(p, r, depth);
                radius = pixel_radius > radius ? pixel_radius : radius;
            }
        want_columns(p, first - 2 * radius, last + 2 * radius);
    }
    cast_wanted(p);
}

static void look_from(search *s, hw_vec3 eye)
{
    if (!prepare_view(s, eye))
        return;
    cast_view(s);
    erode(&s->view);
    uint32_t n = 0;
    for (uint32_t i = 0; i < s->open_count; i++) {
        uint32_t object_idx = s->open[i];
        hw_box bounds = s->occlusion->scene->objects[object_idx].bounds;
        if (may_see(&s->view, &s->outlooks[i], bounds))
            s->seen[object_idx] = true;
        else
            s->open[n++] = object_idx;
    }
    s->open_count = n;
}

// Eyes of the lattice, outermost rings first: they see most. Shrunk by r / (r + 1/3), so that the
// discs round the outermost ones just cover the hexagon's border.
static void look_around(search *s, const hw_hexgrid *grid, hw_cell_id id, uint32_t slabs)
{
    int rings = (int)s->occlusion->options.rings;
    hw_vec3 centre = hw_cell_centre(grid, id), corners[HW_CELL_CORNERS];
    hw_cell_corners(grid, id, corners);
    double height = (grid->z_max - grid->z_min) / slabs;
    double unit = 1 / (rings + 1.0 / 3);
    hw_vec3 x = hw_v3_scale(hw_v3_sub(corners[0], centre), (float)unit);
    hw_vec3 y = hw_v3_scale(hw_v3_sub(corners[1], centre), (float)unit);
    for (int ring = rings; ring >= 0; ring--)
        for (int a = -ring; a <= ring; a++)
            for (int b = -ring; b <= ring; b++) {
                int distance = abs(a + b) > abs(a) ? abs(a + b) : abs(a);
                distance = abs(b) > distance ? abs(b) : distance;
                for (uint32_t slab = 0; distance == ring && slab < slabs; slab++) {
                    hw_vec3 eye = hw_v3_mad(hw_v3_mad(centre, x, (float)a), y, (float)b);
                    eye.z = (float)(grid->z_min + (slab + 0.5) * height);
                    look_from(s, eye);
                }
            }
}

// How far an eye of the lattice answers, horizontally: the radius that covers the plane with discs.
static double covering_radius(const hw_hexgrid *grid, uint32_t rings)
{
    return rings == 0 ? grid->cell_size : grid->cell_size / (rings + 1.0 / 3) / SQRT_3;
}

hw_status hw_occlusion_query(const hw_occlusion *o, const hw_hexgrid *grid, hw_cell_id id,
                             bool *seen)
{
    hw_status status = HW_OK;
    const hw_scene *scene = o->scene;
    search s = {.occlusion = o, .seen = seen};
    double delta = covering_radius(grid, o->options.rings), half = (grid->z_max - grid->z_min) / 2;
    uint32_t slabs = (uint32_t)fmax(ceil(half / delta), 1);
    double delta_up = half / slabs;
    s.view = (panorama){.occlusion = o,
                        .delta = delta * o->options.margin,
                        .delta_up = delta_up * o->options.margin,
                        .step = o->options.step_degrees * HW_PI / 180,
                        .t_min = (float)(PEELED * delta * o->options.margin)};
    // Windows are square in pixels, moves are not.
    s.view.step_up = s.view.step * fmin(fmax(delta_up / delta, 0.4), 1);
    HW_GO(panorama_allocate(&s.view));
    HW_GO(HW_NEW(&s.open, scene->object_count));
    HW_GO(HW_NEW(&s.outlooks, scene->object_count));
    for (uint32_t i = 0; i < scene->object_count; i++) {
        seen[i] = hw_cell_meets_box(grid, id, scene->objects[i].bounds);
        if (!seen[i])
            s.open[s.open_count++] = i;
    }
    look_around(&s, grid, id, slabs);
out:
    panorama_free(&s.view);
    hw_free(s.open);
    hw_free(s.outlooks);
    return status;
}
