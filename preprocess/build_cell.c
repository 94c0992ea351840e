#include "build_cell.h"
#include "alloc.h"
#include "atlas.h"
#include "block.h"
#include "cluster.h"
#include "system.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct assembly {
    hw_near_record *near;
    hw_cluster_item *far;
    uint32_t near_count, far_count;
} assembly;

// A policy that lets another one do the work and tells how long it took.
typedef struct timed_policy {
    hw_svmesh_policy policy; // first: the job's options point here
    const hw_svmesh_policy *inner;
    double ms, capture_ms; // of which in captures
} timed_policy;

static hw_status simplify_timed(const hw_svmesh_job *job, hw_view_mesh *out)
{
    // The options that lead here belong to one call of hw_build_cell, which may write to it.
    timed_policy *timed = (timed_policy *)(uintptr_t)job->options->policy;
    double start = hw_clock_ms(), captured = hw_capture_thread_seconds();
    hw_status status = timed->inner->simplify(job, out);
    timed->capture_ms += (hw_capture_thread_seconds() - captured) * 1000;
    timed->ms += hw_clock_ms() - start;
    return status;
}

uint32_t hw_near_level(const hw_chain *chain, double scale, double distance, double focal_px,
                       double error_px)
{
    if (chain->levels[0].uvs || !(distance > 0))
        return 0;
    double bound = error_px * distance / (focal_px * scale);
    return hw_chain_level_to_draw(chain, HW_NEAR_LEVEL_STRIDE, bound) / HW_NEAR_LEVEL_STRIDE;
}

static hw_status add_object(const hw_cell_inputs *in, const hw_cell_view *view,
                            const hw_far_options *far, uint32_t object_idx, assembly *a)
{
    const hw_object *object = &in->scene->objects[object_idx];
    hw_vec3 towards = hw_v3_sub(hw_box_centre(object->bounds), view->centre);
    hw_svmesh_job job = {
        .view = view,
        .options = far,
        .scene = in->scene,
        .capturer = in->capturer,
        .occlusion = in->cull_faces ? in->occlusion : NULL,
        .chain = &in->chains[object->mesh_idx],
        .object_idx = object_idx,
        .distance = hw_region_distance_to(view->grid, view->id, object->bounds),
        .scale = hw_mat4_stretch(&object->transform),
        .face = hw_face_towards(towards.x, towards.y),
    };
    bool is_near;
    hw_cluster_item *slot = &a->far[a->far_count];
    HW_TRY(hw_svmesh_derive(&job, &is_near, &slot->svmesh));
    if (is_near) {
        uint32_t level = hw_near_level(job.chain, job.scale, job.distance.nearest, view->focal_px,
                                       in->near_error_px);
        a->near[a->near_count++] = (hw_near_record){object_idx, level};
    } else if (slot->svmesh.record.index_count > 0) {
        slot->azimuth = atan2(towards.y, towards.x);
        a->far_count++;
    }
    return HW_OK;
}

static int by_object(const void *x, const void *y)
{
    const hw_near_record *a = x, *b = y;
    return (a->object_idx > b->object_idx) - (a->object_idx < b->object_idx);
}

static int by_azimuth(const void *x, const void *y)
{
    const hw_cluster_item *a = x, *b = y;
    bool a_multi = a->svmesh.record.range_count > 0, b_multi = b->svmesh.record.range_count > 0;
    if (a_multi != b_multi)
        return a_multi ? -1 : 1; // so that their colours are those of the first vertices
    if (a->azimuth != b->azimuth)
        return a->azimuth < b->azimuth ? -1 : 1;
    return a->svmesh.record.object_idx < b->svmesh.record.object_idx ? -1 : 1;
}

// Coverage is kept of cut-out records only: what is the same everywhere costs nothing.
static void copy_capture(hw_image *atlas, const hw_rect *place, const hw_capture *capture,
                         bool cut_out)
{
    for (uint32_t y = 0; y < capture->height; y++) {
        const hw_color8 *from = capture->colors + (size_t)y * capture->width;
        const uint8_t *coverage = cut_out ? capture->coverage + (size_t)y * capture->width : NULL;
        uint8_t *to = atlas->data + ((size_t)(place->y + y) * atlas->width + place->x) * 4;
        for (uint32_t x = 0; x < capture->width; x++, to += 4) {
            to[0] = from[x].r;
            to[1] = from[x].g;
            to[2] = from[x].b;
            to[3] = cut_out ? coverage[x] : 255;
        }
    }
}

