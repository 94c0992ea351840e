#include "alloc.h"
#include "parallel.h"
#include <stdio.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define COUNT 10000

typedef struct counts {
    _Atomic uint32_t times[COUNT];
    _Atomic uint32_t bad_threads;
    uint32_t threads;
    atomic_bool stop;
    uint64_t stop_at, calls_after_stop;
} counts;

static counts all;

static hw_status count_call(void *context, uint64_t index, uint32_t thread)
{
    counts *c = context;
    atomic_fetch_add(&c->times[index], 1);
    if (thread >= c->threads)
        atomic_fetch_add(&c->bad_threads, 1);
    return HW_OK;
}

static void each_index_is_called_once(void **state)
{
    (void)state;
    for (uint32_t threads = 1; threads <= 8; threads++) {
        memset(&all, 0, sizeof all);
        all.threads = threads;
        assert_int_equal(hw_parallel_for(COUNT, threads, count_call, &all, NULL), HW_OK);
        for (uint32_t i = 0; i < COUNT; i++)
            assert_int_equal(all.times[i], 1);
        assert_int_equal(all.bad_threads, 0);
    }
}

static void small_and_empty_loops(void **state)
{
    (void)state;
    memset(&all, 0, sizeof all);
    all.threads = 1; // one index keeps one thread busy
    assert_int_equal(hw_parallel_for(0, 4, count_call, &all, NULL), HW_OK);
    assert_int_equal(all.times[0], 0);
    assert_int_equal(hw_parallel_for(1, 64, count_call, &all, NULL), HW_OK);
    assert_int_equal(all.times[0], 1);
    assert_int_equal(all.bad_threads, 0);
    all.threads = hw_thread_count_default();
    assert_true(all.threads >= 1);
    assert_int_equal(hw_parallel_for(COUNT, 0, count_call, &all, NULL), HW_OK);
    assert_int_equal(all.bad_threads, 0);
}

static hw_status append_index(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    uint64_t *next = context;
    return *next == index ? ++*next, HW_OK : hw_fail(HW_INTERNAL, "out of order");
}

static void one_thread_goes_in_order(void **state)
{
    (void)state;
    uint64_t next = 0;
    assert_int_equal(hw_parallel_for(1000, 1, append_index, &next, NULL), HW_OK);
    assert_int_equal(next, 1000);
}

// Fails at 300 and everywhere from 500 on; 300 is started before them and ends after them.
static hw_status fail_somewhere(void *context, uint64_t index, uint32_t thread)
{
    counts *c = context;
    (void)thread;
    atomic_fetch_add(&c->times[index], 1);
    if (index != 300 && index < 500)
        return HW_OK;
    if (index == 300)
        for (volatile int i = 0; i < 2000000; i++)
            ;
    return hw_fail(index == 300 ? HW_LIMIT : HW_IO, "index %llu", (unsigned long long)index);
}

static void the_lowest_failure_is_returned(void **state)
{
    (void)state;
    for (uint32_t threads = 1; threads <= 4; threads++) {
        memset(&all, 0, sizeof all);
        hw_fail(HW_OK, "%s", "");
        assert_int_equal(hw_parallel_for(COUNT, threads, fail_somewhere, &all, NULL), HW_LIMIT);
        assert_string_equal(hw_error_text(), "index 300");
        uint32_t calls = 0;
        for (uint32_t i = 0; i < COUNT; i++)
            calls += all.times[i];
        assert_true(calls < 600); // the hand-out stopped
        for (uint32_t i = 0; i < 300; i++)
            assert_int_equal(all.times[i], 1);
    }
}

static hw_status stop_in_the_middle(void *context, uint64_t index, uint32_t thread)
{
    counts *c = context;
    (void)thread;
    atomic_fetch_add(&c->times[index], 1);
    if (index == c->stop_at)
        atomic_store(&c->stop, true);
    return HW_OK;
}

static void stop_interrupts(void **state)
{
    (void)state;
    for (uint32_t threads = 1; threads <= 4; threads++) {
        memset(&all, 0, sizeof all);
        all.stop_at = 5;
        assert_int_equal(hw_parallel_for(COUNT, threads, stop_in_the_middle, &all, &all.stop),
                         HW_INTERRUPTED);
        if (threads == 1)
            assert_int_equal(all.times[6], 0);
        assert_int_equal(all.times[5], 1);
        // Stopped from the start: nothing is called.
        memset(all.times, 0, sizeof all.times);
        assert_int_equal(hw_parallel_for(COUNT, threads, count_call, &all, &all.stop),
                         HW_INTERRUPTED);
        for (uint32_t i = 0; i < COUNT; i++)
            assert_int_equal(all.times[i], 0);
    }
    // A stop that comes with the last index has nothing left to stop.
    memset(&all, 0, sizeof all);
    all.stop_at = COUNT - 1;
    assert_int_equal(hw_parallel_for(COUNT, 1, stop_in_the_middle, &all, &all.stop), HW_OK);
}

typedef struct nest {
    _Atomic uint32_t calls, working, most;
    uint32_t inner_count;
} nest;

static hw_status inner_call(void *context, uint64_t index, uint32_t thread)
{
    nest *n = context;
    uint32_t now = atomic_fetch_add(&n->working, 1) + 1, most = atomic_load(&n->most);
    while (now > most && !atomic_compare_exchange_weak(&n->most, &most, now))
        ;
    assert_true(index < n->inner_count && thread < 4);
    atomic_fetch_add(&n->calls, 1);
    for (volatile int i = 0; i < 20000; i++)
        ;
    atomic_fetch_sub(&n->working, 1);
    return HW_OK;
}

static hw_status outer_call(void *context, uint64_t index, uint32_t thread)
{
    (void)index;
    (void)thread;
    nest *n = context;
    return hw_parallel_for(n->inner_count, 4, inner_call, n, NULL);
}

// However many indices the outer loop has, all inner ones are called, by no more threads than the
// outer loop was given.
static void loops_within_share_the_threads(void **state)
{
    (void)state;
    for (uint32_t outer = 1; outer <= 9; outer++) {
        nest n = {.inner_count = 50};
        assert_int_equal(hw_parallel_for(outer, outer, outer_call, &n, NULL), HW_OK);
        assert_int_equal(n.calls, 50 * outer);
        assert_true(n.most >= 1 && n.most <= outer);
        nest free = {.inner_count = 50}; // with threads that have no index of the outer loop
        assert_int_equal(hw_parallel_for(outer, 4, outer_call, &free, NULL), HW_OK);
        assert_int_equal(free.calls, 50 * outer);
        assert_true(free.most <= 4);
    }
}

static void running_out_of_memory(void **state)
{
    (void)state;
    memset(&all, 0, sizeof all);
    hw_alloc_fail_after(1);
    assert_int_equal(hw_parallel_for(COUNT, 2, count_call, &all, NULL), HW_MEMORY);
    hw_alloc_fail_after(0);
    assert_int_equal(all.times[0], 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_index_is_called_once),
        cmocka_unit_test(small_and_empty_loops),
        cmocka_unit_test(one_thread_goes_in_order),
        cmocka_unit_test(the_lowest_failure_is_returned),
        cmocka_unit_test(stop_interrupts),
        cmocka_unit_test(loops_within_share_the_threads),
        cmocka_unit_test(running_out_of_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
