// Bodies to simplify, and the cost of each metric as its paper writes it, for tests.
#pragma once
#include "shapes.h"

#include "metrics.h"
#include "pull_back.h"
#include "rng.h"
#include "simplify.h"
#include <math.h>
#include <stdlib.h>

#define UNUSED __attribute__((unused))

// ---- meshes ----------------------------------------------------------------------------------

typedef struct body {
    hw_mesh mesh;
    hw_collapser *c;
} body;

// Takes the mesh in. Positions are those of the mesh plus `shift`, which the mesh does not get.
static UNUSED body make_body(hw_mesh mesh, double shift)
{
    body b = {.mesh = mesh};
    double(*positions)[3] = NULL;
    assert_int_equal(HW_NEW(&positions, mesh.vertex_count), HW_OK);
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        positions[v][0] = (double)mesh.positions[v].x + shift;
        positions[v][1] = (double)mesh.positions[v].y + shift;
        positions[v][2] = (double)mesh.positions[v].z + shift;
    }
    assert_int_equal(hw_collapser_create((const double(*)[3])positions, mesh.vertex_count,
                                         mesh.indices, mesh.index_count / 3, NULL, HW_COMPLEX_SPLIT,
                                         &b.c),
                     HW_OK);
    hw_free(positions);
    return b;
}

static UNUSED void free_body(body *b)
{
    hw_collapser_destroy(b->c);
    hw_mesh_free(&b->mesh);
}

static UNUSED hw_mesh sphere(uint32_t segments, uint32_t rings)
{
    return shape_sphere(hw_v3(0, 0, 0), 1, segments, rings);
}

// A closed, uneven body; no two of its edges are alike.
static UNUSED hw_mesh potato(uint64_t seed)
{
    hw_mesh mesh = sphere(7, 5);
    hw_rng rng = hw_rng_make(seed, 1);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        mesh.positions[v] = hw_v3_scale(mesh.positions[v], 0.8f + 0.4f * hw_rng_float(&rng));
    return mesh;
}

static UNUSED hw_metric_setup setup_of(const body *b)
{
    return (hw_metric_setup){.collapser = b->c,
                             .mesh = &b->mesh,
                             .kappa = 0.25,
                             .eye = hw_v3(3, 1, 0.5f),
                             .focal_px = 200,
                             .threads = 1};
}

static UNUSED hw_metric create(const char *name, const hw_metric_setup *setup,
                               hw_placement placement)
{
    hw_metric metric;
    const hw_metric_kind *kind = hw_metric_find(name);
    assert_non_null(kind);
    assert_int_equal(hw_metric_create(kind, setup, &metric), HW_OK);
    metric.placement = placement;
    return metric;
}

// ---- formulas --------------------------------------------------------------------------------

static UNUSED double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static UNUSED double distance2(const double a[3], const double b[3])
{
    double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return dot(d, d);
}

// Of length twice the area.
static UNUSED void normal_of(const double *a, const double *b, const double *c, double n[3])
{
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        n[i] = (b[j] - a[j]) * (c[k] - a[k]) - (b[k] - a[k]) * (c[j] - a[j]);
    }
}

typedef struct face {
    const double *p[3];
    int moving;   // which corner goes with the edge; of a face on the edge, one of the two
    bool on_edge; // neither TOP nor BOT
    bool of_a, of_b;
} face;

static UNUSED uint32_t domain_of(const hw_collapser *c, uint32_t a, uint32_t b, face *out,
                                 uint32_t room)
{
    uint32_t n = 0;
    for (uint32_t f = 0; f < c->face_count; f++) {
        const uint32_t *t = c->faces[f];
        face found = {.moving = -1};
        for (int k = 0; t[0] != HW_NO_VERTEX && k < 3; k++) {
            found.p[k] = c->positions[t[k]];
            found.of_a |= t[k] == a;
            found.of_b |= t[k] == b;
            if (t[k] == a || t[k] == b)
                found.moving = k;
        }
        if (found.moving < 0)
            continue;
        found.on_edge = found.of_a && found.of_b;
        assert_true(n < room);
        out[n++] = found;
    }
    return n;
}

