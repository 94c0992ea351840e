// Every metric against its formula, worked out anew from the faces of small made-up meshes, and
// where merged vertices may go.
#include "shapes.h"

#include "metrics.h"
#include "pull_back.h"
#include "rng.h"
#include "simplify.h"
#include <math.h>
#include <stdlib.h>

// ---- meshes ----------------------------------------------------------------------------------

typedef struct body {
    hw_mesh mesh;
    hw_collapser *c;
} body;

// Takes the mesh in. Positions are those of the mesh plus `shift`, which the mesh does not get.
static body make_body(hw_mesh mesh, double shift)
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

static void free_body(body *b)
{
    hw_collapser_destroy(b->c);
    hw_mesh_free(&b->mesh);
}

static hw_mesh sphere(uint32_t segments, uint32_t rings)
{
    return shape_sphere(hw_v3(0, 0, 0), 1, segments, rings);
}

// A closed, uneven body; no two of its edges are alike.
static hw_mesh potato(uint64_t seed)
{
    hw_mesh mesh = sphere(7, 5);
    hw_rng rng = hw_rng_make(seed, 1);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        mesh.positions[v] = hw_v3_scale(mesh.positions[v], 0.8f + 0.4f * hw_rng_float(&rng));
    return mesh;
}

static hw_metric_setup setup_of(const body *b)
{
    return (hw_metric_setup){.collapser = b->c,
                             .mesh = &b->mesh,
                             .kappa = 0.25,
                             .eye = hw_v3(3, 1, 0.5f),
                             .focal_px = 200,
                             .threads = 1};
}

static hw_metric create(const char *name, const hw_metric_setup *setup, hw_placement placement)
{
    hw_metric metric;
    const hw_metric_kind *kind = hw_metric_find(name);
    assert_non_null(kind);
    assert_int_equal(hw_metric_create(kind, setup, &metric), HW_OK);
    metric.placement = placement;
    return metric;
}

// ---- formulas --------------------------------------------------------------------------------

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double distance2(const double a[3], const double b[3])
{
    double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return dot(d, d);
}

// Of length twice the area.
static void normal_of(const double *a, const double *b, const double *c, double n[3])
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

static uint32_t domain_of(const hw_collapser *c, uint32_t a, uint32_t b, face *out, uint32_t room)
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

static double area_of(const face *f)
{
    double n[3];
    normal_of(f->p[0], f->p[1], f->p[2], n);
    return sqrt(dot(n, n)) / 2;
}

static double plane_distance2(const face *f, const double x[3])
{
    double n[3], to[3];
    normal_of(f->p[0], f->p[1], f->p[2], n);
    for (int i = 0; i < 3; i++)
        to[i] = x[i] - f->p[0][i];
    return dot(n, to) * dot(n, to) / dot(n, n);
}

static double tetrahedron_volume(const face *f, const double x[3])
{
    double n[3], to[3];
    normal_of(f->p[0], f->p[1], f->p[2], n);
    for (int i = 0; i < 3; i++)
        to[i] = x[i] - f->p[0][i];
    return fabs(dot(n, to)) / 6;
}

static double one_minus_cosine(const face *f, const double x[3])
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

static query ask(const hw_metric_setup *setup, uint32_t a, uint32_t b)
{
    query q = {.setup = setup, .a = a, .b = b};
    const hw_collapser *c = setup->collapser;
    q.count = domain_of(c, a, b, q.faces, DOMAIN_FACES);
    for (int i = 0; i < 3; i++)
        q.middle[i] = (c->positions[a][i] + c->positions[b][i]) / 2;
    return q;
}

static double edge_formula(query *q, const double x[3])
{
    (void)x;
    const hw_collapser *c = q->setup->collapser;
    return distance2(c->positions[q->a], c->positions[q->b]);
}

static double pm_formula(query *q, const double x[3])
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

static double uvol_formula(query *q, const double x[3])
{
    double sum = 0;
    for (uint32_t i = 0; i < q->count; i++)
        sum += q->faces[i].on_edge ? 0 : tetrahedron_volume(&q->faces[i], x);
    return sum;
}

static double norm_formula(query *q, const double x[3])
{
    double most = 0;
    for (uint32_t i = 0; i < q->count; i++)
        if (!q->faces[i].on_edge)
            most = fmax(most, one_minus_cosine(&q->faces[i], x));
    return most;
}

static double hybrid_formula(query *q, const double x[3])
{
    return uvol_formula(q, x) * norm_formula(q, x);
}

