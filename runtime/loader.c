#include "loader.h"
#include "alloc.h"
#include "file.h"
#include "image_io.h"
#include "log.h"
#include "mesh_file.h"
#include "ring.h"
#include "system.h"
#include <math.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#define JOBS_MAX       2u // reads going on at a time
#define WISHES_MAX     4096u
#define RESULTS_MAX    64u
#define DISPOSALS_MAX  4096u
#define PRIORITY_LOWER 10  // nice value of the thread
#define CELL_RATIO     4.0 // bytes of a cell in memory per byte of its file, until more is seen

// A piece on its way.
typedef struct job {
    hw_data_key key;
    double t_priority;
    hw_request *request;
    bool front;            // the request is for a mesh file's front, not for a level
    bool again;            // what came first was damaged
    uint64_t stored_bytes; // read so far
} job;

// A wish, and how many results had been taken when it was made.
typedef struct sent_wish {
    hw_wish wish;
    uint64_t taken_count;
} sent_wish;

typedef struct disposal {
    hw_loaded *loaded;
    bool all;
} disposal;

struct hw_loader {
    const hw_manifest *manifest;
    hw_source *source;
    uint64_t ram_budget;
    hw_mesh_file **tables; // by mesh; NULL: not opened
    hw_prefetch_queue queue;
    job jobs[JOBS_MAX];
    uint32_t job_count;
    hw_ring wishes, results, disposals;
    hw_data_key result_keys[RESULTS_MAX]; // of the last results, by number
    uint64_t result_count, taken_count;   // since the start; the second is the drawing thread's
    // What is known of sizes before a piece is decoded.
    double cell_ratio;       // the largest that was seen
    uint64_t *texture_bytes; // of those that were seen
    bool *has_uvs;           // by mesh
    _Atomic uint64_t timestamp, ram_bytes, ram_peak, bytes;
    // Of the most urgent wish, if it waits for the budget: bytes with those of what is going on.
    _Atomic uint64_t room_wanted;
    _Atomic double room_priority;
    _Atomic uint32_t queued;
    hw_loader_mode mode;
    bool started; // the thread
    pthread_t thread;
    sem_t wake;
    atomic_bool stopping;
    // Simulated time: of the loader, of the frame, and within what the loader is doing.
    double now_s, frame_s, step_start_s, slept_s, slept_all_s;
    double cpu_start_s, read_s; // of a step: processor time at its start, and time spent on reading
    hw_loaded *held;            // taken from the ring, not ready yet
};

// ---- what is where ---------------------------------------------------------------------------

static void name_of(const hw_loader *l, hw_data_key key, char out[HW_FILE_NAME_BYTES])
{
    if (key.kind == HW_DATA_CELL)
        hw_cell_name(out, l->manifest->cells[key.index].id);
    else if (key.kind == HW_DATA_TEXTURE)
        hw_texture_name(out, key.index);
    else
        hw_mesh_name(out, key.index);
}

static hw_status path_of(const hw_loader *l, hw_data_key key, char **out)
{
    char name[HW_FILE_NAME_BYTES];
    name_of(l, key, name);
    return hw_path_join(out, hw_source_location(l->source), name);
}

static hw_status start_request(hw_loader *l, job *j)
{
    char name[HW_FILE_NAME_BYTES];
    uint64_t offset = 0, size = 0;
    name_of(l, j->key, name);
    j->front =
        j->key.kind == HW_DATA_MESH || (j->key.kind == HW_DATA_LEVEL && !l->tables[j->key.index]);
    if (j->front) {
        size = HW_MESH_FRONT_BYTES;
    } else if (j->key.kind == HW_DATA_LEVEL) {
        const hw_mesh_file *file = l->tables[j->key.index];
        if (j->key.level >= hw_mesh_file_level_count(file))
            return hw_fail(HW_FORMAT, "%s/%s: has changed: no level %u",
                           hw_source_location(l->source), name, j->key.level);
        hw_mesh_file_level_place(file, j->key.level, &offset, &size);
    }
    return hw_source_start(l->source, name, offset, size, &j->request);
}

// ---- decoding --------------------------------------------------------------------------------

static void free_loaded(hw_loaded *loaded)
{
    hw_cell_data_free(&loaded->cell);
    hw_near_data_free(&loaded->level);
    hw_image_free(&loaded->texture);
    hw_free(loaded->table.errors);
    hw_free(loaded->table.gpu_bytes);
    hw_free(loaded->table.triangles);
    hw_free(loaded->table.items);
    hw_free(loaded);
}

