#include "masonry.h"
#include "hash.h"
#include <stdio.h>
#include <string.h>

#define BALL_SEGMENTS 20
#define BALL_RINGS    12

// A mesh under construction.
typedef struct pile {
    hw_mesh mesh;
    size_t vertex_capacity, index_capacity;
} pile;

static hw_status add_vertex(pile *p, hw_vec3 position, uint32_t *idx)
{
    HW_TRY(HW_RESERVE(&p->mesh.positions, &p->vertex_capacity, p->mesh.vertex_count + 1));
    p->mesh.positions[p->mesh.vertex_count] = position;
    *idx = p->mesh.vertex_count++;
    return HW_OK;
}

// Two triangles over a grid square; a, b, c, d counter-clockwise.
static hw_status add_quad(pile *p, uint32_t a, uint32_t b, uint32_t c, uint32_t d)
{
    HW_TRY(HW_RESERVE(&p->mesh.indices, &p->index_capacity, p->mesh.index_count + 6));
    const uint32_t corners[6] = {a, b, c, a, c, d};
    memcpy(p->mesh.indices + p->mesh.index_count, corners, sizeof corners);
    p->mesh.index_count += 6;
    return HW_OK;
}

// ---- relief ----------------------------------------------------------------------------------

static double lattice_value(int32_t x, int32_t y, int32_t z)
{
    const int32_t place[3] = {x, y, z};
    return (double)(hw_hash(17, place, sizeof place) >> 40) * 0x1p-23 - 1;
}

// Smooth noise in [-1, 1]: values at whole places, blended by cubics.
static double noise(double x, double y, double z)
{
    const double p[3] = {x, y, z};
    int32_t base[3];
    double t[3], sum = 0;
    for (int k = 0; k < 3; k++) {
        base[k] = (int32_t)floor(p[k]);
        double f = p[k] - base[k];
        t[k] = f * f * (3 - 2 * f);
    }
    for (int corner = 0; corner < 8; corner++) {
        double weight = 1;
        for (int k = 0; k < 3; k++)
            weight *= corner >> k & 1 ? t[k] : 1 - t[k];
        sum += weight * lattice_value(base[0] + (corner & 1), base[1] + (corner >> 1 & 1),
                                      base[2] + (corner >> 2));
    }
    return sum;
}

// Bumps of a surface: up to `height` out or in, about `width` wide, and half as large ones on them.
typedef struct relief {
    double height, width;
} relief;

static double relief_at(const relief *r, const double p[3])
{
    if (r->height == 0)
        return 0;
    double s = 1 / r->width;
    return r->height * (0.67 * noise(s * p[0], s * p[1], s * p[2]) +
                        0.33 * noise(2 * s * p[0] + 9, 2 * s * p[1], 2 * s * p[2]));
}

// ---- blocks ----------------------------------------------------------------------------------

// A box with rounded edges (but at the bottom), on a grid of about `step`.
typedef struct block {
    double size[3], z, rounding, step;
    relief bumps;
    int32_t n[3]; // squares along each side
} block;

// A grid point on the box's surface, moved to the rounded one (a square goes over into a circle
// round the inner box, at equal largest coordinate) and along it by the relief. A function of the
// point alone, so that neighbouring faces agree on their edges.
static hw_vec3 block_point(const block *b, const int32_t at[3])
{
    double inner[3], d[3], most = 0, length = 0, p[3];
    for (int k = 0; k < 3; k++) {
        p[k] = b->size[k] * ((double)at[k] / b->n[k] - (k < 2 ? 0.5 : 0));
        double high = k < 2 ? b->size[k] / 2 - b->rounding : b->size[k] - b->rounding;
        double low = k < 2 ? -high : 0;
        inner[k] = fmin(fmax(p[k], low), high);
        d[k] = p[k] - inner[k];
        most = fmax(most, fabs(d[k]));
        length += d[k] * d[k];
    }
    double scale = length > 0 ? most / sqrt(length) : 0;
    bool bottom = at[2] == 0;
    scale *= 1 + (bottom ? 0 : relief_at(&b->bumps, p) / b->rounding);
    return hw_v3((float)(inner[0] + scale * d[0]), (float)(inner[1] + scale * d[1]),
                 (float)(b->z + inner[2] + scale * d[2]));
}

// The face where coordinate `axis` is least (side 0) or greatest.
static hw_status add_face(pile *p, const block *b, int axis, int side)
{
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    uint32_t first = p->mesh.vertex_count, idx, columns = (uint32_t)b->n[u] + 1;
    for (int32_t j = 0; j <= b->n[v]; j++)
        for (int32_t i = 0; i <= b->n[u]; i++) {
            int32_t at[3];
            at[axis] = side ? b->n[axis] : 0;
            at[u] = i;
            at[v] = j;
            HW_TRY(add_vertex(p, block_point(b, at), &idx));
        }
    for (uint32_t j = 0; j < (uint32_t)b->n[v]; j++)
        for (uint32_t i = 0; i < (uint32_t)b->n[u]; i++) {
            uint32_t a = first + j * columns + i, c = a + columns;
            if (side)
                HW_TRY(add_quad(p, a, a + 1, c + 1, c));
            else
                HW_TRY(add_quad(p, a, c, c + 1, a + 1));
        }
    return HW_OK;
}

