#include "svmesh.h"
#include "alloc.h"
#include "mvmesh.h"
#include "relief.h"
#include <math.h>
#include <meshoptimizer.h>
#include <string.h>

// Colours spread this far beyond an object's outline, so that filtering and simplified outlines
// never meet the background.
#define DILATION_TEXELS 2u
#define EXTENT_FACES    1000u
#define QUANTUM_PX      (1.0 / 32) // coarser steps show on silhouettes
// What a capture is cast against may be off by this much, as the nearest viewer in the cell sees
// it.
#define CAPTURE_ERROR_PX 0.045
#define THIN_SAMPLES     8u  // a side of a texel, of what fewer have missed
#define OCCLUSION_PX     8.0 // between points of a face that are looked for

static const hw_svmesh_policy *const policies[] = {&hw_policy_screen, &hw_policy_thesis, NULL};

const hw_svmesh_policy *hw_policy_find(const char *name)
{
    for (int i = 0; policies[i]; i++)
        if (strcmp(policies[i]->name, name) == 0)
            return policies[i];
    return NULL;
}

void hw_view_mesh_free(hw_view_mesh *mesh)
{
    if (!mesh)
        return;
    hw_free(mesh->positions);
    hw_free(mesh->indices);
    memset(mesh, 0, sizeof *mesh);
}

hw_status hw_view_mesh_compact(hw_view_mesh *mesh)
{
    uint32_t *remap = NULL;
    HW_TRY(HW_NEW(&remap, mesh->vertex_count));
    for (uint32_t i = 0; i < mesh->index_count; i++)
        remap[mesh->indices[i]] = 1;
    uint32_t n = 0;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        if (!remap[v])
            continue;
        memmove(mesh->positions[n], mesh->positions[v], sizeof mesh->positions[n]);
        remap[v] = n++;
    }
    for (uint32_t i = 0; i < mesh->index_count; i++)
        mesh->indices[i] = remap[mesh->indices[i]];
    mesh->vertex_count = n;
    hw_free(remap);
    return HW_OK;
}

void hw_svmesh_free(hw_svmesh *svmesh)
{
    if (!svmesh)
        return;
    hw_free(svmesh->vertices);
    hw_free(svmesh->indices);
    hw_capture_free(&svmesh->capture);
    for (uint32_t i = 0; svmesh->view_captures && i < svmesh->record.view_count; i++)
        hw_capture_free(&svmesh->view_captures[i]);
    hw_free(svmesh->views);
    hw_free(svmesh->view_captures);
    hw_free(svmesh->ranges);
    hw_free(svmesh->colors);
    memset(svmesh, 0, sizeof *svmesh);
}

hw_cell_view hw_cell_view_make(const hw_hexgrid *grid, hw_cell_id id)
{
    hw_cell_view view = {.grid = grid,
                         .id = id,
                         .centre = hw_cell_centre(grid, id),
                         .size = hw_cell_side(grid, id.level)};
    hw_cell_corners(grid, id, view.corners);
    view.focal_px = HW_REFERENCE_IMAGE_PX / 2 / tan(HW_REFERENCE_FOV_DEGREES / 2 * HW_PI / 180);
    return view;
}

bool hw_plane_project(hw_vec3 eye, int face, hw_vec3 world, double plane[3])
{
    hw_vec3 axis, right, up, rel = hw_v3_sub(world, eye);
    hw_face_basis(face, &axis, &right, &up);
    double depth = hw_v3_dot(rel, axis);
    if (depth < 1e-3)
        return false;
    plane[0] = hw_v3_dot(rel, right) / depth;
    plane[1] = hw_v3_dot(rel, up) / depth;
    plane[2] = depth;
    return true;
}

void hw_plane_bounds_add(hw_plane_bounds *bounds, const double plane[3])
{
    for (int k = 0; k < 2; k++) {
        bounds->min[k] = fmin(bounds->min[k], plane[k]);
        bounds->max[k] = fmax(bounds->max[k], plane[k]);
    }
    bounds->depth_min = fmin(bounds->depth_min, plane[2]);
}

