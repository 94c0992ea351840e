#include "source.h"
#include "alloc.h"
#include "bandwidth.h"
#include "file.h"
#include "source_internal.h"
#include "system.h"
#include <assert.h>
#include <pthread.h>
#include <string.h>
#include <strings.h>
#include <time.h>

#define THREADS_MAX  16u
#define SLEEP_MOST_S 0.01 // without a look at whether the read was cancelled

typedef enum state { STATE_QUEUED, STATE_RUNNING, STATE_DONE } state;

struct hw_request {
    hw_source *source;
    hw_request *next; // in the queue
    char *path;
    uint64_t offset, size;
    state state;           // guarded by the source's mutex
    atomic_bool cancelled; // while running: its thread frees it
    hw_status status;
    hw_block block;
    char error[HW_ERROR_CAPACITY];
};

struct hw_source {
    char *location;
    const hw_source_backend *backend;
    hw_source_desc desc; // without pointers that are borrowed
    hw_source_clock clock;
    pthread_t threads[THREADS_MAX];
    uint32_t thread_count;
    pthread_mutex_t mutex;
    pthread_cond_t queued, done; // something waits; something has ended
    hw_request *first, *last;
    bool closing;
    hw_bandwidth bandwidth;
    hw_source_stats stats;
};

bool hw_location_is_url(const char *location)
{
    return strncasecmp(location, "http://", 7) == 0 || strncasecmp(location, "https://", 8) == 0;
}

// ---- time and bandwidth ----

static double real_now(void *context)
{
    (void)context;
    return hw_clock_ms() / 1000;
}

static void real_sleep(void *context, double seconds)
{
    (void)context;
    struct timespec t = {(time_t)seconds, (long)((seconds - (double)(time_t)seconds) * 1e9)};
    nanosleep(&t, NULL);
}

// False as soon as the read is cancelled.
static bool sleep_on(const hw_source *s, double seconds, const atomic_bool *cancelled)
{
    while (seconds > 0 && !atomic_load(cancelled)) {
        double slice = seconds < SLEEP_MOST_S ? seconds : SLEEP_MOST_S;
        s->clock.sleep_s(s->clock.context, slice);
        seconds -= slice;
    }
    return !atomic_load(cancelled);
}

bool hw_fetch_pace(const hw_fetch *fetch, size_t bytes)
{
    hw_source *s = fetch->source;
    pthread_mutex_lock(&s->mutex);
    s->stats.bytes += bytes;
    double wait = hw_bandwidth_take(&s->bandwidth, bytes, s->clock.now_s(s->clock.context));
    pthread_mutex_unlock(&s->mutex);
    return sleep_on(s, wait, fetch->cancelled);
}

// ---- the threads ----

static void free_request(hw_request *r)
{
    hw_free(r->block.data);
    hw_free(r->path);
    hw_free(r);
}

// All attempts at one read.
static hw_status serve(hw_source *s, void *connection, hw_request *r)
{
    double wait = s->desc.wait_ms / 1000.0, most = s->desc.wait_max_ms / 1000.0;
    for (uint32_t attempt = 0;; attempt++) {
        hw_fetch f = {.source = s,
                      .path = r->path,
                      .offset = r->offset,
                      .size = r->size,
                      .cancelled = &r->cancelled,
                      .timeout_ms = s->desc.timeout_ms};
        hw_status status = s->backend->read(connection, &f);
        if (status == HW_OK) {
            r->block = f.block;
            return HW_OK;
        }
        hw_free(f.block.data);
        if (!f.again || attempt >= s->desc.retries || !sleep_on(s, wait, &r->cancelled))
            return status;
        wait = wait * 2 < most ? wait * 2 : most;
        pthread_mutex_lock(&s->mutex);
        s->stats.retries++;
        pthread_mutex_unlock(&s->mutex);
    }
}

// Under the mutex. NULL once the source closes.
static hw_request *next_request(hw_source *s)
{
    while (!s->first && !s->closing)
        pthread_cond_wait(&s->queued, &s->mutex);
    hw_request *r = s->first;
    if (!r || s->closing)
        return NULL;
    s->first = r->next;
    if (!s->first)
        s->last = NULL;
    r->state = STATE_RUNNING;
    return r;
}

// Under the mutex.
static void end_request(hw_source *s, hw_request *r)
{
    bool wanted = !atomic_load(&r->cancelled);
    s->stats.requests++;
    s->stats.cancelled += !wanted;
    s->stats.errors += wanted && r->status != HW_OK;
    r->state = STATE_DONE;
    if (!wanted)
        free_request(r);
    pthread_cond_broadcast(&s->done);
}

static void *work(void *argument)
{
    hw_source *s = argument;
    hw_request *r;
    void *connection = NULL;
    char why[HW_ERROR_CAPACITY];
    hw_status connected = HW_OK;
    if (s->backend->connect)
        connected = s->backend->connect(&connection);
    hw_error_save(why);
    pthread_mutex_lock(&s->mutex);
    while ((r = next_request(s))) {
        pthread_mutex_unlock(&s->mutex);
        if (connected == HW_OK) {
            r->status = serve(s, connection, r);
        } else {
            hw_error_restore(why);
            r->status = hw_fail_prefix(connected, r->path);
        }
        if (r->status != HW_OK)
            hw_error_save(r->error);
        pthread_mutex_lock(&s->mutex);
        end_request(s, r);
        if (s->desc.notify) {
            pthread_mutex_unlock(&s->mutex);
            s->desc.notify(s->desc.notify_context);
            pthread_mutex_lock(&s->mutex);
        }
    }
    pthread_mutex_unlock(&s->mutex);
    if (s->backend->disconnect)
        s->backend->disconnect(connection);
    return NULL;
}

// ---- opening and closing ----

