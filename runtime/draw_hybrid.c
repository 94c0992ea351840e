// Configuration C: near objects as shaded geometry, far ones as the cell's textured meshes. The
// parts are in hybrid_cells.c, hybrid_near.c, hybrid_hidden.c and hybrid_far.c.
#include "alloc.h"
#include "hybrid_internal.h"
#include "renderer_internal.h"
#include "system.h"
#include <string.h>

#define SCRATCH_RECORDS_MAX 65536u // far records that there is room for from the start, at most

// ---- making and freeing ----------------------------------------------------------------------

static void hybrid_destroy(void *state)
{
    hybrid *h = state;
    hw_prefetch_destroy(h->prefetch);
    hw_store_destroy(h->store);
    hw_hiding_destroy(h->hiding);
    hw_ground_gl_destroy(h->account, &h->ground);
    hw_gpu_buffer_destroy(h->account, &h->far_uniforms);
    hw_far_views_gl_destroy(&h->far_views);
    for (int i = 0; i < 2; i++)
        for (int phase = 0; phase < HW_PHASES; phase++) {
            glDeleteProgram(h->near_programs[i][phase].name);
            glDeleteProgram(h->far_programs[i][phase].name);
        }
    hw_free(h->visible);
    hw_free(h->dissolving);
    hw_free(h->order);
    hw_free(h->order_scratch);
    hw_free(h->near);
    hw_free(h->far);
    hw_free(h->objects);
    hw_free(h->stretch);
    hw_manifest_free(&h->manifest);
    hw_free(h->dataset);
    hw_free(h);
}

static void make_near_object(const hw_manifest_object *object, near_object *out)
{
    hw_mat4 inverse;
    (void)hw_mat4_inverse(object->transform, &inverse); // identity if singular: a flat object
    for (int k = 0; k < 9; k++)
        out->normal[k] = (float)inverse.m[k % 3 * 4 + k / 3];
    out->mirrored = hw_mat4_mirrors(&object->transform);
}

// Scratch for so many near objects and far records. Cells have about as many as the first that
// come: from then on nothing is allocated.
hw_status hw_hybrid_reserve_scratch(hybrid *h, size_t near, size_t far)
{
    far = hw_hybrid_page_count(far) * HW_FAR_PAGE_RECORDS;
    if (near <= h->near_capacity && far <= h->far_capacity)
        return HW_OK;
    if (near > h->near_capacity) {
        HW_TRY(HW_RESIZE(&h->order, near));
        HW_TRY(HW_RESIZE(&h->order_scratch, near));
        HW_TRY(HW_RESIZE(&h->near, near));
    }
    if (far > h->far_capacity) {
        HW_TRY(HW_RESIZE(&h->far, far));
        HW_TRY(HW_RESIZE(&h->dissolving, far));
        hw_gpu_buffer_destroy(h->account, &h->far_uniforms);
        HW_TRY(hw_gpu_buffer_create(h->account, GL_UNIFORM_BUFFER, NULL, far * sizeof *h->far,
                                    GL_STREAM_DRAW, &h->far_uniforms));
    }
    near = near > h->near_capacity ? near : h->near_capacity;
    far = far > h->far_capacity ? far : h->far_capacity;
    HW_TRY(HW_RESIZE(&h->visible, near > far ? near : far));
    h->near_capacity = near;
    h->far_capacity = far;
    return HW_OK;
}

static hw_status make_loading(hybrid *h, const hw_streaming *streaming)
{
    hw_loading loading = streaming->loading;
    h->simulated = loading == HW_LOADING_SIMULATED || loading == HW_LOADING_SIMULATED_WAITS;
    const hw_store_desc desc = {.location = h->dataset,
                                .manifest = &h->manifest,
                                .account = h->account,
                                .mode = h->simulated                  ? HW_LOADER_SIMULATED
                                        : loading == HW_LOADING_AHEAD ? HW_LOADER_THREAD
                                                                      : HW_LOADER_WAITS,
                                .gpu_budget = streaming->gpu_budget,
                                .ram_budget = streaming->ram_budget,
                                .frame_bytes = streaming->frame_bytes,
                                .bytes_per_second = streaming->bytes_per_second};
    HW_TRY(hw_store_create(&desc, &h->store));
    if (loading == HW_LOADING_AHEAD || loading == HW_LOADING_SIMULATED)
        HW_TRY(hw_prefetch_create(h->store, &h->manifest, h->stretch, h->crossing_width,
                                  &h->prefetch));
    // Of most datasets' cells none has more records than there are objects; three are drawn
    // where they dissolve into each other.
    size_t records = h->manifest.object_count;
    records = HW_CROSSING_CELLS * (records < SCRATCH_RECORDS_MAX ? records : SCRATCH_RECORDS_MAX);
    return hw_hybrid_reserve_scratch(h, records,
                                     records + HW_CROSSING_CELLS * (size_t)h->manifest.grid.levels *
                                                   HW_FAR_PAGE_RECORDS);
}

