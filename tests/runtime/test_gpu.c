// What software GL has collected and not yet drawn is bounded: a flush waits for an earlier one.
#include "gpu.h"
#include "models.h"

// GL's functions, with a record of what they were called for.
static PFNGLFENCESYNCPROC fence_sync;
static PFNGLCLIENTWAITSYNCPROC client_wait_sync;
static PFNGLDELETESYNCPROC delete_sync;
static uint32_t fences, waits, kept; // kept: fences that were not deleted
static GLsync made[1000];

static GLsync GLAD_API_PTR count_fence(GLenum condition, GLbitfield flags)
{
    assert_in_range(fences, 0, 999);
    kept++;
    return made[fences++] = fence_sync(condition, flags);
}

static GLenum GLAD_API_PTR count_wait(GLsync sync, GLbitfield flags, GLuint64 timeout)
{
    assert_ptr_equal(sync, made[waits++]); // the oldest that was not waited for
    GLenum result = client_wait_sync(sync, flags, timeout);
    assert_true(result == GL_ALREADY_SIGNALED || result == GL_CONDITION_SATISFIED);
    return result;
}

static void GLAD_API_PTR count_delete(GLsync sync)
{
    assert_non_null(sync);
    kept--;
    delete_sync(sync);
}

static void start_counting(void)
{
    fence_sync = glad_glFenceSync;
    client_wait_sync = glad_glClientWaitSync;
    delete_sync = glad_glDeleteSync;
    glad_glFenceSync = count_fence;
    glad_glClientWaitSync = count_wait;
    glad_glDeleteSync = count_delete;
}

// One frame: a flush after the clear, then triangles in draws of so many.
static void draw_frame(uint32_t draws, uint32_t triangles)
{
    hw_gpu_pace pace = {0};
    fences = waits = 0;
    glClear(GL_COLOR_BUFFER_BIT);
    hw_gpu_pace_flush(&pace);
    assert_int_equal(fences, 1);
    for (uint32_t i = 0; i < draws; i++) {
        glClear(GL_COLOR_BUFFER_BIT);
        hw_gpu_pace_add(&pace, triangles);
        assert_true(kept <= HW_GPU_PACE_PIECES);
    }
    hw_gpu_pace_end(&pace);
    assert_int_equal(kept, 0);
}

static void test_pace(void **state)
{
    (void)state;
    const hw_context_desc desc = {.kind = HW_CONTEXT_OFFSCREEN, .width = 16, .height = 16};
    hw_context *context = NULL;
    assert_ok(hw_context_create(&desc, &context));
    assert_true(hw_gpu_is_software());
    start_counting();
    draw_frame(1, 100);
    assert_int_equal(fences, 1); // a small frame waits for nothing
    assert_int_equal(waits, 0);
    draw_frame(100, 1000);
    assert_true(fences > 2 * HW_GPU_PACE_PIECES);
    assert_int_equal(waits, fences - HW_GPU_PACE_PIECES);
    draw_frame(HW_GPU_PACE_PIECES + 2, 200000); // each is a piece of its own
    assert_int_equal(fences, HW_GPU_PACE_PIECES + 3);
    assert_int_equal(waits, 3);
    hw_gpu_pace untouched = {0};
    hw_gpu_pace_end(&untouched);
    assert_ok(hw_gpu_check("pace"));
    hw_context_destroy(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_pace)};
    return cmocka_run_group_tests_name("gpu", tests, NULL, NULL);
}
