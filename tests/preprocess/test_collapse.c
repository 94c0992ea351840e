// The collapse engine on small meshes whose right answer is known.
#include "alloc.h"
#include "metric.h"
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

typedef struct shape {
    uint32_t vertex_count, face_count;
    double (*positions)[3];
    uint32_t *indices;
} shape;

static void shape_make(shape *s, uint32_t vertices, uint32_t faces)
{
    s->vertex_count = vertices;
    s->face_count = faces;
    assert_int_equal(HW_NEW(&s->positions, vertices), HW_OK);
    assert_int_equal(HW_NEW(&s->indices, 3 * (size_t)faces), HW_OK);
}

static void shape_free(shape *s)
{
    hw_free(s->positions);
    hw_free(s->indices);
}

// A sphere of rings x sectors quads, poles included; closed, outward.
static shape sphere(uint32_t rings, uint32_t sectors)
{
    shape s;
    shape_make(&s, (rings - 1) * sectors + 2, 2 * sectors * (rings - 1));
    uint32_t south = s.vertex_count - 2, north = s.vertex_count - 1, n = 0;
    for (uint32_t r = 1; r < rings; r++)
        for (uint32_t k = 0; k < sectors; k++) {
            double theta = M_PI * r / rings, phi = 2 * M_PI * k / sectors;
            double *p = s.positions[(r - 1) * sectors + k];
            p[0] = sin(theta) * cos(phi);
            p[1] = sin(theta) * sin(phi);
            p[2] = -cos(theta);
        }
    s.positions[south][2] = -1;
    s.positions[north][2] = 1;
    for (uint32_t k = 0; k < sectors; k++) {
        uint32_t next = (k + 1) % sectors, top = (rings - 2) * sectors;
        const uint32_t caps[6] = {south, next, k, north, top + k, top + next};
        memcpy(s.indices + n, caps, sizeof caps);
        n += 6;
        for (uint32_t r = 0; r + 2 < rings; r++) {
            uint32_t a = r * sectors + k, b = r * sectors + next, c = a + sectors, d = b + sectors;
            const uint32_t quad[6] = {a, b, d, a, d, c};
            memcpy(s.indices + n, quad, sizeof quad);
            n += 6;
        }
    }
    assert_int_equal(n, 3 * s.face_count);
    return s;
}

// A flat n x n grid of quads in z = 0, open.
static shape grid(uint32_t n)
{
    shape s;
    shape_make(&s, (n + 1) * (n + 1), 2 * n * n);
    for (uint32_t j = 0; j <= n; j++)
        for (uint32_t i = 0; i <= n; i++) {
            s.positions[j * (n + 1) + i][0] = i;
            s.positions[j * (n + 1) + i][1] = j;
        }
    uint32_t k = 0;
    for (uint32_t j = 0; j < n; j++)
        for (uint32_t i = 0; i < n; i++) {
            uint32_t a = j * (n + 1) + i, b = a + 1, c = a + n + 1, d = c + 1;
            const uint32_t quad[6] = {a, b, d, a, d, c};
            memcpy(s.indices + k, quad, sizeof quad);
            k += 6;
        }
    return s;
}

static hw_collapser *create(const shape *s, const bool *locked)
{
    hw_collapser *c = NULL;
    assert_int_equal(hw_collapser_create((const double(*)[3])s->positions, s->vertex_count,
                                         s->indices, s->face_count, locked, HW_COMPLEX_LOCK, &c),
                     HW_OK);
    return c;
}

static void run(hw_collapser *c, hw_metric metric, uint32_t faces, double cost)
{
    hw_collapse_limits limits = {.faces = faces, .cost = cost};
    assert_int_equal(hw_collapser_run(c, &metric, &limits), HW_OK);
}