static hw_status copy_table(const hw_mesh_file *file, uint32_t mesh, hw_mesh_table *out)
{
    uint32_t count = hw_mesh_file_level_count(file);
    HW_TRY(HW_NEW(&out->errors, count));
    HW_TRY(HW_NEW(&out->gpu_bytes, count));
    HW_TRY(HW_NEW(&out->triangles, count));
    HW_TRY(HW_NEW(&out->items, count));
    for (uint32_t i = 0; i < count; i++) {
        const hw_mesh_level_info *info = hw_mesh_file_level(file, i);
        out->errors[i] = hw_mesh_level_error(info);
        out->items[i].key = (hw_data_key){HW_DATA_LEVEL, mesh, i};
        out->triangles[i] = info->index_count / 3;
        out->gpu_bytes[i] = hw_near_level_bytes(info->vertex_count, info->index_count, false);
    }
    out->level_count = count;
    return HW_OK;
}

static hw_status decode_level(hw_loader *l, hw_data_key key, const char *path,
                              const hw_block *block, hw_near_data *out)
{
    const hw_mesh_file *table = l->tables[key.index];
    hw_mesh mesh = {0};
    hw_inner_boxes boxes;
    // Another level of the file may have been found damaged meanwhile: the table went with it.
    if (!table || key.level >= hw_mesh_file_level_count(table))
        return hw_fail(HW_FORMAT, "%s: has changed", path);
    HW_TRY(hw_mesh_file_decode(table, key.level, block->data, block->size, &mesh, &boxes));
    hw_status status = hw_near_data_make(&mesh, &boxes, out);
    hw_mesh_free(&mesh);
    return status;
}

static hw_status decode_texture(const char *path, const hw_block *block, hw_image *out)
{
    hw_image image = {0};
    hw_status status = hw_image_decode(path, block->data, block->size, &image);
    if (status == HW_OK)
        status = hw_image_make(out, image.width, image.height, 4);
    if (status == HW_OK)
        hw_gpu_expand_rgba(&image, out->data);
    hw_image_free(&image);
    return status;
}

static hw_status decode(hw_loader *l, const job *j, const char *path, const hw_block *block,
                        hw_loaded *out)
{
    uint32_t index = j->key.index;
    switch (j->key.kind) {
    case HW_DATA_CELL:
        HW_TRY(hw_cell_data_make(l->manifest, l->manifest->cells[index].id, path, block->data,
                                 block->size, &out->cell));
        out->ram_bytes = hw_cell_data_bytes(&out->cell);
        return HW_OK;
    case HW_DATA_MESH:
        return copy_table(l->tables[index], index, &out->table);
    case HW_DATA_LEVEL:
        HW_TRY(decode_level(l, j->key, path, block, &out->level));
        out->ram_bytes = hw_near_level_bytes(out->level.vertex_count, out->level.index_count,
                                             out->level.has_uvs);
        return HW_OK;
    default:
        HW_TRY(decode_texture(path, block, &out->texture));
        out->ram_bytes = (uint64_t)out->texture.width * out->texture.height * 4;
        return HW_OK;
    }
}

static hw_status open_table(hw_loader *l, uint32_t mesh, const char *path, const hw_block *block)
{
    hw_mesh_file *file = NULL;
    HW_TRY(hw_mesh_file_open_front(&file, path, block->data, block->size, block->file_bytes));
    hw_mesh_file_close(l->tables[mesh]);
    l->tables[mesh] = file;
    return HW_OK;
}

// Waits for the job's request and decodes what it gave. Out of a mesh file's front comes a second
// request if it was a level that was wanted: *more.
static hw_status take_request(hw_loader *l, job *j, hw_loaded *out, bool *more)
{
    hw_status status = HW_OK;
    hw_block block = {0};
    char *path = NULL;
    *more = false;
    double start_ms = hw_clock_ms();
    status = hw_request_finish(j->request, &block);
    l->read_s += (hw_clock_ms() - start_ms) / 1000;
    j->request = NULL;
    HW_GO(status);
    j->stored_bytes += block.size;
    atomic_fetch_add(&l->bytes, block.size);
    HW_GO(path_of(l, j->key, &path));
    if (j->front)
        HW_GO(open_table(l, j->key.index, path, &block));
    if (j->front && j->key.kind == HW_DATA_LEVEL) {
        HW_GO(start_request(l, j));
        *more = true;
        goto out;
    }
    HW_GO(decode(l, j, path, &block, out));
out:
    hw_free(block.data);
    hw_free(path);
    return status;
}