bool hw_plane_project_all(hw_vec3 eye, int face, const hw_vec3 *points, uint32_t count,
                          double (*planes)[3], hw_plane_bounds *bounds)
{
    *bounds = (hw_plane_bounds){{INFINITY, INFINITY}, {-INFINITY, -INFINITY}, INFINITY};
    for (uint32_t i = 0; i < count; i++) {
        if (!hw_plane_project(eye, face, points[i], planes[i]))
            return false;
        hw_plane_bounds_add(bounds, planes[i]);
    }
    return true;
}

bool hw_svmesh_project(const hw_svmesh_job *job, hw_vec3 world, double image[3])
{
    double plane[3], focal = job->view->focal_px;
    if (!hw_plane_project(job->view->centre, job->face, world, plane))
        return false;
    image[0] = focal * plane[0];
    image[1] = focal * plane[1];
    image[2] = focal * job->view->size / plane[2];
    return true;
}

// From image space back to the world.
hw_vec3 hw_svmesh_unproject(const hw_svmesh_job *job, const double image[3])
{
    hw_vec3 axis, right, up;
    hw_face_basis(job->face, &axis, &right, &up);
    double focal = job->view->focal_px, depth = focal * job->view->size / image[2];
    hw_vec3 p = hw_v3_mad(job->view->centre, axis, (float)depth);
    return hw_v3_mad(hw_v3_mad(p, right, (float)(image[0] * depth / focal)), up,
                     (float)(image[1] * depth / focal));
}

uint32_t hw_svmesh_eyes(const hw_svmesh_job *job, bool centre_only, hw_vec3 eyes[HW_CELL_CORNERS])
{
    hw_mat4 inverse;
    hw_mat4_inverse(job->scene->objects[job->object_idx].transform, &inverse);
    uint32_t count = centre_only ? 1 : HW_CELL_CORNERS;
    for (uint32_t i = 0; i < count; i++)
        eyes[i] = hw_mat4_point(&inverse, centre_only ? job->view->centre : job->view->corners[i]);
    return count;
}

static void image_bounds(const hw_view_mesh *mesh, double min[3], double max[3])
{
    for (int i = 0; i < 3; i++) {
        min[i] = INFINITY;
        max[i] = -INFINITY;
    }
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        for (int i = 0; i < 3; i++) {
            min[i] = fmin(min[i], mesh->positions[v][i]);
            max[i] = fmax(max[i], mesh->positions[v][i]);
        }
}

// Texels of a capture per pixel of its own view, where that sees something at a depth:
// HW_TEXELS_PER_PX per pixel of the nearest viewer in the cell. Captures of MVMeshes make most of a
// cell's bytes, and few viewers come as near: one per pixel of a viewer half way between the
// nearest and the effective distance (as ratios) takes half the texels and costs less than 0.05 dB.
static double texels_per_pixel(const hw_svmesh_job *job, double depth)
{
    double nearest = fmax(job->distance.nearest, 1e-3);
    return job->multi_view ? depth / sqrt(nearest * job->distance.effective)
                           : HW_TEXELS_PER_PX * fmax(1, depth / nearest);
}

bool hw_capture_window_fit(const hw_svmesh_job *job, hw_vec3 eye, int face,
                           const hw_plane_bounds *bounds, hw_capture_window *out)
{
    double density = job->view->focal_px * texels_per_pixel(job, bounds->depth_min);
    double side_x = ceil((bounds->max[0] - bounds->min[0]) * density),
           side_y = ceil((bounds->max[1] - bounds->min[1]) * density);
    if (!(fmax(side_x, side_y) <= job->options->capture_side_max))
        return false;
    uint32_t inner_x = (uint32_t)fmax(side_x, 1), inner_y = (uint32_t)fmax(side_y, 1);
    // The rectangle of the vertices is [min, min + inner texels]; padding lies outside.
    double texel = 1 / density;
    double grow = HW_CAPTURE_PADDING * texel;
    *out = (hw_capture_window){
        .centre = eye,
        .face = face,
        .x_min = (float)(bounds->min[0] - grow),
        .x_max = (float)(bounds->min[0] + inner_x * texel + grow),
        .y_min = (float)(bounds->min[1] - grow),
        .y_max = (float)(bounds->min[1] + inner_y * texel + grow),
        .width = inner_x + 2 * HW_CAPTURE_PADDING,
        .height = inner_y + 2 * HW_CAPTURE_PADDING,
    };
    float range[4]; // a float may be too coarse for it
    hw_rect unused;
    hw_capture_window_inner(out, range, &unused);
    return range[0] < range[1] && range[2] < range[3];
}

