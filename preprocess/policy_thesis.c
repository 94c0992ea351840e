// The policy of thesis 5.2.1 as it is written: weights from the categories of the depth image,
// half-edge collapses in order of cost until the cheapest costs more than T_l; of the result, the
// faces that face the cell centre. Of an MVMesh: the largest weight and projected length over its
// views, no collapse of vertices that no view sees together, and the faces that face the cell. It
// starts from a chain level whose outline deviates by far less than a pixel, not from the scan
// itself.
#include "alloc.h"
#include "classify.h"
#include "collapse.h"
#include "metric.h"
#include "mvmesh.h"
#include "svmesh.h"
#include <math.h>
#include <string.h>

#define START_OUTLINE_PX 0.02

typedef struct weighing {
    hw_view_mesh mesh; // the level, projected from the cell centre
    float (*normals)[3];
    float *weights; // the largest so far
    uint32_t *sets; // a bit for each view that sees the vertex
    float (*images[HW_FAR_VIEWS_MAX])[2];
    uint32_t view_count;
    // Of the view at work, per vertex.
    bool *front; // some face round it faces the view
    double *depths;
} weighing;

static void weighing_free(weighing *w)
{
    hw_view_mesh_free(&w->mesh);
    hw_free(w->normals);
    hw_free(w->weights);
    hw_free(w->sets);
    for (uint32_t k = 0; k < HW_FAR_VIEWS_MAX; k++)
        hw_free(w->images[k]);
    hw_free(w->front);
    hw_free(w->depths);
}

static hw_status weighing_make(const hw_mesh *level, weighing *w)
{
    uint32_t n = level->vertex_count;
    HW_TRY(HW_NEW(&w->mesh.positions, n));
    HW_TRY(HW_NEW(&w->mesh.indices, level->index_count));
    HW_TRY(HW_NEW(&w->normals, n));
    HW_TRY(HW_NEW(&w->weights, n));
    HW_TRY(HW_NEW(&w->sets, n));
    HW_TRY(HW_NEW(&w->front, n));
    return HW_NEW(&w->depths, n);
}

static hw_status project(const hw_svmesh_job *job, const hw_mesh *level, weighing *w)
{
    const hw_mat4 *transform = &job->scene->objects[job->object_idx].transform;
    w->mesh.vertex_count = level->vertex_count;
    w->mesh.index_count = level->index_count;
    memcpy(w->mesh.indices, level->indices, level->index_count * sizeof *level->indices);
    for (uint32_t v = 0; v < level->vertex_count; v++) {
        hw_vec3 n = hw_mat4_normal(transform, level->normals[v]);
        w->normals[v][0] = n.x;
        w->normals[v][1] = n.y;
        w->normals[v][2] = n.z;
        if (!hw_svmesh_project(job, hw_mat4_point(transform, level->positions[v]),
                               w->mesh.positions[v]))
            return hw_fail(HW_INTERNAL, "a far object reaches behind the centre of its cell");
    }
    return HW_OK;
}

// The vertices as the cell centre sees them, and the window round them.
static bool look_from_centre(const hw_svmesh_job *job, weighing *w, hw_capture_window *window)
{
    double parallax = job->view->focal_px * job->view->size;
    float(*image)[2] = w->images[0];
    for (uint32_t v = 0; v < w->mesh.vertex_count; v++) {
        image[v][0] = (float)w->mesh.positions[v][0];
        image[v][1] = (float)w->mesh.positions[v][1];
        w->depths[v] = parallax / w->mesh.positions[v][2];
    }
    return hw_svmesh_window(job, &w->mesh, window);
}

// The same from another point; false if a vertex lies behind it, or the window is too large.
static bool look_from(const hw_svmesh_job *job, const hw_mesh *level, hw_vec3 eye, uint32_t index,
                      weighing *w, hw_capture_window *window)
{
    const hw_mat4 *transform = &job->scene->objects[job->object_idx].transform;
    hw_plane_bounds bounds = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}, INFINITY};
    int face = hw_mvmesh_face(job, eye);
    for (uint32_t v = 0; v < level->vertex_count; v++) {
        double plane[3];
        if (!hw_plane_project(eye, face, hw_mat4_point(transform, level->positions[v]), plane))
            return false;
        w->depths[v] = plane[2];
        hw_plane_bounds_add(&bounds, plane);
        for (int k = 0; k < 2; k++)
            w->images[index][v][k] = (float)(plane[k] * job->view->focal_px);
    }
    return hw_capture_window_fit(job, eye, face, &bounds, window);
}

