// The metric `viewcell` for one mesh seen from one eye: what the build does per cell and object,
// here for a person who simplifies a single scan for one place to stand.
#include "alloc.h"
#include "classify.h"
#include "metrics.h"
#include "rays.h"
#include <string.h>

#define SIDE_MAX 4096.0 // pixels of the depth image

typedef struct view {
    hw_viewcell_metric metric; // points into the arrays below
    float (*normals)[3];
    float (*image)[2]; // pixels, of the depth image
    float *weights;
} view;

typedef struct raster {
    hw_vec3 eye, forward, right, up;
    double focal_px, x_min, y_min; // of the depth image's corner, pixels
    uint32_t width, height;
    float *depths; // along forward
    uint8_t *categories;
} raster;

static void destroy(void *context)
{
    view *v = context;
    if (!v)
        return;
    hw_free(v->normals);
    hw_free(v->image);
    hw_free(v->weights);
    hw_free(v);
}

// Looks from the eye at the middle of the mesh. HW_USAGE if part of the mesh is not before the eye.
static hw_status aim(const hw_metric_setup *setup, raster *r)
{
    hw_box bounds = hw_mesh_bounds(setup->mesh);
    r->eye = setup->eye;
    r->focal_px = setup->focal_px;
    r->forward = hw_v3_normalize(hw_v3_sub(hw_box_centre(bounds), setup->eye));
    hw_vec3 side = hw_v3_cross(r->forward, hw_v3(0, 0, 1));
    r->right = hw_v3_length(side) > 1e-6f ? hw_v3_normalize(side) : hw_v3(1, 0, 0);
    r->up = hw_v3_cross(r->right, r->forward);
    double box[4] = {INFINITY, INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = 0; i < 8; i++) {
        hw_vec3 to = hw_v3_sub(hw_box_corner(bounds, i), r->eye);
        double depth = (double)hw_v3_dot(to, r->forward);
        if (!(depth > 0))
            return hw_fail(HW_USAGE, "the eye stands within the mesh or too close to it");
        double x = (double)hw_v3_dot(to, r->right) / depth * r->focal_px;
        double y = (double)hw_v3_dot(to, r->up) / depth * r->focal_px;
        box[0] = fmin(box[0], x);
        box[1] = fmin(box[1], y);
        box[2] = fmax(box[2], x);
        box[3] = fmax(box[3], y);
    }
    r->x_min = floor(box[0]) - 1;
    r->y_min = floor(box[1]) - 1;
    double width = ceil(box[2]) + 1 - r->x_min, height = ceil(box[3]) + 1 - r->y_min;
    if (width > SIDE_MAX || height > SIDE_MAX)
        return hw_fail(HW_USAGE, "the mesh fills %.0f x %.0f pixels from there, %.0f are allowed",
                       width, height, SIDE_MAX);
    r->width = (uint32_t)width;
    r->height = (uint32_t)height;
    return HW_OK;
}

static hw_status cast(const hw_metric_setup *setup, raster *r)
{
    hw_status status;
    hw_rays *rays = NULL;
    HW_GO(hw_rays_create_mesh(&rays, setup->mesh));
    HW_GO(HW_NEW(&r->depths, (size_t)r->width * r->height));
    HW_GO(HW_NEW(&r->categories, (size_t)r->width * r->height));
    for (uint32_t j = 0; j < r->height; j++)
        for (uint32_t i = 0; i < r->width; i++) {
            float x = (float)((r->x_min + i + 0.5) / r->focal_px);
            float y = (float)((r->y_min + j + 0.5) / r->focal_px);
            hw_vec3 d = hw_v3_mad(hw_v3_mad(r->forward, r->right, x), r->up, y);
            r->depths[(size_t)j * r->width + i] =
                hw_rays_cast(rays, r->eye, d, 0, INFINITY).t; // d is 1 long along forward
        }
    HW_GO(hw_classify(r->depths, r->width, r->height, NULL, r->categories));
out:
    hw_rays_destroy(rays);
    return status;
}

