// The queue of what is to be fetched, and the ring between the threads.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "prefetch_queue.h"
#include "ring.h"
#include "rng.h"

#include <pthread.h>

static hw_wish wish(uint32_t index, double t_priority)
{
    return (hw_wish){{HW_DATA_CELL, index, 0}, t_priority};
}

static void put(hw_prefetch_queue *queue, uint32_t index, double t_priority)
{
    hw_wish w = wish(index, t_priority), lost;
    assert_false(hw_prefetch_queue_put(queue, &w, &lost));
}

static void expect(hw_prefetch_queue *queue, uint32_t index)
{
    hw_wish w;
    assert_true(hw_prefetch_queue_peek(queue, &w));
    assert_int_equal(w.key.index, index);
    assert_true(hw_prefetch_queue_take(queue, &w));
    assert_int_equal(w.key.index, index);
}

// What was wished for later goes first, whatever its priority; within a timestamp the priority
// decides.
static void test_order(void **state)
{
    (void)state;
    static hw_prefetch_queue queue;
    hw_wish w;
    assert_false(hw_prefetch_queue_peek(&queue, &w));
    assert_false(hw_prefetch_queue_take(&queue, &w));
    put(&queue, 1, 7.9);
    put(&queue, 2, 8.1);
    put(&queue, 3, 8.5);
    put(&queue, 4, 6.99);
    expect(&queue, 3);
    expect(&queue, 2);
    put(&queue, 5, 7.95);
    expect(&queue, 5);
    expect(&queue, 1);
    expect(&queue, 4);
    assert_false(hw_prefetch_queue_take(&queue, &w));
}

// A wish that is repeated stands once, with the new urgency, be it higher or lower.
static void test_repeated(void **state)
{
    (void)state;
    static hw_prefetch_queue queue;
    put(&queue, 1, 3.2);
    put(&queue, 2, 3.4);
    put(&queue, 1, 4.0);
    assert_int_equal(queue.count, 2);
    expect(&queue, 1);
    put(&queue, 3, 3.5);
    put(&queue, 3, 3.1);
    expect(&queue, 2);
    expect(&queue, 3);
    assert_int_equal(queue.count, 0);
}

static void test_keys(void **state)
{
    (void)state;
    hw_data_key a = {HW_DATA_LEVEL, 3, 4};
    assert_true(hw_data_key_equal(a, a));
    assert_false(hw_data_key_equal(a, (hw_data_key){HW_DATA_MESH, 3, 4}));
    assert_false(hw_data_key_equal(a, (hw_data_key){HW_DATA_LEVEL, 2, 4}));
    assert_false(hw_data_key_equal(a, (hw_data_key){HW_DATA_LEVEL, 3, 5}));
}

// t-priorities below timestamp - 2 are out of date.
static void test_stale(void **state)
{
    (void)state;
    static hw_prefetch_queue queue;
    hw_wish w;
    put(&queue, 1, 4.99);
    put(&queue, 2, 5.0);
    put(&queue, 3, 3.5);
    put(&queue, 4, 7.1);
    assert_false(hw_prefetch_queue_drop(&queue, 5.5, &w));
    uint32_t dropped = 0;
    while (hw_prefetch_queue_drop(&queue, 7, &w))
        dropped |= 1u << w.key.index;
    assert_int_equal(dropped, 1u << 1 | 1u << 3);
    expect(&queue, 4);
    expect(&queue, 2);
}

static void test_full(void **state)
{
    (void)state;
    static hw_prefetch_queue queue;
    hw_wish lost;
    for (uint32_t i = 0; i < HW_PREFETCH_QUEUE_MAX; i++)
        put(&queue, i, 10 + i * 0.0005);
    hw_wish weak = wish(5000, 9), strong = wish(5001, 11);
    assert_true(hw_prefetch_queue_put(&queue, &weak, &lost));
    assert_int_equal(lost.key.index, 5000);
    assert_true(hw_prefetch_queue_put(&queue, &strong, &lost));
    assert_int_equal(lost.key.index, 0);
    expect(&queue, 5001);
    expect(&queue, HW_PREFETCH_QUEUE_MAX - 1);
    assert_int_equal(queue.count, HW_PREFETCH_QUEUE_MAX - 2);
}

// Against a plain model: whatever is put and taken, the most urgent comes first.
static void test_random(void **state)
{
    (void)state;
    static hw_prefetch_queue queue;
    hw_rng rng = hw_rng_make(1, 2);
    double model[100];
    for (int i = 0; i < 100; i++)
        model[i] = -1;
    for (int step = 0; step < 20000; step++) {
        if (hw_rng_below(&rng, 3) > 0) {
            uint32_t i = hw_rng_below(&rng, 100);
            model[i] = 1 + (double)hw_rng_float(&rng) * 1000 + i * 1e-7;
            put(&queue, i, model[i]);
            continue;
        }
        int best = 0;
        hw_wish w;
        for (int i = 1; i < 100; i++)
            best = model[i] > model[best] ? i : best;
        assert_int_equal(hw_prefetch_queue_take(&queue, &w), model[best] >= 0);
        if (model[best] >= 0)
            assert_int_equal(w.key.index, best);
        model[best] = -1;
    }
}

// ---- the ring ----

static void test_ring(void **state)
{
    (void)state;
    hw_ring ring;
    uint32_t value;
    assert_int_equal(hw_ring_create(&ring, 4, sizeof value), HW_OK);
    for (uint32_t round = 0; round < 10; round++) {
        for (uint32_t i = 0; i < 4; i++) {
            value = round * 10 + i;
            assert_true(hw_ring_put(&ring, &value));
        }
        assert_false(hw_ring_put(&ring, &value));
        assert_int_equal(hw_ring_count(&ring), 4);
        for (uint32_t i = 0; i < 4; i++) {
            assert_true(hw_ring_take(&ring, &value));
            assert_int_equal(value, round * 10 + i);
        }
        assert_false(hw_ring_take(&ring, &value));
    }
    hw_ring_free(&ring);
}

#define MANY 200000u

static void *put_many(void *argument)
{
    hw_ring *ring = argument;
    for (uint64_t i = 0; i < MANY;) {
        const uint64_t item[3] = {i, i * 3, ~i};
        i += hw_ring_put(ring, item);
    }
    return NULL;
}

static void test_ring_threads(void **state)
{
    (void)state;
    hw_ring ring;
    pthread_t thread;
    uint64_t item[3];
    assert_int_equal(hw_ring_create(&ring, 16, sizeof item), HW_OK);
    assert_int_equal(pthread_create(&thread, NULL, put_many, &ring), 0);
    for (uint64_t i = 0; i < MANY;) {
        if (!hw_ring_take(&ring, item))
            continue;
        assert_true(item[0] == i && item[1] == i * 3 && item[2] == ~i);
        i++;
    }
    pthread_join(thread, NULL);
    hw_ring_free(&ring);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_order), cmocka_unit_test(test_repeated),
        cmocka_unit_test(test_keys),  cmocka_unit_test(test_stale),
        cmocka_unit_test(test_full),  cmocka_unit_test(test_random),
        cmocka_unit_test(test_ring),  cmocka_unit_test(test_ring_threads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