// A capture, and the rectangle in the atlas that tells where it went.
typedef struct placement {
    const hw_capture *capture;
    hw_rect *rect;
    bool cut_out;
} placement;

// All captures of all records; count_captures of them.
static void list_captures(assembly *a, placement *out)
{
    for (uint32_t i = 0; i < a->far_count; i++) {
        hw_svmesh *mesh = &a->far[i].svmesh;
        *out++ = (placement){&mesh->capture, &mesh->record.rect, mesh->record.cut_out};
        for (uint32_t k = 0; k < mesh->record.view_count; k++)
            *out++ = (placement){&mesh->view_captures[k], &mesh->views[k].rect, false};
    }
}

static uint32_t count_captures(const assembly *a)
{
    uint32_t count = a->far_count;
    for (uint32_t i = 0; i < a->far_count; i++)
        count += a->far[i].svmesh.record.view_count;
    return count;
}

// Packs the captures; blocks of 4 x 4 texels are never shared between two of them.
static hw_status pack_atlas(assembly *a, hw_cell *out)
{
    hw_status status;
    hw_rect *places = NULL;
    placement *captures = NULL;
    hw_image atlas = {0};
    uint32_t count = count_captures(a);
    HW_GO(HW_NEW(&places, count));
    HW_GO(HW_NEW(&captures, count));
    list_captures(a, captures);
    for (uint32_t i = 0; i < count; i++)
        places[i] = (hw_rect){0, 0, captures[i].capture->width, captures[i].capture->height};
    status =
        hw_atlas_pack(places, count, 4, HW_CELL_ATLAS_MAX, &out->atlas_width, &out->atlas_height);
    if (status == HW_LIMIT)
        status = hw_fail(HW_LIMIT,
                         "cell %d/%d_%d: its captures do not fit into an atlas of %u x %u texels: "
                         "smaller cells or a smaller --texture-side leave more objects near",
                         out->id.level, out->id.q, out->id.r, HW_CELL_ATLAS_MAX, HW_CELL_ATLAS_MAX);
    HW_GO(status);
    HW_GO(hw_image_make(&atlas, out->atlas_width, out->atlas_height, 4));
    for (uint32_t i = 0; i < count; i++) {
        copy_capture(&atlas, &places[i], captures[i].capture, captures[i].cut_out);
        captures[i].rect->x = places[i].x + HW_CAPTURE_PADDING;
        captures[i].rect->y = places[i].y + HW_CAPTURE_PADDING;
    }
    HW_GO(HW_NEW(&out->atlas_bc1, hw_bc1_bytes(out->atlas_width, out->atlas_height)));
    HW_GO(HW_NEW(&out->coverage_bc4, hw_bc1_bytes(out->atlas_width, out->atlas_height)));
    hw_bc1_encode(&atlas, out->atlas_bc1);
    hw_bc4_encode(&atlas, 3, out->coverage_bc4);
out:
    hw_image_free(&atlas);
    hw_free(captures);
    hw_free(places);
    return status;
}

static hw_status join_meshes(const assembly *a, hw_cell *out)
{
    uint64_t vertices = 0, indices = 0, views = 0, ranges = 0, colors = 0;
    for (uint32_t i = 0; i < a->far_count; i++) {
        const hw_svmesh *s = &a->far[i].svmesh;
        vertices += s->record.vertex_count;
        indices += s->record.index_count;
        views += s->record.view_count;
        ranges += s->record.range_count;
        if (s->colors)
            colors = vertices;
    }
    if (a->far_count > HW_CELL_RECORDS_MAX || vertices > HW_CELL_VERTICES_MAX ||
        indices > HW_CELL_INDICES_MAX)
        return hw_fail(
            HW_LIMIT,
            "cell %d_%d sees %u far objects with %llu vertices, more than a cell file holds",
            out->id.q, out->id.r, a->far_count, (unsigned long long)vertices);
    HW_TRY(HW_NEW(&out->far, a->far_count));
    HW_TRY(HW_NEW(&out->vertices, vertices));
    HW_TRY(HW_NEW(&out->indices, indices));
    HW_TRY(HW_NEW(&out->views, views));
    HW_TRY(HW_NEW(&out->ranges, ranges));
    HW_TRY(HW_NEW(&out->colors, colors));
    out->color_count = (uint32_t)colors;
    for (uint32_t i = 0; i < a->far_count; i++) {
        const hw_svmesh *s = &a->far[i].svmesh;
        hw_far_record *record = &out->far[i];
        *record = s->record;
        record->first_vertex = out->vertex_count;
        record->first_index = out->index_count;
        record->first_view = out->view_count;
        record->first_range = out->range_count;
        if (s->colors)
            memcpy(out->colors + out->vertex_count, s->colors,
                   record->vertex_count * sizeof *s->colors);
        for (uint32_t k = 0; k < record->view_count; k++)
            out->views[out->view_count++] = s->views[k];
        for (uint32_t k = 0; k < record->range_count; k++)
            out->ranges[out->range_count++] = s->ranges[k];
        for (uint32_t v = 0; v < record->vertex_count; v++) {
            hw_far_vertex *vertex = &out->vertices[out->vertex_count++];
            *vertex = s->vertices[v];
            vertex->record = (uint16_t)i;
        }
        for (uint32_t k = 0; k < record->index_count; k++)
            out->indices[out->index_count++] = record->first_vertex + s->indices[k];
    }
    out->far_count = a->far_count;
    return HW_OK;
}