static double quadric_formula(query *q, const double x[3])
{
    double sum = 0;
    q->weight = 0;
    for (uint32_t i = 0; i < q->count; i++) {
        sum += area_of(&q->faces[i]) * plane_distance2(&q->faces[i], x);
        q->weight += area_of(&q->faces[i]);
    }
    return sum;
}

static double volume_formula(query *q, const double x[3])
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
static double qem_formula(query *q, const double x[3])
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
static double screen_formula(query *q, const double x[3])
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

static edge_list edges_of(const hw_collapser *c)
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

static bool near(double x, double y, double scale)
{
    return fabs(x - y) <= 1e-6 * fmax(fabs(x), fabs(y)) + 1e-7 * scale;
}

// ---- costs -----------------------------------------------------------------------------------

// Places that a placement allows besides the optimum. Returns how many.
static uint32_t allowed(const hw_collapser *c, const query *q, hw_placement placement,
                        const double *out[3])
{
    uint32_t n = 0;
    if (placement != HW_PLACEMENT_ENDS)
        out[n++] = q->middle;
    if (placement != HW_PLACEMENT_MIDPOINT) {
        out[n++] = c->positions[q->a];
        out[n++] = c->positions[q->b];
    }
    return n;
}

static bool same_place(const double x[3], const double y[3])
{
    return distance2(x, y) <= 1e-24;
}

// The cost is the formula's at the place chosen, and of the places allowed that is the least. The
// vertex kept is the end that the place is at.
static void check_fixed(const rule *r, query *q, hw_placement placement, const hw_collapse *out)
{
    const hw_collapser *c = q->setup->collapser;
    const double *places[3];
    uint32_t n = allowed(c, q, placement, places);
    bool found = false;
    double scale = r->cost(q, q->middle) + r->cost(q, c->positions[q->a]);
    assert_true(near(out->cost, r->cost(q, out->position), scale));
    for (uint32_t i = 0; i < n; i++) {
        found |= same_place(places[i], out->position);
        assert_true(out->cost <= r->cost(q, places[i]) + 1e-6 * scale);
    }
    assert_true(found);
    assert_true((out->kept == q->a && out->removed == q->b) ||
                (out->kept == q->b && out->removed == q->a));
    for (uint32_t i = 0; i < 2; i++) {
        uint32_t end = i ? q->b : q->a;
        if (same_place(out->position, c->positions[end]))
            assert_true(out->kept == end &&
                        memcmp(out->position, c->positions[end], sizeof out->position) == 0);
    }
}

// A free place is the minimum of the formula. Minimisers are drawn weakly to the middle
// (quadric.h): what that may cost is granted tenfold.
static bool check_optimum(const rule *r, query *q, const hw_collapse *out)
{
    const hw_collapser *c = q->setup->collapser;
    const double *places[3];
    uint32_t n = allowed(c, q, HW_PLACEMENT_SUBSET, places);
    for (uint32_t i = 0; i < n; i++)
        if (same_place(places[i], out->position))
            return false;
    double edge = sqrt(distance2(c->positions[q->a], c->positions[q->b]));
    double least = r->cost(q, out->position), scale = r->cost(q, q->middle);
    assert_true(near(out->cost, least, scale));
    assert_true(distance2(out->position, q->middle) <= 4.001 * edge * edge);
    bool constrained = r->cost == volume_formula;
    double g[3] = {0}; // moves along it change the volume
    for (uint32_t i = 0; i < q->count; i++) {
        double m[3];
        normal_of(q->faces[i].p[0], q->faces[i].p[1], q->faces[i].p[2], m);
        for (int k = 0; k < 3; k++)
            g[k] += m[k];
    }
    for (int k = 0; k < 12; k++) {
        double x[3], step[3] = {0}, length = edge * (k < 6 ? 0.1 : 0.5);
        step[k / 2 % 3] = k % 2 ? length : -length;
        double along = constrained ? dot(step, g) / dot(g, g) : 0;
        for (int i = 0; i < 3; i++)
            x[i] = out->position[i] + step[i] - along * g[i];
        double granted = 1e-2 / 3 * q->weight *
                         fmax(0, distance2(x, q->middle) - distance2(out->position, q->middle));
        assert_true(least <= r->cost(q, x) + granted + 1e-9 * scale);
    }
    return true;
}

