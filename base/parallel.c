#include "parallel.h"
#include "alloc.h"
#include <pthread.h>
#include <sched.h>

#define THREADS_MAX 1024u

typedef struct loop {
    uint64_t count;
    hw_parallel_fn fn;
    void *context;
    const atomic_bool *stop;
    _Atomic uint64_t next;
    atomic_bool halted, interrupted;

    pthread_mutex_t mutex; // guards what follows
    hw_status status;
    uint64_t failed_index;
    char error[HW_ERROR_CAPACITY];
} loop;

typedef struct worker {
    loop *loop;
    uint32_t thread;
    pthread_t handle;
} worker;

uint32_t hw_thread_count_default(void)
{
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof set, &set) != 0)
        return 1;
    int count = CPU_COUNT(&set);
    return count < 1 ? 1 : (uint32_t)count;
}

// Indices are handed out in rising order, so every index below a failed one was started too and the
// lowest failure is the same with any number of threads: that one is kept.
static void record_failure(loop *l, uint64_t index, hw_status status)
{
    pthread_mutex_lock(&l->mutex);
    if (l->status == HW_OK || index < l->failed_index) {
        l->status = status;
        l->failed_index = index;
        hw_error_save(l->error);
    }
    pthread_mutex_unlock(&l->mutex);
    atomic_store(&l->halted, true);
}

static void work(loop *l, uint32_t thread)
{
    while (!atomic_load(&l->halted)) {
        if (l->stop && atomic_load(l->stop)) {
            if (atomic_load(&l->next) < l->count)
                atomic_store(&l->interrupted, true);
            return;
        }
        uint64_t index = atomic_fetch_add(&l->next, 1);
        if (index >= l->count)
            return;
        hw_status status = l->fn(l->context, index, thread);
        if (status != HW_OK)
            record_failure(l, index, status);
    }
}

static void *worker_main(void *argument)
{
    worker *w = argument;
    work(w->loop, w->thread);
    return NULL;
}

hw_status hw_parallel_for(uint64_t count, uint32_t threads, hw_parallel_fn fn, void *context,
                          const atomic_bool *stop)
{
    loop l = {.count = count, .fn = fn, .context = context, .stop = stop, .status = HW_OK};
    worker *workers = NULL;
    uint32_t started = 1;
    if (threads == 0)
        threads = hw_thread_count_default();
    if (threads > THREADS_MAX)
        threads = THREADS_MAX;
    if (threads > count)
        threads = count ? (uint32_t)count : 1;
    HW_TRY(HW_NEW(&workers, threads));
    pthread_mutex_init(&l.mutex, NULL);

    // A system that refuses further threads gets the work done by those it gave.
    for (; started < threads; started++) {
        workers[started] = (worker){.loop = &l, .thread = started};
        if (pthread_create(&workers[started].handle, NULL, worker_main, &workers[started]) != 0)
            break;
    }
    work(&l, 0);
    for (uint32_t i = 1; i < started; i++)
        pthread_join(workers[i].handle, NULL);

    pthread_mutex_destroy(&l.mutex);
    hw_free(workers);
    if (l.status != HW_OK)
        hw_error_restore(l.error);
    else if (atomic_load(&l.interrupted))
        return hw_fail(HW_INTERRUPTED, "interrupted");
    return l.status;
}
