#include "bandwidth.h"

void hw_bandwidth_init(hw_bandwidth *bandwidth, uint64_t bytes_per_second, double now_s)
{
    double rate = (double)bytes_per_second;
    *bandwidth = (hw_bandwidth){rate, rate * HW_BANDWIDTH_BURST_S, now_s};
}

double hw_bandwidth_take(hw_bandwidth *bandwidth, uint64_t bytes, double now_s)
{
    double most = bandwidth->rate * HW_BANDWIDTH_BURST_S;
    if (bandwidth->rate <= 0)
        return 0;
    if (now_s > bandwidth->last_s)
        bandwidth->tokens += (now_s - bandwidth->last_s) * bandwidth->rate;
    bandwidth->last_s = now_s;
    if (bandwidth->tokens > most)
        bandwidth->tokens = most;
    bandwidth->tokens -= (double)bytes;
    return bandwidth->tokens < 0 ? -bandwidth->tokens / bandwidth->rate : 0;
}
