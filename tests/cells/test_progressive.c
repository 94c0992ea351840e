// clang-format off
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h>
// clang-format on
#include "progressive_checks.h"

static void test_original_comes_back(void **state)
{
    (void)state;
    uint32_t records = 0;
    for (uint32_t i = 0; i < CONFIGURATIONS; i++) {
        hw_mesh original, mesh;
        hw_progressive *p = make_progressive(i, false, &original);
        must(hw_progressive_extract(p, &mesh));
        assert_same_shape(&original, &mesh);
        hw_mesh_free(&mesh);
        hw_progressive_go(p, 0);
        assert_int_equal(hw_progressive_face_count(p),
                         hw_progressive_get_info(p).record_count
                             ? hw_progressive_get_info(p).base_face_count
                             : original.index_count / 3);
        hw_progressive_go(p, UINT32_MAX);
        must(hw_progressive_extract(p, &mesh));
        assert_same_shape(&original, &mesh);
        records += hw_progressive_get_info(p).record_count;
        hw_mesh_free(&mesh);
        hw_mesh_free(&original);
        hw_progressive_destroy(p);
    }
    assert_true(records > 5000);
    hw_progressive_destroy(NULL);
}

static void test_original_arrays_come_back(void **state)
{
    (void)state;
    for (uint32_t i = 0; i < CONFIGURATIONS; i++) {
        hw_mesh original, mesh;
        hw_progressive *p = make_progressive(i, true, &original);
        hw_progressive_go(p, 0);
        hw_progressive_go(p, UINT32_MAX);
        must(hw_progressive_extract(p, &mesh));
        assert_same_arrays(&original, &mesh);
        hw_mesh_free(&mesh);
        hw_mesh_free(&original);
        hw_progressive_destroy(p);
    }
}

// The recorder's own mesh at the end is the base.
static void test_base(void **state)
{
    (void)state;
    for (uint32_t i = 0; i < CONFIGURATIONS; i++) {
        fixture_recorder r;
        fixture_options o = configuration(i);
        hw_mesh original, mesh, base = {0};
        hw_progressive *p = NULL;
        fixture_record(&r, &original, configuration_shape(i), &o);
        must(hw_progressive_create(&p, &r.grid, &r.source, false));
        if (r.source.collapse_count > 0) {
            hw_progressive_go(p, 0);
            must(hw_progressive_extract(p, &mesh));
            must(HW_NEW(&base.positions, r.source.vertex_count));
            must(HW_NEW(&base.indices, 3 * r.source.face_count));
            memcpy(base.positions, r.positions, r.source.vertex_count * sizeof *base.positions);
            for (uint32_t f = 0; f < r.source.face_count; f++)
                for (int k = 0; k < 3 && r.faces[f][0] != UINT32_MAX; k++)
                    base.indices[base.index_count++] = r.faces[f][k];
            assert_int_equal(mesh.index_count, base.index_count);
            place_face *x = sorted_faces(&mesh), *y = sorted_faces(&base);
            assert_memory_equal(x, y, base.index_count / 3 * sizeof *x);
            hw_free(x);
            hw_free(y);
            hw_mesh_free(&mesh);
            hw_mesh_free(&base);
        }
        hw_progressive_destroy(p);
        fixture_recorder_free(&r);
        hw_mesh_free(&original);
    }
}

static void test_walks(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(4, 4);
    for (uint32_t i = 0; i < CONFIGURATIONS; i++) {
        hw_mesh original;
        hw_progressive *p = make_progressive(i, false, &original);
        uint32_t n = hw_progressive_get_info(p).record_count;
        uint64_t *hashes = all_hashes(p);
        for (int step = 0; step < 60; step++) {
            uint32_t at = hw_progressive_applied_count(p), to = hw_rng_below(&rng, n + 1);
            if (step % 4 == 0) {
                assert_int_equal(hw_progressive_refine(p), at < n);
                to = at < n ? at + 1 : at;
            } else if (step % 4 == 1) {
                assert_int_equal(hw_progressive_coarsen(p), at > 0);
                to = at > 0 ? at - 1 : at;
            } else if (step % 4 == 2) {
                hw_progressive_go(p, to);
            } else {
                uint32_t faces = hw_progressive_faces_at(p, to) + 1;
                hw_progressive_go_faces(p, faces);
                uint32_t reached = hw_progressive_applied_count(p);
                assert_true(reached >= to && hw_progressive_face_count(p) <= faces);
                assert_true(reached == n || hw_progressive_faces_at(p, reached + 1) > faces);
                to = reached;
            }
            assert_int_equal(hw_progressive_applied_count(p), to);
            assert_true(state_hash(p) == hashes[to]);
        }
        hw_free(hashes);
        hw_mesh_free(&original);
        hw_progressive_destroy(p);
    }
}

