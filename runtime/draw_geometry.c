// Configurations A (everything is sent, every frame) and B (what meets the view frustum): the
// ground truth that the hybrid is judged by.
#include "alloc.h"
#include "lod_chain.h"
#include "renderer_internal.h"
#include "shaded.h"

typedef struct geometry {
    hw_gpu_account *account;
    hw_shaded_scene scene;
    uint32_t mesh_count;
    hw_shaded_mesh *meshes;
    const hw_debug_view *debug; // the renderer's
} geometry;

static void geometry_destroy(void *state)
{
    geometry *g = state;
    for (uint32_t i = 0; i < g->mesh_count; i++)
        hw_shaded_mesh_destroy(g->account, &g->meshes[i]);
    hw_free(g->meshes);
    hw_shaded_scene_destroy(g->account, &g->scene);
    hw_free(g);
}

static hw_status upload(geometry *g, const hw_mesh *mesh, hw_shaded_mesh *out)
{
    hw_mesh ordered = {0};
    HW_TRY(hw_mesh_reorder(mesh, mesh->indices, mesh->index_count, &ordered));
    hw_status status = hw_shaded_mesh_create(g->account, &ordered, out);
    hw_mesh_free(&ordered);
    return status;
}

static hw_status geometry_create(const hw_renderer_desc *desc, hw_gpu_account *account,
                                 const hw_debug_view *debug, void **state)
{
    hw_status status = HW_OK;
    geometry *g = NULL;
    HW_TRY(HW_NEW(&g, 1));
    g->account = account;
    g->debug = debug;
    HW_GO(HW_NEW(&g->meshes, desc->scene->mesh_count));
    HW_GO(hw_shaded_scene_create(account, desc->scene, &g->scene));
    g->mesh_count = desc->scene->mesh_count;
    for (uint32_t i = 0; i < g->mesh_count; i++)
        HW_GO(upload(g, &desc->scene->meshes[i], &g->meshes[i]));
    hw_gpu_release_compiler();
    *state = g;
    g = NULL;
out:
    if (g)
        geometry_destroy(g);
    return status;
}

static void draw_object(geometry *g, hw_shaded_pass *pass, uint32_t i, const hw_mat4 *matrix,
                        hw_frame_stats *stats)
{
    const hw_shaded_object *object = &g->scene.objects[i];
    hw_shaded_draw(pass, &g->scene, object, &g->meshes[object->mesh_idx], matrix, stats);
}

static hw_status draw_all(void *state, const hw_camera *camera, hw_frame_stats *stats)
{
    geometry *g = state;
    hw_mat4 matrix = hw_camera_view_projection(camera);
    hw_shaded_pass pass = {0};
    hw_ground_gl_begin();
    hw_ground_gl_draw(&g->scene.ground, &matrix, stats);
    hw_gpu_pace_flush(&pass.pace);
    hw_debug_tint(g->debug, HW_REPRESENTATION_FULL);
    for (uint32_t i = 0; i < g->scene.object_count; i++)
        draw_object(g, &pass, i, &matrix, stats);
    hw_shaded_end(&pass);
    return HW_OK;
}

static hw_status draw_culled(void *state, const hw_camera *camera, hw_frame_stats *stats)
{
    geometry *g = state;
    hw_mat4 matrix = hw_camera_view_projection(camera);
    const hw_camera *culling = hw_debug_culling_camera(g->debug, camera);
    hw_mat4 culling_matrix = hw_camera_view_projection(culling);
    hw_frustum frustum = hw_frustum_make(&culling_matrix);
    hw_shaded_pass pass = {0};
    hw_ground_gl_begin();
    hw_ground_gl_draw(&g->scene.ground, &matrix, stats);
    hw_gpu_pace_flush(&pass.pace);
    hw_debug_tint(g->debug, HW_REPRESENTATION_FULL);
    uint32_t count = hw_shaded_scene_visible(&g->scene, culling, &frustum);
    for (uint32_t i = 0; i < count; i++)
        draw_object(g, &pass, g->scene.order[i].index, &matrix, stats);
    hw_shaded_end(&pass);
    return HW_OK;
}

const hw_renderer_backend hw_draw_all = {
    .create = geometry_create, .destroy = geometry_destroy, .draw = draw_all};
const hw_renderer_backend hw_draw_culled = {
    .create = geometry_create, .destroy = geometry_destroy, .draw = draw_culled};
