// Where metrics put the vertex of a collapse, whatever they cost it; and the table of metrics.
#include "metric_formulas.h"

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