// One step of a job whose request has ended (or, waiting, of any). NULL: it has another request; or
// for want of memory there is nothing to tell of it: *gone.
static hw_loaded *step_job(hw_loader *l, job *j, bool *gone)
{
    hw_loaded *out = NULL;
    bool more = false;
    *gone = false;
    if (HW_NEW(&out, 1) != HW_OK) {
        hw_request_cancel(j->request);
        *gone = true;
        return NULL;
    }
    hw_status status = j->request ? take_request(l, j, out, &more) : start_request(l, j);
    more = more || (status == HW_OK && j->request);
    // Damaged on the way, perhaps, or changed since its table was read: once more from the start.
    if (status == HW_FORMAT && !j->again) {
        j->again = true;
        if (j->key.kind == HW_DATA_LEVEL) {
            hw_mesh_file_close(l->tables[j->key.index]);
            l->tables[j->key.index] = NULL;
        }
        status = start_request(l, j);
        more = status == HW_OK;
    }
    if (more) {
        free_loaded(out);
        return NULL;
    }
    out->key = j->key;
    out->status = status;
    out->stored_bytes = j->stored_bytes;
    if (status != HW_OK) {
        hw_error_save(out->error);
        if (l->started) // others return the error
            hw_log_warning("%s", out->error);
    }
    return out;
}

// ---- the budget ------------------------------------------------------------------------------

// Bytes that a piece will take once decoded, about.
static uint64_t estimate(const hw_loader *l, hw_data_key key)
{
    const hw_mesh_file *table = key.kind == HW_DATA_LEVEL ? l->tables[key.index] : NULL;
    if (key.kind == HW_DATA_CELL)
        return (uint64_t)ceil(l->cell_ratio * (double)l->manifest->cells[key.index].bytes);
    if (key.kind == HW_DATA_TEXTURE)
        return l->texture_bytes[key.index];
    if (!table || key.level >= hw_mesh_file_level_count(table))
        return 0;
    const hw_mesh_level_info *info = hw_mesh_file_level(table, key.level);
    return hw_near_level_bytes(info->vertex_count, info->index_count, l->has_uvs[key.index]);
}

// What is learnt from a piece makes its next estimate no less than what it takes.
static void learn_size(hw_loader *l, const hw_loaded *loaded)
{
    hw_data_key key = loaded->key;
    if (key.kind == HW_DATA_CELL && l->manifest->cells[key.index].bytes > 0)
        l->cell_ratio = fmax(l->cell_ratio, (double)loaded->ram_bytes /
                                                (double)l->manifest->cells[key.index].bytes);
    else if (key.kind == HW_DATA_TEXTURE)
        l->texture_bytes[key.index] = loaded->ram_bytes;
    else if (key.kind == HW_DATA_LEVEL)
        l->has_uvs[key.index] = loaded->level.has_uvs;
}

// Bytes that will be held once all that is going on, but jobs[except], has been decoded.
static uint64_t reserved_bytes(const hw_loader *l, uint32_t except)
{
    uint64_t bytes = atomic_load(&l->ram_bytes);
    for (uint32_t i = 0; i < l->job_count; i++)
        bytes += i == except ? 0 : estimate(l, l->jobs[i].key);
    return bytes;
}

#define NO_JOB UINT32_MAX

// Whether the wish may be begun. What is larger than the budget may when there is nothing else,
// lest it be waited for for ever.
static bool has_room(hw_loader *l, const hw_wish *wish)
{
    uint64_t reserved = reserved_bytes(l, NO_JOB), wanted = reserved + estimate(l, wish->key);
    if (hw_ring_count(&l->results) + l->job_count + 1 > RESULTS_MAX)
        return false;
    if (wanted <= l->ram_budget || reserved == 0)
        return true;
    atomic_store(&l->room_priority, wish->t_priority);
    atomic_store(&l->room_wanted, wanted - atomic_load(&l->ram_bytes));
    return false;
}