static void costs_are_the_formulas(void **state)
{
    (void)state;
    for (uint64_t seed = 0; seed < 3; seed++) {
        body b = make_body(potato(seed), 0);
        hw_metric_setup setup = setup_of(&b);
        edge_list list = edges_of(b.c);
        assert_int_equal(list.count, b.mesh.index_count / 2);
        for (size_t i = 0; i < RULES; i++)
            for (int p = HW_PLACEMENT_MIDPOINT; p <= HW_PLACEMENT_OPTIMAL; p++) {
                hw_metric metric = create(rules[i].name, &setup, (hw_placement)p);
                uint32_t optima = 0;
                for (uint32_t e = 0; e < list.count; e++) {
                    hw_collapse out;
                    query q = ask(&setup, list.edges[e][0], list.edges[e][1]);
                    hw_metric_evaluate(&metric, b.c, q.a, q.b, &out);
                    if (p != HW_PLACEMENT_OPTIMAL)
                        check_fixed(&rules[i], &q, (hw_placement)p, &out);
                    else if (rules[i].minimises)
                        optima += check_optimum(&rules[i], &q, &out);
                    else
                        assert_true(near(out.cost, rules[i].cost(&q, out.position), out.cost));
                }
                if (p == HW_PLACEMENT_OPTIMAL && rules[i].minimises)
                    assert_true(optima > list.count / 2);
                hw_metric_destroy(&metric);
            }
        hw_free(list.edges);
        free_body(&b);
    }
}

// All that is above, at once: what moves no face costs nothing, whatever the metric of distance.
static void flat_places_cost_nothing(void **state)
{
    (void)state;
    body b = make_body(shape_plane(hw_v3(0, 0, 2), hw_v3(4, 0, 0), hw_v3(0, 4, 0), 4, 4), 0);
    hw_metric_setup setup = setup_of(&b);
    static const char *const names[] = {"uvol", "norm", "hybrid", "quadric", "volume", "qem"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        for (int p = HW_PLACEMENT_MIDPOINT; p <= HW_PLACEMENT_OPTIMAL; p++) {
            hw_metric metric = create(names[i], &setup, (hw_placement)p);
            hw_collapse out;
            hw_metric_evaluate(&metric, b.c, 12, 13, &out); // inner vertices (2, 2) and (3, 2)
            assert_true(out.cost < 1e-6);
            // Where nothing tells the place, it is on the surface and near the edge.
            assert_true(fabs(out.position[2] - 2) < 1e-9);
            assert_true(out.position[0] > 1.999 && out.position[0] < 3.001);
            assert_true(fabs(out.position[1] - 2) < 1e-3);
            hw_metric_destroy(&metric);
        }
    free_body(&b);
}

// The corner of a sheet: a face with two open edges. Cutting it off along one of them moves the
// other, which must cost as much as any border that moves.
static void corners_are_not_cut_for_nothing(void **state)
{
    (void)state;
    body b = make_body(shape_plane(hw_v3(0, 0, 0), hw_v3(3, 0, 0), hw_v3(0, 3, 0), 3, 3), 0);
    hw_metric_setup setup = setup_of(&b);
    static const char *const names[] = {"quadric", "volume", "uvol", "pm", "screen"};
    const uint32_t corner = 3, beside[2] = {2, 7};
    assert_int_equal(hw_collapser_degree(b.c, corner), 1);
    setup.kappa = 1e-6;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        hw_metric metric = create(names[i], &setup, HW_PLACEMENT_MIDPOINT);
        hw_collapse along, cut;
        hw_metric_evaluate(&metric, b.c, 1, 2, &along); // slides on the straight border
        for (int k = 0; k < 4; k++) {
            uint32_t x = k < 2 ? corner : beside[k - 2], y = k < 2 ? beside[k] : corner;
            hw_metric_evaluate(&metric, b.c, x, y, &cut);
            assert_true(cut.cost > 100 * along.cost + 0.1);
        }
        // With free placement the corner stays where it is, or nearly.
        metric.placement = HW_PLACEMENT_OPTIMAL;
        hw_metric_evaluate(&metric, b.c, corner, beside[0], &cut);
        assert_true(distance2(cut.position, b.c->positions[corner]) < 1e-2);
        hw_metric_destroy(&metric);
    }
    free_body(&b);
}

