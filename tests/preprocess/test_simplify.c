// hw_simplify from beginning to end, on made-up meshes of every kind; what it records gives the
// original back.
#include "shapes.h"

#include "../cells/progressive_checks.h"
#include "metrics.h"
#include "simplify.h"
#include <math.h>

// ---- meshes ----------------------------------------------------------------------------------

static hw_mesh sphere(uint32_t segments, uint32_t rings)
{
    return shape_sphere(hw_v3(0, 0, 0), 1, segments, rings);
}

static hw_mesh torus(void)
{
    hw_mesh mesh, named;
    fixture_surface(&mesh, 14, 11, false, 1);
    must(hw_strdup(&mesh.name, "torus"));
    named = mesh;
    must(HW_NEW(&named.normals, named.vertex_count)); // for shape_append; nobody looks at them
    return named;
}

static hw_mesh grid(uint32_t n)
{
    hw_mesh mesh = shape_plane(hw_v3(5, 0, 0), hw_v3(4, 0, 0), hw_v3(0, 4, 0), n, n);
    hw_rng rng = hw_rng_make(1, n);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        mesh.positions[v].z = 0.3f * hw_rng_float(&rng);
    hw_free(mesh.uvs);
    mesh.uvs = NULL;
    return mesh;
}

static void set_mesh(hw_mesh *mesh, const float (*positions)[3], uint32_t vertices,
                     const uint32_t *indices, uint32_t index_count)
{
    *mesh = shape_alloc(vertices, index_count);
    memcpy(mesh->positions, positions, vertices * sizeof *positions);
    memcpy(mesh->indices, indices, index_count * sizeof *indices);
}

static void add_faces(hw_mesh *mesh, const uint32_t *indices, uint32_t count)
{
    must(HW_RESIZE(&mesh->indices, mesh->index_count + count));
    memcpy(mesh->indices + mesh->index_count, indices, count * sizeof *indices);
    mesh->index_count += count;
}

static const float corners[7][3] = {{0, 0, 0},    {0, 0, 1},     {1, -1, 0.5}, {1, 1, 0.5},
                                    {-1, 1, 0.5}, {-1, -1, 0.5}, {0, 1, -2}};

enum {
    SPHERE,
    TORUS,
    GRID,
    PARTS,
    FIN,         // three faces on an edge
    SHARED_EDGE, // two tetrahedra
    SHARED_VERTEX,
    REPEATED,   // faces twice, and one back to back
    DEGENERATE, // faces with two equal corners, and with corners on a line
    ISOLATED,   // vertices without a face
    TRIANGLE,
    SHAPES
};