static hw_status add_block(pile *p, block b)
{
    for (int k = 0; k < 3; k++)
        b.n[k] = (int32_t)fmax(ceil(b.size[k] / b.step), 2);
    for (int axis = 0; axis < 3; axis++)
        for (int side = 0; side < 2; side++)
            HW_TRY(add_face(p, &b, axis, side));
    return HW_OK;
}

// ---- turned pieces ---------------------------------------------------------------------------

typedef struct profile_point {
    double radius, z;
} profile_point;

// A surface of revolution about a vertical axis at x; the profile goes up and has radius 0 at both
// ends.
static hw_status add_turned(pile *p, double x, const profile_point *profile, uint32_t count,
                            uint32_t segments)
{
    uint32_t first = p->mesh.vertex_count, idx;
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t s = 0; s < segments; s++) {
            double angle = 2 * HW_PI * s / segments, r = profile[i].radius;
            HW_TRY(add_vertex(
                p, hw_v3((float)(x + r * cos(angle)), (float)(r * sin(angle)), (float)profile[i].z),
                &idx));
        }
    for (uint32_t i = 0; i + 1 < count; i++)
        for (uint32_t s = 0; s < segments; s++) {
            uint32_t a = first + i * segments + s, b = first + i * segments + (s + 1) % segments;
            HW_TRY(add_quad(p, a, b, b + segments, a + segments));
        }
    return HW_OK;
}

static hw_status add_column(pile *p, double x)
{
    static const profile_point profile[] = {
        {0, 1.4},     {2.3, 1.4},   {2.5, 1.9},   {2.3, 2.4},  {1.9, 2.6},  {1.85, 5},
        {1.82, 8},    {1.76, 11},   {1.68, 14},   {1.58, 17},  {1.48, 19},  {1.48, 19.6},
        {1.75, 19.8}, {1.75, 20.1}, {1.55, 20.3}, {2.1, 20.8}, {2.6, 21.6}, {0, 21.6}};
    return add_turned(p, x, profile, sizeof profile / sizeof *profile, 24);
}

static hw_status add_ball(pile *p, double z, double radius)
{
    profile_point profile[BALL_RINGS + 1];
    for (int i = 0; i <= BALL_RINGS; i++) {
        double latitude = HW_PI * ((double)i / BALL_RINGS - 0.5);
        bool pole = i == 0 || i == BALL_RINGS;
        profile[i] = (profile_point){pole ? 0 : radius * cos(latitude), z + radius * sin(latitude)};
    }
    return add_turned(p, 0, profile, BALL_RINGS + 1, BALL_SEGMENTS);
}

// ---- pieces ----------------------------------------------------------------------------------

// Walls and hedges reach a little beyond their length, so that no light falls through between two.
static hw_status make_wall(pile *p, double length)
{
    length += 0.8;
    HW_TRY(add_block(
        p, (block){.size = {length, 3, 26}, .rounding = 0.3, .step = 1, .bumps = {0.2, 5}}));
    return add_block(p,
                     (block){.size = {length, 4.4, 1.3}, .z = 25.6, .rounding = 0.5, .step = 0.8});
}

static hw_status make_hedge(pile *p, double length)
{
    length += 5;
    return add_block(
        p, (block){.size = {length, 8, 27}, .rounding = 2, .step = 0.8, .bumps = {0.9, 2.6}});
}

static hw_status make_colonnade(pile *p, double length)
{
    uint32_t columns = (uint32_t)fmax(floor(length / 10 + 0.5), 1);
    HW_TRY(add_block(p, (block){.size = {length, 6.5, 1.5}, .rounding = 0.2, .step = 1.5}));
    HW_TRY(
        add_block(p, (block){.size = {length, 4.6, 3.4}, .z = 21.4, .rounding = 0.3, .step = 1}));
    for (uint32_t i = 0; i < columns; i++)
        HW_TRY(add_column(p, length * ((i + 0.5) / columns - 0.5)));
    return HW_OK;
}

static hw_status make_pier(pile *p, double length)
{
    (void)length;
    HW_TRY(add_block(p, (block){.size = {6, 6, 28}, .rounding = 0.4, .step = 1}));
    HW_TRY(add_block(p, (block){.size = {7.6, 7.6, 1.6}, .z = 27.8, .rounding = 0.5, .step = 0.8}));
    return add_ball(p, 31.4, 2.6);
}

static const struct {
    const char *name;
    hw_status (*make)(pile *p, double length);
} pieces[HW_MASONRY_COUNT] = {
    [HW_MASONRY_WALL] = {"wall", make_wall},
    [HW_MASONRY_HEDGE] = {"hedge", make_hedge},
    [HW_MASONRY_COLONNADE] = {"colonnade", make_colonnade},
    [HW_MASONRY_PIER] = {"pier", make_pier},
};

hw_status hw_masonry_make(hw_masonry kind, double length, hw_mesh *out)
{
    hw_status status = HW_OK;
    pile p = {0};
    char name[64];
    *out = (hw_mesh){0};
    if (kind == HW_MASONRY_PIER)
        snprintf(name, sizeof name, "%s", pieces[kind].name);
    else
        snprintf(name, sizeof name, "%s %g", pieces[kind].name, length);
    HW_GO(hw_strdup(&p.mesh.name, name));
    HW_GO(pieces[kind].make(&p, length));
    HW_GO(hw_mesh_clean(&p.mesh)); // faces of a block meet in shared vertices, fans in poles
    HW_GO(hw_mesh_compute_normals(&p.mesh));
    *out = p.mesh;
    p.mesh = (hw_mesh){0};
out:
    hw_mesh_free(&p.mesh);
    return status;
}