static UNUSED double area_of(const face *f)
{
    double n[3];
    normal_of(f->p[0], f->p[1], f->p[2], n);
    return sqrt(dot(n, n)) / 2;
}

static UNUSED double plane_distance2(const face *f, const double x[3])
{
    double n[3], to[3];
    normal_of(f->p[0], f->p[1], f->p[2], n);
    for (int i = 0; i < 3; i++)
        to[i] = x[i] - f->p[0][i];
    return dot(n, to) * dot(n, to) / dot(n, n);
}

static UNUSED double tetrahedron_volume(const face *f, const double x[3])
{
    double n[3], to[3];
    normal_of(f->p[0], f->p[1], f->p[2], n);
    for (int i = 0; i < 3; i++)
        to[i] = x[i] - f->p[0][i];
    return fabs(dot(n, to)) / 6;
}

static UNUSED double one_minus_cosine(const face *f, const double x[3])
{
    double before[3], after[3];
    const double *p[3] = {f->p[0], f->p[1], f->p[2]};
    normal_of(p[0], p[1], p[2], before);
    p[f->moving] = x;
    normal_of(p[0], p[1], p[2], after);
    return 1 - dot(before, after) / sqrt(dot(before, before) * dot(after, after));
}

#define DOMAIN_FACES 64
typedef struct query {
    const hw_metric_setup *setup;
    uint32_t a, b;
    face faces[DOMAIN_FACES];
    uint32_t count;
    double middle[3], weight; // of the edge; sum of the planes' weights
} query;

static UNUSED query ask(const hw_metric_setup *setup, uint32_t a, uint32_t b)
{
    query q = {.setup = setup, .a = a, .b = b};
    const hw_collapser *c = setup->collapser;
    q.count = domain_of(c, a, b, q.faces, DOMAIN_FACES);
    for (int i = 0; i < 3; i++)
        q.middle[i] = (c->positions[a][i] + c->positions[b][i]) / 2;
    return q;
}

static UNUSED double edge_formula(query *q, const double x[3])
{
    (void)x;
    const hw_collapser *c = q->setup->collapser;
    return distance2(c->positions[q->a], c->positions[q->b]);
}

static UNUSED double pm_formula(query *q, const double x[3])
{
    const hw_collapser *c = q->setup->collapser;
    double sum = 0;
    q->weight = 0;
    for (uint32_t i = 0; i < q->count; i++) {
        if (q->faces[i].on_edge)
            continue;
        sum += plane_distance2(&q->faces[i], x);
        q->weight++;
    }
    for (uint32_t v = 0; v < c->vertex_count; v++) { // base points: neighbours, each once
        if (v == q->a || v == q->b ||
            hw_collapser_edge_faces(c, q->a, v) + hw_collapser_edge_faces(c, q->b, v) == 0)
            continue;
        sum += q->setup->kappa * distance2(x, c->positions[v]);
        q->weight += 3 * q->setup->kappa;
    }
    return sum;
}

static UNUSED double uvol_formula(query *q, const double x[3])
{
    double sum = 0;
    for (uint32_t i = 0; i < q->count; i++)
        sum += q->faces[i].on_edge ? 0 : tetrahedron_volume(&q->faces[i], x);
    return sum;
}

static UNUSED double norm_formula(query *q, const double x[3])
{
    double most = 0;
    for (uint32_t i = 0; i < q->count; i++)
        if (!q->faces[i].on_edge)
            most = fmax(most, one_minus_cosine(&q->faces[i], x));
    return most;
}

static UNUSED double hybrid_formula(query *q, const double x[3])
{
    return uvol_formula(q, x) * norm_formula(q, x);
}

static UNUSED double quadric_formula(query *q, const double x[3])
{
    double sum = 0;
    q->weight = 0;
    for (uint32_t i = 0; i < q->count; i++) {
        sum += area_of(&q->faces[i]) * plane_distance2(&q->faces[i], x);
        q->weight += area_of(&q->faces[i]);
    }
    return sum;
}