// Springs: kappa scales their part, 0 stands for the default.
static void kappa_is_the_stiffness(void **state)
{
    (void)state;
    body b = make_body(shape_plane(hw_v3(0, 0, 0), hw_v3(4, 0, 0), hw_v3(0, 4, 0), 4, 4), 0);
    hw_metric_setup setup = setup_of(&b);
    const double kappas[] = {0.5, 2, 0};
    for (int i = 0; i < 3; i++) {
        setup.kappa = kappas[i];
        hw_metric metric = create("pm", &setup, HW_PLACEMENT_MIDPOINT);
        hw_collapse out;
        hw_metric_evaluate(&metric, b.c, 12, 13, &out);
        setup.kappa = kappas[i] > 0 ? kappas[i] : HW_PM_KAPPA;
        query q = ask(&setup, 12, 13);
        double expected = pm_formula(&q, q.middle);
        assert_true(expected > 8 * setup.kappa); // eight base points, a unit away and more
        assert_true(near(out.cost, expected, 0));
        hw_metric_destroy(&metric);
    }
    free_body(&b);
}

// On a convex body all is outline, importance is 1 everywhere, and silhouette is quadric.
static void silhouette_is_quadric_on_a_sphere(void **state)
{
    (void)state;
    body b = make_body(sphere(9, 6), 0);
    hw_metric_setup setup = setup_of(&b);
    edge_list list = edges_of(b.c);
    hw_metric metric = create("silhouette", &setup, HW_PLACEMENT_SUBSET);
    for (uint32_t e = 0; e < list.count; e++) {
        hw_collapse out;
        query q = ask(&setup, list.edges[e][0], list.edges[e][1]);
        hw_metric_evaluate(&metric, b.c, q.a, q.b, &out);
        assert_true(near(out.cost, quadric_formula(&q, out.position), out.cost));
    }
    hw_metric_destroy(&metric);
    hw_free(list.edges);
    free_body(&b);
}

// Two spheres, one in the other. The inner one is never an outline: silhouette spends its faces on
// the outer one. To quadric they differ by their size alone.
static uint32_t outer_faces(const char *name)
{
    hw_mesh mesh = sphere(24, 16), inner = shape_sphere(hw_v3(0, 0, 0), 0.95f, 24, 16);
    uint32_t outer_vertices = mesh.vertex_count, faces = 0;
    shape_append(&mesh, &inner);
    body b = make_body(mesh, 0);
    hw_metric_setup setup = setup_of(&b);
    hw_metric metric = create(name, &setup, HW_PLACEMENT_OPTIMAL);
    hw_collapse_limits limits = {.faces = b.c->face_count / 4, .cost = INFINITY};
    assert_int_equal(hw_collapser_run(b.c, &metric, &limits), HW_OK);
    assert_true(b.c->live_faces <= limits.faces);
    for (uint32_t f = 0; f < b.c->face_count; f++)
        faces += b.c->faces[f][0] < outer_vertices;
    hw_metric_destroy(&metric);
    free_body(&b);
    return faces;
}

static void outlines_last_longer(void **state)
{
    (void)state;
    uint32_t with = outer_faces("silhouette"), without = outer_faces("quadric");
    assert_true(with > without + without / 4);
}

// `finish` takes vertices a part of the way back to the original.
static void silhouette_pulls_back(void **state)
{
    (void)state;
    body b = make_body(shape_plane(hw_v3(0, 0, 1), hw_v3(4, 0, 0), hw_v3(0, 4, 0), 4, 4), 0);
    hw_metric_setup setup = setup_of(&b);
    hw_metric metric = create("silhouette", &setup, HW_PLACEMENT_OPTIMAL);
    hw_mesh off = shape_plane(hw_v3(1, 1, 3), hw_v3(2, 0, 0), hw_v3(0, 2, 0), 2, 2);
    assert_non_null(metric.finish);
    assert_int_equal(metric.finish(metric.context, &off), HW_OK);
    for (uint32_t v = 0; v < off.vertex_count; v++) {
        assert_true(fabs((double)off.positions[v].z - (3 - 2 * (double)HW_PULL_BACK)) < 1e-5);
        assert_true(off.positions[v].x >= 0.999f && off.positions[v].x <= 3.001f);
    }
    hw_mesh_free(&off);
    hw_metric_destroy(&metric);
    free_body(&b);
}

// Doubling the pixels makes areas and squared distances fourfold.
static void screen_grows_with_the_picture(void **state)
{
    (void)state;
    body b = make_body(potato(9), 0);
    hw_metric_setup setup = setup_of(&b), twice = setup;
    twice.focal_px *= 2;
    hw_metric one = create("screen", &setup, HW_PLACEMENT_SUBSET),
              two = create("screen", &twice, HW_PLACEMENT_SUBSET);
    edge_list list = edges_of(b.c);
    for (uint32_t e = 0; e < list.count; e++) {
        hw_collapse x, y;
        hw_metric_evaluate(&one, b.c, list.edges[e][0], list.edges[e][1], &x);
        hw_metric_evaluate(&two, b.c, list.edges[e][0], list.edges[e][1], &y);
        assert_true(near(16 * x.cost, y.cost, y.cost));
    }
    hw_free(list.edges);
    hw_metric_destroy(&one);
    hw_metric_destroy(&two);
    free_body(&b);
}