static void make_shape(int shape, hw_mesh *mesh)
{
    hw_mesh other;
    switch (shape) {
    case SPHERE:
        *mesh = sphere(14, 9);
        return;
    case TORUS:
        *mesh = torus();
        return;
    case GRID:
        *mesh = grid(9);
        return;
    case PARTS:
        *mesh = sphere(9, 6);
        other = torus();
        shape_append(mesh, &other);
        other = grid(5);
        shape_append(mesh, &other);
        return;
    case FIN: {
        *mesh = grid(6);
        const uint32_t fin[3] = {23, 24, mesh->vertex_count};
        other = shape_alloc(1, 0);
        other.positions[0] = hw_v3(6, 2, 3);
        shape_append(mesh, &other);
        add_faces(mesh, fin, 3);
        return;
    }
    case SHARED_EDGE: {
        const uint32_t faces[24] = {0, 3, 2, 0, 1, 3, 0, 2, 1, 1, 2, 3,
                                    0, 5, 4, 0, 1, 5, 0, 4, 1, 1, 4, 5};
        set_mesh(mesh, corners, 6, faces, 24);
        return;
    }
    case SHARED_VERTEX: {
        const uint32_t faces[24] = {0, 2, 3, 0, 3, 1, 0, 1, 2, 1, 3, 2,
                                    0, 4, 5, 0, 5, 6, 0, 6, 4, 6, 5, 4};
        set_mesh(mesh, corners, 7, faces, 24);
        return;
    }
    case REPEATED: {
        *mesh = sphere(9, 6);
        uint32_t again[15];
        memcpy(again, mesh->indices, 36);
        memcpy(again + 9, mesh->indices, 12); // the first a third time, turned
        uint32_t turned[3] = {again[1], again[2], again[0]};
        memcpy(again + 9, turned, sizeof turned);
        const uint32_t *t = mesh->indices + 60; // and one the other way round
        again[12] = t[0], again[13] = t[2], again[14] = t[1];
        add_faces(mesh, again, 15);
        return;
    }
    case DEGENERATE: {
        *mesh = grid(6);
        for (uint32_t v = 0; v < mesh->vertex_count; v++)
            mesh->positions[v].z = 0;
        const uint32_t faces[12] = {3, 3, 9, 4, 4, 4, 0, 1, 2, 10, 17, 24};
        add_faces(mesh, faces, 12);
        return;
    }
    case ISOLATED:
        *mesh = sphere(9, 6);
        other = shape_alloc(3, 0);
        other.positions[1] = hw_v3(2, 0, 0);
        other.positions[2] = mesh->positions[4]; // welded to one that is used
        shape_append(mesh, &other);
        return;
    default: {
        const uint32_t face[3] = {0, 1, 2};
        set_mesh(mesh, corners, 3, face, 3);
    }
    }
}

static uint32_t face_count(const hw_mesh *mesh)
{
    return mesh->index_count / 3;
}

static void simplify(const hw_mesh *mesh, const hw_simplify_options *o, hw_simplified *out)
{
    hw_status status = hw_simplify(mesh, o, out);
    if (status != HW_OK)
        print_error("%s\n", hw_error_text());
    assert_int_equal(status, HW_OK);
}

static void assert_same_meshes(const hw_mesh *a, const hw_mesh *b)
{
    assert_true(hw_mesh_equal(a, b));
}

// ---- limits ----------------------------------------------------------------------------------

static void limits_are_kept(void **state)
{
    (void)state;
    hw_mesh mesh = sphere(20, 14);
    uint32_t faces = face_count(&mesh);
    for (int batched = 0; batched < 2; batched++)
        for (uint32_t limit = faces - 2; limit > 8; limit /= 2) {
            hw_simplified s;
            hw_simplify_options o = {.faces = limit, .batched = batched};
            simplify(&mesh, &o, &s);
            assert_in_range(face_count(&s.mesh), limit - 1, limit);
            assert_int_equal(s.facts.faces_before, faces);
            assert_int_equal(s.facts.vertices_before, mesh.vertex_count);
            must(hw_mesh_validate(&s.mesh));
            hw_simplified_free(&s);
            o = (hw_simplify_options){.vertices = limit / 2 + 2, .batched = batched};
            simplify(&mesh, &o, &s);
            assert_int_equal(s.mesh.vertex_count, limit / 2 + 2);
            hw_simplified_free(&s);
            // Whichever comes first.
            o = (hw_simplify_options){.vertices = 5, .faces = limit, .batched = batched};
            simplify(&mesh, &o, &s);
            assert_in_range(face_count(&s.mesh), limit - 1, limit);
            hw_simplified_free(&s);
        }
    // More than there are: nothing happens.
    hw_simplified s;
    hw_simplify_options o = {.faces = faces + 100};
    simplify(&mesh, &o, &s);
    assert_same_shape(&s.mesh, &mesh);
    hw_simplified_free(&s);
    hw_mesh_free(&mesh);
}

