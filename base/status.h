// Results of fallible calls, and the one per-thread slot that holds what went wrong.
//
// A caller's bug is an assert. Bad data, I/O, GL and memory are a returned status; the details go
// into the slot of the calling thread, where only `main` (or a test) reads them. Nothing below
// `tools/` prints an error or exits.
#pragma once
#include <stddef.h>

#define HW_STATUS_LIST(X)                                                                          \
    X(OK, "ok")                                                                                    \
    X(USAGE, "wrong usage")                                                                        \
    X(MEMORY, "out of memory")                                                                     \
    X(NOT_FOUND, "not found")                                                                      \
    X(IO, "input/output error")                                                                    \
    X(FORMAT, "malformed data")                                                                    \
    X(VERSION, "unsupported version")                                                              \
    X(LIMIT, "limit exceeded")                                                                     \
    X(GRAPHICS, "graphics error")                                                                  \
    X(INTERRUPTED, "interrupted")                                                                  \
    X(INTERNAL, "internal error")

typedef enum hw_status {
#define X(name, text) HW_##name,
    HW_STATUS_LIST(X)
#undef X
} hw_status;

#define HW_MUST_USE          __attribute__((warn_unused_result))
#define HW_PRINTF(fmt, args) __attribute__((format(printf, fmt, args)))

// "ok", "not found", ... Static storage.
const char *hw_status_text(hw_status status);

// Stores the message (cut at 1023 bytes) in this thread's slot and returns `status`, so that a
// function can end with `return hw_fail(HW_FORMAT, "%s: vertex %u is not finite", path, i)`.
// Messages name the file first, then the cause.
hw_status hw_fail(hw_status status, const char *format, ...) HW_PRINTF(2, 3);

// Puts "prefix: " before the message already in the slot (to name the file a lower layer did not
// know); returns status.
hw_status hw_fail_prefix(hw_status status, const char *prefix);

// The message of the last failure on this thread, "" if none. Valid until the next failure on the
// same thread.
const char *hw_error_text(void);

// Copies status text between threads: save in the worker, restore in the caller. `buffer` holds
// HW_ERROR_CAPACITY bytes.
#define HW_ERROR_CAPACITY 1024
void hw_error_save(char buffer[HW_ERROR_CAPACITY]);
void hw_error_restore(const char buffer[HW_ERROR_CAPACITY]);

// Early return of a failure.
#define HW_TRY(expression)                                                                         \
    do {                                                                                           \
        hw_status hw_try_status = (expression);                                                    \
        if (hw_try_status != HW_OK)                                                                \
            return hw_try_status;                                                                  \
    } while (0)

// The clean-up idiom: assigns the local `status` and jumps to `out` on failure.
#define HW_GO(expression)                                                                          \
    do {                                                                                           \
        status = (expression);                                                                     \
        if (status != HW_OK)                                                                       \
            goto out;                                                                              \
    } while (0)
