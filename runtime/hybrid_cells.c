// Which cells a frame of the hybrid shows: the viewer's, those of a crossing, or the best there
// are.
#include "hierarchy.h"
#include "hybrid_internal.h"
#include "system.h"
#include <math.h>
#include <string.h>
#include <time.h>

#define FIRST_WAIT_S      0.002 // between looks, while there is nothing to draw
#define FIRST_SIMULATED_S 0.02
#define FIRST_NEAR_S      1.0 // more, for near objects that could be drawn coarser

static hw_data_key cell_key(uint32_t index)
{
    return (hw_data_key){HW_DATA_CELL, index, 0};
}

static void use_cells(hybrid *h, hw_cell_gpu *const *cells)
{
    for (int32_t l = 0; l < h->manifest.grid.levels; l++)
        hw_store_use_cell(h->store, cells[l]);
}

static hw_status find_cell(const hybrid *h, hw_cell_id id, uint32_t *index)
{
    if (!hw_manifest_find_cell(&h->manifest, id, index))
        return hw_fail(HW_FORMAT, "%s: has no cell %d/%d_%d", h->dataset, id.level, id.q, id.r);
    return HW_OK;
}

// Everything the cell needs before frames can be drawn in it, but the levels of its near meshes.
static hw_status need_cell(hybrid *h, hw_cell_id id, hw_cell_gpu **out)
{
    uint32_t index;
    HW_TRY(find_cell(h, id, &index));
    HW_TRY(hw_store_need(h->store, cell_key(index)));
    const hw_cell_records *records = hw_store_records(h->store, index);
    for (uint32_t i = 0; i < records->near_count; i++) {
        const hw_manifest_object *object = &h->manifest.objects[records->near[i].object_idx];
        hw_data_key mesh = {HW_DATA_MESH, object->mesh_idx, 0};
        hw_data_key texture = {HW_DATA_TEXTURE, (uint32_t)object->texture_idx, 0};
        HW_TRY(hw_store_need(h->store, mesh));
        if (object->texture_idx >= 0)
            HW_TRY(hw_store_need(h->store, texture));
    }
    *out = hw_store_cell(h->store, index);
    return HW_OK;
}

// The cell and the groups that hold it, one of each level, if all can be drawn as they are.
static bool is_chain_ready(hybrid *h, hw_cell_id id, hw_cell_gpu *out[HW_CELL_LEVELS_MAX])
{
    uint32_t index;
    for (int32_t l = 0; l < h->manifest.grid.levels; l++, id = hw_cell_parent(id)) {
        out[l] =
            hw_manifest_find_cell(&h->manifest, id, &index) ? hw_store_cell(h->store, index) : NULL;
        if (!out[l] || !hw_store_has_near(h->store, out[l]->records))
            return false;
    }
    return true;
}

// The chain of the closest cell that is ready. Chains are not mixed: an object that is missing in
// the cell of one is in those of its other levels.
static bool find_closest_chain(hybrid *h, hw_vec3 eye, hw_cell_gpu *out[HW_CELL_LEVELS_MAX])
{
    hw_cell_gpu *chain[HW_CELL_LEVELS_MAX];
    float least = INFINITY;
    for (uint32_t i = 0; i < HW_STORE_CELLS_MAX; i++) {
        const hw_cell_gpu *cell = hw_store_ready_cell(h->store, i);
        if (!cell || cell->id.level != 0)
            continue;
        hw_vec3 away = hw_v3_sub(hw_cell_centre(&h->manifest.grid, cell->id), eye);
        float distance = hypotf(away.x, away.y);
        if (distance >= least || !is_chain_ready(h, cell->id, chain))
            continue;
        least = distance;
        memcpy(out, chain, sizeof chain);
    }
    return least < INFINITY;
}

// Whether the mesh cannot be drawn, nor will be: its table or its coarsest level failed to load.
static bool has_mesh_failed(hybrid *h, uint32_t mesh)
{
    const hw_mesh_table *table = hw_store_table(h->store, mesh);
    if (!table)
        return hw_store_failed(h->store, (hw_data_key){HW_DATA_MESH, mesh, 0});
    uint32_t last = table->level_count - 1;
    return !hw_store_level(h->store, mesh, last) &&
           hw_store_failed(h->store, (hw_data_key){HW_DATA_LEVEL, mesh, last});
}

