// The build: scene in, dataset out. Stages: import, chains, meshes, cells, manifest.
#pragma once
#include "build_cell.h"
#include "occlusion.h"
#include "tour.h"
#include <stdatomic.h>

// Raise when the content of cells or meshes changes for the same input: it is part of every key.
#define HW_BUILD_VERSION 13u

typedef enum hw_occlusion_mode {
    HW_OCCLUSION_OFF,
    HW_OCCLUSION_OBJECTS,
    HW_OCCLUSION_TRIANGLES // objects, and triangles of far objects
} hw_occlusion_mode;

typedef struct hw_build_options {
    const char *scene_path, *dataset;
    double cell_size;
    int32_t levels;      // of cells, 1 to HW_CELL_LEVELS_MAX; 0: by the number of cells
    double z_min, z_max; // heights above the ground at which eyes may be
    double piece_cells;  // width, in cell sizes, of the pieces that oversized meshes are cut into
                         // (scene_split.h); 0: none is
    double near_error_px;
    hw_far_options far;
    hw_chain_options chain;
    hw_occlusion_mode cull; // what is left out of a cell because it cannot be seen from it
    hw_occlusion_options occlusion;
    bool clusters;           // of far objects
    double cluster_error_px; // largest self-occluding error of one
    uint32_t threads;        // 0 = default
    uint32_t shard_index,
        shard_count;       // this run makes every shard_count-th cell and mesh; count 0 or 1 = all
    uint64_t memory_bytes; // bound of the resident memory; 0 = none
    const hw_tour *along;  // only cells that frames of this tour stand in, and the groups that hold
                           // them; NULL = all. Not together with shards
    uint32_t along_every;  // every how manieth of its frames
    const atomic_bool *stop; // becomes true to stop soon with HW_INTERRUPTED; may be NULL
} hw_build_options;

// T_s 20, T_l 4.5, cell size 50, ...: what the measurements in the README were made with.
hw_build_options hw_build_defaults(void);

typedef struct hw_build_report {
    double import_seconds, chain_seconds, mesh_seconds, rays_seconds, cell_seconds, total_seconds;
    hw_cell_seconds cell_parts;          // of cell_seconds, added up over the threads
    double cell_write_seconds;           // likewise: packing into a file, writing, syncing
    uint64_t scratch_bytes, tree_builds; // what a bound of memory costs
    uint32_t meshes_cut;                 // oversized ones, into pieces
    uint32_t cells_total, cells_made, cells_kept;
    uint32_t cells_missing, meshes_missing; // left to other shards
    uint32_t cells_left_out;                // not along the tour, and not there from before
    uint64_t bytes, mesh_bytes, texture_bytes, near_bytes;
    double far_records_mean, far_triangles_mean, near_records_mean; // per cell
} hw_build_report;

// Whatever an earlier, killed build with the same input and options left complete is kept; the
// bytes are the same with any number of threads, any split into shards and any bound of memory. The
// manifest is written once every cell and mesh is there; until then a shard leaves its own
// (shard.h) for hw_merge_run. Errors name the file at fault; what was there before stays. HW_LIMIT:
// the bound of memory is too small; the message tells what is needed.
HW_MUST_USE hw_status hw_build_run(const hw_build_options *options, hw_build_report *report);
