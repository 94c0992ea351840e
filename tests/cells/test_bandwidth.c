// The limit of bandwidth by a clock of the test's own.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "bandwidth.h"

#include <math.h>

static void test_no_limit(void **state)
{
    (void)state;
    hw_bandwidth b;
    hw_bandwidth_init(&b, 0, 5);
    assert_true(hw_bandwidth_take(&b, UINT64_C(1) << 40, 5) == 0);
}

// Whoever waits as told gets the rate, whatever the sizes of what he takes.
static void test_rate(void **state)
{
    (void)state;
    static const uint64_t sizes[] = {1, 700, 65536, 1000000};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        hw_bandwidth b;
        double now = 100;
        uint64_t taken = 0;
        hw_bandwidth_init(&b, 1000000, now);
        while (taken < 5000000) {
            now += hw_bandwidth_take(&b, sizes[i], now);
            taken += sizes[i];
        }
        double wanted = (double)taken / 1e6 - HW_BANDWIDTH_BURST_S;
        assert_true(fabs(now - 100 - wanted) < 1e-6);
    }
}

// A pause saves up no more than a burst.
static void test_burst(void **state)
{
    (void)state;
    hw_bandwidth b;
    hw_bandwidth_init(&b, 1000, 0);
    uint64_t burst = (uint64_t)(1000 * HW_BANDWIDTH_BURST_S);
    assert_true(hw_bandwidth_take(&b, burst, 0) == 0);
    assert_true(hw_bandwidth_take(&b, burst, 1000) == 0);
    assert_true(fabs(hw_bandwidth_take(&b, 1000, 1000) - 1) < 1e-9);
    // A clock that stands still or goes back gives nothing.
    assert_true(fabs(hw_bandwidth_take(&b, 1000, 999) - 2) < 1e-9);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_limit),
        cmocka_unit_test(test_rate),
        cmocka_unit_test(test_burst),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