// Marks the vertices of faces that look towards the eye.
static void mark_front(const hw_collapser *c, hw_vec3 eye, bool *front)
{
    const double e[3] = {(double)eye.x, (double)eye.y, (double)eye.z};
    for (uint32_t f = 0; f < c->face_count; f++) {
        const uint32_t *t = c->faces[f];
        if (t[0] == HW_NO_VERTEX)
            continue;
        const double *p = c->positions[t[0]], *q = c->positions[t[1]], *s = c->positions[t[2]];
        double volume = 0;
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, k = (i + 2) % 3;
            volume +=
                (e[i] - p[i]) * ((q[j] - p[j]) * (s[k] - p[k]) - (q[k] - p[k]) * (s[j] - p[j]));
        }
        for (int k = 0; k < 3 && volume > 0; k++)
            front[t[k]] = true;
    }
}

static void weigh(const hw_collapser *c, const raster *r, const bool *front, view *out)
{
    for (uint32_t v = 0; v < c->vertex_count; v++) {
        const double *p = c->positions[v];
        hw_vec3 to = hw_v3_sub(hw_v3((float)p[0], (float)p[1], (float)p[2]), r->eye);
        double depth = (double)hw_v3_dot(to, r->forward);
        double x = (double)hw_v3_dot(to, r->right) / depth * r->focal_px - r->x_min;
        double y = (double)hw_v3_dot(to, r->up) / depth * r->focal_px - r->y_min;
        uint32_t i = (uint32_t)fmin(fmax(x, 0), r->width - 1.0);
        uint32_t j = (uint32_t)fmin(fmax(y, 0), r->height - 1.0);
        size_t pixel = (size_t)j * r->width + i;
        out->image[v][0] = (float)x;
        out->image[v][1] = (float)y;
        out->weights[v] =
            hw_viewcell_weight(front[v], depth, r->depths[pixel], r->categories[pixel]);
    }
}

// Unit vertex normals of the mesh that the collapser was made of.
static hw_status fill_normals(const hw_metric_setup *setup, view *out)
{
    hw_status status;
    hw_mesh mesh = {0};
    HW_GO(hw_mesh_copy(setup->mesh, &mesh));
    HW_GO(hw_mesh_compute_normals(&mesh));
    for (uint32_t v = 0; v < setup->collapser->vertex_count; v++)
        memcpy(out->normals[v], &mesh.normals[setup->collapser->source[v]], sizeof *out->normals);
out:
    hw_mesh_free(&mesh);
    return status;
}

hw_status hw_metric_viewcell_from_eye(const hw_metric_setup *setup, hw_metric *out)
{
    hw_status status;
    const hw_collapser *c = setup->collapser;
    raster r = {0};
    bool *front = NULL;
    view *v = NULL;
    *out = (hw_metric){0};
    HW_GO(HW_NEW(&v, 1));
    HW_GO(HW_NEW(&front, c->vertex_count));
    HW_GO(HW_NEW(&v->normals, c->vertex_count));
    HW_GO(HW_NEW(&v->image, c->vertex_count));
    HW_GO(HW_NEW(&v->weights, c->vertex_count));
    HW_GO(aim(setup, &r));
    HW_GO(cast(setup, &r));
    HW_GO(fill_normals(setup, v));
    mark_front(c, setup->eye, front);
    weigh(c, &r, front, v);
    v->metric = (hw_viewcell_metric){(const float(*)[3])v->normals, (const float(*)[2])v->image,
                                     v->weights};
    *out = hw_metric_viewcell(&v->metric);
    out->context = v; // the metric comes first in it
    out->destroy = destroy;
    v = NULL;
out:
    hw_free(r.depths);
    hw_free(r.categories);
    hw_free(front);
    destroy(v);
    return status;
}