// Sorts the objects into near and far and derives the far ones' meshes.
static hw_status add_objects(const hw_cell_inputs *in, const hw_cell_view *view, assembly *a,
                             hw_cell_seconds *seconds)
{
    hw_status status = HW_OK;
    timed_policy timed = {
        {in->far.policy->name, in->far.policy->help, simplify_timed}, in->far.policy, 0, 0};
    hw_far_options far = in->far;
    far.policy = &timed.policy;
    double start = hw_clock_ms(), captured = hw_capture_thread_seconds();
    uint32_t count = in->scene->object_count;
    bool *seen = NULL;
    HW_GO(HW_NEW(&a->near, count));
    HW_GO(HW_NEW(&a->far, count));
    if (in->cull_objects) {
        HW_GO(HW_NEW(&seen, count));
        HW_GO(hw_occlusion_query(in->occlusion, view->id, seen));
    }
    for (uint32_t i = 0; i < count; i++) {
        uint32_t k = in->backwards ? count - 1 - i : i, object_idx = in->order ? in->order[k] : k;
        if ((seen && !seen[object_idx]) || !hw_groups_leave_to(in->groups, view->id, object_idx))
            continue;
        HW_GO(hw_budget_use(in->budget, in->scene->objects[object_idx].mesh_idx));
        HW_GO(add_object(in, view, &far, object_idx, a));
    }
    if (in->clusters) {
        const hw_cluster_inputs clusters = {.view = view,
                                            .options = &in->far,
                                            .scene = in->scene,
                                            .capturer = in->capturer,
                                            .occlusion = in->occlusion,
                                            .self_occlusion_px = in->cluster_error_px};
        HW_GO(hw_clusters_make(&clusters, a->far, &a->far_count));
    }
    qsort(a->near, a->near_count, sizeof *a->near, by_object);
    qsort(a->far, a->far_count, sizeof *a->far, by_azimuth);
out:
    hw_free(seen);
    captured = hw_capture_thread_seconds() - captured;
    double simplified = (timed.ms - timed.capture_ms) / 1000;
    seconds->capture += captured;
    seconds->simplify += simplified;
    seconds->classify += (hw_clock_ms() - start) / 1000 - captured - simplified;
    return status;
}

hw_status hw_build_cell(const hw_cell_inputs *in, hw_cell_id id, hw_cell *out,
                        hw_cell_seconds *seconds)
{
    hw_status status;
    assembly a = {0};
    hw_cell_view view = hw_cell_view_make(in->grid, id);
    memset(out, 0, sizeof *out);
    out->id = id;
    out->centre = view.centre;
    out->key = in->key;
    HW_GO(add_objects(in, &view, &a, seconds));
    if (id.level > 0 && a.near_count > 0)
        HW_GO(hw_fail(HW_INTERNAL, "object %u cannot be drawn from cell %d/%d_%d",
                      a.near[0].object_idx, id.level, id.q, id.r));
    double start = hw_clock_ms();
    out->near = a.near;
    out->near_count = a.near_count;
    a.near = NULL;
    if (a.far_count > 0)
        HW_GO(pack_atlas(&a, out));
    HW_GO(join_meshes(&a, out));
    seconds->pack += (hw_clock_ms() - start) / 1000;
out:
    for (uint32_t i = 0; i < a.far_count; i++)
        hw_svmesh_free(&a.far[i].svmesh);
    hw_free(a.near);
    hw_free(a.far);
    if (status != HW_OK)
        hw_cell_free(out);
    return status;
}