// Thesis 5.2.1 on a whole mesh: (1.5 - n.n)^2 l (w + w), and the vertex of smaller weight goes.
static void viewcell_follows_the_weights(void **state)
{
    (void)state;
    body b = make_body(potato(4), 0);
    edge_list list = edges_of(b.c);
    hw_rng rng = hw_rng_make(8, 8);
    float normals[64][3], image[64][2], weights[64];
    for (uint32_t v = 0; v < b.mesh.vertex_count; v++) {
        memcpy(normals[v], &b.mesh.normals[v], sizeof normals[v]);
        image[v][0] = 100 * hw_rng_float(&rng);
        image[v][1] = 100 * hw_rng_float(&rng);
        weights[v] = hw_rng_float(&rng);
    }
    hw_viewcell_metric context = {(const float(*)[3])normals, (const float(*)[2])image, weights};
    for (int p = HW_PLACEMENT_ENDS; p <= HW_PLACEMENT_OPTIMAL; p++) {
        hw_metric metric = hw_metric_viewcell(&context);
        metric.placement = (hw_placement)p;
        for (uint32_t e = 0; e < 2 * list.count; e++) { // either way round
            uint32_t x = list.edges[e / 2][e % 2], y = list.edges[e / 2][1 - e % 2];
            double turn = 1.5, length = hypot((double)image[x][0] - (double)image[y][0],
                                              (double)image[x][1] - (double)image[y][1]);
            for (int i = 0; i < 3; i++)
                turn -= (double)normals[x][i] * (double)normals[y][i];
            hw_collapse out;
            hw_metric_evaluate(&metric, b.c, x, y, &out);
            assert_true(near(out.cost,
                             turn * turn * length * ((double)weights[x] + (double)weights[y]), 0));
            assert_int_equal(out.removed, weights[x] < weights[y] ? x : y);
            assert_memory_equal(out.position, b.c->positions[out.kept], sizeof out.position);
        }
    }
    hw_free(list.edges);
    free_body(&b);
}

// Collapses with free placement keep the enclosed volume, within rounding.
static double enclosed(const hw_collapser *c)
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

static void volume_keeps_the_volume(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        hw_mesh mesh = i == 2 ? sphere(30, 20) : shape_sphere(hw_v3(0, 0, 0), 1, 24, 16);
        for (uint32_t v = 0; i > 0 && v < mesh.vertex_count; v++) { // waves, an ellipsoid
            hw_vec3 *p = &mesh.positions[v];
            if (i == 1)
                *p = hw_v3_scale(*p, 1 + 0.1f * sinf(4 * p->x) * cosf(3 * p->y));
            else
                p->x *= 2;
        }
        body b = make_body(mesh, 0);
        hw_metric_setup setup = setup_of(&b);
        hw_metric volume = create("volume", &setup, HW_PLACEMENT_OPTIMAL);
        double before = enclosed(b.c);
        hw_collapse_limits limits = {.faces = b.c->face_count / 3, .cost = INFINITY};
        assert_int_equal(hw_collapser_run(b.c, &volume, &limits), HW_OK);
        assert_true(b.c->live_faces <= limits.faces);
        assert_true(fabs(enclosed(b.c) / before - 1) < 1e-9);
        hw_metric_destroy(&volume);
        free_body(&b);
    }
}

// ---- places ----------------------------------------------------------------------------------

static void a_held_end_stays(void **state)
{
    (void)state;
    body b = make_body(potato(5), 0);
    hw_metric_setup setup = setup_of(&b);
    edge_list list = edges_of(b.c);
    for (const hw_metric_kind *kind = hw_metric_kinds; kind->name; kind++)
        for (int p = HW_PLACEMENT_MIDPOINT; p <= HW_PLACEMENT_OPTIMAL; p++) {
            hw_metric metric = create(kind->name, &setup, (hw_placement)p);
            for (uint32_t e = 0; e < list.count; e++) {
                uint32_t x = list.edges[e][0], y = list.edges[e][1], held = e % 2 ? x : y;
                bool *hold = e % 4 < 2 ? b.c->locked : b.c->border; // border against interior
                hw_collapse out;
                hold[held] = true;
                hw_metric_evaluate(&metric, b.c, x, y, &out);
                assert_int_equal(out.kept, held);
                assert_memory_equal(out.position, b.c->positions[held], sizeof out.position);
                assert_true(out.cost < INFINITY);
                b.c->locked[x] = b.c->locked[y] = true;
                hw_metric_evaluate(&metric, b.c, x, y, &out);
                assert_true(out.cost == INFINITY);
                b.c->locked[x] = b.c->locked[y] = b.c->border[held] = false;
            }
            hw_metric_destroy(&metric);
        }
    hw_free(list.edges);
    free_body(&b);
}

