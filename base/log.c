#include "log.h"
#include "alloc.h"
#include "system.h"
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <unistd.h>

#define BAR_CELLS        30
#define BAR_INTERVAL_MS  100.0
#define LINE_INTERVAL_MS 5000.0

struct hw_progress {
    const char *label;
    _Atomic uint64_t total, done;
    double start_ms, shown_ms;
};

static atomic_bool quiet;
// Guards stderr and `bar`, the progress whose bar stands on the terminal's last line.
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static hw_progress *bar;

void hw_log_set_quiet(bool value)
{
    atomic_store(&quiet, value);
}

bool hw_log_quiet(void)
{
    return atomic_load(&quiet);
}

static void format_duration(double ms, char *out, size_t size)
{
    uint64_t s = (uint64_t)(ms / 1000);
    if (s >= 3600)
        snprintf(out, size, "%llu:%02llu:%02llu", (unsigned long long)(s / 3600),
                 (unsigned long long)(s / 60 % 60), (unsigned long long)(s % 60));
    else
        snprintf(out, size, "%llu:%02llu", (unsigned long long)(s / 60),
                 (unsigned long long)(s % 60));
}

// Called with the mutex held. Writes the state as a bar (terminal) or as one line.
static void show(hw_progress *p, bool terminal)
{
    uint64_t done = atomic_load(&p->done);
    uint64_t total = atomic_load(&p->total);
    double share = total ? (double)done / (double)total : 1;
    share = share > 1 ? 1 : share;
    p->shown_ms = hw_clock_ms();
    double elapsed = p->shown_ms - p->start_ms;
    char left[32] = "?";
    if (share > 0)
        format_duration(elapsed / share - elapsed, left, sizeof left);
    if (!terminal) {
        fprintf(stderr, "hexwalk: %s: %.0f %% (%llu of %llu), %s left\n", p->label, share * 100,
                (unsigned long long)done, (unsigned long long)total, left);
        return;
    }
    char cells[BAR_CELLS + 1];
    for (int i = 0; i < BAR_CELLS; i++)
        cells[i] = i < (int)(share * BAR_CELLS) ? '#' : '.';
    cells[BAR_CELLS] = 0;
    fprintf(stderr, "\r\033[K%s [%s] %3.0f %%  ETA %s", p->label, cells, share * 100, left);
    fflush(stderr);
    bar = p;
}

void hw_log_warning(const char *format, ...)
{
    char text[HW_ERROR_CAPACITY];
    va_list args;
    if (hw_log_quiet())
        return;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    pthread_mutex_lock(&mutex);
    fprintf(stderr, "%shexwalk: warning: %s\n", bar ? "\r\033[K" : "", text);
    if (bar)
        show(bar, true);
    pthread_mutex_unlock(&mutex);
}

hw_status hw_progress_create(hw_progress **out, const char *label, uint64_t total)
{
    HW_TRY(HW_NEW(out, 1));
    (*out)->label = label;
    atomic_init(&(*out)->total, total);
    (*out)->start_ms = (*out)->shown_ms = hw_clock_ms();
    return HW_OK;
}

void hw_progress_add(hw_progress *progress, uint64_t done)
{
    atomic_fetch_add(&progress->done, done);
    if (hw_log_quiet())
        return;
    // Whoever finds the line taken leaves it to the other: the count is already added.
    if (pthread_mutex_trylock(&mutex) != 0)
        return;
    bool terminal = isatty(STDERR_FILENO);
    double interval = terminal ? BAR_INTERVAL_MS : LINE_INTERVAL_MS;
    if (hw_clock_ms() - progress->shown_ms >= interval)
        show(progress, terminal);
    pthread_mutex_unlock(&mutex);
}

void hw_progress_skip(hw_progress *progress, uint64_t skipped)
{
    atomic_fetch_sub(&progress->total, skipped);
}

void hw_progress_destroy(hw_progress *progress)
{
    if (!progress)
        return;
    pthread_mutex_lock(&mutex);
    bool drawn = bar == progress;
    if (drawn)
        bar = NULL;
    if (!hw_log_quiet()) {
        char elapsed[32];
        format_duration(hw_clock_ms() - progress->start_ms, elapsed, sizeof elapsed);
        fprintf(stderr, "%shexwalk: %s: %llu of %llu in %s\n", drawn ? "\r\033[K" : "",
                progress->label, (unsigned long long)atomic_load(&progress->done),
                (unsigned long long)atomic_load(&progress->total), elapsed);
    }
    pthread_mutex_unlock(&mutex);
    hw_free(progress);
}
