// The queue of collapses against a plain list that is searched anew each time.
#include "alloc.h"
#include "collapse_queue.h"
#include "rng.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static hw_collapse_queue *create(uint32_t vertices, uint32_t edges)
{
    hw_collapse_queue *q = NULL;
    assert_int_equal(hw_collapse_queue_create(vertices, &q), HW_OK);
    assert_int_equal(hw_collapse_queue_reset(q, edges), HW_OK);
    return q;
}

static void push(hw_collapse_queue *q, uint32_t a, uint32_t b, double cost)
{
    assert_int_equal(hw_collapse_queue_push(q, hw_collapse_queue_entry(q, a, b, cost)), HW_OK);
}

// By cost, then by the vertices.
static int compare(const void *x, const void *y)
{
    const hw_queue_entry *a = x, *b = y;
    if (a->cost != b->cost)
        return a->cost < b->cost ? -1 : 1;
    if (a->a != b->a)
        return a->a < b->a ? -1 : 1;
    return a->b < b->b ? -1 : a->b > b->b;
}

static void assert_same_entry(const hw_queue_entry *x, const hw_queue_entry *y)
{
    assert_true(x->cost == y->cost);
    assert_int_equal(x->a, y->a);
    assert_int_equal(x->b, y->b);
}

static hw_queue_entry random_entry(hw_rng *rng, const hw_collapse_queue *q)
{
    uint32_t a = hw_rng_below(rng, q->vertex_count - 1);
    uint32_t b = a + 1 + hw_rng_below(rng, q->vertex_count - 1 - a);
    return hw_collapse_queue_entry(q, b, a, hw_rng_below(rng, 50)); // few costs: many ties
}

static void pops_come_in_order(void **state)
{
    (void)state;
    enum { MOST = 3000 };
    hw_collapse_queue *q = create(200, MOST);
    hw_queue_entry *model = NULL;
    uint32_t count = 0, pops = 0;
    hw_rng rng = hw_rng_make(1, 2);
    assert_int_equal(HW_NEW(&model, MOST), HW_OK);
    for (int step = 0; step < 20000; step++) {
        bool grow = hw_rng_below(&rng, 1000) < (step % 8000 < 4000 ? 600u : 400u);
        if (grow && count < MOST) {
            model[count] = random_entry(&rng, q);
            assert_true(model[count].a < model[count].b);
            assert_int_equal(hw_collapse_queue_push(q, model[count++]), HW_OK);
        } else if (count > 0) {
            uint32_t least = 0;
            for (uint32_t i = 1; i < count; i++)
                if (compare(&model[i], &model[least]) < 0)
                    least = i;
            hw_queue_entry top = hw_collapse_queue_pop(q);
            assert_same_entry(&top, &model[least]);
            model[least] = model[--count];
            pops++;
        }
        assert_int_equal(q->count, count);
    }
    assert_true(pops > 5000);
    hw_free(model);
    hw_collapse_queue_destroy(q);
}

// Entries that were appended and ordered, and some pushed later, come out sorted; equal costs in
// the order of the vertices, whatever order they came in.
static void appended_entries_are_ordered(void **state)
{
    (void)state;
    for (uint32_t n = 0; n < 300; n = n * 2 + 1) {
        hw_collapse_queue *q = create(100, n + 5);
        hw_queue_entry *model = NULL;
        hw_rng rng = hw_rng_make(3, n);
        assert_int_equal(HW_NEW(&model, n + 5), HW_OK);
        for (uint32_t i = 0; i < n + 5; i++)
            model[i] = random_entry(&rng, q);
        for (uint32_t i = 0; i < n; i++)
            hw_collapse_queue_append(q, model[i]);
        hw_collapse_queue_order(q);
        for (uint32_t i = n; i < n + 5; i++)
            assert_int_equal(hw_collapse_queue_push(q, model[i]), HW_OK);
        qsort(model, n + 5, sizeof *model, compare);
        for (uint32_t i = 0; i < n + 5; i++) {
            hw_queue_entry top = hw_collapse_queue_pop(q);
            assert_same_entry(&top, &model[i]);
        }
        assert_int_equal(q->count, 0);
        hw_free(model);
        hw_collapse_queue_destroy(q);
    }
}

static void old_and_touched_entries_are_known(void **state)
{
    (void)state;
    hw_collapse_queue *q = create(10, 10);
    hw_queue_entry e = hw_collapse_queue_entry(q, 3, 7, 1);
    assert_false(hw_collapse_queue_is_old(q, &e) || hw_collapse_queue_is_touched(q, &e));
    q->generation[5]++;
    q->touched[5]++; // of neither end
    assert_false(hw_collapse_queue_is_old(q, &e) || hw_collapse_queue_is_touched(q, &e));
    q->touched[7]++;
    assert_true(hw_collapse_queue_is_touched(q, &e) && !hw_collapse_queue_is_old(q, &e));
    e = hw_collapse_queue_entry(q, 7, 3, 1);
    assert_false(hw_collapse_queue_is_touched(q, &e));
    q->generation[3]++;
    assert_true(hw_collapse_queue_is_old(q, &e) && !hw_collapse_queue_is_touched(q, &e));
    // Counters wrap round: the sums still match.
    q->generation[3] = q->generation[7] = q->touched[3] = q->touched[7] = UINT16_MAX;
    e = hw_collapse_queue_entry(q, 3, 7, 1);
    assert_false(hw_collapse_queue_is_old(q, &e) || hw_collapse_queue_is_touched(q, &e));
    q->generation[3]++;
    q->touched[7]++;
    assert_true(hw_collapse_queue_is_old(q, &e) && hw_collapse_queue_is_touched(q, &e));
    hw_collapse_queue_destroy(q);
}

