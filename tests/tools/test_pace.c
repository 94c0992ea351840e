// Frame times as a HUD shows them, from made-up clocks.
#include "pace.h"
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static void assert_near(double a, double b)
{
    assert_true(fabs(a - b) < 1e-3);
}

static void test_even_frames(void **state)
{
    (void)state;
    hw_pace pace = {0};
    for (int i = 0; i <= 40; i++) {
        hw_pace_tick(&pace, 1000 + 20 * i, 1000);
        if (i < 25)
            assert_true(pace.fps == 0); // not known yet
    }
    assert_near(pace.fps, 50);
    assert_near(pace.frame_ms, 20);
    assert_near(pace.p99_ms, 20);
    assert_near(pace.bytes_s, 26 * 1000 / 0.5); // the first frame's bytes count, its time does not
}

// Some slow frames in every hundred are what the 99th is.
static void test_percentile(void **state)
{
    (void)state;
    for (int slow = 0; slow <= 10; slow += 5) {
        hw_pace pace = {0};
        double now = 1;
        hw_pace_tick(&pace, now, 0);
        for (int i = 0; i < 1000; i++) {
            now += i % 100 < slow ? 200 : 10;
            hw_pace_tick(&pace, now, 0);
        }
        assert_near(pace.p99_ms, slow == 0 ? 10 : 200);
    }
}

// A pause is neither a slow frame nor part of the mean.
static void test_pause(void **state)
{
    (void)state;
    hw_pace pace = {0};
    double now = 1;
    for (int i = 0; i < 200; i++) {
        now += 10;
        hw_pace_tick(&pace, now, 0);
        if (i == 100) {
            hw_pace_pause(&pace);
            now += 60000;
        }
    }
    assert_near(pace.p99_ms, 10);
    assert_near(pace.frame_ms, 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_even_frames),
        cmocka_unit_test(test_percentile),
        cmocka_unit_test(test_pause),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
