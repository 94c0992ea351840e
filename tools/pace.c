#include "pace.h"
#include <stdlib.h>
#include <string.h>

#define PERIOD_MS 500.0

static int compare_floats(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static double percentile_99(const hw_pace *p)
{
    float sorted[HW_PACE_FRAMES];
    uint32_t count = p->time_count < HW_PACE_FRAMES ? p->time_count : HW_PACE_FRAMES;
    memcpy(sorted, p->times_ms, count * sizeof *sorted);
    qsort(sorted, count, sizeof *sorted, compare_floats);
    return (double)sorted[(uint32_t)(0.99 * (count - 1) + 0.5)];
}

bool hw_pace_tick(hw_pace *p, double now_ms, uint64_t loaded_bytes)
{
    p->bytes += loaded_bytes;
    if (p->last_ms == 0) {
        p->start_ms = p->last_ms = now_ms;
        return false;
    }
    p->times_ms[p->time_count++ % HW_PACE_FRAMES] = (float)(now_ms - p->last_ms);
    p->last_ms = now_ms;
    p->frames++;
    double elapsed = now_ms - p->start_ms;
    if (elapsed < PERIOD_MS)
        return false;
    p->frame_ms = elapsed / p->frames;
    p->fps = 1000 / p->frame_ms;
    p->p99_ms = percentile_99(p);
    p->bytes_s = (double)p->bytes / elapsed * 1000;
    p->start_ms = now_ms;
    p->frames = 0;
    p->bytes = 0;
    return true;
}

void hw_pace_pause(hw_pace *p)
{
    p->last_ms = 0;
    p->frames = 0;
    p->bytes = 0;
}
