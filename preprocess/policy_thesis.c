// The policy of thesis 5.2.1 as it is written: weights from the categories of the depth image,
// half-edge collapses in order of cost until the cheapest costs more than T_l; of the result, the
// faces that face the cell centre. It starts from a chain level whose outline deviates by far less
// than a pixel, not from the scan itself.
#include "alloc.h"
#include "classify.h"
#include "collapse.h"
#include "metric.h"
#include "svmesh.h"
#include <math.h>
#include <string.h>

#define START_OUTLINE_PX 0.02
typedef struct weighing {
    hw_view_mesh mesh; // the level, projected
    bool *front;       // per vertex: some face round it faces the centre
    float (*normals)[3];
    float (*image)[2];
    float *weights;
} weighing;

static void weighing_free(weighing *w)
{
    hw_view_mesh_free(&w->mesh);
    hw_free(w->front);
    hw_free(w->normals);
    hw_free(w->image);
    hw_free(w->weights);
}

// A face turns to the centre when its projection is counter-clockwise.
static bool faces_centre(const hw_view_mesh *mesh, const uint32_t *t)
{
    const double *a = mesh->positions[t[0]], *b = mesh->positions[t[1]], *c = mesh->positions[t[2]];
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0;
}

static hw_status project(const hw_svmesh_job *job, const hw_mesh *level, weighing *w)
{
    const hw_mat4 *transform = &job->scene->objects[job->object_idx].transform;
    w->mesh.vertex_count = level->vertex_count;
    w->mesh.index_count = level->index_count;
    memcpy(w->mesh.indices, level->indices, level->index_count * sizeof *level->indices);
    for (uint32_t v = 0; v < level->vertex_count; v++)
        if (!hw_svmesh_project(job, hw_mat4_point(transform, level->positions[v]),
                               w->mesh.positions[v]))
            return hw_fail(HW_INTERNAL, "a far object reaches behind the centre of its cell");
    for (uint32_t i = 0; i < level->index_count; i += 3)
        for (int k = 0; k < 3 && faces_centre(&w->mesh, level->indices + i); k++)
            w->front[level->indices[i + k]] = true;
    return HW_OK;
}

// Keeps the faces towards the centre.
static void cull(hw_view_mesh *mesh)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < mesh->index_count; i += 3)
        if (faces_centre(mesh, mesh->indices + i)) {
            memmove(mesh->indices + n, mesh->indices + i, 3 * sizeof *mesh->indices);
            n += 3;
        }
    mesh->index_count = n;
}

// The pixel of the capture that a vertex falls into, clamped to the window.
static uint32_t pixel_of(const hw_capture_window *window, const double position[3], double focal)
{
    double x =
        (position[0] / focal - window->x_min) / (window->x_max - window->x_min) * window->width;
    double y =
        (position[1] / focal - window->y_min) / (window->y_max - window->y_min) * window->height;
    uint32_t i = (uint32_t)fmin(fmax(x, 0), window->width - 1.0),
             j = (uint32_t)fmin(fmax(y, 0), window->height - 1.0);
    return j * window->width + i;
}

static hw_status weigh(const hw_svmesh_job *job, const hw_mesh *level,
                       const hw_capture_window *window, weighing *w)
{
    hw_status status;
    hw_capture capture = {0};
    uint8_t *categories = NULL;
    const hw_mat4 *transform = &job->scene->objects[job->object_idx].transform;
    double focal = job->view->focal_px, parallax = focal * job->view->size;
    HW_GO(hw_capture_object(job->capturer, job->object_idx, window, 1, &capture));
    HW_GO(HW_NEW(&categories, (size_t)capture.width * capture.height));
    HW_GO(hw_classify(capture.depths, capture.width, capture.height, NULL, categories));
    for (uint32_t v = 0; v < w->mesh.vertex_count; v++) {
        const double *p = w->mesh.positions[v];
        hw_vec3 n = hw_mat4_normal(transform, level->normals[v]);
        w->normals[v][0] = n.x;
        w->normals[v][1] = n.y;
        w->normals[v][2] = n.z;
        w->image[v][0] = (float)p[0];
        w->image[v][1] = (float)p[1];
        uint32_t pixel = pixel_of(window, p, focal);
        double depth = parallax / p[2];
        w->weights[v] =
            hw_viewcell_weight(w->front[v], depth, capture.depths[pixel], categories[pixel]);
    }
out:
    hw_free(categories);
    hw_capture_free(&capture);
    return status;
}

static hw_status collapse(const hw_svmesh_job *job, weighing *w, hw_view_mesh *out)
{
    hw_status status;
    hw_collapser *c = NULL;
    uint32_t *kept = NULL;
    HW_GO(hw_collapser_create((const double(*)[3])w->mesh.positions, w->mesh.vertex_count,
                              w->mesh.indices, w->mesh.index_count / 3, NULL, HW_COMPLEX_LOCK, &c));
    hw_viewcell_metric context = {(const float(*)[3])w->normals, (const float(*)[2])w->image,
                                  w->weights};
    hw_metric metric = hw_metric_viewcell(&context);
    hw_collapse_limits limits = {.cost = job->options->edge_length_px};
    HW_GO(hw_collapser_run(c, &metric, &limits));
    HW_GO(HW_NEW(&kept, c->vertex_count));
    HW_GO(HW_NEW(&out->indices, 3 * (size_t)c->live_faces));
    out->index_count = 3 * c->live_faces;
    out->vertex_count = hw_collapser_extract(c, kept, out->indices);
    HW_GO(HW_NEW(&out->positions, out->vertex_count));
    for (uint32_t v = 0; v < out->vertex_count; v++)
        memcpy(out->positions[v], c->positions[kept[v]], sizeof out->positions[v]);
    cull(out);
    HW_GO(hw_view_mesh_compact(out));
out:
    hw_free(kept);
    hw_collapser_destroy(c);
    return status;
}

static hw_status simplify(const hw_svmesh_job *job, hw_view_mesh *out)
{
    hw_status status;
    weighing w = {0};
    hw_capture_window window;
    double bound = START_OUTLINE_PX * job->distance.effective / (job->view->focal_px * job->scale);
    const hw_mesh *level = &job->chain->levels[hw_chain_level_by_silhouette(job->chain, bound)];
    HW_GO(HW_NEW(&w.mesh.positions, level->vertex_count));
    HW_GO(HW_NEW(&w.mesh.indices, level->index_count));
    HW_GO(HW_NEW(&w.front, level->vertex_count));
    HW_GO(project(job, level, &w));
    HW_GO(HW_NEW(&w.normals, w.mesh.vertex_count));
    HW_GO(HW_NEW(&w.image, w.mesh.vertex_count));
    HW_GO(HW_NEW(&w.weights, w.mesh.vertex_count));
    if (hw_svmesh_window(job, &w.mesh, &window)) {
        HW_GO(weigh(job, level, &window, &w));
        HW_GO(collapse(job, &w, out));
    } else { // too large to capture: hand it back whole, the derivation makes the object near
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