// By edge length: no edge shorter than the limit is left that could go, none longer went.
static void error_is_in_the_metrics_unit(void **state)
{
    (void)state;
    hw_mesh mesh = shape_plane(hw_v3(0, 0, 0), hw_v3(30, 0, 0), hw_v3(0, 20, 0), 30, 20);
    hw_simplified s;
    hw_simplify_options o = {.stage_count = 1, .stages = {{.metric = hw_metric_find("edge")}}};
    o.error = 0.9; // squared; edges are 1 and sqrt(2) long
    simplify(&mesh, &o, &s);
    assert_same_shape(&s.mesh, &mesh);
    hw_simplified_free(&s);
    uint32_t before = face_count(&mesh);
    for (o.error = 1.1; o.error < 100; o.error *= 4) { // the more may go, the less stays
        simplify(&mesh, &o, &s);
        assert_true(face_count(&s.mesh) < before);
        before = face_count(&s.mesh);
        hw_simplified_free(&s);
    }
    hw_mesh_free(&mesh);
    // Flat: quadric takes all that costs nothing, but the outline stays.
    mesh = shape_plane(hw_v3(0, 0, 0), hw_v3(8, 0, 0), hw_v3(0, 8, 0), 16, 16);
    o = (hw_simplify_options){.error = 1e-4};
    simplify(&mesh, &o, &s);
    assert_true(face_count(&s.mesh) <= 20);
    assert_true(fabs(hw_mesh_area(&s.mesh) - 64) < 0.5);
    hw_simplified_free(&s);
    hw_mesh_free(&mesh);
}

static void senseless_options_are_refused(void **state)
{
    (void)state;
    hw_mesh mesh = sphere(6, 4);
    const hw_metric_kind *edge = hw_metric_find("edge"), *quadric = hw_metric_find("quadric");
    const double shares[][2] = {{0, 0.1},   {-1, 0.1},  {1.5, 0.1}, {NAN, 0.1},
                                {0.5, 0.5}, {0.5, 0.7}, {0.5, 0},   {0.5, NAN}};
    for (size_t i = 0; i < sizeof shares / sizeof *shares; i++) {
        hw_simplified s;
        hw_simplify_options o = {
            .faces = 10,
            .stage_count = 3,
            .stages = {{edge, shares[i][0]}, {quadric, shares[i][1]}, {edge, 0}}};
        assert_int_equal(hw_simplify(&mesh, &o, &s), HW_USAGE);
        assert_null(s.mesh.positions);
    }
    hw_simplified s;
    hw_simplify_options o = {.faces = 10, .stage_count = HW_SIMPLIFY_STAGES_MAX + 1};
    assert_int_equal(hw_simplify(&mesh, &o, &s), HW_USAGE);
    // No eye to look from.
    o = (hw_simplify_options){
        .faces = 10, .stage_count = 1, .stages = {{.metric = hw_metric_find("screen")}}};
    assert_int_equal(hw_simplify(&mesh, &o, &s), HW_USAGE);
    // No mesh.
    o = (hw_simplify_options){.faces = 10};
    uint32_t count = mesh.index_count;
    mesh.index_count = 0;
    assert_int_not_equal(hw_simplify(&mesh, &o, &s), HW_OK);
    mesh.index_count = count;
    mesh.indices[7] = mesh.vertex_count;
    assert_int_not_equal(hw_simplify(&mesh, &o, &s), HW_OK);
    hw_simplified_free(&s);
    hw_mesh_free(&mesh);
}

// ---- stages and batches ----------------------------------------------------------------------

