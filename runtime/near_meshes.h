// The meshes of near objects on the GPU: levels of detail from the dataset's mesh files, loaded one
// by one as views need them, dropped when unused and over budget. GL thread only.
#pragma once
#include "gpu.h"
#include "manifest.h"
#include "renderer.h"

typedef struct hw_near_level {
    GLuint array; // 0 = not loaded
    hw_gpu_buffer vertices, indices;
    uint32_t index_count;
    GLenum index_type;
    bool has_uvs;
    uint64_t used; // number of the last frame that asked for it
} hw_near_level;

typedef struct hw_near_meshes hw_near_meshes;

// budget_bytes: GPU bytes of levels kept beyond those in use. Borrows the dataset's path and the
// manifest. Reads nothing yet.
HW_MUST_USE hw_status hw_near_meshes_create(hw_gpu_account *account, const char *dataset,
                                            const hw_manifest *manifest, uint64_t budget_bytes,
                                            hw_near_meshes **out);
void hw_near_meshes_destroy(hw_near_meshes *meshes);

// Reads a mesh's table of levels, and a texture (index -1: none), unless that was done before.
// Counts in *stats what was read. Errors name the file.
HW_MUST_USE hw_status hw_near_meshes_open(hw_near_meshes *meshes, uint32_t mesh_idx,
                                          int32_t texture_idx, hw_frame_stats *stats);
// Of an opened mesh, the coarsest level whose surface error is at most `error` mesh units.
uint32_t hw_near_meshes_choose(const hw_near_meshes *meshes, uint32_t mesh_idx, double error);
// The level itself, marked as used in `frame`, loaded if it is not there (a stall, counted in
// *stats): then levels not used in `frame` may be dropped. *out stays valid until the next frame.
HW_MUST_USE hw_status hw_near_meshes_get(hw_near_meshes *meshes, uint32_t mesh_idx, uint32_t level,
                                         uint64_t frame, hw_frame_stats *stats,
                                         const hw_near_level **out);
// GL name of an opened texture; 0 for index -1.
GLuint hw_near_meshes_texture(const hw_near_meshes *meshes, int32_t texture_idx);
