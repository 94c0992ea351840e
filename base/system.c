#include "system.h"
#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <stdio.h>
#include <string.h>
#include <time.h>

double hw_clock_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static double processor_seconds(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

double hw_thread_seconds(void)
{
    return processor_seconds(CLOCK_THREAD_CPUTIME_ID);
}

double hw_process_seconds(void)
{
    return processor_seconds(CLOCK_PROCESS_CPUTIME_ID);
}

// A "Name:   123 kB" line of /proc/self/status in bytes.
static uint64_t status_line_bytes(const char *name)
{
    FILE *file = fopen("/proc/self/status", "re");
    if (!file)
        return 0;
    char line[256];
    size_t length = strlen(name);
    unsigned long long kib = 0;
    while (fgets(line, sizeof line, file))
        if (!strncmp(line, name, length) && sscanf(line + length, " %llu", &kib) == 1)
            break;
    fclose(file);
    return (uint64_t)kib * 1024;
}

uint64_t hw_rss_bytes(void)
{
    return status_line_bytes("VmRSS:");
}

uint64_t hw_rss_peak_bytes(void)
{
    return status_line_bytes("VmHWM:");
}

void hw_rss_reset_peak(void)
{
    FILE *file = fopen("/proc/self/clear_refs", "we");
    if (!file)
        return;
    (void)fputs("5", file);
    fclose(file);
}

void hw_memory_map_blocks(void)
{
#ifdef __GLIBC__
    (void)mallopt(M_MMAP_THRESHOLD, 128 * 1024);
    (void)mallopt(M_ARENA_MAX, 2); // the first thread's, and one for all others
#endif
}

void hw_memory_trim(void)
{
    hw_memory_map_blocks();
#ifdef __GLIBC__
    (void)malloc_trim(0);
#endif
}
