#include "status.h"
#include <pthread.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static void every_status_has_its_text(void **state)
{
    (void)state;
    assert_string_equal(hw_status_text(HW_OK), "ok");
    assert_string_equal(hw_status_text(HW_FORMAT), "malformed data");
    assert_string_equal(hw_status_text(HW_INTERNAL), "internal error");
    assert_string_equal(hw_status_text((hw_status)999), "unknown status");
    for (int s = HW_OK; s <= HW_INTERNAL; s++)
        for (int t = HW_OK; t < s; t++)
            assert_string_not_equal(hw_status_text((hw_status)s), hw_status_text((hw_status)t));
}

static void fail_stores_the_message(void **state)
{
    (void)state;
    assert_int_equal(hw_fail(HW_IO, "%s: vertex %u", "a.ply", 7u), HW_IO);
    assert_string_equal(hw_error_text(), "a.ply: vertex 7");
    // The message may be built from the last one.
    assert_int_equal(hw_fail(HW_FORMAT, "again: %s", hw_error_text()), HW_FORMAT);
    assert_string_equal(hw_error_text(), "again: a.ply: vertex 7");
    assert_int_equal(hw_fail_prefix(HW_LIMIT, "scene.glb"), HW_LIMIT);
    assert_string_equal(hw_error_text(), "scene.glb: again: a.ply: vertex 7");
}

static void long_messages_are_cut(void **state)
{
    (void)state;
    char text[3 * HW_ERROR_CAPACITY];
    memset(text, 'x', sizeof text);
    text[sizeof text - 1] = 0;
    assert_int_equal(hw_fail(HW_IO, "%s", text), HW_IO);
    assert_int_equal(strlen(hw_error_text()), HW_ERROR_CAPACITY - 1);
    assert_int_equal(hw_fail_prefix(HW_IO, "name"), HW_IO);
    assert_int_equal(strlen(hw_error_text()), HW_ERROR_CAPACITY - 1);
    assert_memory_equal(hw_error_text(), "name: xxx", 9);
}

static void *fail_elsewhere(void *buffer)
{
    // A new thread starts without a message.
    if (*hw_error_text() == 0)
        hw_fail(HW_MEMORY, "in the thread");
    hw_error_save(buffer);
    return NULL;
}

static void slots_belong_to_threads(void **state)
{
    (void)state;
    char buffer[HW_ERROR_CAPACITY];
    pthread_t thread;
    hw_fail(HW_IO, "mine");
    assert_int_equal(pthread_create(&thread, NULL, fail_elsewhere, buffer), 0);
    pthread_join(thread, NULL);
    assert_string_equal(hw_error_text(), "mine");
    hw_error_restore(buffer);
    assert_string_equal(hw_error_text(), "in the thread");
}

static hw_status step(hw_status status)
{
    return status;
}

static hw_status try_steps(hw_status first, int *reached)
{
    HW_TRY(step(first));
    *reached = 1;
    return HW_OK;
}

static hw_status go_steps(hw_status first, int *reached, int *cleaned)
{
    hw_status status = HW_OK;
    HW_GO(step(first));
    *reached = 1;
out:
    *cleaned = 1;
    return status;
}

static void early_returns(void **state)
{
    (void)state;
    int reached = 0, cleaned = 0;
    assert_int_equal(try_steps(HW_LIMIT, &reached), HW_LIMIT);
    assert_int_equal(go_steps(HW_IO, &reached, &cleaned), HW_IO);
    assert_int_equal(reached, 0);
    assert_int_equal(cleaned, 1);
    assert_int_equal(try_steps(HW_OK, &reached), HW_OK);
    assert_int_equal(reached, 1);
    reached = cleaned = 0;
    assert_int_equal(go_steps(HW_OK, &reached, &cleaned), HW_OK);
    assert_int_equal(reached + cleaned, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_status_has_its_text),
        cmocka_unit_test(fail_stores_the_message),
        cmocka_unit_test(long_messages_are_cut),
        cmocka_unit_test(slots_belong_to_threads),
        cmocka_unit_test(early_returns),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