static double volume(const hw_collapser *c)
{
    double sum = 0;
    for (uint32_t f = 0; f < c->face_count; f++) {
        const uint32_t *t = c->faces[f];
        if (t[0] == HW_NO_VERTEX)
            continue;
        const double *a = c->positions[t[0]], *b = c->positions[t[1]], *d = c->positions[t[2]];
        sum += a[0] * (b[1] * d[2] - b[2] * d[1]) + a[1] * (b[2] * d[0] - b[0] * d[2]) +
               a[2] * (b[0] * d[1] - b[1] * d[0]);
    }
    return sum / 6;
}

static double area(const hw_collapser *c)
{
    double sum = 0;
    for (uint32_t f = 0; f < c->face_count; f++) {
        const uint32_t *t = c->faces[f];
        if (t[0] == HW_NO_VERTEX)
            continue;
        const double *a = c->positions[t[0]], *b = c->positions[t[1]], *d = c->positions[t[2]];
        double n[3];
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, k = (i + 2) % 3;
            n[i] = (b[j] - a[j]) * (d[k] - a[k]) - (b[k] - a[k]) * (d[j] - a[j]);
        }
        sum += sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) / 2;
    }
    return sum;
}

// Every edge of a closed manifold has exactly one face on each side.
static void assert_closed_manifold(const hw_collapser *c)
{
    for (uint32_t f = 0; f < c->face_count; f++) {
        const uint32_t *t = c->faces[f];
        for (int i = 0; t[0] != HW_NO_VERTEX && i < 3; i++) {
            uint32_t forward = 0, back = 0;
            for (uint32_t g = 0; g < c->face_count; g++) {
                const uint32_t *u = c->faces[g];
                for (int k = 0; u[0] != HW_NO_VERTEX && k < 3; k++) {
                    forward += u[k] == t[i] && u[(k + 1) % 3] == t[(i + 1) % 3];
                    back += u[k] == t[(i + 1) % 3] && u[(k + 1) % 3] == t[i];
                }
            }
            assert_int_equal(forward, 1);
            assert_int_equal(back, 1);
        }
    }
}

static void sphere_stays_closed_and_round(void **state)
{
    (void)state;
    shape s = sphere(40, 60);
    hw_collapser *c = create(&s, NULL);
    double before = volume(c);
    run(c, hw_metric_quadric(NULL), 400, INFINITY);
    assert_in_range(c->live_faces, 398, 400);
    assert_closed_manifold(c);
    assert_true(fabs(volume(c) / before - 1) < 0.01);
    for (uint32_t v = 0; v < c->vertex_count; v++)
        if (c->first_corner[v] != HW_NO_VERTEX) {
            const double *p = c->positions[v];
            assert_true(fabs(sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) - 1) < 0.03);
        }
    // On to the end: a closed surface never vanishes.
    run(c, hw_metric_quadric(NULL), 0, INFINITY);
    assert_true(c->live_faces >= 4);
    assert_closed_manifold(c);
    hw_collapser_destroy(c);
    shape_free(&s);
}

static void going_down_in_steps_is_going_down_at_once(void **state)
{
    (void)state;
    shape s = sphere(20, 30);
    hw_collapser *a = create(&s, NULL), *b = create(&s, NULL);
    for (uint32_t faces = 1000; faces >= 200; faces -= 100)
        run(a, hw_metric_quadric(NULL), faces, INFINITY);
    run(b, hw_metric_quadric(NULL), 200, INFINITY);
    assert_int_equal(a->live_faces, b->live_faces);
    assert_memory_equal(a->faces, b->faces, a->face_count * sizeof *a->faces);
    assert_memory_equal(a->positions, b->positions, a->vertex_count * sizeof *a->positions);
    hw_collapser_destroy(a);
    hw_collapser_destroy(b);
    shape_free(&s);
}

