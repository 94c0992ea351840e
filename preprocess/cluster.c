#include "cluster.h"
#include "alloc.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FACES        6
#define OCCLUSION_PX 8.0  // between points of a face that others may hide
#define DEPTH_MIN    1e-3 // in front of a plane
#define SLANT_MAX    1.2  // of lines of sight to the axis of the face that they are captured on

// A part of the plane at distance 1 along a face's axis.
typedef struct area {
    double low[2], high[2];
    double density; // texels per unit
    bool valid;     // all of it lies well in front
} area;

// One object, or several.
typedef struct cluster {
    area areas[FACES];
    double nearest, farthest; // horizontal distances from the cell's centre of what is drawn
    double texels;            // on the best face
    int face;
    uint32_t first, last, count; // members: a list through `next`
} cluster;

typedef struct clustering {
    const hw_cluster_inputs *in;
    hw_cluster_item *items;
    hw_vec3 **positions; // per item: vertices in the world
    cluster *clusters;   // per item, count 0 when joined to another
    uint32_t *next;      // per item: the member after it, UINT32_MAX at the end
    uint32_t *order;     // items by falling size
    uint32_t count;
} clustering;

// ---- what an object covers -------------------------------------------------------------------

static double texels_of(const area *a)
{
    double padding = 2 * HW_CAPTURE_PADDING;
    double w = ceil((a->high[0] - a->low[0]) * a->density),
           h = ceil((a->high[1] - a->low[1]) * a->density);
    return (fmax(w, 1) + padding) * (fmax(h, 1) + padding);
}

static bool is_too_large(const area *a, const hw_far_options *o)
{
    return fmax(a->high[0] - a->low[0], a->high[1] - a->low[1]) * a->density > o->capture_side_max;
}

static void choose_face(cluster *c)
{
    c->texels = INFINITY;
    for (int f = 0; f < FACES; f++)
        if (c->areas[f].valid && texels_of(&c->areas[f]) < c->texels) {
            c->texels = texels_of(&c->areas[f]);
            c->face = f;
        }
}

static area area_on(const clustering *k, uint32_t item, int face, double nearest)
{
    const hw_cell_view *view = k->in->view;
    hw_vec3 axis, right, up;
    hw_face_basis(face, &axis, &right, &up);
    area a = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}, 0, true};
    double depth_min = INFINITY;
    for (uint32_t v = 0; v < k->items[item].svmesh.record.vertex_count; v++) {
        hw_vec3 rel = hw_v3_sub(k->positions[item][v], view->centre);
        double depth = hw_v3_dot(rel, axis);
        double p[2] = {hw_v3_dot(rel, right) / depth, hw_v3_dot(rel, up) / depth};
        a.valid &= depth > DEPTH_MIN && fabs(p[0]) < SLANT_MAX;
        depth_min = fmin(depth_min, depth);
        for (int i = 0; i < 2; i++) {
            a.low[i] = fmin(a.low[i], p[i]);
            a.high[i] = fmax(a.high[i], p[i]);
        }
    }
    // For the nearest viewer in the cell, as of objects alone.
    a.density = view->focal_px * HW_TEXELS_PER_PX * fmax(1, depth_min / fmax(nearest, DEPTH_MIN));
    return a;
}

static hw_status measure_item(clustering *k, uint32_t i)
{
    const hw_cell_view *view = k->in->view;
    const hw_svmesh *s = &k->items[i].svmesh;
    cluster *c = &k->clusters[i];
    hw_mat4 matrix = hw_far_record_matrix(&s->record, view->centre);
    hw_box box = k->in->scene->objects[s->record.object_idx].bounds;
    double nearest = hw_region_distance_to(view->grid, view->id, box).nearest;
    *c = (cluster){.nearest = INFINITY, .first = i, .last = i, .count = 1};
    k->next[i] = UINT32_MAX;
    HW_TRY(HW_NEW(&k->positions[i], s->record.vertex_count));
    for (uint32_t v = 0; v < s->record.vertex_count; v++) {
        const hw_far_vertex *q = &s->vertices[v];
        double h[4];
        for (int r = 0; r < 4; r++)
            h[r] = matrix.m[r] * q->x + matrix.m[4 + r] * q->y + matrix.m[8 + r] * q->z +
                   matrix.m[12 + r];
        hw_vec3 p = hw_v3((float)(h[0] / h[3]), (float)(h[1] / h[3]), (float)(h[2] / h[3]));
        double d =
            hypot((double)p.x - (double)view->centre.x, (double)p.y - (double)view->centre.y);
        c->nearest = fmin(c->nearest, d);
        c->farthest = fmax(c->farthest, d);
        k->positions[i][v] = p;
    }
    for (int f = 0; f < FACES; f++)
        c->areas[f] = area_on(k, i, f, nearest);
    choose_face(c);
    // Flat pictures and meshes with several captures join nothing.
    bool single = s->record.cut_out || s->record.view_count > 0 || s->record.range_count > 0;
    for (int f = 0; f < FACES && single; f++)
        c->areas[f].valid = false;
    // What is saved is judged against what is there.
    c->texels = (double)s->capture.width * s->capture.height;
    return HW_OK;
}