// A face turns to the view when its projection is counter-clockwise.
static bool turns_to(const float (*image)[2], const uint32_t *t)
{
    const float *a = image[t[0]], *b = image[t[1]], *c = image[t[2]];
    return ((double)b[0] - a[0]) * ((double)c[1] - a[1]) -
               ((double)b[1] - a[1]) * ((double)c[0] - a[0]) >
           0;
}

static void find_front(uint32_t index, weighing *w)
{
    const float(*image)[2] = (const float(*)[2])w->images[index];
    memset(w->front, 0, w->mesh.vertex_count * sizeof *w->front);
    for (uint32_t i = 0; i < w->mesh.index_count; i += 3)
        for (int k = 0; k < 3 && turns_to(image, w->mesh.indices + i); k++)
            w->front[w->mesh.indices[i + k]] = true;
}

// The pixel of the capture that a vertex falls into, clamped to the window.
static uint32_t pixel_of(const hw_capture_window *window, const float position[2], double focal)
{
    double x =
        (position[0] / focal - window->x_min) / (window->x_max - window->x_min) * window->width;
    double y =
        (position[1] / focal - window->y_min) / (window->y_max - window->y_min) * window->height;
    uint32_t i = (uint32_t)fmin(fmax(x, 0), window->width - 1.0),
             j = (uint32_t)fmin(fmax(y, 0), window->height - 1.0);
    return j * window->width + i;
}

static hw_status weigh(const hw_svmesh_job *job, const hw_capture_window *window, uint32_t index,
                       weighing *w)
{
    hw_status status;
    hw_capture capture = {0};
    uint8_t *categories = NULL;
    find_front(index, w);
    HW_GO(hw_capture_object(job->capturer, job->object_idx, window, 1, 0, &capture));
    HW_GO(HW_NEW(&categories, (size_t)capture.width * capture.height));
    HW_GO(hw_classify(capture.depths, capture.width, capture.height, NULL, categories));
    for (uint32_t v = 0; v < w->mesh.vertex_count; v++) {
        uint32_t pixel = pixel_of(window, w->images[index][v], job->view->focal_px);
        float depth = capture.depths[pixel];
        float weight = hw_viewcell_weight(w->front[v], w->depths[v], depth, categories[pixel]);
        w->weights[v] = fmaxf(w->weights[v], weight);
        if (hw_viewcell_visible(w->front[v], w->depths[v], depth))
            w->sets[v] |= 1u << index;
    }
out:
    hw_free(categories);
    hw_capture_free(&capture);
    return status;
}

// Weighs from all views; *fits is false if the object is too large to be captured at all.
static hw_status weigh_views(const hw_svmesh_job *job, const hw_mesh *level, weighing *w,
                             bool *fits)
{
    hw_vec3 eyes[HW_FAR_VIEWS_MAX];
    hw_capture_window window;
    uint32_t eye_count = hw_mvmesh_eyes(job, eyes);
    uint32_t wanted = job->multi_view ? job->options->multi_view_count : 1;
    *fits = true;
    for (uint32_t i = 0; i < eye_count && w->view_count < wanted; i++) {
        uint32_t index = w->view_count;
        if (!w->images[index])
            HW_TRY(HW_NEW(&w->images[index], level->vertex_count));
        bool good = i == 0 ? look_from_centre(job, w, &window)
                           : look_from(job, level, eyes[i], index, w, &window);
        if (i == 0 && !good) {
            *fits = false;
            return HW_OK;
        }
        if (!good)
            continue;
        HW_TRY(weigh(job, &window, index, w));
        w->view_count++;
    }
    return HW_OK;
}

