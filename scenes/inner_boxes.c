#include "inner_boxes.h"
#include "alloc.h"
#include <float.h>
#include <stdlib.h>
#include <string.h>

#define SIDE      64u       // voxels along the longest axis
#define SEEDS     31u       // one voxel in so many is where a box may begin to grow
#define LEAP      4u        // layers that a box grows by at first
#define SHARE_MIN 1 / 2000. // of all voxels that a further box must add
#define SPLITS    14        // of a triangle, at most, until it is as small as a voxel

#define LAYERS 2u

enum { OUTSIDE = 1, SURFACE = 2, TAKEN = 4 };

// ---- solids ----------------------------------------------------------------------------------

static int by_edge(const void *x, const void *y)
{
    const uint64_t a = *(const uint64_t *)x >> 1, b = *(const uint64_t *)y >> 1;
    return (a > b) - (a < b);
}

// Whether every edge is used as often in one direction as in the other, and the volume is positive.
hw_status hw_mesh_is_solid(const hw_mesh *mesh, bool *out)
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

// ---- voxels ----------------------------------------------------------------------------------

typedef struct voxels {
    uint32_t n[3]; // with LAYERS round the mesh, the outermost of which stay empty
    float size;
    hw_vec3 origin;
    uint8_t *marks;
    uint32_t *sums; // per corner of the lattice: voxels below it that no box may hold
} voxels;

// A box of voxels, from low up to below high.
typedef struct range {
    uint32_t low[3], high[3];
} range;

static size_t at(const voxels *v, uint32_t x, uint32_t y, uint32_t z)
{
    return ((size_t)z * v->n[1] + y) * v->n[0] + x;
}

static void free_voxels(voxels *v)
{
    hw_free(v->marks);
    hw_free(v->sums);
}

static hw_status make_voxels(const hw_mesh *mesh, voxels *v)
{
    hw_box box = hw_mesh_bounds(mesh);
    hw_vec3 size = hw_box_size(box);
    const float sides[3] = {size.x, size.y, size.z};
    v->size = fmaxf(size.x, fmaxf(size.y, size.z)) / SIDE;
    if (!(v->size > 0))
        v->size = 1;
    for (int k = 0; k < 3; k++)
        v->n[k] = (uint32_t)fminf(ceilf(sides[k] / v->size), SIDE) + 1 + 2 * LAYERS;
    float margin = LAYERS * v->size;
    v->origin = hw_v3_sub(box.min, hw_v3(margin, margin, margin));
    HW_TRY(HW_NEW(&v->marks, (size_t)v->n[0] * v->n[1] * v->n[2]));
    return HW_NEW(&v->sums, (size_t)(v->n[0] + 1) * (v->n[1] + 1) * (v->n[2] + 1));
}

// ---- marking ---------------------------------------------------------------------------------

// The voxels that a box touches, in whole numbers.
static range range_of(const voxels *v, hw_box box)
{
    hw_vec3 low = hw_v3_scale(hw_v3_sub(box.min, v->origin), 1 / v->size);
    hw_vec3 high = hw_v3_scale(hw_v3_sub(box.max, v->origin), 1 / v->size);
    const float a[3] = {low.x, low.y, low.z}, b[3] = {high.x, high.y, high.z};
    const float slack = 1e-3f; // more than the rounding of coordinates
    range r;
    for (int k = 0; k < 3; k++) {
        // The library's fminf and fmaxf are calls.
        float from = a[k] - slack, to = b[k] + slack, last = (float)v->n[k] - 1;
        r.low[k] = from > 0 ? (uint32_t)from : 0;
        r.high[k] = (uint32_t)(to < last ? to : last) + 1;
    }
    return r;
}

