// Every metric against its formula, worked out anew from the faces of small made-up meshes, and
// where merged vertices may go.
#include "metric_formulas.h"

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
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