bool hw_svmesh_window(const hw_svmesh_job *job, const hw_view_mesh *mesh, hw_capture_window *out)
{
    double min[3], max[3], focal = job->view->focal_px;
    image_bounds(mesh, min, max);
    hw_plane_bounds bounds = {{min[0] / focal, min[1] / focal},
                              {max[0] / focal, max[1] / focal},
                              focal * job->view->size / max[2]};
    return hw_capture_window_fit(job, job->view->centre, job->face, &bounds, out);
}

void hw_capture_window_inner(const hw_capture_window *w, float range[4], hw_rect *rect)
{
    float tx = (w->x_max - w->x_min) / (float)w->width * HW_CAPTURE_PADDING;
    float ty = (w->y_max - w->y_min) / (float)w->height * HW_CAPTURE_PADDING;
    range[0] = w->x_min + tx;
    range[1] = w->x_max - tx;
    range[2] = w->y_min + ty;
    range[3] = w->y_max - ty;
    *rect = (hw_rect){0, 0, w->width - 2 * HW_CAPTURE_PADDING, w->height - 2 * HW_CAPTURE_PADDING};
}

static void record_window(const hw_capture_window *window, hw_far_record *record)
{
    float range[4];
    hw_capture_window_inner(window, range, &record->rect);
    record->x_min = range[0];
    record->x_max = range[1];
    record->y_min = range[2];
    record->y_max = range[3];
}

hw_status hw_svmesh_capture(const hw_svmesh_job *job, const hw_capture_window *window,
                            uint32_t samples, hw_capture *out)
{
    double error = CAPTURE_ERROR_PX * job->distance.nearest / job->view->focal_px;
    if (job->members)
        HW_TRY(hw_capture_objects(job->capturer, job->members, job->member_count, window, samples,
                                  error, out));
    else
        HW_TRY(hw_capture_object(job->capturer, job->object_idx, window, samples, error, out));
    hw_capture_dilate(out, DILATION_TEXELS);
    return HW_OK;
}

// A 16-bit axis whose steps are a power of two as coarse as QUANTUM_PX allows: the low bits are
// zero and cost nothing in the file.
typedef struct axis {
    double min, max;
    uint32_t step;
} axis;

static axis axis_make(double min, double max, double range_px)
{
    axis a = {min, max, 1};
    while (a.step < 256 && range_px * 2 * a.step <= QUANTUM_PX * 65535)
        a.step *= 2;
    return a;
}

static uint16_t quantise(const axis *a, double value)
{
    double q = floor((value - a->min) / (a->max - a->min) * 65535 / a->step + 0.5) * a->step;
    return (uint16_t)fmin(fmax(q, 0), 65535 / a->step * a->step);
}