static void mark_triangle(voxels *v, hw_vec3 a, hw_vec3 b, hw_vec3 c, int splits)
{
    hw_box box = hw_box_empty();
    hw_box_add(&box, a);
    hw_box_add(&box, b);
    hw_box_add(&box, c);
    range r = range_of(v, box);
    uint32_t wide = 0;
    for (int k = 0; k < 3; k++)
        wide += r.high[k] - r.low[k] > 1;
    if (wide > 1 && splits > 0) { // in halves, across the longest edge
        float ab = hw_v3_length(hw_v3_sub(a, b)), bc = hw_v3_length(hw_v3_sub(b, c)),
              ca = hw_v3_length(hw_v3_sub(c, a));
        if (fmaxf(ab, fmaxf(bc, ca)) > v->size) {
            if (bc >= ab && bc >= ca) {
                hw_vec3 swap = a;
                a = b;
                b = c;
                c = swap;
            } else if (ca >= ab) {
                hw_vec3 swap = a;
                a = c;
                c = b;
                b = swap;
            }
            hw_vec3 middle = hw_v3_scale(hw_v3_add(a, b), 0.5f);
            mark_triangle(v, a, middle, c, splits - 1);
            mark_triangle(v, middle, b, c, splits - 1);
            return;
        }
    }
    for (uint32_t z = r.low[2]; z < r.high[2]; z++)
        for (uint32_t y = r.low[1]; y < r.high[1]; y++)
            memset(v->marks + at(v, r.low[0], y, z), SURFACE, r.high[0] - r.low[0]);
}

static void mark_surface(voxels *v, const hw_mesh *mesh)
{
    for (uint32_t i = 0; i < mesh->index_count; i += 3) {
        const uint32_t *t = mesh->indices + i;
        mark_triangle(v, mesh->positions[t[0]], mesh->positions[t[1]], mesh->positions[t[2]],
                      SPLITS);
    }
}

// What can be reached from the empty layers all round.
static hw_status mark_outside(voxels *v)
{
    size_t count = (size_t)v->n[0] * v->n[1] * v->n[2], n = 0;
    uint32_t *stack = NULL;
    HW_TRY(HW_NEW(&stack, count));
    v->marks[0] = OUTSIDE;
    stack[n++] = 0;
    while (n > 0) {
        uint32_t i = stack[--n];
        const uint32_t place[3] = {i % v->n[0], i / v->n[0] % v->n[1], i / v->n[0] / v->n[1]};
        const uint32_t step[3] = {1, v->n[0], v->n[0] * v->n[1]};
        for (int k = 0; k < 3; k++) {
            if (place[k] > 0 && v->marks[i - step[k]] == 0) {
                v->marks[i - step[k]] = OUTSIDE;
                stack[n++] = i - step[k];
            }
            if (place[k] + 1 < v->n[k] && v->marks[i + step[k]] == 0) {
                v->marks[i + step[k]] = OUTSIDE;
                stack[n++] = i + step[k];
            }
        }
    }
    hw_free(stack);
    return HW_OK;
}

// ---- boxes -----------------------------------------------------------------------------------

static size_t corner(const voxels *v, uint32_t x, uint32_t y, uint32_t z)
{
    return ((size_t)z * (v->n[1] + 1) + y) * (v->n[0] + 1) + x;
}

// Of the voxels that no box may hold.
static void sum_up(voxels *v)
{
    for (uint32_t z = 0; z < v->n[2]; z++)
        for (uint32_t y = 0; y < v->n[1]; y++) {
            uint32_t row = 0;
            for (uint32_t x = 0; x < v->n[0]; x++) {
                uint8_t mark = v->marks[at(v, x, y, z)];
                row += mark != 0;
                v->sums[corner(v, x + 1, y + 1, z + 1)] =
                    row + v->sums[corner(v, x + 1, y, z + 1)] +
                    v->sums[corner(v, x + 1, y + 1, z)] - v->sums[corner(v, x + 1, y, z)];
            }
        }
}

static uint32_t sum_in(const voxels *v, const range *r)
{
    uint32_t sum = 0;
    for (uint32_t i = 0; i < 8; i++) {
        uint32_t s =
            v->sums[corner(v, i & 1 ? r->high[0] : r->low[0], i & 2 ? r->high[1] : r->low[1],
                           i & 4 ? r->high[2] : r->low[2])];
        bool minus = ((i & 1) + (i >> 1 & 1) + (i >> 2 & 1)) % 2 == 0;
        sum += minus ? 0 - s : s; // modulo 2^32
    }
    return sum;
}