static void shuffle(hw_rng *rng, uint32_t *values, uint32_t count)
{
    for (uint32_t i = count; i > 1; i--) {
        uint32_t k = hw_rng_below(rng, i), v = values[k];
        values[k] = values[i - 1];
        values[i - 1] = v;
    }
}

// Puts the records of a batch into the state that `wanted` tells, in random order.
static void set_records(hw_progressive *p, hw_rng *rng, uint32_t first, uint32_t count,
                        const uint8_t *wanted)
{
    uint32_t *order = NULL;
    must(HW_NEW(&order, count));
    for (uint32_t i = 0; i < count; i++)
        order[i] = i;
    shuffle(rng, order, count);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t record = first + order[i];
        bool is = hw_progressive_is_applied(p, record), want = wanted[order[i]];
        if (is)
            assert_int_equal(hw_progressive_split(p, record), HW_USAGE);
        else
            assert_int_equal(hw_progressive_collapse_record(p, record), HW_USAGE);
        if (want && !is)
            must(hw_progressive_split(p, record));
        if (!want && is)
            must(hw_progressive_collapse_record(p, record));
        assert_int_equal(hw_progressive_is_applied(p, record), want);
    }
    hw_free(order);
}

static void check_batch(hw_progressive *p, hw_rng *rng, const uint64_t *hashes, uint32_t first,
                        uint32_t count)
{
    uint8_t *wanted = NULL;
    must(HW_NEW(&wanted, count));
    hw_progressive_go(p, first);
    memset(wanted, 1, count);
    set_records(p, rng, first, count, wanted);
    assert_true(state_hash(p) == hashes[first + count]);
    memset(wanted, 0, count);
    set_records(p, rng, first, count, wanted);
    assert_true(state_hash(p) == hashes[first]);
    for (int subset = 0; subset < 3; subset++) {
        for (uint32_t i = 0; i < count; i++)
            wanted[i] = hw_rng_below(rng, 2) != 0;
        set_records(p, rng, first, count, wanted);
        uint64_t hash = state_hash(p);
        uint32_t faces = hw_progressive_face_count(p);
        for (uint32_t i = 0; i < count; i++) // by way of another subset
            wanted[i] ^= hw_rng_below(rng, 2) != 0 ? 2 : 0;
        for (uint32_t i = 0; i < count; i++)
            wanted[i] = (uint8_t)((wanted[i] & 1) ^ (wanted[i] >> 1)) | (uint8_t)(wanted[i] << 4);
        uint8_t *other = NULL;
        must(HW_NEW(&other, count));
        for (uint32_t i = 0; i < count; i++) {
            other[i] = wanted[i] & 1;
            wanted[i] = wanted[i] >> 4 & 1;
        }
        set_records(p, rng, first, count, other);
        set_records(p, rng, first, count, wanted);
        assert_true(state_hash(p) == hash);
        assert_int_equal(hw_progressive_face_count(p), faces);
        hw_free(other);
    }
    // Steps and jumps from a subset come back to the order of the file.
    uint32_t to = first + hw_rng_below(rng, count + 1);
    hw_progressive_go(p, to);
    assert_true(state_hash(p) == hashes[to]);
    hw_free(wanted);
}

static void test_any_order_in_a_batch(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(5, 5);
    for (uint32_t i = 0; i < CONFIGURATIONS; i++) {
        hw_mesh original;
        if (!configuration(i).batched)
            continue;
        hw_progressive *p = make_progressive(i, false, &original);
        uint64_t *hashes = all_hashes(p);
        uint32_t n = hw_progressive_get_info(p).record_count, sum = 0;
        for (uint32_t b = 0; b < hw_progressive_get_info(p).batch_count; b++) {
            uint32_t first, count;
            hw_progressive_batch(p, b, &first, &count);
            assert_int_equal(first, sum);
            sum += count;
            check_batch(p, &rng, hashes, first, count);
            // Other batches are out of reach.
            hw_progressive_go(p, first);
            if (first + count < n)
                assert_int_equal(hw_progressive_split(p, first + count), HW_USAGE);
            hw_progressive_go(p, first + count);
            if (first + count < n) {
                must(hw_progressive_split(p, first + count));
                assert_int_equal(hw_progressive_collapse_record(p, first), HW_USAGE);
            }
        }
        assert_int_equal(sum, n);
        assert_int_equal(hw_progressive_split(p, n), HW_USAGE);
        assert_int_equal(hw_progressive_collapse_record(p, n), HW_USAGE);
        hw_free(hashes);
        hw_mesh_free(&original);
        hw_progressive_destroy(p);
    }
}