static hw_status quantise_mesh(const hw_svmesh_job *job, const hw_view_mesh *mesh, hw_svmesh *out)
{
    hw_status status;
    hw_far_record *record = &out->record;
    uint32_t *remap = NULL;
    double min[3], max[3], focal = job->view->focal_px, parallax = focal * job->view->size;
    image_bounds(mesh, min, max);
    record->iz_min = (float)(min[2] / parallax);
    record->iz_max = (float)fmax(max[2] / parallax, record->iz_min * (1 + 1e-5));
    HW_GO(HW_NEW(&out->vertices, mesh->vertex_count));
    HW_GO(HW_NEW(&out->indices, mesh->index_count));
    HW_GO(HW_NEW(&remap, mesh->vertex_count));
    axis x = axis_make(record->x_min, record->x_max, record->rect.width);
    axis y = axis_make(record->y_min, record->y_max, record->rect.height);
    axis z = axis_make(record->iz_min, record->iz_max, max[2] - min[2]);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        const double *p = mesh->positions[v];
        out->vertices[v] = (hw_far_vertex){quantise(&x, p[0] / focal), quantise(&y, p[1] / focal),
                                           quantise(&z, p[2] / parallax), 0};
    }
    // Vertices that fell together become one; faces that lost their area go.
    meshopt_generateVertexRemap(remap, mesh->indices, mesh->index_count, out->vertices,
                                mesh->vertex_count, sizeof *out->vertices);
    uint32_t n = 0;
    for (uint32_t i = 0; i < mesh->index_count; i += 3) {
        const uint32_t *t = mesh->indices + i;
        uint32_t a = remap[t[0]], b = remap[t[1]], c = remap[t[2]];
        if (a == b || b == c || c == a)
            continue;
        out->indices[n++] = a;
        out->indices[n++] = b;
        out->indices[n++] = c;
    }
    meshopt_remapVertexBuffer(out->vertices, out->vertices, mesh->vertex_count,
                              sizeof *out->vertices, remap);
    meshopt_optimizeVertexCacheStrip(out->indices, out->indices, n,
                                     mesh->vertex_count); // packs best
    record->vertex_count = (uint32_t)meshopt_optimizeVertexFetch(
        out->vertices, out->indices, n, out->vertices, mesh->vertex_count, sizeof *out->vertices);
    record->index_count = n;
out:
    hw_free(remap);
    return status;
}

hw_vec3 hw_far_vertex_world(const hw_mat4 *matrix, const hw_far_vertex *vertex)
{
    double h[4];
    for (int r = 0; r < 4; r++)
        h[r] = matrix->m[r] * vertex->x + matrix->m[4 + r] * vertex->y +
               matrix->m[8 + r] * vertex->z + matrix->m[12 + r];
    return hw_v3((float)(h[0] / h[3]), (float)(h[1] / h[3]), (float)(h[2] / h[3]));
}

double hw_svmesh_interior_px(const hw_svmesh_job *job)
{
    return job->multi_view ? job->options->multi_interior_px : job->options->interior_px;
}

static hw_box record_bounds(const hw_svmesh *svmesh, hw_vec3 centre)
{
    hw_mat4 matrix = hw_far_record_matrix(&svmesh->record, centre);
    hw_box box = hw_box_empty();
    for (uint32_t v = 0; v < svmesh->record.vertex_count; v++)
        hw_box_add(&box, hw_far_vertex_world(&matrix, &svmesh->vertices[v]));
    return box;
}

// The coarsest level that still has every limb: enough to tell how deep an object is.
static const hw_mesh *extent_level(const hw_chain *chain)
{
    uint32_t l = chain->level_count - 1;
    while (l > 0 && chain->infos[l].index_count < 3 * EXTENT_FACES)
        l--;
    return &chain->levels[l];
}

double hw_svmesh_self_occlusion_bound(const hw_cell_view *view, double side, hw_box box)
{
    double most = 0;
    for (uint32_t i = 0; i < 8; i++) {
        hw_vec3 rel = hw_v3_sub(hw_box_corner(box, i), view->centre);
        most = fmax(most, hypot((double)rel.x, (double)rel.y));
    }
    double x = fmax(fmax((double)box.min.x - (double)view->centre.x,
                         (double)view->centre.x - (double)box.max.x),
                    0);
    double y = fmax(fmax((double)box.min.y - (double)view->centre.y,
                         (double)view->centre.y - (double)box.max.y),
                    0);
    double least = hypot(x, y);
    return hw_self_occluding_error(side, least, most - least, HW_REFERENCE_IMAGE_PX);
}

