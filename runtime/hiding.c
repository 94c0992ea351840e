#include "hiding.h"
#include "alloc.h"
#include <math.h>
#include <string.h>

#define TILE      8u    // bits along each side
#define TILES_MAX 128u  // along each side
#define MARGIN    0.125 // bits by which what hides is smaller: rasterisers round
#define REACH     1.0   // bits by which what may be hidden is larger
#define AREA_MIN  512.0 // bits that a box must cover to be worth the time
#define FRONTS    3u    // faces of a box that one sees, at most
#define FACES     6u
#define NEARER    1e-4    // part of a distance by which what hides must be nearer
#define STEPS     0x1p-21 // of the range of depths, too: a depth buffer of 24 bits rounds
#define EDGES_MAX (FRONTS * FACES + FRONTS)

// Depths are inverse (1 / w), which is linear over the picture; 0 is infinitely far.
typedef struct tile {
    uint64_t mask;     // bits that hide what is beyond `part`
    float part, whole; // all bits hide what is beyond `whole`
} tile;

struct hw_hiding {
    double eye[3], forward[3], right[3], down[3];
    double left, top, step; // of bit (0, 0)'s corner and from bit to bit, at distance 1
    double near, far, near_reach;
    uint32_t columns, rows; // tiles
    bool empty;
    tile tiles[TILES_MAX * TILES_MAX];
};

// a u + b v + c at place (u, v) of the picture, in bits.
typedef struct line {
    double a, b, c;
} line;

hw_status hw_hiding_create(hw_hiding **out)
{
    HW_TRY(HW_NEW(out, 1));
    (*out)->empty = true;
    return HW_OK;
}

void hw_hiding_destroy(hw_hiding *hiding)
{
    hw_free(hiding);
}

// The library's fmin and fmax are calls, for the sake of NaNs.
static inline double least(double a, double b)
{
    return a < b ? a : b;
}