// The box with `layers` more on a side, if there is room for them within the voxels.
static bool extend(const voxels *v, int side, uint32_t layers, range *r)
{
    int k = side / 2;
    if (side % 2 ? r->low[k] < layers : r->high[k] + layers > v->n[k])
        return false;
    if (side % 2)
        r->low[k] -= layers;
    else
        r->high[k] += layers;
    return true;
}

// Grows a box on each side in turn, by fewer and fewer layers, for as long as it stays inside the
// mesh.
static range grow(const voxels *v, range r)
{
    for (uint32_t layers = LEAP; layers > 0; layers /= 2) {
        bool grown = true;
        while (grown) {
            grown = false;
            for (int side = 0; side < 6; side++) {
                range next = r;
                if (!extend(v, side, layers, &next) || sum_in(v, &next) != 0)
                    continue;
                r = next;
                grown = true;
            }
        }
    }
    return r;
}

static uint32_t volume(const range *r)
{
    return (r->high[0] - r->low[0]) * (r->high[1] - r->low[1]) * (r->high[2] - r->low[2]);
}

static bool holds(const range *r, uint32_t x, uint32_t y, uint32_t z)
{
    return x >= r->low[0] && x < r->high[0] && y >= r->low[1] && y < r->high[1] && z >= r->low[2] &&
           z < r->high[2];
}

// Seeds inside the largest box so far would mostly grow to much the same one.
static range largest_from_seeds(const voxels *v)
{
    range best = {{0}, {0}};
    for (uint32_t z = 0; z < v->n[2]; z++)
        for (uint32_t y = 0; y < v->n[1]; y++)
            for (uint32_t x = 0; x < v->n[0]; x++) {
                // On a lattice that every layer of voxels has its share of.
                if (v->marks[at(v, x, y, z)] != 0 || (x + 5 * y + 11 * z) % SEEDS != 0 ||
                    holds(&best, x, y, z))
                    continue;
                range r = grow(v, (range){{x, y, z}, {x + 1, y + 1, z + 1}});
                if (volume(&r) > volume(&best))
                    best = r;
            }
    return best;
}

static void take(voxels *v, const range *r)
{
    for (uint32_t z = r->low[2]; z < r->high[2]; z++)
        for (uint32_t y = r->low[1]; y < r->high[1]; y++)
            memset(v->marks + at(v, r->low[0], y, z), TAKEN, r->high[0] - r->low[0]);
}

static hw_box box_of(const voxels *v, const range *r)
{
    hw_vec3 low = hw_v3((float)r->low[0], (float)r->low[1], (float)r->low[2]);
    hw_vec3 high = hw_v3((float)r->high[0], (float)r->high[1], (float)r->high[2]);
    return (hw_box){hw_v3_mad(v->origin, low, v->size), hw_v3_mad(v->origin, high, v->size)};
}

// Whether coordinates are much finer than voxels: else a box may come to lie where it is not.
static bool is_fine(const voxels *v)
{
    hw_vec3 o = v->origin;
    float reach = fmaxf(fabsf(o.x), fmaxf(fabsf(o.y), fabsf(o.z))) + SIDE * v->size;
    return v->size > 64 * FLT_EPSILON * reach;
}

hw_status hw_inner_boxes_find(const hw_mesh *mesh, hw_inner_boxes *out)
{
    hw_status status = HW_OK;
    voxels v = {0};
    out->count = 0;
    HW_GO(make_voxels(mesh, &v));
    if (!is_fine(&v))
        goto out;
    mark_surface(&v, mesh);
    HW_GO(mark_outside(&v));
    double least = SHARE_MIN * v.n[0] * v.n[1] * v.n[2];
    while (out->count < HW_INNER_BOXES_MAX) {
        sum_up(&v);
        range r = largest_from_seeds(&v);
        if (volume(&r) < least)
            break;
        take(&v, &r);
        out->boxes[out->count++] = box_of(&v, &r);
    }
out:
    if (status != HW_OK)
        out->count = 0;
    free_voxels(&v);
    return status;
}

// ---- fitting ---------------------------------------------------------------------------------

// A coordinate of a point by its number, and back.
static float part(hw_vec3 p, int axis)
{
    return axis == 0 ? p.x : axis == 1 ? p.y : p.z;
}

