// Off-screen contexts: one at a time, made again after they are destroyed.
#include "models.h"

static const hw_context_desc desc = {.kind = HW_CONTEXT_OFFSCREEN, .width = 32, .height = 16};

static void test_create_and_destroy(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        hw_context *context = NULL;
        assert_ok(hw_context_create(&desc, &context));
        assert_true(strlen(hw_context_renderer(context)) > 0);
        hw_input input = {.close = true, .mouse_dx = 5};
        hw_context_set_title(context, "nothing to see");
        hw_context_present(context, &input);
        assert_false(input.close);
        assert_true(input.mouse_dx == 0);
        assert_int_equal(input.width, 32);
        assert_int_equal(input.height, 16);
        hw_context_destroy(context);
    }
    hw_context_destroy(NULL);
}

static void test_one_at_a_time(void **state)
{
    (void)state;
    hw_context *first = NULL, *second = NULL;
    assert_ok(hw_context_create(&desc, &first));
    assert_int_equal(hw_context_create(&desc, &second), HW_GRAPHICS);
    assert_null(second);
    hw_context_destroy(first);
    assert_ok(hw_context_create(&desc, &second));
    hw_context_destroy(second);
}

static void test_failing_allocations(void **state)
{
    (void)state;
    hw_context *context = NULL;
    for (uint64_t n = 1; n <= 16; n++) {
        hw_alloc_fail_after(n);
        hw_status status = hw_context_create(&desc, &context);
        hw_alloc_fail_after(0);
        if (status == HW_OK) {
            assert_true(n > 1);
            hw_context_destroy(context);
            return;
        }
        assert_int_equal(status, HW_MEMORY);
        assert_null(context);
    }
    fail_msg("it never succeeded");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_create_and_destroy),
        cmocka_unit_test(test_one_at_a_time),
        cmocka_unit_test(test_failing_allocations),
    };
    return cmocka_run_group_tests_name("context", tests, NULL, NULL);
}