// What the engine makes of the same plan when driven by hand: batches of the metrics in turn.
static void stages_follow_each_other(void **state)
{
    (void)state;
    hw_mesh mesh = sphere(24, 16), want;
    uint32_t faces = face_count(&mesh);
    hw_simplify_options o = {.stage_count = 3,
                             .stages = {{hw_metric_find("edge"), 0.6},
                                        {hw_metric_find("hybrid"), 0.3},
                                        {hw_metric_find("quadric"), 0}},
                             .faces = 60};
    for (o.batched = false;; o.batched = true) {
        hw_collapser *c = NULL;
        must(hw_collapser_from_mesh(&mesh, &c));
        const double until[3] = {0.6, 0.3, 0};
        for (int i = 0; i < 3; i++) {
            hw_metric metric;
            uint32_t share = (uint32_t)(until[i] * faces), collapses = 1;
            hw_collapse_limits limits = {.faces = share > 60 ? share : 60, .cost = INFINITY};
            hw_metric_setup setup = {.collapser = c, .mesh = &mesh};
            must(hw_metric_create(o.stages[i].metric, &setup, &metric));
            hw_collapser_forget_queue(c);
            while (o.batched && collapses > 0)
                must(hw_collapser_run_batch(c, &metric, &limits, &collapses));
            if (!o.batched)
                must(hw_collapser_run(c, &metric, &limits));
            assert_true(c->live_faces <= limits.faces);
            hw_metric_destroy(&metric);
        }
        must(hw_collapser_to_mesh(c, &want));
        hw_simplified s;
        simplify(&mesh, &o, &s);
        assert_same_arrays(&s.mesh, &want);
        hw_simplified_free(&s);
        hw_mesh_free(&want);
        hw_collapser_destroy(c);
        if (o.batched)
            break;
    }
    // A first stage that ends below the limit is all there is.
    hw_simplified s, t;
    o.batched = false;
    o.faces = faces * 7 / 10;
    simplify(&mesh, &o, &s);
    o.stage_count = 1;
    simplify(&mesh, &o, &t);
    assert_same_meshes(&s.mesh, &t.mesh);
    hw_simplified_free(&s);
    hw_simplified_free(&t);
    hw_mesh_free(&mesh);
}

// After each batch the springs are as stiff as kappa times the decay.
static void kappa_decays(void **state)
{
    (void)state;
    hw_mesh mesh = sphere(24, 16), want;
    hw_collapser *c = NULL;
    hw_collapse_limits limits = {.faces = 40, .cost = INFINITY};
    must(hw_collapser_from_mesh(&mesh, &c));
    uint32_t collapses = 1, batches = 0;
    for (double kappa = 2; collapses > 0; kappa *= 0.125) {
        hw_metric metric;
        must(hw_metric_pm(kappa, &metric));
        must(hw_collapser_run_batch(c, &metric, &limits, &collapses));
        batches += collapses > 0;
        hw_metric_destroy(&metric);
    }
    must(hw_collapser_to_mesh(c, &want));
    hw_collapser_destroy(c);
    hw_simplified s, t;
    hw_simplify_options o = {.stage_count = 1,
                             .stages = {{hw_metric_find("pm"), 0}},
                             .kappa = 2,
                             .kappa_decay = 0.125,
                             .faces = 40,
                             .batched = true};
    simplify(&mesh, &o, &s);
    assert_int_equal(s.facts.batches, batches);
    assert_same_arrays(&s.mesh, &want);
    o.kappa_decay = 1;
    simplify(&mesh, &o, &t);
    assert_false(hw_mesh_equal(&s.mesh, &t.mesh)); // it does make a difference
    hw_simplified_free(&t);
    o.kappa_decay = 0; // is 1
    simplify(&mesh, &o, &t);
    o.kappa_decay = 1;
    hw_simplified_free(&s);
    simplify(&mesh, &o, &s);
    assert_same_meshes(&s.mesh, &t.mesh);
    hw_simplified_free(&s);
    hw_simplified_free(&t);
    hw_mesh_free(&want);
    hw_mesh_free(&mesh);
}

typedef struct levels {
    uint32_t calls, fail_at, faces[64];
    hw_mesh last;
} levels;

static hw_status take_level(void *context, uint32_t batch, const hw_mesh *mesh)
{
    levels *l = context;
    assert_int_equal(batch, ++l->calls);
    assert_true(l->calls < 64);
    assert_non_null(mesh->normals);
    must(hw_mesh_validate(mesh));
    l->faces[batch] = face_count(mesh);
    hw_mesh_free(&l->last);
    must(hw_mesh_copy(mesh, &l->last));
    return batch == l->fail_at ? hw_fail(HW_LIMIT, "enough") : HW_OK;
}