double hw_svmesh_self_occlusion(const hw_svmesh_job *job, double enough)
{
    const hw_object *object = &job->scene->objects[job->object_idx];
    double bound = hw_svmesh_self_occlusion_bound(job->view, job->view->size, object->bounds);
    if (bound < enough)
        return bound;
    const hw_mesh *level = extent_level(job->chain);
    hw_vec3 eyes[HW_CELL_CORNERS];
    uint32_t eye_count = hw_svmesh_eyes(job, false, eyes);
    double least = INFINITY, most = 0;
    for (uint32_t i = 0; i < level->index_count; i += 3) {
        const uint32_t *t = level->indices + i;
        hw_vec3 p[3] = {level->positions[t[0]], level->positions[t[1]], level->positions[t[2]]};
        if (hw_triangle_facing(p[0], p[1], p[2], eyes, eye_count) == HW_FACING_BACK)
            continue;
        for (int k = 0; k < 3; k++) {
            hw_vec3 rel = hw_v3_sub(hw_mat4_point(&object->transform, p[k]), job->view->centre);
            double d = sqrt((double)rel.x * rel.x + (double)rel.y * rel.y);
            least = fmin(least, d);
            most = fmax(most, d);
        }
    }
    if (!(least < INFINITY))
        return 0; // nothing faces the cell
    // Simplified levels may reach beyond the object, and groups promise by the bound.
    return fmin(
        hw_self_occluding_error(job->view->size, least, most - least, HW_REFERENCE_IMAGE_PX),
        bound);
}

// Whether the whole object lies in front of the plane through the cell centre that its window is
// parallel to.
static bool in_front(const hw_svmesh_job *job)
{
    const hw_object *object = &job->scene->objects[job->object_idx];
    double image[3];
    for (uint32_t i = 0; i < 8; i++)
        if (!hw_svmesh_project(job, hw_box_corner(object->bounds, i), image))
            return false;
    return true;
}

// Drops the faces that no point of the cell sees past other objects.
static hw_status drop_hidden(const hw_svmesh_job *job, hw_view_mesh *mesh)
{
    hw_status status = HW_OK;
    hw_vec3 *positions = NULL;
    bool *seen = NULL;
    uint32_t n = 0;
    HW_GO(HW_NEW(&positions, mesh->vertex_count));
    HW_GO(HW_NEW(&seen, mesh->index_count / 3));
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        positions[v] = hw_svmesh_unproject(job, mesh->positions[v]);
    const hw_sight_surface surface = {.box = job->scene->objects[job->object_idx].bounds,
                                      .vertex_count = mesh->vertex_count,
                                      .index_count = mesh->index_count,
                                      .positions = positions,
                                      .indices = mesh->indices,
                                      .spacing = OCCLUSION_PX * job->distance.effective /
                                                 job->view->focal_px};
    HW_GO(hw_occlusion_faces(job->occlusion, job->view->id, &surface, seen));
    for (uint32_t i = 0; i < mesh->index_count; i++)
        if (seen[i / 3])
            mesh->indices[n++] = mesh->indices[i];
    if (n == mesh->index_count)
        goto out;
    mesh->index_count = n;
    HW_GO(hw_view_mesh_compact(mesh));
out:
    hw_free(positions);
    hw_free(seen);
    return status;
}

// Record and quantised vertices of a mesh that lies in the window; all but the capture.
static hw_status assemble(const hw_svmesh_job *job, const hw_view_mesh *mesh,
                          const hw_capture_window *window, bool cut_out, hw_svmesh *out)
{
    out->record.object_idx = job->object_idx;
    out->record.face = (uint32_t)job->face;
    out->record.cut_out = cut_out;
    record_window(window, &out->record);
    HW_TRY(quantise_mesh(job, mesh, out));
    if (out->record.index_count > 0)
        out->record.bounds = record_bounds(out, job->view->centre);
    return HW_OK;
}

static bool is_blank(const hw_capture *capture)
{
    size_t texels = (size_t)capture->width * capture->height;
    for (size_t i = 0; i < texels; i++)
        if (capture->colors[i].a != 0)
            return false;
    return true;
}