// Keeps the faces towards the centre, of an MVMesh those that some point of the cell may see.
// `kept` tells the level's vertex of each vertex.
static void cull(const hw_svmesh_job *job, const hw_mesh *level, const weighing *w,
                 const uint32_t *kept, hw_view_mesh *mesh)
{
    hw_vec3 eyes[HW_CELL_CORNERS];
    uint32_t n = 0, eye_count = hw_svmesh_eyes(job, false, eyes);
    for (uint32_t i = 0; i < mesh->index_count; i += 3) {
        const uint32_t old[3] = {kept[mesh->indices[i]], kept[mesh->indices[i + 1]],
                                 kept[mesh->indices[i + 2]]};
        const hw_vec3 *p = level->positions;
        bool stays = job->multi_view ? hw_triangle_facing(p[old[0]], p[old[1]], p[old[2]], eyes,
                                                          eye_count) != HW_FACING_BACK
                                     : turns_to((const float(*)[2])w->images[0], old);
        if (!stays)
            continue;
        memmove(mesh->indices + n, mesh->indices + i, 3 * sizeof *mesh->indices);
        n += 3;
    }
    mesh->index_count = n;
}

// Vertices that share their place with another: along seams of texture coordinates or hard edges,
// which would open if each side moved by itself.
static hw_status lock_seams(const hw_mesh *level, bool **out)
{
    hw_status status = HW_OK;
    uint32_t *same = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&same, level->vertex_count));
    HW_GO(hw_mesh_weld_map(level, same));
    HW_GO(HW_NEW(out, level->vertex_count));
    for (uint32_t v = 0; v < level->vertex_count; v++)
        if (same[v] != v)
            (*out)[v] = (*out)[same[v]] = true;
out:
    hw_free(same);
    return status;
}

static hw_status collapse(const hw_svmesh_job *job, const hw_mesh *level, const weighing *w,
                          hw_view_mesh *out)
{
    hw_status status;
    hw_collapser *c = NULL;
    uint32_t *kept = NULL;
    bool *locked = NULL;
    HW_GO(lock_seams(level, &locked));
    HW_GO(hw_collapser_create((const double(*)[3])w->mesh.positions, w->mesh.vertex_count,
                              w->mesh.indices, w->mesh.index_count / 3, locked, HW_COMPLEX_LOCK,
                              &c));
    hw_multiview_metric context = {
        .base = {(const float(*)[3])w->normals, (const float(*)[2])w->images[0], w->weights},
        .view_count = w->view_count,
        .sets = w->sets};
    for (uint32_t k = 0; k < w->view_count; k++)
        context.images[k] = (const float(*)[2])w->images[k];
    hw_metric metric =
        job->multi_view ? hw_metric_multiview(&context) : hw_metric_viewcell(&context.base);
    hw_collapse_limits limits = {.cost = job->options->edge_length_px};
    HW_GO(hw_collapser_run(c, &metric, &limits));
    HW_GO(HW_NEW(&kept, c->vertex_count));
    HW_GO(HW_NEW(&out->indices, 3 * (size_t)c->live_faces));
    out->index_count = 3 * c->live_faces;
    out->vertex_count = hw_collapser_extract(c, kept, out->indices);
    HW_GO(HW_NEW(&out->positions, out->vertex_count));
    for (uint32_t v = 0; v < out->vertex_count; v++)
        memcpy(out->positions[v], c->positions[kept[v]], sizeof out->positions[v]);
    cull(job, level, w, kept, out);
    HW_GO(hw_view_mesh_compact(out));
out:
    hw_free(locked);
    hw_free(kept);
    hw_collapser_destroy(c);
    return status;
}

static hw_status simplify(const hw_svmesh_job *job, hw_view_mesh *out)
{
    hw_status status;
    weighing w = {0};
    bool fits;
    double bound = START_OUTLINE_PX * job->distance.effective / (job->view->focal_px * job->scale);
    const hw_mesh *level = &job->chain->levels[hw_chain_level_by_silhouette(job->chain, bound)];
    HW_GO(weighing_make(level, &w));
    HW_GO(project(job, level, &w));
    HW_GO(weigh_views(job, level, &w, &fits));
    if (fits) {
        HW_GO(collapse(job, level, &w, out));
    } else { // hand it back whole, the derivation makes the object near
        *out = w.mesh;
        w.mesh = (hw_view_mesh){0};
    }
out:
    weighing_free(&w);
    if (status != HW_OK)
        hw_view_mesh_free(out);
    return status;
}

const hw_svmesh_policy hw_policy_thesis = {
    "thesis", "the cost of the thesis, section 5.2.1, up to T_l", simplify};