static void batches_about_halve_the_faces(void **state)
{
    (void)state;
    hw_mesh mesh = sphere(60, 40);
    for (int p = HW_PLACEMENT_MIDPOINT; p <= HW_PLACEMENT_OPTIMAL; p++) {
        levels l = {.faces = {face_count(&mesh)}};
        hw_simplified s;
        hw_simplify_options o = {.batched = true,
                                 .faces = 100,
                                 .placement_set = true,
                                 .placement = (hw_placement)p,
                                 .level = take_level,
                                 .level_context = &l};
        simplify(&mesh, &o, &s);
        assert_int_equal(l.calls, s.facts.batches);
        assert_true(l.calls >= 4);
        for (uint32_t b = 1; b < l.calls; b++) { // the last one is cut short by the limit
            double ratio = (double)l.faces[b] / l.faces[b - 1];
            assert_true(ratio > 0.4 && ratio < 0.75);
        }
        assert_true(l.faces[l.calls] < l.faces[l.calls - 1]);
        assert_same_arrays(&l.last, &s.mesh);
        hw_mesh_free(&l.last);
        hw_simplified_free(&s);
        // A failure ends the run.
        l = (levels){.fail_at = 2};
        assert_int_equal(hw_simplify(&mesh, &o, &s), HW_LIMIT);
        assert_string_equal(hw_error_text(), "enough");
        assert_int_equal(l.calls, 2);
        assert_null(s.mesh.positions);
        hw_mesh_free(&l.last);
    }
    hw_mesh_free(&mesh);
}

// ---- what is recorded ------------------------------------------------------------------------

static hw_position_grid grid_of(const hw_mesh *mesh, uint32_t bits)
{
    return hw_position_grid_make(hw_mesh_bounds(mesh), bits);
}

// The welded mesh, moved onto the grid.
static void make_reference(const hw_mesh *mesh, const hw_position_grid *g, hw_mesh *out)
{
    must(hw_mesh_weld_positions(mesh, out));
    for (uint32_t v = 0; v < out->vertex_count; v++) {
        hw_vec3 *q = &out->positions[v], before = *q;
        double p[3] = {(double)q->x, (double)q->y, (double)q->z};
        hw_position_grid_snap(g, p);
        *q = hw_v3((float)p[0], (float)p[1], (float)p[2]);
        if (g->lossless) {
            assert_memory_equal(q, &before, sizeof before);
            continue;
        }
        const float from[3] = {before.x, before.y, before.z};
        for (int i = 0; i < 3; i++) {
            double last_place = fabs((double)from[i]) * 0x1p-23;
            assert_true(fabs(p[i] - (double)from[i]) <= g->step / 2 + last_place);
        }
    }
}

static bool same_faces(const hw_mesh *a, const hw_mesh *b)
{
    if (a->index_count != b->index_count)
        return false;
    place_face *x = sorted_faces(a), *y = sorted_faces(b);
    bool same = memcmp(x, y, face_count(a) * sizeof *x) == 0;
    hw_free(x);
    hw_free(y);
    return same;
}

// No vertex is kept or removed twice in a batch.
static void check_independence(const hw_progressive *p)
{
    hw_progressive_info info = hw_progressive_get_info(p);
    uint32_t *batch_of = NULL, sum = 0;
    must(HW_NEW(&batch_of, info.base_vertex_count + info.record_count));
    for (uint32_t b = 0; b < info.batch_count; b++) {
        uint32_t first, count;
        hw_progressive_batch(p, b, &first, &count);
        assert_int_equal(first, sum);
        sum += count;
        for (uint32_t r = first; r < first + count; r++) {
            hw_progressive_record record = hw_progressive_get_record(p, r);
            assert_true(batch_of[record.kept] != b + 1 && batch_of[record.removed] != b + 1);
            batch_of[record.kept] = batch_of[record.removed] = b + 1;
        }
    }
    assert_int_equal(sum, info.batch_count > 0 ? info.record_count : 0);
    hw_free(batch_of);
}

