// A cell in memory and on the GPU: its far objects' vertices, indices and atlas, and what a frame
// needs of its records.
#pragma once
#include "cell_file.h"
#include "cull.h"
#include "gpu.h"
#include "manifest.h"
#include "upload.h"

// Far records whose matrices fit into one uniform block (GL promises 16 KiB), and whose
// uniforms begin at multiples of 256 bytes.
#define HW_FAR_PAGE_RECORDS 168u

// A far record, in drawing order.
typedef struct hw_far_draw {
    hw_mat4 matrix;   // world <- image space
    float texture[4]; // uv = texture.xy + (x, y) * texture.zw
    uint32_t object_idx, first_index, index_count;
    // Of MVMeshes: captures, its own first; ranges of its indices.
    uint32_t first_view, view_count, first_range, range_count;
    hw_box bounds; // of its vertices, world
} hw_far_draw;

// A capture of an MVMesh.
typedef struct hw_far_view_draw {
    hw_vec3 eye;
    float texture[16]; // (u w, v w, 0, w) <- image space of the record, column-major
} hw_far_view_draw;

// What a frame needs of a cell's records on the CPU.
typedef struct hw_cell_records {
    uint32_t near_count, far_count;
    // Of the far ones: MVMeshes come first, cut-out ones after the opaque ones (which MVMeshes
    // are).
    uint32_t multi_count, opaque_count;
    hw_near_record *near;
    hw_far_draw *far;
    hw_far_view_draw *views;
    hw_far_range *ranges;
    hw_cull_set near_bounds, far_bounds; // in the order of near and far
} hw_cell_records;

// A cell as it comes from its file, arranged for drawing. Has nothing to do with GL.
typedef struct hw_cell_data {
    hw_cell_id id;
    hw_cell_records records;
    // On its way to the GPU:
    uint32_t vertex_count, index_count, color_count, atlas_width, atlas_height;
    hw_far_vertex *vertices; // the record of each is its place in the drawing order
    uint32_t index_bytes;    // of one
    uint8_t *indices;
    hw_color8 *colors; // of the first color_count vertices
    uint8_t *atlas;    // BC3
} hw_cell_data;

// From the bytes of the cell's file; `name` is for messages. Checks against the manifest. On
// failure *out is zeroed. Any thread.
HW_MUST_USE hw_status hw_cell_data_make(const hw_manifest *manifest, hw_cell_id id,
                                        const char *name, const void *bytes, size_t size,
                                        hw_cell_data *out);
// Frees what was on its way to the GPU, and all.
void hw_cell_data_free_bulk(hw_cell_data *data);
void hw_cell_data_free(hw_cell_data *data);
// Bytes of memory, and what becomes of them on a GPU that takes blocks or does not.
uint64_t hw_cell_data_bytes(const hw_cell_data *data);
uint64_t hw_cell_data_gpu_bytes(const hw_cell_data *data, bool blocks);

typedef struct hw_cell_gpu {
    hw_cell_id id;
    const hw_cell_records *records;
    GLuint array;
    hw_gpu_buffer vertices, indices, colors;
    uint32_t index_bytes; // of one
    hw_gpu_texture atlas;
} hw_cell_gpu;

// Makes the GL objects, the atlas of blocks or of RGBA; *upload is to fill them. Borrows the data:
// its records until hw_cell_gpu_free, the rest until the upload has gone through. On failure *out
// is zeroed. GL thread only, as is the next.
HW_MUST_USE hw_status hw_cell_gpu_create(hw_gpu_account *account, const hw_cell_data *data,
                                         bool blocks, hw_cell_gpu *out, hw_upload *upload);
void hw_cell_gpu_free(hw_gpu_account *account, hw_cell_gpu *cell);
