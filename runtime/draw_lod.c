// Configuration L, the fair competitor: discrete levels of detail by meshoptimizer, per object the
// coarsest level whose error, projected at the distance of the object's box, is small enough.
#include "alloc.h"
#include "lod_chain.h"
#include "parallel.h"
#include "renderer_internal.h"
#include "shaded.h"

typedef struct lod_mesh {
    uint32_t count;
    float errors[HW_LOD_LEVELS_MAX]; // mesh units
    hw_shaded_mesh levels[HW_LOD_LEVELS_MAX];
} lod_mesh;

typedef struct lod {
    hw_gpu_account *account;
    hw_shaded_scene scene;
    uint32_t mesh_count;
    lod_mesh *meshes;
    double error_px;
    const hw_debug_view *debug; // the renderer's
} lod;

static void lod_destroy(void *state)
{
    lod *l = state;
    for (uint32_t i = 0; i < l->mesh_count; i++) {
        for (uint32_t k = 0; k < l->meshes[i].count; k++)
            hw_shaded_mesh_destroy(l->account, &l->meshes[i].levels[k]);
    }
    hw_free(l->meshes);
    hw_shaded_scene_destroy(l->account, &l->scene);
    hw_free(l);
}

typedef struct chain_job {
    const hw_scene *scene;
    hw_lod_chain *chains;
} chain_job;

static hw_status make_chain(void *context, uint64_t index, uint32_t thread)
{
    const chain_job *job = context;
    (void)thread;
    return hw_lod_chain_make(&job->scene->meshes[index], &job->chains[index]);
}

static hw_status upload_chain(lod *l, const hw_lod_chain *chain, lod_mesh *out)
{
    for (uint32_t k = 0; k < chain->count; k++) {
        HW_TRY(hw_shaded_mesh_create(l->account, &chain->levels[k].mesh, &out->levels[k]));
        out->errors[k] = chain->levels[k].error;
        out->count++;
    }
    return HW_OK;
}

static hw_status lod_create(const hw_renderer_desc *desc, hw_gpu_account *account,
                            const hw_debug_view *debug, void **state)
{
    hw_status status = HW_OK;
    const hw_scene *scene = desc->scene;
    hw_lod_chain *chains = NULL;
    lod *l = NULL;
    HW_TRY(HW_NEW(&l, 1));
    l->account = account;
    l->debug = debug;
    l->error_px = desc->lod_error_px > 0 ? desc->lod_error_px : 1;
    HW_GO(HW_NEW(&l->meshes, scene->mesh_count));
    HW_GO(HW_NEW(&chains, scene->mesh_count));
    HW_GO(hw_shaded_scene_create(account, scene, &l->scene));
    HW_GO(hw_parallel_for(scene->mesh_count, 0, make_chain, &(chain_job){scene, chains}, NULL));
    l->mesh_count = scene->mesh_count;
    for (uint32_t i = 0; i < scene->mesh_count; i++) {
        HW_GO(upload_chain(l, &chains[i], &l->meshes[i]));
        hw_lod_chain_free(&chains[i]);
    }
    hw_gpu_release_compiler();
    *state = l;
    l = NULL;
out:
    for (uint32_t i = 0; chains && i < scene->mesh_count; i++)
        hw_lod_chain_free(&chains[i]);
    hw_free(chains);
    if (l)
        lod_destroy(l);
    return status;
}

static hw_status lod_draw(void *state, const hw_camera *camera, hw_frame_stats *stats)
{
    lod *l = state;
    hw_mat4 matrix = hw_camera_view_projection(camera);
    const hw_camera *culling = hw_debug_culling_camera(l->debug, camera);
    hw_mat4 culling_matrix = hw_camera_view_projection(culling);
    hw_frustum frustum = hw_frustum_make(&culling_matrix);
    // An error e at distance d covers e * focal / d pixels.
    double unit = l->error_px / hw_camera_focal_px(culling);
    hw_shaded_pass pass = {0};
    hw_ground_gl_begin();
    hw_ground_gl_draw(&l->scene.ground, &matrix, stats);
    hw_gpu_pace_flush(&pass.pace);
    hw_debug_tint(l->debug, HW_REPRESENTATION_LOD);
    uint32_t count = hw_shaded_scene_visible(&l->scene, culling, &frustum);
    for (uint32_t i = 0; i < count; i++) {
        hw_cull_item item = l->scene.order[i];
        const hw_shaded_object *object = &l->scene.objects[item.index];
        const lod_mesh *mesh = &l->meshes[object->mesh_idx];
        uint32_t level =
            hw_lod_chain_choose(mesh->errors, mesh->count, unit * item.key / object->stretch);
        hw_shaded_draw(&pass, &l->scene, object, &mesh->levels[level], &matrix, stats);
    }
    hw_shaded_end(&pass);
    return HW_OK;
}

const hw_renderer_backend hw_draw_lod = {
    .create = lod_create, .destroy = lod_destroy, .draw = lod_draw};