// To random places, by steps and leaps: the same mesh wherever it was met before.
static void walk(hw_progressive *p, const uint64_t *hashes, hw_rng *rng)
{
    uint32_t n = hw_progressive_get_info(p).record_count;
    for (int i = 0; i < 20; i++) {
        uint32_t at = hw_progressive_applied_count(p), to = hw_rng_below(rng, n + 1);
        if (i % 2)
            hw_progressive_go(p, to);
        for (; i % 2 == 0 && at != to; at = hw_progressive_applied_count(p))
            assert_true(at < to ? hw_progressive_refine(p) : hw_progressive_coarsen(p));
        assert_int_equal(hw_progressive_applied_count(p), to);
        assert_true(state_hash(p) == hashes[to]);
    }
}

// The records of each batch, in random order.
static void shuffle_batches(hw_progressive *p, const uint64_t *hashes, hw_rng *rng)
{
    hw_progressive_info info = hw_progressive_get_info(p);
    uint32_t *order = NULL;
    must(HW_NEW(&order, info.record_count));
    for (int down = 0; down < 2; down++)
        for (uint32_t i = 0; i < info.batch_count; i++) {
            uint32_t first, count;
            hw_progressive_batch(p, down ? info.batch_count - 1 - i : i, &first, &count);
            hw_progressive_go(p, down ? first + count : first);
            for (uint32_t k = 0; k < count; k++) {
                uint32_t other = hw_rng_below(rng, k + 1);
                order[k] = order[other];
                order[other] = first + k;
            }
            for (uint32_t k = 0; k < count; k++)
                must(down ? hw_progressive_collapse_record(p, order[k])
                          : hw_progressive_split(p, order[k]));
            assert_true(state_hash(p) == hashes[down ? first : first + count]);
        }
    hw_free(order);
}

static void check_recorded(const hw_mesh *mesh, const hw_simplify_options *options,
                           const hw_simplify_options *again)
{
    hw_simplified s, t;
    hw_mesh reference, got;
    hw_rng rng = hw_rng_make(11, mesh->vertex_count);
    make_reference(mesh, options->grid, &reference);
    simplify(mesh, options, &s);
    assert_non_null(s.progressive);
    hw_progressive_info info = hw_progressive_get_info(s.progressive);
    assert_true(info.complete && info.keep_order == options->keep_order);
    assert_int_equal(hw_progressive_applied_count(s.progressive), info.record_count);
    assert_int_equal(info.batch_count, options->batched ? s.facts.batches : 0);
    must(hw_progressive_extract(s.progressive, &got));
    assert_same_shape(&got, &reference);
    if (options->keep_order)
        assert_same_arrays(&got, &reference);
    hw_mesh_free(&got);
    check_independence(s.progressive);
    uint64_t *hashes = all_hashes(s.progressive);
    walk(s.progressive, hashes, &rng);
    shuffle_batches(s.progressive, hashes, &rng);
    hw_free(hashes);
    // The coarse end is the simplified mesh.
    hw_progressive_go(s.progressive, 0);
    must(hw_progressive_extract(s.progressive, &got));
    if (info.record_count > 0) {
        assert_true(same_faces(&got, &s.mesh));
        assert_true(face_count(&s.mesh) + 1 >= options->faces);
    }
    hw_mesh_free(&got);
    // And a second run gives the same again.
    simplify(mesh, again, &t);
    assert_same_meshes(&s.mesh, &t.mesh);
    must(hw_progressive_extract(t.progressive, &got));
    hw_progressive_go(s.progressive, UINT32_MAX);
    hw_mesh first;
    must(hw_progressive_extract(s.progressive, &first));
    assert_same_arrays(&first, &got);
    hw_mesh_free(&first);
    hw_mesh_free(&got);
    hw_simplified_free(&s);
    hw_simplified_free(&t);
    hw_mesh_free(&reference);
}