static void flat_grid_keeps_its_outline(void **state)
{
    (void)state;
    shape s = grid(12);
    hw_collapser *c = create(&s, NULL);
    run(c, hw_metric_quadric(NULL), 0, 1e-3);
    assert_true(c->live_faces <= 20); // flat, so that a handful of faces is enough for a square
    assert_true(fabs(area(c) - 144) < 0.05);
    hw_collapser_destroy(c);
    shape_free(&s);
}

static void locked_vertices_stay(void **state)
{
    (void)state;
    shape s = grid(10);
    bool locked[121] = {0};
    for (int i = 0; i < 121; i++)
        locked[i] = i % 11 == 0 || i % 11 == 10 || i < 11 || i >= 110;
    hw_collapser *c = create(&s, locked);
    hw_metric qem;
    assert_int_equal(hw_metric_qem(c, &qem), HW_OK);
    run(c, qem, 0, 1e-9);
    assert_int_equal(c->live_faces, 38); // 40 border vertices and no other: n - 2 faces
    for (int i = 0; i < 121; i++)
        if (locked[i]) {
            assert_true(c->first_corner[i] != HW_NO_VERTEX);
            assert_memory_equal(c->positions[i], s.positions[i], sizeof s.positions[i]);
        }
    assert_true(fabs(area(c) - 100) < 1e-9);
    hw_metric_destroy(&qem);
    hw_collapser_destroy(c);
    shape_free(&s);
}

// sqrt(cost) of the remembering metric is a distance: a bump lower than the tolerance goes, a
// higher one stays.
static void tolerance_is_a_distance(void **state)
{
    (void)state;
    for (int high = 0; high < 2; high++) {
        shape s = grid(10);
        s.positions[60][2] = high ? 4 : 0.2;
        bool locked[121] = {0};
        for (int i = 0; i < 121; i++)
            locked[i] = i % 11 == 0 || i % 11 == 10 || i < 11 || i >= 110;
        hw_collapser *c = create(&s, locked);
        hw_metric qem;
        assert_int_equal(hw_metric_qem(c, &qem), HW_OK);
        run(c, qem, 0, 0.5 * 0.5);
        double top = 0;
        for (uint32_t v = 0; v < 121; v++)
            if (c->first_corner[v] != HW_NO_VERTEX)
                top = fmax(top, c->positions[v][2]);
        if (high)
            assert_true(top > 3);
        else
            assert_true(top < 0.2);
        hw_metric_destroy(&qem);
        hw_collapser_destroy(c);
        shape_free(&s);
    }
}

// An L of relief with its border held: with `upright` its projection covers the L and nothing else,
// whatever the relief invites to.
static void upright_patches_do_not_fold(void **state)
{
    (void)state;
    shape s = grid(10);
    uint32_t kept = 0;
    for (uint32_t f = 0; f < s.face_count; f++) { // drop the upper right quarter
        const uint32_t *t = s.indices + 3 * f;
        double x = 0, y = 0;
        for (int k = 0; k < 3; k++) {
            x += s.positions[t[k]][0] / 3;
            y += s.positions[t[k]][1] / 3;
        }
        if (x > 4 && y > 4)
            continue;
        memmove(s.indices + 3 * kept++, t, 3 * sizeof *t);
    }
    s.face_count = kept;
    bool locked[121] = {0};
    for (int i = 0; i < 121; i++) {
        double x = s.positions[i][0], y = s.positions[i][1];
        locked[i] = x == 0 || y == 0 || x == 10 || y == 10 || (x >= 4 && y >= 4);
        s.positions[i][2] = 30 * sin(x * 1.7) * cos(y * 1.3);
    }
    hw_collapser *c = create(&s, locked);
    hw_metric qem;
    assert_int_equal(hw_metric_qem(c, &qem), HW_OK);
    c->upright = true;
    run(c, qem, 0, 1e6);
    assert_true(c->live_faces < kept);
    double covered = 0;
    for (uint32_t f = 0; f < c->face_count; f++) {
        const uint32_t *t = c->faces[f];
        if (t[0] == HW_NO_VERTEX)
            continue;
        const double *a = c->positions[t[0]], *b = c->positions[t[1]], *d = c->positions[t[2]];
        double area2 = (b[0] - a[0]) * (d[1] - a[1]) - (b[1] - a[1]) * (d[0] - a[0]);
        assert_true(area2 > 0);
        covered += area2 / 2;
    }
    assert_true(fabs(covered - 64) < 1e-6);
    hw_metric_destroy(&qem);
    hw_collapser_destroy(c);
    shape_free(&s);
}