// ---- the greedy rule -------------------------------------------------------------------------

// Both together; false if they are not cluster-able.
static bool unite(const clustering *k, const cluster *a, const cluster *b, cluster *out)
{
    const hw_far_options *o = k->in->options;
    *out = *a;
    out->count = a->count + b->count;
    out->nearest = fmin(a->nearest, b->nearest);
    out->farthest = fmax(a->farthest, b->farthest);
    double error = hw_self_occluding_error(k->in->view->size, out->nearest,
                                           out->farthest - out->nearest, HW_REFERENCE_IMAGE_PX);
    if (error >= k->in->self_occlusion_px)
        return false;
    for (int f = 0; f < FACES; f++) {
        area *u = &out->areas[f];
        const area *v = &b->areas[f];
        u->valid &= v->valid;
        u->density = fmax(u->density, v->density);
        for (int i = 0; i < 2; i++) {
            u->low[i] = fmin(u->low[i], v->low[i]);
            u->high[i] = fmax(u->high[i], v->high[i]);
        }
        u->valid &= !is_too_large(u, o);
    }
    choose_face(out);
    return out->texels < a->texels + b->texels;
}

// The size of what both cover of the picture, in pixels.
static double overlap(const clustering *k, const cluster *a, const cluster *b)
{
    const area *u = &a->areas[a->face], *v = &b->areas[a->face];
    double focal = k->in->view->focal_px, size = focal * focal;
    if (!u->valid || !v->valid)
        return 0;
    for (int i = 0; i < 2; i++)
        size *= fmax(0, fmin(u->high[i], v->high[i]) - fmax(u->low[i], v->low[i]));
    return size;
}

// The cluster that shares most with c and can be joined to it, of those of the first `known` items;
// NULL if there is none.
static cluster *best_partner(const clustering *k, const cluster *c, uint32_t known, cluster *joined)
{
    cluster *best = NULL;
    double most = 0;
    for (uint32_t i = 0; i < known; i++) {
        cluster *other = &k->clusters[k->order[i]];
        cluster both;
        double shared = other == c || other->count == 0 ? 0 : overlap(k, c, other);
        if (shared > most && unite(k, c, other, &both)) {
            most = shared;
            best = other;
            *joined = both;
        }
    }
    return best;
}

static void join(clustering *k)
{
    for (uint32_t i = 0; i < k->count; i++) {
        cluster *c = &k->clusters[k->order[i]], *other, joined;
        while ((other = best_partner(k, c, i, &joined)) != NULL) {
            k->next[other->last] = c->first;
            joined.first = other->first; // a larger one
            joined.last = c->last;
            *c = joined;
            other->count = 0;
        }
    }
}

typedef struct sized {
    double size;
    uint32_t object_idx, item;
} sized;

static int by_size(const void *x, const void *y)
{
    const sized *a = x, *b = y;
    if (a->size != b->size)
        return a->size > b->size ? -1 : 1;
    return (a->object_idx > b->object_idx) - (a->object_idx < b->object_idx);
}

static hw_status order_items(clustering *k)
{
    sized *list = NULL;
    HW_TRY(HW_NEW(&list, k->count));
    for (uint32_t i = 0; i < k->count; i++) {
        const area *a = &k->clusters[i].areas[k->clusters[i].face];
        list[i] = (sized){(a->high[0] - a->low[0]) * (a->high[1] - a->low[1]),
                          k->items[i].svmesh.record.object_idx, i};
    }
    qsort(list, k->count, sizeof *list, by_size);
    for (uint32_t i = 0; i < k->count; i++)
        k->order[i] = list[i].item;
    hw_free(list);
    return HW_OK;
}

// ---- the union -------------------------------------------------------------------------------

typedef struct merge {
    hw_view_mesh mesh;
    uint32_t *objects;
    bool *hiders; // per object of the scene
    bool *seen;   // per face of one member
} merge;

static hw_status merge_allocate(const clustering *k, const cluster *c, merge *m)
{
    size_t vertices = 0, indices = 0;
    for (uint32_t i = c->first; i != UINT32_MAX; i = k->next[i]) {
        vertices += k->items[i].svmesh.record.vertex_count;
        indices += k->items[i].svmesh.record.index_count;
    }
    HW_TRY(HW_NEW(&m->mesh.positions, vertices));
    HW_TRY(HW_NEW(&m->mesh.indices, indices));
    HW_TRY(HW_NEW(&m->seen, indices / 3));
    HW_TRY(HW_NEW(&m->objects, c->count));
    return HW_NEW(&m->hiders, k->in->scene->object_count);
}