static inline double most(double a, double b)
{
    return a > b ? a : b;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void normalise(double v[3])
{
    double length = sqrt(dot(v, v));
    for (int k = 0; k < 3; k++)
        v[k] /= length > 0 ? length : 1;
}

static void put(double out[3], hw_vec3 v)
{
    out[0] = (double)v.x;
    out[1] = (double)v.y;
    out[2] = (double)v.z;
}

void hw_hiding_begin(hw_hiding *h, const hw_camera *camera)
{
    double up[3], focal = hw_camera_focal_px(camera);
    double width = camera->width, height = camera->height;
    put(h->eye, camera->eye);
    put(h->forward, camera->forward);
    put(up, camera->up);
    normalise(h->forward);
    hw_cross(h->forward, up, h->right);
    normalise(h->right);
    hw_cross(h->forward, h->right, h->down);
    double bit = ceil(fmax(width, height) / (TILES_MAX * TILE)); // in pixels
    h->step = bit / focal;
    h->left = (-width / 2 - (double)camera->jitter_x) / focal;
    h->top = (-height / 2 + (double)camera->jitter_y) / focal;
    h->columns = (uint32_t)ceil(width / bit / TILE);
    h->rows = (uint32_t)ceil(height / bit / TILE);
    h->near = (double)(camera->near > 0 ? camera->near : HW_CAMERA_NEAR);
    h->far = (double)(camera->far > 0 ? camera->far : HW_CAMERA_FAR);
    h->near_reach = h->near * sqrt(1 + pow(fabs(h->left) + h->step, 2) + pow(h->top - h->step, 2));
    memset(h->tiles, 0, (size_t)h->columns * h->rows * sizeof *h->tiles);
    h->empty = true;
}

double hw_hiding_near_reach(const hw_hiding *hiding)
{
    return hiding->near_reach;
}

// ---- boxes -----------------------------------------------------------------------------------

// Where a box lies in the picture.
typedef struct place {
    double least, most;     // distance along the view
    double low[2], high[2]; // in bits; if least > 0
} place;

static place place_of(const hw_hiding *h, const hw_mat4 *transform, hw_box box)
{
    place p = {INFINITY, -INFINITY, {INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
    for (uint32_t i = 0; i < 8; i++) {
        const hw_vec3 c = hw_box_corner(box, i);
        double at[3] = {(double)c.x, (double)c.y, (double)c.z}, d[3];
        for (int k = 0; k < 3; k++) {
            const double *m = transform ? transform->m + k : NULL;
            d[k] = m ? m[0] * at[0] + m[4] * at[1] + m[8] * at[2] + m[12] : at[k];
            d[k] -= h->eye[k];
        }
        double w = dot(d, h->forward);
        double uv[2] = {(dot(d, h->right) / w - h->left) / h->step,
                        (dot(d, h->down) / w - h->top) / h->step};
        p.least = least(p.least, w);
        p.most = most(p.most, w);
        for (int k = 0; k < 2; k++) {
            p.low[k] = least(p.low[k], uv[k]);
            p.high[k] = most(p.high[k], uv[k]);
        }
    }
    return p;
}

// The inverse depth of a plane n p = d, where it is `away` from the eye along n.
static line plane_depth(const hw_hiding *h, const double n[3], double away)
{
    double right = dot(n, h->right) / away, down = dot(n, h->down) / away;
    return (line){right * h->step, down * h->step,
                  dot(n, h->forward) / away + right * h->left + down * h->top};
}

// Inverse depths of the planes of a box, of faces that one sees and of the others. A point of the
// picture shows the box where it meets all of the first before any of the others.
typedef struct faces {
    line front[FRONTS], back[FACES];
    uint32_t front_count, back_count;
} faces;

// False if the box hides nothing.
static bool faces_of(const hw_hiding *h, const hw_mat4 *transform, hw_box box, faces *out)
{
    const double *m = transform->m, *axes[3] = {m, m + 4, m + 8};
    double ends[2][3], to[2][3], normal[3];
    put(ends[0], box.min);
    put(ends[1], box.max);
    for (int end = 0; end < 2; end++)
        for (int k = 0; k < 3; k++)
            to[end][k] = m[k] * ends[end][0] + m[4 + k] * ends[end][1] + m[8 + k] * ends[end][2] +
                         m[12 + k] - h->eye[k];
    hw_cross(axes[0], axes[1], normal);
    double turned = dot(normal, axes[2]);
    out->front_count = out->back_count = 0;
    for (int k = 0; k < 3; k++)
        for (int end = 0; end < 2; end++) {
            hw_cross(axes[(k + 1) % 3], axes[(k + 2) % 3], normal);
            double outward = (end == 1) == (turned > 0) ? 1 : -1;
            double away = dot(normal, to[end]);
            if (away * outward == 0 || !isfinite(away))
                return false;
            line depth = plane_depth(h, normal, away);
            if (away * outward > 0)
                out->back[out->back_count++] = depth;
            else if (out->front_count < FRONTS)
                out->front[out->front_count++] = depth;
            else
                return false;
        }
    return out->front_count > 0;
}

// ---- adding ----------------------------------------------------------------------------------

// An edge of what is covered: in row v of bits, bits from u = offset + slope v on are on its inner
// side wholly, or up to there.
typedef struct edge {
    bool begins, level; // level: parallel to rows; offset + slope v >= 0 within
    double offset, slope;
} edge;

static edge edge_of(line l)
{
    double margin = MARGIN * (fabs(l.a) + fabs(l.b));
    double worst = l.c + fmin(l.a, 0) + fmin(l.b, 0) - margin; // of a bit, at its corner
    if (fabs(l.a) <= 1e-12 * (fabs(l.b) + fabs(l.c)))
        return (edge){.level = true, .offset = worst - fabs(l.c) * 1e-9, .slope = l.b};
    return (edge){.begins = l.a > 0, .offset = -worst / l.a, .slope = -l.b / l.a};
}

static line minus(line a, line b)
{
    return (line){a.a - b.a, a.b - b.b, a.c - b.c};
}

static uint32_t edges_of(const faces *f, edge *edges)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < f->front_count; i++) {
        edges[n++] = edge_of(f->front[i]); // before the eye
        for (uint32_t k = 0; k < f->back_count; k++)
            edges[n++] = edge_of(minus(f->front[i], f->back[k]));
    }
    return n;
}

// Bits [low, high) of a row that are covered wholly, of those before `width`.
typedef struct span {
    int32_t low, high;
} span;

static span span_of(const edge *edges, uint32_t count, uint32_t row, uint32_t width)
{
    double low = 0, high = width;
    for (uint32_t i = 0; i < count; i++) {
        double at = edges[i].offset + edges[i].slope * row;
        if (edges[i].level)
            high = at >= 0 ? high : 0;
        else if (edges[i].begins)
            low = most(low, at);
        else
            high = least(high, at + 1);
    }
    if (!(low < high))
        return (span){0, 0};
    int32_t first = (int32_t)low;
    return (span){first + (first < low), (int32_t)high};
}

// The bits of eight spans that lie in the tile that begins at bit `first`.
static uint64_t tile_mask(const span spans[TILE], int32_t first)
{
    uint64_t mask = 0;
    for (uint32_t r = 0; r < TILE; r++) {
        int32_t low = spans[r].low - first, high = spans[r].high - first;
        low = low < 0 ? 0 : low;
        high = high > (int32_t)TILE ? (int32_t)TILE : high;
        if (low < high)
            mask |= (uint64_t)((1u << high) - (1u << low)) << TILE * r;
    }
    return mask;
}

// The farthest of the faces within a tile.
static float tile_depth(const faces *f, uint32_t column, uint32_t row)
{
    double depth = INFINITY;
    for (uint32_t i = 0; i < f->front_count; i++) {
        const line *l = &f->front[i];
        depth = least(depth, l->c + l->a * TILE * (column + (l->a < 0)) +
                                 l->b * TILE * (row + (l->b < 0)));
    }
    return (float)depth;
}

static void cover(tile *t, uint64_t mask, float depth)
{
    if (mask == 0 || depth <= t->whole)
        return;
    if (mask == UINT64_MAX) {
        t->whole = depth;
    } else {
        t->part = t->mask && t->part < depth ? t->part : depth;
        t->mask |= mask;
        if (t->mask == UINT64_MAX)
            t->whole = t->part;
    }
    if (t->mask == UINT64_MAX || t->part <= t->whole)
        t->mask = 0;
}

static void cover_tiles(hw_hiding *h, const faces *f, const span spans[TILE], uint32_t row)
{
    int32_t low = INT32_MAX, high = 0;           // of the tiles that are touched
    int32_t full_low = 0, full_high = INT32_MAX; // of those that are covered
    for (uint32_t r = 0; r < TILE; r++) {
        full_low = spans[r].low > full_low ? spans[r].low : full_low;
        full_high = spans[r].high < full_high ? spans[r].high : full_high;
        if (spans[r].low >= spans[r].high)
            continue;
        low = spans[r].low < low ? spans[r].low : low;
        high = spans[r].high > high ? spans[r].high : high;
    }
    for (int32_t at = low / (int32_t)TILE * (int32_t)TILE; at < high; at += (int32_t)TILE) {
        uint32_t column = (uint32_t)at / TILE;
        bool full = at >= full_low && at + (int32_t)TILE <= full_high;
        cover(&h->tiles[row * h->columns + column], full ? UINT64_MAX : tile_mask(spans, at),
              tile_depth(f, column, row));
    }
}

void hw_hiding_add(hw_hiding *h, const hw_mat4 *transform, hw_box box)
{
    faces f;
    edge edges[EDGES_MAX];
    place p = place_of(h, transform, box);
    double top = 0, bottom = h->rows;
    if (!(p.most > h->near && p.most < h->far) || !faces_of(h, transform, box, &f))
        return;
    if (p.least > 0) {
        if ((p.high[0] - p.low[0]) * (p.high[1] - p.low[1]) < AREA_MIN)
            return;
        top = fmax(floor(p.low[1] / TILE), 0);
        bottom = fmin(ceil(p.high[1] / TILE), bottom);
    }
    uint32_t count = edges_of(&f, edges);
    for (double row = top; row < bottom; row++) {
        span spans[TILE];
        for (uint32_t r = 0; r < TILE; r++)
            spans[r] = span_of(edges, count, (uint32_t)row * TILE + r, h->columns * TILE);
        cover_tiles(h, &f, spans, (uint32_t)row);
    }
    h->empty = false;
}

// ---- asking ----------------------------------------------------------------------------------

// Whether all bits of the rectangle that lie in the tile hide what is at this depth.
static bool tile_hides(const tile *t, uint32_t column, uint32_t row, const int32_t low[2],
                       const int32_t high[2], double depth)
{
    if ((double)t->whole > depth)
        return true;
    if (t->mask == 0 || (double)t->part <= depth)
        return false;
    span spans[TILE];
    for (uint32_t r = 0; r < TILE; r++) {
        int32_t v = (int32_t)(row * TILE + r);
        spans[r] = v >= low[1] && v < high[1] ? (span){low[0], high[0]} : (span){0, 0};
    }
    return (tile_mask(spans, (int32_t)(column * TILE)) & ~t->mask) == 0;
}

bool hw_hiding_hides(const hw_hiding *h, const hw_mat4 *transform, hw_box box)
{
    if (h->empty)
        return false;
    place p = place_of(h, transform, box);
    if (!(p.least > 0))
        return false;
    double depth = (1 + NEARER) / p.least + STEPS / h->near;
    const double size[2] = {h->columns * TILE, h->rows * TILE};
    int32_t low[2], high[2];
    for (int k = 0; k < 2; k++) {
        low[k] = (int32_t)fmin(fmax(floor(p.low[k] - REACH), 0), size[k]);
        high[k] = (int32_t)fmax(fmin(ceil(p.high[k] + REACH), size[k]), 0);
        if (low[k] >= high[k])
            return true;
    }
    for (int32_t row = low[1] / (int32_t)TILE; row * (int32_t)TILE < high[1]; row++)
        for (int32_t column = low[0] / (int32_t)TILE; column * (int32_t)TILE < high[0]; column++)
            if (!tile_hides(&h->tiles[(uint32_t)row * h->columns + (uint32_t)column],
                            (uint32_t)column, (uint32_t)row, low, high, depth))
                return false;
    return true;
}