// Thesis 5.2.1: cost (1.5 - n.n)^2 l (w + w), and the vertex of smaller weight goes.
static void viewcell_cost_is_the_formula(void **state)
{
    (void)state;
    const float normals[2][3] = {{0, 0, 1}, {0, 0.6f, 0.8f}}, image[2][2] = {{0, 0}, {3, 4}};
    const float weights[2] = {0.125f, 0.5f};
    double positions[2][3] = {{1, 2, 3}, {4, 5, 6}};
    bool locked[2] = {0}, border[2] = {0};
    hw_viewcell_metric context = {normals, image, weights};
    hw_metric metric = hw_metric_viewcell(&context);
    hw_collapser c = {
        .vertex_count = 2, .positions = positions, .locked = locked, .border = border};
    hw_collapse out;
    hw_metric_evaluate(&metric, &c, 0, 1, &out);
    assert_true(fabs(out.cost - 0.7 * 0.7 * 5 * 0.625) < 1e-6);
    assert_int_equal(out.kept, 1);
    assert_memory_equal(out.position, positions[1], sizeof out.position);
}

// The same over several views: the largest projected length counts, and both ends must be seen by a
// common view or by none.
static void multiview_collapses_what_is_seen_together(void **state)
{
    (void)state;
    const float normals[2][3] = {{0, 0, 1}, {0, 0.6f, 0.8f}};
    const float images[2][2][2] = {{{0, 0}, {3, 4}}, {{1, 0}, {1, 12}}};
    const float weights[2] = {0.125f, 0.5f};
    double positions[2][3] = {{1, 2, 3}, {4, 5, 6}};
    bool locked[2] = {0}, border[2] = {0};
    hw_collapser c = {
        .vertex_count = 2, .positions = positions, .locked = locked, .border = border};
    static const struct {
        uint32_t sets[2];
        bool allowed;
    } cases[] = {{{1, 1}, true}, {{3, 2}, true}, {{0, 0}, true}, {{1, 2}, false}, {{0, 2}, false}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        hw_multiview_metric context = {.base = {normals, images[0], weights},
                                       .images = {images[0], images[1]},
                                       .view_count = 2,
                                       .sets = cases[i].sets};
        hw_metric metric = hw_metric_multiview(&context);
        hw_collapse out;
        hw_metric_evaluate(&metric, &c, 0, 1, &out);
        if (cases[i].allowed) {
            assert_true(fabs(out.cost - 0.7 * 0.7 * 12 * 0.625) < 1e-6);
            assert_int_equal(out.kept, 1);
        } else {
            assert_true(out.cost == (double)INFINITY);
        }
    }
}

static void hostile_meshes_are_survived(void **state)
{
    (void)state;
    // A fin on an edge of three faces, a face out of range, a degenerate one, a duplicate, an
    // isolated vertex.
    double positions[7][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0},
                              {0, 0, 1}, {5, 5, 5}, {1, 1, 0}};
    const uint32_t indices[] = {0, 1, 2, 1, 0, 3, 0, 1, 4, 0, 1, 99, 2, 2, 1, 0, 1, 2, 1, 6, 2};
    hw_collapser *c = NULL;
    assert_int_equal(hw_collapser_create((const double(*)[3])positions, 7, indices, 7, NULL,
                                         HW_COMPLEX_LOCK, &c),
                     HW_OK);
    assert_int_equal(c->live_faces, 5);
    assert_true(c->locked[0] && c->locked[1]);
    run(c, hw_metric_quadric(NULL), 0, INFINITY);
    uint32_t vertices[7], out[21];
    uint32_t n = hw_collapser_extract(c, vertices, out);
    for (uint32_t i = 0; i < 3 * c->live_faces; i++)
        assert_true(out[i] < n);
    hw_collapser_destroy(c);

    assert_int_equal(hw_collapser_create((const double(*)[3])positions, 0, indices, 0, NULL,
                                         HW_COMPLEX_SPLIT, &c),
                     HW_OK);
    run(c, hw_metric_quadric(NULL), 0, INFINITY);
    hw_collapser_destroy(c);
}