static bool no_optimum(void *context, const hw_domain *domain, double x[3])
{
    (void)context;
    (void)domain;
    x[0] = x[1] = x[2] = NAN;
    return false;
}

// Just within reach (two edge lengths from the middle) or just out of it.
static bool far_optimum(void *context, const hw_domain *domain, double x[3])
{
    const double *part = context;
    for (int i = 0; i < 3; i++)
        x[i] = domain->ends[1][i] / 2;
    x[2] += *part * 2 * sqrt(domain->length2);
    return true;
}

static void optimal_falls_back(void **state)
{
    (void)state;
    body b = make_body(potato(6), 0);
    hw_metric_setup setup = setup_of(&b);
    hw_metric subset = create("quadric", &setup, HW_PLACEMENT_SUBSET), metric = subset;
    metric.placement = HW_PLACEMENT_OPTIMAL;
    edge_list list = edges_of(b.c);
    for (uint32_t e = 0; e < list.count; e++) {
        uint32_t x = list.edges[e][0], y = list.edges[e][1];
        hw_collapse want, out;
        hw_metric_evaluate(&subset, b.c, x, y, &want);
        metric.optimum = no_optimum;
        hw_metric_evaluate(&metric, b.c, x, y, &out);
        assert_memory_equal(&out, &want, sizeof out);
    }
    hw_free(list.edges);
    hw_metric_destroy(&subset);
    free_body(&b);

    // Corners on one line: no plane, no optimum.
    hw_mesh line = sphere(5, 4);
    for (uint32_t v = 0; v < line.vertex_count; v++)
        line.positions[v] = hw_v3((float)v, (float)v, 0);
    b = make_body(line, 0);
    setup = setup_of(&b);
    static const char *const names[] = {"quadric", "volume", "qem", "uvol", "edge", "pm"};
    list = edges_of(b.c);
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        metric = create(names[i], &setup, HW_PLACEMENT_OPTIMAL);
        for (uint32_t e = 0; e < list.count; e++) {
            hw_collapse out;
            query q = ask(&setup, list.edges[e][0], list.edges[e][1]);
            hw_metric_evaluate(&metric, b.c, q.a, q.b, &out);
            for (int k = 0; k < 3; k++)
                assert_true(isfinite(out.position[k]));
            assert_true(distance2(out.position, q.middle) <=
                        4.001 * distance2(b.c->positions[q.a], b.c->positions[q.b]));
            if (strcmp(names[i], "pm") != 0) // whose springs know a best place
                assert_true(same_place(out.position, q.middle) ||
                            same_place(out.position, b.c->positions[q.a]) ||
                            same_place(out.position, b.c->positions[q.b]));
        }
        hw_metric_destroy(&metric);
    }
    hw_free(list.edges);
    free_body(&b);
}

static void error_of_reach(void *context, const hw_domain *domain, const hw_candidates *c,
                           double out[HW_CANDIDATES])
{
    (void)context;
    (void)domain;
    for (int i = 0; i < HW_CANDIDATES; i++)
        out[i] = c->end[i] < 0 ? 1 : 2;
}

static void reach_is_two_edge_lengths(void **state)
{
    (void)state;
    body b = make_body(potato(6), 0);
    double part;
    hw_metric metric = {.name = "far",
                        .context = &part,
                        .placement = HW_PLACEMENT_OPTIMAL,
                        .error = error_of_reach,
                        .optimum = far_optimum};
    edge_list list = edges_of(b.c);
    for (uint32_t e = 0; e < list.count; e++) {
        hw_collapse out;
        const double *p = b.c->positions[list.edges[e][0]], *q = b.c->positions[list.edges[e][1]];
        double middle[3] = {(p[0] + q[0]) / 2, (p[1] + q[1]) / 2, (p[2] + q[2]) / 2};
        part = 0.99;
        hw_metric_evaluate(&metric, b.c, list.edges[e][0], list.edges[e][1], &out);
        assert_true(near(distance2(out.position, middle), 0.99 * 0.99 * 4 * distance2(p, q), 0));
        for (part = 1.01; part < 1e6; part *= 1000) {
            hw_metric_evaluate(&metric, b.c, list.edges[e][0], list.edges[e][1], &out);
            assert_true(same_place(out.position, middle));
        }
    }
    hw_free(list.edges);
    free_body(&b);
}