// What the chain's first frame waits for has failed to load.
static hw_status check_chain(hybrid *h, hw_cell_id id)
{
    uint32_t index;
    bool failed = false;
    for (int32_t l = 0; l < h->manifest.grid.levels; l++, id = hw_cell_parent(id)) {
        HW_TRY(find_cell(h, id, &index));
        const hw_cell_records *records = hw_store_records(h->store, index);
        failed = failed || hw_store_failed(h->store, cell_key(index));
        for (uint32_t i = 0; records && i < records->near_count; i++) {
            const hw_manifest_object *object = &h->manifest.objects[records->near[i].object_idx];
            hw_data_key texture = {HW_DATA_TEXTURE, (uint32_t)object->texture_idx, 0};
            failed = failed || has_mesh_failed(h, object->mesh_idx) ||
                     (object->texture_idx >= 0 && hw_store_failed(h->store, texture));
        }
    }
    return failed ? hw_fail(HW_IO, "%s", hw_store_get_stats(h->store).problem) : HW_OK;
}

static double now_s(const hybrid *h)
{
    return h->simulated ? h->simulated_s : hw_clock_ms() / 1000;
}

void hw_hybrid_begin_loading(hybrid *h, const hw_camera *camera)
{
    hw_store_begin_frame(h->store, now_s(h), !h->drawable);
    if (h->prefetch)
        hw_prefetch_update(h->prefetch, camera, now_s(h));
}

// Time in which the loader works, while there is nothing to draw.
static void wait_a_little(hybrid *h, const hw_camera *camera)
{
    const struct timespec pause = {0, (long)(FIRST_WAIT_S * 1e9)};
    if (h->simulated) {
        h->simulated_s += FIRST_SIMULATED_S;
        hw_store_simulate(h->store, h->simulated_s);
    } else {
        nanosleep(&pause, NULL);
    }
    hw_hybrid_begin_loading(h, camera);
}

// The level of detail of a near object that a tolerance asks for at this distance.
hw_data_key hw_hybrid_level_key(const hybrid *h, uint32_t object_idx, double error_px,
                                double focal_px, float distance)
{
    hw_data_key key = {HW_DATA_LEVEL, h->manifest.objects[object_idx].mesh_idx, 0};
    key.level = hw_prefetch_level(hw_store_table(h->store, key.index), error_px, focal_px,
                                  (double)h->stretch[object_idx], (double)distance);
    return key;
}

// Whether all near objects of the cell are there as they should be; wishes for what is not.
static bool is_near_exact(hybrid *h, const hw_cell_records *cell, const hw_camera *camera)
{
    double focal_px = hw_camera_focal_px(camera);
    bool exact = true;
    for (uint32_t i = 0; i < cell->near_count; i++) {
        uint32_t object_idx = cell->near[i].object_idx;
        float distance = hw_box_distance(h->manifest.objects[object_idx].bounds, camera->eye);
        hw_data_key key =
            hw_hybrid_level_key(h, object_idx, h->manifest.near_error_px, focal_px, distance);
        if (hw_store_table(h->store, key.index)->items[key.level].state == HW_ITEM_READY)
            continue;
        exact = false;
        hw_prefetch_urge(h->prefetch, key);
    }
    return exact;
}

// Whether the first frame can be drawn: it is to be as it should be, if that does not take too
// long.
static hw_status look_for_first(hybrid *h, const hw_camera *camera, hw_cell_id id,
                                hw_cell_gpu *out[HW_CELL_LEVELS_MAX], bool *ready)
{
    *ready = is_chain_ready(h, id, out);
    if (!*ready)
        return check_chain(h, id);
    use_cells(h, out); // finer levels are not to push them out
    h->first_s = h->first_s < 0 ? now_s(h) : h->first_s;
    *ready = is_near_exact(h, out[0]->records, camera) || now_s(h) > h->first_s + FIRST_NEAR_S;
    return HW_OK;
}

static hw_status wait_for_first(hybrid *h, const hw_camera *camera, hw_cell_id id,
                                hw_cell_gpu *out[HW_CELL_LEVELS_MAX])
{
    for (bool ready = false;;) {
        HW_TRY(look_for_first(h, camera, id, out, &ready));
        if (ready)
            return HW_OK;
        wait_a_little(h, camera);
    }
}