// Two tetrahedra that touch along an edge (four faces on it) come apart into two closed ones; one
// vertex shared by two tetrahedra too.
static void touching_sheets_are_split(void **state)
{
    (void)state;
    double positions[7][3] = {{0, 0, 0},    {0, 0, 1},     {1, -1, 0.5}, {1, 1, 0.5},
                              {-1, 1, 0.5}, {-1, -1, 0.5}, {0, 0, 0}};
    const uint32_t edge[] = {0, 3, 2, 0, 1, 3, 0, 2, 1, 1, 2, 3,
                             0, 5, 4, 0, 1, 5, 0, 4, 1, 1, 4, 5};
    hw_collapser *c = NULL;
    assert_int_equal(
        hw_collapser_create((const double(*)[3])positions, 7, edge, 8, NULL, HW_COMPLEX_SPLIT, &c),
        HW_OK);
    assert_int_equal(c->vertex_count, 9); // both ends of the edge are doubled
    assert_closed_manifold(c);
    for (uint32_t v = 0; v < c->vertex_count; v++)
        assert_false(c->locked[v]);
    // Each tetrahedron kept its four vertices to itself.
    for (uint32_t f = 0; f < 4; f++)
        for (uint32_t g = 4; g < 8; g++)
            for (int k = 0; k < 9; k++)
                assert_int_not_equal(c->faces[f][k / 3], c->faces[g][k % 3]);
    hw_collapser_destroy(c);
    assert_int_equal(
        hw_collapser_create((const double(*)[3])positions, 7, edge, 8, NULL, HW_COMPLEX_LOCK, &c),
        HW_OK);
    assert_true(c->locked[0] && c->locked[1] && !c->locked[2]);
    hw_collapser_destroy(c);

    const uint32_t point[] = {0, 2, 3, 0, 3, 1, 0, 1, 2, 1, 3, 2,
                              0, 4, 5, 0, 5, 6, 0, 6, 4, 6, 5, 4};
    assert_int_equal(
        hw_collapser_create((const double(*)[3])positions, 7, point, 8, NULL, HW_COMPLEX_SPLIT, &c),
        HW_OK);
    assert_int_equal(c->vertex_count, 8);
    assert_int_equal(c->source[7], 0);
    hw_collapser_destroy(c);
}

// A triangle split at its middle, and one more beside it: the edge from the middle to a corner has
// the counts of a tetrahedron's, but the patch is open and must stay when the middle goes.
static void open_patches_stay(void **state)
{
    (void)state;
    shape s;
    shape_make(&s, 10, 8);
    const double positions[5][3] = {{0, 0, 0}, {3, 0, 0}, {0, 3, 0}, {1, 1, 0}, {3, -3, 0}};
    const uint32_t faces[12] = {3, 0, 1, 3, 1, 2, 3, 2, 0, 0, 4, 1};
    bool locked[10];
    for (uint32_t i = 0; i < 10; i++) { // two of them, one above the other
        memcpy(s.positions[i], positions[i % 5], sizeof positions[0]);
        s.positions[i][2] = i / 5;
        locked[i] = i % 5 != 3;
    }
    for (uint32_t i = 0; i < 24; i++)
        s.indices[i] = faces[i % 12] + i / 12 * 5;
    hw_collapser *c = create(&s, locked);
    hw_metric qem;
    assert_int_equal(hw_metric_qem(c, &qem), HW_OK);
    run(c, qem, 0, INFINITY);
    assert_int_equal(c->live_faces, 4);
    assert_true(fabs(area(c) - 18) < 1e-9);
    hw_metric_destroy(&qem);
    hw_collapser_destroy(c);
    shape_free(&s);
}

