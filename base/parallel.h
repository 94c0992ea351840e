// Data-parallel loops over indices. Plain pthreads rather than OpenMP, so that the thread sanitizer
// understands them.
#pragma once
#include "status.h"
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

// Number of processors available to this process, at least 1.
uint32_t hw_thread_count_default(void);

// Calls fn(context, index, thread) for every index in [0, count), handed out one by one in rising
// order, on `threads` threads (0: the default; the caller's thread is one of them; 1 runs inline).
// `thread` is in [0, threads). A failure stops the hand-out; the one of the lowest index is
// returned with its message, the same with any number of threads. A non-null `stop` that becomes
// true stops it with HW_INTERRUPTED.
//
// A loop within a loop shares its threads: it starts only as many as have run out of work outside,
// so that all are busy to the end and there are never more than the outermost loop has.
typedef hw_status (*hw_parallel_fn)(void *context, uint64_t index, uint32_t thread);
HW_MUST_USE hw_status hw_parallel_for(uint64_t count, uint32_t threads, hw_parallel_fn fn,
                                      void *context, const atomic_bool *stop);
