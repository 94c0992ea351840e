// One level of a near mesh, in memory and on the GPU.
#pragma once
#include "gpu.h"
#include "inner_boxes.h"
#include "upload.h"

// The space that a level takes up, in the mesh's own.
typedef struct hw_near_inside {
    hw_box bounds;
    hw_inner_boxes filled; // wholly inside
} hw_near_inside;

// As it comes from its file, packed for the GPU. Has nothing to do with GL.
typedef struct hw_near_data {
    uint32_t vertex_count, index_count, index_bytes; // index_bytes: 2 or 4 each
    bool has_uvs;
    uint8_t *vertices; // all but texture coordinates, interleaved; then those
    uint8_t *indices;
    hw_near_inside inside;
} hw_near_data;

// Of a level and the boxes inside of it. The mesh may get normals that it lacks. On failure *out is
// zeroed. Any thread.
HW_MUST_USE hw_status hw_near_data_make(hw_mesh *mesh, const hw_inner_boxes *boxes,
                                        hw_near_data *out);
void hw_near_data_free(hw_near_data *data);
// Bytes of a level in memory, and on the GPU.
uint64_t hw_near_level_bytes(uint32_t vertex_count, uint32_t index_count, bool has_uvs);

typedef struct hw_near_level {
    GLuint array; // 0 = there is none
    hw_gpu_buffer vertices, indices;
    uint32_t index_count;
    GLenum index_type;
    bool has_uvs;
    hw_near_inside inside;
} hw_near_level;

// Makes the GL objects; *upload is to fill them, and borrows the data. On failure *out is zeroed.
// GL thread only, as is the next.
HW_MUST_USE hw_status hw_near_level_create(hw_gpu_account *account, const hw_near_data *data,
                                           hw_near_level *out, hw_upload *upload);
void hw_near_level_free(hw_gpu_account *account, hw_near_level *level);