hw_status hw_hybrid_arrive(hybrid *h, const hw_camera *camera, bool *ready)
{
    hw_cell_gpu *chain[HW_CELL_LEVELS_MAX];
    *ready = !h->prefetch || h->drawable;
    if (*ready)
        return HW_OK;
    hw_hybrid_begin_loading(h, camera);
    hw_cell_id id = hw_hexgrid_locate(&h->manifest.grid, camera->eye.x, camera->eye.y);
    return look_for_first(h, camera, id, chain, ready);
}

static hw_status need_chain(hybrid *h, hw_cell_id id, hw_cell_gpu *out[HW_CELL_LEVELS_MAX])
{
    for (int32_t l = 0; l < h->manifest.grid.levels; l++, id = hw_cell_parent(id))
        HW_TRY(need_cell(h, id, &out[l]));
    return HW_OK;
}

// The chain of the viewer's cell; with prefetching, the best there is.
static hw_status find_own_chain(hybrid *h, const hw_camera *camera, hw_cell_id id,
                                hw_frame_stats *stats, hw_cell_gpu *out[HW_CELL_LEVELS_MAX])
{
    stats->cell_q = id.q;
    stats->cell_r = id.r;
    stats->cell_level = id.level;
    if (!h->prefetch) {
        HW_TRY(need_chain(h, id, out));
    } else if (!is_chain_ready(h, id, out)) {
        if (h->drawable && find_closest_chain(h, camera->eye, out))
            stats->stream.late_cells = (uint32_t)h->manifest.grid.levels;
        else
            HW_TRY(wait_for_first(h, camera, id, out));
    }
    h->drawable = true;
    use_cells(h, out);
    for (int32_t l = 0; l < h->manifest.grid.levels && stats->stream.late_cells; l++)
        stats->stream.missing += out[l]->records->far_count;
    if (stats->stream.late_cells && stats->stream.missing == 0)
        stats->stream.missing = 1; // even if there is nothing in it
    return HW_OK;
}

// The chain of another cell, if the dataset has it; with prefetching, if it is there already.
static hw_status find_other_chain(hybrid *h, hw_cell_id id, hw_frame_stats *stats,
                                  hw_cell_gpu *out[HW_CELL_LEVELS_MAX], bool *found)
{
    *found = hw_manifest_find_cell(&h->manifest, id, NULL);
    if (!*found)
        return HW_OK;
    if (!h->prefetch) {
        HW_TRY(need_chain(h, id, out));
    } else if (!is_chain_ready(h, id, out)) {
        *found = false;
        stats->stream.missing++;
        return HW_OK;
    }
    use_cells(h, out);
    return HW_OK;
}

// The cells of the crossing that can be drawn, with their chains.
static hw_status find_chains(hybrid *h, hw_cell_id own,
                             hw_cell_gpu *const own_chain[HW_CELL_LEVELS_MAX],
                             hw_frame_stats *stats, frame_cells *out)
{
    hw_crossing *c = &out->crossing;
    for (uint32_t i = 0; i < c->count;) {
        bool found = hw_cell_compare(c->cells[i], own) == 0;
        if (found)
            memcpy(out->chains[i], own_chain, sizeof out->chains[i]);
        else
            HW_TRY(find_other_chain(h, c->cells[i], stats, out->chains[i], &found));
        if (found)
            i++;
        else
            hw_crossing_remove(c, i);
    }
    return HW_OK;
}

hw_status hw_hybrid_find_cells(hybrid *h, const hw_camera *camera, hw_frame_stats *stats,
                               frame_cells *out)
{
    hw_cell_id id = hw_hexgrid_locate(&h->manifest.grid, camera->eye.x, camera->eye.y);
    hw_cell_gpu *own[HW_CELL_LEVELS_MAX];
    HW_TRY(find_own_chain(h, camera, id, stats, own));
    out->crossing = hw_crossing_none(id);
    if (!stats->stream.late_cells && !h->debug->hard)
        out->crossing = hw_crossing_at(&h->manifest.grid, id, camera->eye, h->crossing_width);
    HW_TRY(find_chains(h, id, own, stats, out));
    size_t near = 0, far = 0;
    for (uint32_t i = 0; i < out->crossing.count; i++) {
        near += out->chains[i][0]->records->near_count;
        for (int32_t l = 0; l < h->manifest.grid.levels; l++)
            far +=
                hw_hybrid_page_count(out->chains[i][l]->records->far_count) * HW_FAR_PAGE_RECORDS;
    }
    return hw_hybrid_reserve_scratch(h, near, far);
}