uint64_t hw_loader_lacks(const hw_loader *loader, double *t_priority)
{
    uint64_t wanted = atomic_load(&loader->room_wanted);
    uint64_t bytes = atomic_load(&loader->ram_bytes) + wanted;
    *t_priority = atomic_load(&loader->room_priority);
    if (wanted == 0 || bytes <= loader->ram_budget)
        return 0;
    return bytes - loader->ram_budget;
}

static void hold(hw_loader *l, const hw_loaded *loaded)
{
    uint64_t bytes = atomic_fetch_add(&l->ram_bytes, loaded->ram_bytes) + loaded->ram_bytes;
    if (bytes > atomic_load(&l->ram_peak))
        atomic_store(&l->ram_peak, bytes);
}

// Takes what jobs[i] (or, NO_JOB, what is none) has loaded into the account; or throws it away, if
// it turned out to be larger than it was thought to be and than what is left: it is wished for
// again, now with its true size.
static void put_result(hw_loader *l, uint32_t i, double t_priority, hw_loaded *loaded)
{
    uint64_t others = reserved_bytes(l, i);
    const hw_wish wish = {loaded->key, t_priority};
    hw_wish lost;
    learn_size(l, loaded);
    if (others > 0 && others + loaded->ram_bytes > l->ram_budget && loaded->ram_bytes > 0) {
        free_loaded(loaded);
        (void)hw_prefetch_queue_put(&l->queue, &wish, &lost);
        return;
    }
    hold(l, loaded);
    l->result_keys[l->result_count++ % RESULTS_MAX] = loaded->key;
    if (hw_ring_put(&l->results, &loaded)) // has_room has left some
        return;
    atomic_fetch_sub(&l->ram_bytes, loaded->ram_bytes);
    free_loaded(loaded);
}

// ---- simulated time --------------------------------------------------------------------------

static double simulated_now(void *context)
{
    const hw_loader *l = context;
    return l->now_s + l->slept_s + hw_clock_ms() / 1000 - l->step_start_s;
}

static void simulated_sleep(void *context, double seconds)
{
    hw_loader *l = context;
    l->slept_s += seconds;
    l->slept_all_s += seconds;
}

static void step_begin(hw_loader *l)
{
    l->slept_s = l->read_s = 0;
    l->step_start_s = hw_clock_ms() / 1000;
    l->cpu_start_s = hw_thread_seconds();
}

// Decoding counts by its processor time: what else the machine does is not the dataset's fault.
static void step_end(hw_loader *l)
{
    l->now_s += l->slept_s + l->read_s + hw_thread_seconds() - l->cpu_start_s;
    step_begin(l);
}

static hw_loaded *load_now(hw_loader *l, hw_data_key key)
{
    job j = {.key = key};
    bool gone = false;
    hw_loaded *out = NULL;
    step_begin(l);
    while (!out && !gone)
        out = step_job(l, &j, &gone);
    step_end(l);
    return out;
}

hw_loaded *hw_loader_load(hw_loader *loader, hw_data_key key)
{
    hw_loaded *out = load_now(loader, key);
    if (out)
        hold(loader, out);
    return out;
}

// ---- freeing ---------------------------------------------------------------------------------

static void dispose(disposal d)
{
    if (d.all)
        free_loaded(d.loaded);
    else
        hw_cell_data_free_bulk(&d.loaded->cell);
}

static void take_disposals(hw_loader *l)
{
    disposal d;
    while (hw_ring_take(&l->disposals, &d))
        dispose(d);
}

void hw_loader_dispose(hw_loader *loader, hw_loaded *loaded, bool all)
{
    disposal d = {loaded, all};
    // The loader frees before it begins anything: what is given back counts no more.
    atomic_fetch_sub(&loader->ram_bytes, loaded->ram_bytes);
    loaded->ram_bytes = 0;
    if (loader->started && hw_ring_put(&loader->disposals, &d))
        sem_post(&loader->wake);
    else
        dispose(d);
}

// ---- the thread ------------------------------------------------------------------------------

static void publish_queued(hw_loader *l)
{
    atomic_store(&l->queued, l->queue.count + l->job_count);
}

// Whether the result had not been taken yet when it was wished for: it has come meanwhile.
static bool has_come(const hw_loader *l, const sent_wish *sent)
{
    uint64_t oldest = l->result_count > RESULTS_MAX ? l->result_count - RESULTS_MAX : 0;
    for (uint64_t i = l->result_count; i > oldest && i > sent->taken_count; i--)
        if (hw_data_key_equal(l->result_keys[(i - 1) % RESULTS_MAX], sent->wish.key))
            return true;
    return false;
}

