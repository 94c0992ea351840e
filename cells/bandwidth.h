// A limit on bytes a second, as a token bucket that may run into debt. No clock of its own: the
// caller says what time it is, so that a test can.
#pragma once
#include <stdint.h>

typedef struct hw_bandwidth {
    double rate;           // bytes a second; 0 = no limit
    double tokens, last_s; // what may be taken at once, and when that was reckoned
} hw_bandwidth;

// Bursts hold what comes in this time.
#define HW_BANDWIDTH_BURST_S 0.05

// Full at time now_s.
void hw_bandwidth_init(hw_bandwidth *bandwidth, uint64_t bytes_per_second, double now_s);
// Takes the bytes at time now_s. Returns for how many seconds the caller has to wait until they
// are his; 0 without a limit.
double hw_bandwidth_take(hw_bandwidth *bandwidth, uint64_t bytes, double now_s);