static void test_strict_order(void **state)
{
    (void)state;
    hw_mesh original;
    hw_progressive *p = make_progressive(0, false, &original);
    uint32_t n = hw_progressive_get_info(p).record_count, first, count;
    assert_int_equal(hw_progressive_get_info(p).batch_count, 0);
    hw_progressive_go(p, n / 2);
    hw_progressive_batch(p, n / 2, &first, &count);
    assert_true(first == n / 2 && count == 1);
    assert_int_equal(hw_progressive_split(p, n / 2 + 1), HW_USAGE);
    assert_int_equal(hw_progressive_collapse_record(p, n / 2 - 2), HW_USAGE);
    must(hw_progressive_split(p, n / 2));
    must(hw_progressive_collapse_record(p, n / 2));
    hw_mesh_free(&original);
    hw_progressive_destroy(p);
}

// --- Sources that contradict themselves ----------------------------------------------------------

#define LIES 20
static void lie(fixture_recorder *r, uint32_t which)
{
    hw_progressive_collapse *c = &r->collapses[3], *last = c + 1;
    hw_progressive_source *s = &r->source;
    uint32_t dead = r->collapses[0].removed;
    switch (which) {
    case 0:
        c->kept = s->vertex_count;
        break;
    case 1:
        c->removed = c->kept;
        break;
    case 2:
        c->removed = dead;
        break;
    case 3:
        c->kept = dead;
        break;
    case 4:
        c->faces[0] = s->face_count;
        break;
    case 5:
        c->faces[1] = c->faces[0];
        break;
    case 6:
        c->faces[0] = r->collapses[0].faces[0];
        break;
    case 7:
        c->face_corners[0][0] = c->face_corners[0][1];
        break;
    case 8:
        c->face_corners[0][0] = dead;
        break;
    case 9:
        r->corners[c->first_corner] = 3 * s->face_count;
        break;
    case 10:
        r->corners[c->first_corner]++;
        break;
    case 11:
        r->corners[c->first_corner] = r->corners[c->first_corner + 1];
        break;
    case 12:
        c->merged[1] += 1;
        break;
    case 13:
        c->kept_before[0] = NAN;
        break;
    case 14:
        c->removed_before[2] = INFINITY;
        break;
    case 15:
        r->batches[0]++;
        break;
    case 16:
        r->batches[0] += r->batches[1];
        r->batches[1] = 0;
        break;
    case 17:
        last->kept = c->kept;
        break; // one batch, the same vertex twice
    case 18:
        s->original_vertex_count--;
        break;
    default:
        r->faces[c->faces[0]][0] = 0; // still there
    }
}

static void test_lies(void **state)
{
    (void)state;
    fixture_options o = {.batched = true, .placement = PLACE_MIDPOINT, .keep = 0.3f, .seed = 1};
    for (uint32_t i = 0; i < LIES; i++) {
        fixture_recorder r;
        hw_mesh original;
        hw_progressive *p = NULL;
        fixture_record(&r, &original, 0, &o);
        lie(&r, i);
        hw_status status = hw_progressive_create(&p, &r.grid, &r.source, true);
        if (status != HW_FORMAT)
            fail_msg("lie %u: %s", i, hw_status_text(status));
        assert_null(p);
        fixture_recorder_free(&r);
        hw_mesh_free(&original);
    }
}

static void test_positions_off_the_grid(void **state)
{
    (void)state;
    fixture_options o = {.bits = 12, .keep = 0.5f, .seed = 1};
    fixture_recorder r;
    hw_mesh original;
    hw_progressive *p = NULL;
    fixture_record(&r, &original, 0, &o);
    r.collapses[2].removed_before[1] += (float)r.grid.step * 0.3f;
    assert_int_equal(hw_progressive_create(&p, &r.grid, &r.source, false), HW_FORMAT);
    r.grid.step = 0;
    assert_int_equal(hw_progressive_create(&p, &r.grid, &r.source, false), HW_FORMAT);
    fixture_recorder_free(&r);
    hw_mesh_free(&original);
}

