// One loaded cell: its far objects' vertices, indices and atlas on the GPU, and what a frame needs
// of its records on the CPU. GL thread only.
#pragma once
#include "cell_file.h"
#include "cull.h"
#include "gpu.h"
#include "manifest.h"

// Far records whose matrices fit into one uniform block (GL promises 16 KiB).
#define HW_FAR_PAGE_RECORDS 192u

// A far record, in drawing order.
typedef struct hw_far_draw {
    hw_mat4 matrix;   // world <- image space
    float texture[4]; // uv = texture.xy + (x, y) * texture.zw
    uint32_t first_index, index_count;
    // Of MVMeshes: captures, its own first; ranges of its indices; where the object's middle is.
    uint32_t first_view, view_count, first_range, range_count;
    hw_vec3 middle;
} hw_far_draw;

// A capture of an MVMesh.
typedef struct hw_far_view_draw {
    hw_vec3 eye;
    float texture[16]; // (u w, v w, 0, w) <- image space of the record, column-major
} hw_far_view_draw;

typedef struct hw_cell_gpu {
    hw_cell_id id;
    bool loaded;
    uint64_t used; // number of the last frame that drew it
    uint64_t gpu_bytes, file_bytes;
    uint32_t near_count, far_count;
    hw_near_record *near;
    hw_far_draw *far; // MVMeshes first
    uint32_t multi_count;
    hw_far_view_draw *views;
    hw_far_range *ranges;
    hw_cull_set near_bounds, far_bounds; // in the order of near and far
    GLuint array;
    hw_gpu_buffer vertices, indices, colors;
    hw_gpu_texture atlas;
} hw_cell_gpu;

// Reads and uploads the cell. Checks it against the manifest: HW_FORMAT names the file. On failure
// *out is zeroed.
HW_MUST_USE hw_status hw_cell_gpu_load(hw_gpu_account *account, const char *dataset,
                                       const hw_manifest *manifest, hw_cell_id id,
                                       hw_cell_gpu *out);
void hw_cell_gpu_free(hw_gpu_account *account, hw_cell_gpu *cell);

// Bytes of a file, 0 if it cannot be opened; for the figures of what was loaded.
uint64_t hw_dataset_file_bytes(const char *path);