static void recorded_meshes_come_back(void **state)
{
    (void)state;
    static const char *const metrics[] = {"quadric", "volume", "hybrid", "edge", "qem", "pm"};
    const uint32_t bits[] = {0, 16, 8};
    uint32_t run = 0;
    for (int shape = 0; shape < SHAPES; shape++) {
        hw_mesh mesh;
        make_shape(shape, &mesh);
        for (int b = 0; b < 3; b++)
            for (int kind = 0; kind < 4; kind++, run++) {
                const hw_position_grid g = grid_of(&mesh, bits[b]);
                hw_simplify_options o = {.stage_count = 1,
                                         .grid = &g,
                                         .batched = kind % 2,
                                         .keep_order = kind / 2,
                                         .threads = 1};
                o.stages[0].metric = hw_metric_find(metrics[run % 6]);
                o.placement_set = run % 5 < 4;
                o.placement = (hw_placement)(run % 5 % 4);
                o.faces = run % 3 ? 0 : face_count(&mesh) / 3;
                hw_simplify_options again = o;
                again.threads = 2;
                check_recorded(&mesh, &o, &again);
            }
        hw_mesh_free(&mesh);
    }
}

// What is not manifold is told.
static void facts_are_facts(void **state)
{
    (void)state;
    hw_simplify_options o = {.faces = 1000};
    for (int shape = 0; shape < SHAPES; shape++) {
        hw_mesh mesh, welded;
        hw_simplified s;
        make_shape(shape, &mesh);
        must(hw_mesh_weld_positions(&mesh, &welded));
        simplify(&mesh, &o, &s);
        assert_int_equal(s.facts.faces_before, face_count(&mesh));
        assert_int_equal(s.facts.vertices_before, welded.vertex_count);
        assert_int_equal(s.facts.batches, 0);
        bool open = shape == GRID || shape == PARTS || shape == FIN || shape == DEGENERATE ||
                    shape == TRIANGLE || shape == REPEATED;
        assert_int_equal(s.facts.border_edges > 0, open);
        if (shape == GRID)
            assert_int_equal(s.facts.border_edges, 4 * 9);
        if (shape == TRIANGLE)
            assert_int_equal(s.facts.border_edges, 3);
        if (shape == SHARED_EDGE)
            assert_int_equal(s.facts.split_vertices, 2);
        if (shape == SHARED_VERTEX)
            assert_int_equal(s.facts.split_vertices, 1);
        if (shape <= PARTS || shape == ISOLATED || shape == TRIANGLE)
            assert_int_equal(s.facts.split_vertices + s.facts.complex_edges + s.facts.dropped_faces,
                             0);
        if (shape == DEGENERATE)
            assert_true(s.facts.dropped_faces >= 2);
        if (shape == FIN)
            assert_true(s.facts.split_vertices + s.facts.complex_edges > 0);
        hw_simplified_free(&s);
        hw_mesh_free(&welded);
        hw_mesh_free(&mesh);
    }
}

