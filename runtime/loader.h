// Reads pieces of a dataset and makes them ready for the GPU: on a thread of its own in the order
// of their urgency, or at once for a caller who waits. The thread that draws shares no lock with
// it: wishes, results and what is to be freed go through rings.
#pragma once
#include "cell_gpu.h"
#include "manifest.h"
#include "near_level.h"
#include "prefetch_queue.h"
#include "source.h"

// Where a piece is, for the store (store.h).
typedef enum hw_item_state {
    HW_ITEM_AWAY,
    HW_ITEM_IN_RAM,
    HW_ITEM_UPLOADING,
    HW_ITEM_READY // on the GPU; a table: here
} hw_item_state;

typedef struct hw_item {
    hw_data_key key;
    hw_item_state state;
    int place;     // where it is wanted (store.h)
    double stamp;  // its last t-priority; without a loader's thread the last frame it was used
    uint64_t used; // number of the last frame that drew it
    uint64_t gpu_bytes;
    uint64_t known_gpu, known_ram; // of a cell or texture that has been here: its bytes
    double retry_s, wait_s;        // after a failure: when, and how long the next wait is
    bool failed;                   // the last attempt to load it
    struct hw_loaded *loaded;      // in memory, and of a cell as long as it is on the GPU
    hw_cell_gpu *cell;
    hw_near_level level;
    hw_gpu_texture texture;
} hw_item;

// A near mesh's levels, finest first.
typedef struct hw_mesh_table {
    uint32_t level_count;
    float *errors;       // hw_mesh_level_error
    uint64_t *gpu_bytes; // without texture coordinates
    uint32_t *triangles;
    hw_item *items; // one for each, away
} hw_mesh_table;

// What became of a piece: by its key's kind one of cell, table, level and texture, or an error.
typedef struct hw_loaded {
    hw_data_key key;
    hw_status status;
    char error[HW_ERROR_CAPACITY];
    uint64_t stored_bytes; // read for it
    uint64_t ram_bytes;    // held until it is disposed of
    double ready_s;        // simulated time; else 0
    hw_cell_data cell;
    hw_mesh_table table;
    hw_near_data level;
    hw_image texture; // RGBA
} hw_loaded;

typedef enum hw_loader_mode {
    HW_LOADER_WAITS,     // works in hw_loader_load only
    HW_LOADER_THREAD,    // has a thread
    HW_LOADER_SIMULATED, // works in hw_loader_load and hw_loader_run, by simulated time
} hw_loader_mode;

typedef struct hw_loader_desc {
    const char *location;        // folder or URL
    const hw_manifest *manifest; // borrowed
    uint64_t bytes_per_second;   // 0 = no limit
    uint64_t ram_budget;         // bytes of results held at a time, at most; not where it waits
    hw_loader_mode mode;
    uint32_t timeout_ms, wait_ms; // of a web server, 0 = defaults (source.h)
} hw_loader_desc;

// The budget bounds what has been decoded and not been disposed of. What is being read or decoded
// (files, scratch) comes on top, two pieces at most. A piece that is larger than the whole budget
// is loaded when nothing else is held.
typedef struct hw_loader hw_loader;
HW_MUST_USE hw_status hw_loader_create(const hw_loader_desc *desc, hw_loader **out);
// Stops the thread and frees what lies in the rings. NULL is legal.
void hw_loader_destroy(hw_loader *loader);

// The following are for one thread, that which draws. None of them waits or allocates.

// Wishes for a piece, or changes the urgency of a wish. False: too many at once, try again later.
bool hw_loader_wish(hw_loader *loader, const hw_wish *wish);
// Wishes older than this less HW_PREFETCH_STALE are given up, running ones too.
void hw_loader_set_timestamp(hw_loader *loader, uint64_t timestamp);
// The next piece that is ready or has failed; NULL: none is. The caller's until disposed of.
hw_loaded *hw_loader_take(hw_loader *loader);
// Gives it back: all of it, or only what was on its way to the GPU.
void hw_loader_dispose(hw_loader *loader, hw_loaded *loaded, bool all);

typedef struct hw_loader_stats {
    uint32_t queued;    // wishes and reads going on
    uint64_t ram_bytes; // of results not disposed of
    uint64_t ram_peak;  // the most there were since the start
    uint64_t bytes;     // read since the start
} hw_loader_stats;
hw_loader_stats hw_loader_get_stats(const hw_loader *loader);
// Bytes that must be disposed of before the most urgent wish can be begun, and how urgent that is;
// 0: it is not the budget that it waits for.
uint64_t hw_loader_lacks(const hw_loader *loader, double *t_priority);

// Without a thread: loads the piece now. NULL for want of memory; else look at its status.
hw_loaded *hw_loader_load(hw_loader *loader, hw_data_key key);
// Simulated seconds that hw_loader_load has waited for the limit of bandwidth since the start.
double hw_loader_slept(const hw_loader *loader);
// Simulated: works on wishes, most urgent first and one at a time, until the work done (reading
// by the limit of bandwidth, decoding as long as it takes) fills the time up to `until_s`. Results
// become available at the time at which they would be ready.
void hw_loader_run(hw_loader *loader, double until_s);