static void either_way_round_costs_the_same(void **state)
{
    (void)state;
    body b = make_body(potato(7), 0);
    hw_metric_setup setup = setup_of(&b);
    edge_list list = edges_of(b.c);
    for (const hw_metric_kind *kind = hw_metric_kinds; kind->name; kind++)
        for (int p = HW_PLACEMENT_MIDPOINT; p <= HW_PLACEMENT_OPTIMAL; p++) {
            hw_metric metric = create(kind->name, &setup, (hw_placement)p);
            for (uint32_t e = 0; e < list.count; e++) {
                hw_collapse x, y;
                hw_metric_evaluate(&metric, b.c, list.edges[e][0], list.edges[e][1], &x);
                hw_metric_evaluate(&metric, b.c, list.edges[e][1], list.edges[e][0], &y);
                assert_true(near(x.cost, y.cost, 1e-3));
            }
            hw_metric_destroy(&metric);
        }
    hw_free(list.edges);
    free_body(&b);
}

// Far from the origin costs and places are the same but for what double precision loses.
static void far_from_the_origin_nothing_changes(void **state)
{
    (void)state;
    const double shift = 1e5;
    body here = make_body(potato(8), 0), there = make_body(potato(8), shift);
    hw_metric_setup setup = setup_of(&here), moved = setup_of(&there);
    moved.eye = hw_v3(3 + 1e5f, 1 + 1e5f, 0.5f + 1e5f); // exact as floats
    edge_list list = edges_of(here.c);
    for (size_t i = 0; i < RULES; i++)
        for (int p = HW_PLACEMENT_MIDPOINT; p <= HW_PLACEMENT_OPTIMAL; p++) {
            hw_metric one = create(rules[i].name, &setup, (hw_placement)p),
                      two = create(rules[i].name, &moved, (hw_placement)p);
            for (uint32_t e = 0; e < list.count; e++) {
                hw_collapse x, y;
                query q = ask(&setup, list.edges[e][0], list.edges[e][1]);
                hw_metric_evaluate(&one, here.c, q.a, q.b, &x);
                hw_metric_evaluate(&two, there.c, q.a, q.b, &y);
                assert_true(near(x.cost, y.cost, rules[i].cost(&q, q.middle)));
                for (int k = 0; k < 3; k++)
                    assert_true(fabs(y.position[k] - shift - x.position[k]) < 1e-6);
            }
            hw_metric_destroy(&one);
            hw_metric_destroy(&two);
        }
    hw_free(list.edges);
    free_body(&here);
    free_body(&there);
}

// ---- the table -------------------------------------------------------------------------------

static void names_are_unique_and_found(void **state)
{
    (void)state;
    uint32_t count = 0;
    for (const hw_metric_kind *kind = hw_metric_kinds; kind->name; kind++, count++) {
        assert_ptr_equal(hw_metric_find(kind->name), kind); // an earlier one would be found
        assert_true(kind->summary && *kind->summary && kind->unit && *kind->unit);
        assert_non_null(kind->create);
    }
    assert_true(count >= 11);
    assert_null(hw_metric_find(""));
    assert_null(hw_metric_find("quadrics"));
    assert_null(hw_metric_find("QUADRIC"));
}

static void eyes_are_asked_for(void **state)
{
    (void)state;
    body b = make_body(sphere(8, 6), 0);
    uint32_t needing = 0;
    for (const hw_metric_kind *kind = hw_metric_kinds; kind->name; kind++) {
        hw_metric_setup blind = setup_of(&b);
        blind.focal_px = 0;
        hw_metric metric;
        hw_status status = hw_metric_create(kind, &blind, &metric);
        assert_int_equal(status, kind->needs_eye ? HW_USAGE : HW_OK);
        if (status != HW_OK)
            assert_null(metric.error);
        needing += kind->needs_eye;
        hw_metric_destroy(&metric);
        hw_metric_destroy(&metric); // zeroed: legal
    }
    assert_true(hw_metric_find("screen")->needs_eye && hw_metric_find("viewcell")->needs_eye);
    assert_int_equal(needing, 2);
    // An eye within the mesh, or one so close that the picture bursts.
    hw_metric metric;
    hw_metric_setup setup = setup_of(&b);
    setup.eye = hw_v3(0.1f, 0, 0);
    assert_int_equal(hw_metric_create(hw_metric_find("viewcell"), &setup, &metric), HW_USAGE);
    setup.eye = hw_v3(3, 0, 0);
    setup.focal_px = 1e7;
    assert_int_equal(hw_metric_create(hw_metric_find("viewcell"), &setup, &metric), HW_USAGE);
    free_body(&b);
}

