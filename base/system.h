// The clock and the process's own memory, for benchmarks and reports.
#pragma once
#include <stdint.h>

// Monotonic milliseconds since an arbitrary start.
double hw_clock_ms(void);
// Processor time of the calling thread, seconds since an arbitrary start.
double hw_thread_seconds(void);
// The same of all threads of the process.
double hw_process_seconds(void);
// Resident set size of this process in bytes, now and at its peak; 0 where /proc is missing.
uint64_t hw_rss_bytes(void);
uint64_t hw_rss_peak_bytes(void);
// Begins a new peak, where the system can (Linux).
void hw_rss_reset_peak(void);
// Gives memory that was freed back to the system, where the C library can (glibc), and makes it do
// so from now on for blocks of 128 KiB and more, with few pools for small ones: else what one
// thread frees stays for its next. Takes a while; for programs that have just read their inputs and
// are to stay small.
void hw_memory_trim(void);
// The same for what is freed from now on alone: no search for what can go back already.
void hw_memory_map_blocks(void);
