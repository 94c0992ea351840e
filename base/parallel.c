#include "parallel.h"
#include "alloc.h"
#include <pthread.h>
#include <sched.h>

#define THREADS_MAX 1024u

typedef struct loop {
    struct loop *root;       // the outermost loop around this one, or itself
    uint32_t threads;        // of the root: how many may work at a time
    _Atomic uint32_t active; // of the root: how many do, in loops within too
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

static _Thread_local loop *current_root; // of the loop whose body this thread is in

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

static void take_indices(loop *l, uint32_t thread)
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
    current_root = w->loop->root;
    take_indices(w->loop, w->thread);
    atomic_fetch_sub(&w->loop->root->active, 1);
    return NULL;
}

// Counts one more thread as active if the root has one to spare.
static bool claim_thread(loop *root)
{
    uint32_t active = atomic_load(&root->active);
    while (active < root->threads)
        if (atomic_compare_exchange_weak(&root->active, &active, active + 1))
            return true;
    return false;
}

// The caller's part. In an outermost loop it is one of the threads; in one within, it is counted
// already.
static void work_here(loop *l)
{
    loop *around = current_root;
    current_root = l->root;
    take_indices(l, 0);
    current_root = around;
    if (!around)
        atomic_fetch_sub(&l->active, 1);
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
    l.root = current_root ? current_root : &l;
    l.threads = threads;
    atomic_init(&l.active, threads);
    HW_TRY(HW_NEW(&workers, threads));
    pthread_mutex_init(&l.mutex, NULL);

    // A system that refuses further threads gets the work done by those it gave.
    bool within = l.root != &l;
    for (; started < threads && (!within || claim_thread(l.root)); started++) {
        workers[started] = (worker){.loop = &l, .thread = started};
        if (pthread_create(&workers[started].handle, NULL, worker_main, &workers[started]) != 0) {
            atomic_fetch_sub(&l.root->active, within ? 1 : threads - started);
            break;
        }
    }
    work_here(&l);
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