static float *part_of(hw_vec3 *p, int axis)
{
    return axis == 0 ? &p->x : axis == 1 ? &p->y : &p->z;
}

#define POLYGON_MAX 7u // corners of a triangle that four planes have cut

// What of a polygon lies on the side of a plane across an axis where sign * (p - at) <= 0.
static uint32_t cut(const hw_vec3 *in, uint32_t count, int axis, float at, float sign, hw_vec3 *out)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; i++) {
        hw_vec3 a = in[i], b = in[(i + 1) % count];
        float da = sign * (part(a, axis) - at), db = sign * (part(b, axis) - at);
        if (da <= 0)
            out[n++] = a;
        if ((da < 0 && db > 0) || (da > 0 && db < 0))
            out[n++] = hw_v3_mad(a, hw_v3_sub(b, a), da / (da - db));
    }
    return n;
}

// How far, up to `reach`, a side of the box may move out until it meets the triangle.
static float reach_to(const hw_box *box, int axis, bool upper, const hw_vec3 t[3], float reach)
{
    hw_vec3 polygon[2][POLYGON_MAX + 1];
    uint32_t count = 3, which = 0;
    float side = part(upper ? box->max : box->min, axis), sign = upper ? 1 : -1;
    float first = INFINITY, last = -INFINITY;
    for (int k = 0; k < 3; k++) {
        float out = sign * (part(t[k], axis) - side);
        first = out < first ? out : first;
        last = out > last ? out : last;
        polygon[0][k] = t[k];
    }
    if (last < 0 || first >= reach)
        return reach;
    for (int k = 1; k < 3 && count > 0; k++) {
        int across = (axis + k) % 3;
        for (int high = 0; high < 2 && count > 0; high++) {
            float at = part(high ? box->max : box->min, across);
            count = cut(polygon[which], count, across, at, high ? 1 : -1, polygon[!which]);
            which = !which;
        }
    }
    first = INFINITY;
    last = -INFINITY;
    for (uint32_t i = 0; i < count; i++) {
        float out = sign * (part(polygon[which][i], axis) - side);
        first = fminf(first, out);
        last = fmaxf(last, out);
    }
    return last < 0 ? reach : fminf(reach, fmaxf(first, 0));
}

static void fit_side(const hw_mesh *mesh, float margin, int axis, bool upper, hw_box *box)
{
    // The box, somewhat wider than it is, meets nothing on its way; less than by the margin, or the
    // sides that have come to theirs would be in its way.
    hw_vec3 more = hw_v3(margin / 2, margin / 2, margin / 2);
    hw_box wide = {hw_v3_sub(box->min, more), hw_v3_add(box->max, more)};
    *part_of(upper ? &wide.max : &wide.min, axis) = part(upper ? box->max : box->min, axis);
    float reach = INFINITY;
    for (uint32_t i = 0; i < mesh->index_count; i += 3) {
        const uint32_t *t = mesh->indices + i;
        const hw_vec3 corners[3] = {mesh->positions[t[0]], mesh->positions[t[1]],
                                    mesh->positions[t[2]]};
        reach = reach_to(&wide, axis, upper, corners, reach);
    }
    if (reach < INFINITY && reach > margin)
        *part_of(upper ? &box->max : &box->min, axis) += (upper ? 1 : -1) * (reach - margin);
}

void hw_inner_boxes_fit(const hw_mesh *mesh, hw_inner_boxes *boxes)
{
    float margin = 1e-4f * hw_box_diagonal(hw_mesh_bounds(mesh));
    for (uint32_t i = 0; i < boxes->count; i++) {
        // Lengthwise first: pieces of a wall are to reach each other.
        int axes[3] = {0, 1, 2};
        hw_vec3 size = hw_box_size(boxes->boxes[i]);
        for (int k = 0; k < 3; k++) {
            int m = k == 2 ? 0 : k; // two of neighbours, then the first again
            if (part(size, axes[m]) < part(size, axes[m + 1])) {
                int swap = axes[m];
                axes[m] = axes[m + 1];
                axes[m + 1] = swap;
            }
        }
        for (int k = 0; k < 6; k++)
            fit_side(mesh, margin, axes[k / 2], k % 2, &boxes->boxes[i]);
    }
}
