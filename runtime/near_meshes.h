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
    uint64_t used; // number of the last frame that asked for it
} hw_near_level;

typedef struct hw_near_meshes hw_near_meshes;

// Borrows the dataset's path and the manifest. Reads nothing yet.
HW_MUST_USE hw_status hw_near_meshes_create(hw_gpu_account *account, const char *dataset,
                                            const hw_manifest *manifest, hw_near_meshes **out);
void hw_near_meshes_destroy(hw_near_meshes *meshes);

// Reads the mesh's table of levels and its texture, once. Errors name the file.
HW_MUST_USE hw_status hw_near_meshes_open(hw_near_meshes *meshes, uint32_t mesh_idx);
HW_MUST_USE hw_status hw_near_meshes_open_texture(hw_near_meshes *meshes, int32_t texture_idx,
                                                  hw_frame_stats *stats);
// The coarsest level of an opened mesh whose largest error is at most `error` mesh units.
uint32_t hw_near_meshes_choose(const hw_near_meshes *meshes, uint32_t mesh_idx, double error);
// The level itself, marked as used in `frame`; loaded if need be (counted in *stats as a stall), for
// which levels unused in `frame` may be dropped. NULL *out never happens on success.
HW_MUST_USE hw_status hw_near_meshes_get(hw_near_meshes *meshes, uint32_t mesh_idx, uint32_t level,
                                         uint64_t frame, hw_frame_stats *stats,
                                         const hw_near_level **out);
// Name of an opened texture; 0 for index -1.
GLuint hw_near_meshes_texture(const hw_near_meshes *meshes, int32_t texture_idx);
// Whether an opened mesh has texture coordinates.
bool hw_near_meshes_has_uvs(const hw_near_meshes *meshes, uint32_t mesh_idx);