static void test_torture(void **state)
{
    (void)state;
    fixture_options o = {.batched = true, .keep = 0.3f, .seed = 1};
    fixture_recorder r;
    hw_mesh original, mesh;
    hw_progressive *p = NULL;
    fixture_record(&r, &original, 4, &o);
    for (uint64_t n = 1;; n++) {
        hw_alloc_fail_after(n);
        hw_status status = hw_progressive_create(&p, &r.grid, &r.source, true);
        if (status == HW_OK)
            status = hw_progressive_extract(p, &mesh);
        bool reached = hw_alloc_count() >= n;
        hw_alloc_fail_after(0);
        assert_int_equal(status, reached ? HW_MEMORY : HW_OK);
        hw_progressive_destroy(p);
        if (!reached)
            break;
    }
    hw_mesh_free(&mesh);
    fixture_recorder_free(&r);
    hw_mesh_free(&original);
}

// --- Grids ---------------------------------------------------------------------------------------

static void test_lossless_codes(void **state)
{
    (void)state;
    hw_position_grid grid = hw_position_grid_make(hw_box_empty(), 0);
    const float rising[] = {-1e9f, -1, -1e-44f, -0.0f, 0.0f, 1e-44f, 1e-30f, 1, 1e9f};
    int32_t before = INT32_MIN;
    for (size_t i = 0; i < sizeof rising / sizeof *rising; i++) {
        float p[3] = {rising[i], rising[i], rising[i]}, back[3];
        int32_t code[3];
        hw_position_grid_encode(&grid, p, code);
        hw_position_grid_decode(&grid, code, back);
        assert_memory_equal(p, back, sizeof p);
        assert_true(code[0] > before && hw_position_grid_holds(&grid, p));
        before = code[0];
    }
    const float bad[][3] = {{NAN, 0, 0}, {0, INFINITY, 0}, {0, 0, -1.1e9f}};
    for (int i = 0; i < 3; i++)
        assert_false(hw_position_grid_holds(&grid, bad[i]));
}

static void test_grid_error(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(6, 6);
    const hw_box boxes[] = {{{-1, -2, -3}, {4, 5, 6}},
                            {{1000, 1000, 1000}, {1001, 1000.5f, 1000}},
                            {{0, 0, 0}, {0, 0, 0}},
                            {{5e8f, -9e8f, 0}, {9e8f, -8e8f, 1}}};
    for (uint32_t i = 0; i < 4 * 17 * 200; i++) {
        hw_box box = boxes[i % 4];
        hw_position_grid grid = hw_position_grid_make(box, 8 + i / 4 % 17);
        const float low[3] = {box.min.x, box.min.y, box.min.z};
        const float high[3] = {box.max.x, box.max.y, box.max.z};
        float longest = fmaxf(fmaxf(high[0] - low[0], high[1] - low[1]), high[2] - low[2]);
        double p[3], q[3];
        for (int k = 0; k < 3; k++) // also outside of the box
            p[k] = q[k] = (double)low[k] + (double)(high[k] - low[k]) * (double)hw_rng_float(&rng) +
                          (double)longest * ((double)hw_rng_float(&rng) - 0.5);
        hw_position_grid_snap(&grid, q);
        float snapped[3];
        for (int k = 0; k < 3; k++) {
            snapped[k] = (float)q[k];
            double slack = fabs(p[k]) * 0x1p-23;
            assert_true(fabs(p[k] - q[k]) <= grid.step * 0.5000001 + slack);
        }
        assert_true(hw_position_grid_valid(&grid));
        assert_true(hw_position_grid_holds(&grid, snapped) || longest > 1e8f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_original_comes_back),
        cmocka_unit_test(test_original_arrays_come_back),
        cmocka_unit_test(test_base),
        cmocka_unit_test(test_walks),
        cmocka_unit_test(test_any_order_in_a_batch),
        cmocka_unit_test(test_strict_order),
        cmocka_unit_test(test_lies),
        cmocka_unit_test(test_positions_off_the_grid),
        cmocka_unit_test(test_torture),
        cmocka_unit_test(test_lossless_codes),
        cmocka_unit_test(test_grid_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