static UNUSED double volume_formula(query *q, const double x[3])
{
    double sum = 0;
    q->weight = 0;
    for (uint32_t i = 0; i < q->count; i++) {
        double v = 6 * tetrahedron_volume(&q->faces[i], x), size = 2 * area_of(&q->faces[i]);
        sum += v * v;
        q->weight += size * size;
    }
    return sum;
}

// With memory, faces on the edge count for both ends. A mean of squared distances.
static UNUSED double qem_formula(query *q, const double x[3])
{
    double sum = 0, weight = 0;
    for (uint32_t i = 0; i < q->count; i++) {
        double w = area_of(&q->faces[i]) * (q->faces[i].on_edge ? 2 : 1);
        sum += w * plane_distance2(&q->faces[i], x);
        weight += w;
    }
    q->weight = 1;
    return sum / weight;
}

// Square pixels of area times square pixels of distance. What moves across the line of sight shows
// whole, along it a twentieth at least; faces that look away count a quarter.
static UNUSED double screen_formula(query *q, const double x[3])
{
    const hw_metric_setup *s = q->setup;
    const double eye[3] = {(double)s->eye.x, (double)s->eye.y, (double)s->eye.z};
    double ray[3], px2 = s->focal_px * s->focal_px / distance2(q->middle, eye), sum = 0;
    for (int i = 0; i < 3; i++)
        ray[i] = q->middle[i] - eye[i];
    q->weight = 0;
    for (uint32_t i = 0; i < q->count; i++) {
        double n[3];
        const face *f = &q->faces[i];
        normal_of(f->p[0], f->p[1], f->p[2], n);
        double cosine = dot(n, ray) / sqrt(dot(n, n) * dot(ray, ray));
        double share = fmax(1 - cosine * cosine, 0.05) * (cosine > 0 ? 0.25 : 1);
        sum += area_of(f) * px2 * share * plane_distance2(f, x) * px2;
        q->weight += area_of(f) * px2 * px2 * share;
    }
    return sum;
}

typedef double formula(query *q, const double x[3]);
typedef struct rule {
    const char *name;
    formula *cost;
    bool minimises; // has an optimum of its own
} rule;

static const rule rules[] = {
    {"edge", edge_formula, false},     {"pm", pm_formula, true},
    {"uvol", uvol_formula, false},     {"norm", norm_formula, false},
    {"hybrid", hybrid_formula, false}, {"quadric", quadric_formula, true},
    {"volume", volume_formula, true},  {"qem", qem_formula, true},
    {"screen", screen_formula, true},
};
#define RULES (sizeof rules / sizeof *rules)

// Every edge of a closed mesh once: visit is called with the lower vertex first.
typedef struct edge_list {
    uint32_t (*edges)[2], count;
} edge_list;

static UNUSED edge_list edges_of(const hw_collapser *c)
{
    edge_list list = {0};
    assert_int_equal(HW_NEW(&list.edges, 3 * (size_t)c->face_count), HW_OK);
    for (uint32_t f = 0; f < c->face_count; f++)
        for (int k = 0; c->faces[f][0] != HW_NO_VERTEX && k < 3; k++) {
            uint32_t a = c->faces[f][k], b = c->faces[f][(k + 1) % 3];
            if (a > b && hw_collapser_edge_faces(c, a, b) > 1)
                continue; // the other face tells of it
            list.edges[list.count][0] = a < b ? a : b;
            list.edges[list.count++][1] = a < b ? b : a;
        }
    return list;
}

static UNUSED bool near(double x, double y, double scale)
{
    return fabs(x - y) <= 1e-6 * fmax(fabs(x), fabs(y)) + 1e-7 * scale;
}

static UNUSED bool same_place(const double x[3], const double y[3])
{
    return distance2(x, y) <= 1e-24;
}

// Collapses with free placement keep the enclosed volume, within rounding.
static UNUSED double enclosed(const hw_collapser *c)
{
    double sum = 0;
    for (uint32_t f = 0; f < c->face_count; f++) {
        double n[3];
        const uint32_t *t = c->faces[f];
        if (t[0] == HW_NO_VERTEX)
            continue;
        normal_of(c->positions[t[0]], c->positions[t[1]], c->positions[t[2]], n);
        sum += dot(n, c->positions[t[0]]) / 6;
    }
    return sum;
}
