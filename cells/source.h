// Where the files of a dataset come from: a folder, or a web server. Reads are asynchronous: they
// are started, served by the source's own threads in the order of their start, and finished or
// cancelled. A source may be used by several threads.
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stdint.h>

// Time as the limit of bandwidth and the waits between attempts see it. Both are called by the
// source's threads.
typedef struct hw_source_clock {
    double (*now_s)(void *context);
    void (*sleep_s)(void *context, double seconds);
    void *context;
} hw_source_clock;

typedef struct hw_source_desc {
    const char *location;         // a folder, or http://HOST[:PORT]/PATH (https likewise)
    uint64_t bytes_per_second;    // limit; 0 = none
    uint32_t threads;             // reads served at a time; 0 = 1 of a folder, 3 of a server
    const hw_source_clock *clock; // copied; NULL = the real one
    // Called by a thread of the source whenever a read has ended; NULL = not.
    void (*notify)(void *context);
    void *notify_context;
    // Of a server; 0 = the defaults: a connection or transfer in which nothing moves fails after
    // 10 s, 4 attempts after the first, waits of 0.2 s that double up to 5 s between them.
    uint32_t timeout_ms, retries, wait_ms, wait_max_ms;
} hw_source_desc;

// Sums since the source was opened.
typedef struct hw_source_stats {
    uint64_t bytes;     // received
    uint64_t requests;  // reads served, and
    uint64_t retries;   // attempts beyond their first
    uint64_t errors;    // reads that failed
    uint64_t cancelled; // reads that nobody wanted any more
} hw_source_stats;

// What a read gave. data is freed with hw_free.
typedef struct hw_block {
    uint8_t *data; // 0-terminated beyond size
    size_t size;
    uint64_t file_bytes; // size of the whole file
} hw_block;

#define HW_SOURCE_FILE_MAX (UINT64_C(1) << 31) // a read of more is HW_LIMIT

typedef struct hw_source hw_source;
typedef struct hw_request hw_request;

// Whether the location is for a web server.
bool hw_location_is_url(const char *location);

// Starts the threads; touches no file yet. HW_USAGE for a URL of another scheme.
HW_MUST_USE hw_status hw_source_open(hw_source **out, const hw_source_desc *desc);
// Cancels all that is going on. Requests must have been finished or cancelled before. NULL is
// legal.
void hw_source_close(hw_source *source);
const char *hw_source_location(const hw_source *source);
hw_source_stats hw_source_get_stats(hw_source *source);

// Starts to read `size` bytes at `offset` of the file (its name below the location, "cells/..."),
// fewer where the file ends before; size 0: the whole file, offset must be 0 then.
HW_MUST_USE hw_status hw_source_start(hw_source *source, const char *name, uint64_t offset,
                                      uint64_t size, hw_request **out);
// Whether it has ended, one way or the other.
bool hw_request_done(hw_request *request);
// Waits for the end, hands over the bytes and frees the request. HW_NOT_FOUND: there is no such
// file. HW_FORMAT: the file ends before `offset`. HW_IO: all else, after the retries. Errors name
// the file. On failure *out is zeroed.
HW_MUST_USE hw_status hw_request_finish(hw_request *request, hw_block *out);
// Ends a read that nobody wants any more, whatever its state, and frees the request. Does not wait.
// NULL is legal.
void hw_request_cancel(hw_request *request);
// Start and finish in one.
HW_MUST_USE hw_status hw_source_read(hw_source *source, const char *name, uint64_t offset,
                                     uint64_t size, hw_block *out);
