// Shaded geometry on the GPU, for the configurations that draw the original scene (A, B, L): one
// vertex and index buffer per mesh or level, one draw call per object. The hybrid does not use it:
// it is judged against this.
#pragma once
#include "cull.h"
#include "ground.h"
#include "scene.h"

typedef struct hw_shaded_mesh {
    GLuint array;
    hw_gpu_buffer vertices, indices;
    uint32_t index_count;
    GLenum index_type;
    bool has_uvs;
} hw_shaded_mesh;

// Uploads a mesh: positions as floats, normals as 16-bit, colours as 8-bit integers (white if there
// are none), uvs if there. On failure *out is zeroed. mesh->normals is not NULL.
HW_MUST_USE hw_status hw_shaded_mesh_create(hw_gpu_account *account, const hw_mesh *mesh,
                                            hw_shaded_mesh *out);
void hw_shaded_mesh_destroy(hw_gpu_account *account, hw_shaded_mesh *mesh);

typedef struct hw_shaded_object {
    hw_mat4 transform;
    hw_box bounds;
    float normal[9]; // inverse transpose, column-major
    float color[3];
    float stretch; // largest factor of lengths
    uint32_t mesh_idx;
    GLuint texture; // 0 = none
    bool mirrored;
} hw_shaded_object;

typedef struct hw_shaded_program {
    GLuint name;
    GLint clip, normal, color;
} hw_shaded_program;

// Everything of a scene but its meshes.
typedef struct hw_shaded_scene {
    uint32_t object_count, texture_count;
    hw_shaded_object *objects;
    hw_gpu_texture *textures; // per material; name 0 = none
    hw_shaded_program plain, textured;
    hw_ground_gl ground;
    hw_cull_set cull;
    uint32_t *visible;                   // scratch, object_count
    hw_cull_item *order, *order_scratch; // scratch, object_count
} hw_shaded_scene;

// Zeroes *out and fills it; on failure it is freed.
HW_MUST_USE hw_status hw_shaded_scene_create(hw_gpu_account *account, const hw_scene *scene,
                                             hw_shaded_scene *out);
void hw_shaded_scene_destroy(hw_gpu_account *account, hw_shaded_scene *scene);
// The objects that meet the frustum, front to back, into scene->order (key = distance from the eye
// to the box); returns how many.
uint32_t hw_shaded_scene_visible(hw_shaded_scene *scene, const hw_camera *camera,
                                 const hw_frustum *frustum);

// Draws objects one by one; keeps what is bound so that equal state is not set again.
// Zero-initialise per frame.
typedef struct hw_shaded_pass {
    const hw_shaded_program *program;
    GLuint texture;
    bool mirrored;
    hw_gpu_pace pace;
} hw_shaded_pass;
void hw_shaded_draw(hw_shaded_pass *pass, const hw_shaded_scene *scene,
                    const hw_shaded_object *object, const hw_shaded_mesh *mesh,
                    const hw_mat4 *view_projection, hw_frame_stats *stats);
// Ends a pass and its pace: front faces are counter-clockwise again.
void hw_shaded_end(hw_shaded_pass *pass);