// Every half-edge has its opposite exactly once; the surface stays a sphere (Euler).
static void assert_closed_sphere(const hw_collapser *c)
{
    uint32_t half_edges = 0;
    for (uint32_t f = 0; f < c->face_count; f++)
        for (int k = 0; c->faces[f][0] != HW_NO_VERTEX && k < 3; k++) {
            uint32_t a = c->faces[f][k], b = c->faces[f][(k + 1) % 3], forward = 0, back = 0;
            assert_int_not_equal(a, b);
            for (uint32_t j = c->first_corner[a]; j != HW_NO_VERTEX; j = hw_next_corner(c, j)) {
                const uint32_t *t = c->faces[j / 4];
                assert_int_equal(t[j % 4], a);
                forward += t[hw_next_place[j % 4]] == b;
                back += t[hw_last_place[j % 4]] == b;
            }
            assert_true(forward == 1 && back == 1);
            half_edges++;
        }
    assert_int_equal(half_edges, 3 * c->live_faces);
    assert_int_equal(c->live_vertices + c->live_faces, half_edges / 2 + 2);
}

static void every_metric_halves_a_sphere(void **state)
{
    (void)state;
    for (const hw_metric_kind *kind = hw_metric_kinds; kind->name; kind++)
        for (int p = HW_PLACEMENT_MIDPOINT; p <= HW_PLACEMENT_OPTIMAL; p++)
            for (int batched = 0; batched < 2; batched++) {
                body b = make_body(sphere(16, 12), 0);
                hw_metric_setup setup = setup_of(&b);
                hw_metric metric = create(kind->name, &setup, (hw_placement)p);
                assert_string_equal(metric.name, kind->name);
                uint32_t before = b.c->live_faces, collapses = 1;
                hw_collapse_limits limits = {.faces = before / 2, .cost = INFINITY};
                if (!batched)
                    assert_int_equal(hw_collapser_run(b.c, &metric, &limits), HW_OK);
                while (batched && collapses > 0)
                    assert_int_equal(hw_collapser_run_batch(b.c, &metric, &limits, &collapses),
                                     HW_OK);
                assert_in_range(b.c->live_faces, limits.faces - 1, limits.faces);
                assert_closed_sphere(b.c);
                assert_true(enclosed(b.c) > 2); // of about 4
                hw_metric_destroy(&metric);
                free_body(&b);
            }
}

static void failing_allocations_leak_nothing(void **state)
{
    (void)state;
    body b = make_body(sphere(8, 6), 0);
    hw_metric_setup setup = setup_of(&b);
    for (const hw_metric_kind *kind = hw_metric_kinds; kind->name; kind++)
        for (uint64_t n = 1;; n++) {
            hw_metric metric;
            hw_alloc_fail_after(n);
            hw_status status = hw_metric_create(kind, &setup, &metric);
            hw_alloc_fail_after(0);
            hw_metric_destroy(&metric);
            if (status == HW_OK)
                break;
            assert_int_equal(status, HW_MEMORY);
        }
    free_body(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(costs_are_the_formulas),
        cmocka_unit_test(flat_places_cost_nothing),
        cmocka_unit_test(corners_are_not_cut_for_nothing),
        cmocka_unit_test(kappa_is_the_stiffness),
        cmocka_unit_test(silhouette_is_quadric_on_a_sphere),
        cmocka_unit_test(outlines_last_longer),
        cmocka_unit_test(silhouette_pulls_back),
        cmocka_unit_test(screen_grows_with_the_picture),
        cmocka_unit_test(viewcell_follows_the_weights),
        cmocka_unit_test(volume_keeps_the_volume),
        cmocka_unit_test(a_held_end_stays),
        cmocka_unit_test(optimal_falls_back),
        cmocka_unit_test(reach_is_two_edge_lengths),
        cmocka_unit_test(either_way_round_costs_the_same),
        cmocka_unit_test(far_from_the_origin_nothing_changes),
        cmocka_unit_test(names_are_unique_and_found),
        cmocka_unit_test(eyes_are_asked_for),
        cmocka_unit_test(every_metric_halves_a_sphere),
        cmocka_unit_test(failing_allocations_leak_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