static void take_wishes(hw_loader *l)
{
    sent_wish sent;
    hw_wish lost;
    while (hw_ring_take(&l->wishes, &sent)) {
        const hw_wish wish = sent.wish;
        bool running = has_come(l, &sent);
        for (uint32_t i = 0; i < l->job_count && !running; i++) {
            running = hw_data_key_equal(l->jobs[i].key, wish.key);
            if (running)
                l->jobs[i].t_priority = wish.t_priority;
        }
        if (!running)
            (void)hw_prefetch_queue_put(&l->queue, &wish, &lost);
    }
}

static void drop_stale(hw_loader *l)
{
    double timestamp = (double)atomic_load(&l->timestamp);
    hw_wish wish;
    while (hw_prefetch_queue_drop(&l->queue, timestamp, &wish))
        ;
    for (uint32_t i = 0; i < l->job_count;) {
        if (l->jobs[i].t_priority >= timestamp - HW_PREFETCH_STALE) {
            i++;
            continue;
        }
        hw_request_cancel(l->jobs[i].request);
        l->jobs[i] = l->jobs[--l->job_count];
    }
}

static void start_jobs(hw_loader *l)
{
    hw_wish wish;
    atomic_store(&l->room_wanted, 0);
    while (l->job_count < JOBS_MAX && hw_prefetch_queue_peek(&l->queue, &wish) &&
           has_room(l, &wish) && hw_prefetch_queue_take(&l->queue, &wish)) {
        job j = {.key = wish.key, .t_priority = wish.t_priority};
        bool gone;
        hw_loaded *failed = step_job(l, &j, &gone);
        if (failed)
            put_result(l, NO_JOB, wish.t_priority, failed);
        else if (!gone)
            l->jobs[l->job_count++] = j;
    }
}

// Decodes the first job whose request has ended; false: there is none.
static bool finish_job(hw_loader *l)
{
    for (uint32_t i = 0; i < l->job_count; i++) {
        if (!hw_request_done(l->jobs[i].request))
            continue;
        bool gone;
        hw_loaded *out = step_job(l, &l->jobs[i], &gone);
        if (out)
            put_result(l, i, l->jobs[i].t_priority, out);
        if (out || gone)
            l->jobs[i] = l->jobs[--l->job_count];
        return true;
    }
    return false;
}

static void *work(void *argument)
{
    hw_loader *l = argument;
    (void)setpriority(PRIO_PROCESS, (id_t)gettid(), PRIORITY_LOWER);
    while (!atomic_load(&l->stopping)) {
        take_wishes(l);
        drop_stale(l);
        take_disposals(l);
        start_jobs(l);
        bool busy = finish_job(l);
        publish_queued(l);
        if (busy)
            continue;
        while (sem_wait(&l->wake) != 0)
            ;
        while (sem_trywait(&l->wake) == 0)
            ;
    }
    for (uint32_t i = 0; i < l->job_count; i++)
        hw_request_cancel(l->jobs[i].request);
    return NULL;
}

static void wake(void *context)
{
    sem_post(context);
}

// ---- working in simulated time ---------------------------------------------------------------

double hw_loader_slept(const hw_loader *loader)
{
    return loader->slept_all_s;
}

void hw_loader_run(hw_loader *loader, double until_s)
{
    hw_loader *l = loader;
    hw_wish wish;
    l->frame_s = until_s;
    take_wishes(l);
    drop_stale(l);
    atomic_store(&l->room_wanted, 0);
    while (l->now_s < until_s && hw_prefetch_queue_peek(&l->queue, &wish) && has_room(l, &wish) &&
           hw_prefetch_queue_take(&l->queue, &wish)) {
        hw_loaded *out = load_now(l, wish.key);
        if (!out)
            continue;
        out->ready_s = l->now_s;
        put_result(l, NO_JOB, wish.t_priority, out);
    }
    if (l->now_s < until_s)
        l->now_s = until_s; // idle
    publish_queued(l);
}

// ---- the thread that draws -------------------------------------------------------------------