// Samples of something thinner than a texel may all miss it: then with more of them.
static hw_status capture_thin(const hw_svmesh_job *job, const hw_capture_window *window,
                              hw_capture *out)
{
    HW_TRY(hw_svmesh_capture(job, window, job->options->capture_samples, out));
    if (!is_blank(out))
        return HW_OK;
    hw_capture_free(out);
    return hw_svmesh_capture(job, window, THIN_SAMPLES, out);
}

hw_status hw_svmesh_finish(const hw_svmesh_job *job, const hw_view_mesh *mesh, bool *fits,
                           hw_svmesh *out)
{
    hw_status status = HW_OK;
    hw_capture_window window;
    memset(out, 0, sizeof *out);
    *fits = hw_svmesh_window(job, mesh, &window);
    if (!*fits)
        return HW_OK;
    HW_GO(assemble(job, mesh, &window, false, out));
    if (out->record.index_count > 0)
        HW_GO(capture_thin(job, &window, &out->capture));
    if (out->capture.width > 0 && is_blank(&out->capture))
        out->record.index_count = 0; // too thin to be seen
out:
    if (status != HW_OK || out->record.index_count == 0)
        hw_svmesh_free(out);
    return status;
}

// A relief; *good tells whether one may stand for the object.
static hw_status derive_relief(const hw_svmesh_job *job, bool flat, bool *good, hw_svmesh *out)
{
    hw_status status;
    hw_relief relief = {0};
    HW_GO(hw_relief_make(job, flat, good, &relief)); // too few faces to look for hidden ones
    if (!*good)
        goto out;
    HW_GO(assemble(job, &relief.mesh, &relief.window, true, out));
    if (out->record.index_count == 0)
        goto out;
    out->capture = relief.capture;
    relief.capture = (hw_capture){0};
out:
    hw_relief_free(&relief);
    if (status != HW_OK || out->record.index_count == 0)
        hw_svmesh_free(out);
    return status;
}

// Whether the object is an SVMesh, an MVMesh (job->multi_view) or near.
static bool must_be_near(hw_svmesh_job *job, double *error)
{
    const hw_far_options *options = job->options;
    job->multi_view = false;
    *error = INFINITY;
    if (job->distance.nearest <= 0 || !in_front(job))
        return true;
    *error = hw_svmesh_self_occlusion(job, fmin(options->impostor_px, options->self_occlusion_px));
    if (*error < options->self_occlusion_px)
        return false;
    const hw_object *object = &job->scene->objects[job->object_idx];
    bool textured = job->scene->meshes[object->mesh_idx].uvs;
    double limit = textured ? options->multi_textured_px : options->multi_view_px;
    job->multi_view = job->view->id.level == 0 && *error < limit;
    return !job->multi_view;
}

hw_status hw_svmesh_derive(hw_svmesh_job *job, bool *is_near, hw_svmesh *out)
{
    hw_status status = HW_OK;
    hw_view_mesh mesh = {0};
    bool fits = true;
    memset(out, 0, sizeof *out);
    double error;
    *is_near = must_be_near(job, &error);
    if (*is_near)
        return HW_OK;
    bool good = false;
    if (hw_relief_is_likely(job, error))
        HW_GO(derive_relief(job, error < job->options->impostor_px, &good, out));
    if (good)
        return HW_OK;
    HW_GO(job->options->policy->simplify(job, &mesh));
    if (job->occlusion && mesh.index_count > 0)
        HW_GO(drop_hidden(job, &mesh));
    if (mesh.index_count > 0)
        HW_GO(hw_svmesh_finish(job, &mesh, &fits, out));
    *is_near = !fits;
    if (fits && job->multi_view && out->record.index_count > 0)
        HW_GO(hw_mvmesh_add_views(job, out));
out:
    hw_view_mesh_free(&mesh);
    if (status != HW_OK || out->record.index_count == 0)
        hw_svmesh_free(out);
    return status;
}