static hw_status hybrid_create(const hw_renderer_desc *desc, hw_gpu_account *account,
                               const hw_debug_view *debug, void **state)
{
    hw_status status = HW_OK;
    hybrid *h = NULL;
    HW_TRY(HW_NEW(&h, 1));
    h->account = account;
    h->debug = debug;
    h->first_s = -1;
    h->crossing_width = desc->crossing_width;
    h->near_triangles = desc->near_triangles ? desc->near_triangles : HW_NEAR_TRIANGLES;
    HW_GO(hw_strdup(&h->dataset, desc->dataset));
    HW_GO(hw_manifest_open(h->dataset, &h->manifest));
    // Which objects a cluster holds is not known, and they may be alone in the next cell: nothing
    // is lost between the two only if all dissolve together.
    h->turns = h->manifest.clusters ? 1 : HW_CROSSING_TURNS;
    HW_GO(HW_NEW(&h->objects, h->manifest.object_count));
    HW_GO(HW_NEW(&h->stretch, h->manifest.object_count));
    hw_box bounds = hw_box_empty();
    for (uint32_t i = 0; i < h->manifest.object_count; i++) {
        make_near_object(&h->manifest.objects[i], &h->objects[i]);
        h->stretch[i] = (float)hw_mat4_stretch(&h->manifest.objects[i].transform);
        bounds = hw_box_union(bounds, h->manifest.objects[i].bounds);
    }
    HW_GO(make_loading(h, &desc->streaming));
    HW_GO(hw_ground_gl_create(account, &h->manifest.ground, bounds, &h->ground));
    if (desc->hide)
        HW_GO(hw_hiding_create(&h->hiding));
    HW_GO(hw_hybrid_make_near(h));
    HW_GO(hw_hybrid_make_far(h));
    hw_gpu_release_compiler();
    *state = h;
    h = NULL;
out:
    if (h)
        hybrid_destroy(h);
    return status;
}

// ---- frames ----------------------------------------------------------------------------------

typedef struct frame_view {
    hw_mat4 matrix;
    hw_frustum frustum;
    frame_cells cells;
    uint32_t near_count;
} frame_view;

static void put_stream_stats(const hybrid *h, const hw_store_stats *before, hw_frame_stats *stats)
{
    hw_store_stats s = hw_store_get_stats(h->store);
    hw_stream_stats *to = &stats->stream;
    to->queued = s.queued;
    to->gpu_bytes = s.gpu_bytes;
    to->gpu_budget = s.gpu_budget;
    to->ram_bytes = s.ram_bytes;
    to->ram_bytes_peak = s.ram_bytes_peak;
    to->ram_budget = s.ram_budget;
    to->read_bytes = s.read_bytes;
    to->uploaded_bytes = s.uploaded_bytes;
    to->waited_ms = (s.slept_s - before->slept_s) * 1000;
    to->problem_count = s.problem_count;
    to->problem = s.problem;
    if (!h->prefetch) {
        stats->loaded_bytes = s.read_bytes - before->read_bytes;
        stats->stalls = s.news != before->news;
    }
}

// Loads what is missing, and chooses the near objects.
static hw_status begin_frame(hybrid *h, const hw_camera *camera, hw_frame_stats *stats,
                             frame_view *view)
{
    double start = hw_clock_ms();
    hw_store_stats before = hw_store_get_stats(h->store);
    const hw_camera *culling = hw_debug_culling_camera(h->debug, camera);
    hw_mat4 culling_matrix = hw_camera_view_projection(culling);
    view->matrix = hw_camera_view_projection(camera);
    view->frustum = hw_frustum_make(&culling_matrix);
    hw_hybrid_begin_loading(h, culling);
    hw_status status = hw_hybrid_find_cells(h, culling, stats, &view->cells);
    if (status == HW_OK)
        status = hw_hybrid_choose_near(h, &view->cells, culling, &view->frustum, stats,
                                       &view->near_count);
    put_stream_stats(h, &before, stats);
    if (stats->stalls)
        stats->load_ms = hw_clock_ms() - start + stats->stream.waited_ms;
    return status;
}

static hw_status hybrid_prepare(void *state, const hw_camera *camera, hw_frame_stats *stats)
{
    hybrid *h = state;
    frame_view view;
    return h->prefetch && h->drawable ? HW_OK : begin_frame(h, camera, stats, &view);
}

static hw_status hybrid_arrive(void *state, const hw_camera *camera, bool *ready)
{
    return hw_hybrid_arrive(state, camera, ready);
}

static void hybrid_advance(void *state, double dt_s)
{
    hybrid *h = state;
    h->simulated_s += dt_s;
    if (h->simulated)
        hw_store_simulate(h->store, h->simulated_s);
}

static hw_status hybrid_draw(void *state, const hw_camera *camera, hw_frame_stats *stats)
{
    hybrid *h = state;
    frame_view view;
    HW_TRY(begin_frame(h, camera, stats, &view));
    hw_hybrid_hide_near(h, hw_debug_culling_camera(h->debug, camera), &view.near_count);
    hw_ground_gl_begin();
    hw_ground_gl_draw(&h->ground, &view.matrix, stats);
    hw_gpu_pace_flush(&h->pace);
    hw_debug_tint(h->debug, HW_REPRESENTATION_NEAR);
    hw_hybrid_draw_near(h, view.near_count, &view.matrix, stats);
    hw_hybrid_draw_far(h, &view.cells, camera->eye, &view.matrix, &view.frustum, stats);
    glBindVertexArray(0);
    hw_gpu_pace_end(&h->pace);
    stats->triangles += stats->near_triangles + stats->far_triangles;
    stats->hidden = h->hidden_count;
    return HW_OK;
}

const hw_renderer_backend hw_draw_hybrid = {.create = hybrid_create,
                                            .destroy = hybrid_destroy,
                                            .arrive = hybrid_arrive,
                                            .prepare = hybrid_prepare,
                                            .draw = hybrid_draw,
                                            .advance = hybrid_advance};