bool hw_loader_wish(hw_loader *loader, const hw_wish *wish)
{
    const sent_wish sent = {*wish, loader->taken_count};
    bool fits = hw_ring_put(&loader->wishes, &sent);
    sem_post(&loader->wake);
    return fits;
}

void hw_loader_set_timestamp(hw_loader *loader, uint64_t timestamp)
{
    atomic_store(&loader->timestamp, timestamp);
}

hw_loaded *hw_loader_take(hw_loader *loader)
{
    hw_loaded *out = loader->held;
    loader->held = NULL;
    if (!out && !hw_ring_take(&loader->results, &out))
        return NULL;
    if (out->ready_s > loader->frame_s) {
        loader->held = out;
        return NULL;
    }
    loader->taken_count++;
    if (loader->started)
        sem_post(&loader->wake); // there is room
    return out;
}

hw_loader_stats hw_loader_get_stats(const hw_loader *loader)
{
    return (hw_loader_stats){.queued = atomic_load(&loader->queued),
                             .ram_bytes = atomic_load(&loader->ram_bytes),
                             .ram_peak = atomic_load(&loader->ram_peak),
                             .bytes = atomic_load(&loader->bytes)};
}

// ---- making and freeing ----------------------------------------------------------------------

static hw_status open_source(hw_loader *l, const hw_loader_desc *desc)
{
    const hw_source_clock clock = {simulated_now, simulated_sleep, l};
    bool threaded = desc->mode == HW_LOADER_THREAD;
    const hw_source_desc source = {.location = desc->location,
                                   .bytes_per_second = desc->bytes_per_second,
                                   .clock = desc->mode == HW_LOADER_SIMULATED ? &clock : NULL,
                                   .notify = threaded ? wake : NULL,
                                   .notify_context = &l->wake,
                                   .timeout_ms = desc->timeout_ms,
                                   .wait_ms = desc->wait_ms};
    step_begin(l);
    return hw_source_open(&l->source, &source);
}

hw_status hw_loader_create(const hw_loader_desc *desc, hw_loader **out)
{
    hw_status status = HW_OK;
    hw_loader *l = NULL;
    *out = NULL;
    HW_TRY(HW_NEW(&l, 1));
    sem_init(&l->wake, 0, 0);
    l->manifest = desc->manifest;
    l->ram_budget = desc->ram_budget;
    l->mode = desc->mode;
    l->cell_ratio = CELL_RATIO;
    HW_GO(HW_NEW(&l->tables, desc->manifest->mesh_count));
    HW_GO(HW_NEW(&l->has_uvs, desc->manifest->mesh_count));
    HW_GO(HW_NEW(&l->texture_bytes, desc->manifest->texture_count));
    HW_GO(hw_ring_create(&l->wishes, WISHES_MAX, sizeof(sent_wish)));
    HW_GO(hw_ring_create(&l->results, RESULTS_MAX, sizeof(hw_loaded *)));
    HW_GO(hw_ring_create(&l->disposals, DISPOSALS_MAX, sizeof(disposal)));
    HW_GO(open_source(l, desc));
    l->started = desc->mode == HW_LOADER_THREAD;
    if (l->started && pthread_create(&l->thread, NULL, work, l) != 0) {
        l->started = false;
        status = hw_fail(HW_MEMORY, "%s: no thread to load it", desc->location);
        goto out;
    }
    *out = l;
    return HW_OK;
out:
    hw_loader_destroy(l);
    return status;
}

void hw_loader_destroy(hw_loader *loader)
{
    if (!loader)
        return;
    if (loader->started) {
        atomic_store(&loader->stopping, true);
        sem_post(&loader->wake);
        pthread_join(loader->thread, NULL);
    }
    hw_loaded *loaded = loader->held;
    if (loaded)
        free_loaded(loaded);
    if (loader->disposals.items)
        take_disposals(loader);
    while (loader->results.items && hw_ring_take(&loader->results, &loaded))
        free_loaded(loaded);
    hw_source_close(loader->source);
    for (uint32_t i = 0; loader->tables && i < loader->manifest->mesh_count; i++)
        hw_mesh_file_close(loader->tables[i]);
    hw_free(loader->tables);
    hw_free(loader->has_uvs);
    hw_free(loader->texture_bytes);
    hw_ring_free(&loader->wishes);
    hw_ring_free(&loader->results);
    hw_ring_free(&loader->disposals);
    sem_destroy(&loader->wake);
    hw_free(loader);
}