// Vertices in a ring, an edge from each to the next. A vertex is merged again and again: its two
// edges get new entries, the old ones go out of date. The queue never holds more than twice the
// edges (and a little for small meshes), and no live entry is lost.
static void a_million_entries_take_bounded_room(void **state)
{
    (void)state;
    enum { RING = 1000, PUSHES = 1000000 };
    hw_collapse_queue *q = create(RING, RING);
    float *cost = NULL; // of the edge from each vertex to the next
    hw_rng rng = hw_rng_make(5, 5);
    assert_int_equal(HW_NEW(&cost, RING), HW_OK);
    for (uint32_t v = 0; v < RING; v++)
        push(q, v, (v + 1) % RING, cost[v] = hw_rng_float(&rng));
    for (uint32_t n = RING; n < PUSHES; n += 2) {
        uint32_t v = hw_rng_below(&rng, RING), before = (v + RING - 1) % RING;
        q->generation[v]++;
        push(q, v, (v + 1) % RING, cost[v] = hw_rng_float(&rng));
        push(q, before, v, cost[before] = hw_rng_float(&rng));
        assert_true(q->count <= q->capacity && q->capacity <= 2 * RING + 128);
    }
    float last = 0;
    uint32_t live = 0;
    while (q->count > 0) {
        hw_queue_entry top = hw_collapse_queue_pop(q);
        assert_true(top.cost >= last);
        last = top.cost;
        if (hw_collapse_queue_is_old(q, &top))
            continue;
        uint32_t v = top.b == top.a + 1 ? top.a : top.b;
        assert_true(cost[v] == top.cost);
        cost[v] = -1; // not twice
        live++;
    }
    assert_int_equal(live, RING);
    hw_free(cost);
    hw_collapse_queue_destroy(q);
}

// More live entries than was reckoned with: room grows, nothing is lost.
static void live_entries_make_room(void **state)
{
    (void)state;
    hw_collapse_queue *q = create(5000, 10);
    for (uint32_t v = 4999; v > 0; v--)
        push(q, v, v - 1, v % 7);
    assert_int_equal(q->count, 4999);
    assert_true(q->capacity < 2 * 4999);
    for (uint32_t i = 0; i < 4999; i++) {
        hw_queue_entry top = hw_collapse_queue_pop(q);
        assert_true(top.cost == top.b % 7);
    }
    assert_int_equal(hw_collapse_queue_reset(q, 3), HW_OK);
    assert_int_equal(q->count, 0);
    hw_collapse_queue_destroy(q);
    hw_collapse_queue_destroy(NULL);
}

static void marks_are_new(void **state)
{
    (void)state;
    hw_collapse_queue *q = create(4, 4);
    q->mark_value = UINT32_MAX - 3;
    for (int i = 0; i < 8; i++) {
        uint32_t mark = hw_collapse_queue_new_mark(q);
        for (uint32_t v = 0; v < 4; v++) {
            assert_true(q->mark[v] != mark);
            q->mark[v] = mark;
        }
    }
    hw_collapse_queue_destroy(q);
}

static void failing_allocations_lose_nothing(void **state)
{
    (void)state;
    for (uint64_t n = 1;; n++) {
        hw_collapse_queue *q = NULL;
        hw_alloc_fail_after(n);
        hw_status status = hw_collapse_queue_create(600, &q);
        if (status == HW_OK)
            status = hw_collapse_queue_reset(q, 4);
        uint32_t pushed = 0;
        for (uint32_t v = 1; status == HW_OK && v < 600; v++) {
            status = hw_collapse_queue_push(q, hw_collapse_queue_entry(q, v, v - 1, v));
            pushed += status == HW_OK;
        }
        hw_alloc_fail_after(0);
        if (q)
            assert_int_equal(q->count, pushed);
        for (uint32_t v = 1; v <= pushed; v++)
            assert_int_equal(hw_collapse_queue_pop(q).b, v);
        hw_collapse_queue_destroy(q);
        if (status == HW_OK)
            break;
        assert_int_equal(status, HW_MEMORY);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pops_come_in_order),
        cmocka_unit_test(appended_entries_are_ordered),
        cmocka_unit_test(old_and_touched_entries_are_known),
        cmocka_unit_test(a_million_entries_take_bounded_room),
        cmocka_unit_test(live_entries_make_room),
        cmocka_unit_test(marks_are_new),
        cmocka_unit_test(failing_allocations_lose_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
