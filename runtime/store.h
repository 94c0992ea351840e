// What of a dataset is in memory and on the GPU: cells, levels of near meshes, textures. Within
// budgets: what was wanted longest ago goes first. GL thread only.
//
// The memory budget is for what waits there, decoded, for the GPU (loader.h); a piece larger than
// all of it comes alone. The GPU's budget is exceeded by what a frame cannot be drawn without
// (HW_PLACE_NOW: the viewer's cell, the coarsest levels and the textures of what is near in it), if
// all else there is being drawn for some frames, and by that alone.
//
// Either pieces are loaded when they are needed (hw_store_need, which waits); or they are wished
// for (hw_store_want), come from the loader some frames later, and reach the GPU under a budget of
// bytes per frame: then nothing here waits, reads a file or allocates.
#pragma once
#include "loader.h"

// Of the GPU for each level of cells; where nothing is streamed atlases are RGBA in software GL.
#define HW_STORE_GPU_BUDGET  UINT64_C(16000000)
#define HW_STORE_GPU_WAITING UINT64_C(24000000)
#define HW_STORE_RAM_BUDGET  UINT64_C(4000000)
#define HW_STORE_FRAME_BYTES (UINT64_C(1) << 19)

typedef struct hw_store_desc {
    const char *location; // folder or URL
    const hw_manifest *manifest;
    hw_gpu_account *account;
    hw_loader_mode mode;
    uint64_t gpu_budget, ram_budget, frame_bytes; // 0 = defaults
    uint64_t bytes_per_second;                    // 0 = no limit
} hw_store_desc;

typedef struct hw_store hw_store;
// Borrows manifest and account.
HW_MUST_USE hw_status hw_store_create(const hw_store_desc *desc, hw_store **out);
void hw_store_destroy(hw_store *store);

// Begins a frame at the time now_s (seconds): takes what the loader has ready and uploads a
// frame's share of it (all of it with `hurry`).
void hw_store_begin_frame(hw_store *store, double now_s, bool hurry);
// Simulated time: the loader works up to now_s.
void hw_store_simulate(hw_store *store, double now_s);

// Wishes for a piece with a t-priority. One that is there stays there the longer.
typedef enum hw_store_place {
    HW_PLACE_RAM,
    HW_PLACE_GPU,
    HW_PLACE_NOW, // on the GPU, even over the budget if all that is there is being drawn
} hw_store_place;
void hw_store_set_timestamp(hw_store *store, uint64_t timestamp);
void hw_store_want(hw_store *store, hw_data_key key, double t_priority, hw_store_place place);
// Makes a piece ready now, waiting for it; and marks it as used in this frame. Not with a loader's
// thread. Errors name the file.
HW_MUST_USE hw_status hw_store_need(hw_store *store, hw_data_key key);

// Whether the last attempt to load the piece failed.
bool hw_store_failed(hw_store *store, hw_data_key key);

// Whether the piece is in memory or on the GPU.
bool hw_store_is_here(hw_store *store, hw_data_key key);
// A cell that is ready, else NULL; and the records of one that is at least in memory.
hw_cell_gpu *hw_store_cell(hw_store *store, uint32_t index);
const hw_cell_records *hw_store_records(const hw_store *store, uint32_t index);
// The ready cells one after the other, in no order: NULL from number HW_STORE_CELLS_MAX on or where
// there is none.
#define HW_STORE_CELLS_MAX 48u
hw_cell_gpu *hw_store_ready_cell(hw_store *store, uint32_t number);
// Bytes on the GPU: of a cell as far as it is known, else about.
uint64_t hw_store_cell_gpu_bytes(const hw_store *store, uint32_t index);
uint64_t hw_store_cell_ram_bytes(const hw_store *store, uint32_t index);
uint64_t hw_store_texture_gpu_bytes(const hw_store *store, uint32_t texture); // 0: not known yet
// Whether all near objects of the cell can be drawn, if not at the level one would like.
bool hw_store_has_near(const hw_store *store, const hw_cell_records *records);
// Marks the cell as used in this frame.
void hw_store_use_cell(hw_store *store, hw_cell_gpu *cell);

// A near mesh's table; NULL: it is away.
const hw_mesh_table *hw_store_table(const hw_store *store, uint32_t mesh);
// Of a mesh whose table is here, the coarsest level whose error is at most `error` mesh units.
uint32_t hw_mesh_table_choose(const hw_mesh_table *table, double error);
// The level if it is ready, else the next coarser or, if there is none, finer one that is; marked
// as used. NULL: none is.
const hw_near_level *hw_store_level(hw_store *store, uint32_t mesh, uint32_t level);
// GL name of a texture; 0: none, or away.
GLuint hw_store_texture(hw_store *store, int32_t texture_idx);

typedef struct hw_store_stats {
    uint64_t gpu_bytes, gpu_budget, ram_bytes, ram_budget;
    uint64_t ram_bytes_peak; // since the start, also between frames
    uint64_t read_bytes;     // since the start
    uint64_t uploaded_bytes; // since the start
    uint32_t queued;         // wishes and reads under way
    uint32_t news;           // pieces that have come since the start
    uint32_t problem_count;  // pieces that failed since the start
    double slept_s;          // simulated waits of hw_store_need
    const char *problem;     // of the last of them, "" if none; valid until the next frame
} hw_store_stats;
hw_store_stats hw_store_get_stats(const hw_store *store);
uint64_t hw_store_gpu_budget(const hw_store *store);
// What of it is left beside all that is in use.
uint64_t hw_store_gpu_room(const hw_store *store);
uint64_t hw_store_ram_budget(const hw_store *store);