// The finished mesh has a name, normals of its own, and colours of the original.
static void finished_meshes_are_whole(void **state)
{
    (void)state;
    hw_mesh mesh = sphere(20, 14);
    must(HW_NEW(&mesh.colors, mesh.vertex_count));
    for (uint32_t v = 0; v < mesh.vertex_count; v++) // north is red, south blue
        mesh.colors[v] =
            mesh.positions[v].z > 0 ? (hw_color8){255, 0, 0, 255} : (hw_color8){0, 0, 255, 255};
    hw_simplified s, t;
    hw_simplify_options o = {.faces = 100, .threads = 1};
    simplify(&mesh, &o, &s);
    assert_string_equal(s.mesh.name, mesh.name);
    assert_null(s.progressive);
    for (uint32_t v = 0; v < s.mesh.vertex_count; v++) {
        hw_vec3 p = s.mesh.positions[v];
        if (p.z > 0.3f)
            assert_true(s.mesh.colors[v].r == 255 && s.mesh.colors[v].b == 0);
        if (p.z < -0.3f)
            assert_true(s.mesh.colors[v].b == 255 && s.mesh.colors[v].r == 0);
        assert_true(hw_v3_dot(s.mesh.normals[v], hw_v3_normalize(p)) > 0.8f);
    }
    hw_simplified_free(&s);
    // With any number of threads.
    static const char *const metrics[] = {"quadric", "silhouette", "viewcell", "screen"};
    for (int i = 0; i < 4; i++) {
        o = (hw_simplify_options){.faces = 100,
                                  .threads = 1,
                                  .stage_count = 1,
                                  .eye = hw_v3(4, 1, 1),
                                  .focal_px = 300,
                                  .stages = {{.metric = hw_metric_find(metrics[i])}}};
        simplify(&mesh, &o, &s);
        o.threads = 2;
        simplify(&mesh, &o, &t);
        assert_same_meshes(&s.mesh, &t.mesh);
        hw_simplified_free(&s);
        hw_simplified_free(&t);
    }
    hw_mesh_free(&mesh);
}

// ---- failures --------------------------------------------------------------------------------

static hw_status count_level(void *context, uint32_t batch, const hw_mesh *mesh)
{
    (void)batch;
    (void)mesh;
    ++*(uint32_t *)context;
    return HW_OK;
}

static void failing_allocations_leak_nothing(void **state)
{
    (void)state;
    static const char *const metrics[] = {"quadric", "silhouette", "viewcell", "pm"};
    const int shapes[] = {SPHERE, FIN, SHARED_VERTEX, PARTS};
    for (int i = 0; i < 4; i++) {
        hw_mesh mesh;
        uint32_t calls = 0;
        make_shape(shapes[i], &mesh);
        must(HW_NEW(&mesh.colors, mesh.vertex_count));
        const hw_position_grid g = grid_of(&mesh, 0);
        hw_simplify_options o = {
            .stage_count = 2,
            .stages = {{hw_metric_find("edge"), 0.8}, {hw_metric_find(metrics[i]), 0}},
            .batched = i % 2,
            .keep_order = i > 1,
            .grid = &g,
            .threads = 1,
            .eye = hw_v3(9, 20, 1),
            .focal_px = 100,
            .kappa_decay = 0.5,
            .level = i % 2 ? count_level : NULL,
            .level_context = &calls};
        uint64_t n = 1;
        for (;; n++) {
            hw_simplified s;
            hw_alloc_fail_after(n);
            hw_status status = hw_simplify(&mesh, &o, &s);
            hw_alloc_fail_after(0);
            if (status == HW_OK) {
                hw_simplified_free(&s);
                break;
            }
            assert_int_equal(status, HW_MEMORY);
            assert_true(!s.mesh.positions && !s.mesh.indices && !s.mesh.name && !s.progressive);
        }
        assert_true(n > 40);
        assert_int_equal(calls > 0, i % 2);
        hw_mesh_free(&mesh);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(limits_are_kept),
        cmocka_unit_test(error_is_in_the_metrics_unit),
        cmocka_unit_test(senseless_options_are_refused),
        cmocka_unit_test(stages_follow_each_other),
        cmocka_unit_test(kappa_decays),
        cmocka_unit_test(batches_about_halve_the_faces),
        cmocka_unit_test(recorded_meshes_come_back),
        cmocka_unit_test(facts_are_facts),
        cmocka_unit_test(finished_meshes_are_whole),
        cmocka_unit_test(failing_allocations_leak_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
