// Diagnostics and progress on stderr. Libraries report progress through hw_progress and never print
// errors.
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stdint.h>

// With quiet, neither log lines nor progress are written. Set once by main before threads start.
void hw_log_set_quiet(bool quiet);
bool hw_log_quiet(void);
// One line on stderr: "hexwalk: warning: text". Thread-safe.
void hw_log_warning(const char *format, ...) HW_PRINTF(1, 2);

// A progress bar with ETA on a terminal, a plain line at most every 5 seconds otherwise. `label`
// must outlive it.
typedef struct hw_progress hw_progress;
HW_MUST_USE hw_status hw_progress_create(hw_progress **out, const char *label, uint64_t total);
// Adds to what is done. Thread-safe.
void hw_progress_add(hw_progress *progress, uint64_t done);
// Takes work that needs not be done out of the total, so that the ETA tells of the rest.
// Thread-safe.
void hw_progress_skip(hw_progress *progress, uint64_t skipped);
// Writes the closing line and frees. NULL is legal.
void hw_progress_destroy(hw_progress *progress);