// A speck beside a sphere vanishes first; a pair of faces back to back is nothing.
static void specks_and_flaps_vanish(void **state)
{
    (void)state;
    shape s = sphere(20, 30), t;
    shape_make(&t, s.vertex_count + 4, s.face_count + 6);
    memcpy(t.positions, s.positions, s.vertex_count * sizeof *s.positions);
    memcpy(t.indices, s.indices, 3 * (size_t)s.face_count * sizeof *s.indices);
    const double speck[4][3] = {{3, 0, 0}, {3.001, 0, 0}, {3, 0.001, 0}, {3, 0, 0.001}};
    memcpy(t.positions + s.vertex_count, speck, sizeof speck);
    const uint32_t faces[18] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3, 0, 1, 2, 0, 2, 1};
    for (int i = 0; i < 18; i++)
        t.indices[3 * s.face_count + i] = s.vertex_count + faces[i];
    hw_collapser *c = create(&t, NULL);
    assert_true(c->locked[s.vertex_count]); // kept as it is: the flap makes complex edges
    hw_collapser_destroy(c);
    assert_int_equal(hw_collapser_create((const double(*)[3])t.positions, t.vertex_count, t.indices,
                                         t.face_count, NULL, HW_COMPLEX_SPLIT, &c),
                     HW_OK);
    assert_int_equal(c->live_faces, s.face_count + 4);
    run(c, hw_metric_quadric(NULL), s.face_count, INFINITY);
    assert_int_equal(c->live_faces, s.face_count);
    assert_int_equal(c->first_corner[s.vertex_count], HW_NO_VERTEX);
    assert_closed_manifold(c);
    hw_collapser_destroy(c);
    shape_free(&t);
    shape_free(&s);
}

static void failing_allocations_leak_nothing(void **state)
{
    (void)state;
    shape s = sphere(6, 8);
    for (uint64_t n = 1;; n++) {
        hw_collapser *c = NULL;
        hw_alloc_fail_after(n);
        hw_status status = hw_collapser_create((const double(*)[3])s.positions, s.vertex_count,
                                               s.indices, s.face_count, NULL, HW_COMPLEX_SPLIT, &c);
        hw_metric metric = hw_metric_quadric(NULL);
        hw_collapse_limits limits = {.faces = 10, .cost = INFINITY};
        if (status == HW_OK)
            status = hw_collapser_run(c, &metric, &limits);
        hw_alloc_fail_after(0);
        hw_collapser_destroy(c);
        if (status == HW_OK)
            break;
        assert_int_equal(status, HW_MEMORY);
    }
    shape_free(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sphere_stays_closed_and_round),
        cmocka_unit_test(going_down_in_steps_is_going_down_at_once),
        cmocka_unit_test(flat_grid_keeps_its_outline),
        cmocka_unit_test(locked_vertices_stay),
        cmocka_unit_test(tolerance_is_a_distance),
        cmocka_unit_test(upright_patches_do_not_fold),
        cmocka_unit_test(viewcell_cost_is_the_formula),
        cmocka_unit_test(multiview_collapses_what_is_seen_together),
        cmocka_unit_test(hostile_meshes_are_survived),
        cmocka_unit_test(touching_sheets_are_split),
        cmocka_unit_test(open_patches_stay),
        cmocka_unit_test(specks_and_flaps_vanish),
        cmocka_unit_test(failing_allocations_leak_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