// Adds what no other member hides of a member.
static hw_status merge_member(const clustering *k, const hw_svmesh_job *job, uint32_t item,
                              merge *m)
{
    const hw_svmesh *s = &k->items[item].svmesh;
    const hw_sight_surface surface = {.box = k->in->scene->objects[s->record.object_idx].bounds,
                                      .hiders = m->hiders,
                                      .vertex_count = s->record.vertex_count,
                                      .index_count = s->record.index_count,
                                      .positions = k->positions[item],
                                      .indices = s->indices,
                                      .spacing = OCCLUSION_PX * job->distance.effective /
                                                 job->view->focal_px};
    HW_TRY(hw_occlusion_faces(k->in->occlusion, job->view->id, &surface, m->seen));
    uint32_t first = m->mesh.vertex_count;
    for (uint32_t v = 0; v < s->record.vertex_count; v++)
        if (!hw_svmesh_project(job, k->positions[item][v],
                               m->mesh.positions[m->mesh.vertex_count++]))
            return hw_fail(HW_INTERNAL, "a cluster reaches behind the centre of its cell");
    for (uint32_t i = 0; i < s->record.index_count; i++)
        if (m->seen[i / 3])
            m->mesh.indices[m->mesh.index_count++] = first + s->indices[i];
    return HW_OK;
}

static hw_status merge_all(const clustering *k, const cluster *c, hw_svmesh_job *job, merge *m,
                           bool *fits, hw_svmesh *out)
{
    const hw_cell_view *view = k->in->view;
    HW_TRY(merge_allocate(k, c, m));
    for (uint32_t i = c->first; i != UINT32_MAX; i = k->next[i]) {
        uint32_t object_idx = k->items[i].svmesh.record.object_idx;
        hw_region_distance d =
            hw_region_distance_to(view->grid, view->id, k->in->scene->objects[object_idx].bounds);
        if (job->member_count == 0 || d.nearest < job->distance.nearest)
            job->distance = d;
        m->objects[job->member_count++] = object_idx;
        m->hiders[object_idx] = true;
    }
    job->object_idx = m->objects[0];
    job->members = m->objects;
    for (uint32_t i = c->first; i != UINT32_MAX; i = k->next[i])
        HW_TRY(merge_member(k, job, i, m));
    HW_TRY(hw_view_mesh_compact(&m->mesh));
    return hw_svmesh_finish(job, &m->mesh, fits, out);
}

// Puts the union in the place of the first member; if its capture comes out too large after all,
// the members stay.
static hw_status merge_cluster(clustering *k, const cluster *c)
{
    hw_status status = HW_OK;
    merge m = {0};
    hw_svmesh whole;
    bool fits = true;
    hw_svmesh_job job = {.view = k->in->view,
                         .options = k->in->options,
                         .scene = k->in->scene,
                         .capturer = k->in->capturer,
                         .face = c->face};
    HW_GO(merge_all(k, c, &job, &m, &fits, &whole));
    if (!fits || whole.record.index_count == 0)
        goto out;
    for (uint32_t i = c->first; i != UINT32_MAX; i = k->next[i])
        hw_svmesh_free(&k->items[i].svmesh);
    k->items[c->first].svmesh = whole;
out:
    hw_view_mesh_free(&m.mesh);
    hw_free(m.objects);
    hw_free(m.hiders);
    hw_free(m.seen);
    return status;
}

static void drop_empty(hw_cluster_item *items, uint32_t *count)
{
    uint32_t left = 0;
    for (uint32_t i = 0; i < *count; i++)
        if (items[i].svmesh.record.index_count > 0)
            items[left++] = items[i];
    *count = left;
}

hw_status hw_clusters_make(const hw_cluster_inputs *in, hw_cluster_item *items, uint32_t *count)
{
    hw_status status = HW_OK;
    clustering k = {.in = in, .items = items, .count = *count};
    HW_GO(HW_NEW(&k.positions, k.count));
    HW_GO(HW_NEW(&k.clusters, k.count));
    HW_GO(HW_NEW(&k.next, k.count));
    HW_GO(HW_NEW(&k.order, k.count));
    for (uint32_t i = 0; i < k.count; i++)
        HW_GO(measure_item(&k, i));
    HW_GO(order_items(&k));
    join(&k);
    for (uint32_t i = 0; i < k.count; i++)
        if (k.clusters[i].count > 1)
            HW_GO(merge_cluster(&k, &k.clusters[i]));
out:
    for (uint32_t i = 0; k.positions && i < k.count; i++)
        hw_free(k.positions[i]);
    hw_free(k.positions);
    hw_free(k.clusters);
    hw_free(k.next);
    hw_free(k.order);
    drop_empty(items, count);
    return status;
}