static void set_defaults(hw_source_desc *d)
{
    bool remote = hw_location_is_url(d->location);
    d->threads = d->threads ? d->threads : remote ? 3 : 1;
    d->threads = d->threads < THREADS_MAX ? d->threads : THREADS_MAX;
    d->timeout_ms = d->timeout_ms ? d->timeout_ms : 10000;
    d->retries = d->retries ? d->retries : 4;
    d->wait_ms = d->wait_ms ? d->wait_ms : 200;
    d->wait_max_ms = d->wait_max_ms ? d->wait_max_ms : 5000;
}

static hw_status start_threads(hw_source *s)
{
    for (uint32_t i = 0; i < s->desc.threads; i++) {
        if (pthread_create(&s->threads[i], NULL, work, s) != 0)
            return hw_fail(HW_MEMORY, "%s: no thread to read it", s->location);
        s->thread_count++;
    }
    return HW_OK;
}

hw_status hw_source_open(hw_source **out, const hw_source_desc *desc)
{
    hw_status status = HW_OK;
    hw_source *s = NULL;
    *out = NULL;
    bool remote = hw_location_is_url(desc->location);
    if (!remote && strstr(desc->location, "://"))
        return hw_fail(HW_USAGE, "%s: only http:// and https:// are known", desc->location);
    HW_TRY(HW_NEW(&s, 1));
    pthread_mutex_init(&s->mutex, NULL);
    pthread_cond_init(&s->queued, NULL);
    pthread_cond_init(&s->done, NULL);
    s->backend = remote ? &hw_source_http : &hw_source_disk;
    s->clock = desc->clock ? *desc->clock : (hw_source_clock){real_now, real_sleep, NULL};
    s->desc = *desc;
    set_defaults(&s->desc);
    s->desc.clock = NULL;
    hw_bandwidth_init(&s->bandwidth, desc->bytes_per_second, s->clock.now_s(s->clock.context));
    HW_GO(hw_strdup(&s->location, desc->location));
    s->desc.location = s->location;
    for (size_t n = strlen(s->location); n > 1 && s->location[n - 1] == '/'; n--)
        s->location[n - 1] = 0;
    HW_GO(start_threads(s));
    *out = s;
    return HW_OK;
out:
    hw_source_close(s);
    return status;
}

void hw_source_close(hw_source *source)
{
    if (!source)
        return;
    pthread_mutex_lock(&source->mutex);
    assert(!source->first);
    source->closing = true;
    pthread_cond_broadcast(&source->queued);
    pthread_mutex_unlock(&source->mutex);
    for (uint32_t i = 0; i < source->thread_count; i++)
        pthread_join(source->threads[i], NULL);
    pthread_cond_destroy(&source->queued);
    pthread_cond_destroy(&source->done);
    pthread_mutex_destroy(&source->mutex);
    hw_free(source->location);
    hw_free(source);
}

const char *hw_source_location(const hw_source *source)
{
    return source->location;
}

hw_source_stats hw_source_get_stats(hw_source *source)
{
    pthread_mutex_lock(&source->mutex);
    hw_source_stats stats = source->stats;
    pthread_mutex_unlock(&source->mutex);
    return stats;
}

// ---- requests ----

hw_status hw_source_start(hw_source *source, const char *name, uint64_t offset, uint64_t size,
                          hw_request **out)
{
    hw_request *r = NULL;
    *out = NULL;
    assert(size > 0 || offset == 0);
    HW_TRY(HW_NEW(&r, 1));
    r->source = source;
    r->offset = offset;
    r->size = size;
    hw_status status = hw_path_join(&r->path, source->location, name);
    if (status != HW_OK) {
        free_request(r);
        return status;
    }
    pthread_mutex_lock(&source->mutex);
    if (source->last)
        source->last->next = r;
    else
        source->first = r;
    source->last = r;
    pthread_cond_signal(&source->queued);
    pthread_mutex_unlock(&source->mutex);
    *out = r;
    return HW_OK;
}

bool hw_request_done(hw_request *request)
{
    pthread_mutex_lock(&request->source->mutex);
    bool done = request->state == STATE_DONE;
    pthread_mutex_unlock(&request->source->mutex);
    return done;
}

hw_status hw_request_finish(hw_request *request, hw_block *out)
{
    hw_source *s = request->source;
    pthread_mutex_lock(&s->mutex);
    while (request->state != STATE_DONE)
        pthread_cond_wait(&s->done, &s->mutex);
    pthread_mutex_unlock(&s->mutex);
    hw_status status = request->status;
    if (status != HW_OK)
        hw_error_restore(request->error);
    *out = request->block;
    request->block = (hw_block){0};
    free_request(request);
    return status;
}

// Under the mutex.
static void unlink_request(hw_source *s, const hw_request *request)
{
    hw_request **link = &s->first, *before = NULL;
    while (*link != request) {
        before = *link;
        link = &(*link)->next;
    }
    *link = request->next;
    if (s->last == request)
        s->last = before;
}

void hw_request_cancel(hw_request *request)
{
    if (!request)
        return;
    hw_source *s = request->source;
    pthread_mutex_lock(&s->mutex);
    if (request->state == STATE_RUNNING) {
        atomic_store(&request->cancelled, true);
    } else {
        if (request->state == STATE_QUEUED)
            unlink_request(s, request);
        s->stats.cancelled++;
        free_request(request);
    }
    pthread_mutex_unlock(&s->mutex);
}

hw_status hw_source_read(hw_source *source, const char *name, uint64_t offset, uint64_t size,
                         hw_block *out)
{
    hw_request *request = NULL;
    *out = (hw_block){0};
    HW_TRY(hw_source_start(source, name, offset, size, &request));
    return hw_request_finish(request, out);
}
