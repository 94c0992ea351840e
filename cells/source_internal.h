// Between source.c, which keeps queue, threads, retries and the limit of bandwidth, and what reads.
#pragma once
#include "source.h"
#include <stdatomic.h>

// One attempt at a read.
typedef struct hw_fetch {
    hw_source *source;
    const char *path; // location and name
    uint64_t offset, size;
    const atomic_bool *cancelled;
    uint32_t timeout_ms;
    bool again; // set by a backend whose failure another attempt may mend
    hw_block block;
} hw_fetch;

typedef struct hw_source_backend {
    // State of one thread; both may be NULL.
    hw_status (*connect)(void **connection);
    void (*disconnect)(void *connection);
    // Fills the block; what it holds is freed by the caller on failure.
    hw_status (*read)(void *connection, hw_fetch *fetch);
} hw_source_backend;

extern const hw_source_backend hw_source_disk, hw_source_http;

// Counts bytes received and waits until the limit allows them. False: the read was cancelled.
bool hw_fetch_pace(const hw_fetch *fetch, size_t bytes);
