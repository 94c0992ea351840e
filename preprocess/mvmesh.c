#include "mvmesh.h"
#include "alloc.h"
#include <math.h>
#include <meshoptimizer.h>
#include <stdlib.h>
#include <string.h>

// A capture serves a triangle if it shows it at this fraction, at least, of the area it has in the
// capture that shows it largest.
#define AREA_FRACTION 0.15
// ... and if at most this fraction of its texels show something in front of it.
#define HIDDEN_FRACTION 0.1
// What is in front by less parallax than this, beyond the tolerance of the simplification, is the
// triangle's own surface.
#define HIDDEN_PX 1.5
// Without blending, another capture than the own must show a triangle this much larger.
#define OWN_PREFERENCE 2.0
// Unseen triangles of more texels than this are split, with their neighbours, so many times.
#define SPLIT_TEXELS 16.0
#define SPLIT_ROUNDS 3
// How far from the mesh its original is looked for, in pixels at the effective distance.
#define COLOR_REACH_PX 16.0
// ... and how far from the vertex to the triangle's middle: at the very border rays may miss.
#define COLOR_INWARDS 0.1f

// A triangle that no view sees is looked for from the corners of the cell (below, above and at half
// height), the middles of its edges and of the lines from there to the centre, and the centre.
#define EYES (HW_CELL_CORNERS + 19)
// How far the samples on a triangle lie from its middle, as a fraction of the way to its outline.
#define SAMPLE_SPREAD 0.85f

// One capture at work.
typedef struct view {
    hw_vec3 eye;
    int face;
    hw_capture_window window;
    const hw_capture *capture;
    double (*points)[3]; // per vertex: texels of the window, inverse depth
} view;

typedef struct work {
    const hw_svmesh_job *job;
    hw_svmesh *mesh;
    hw_vec3 *world; // per vertex
    view views[HW_FAR_VIEWS_MAX];
    uint32_t view_count;
    uint32_t *sets; // per triangle: a bit for each view that sees it
    hw_vec3 eyes[EYES];
} work;

// ---- points of view --------------------------------------------------------------------------

static double angle_between(const double a[2], const double b[2])
{
    return atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]);
}

// The cell's corners at half height: the outermost to each side, as seen from the object, then
// those next to them.
static void order_corners(const hw_svmesh_job *job, hw_vec3 eyes[6])
{
    hw_vec3 target = hw_box_centre(job->scene->objects[job->object_idx].bounds);
    const hw_vec3 centre = job->view->centre;
    const double middle[2] = {(double)centre.x - target.x, (double)centre.y - target.y};
    double angles[6];
    for (int i = 0; i < 6; i++) {
        eyes[i] = job->view->corners[i];
        eyes[i].z = centre.z;
        const double to[2] = {(double)eyes[i].x - target.x, (double)eyes[i].y - target.y};
        angles[i] = angle_between(middle, to);
    }
    for (int i = 0; i < 6; i++) { // leftmost, rightmost, second to the left, ...
        int best = i;
        for (int k = i + 1; k < 6; k++)
            if (i % 2 == 0 ? angles[k] > angles[best] : angles[k] < angles[best])
                best = k;
        hw_vec3 eye = eyes[i];
        double angle = angles[i];
        eyes[i] = eyes[best];
        angles[i] = angles[best];
        eyes[best] = eye;
        angles[best] = angle;
    }
}

uint32_t hw_mvmesh_eyes(const hw_svmesh_job *job, hw_vec3 eyes[HW_FAR_VIEWS_MAX])
{
    eyes[0] = job->view->centre;
    order_corners(job, eyes + 1);
    return 7;
}

int hw_mvmesh_face(const hw_svmesh_job *job, hw_vec3 eye)
{
    hw_vec3 towards = hw_v3_sub(hw_box_centre(job->scene->objects[job->object_idx].bounds), eye);
    return hw_face_towards(towards.x, towards.y);
}

// Projects the vertices to the plane of the view; false if one lies behind it.
static bool project(const work *w, view *v, hw_plane_bounds *bounds)
{
    uint32_t count = w->mesh->record.vertex_count;
    if (!hw_plane_project_all(v->eye, v->face, w->world, count, v->points, bounds))
        return false;
    for (uint32_t i = 0; i < count; i++)
        v->points[i][2] = 1 / v->points[i][2];
    return true;
}

// Points on the plane become texels of the window.
static void to_texels(const work *w, view *v)
{
    for (uint32_t i = 0; i < w->mesh->record.vertex_count; i++) {
        const double plane[2] = {v->points[i][0], v->points[i][1]};
        hw_capture_window_texel(&v->window, plane, v->points[i]);
    }
}

static hw_status add_own_view(work *w)
{
    const hw_far_record *r = &w->mesh->record;
    view *v = &w->views[w->view_count++];
    hw_plane_bounds unused;
    HW_TRY(HW_NEW(&v->points, r->vertex_count));
    v->eye = w->job->view->centre;
    v->face = w->job->face;
    v->capture = &w->mesh->capture;
    float tx = (r->x_max - r->x_min) / (float)r->rect.width * HW_CAPTURE_PADDING;
    float ty = (r->y_max - r->y_min) / (float)r->rect.height * HW_CAPTURE_PADDING;
    v->window =
        (hw_capture_window){v->eye,        v->face,       r->x_min - tx,     r->x_max + tx,
                            r->y_min - ty, r->y_max + ty, v->capture->width, v->capture->height};
    if (!project(w, v, &unused))
        return hw_fail(HW_INTERNAL, "a far object reaches behind the centre of its cell");
    to_texels(w, v);
    return HW_OK;
}

static void set_window(const hw_capture_window *window, hw_far_view *out)
{
    float range[4];
    *out = (hw_far_view){.eye = window->centre, .face = (uint32_t)window->face};
    hw_capture_window_inner(window, range, &out->rect);
    out->x_min = range[0];
    out->x_max = range[1];
    out->y_min = range[2];
    out->y_max = range[3];
}

// Where the vertices are, in the world and in the views there are.
static hw_status place_vertices(work *w)
{
    const hw_far_record *r = &w->mesh->record;
    hw_mat4 matrix = hw_far_record_matrix(r, w->job->view->centre);
    hw_plane_bounds unused;
    HW_TRY(HW_RESIZE(&w->world, r->vertex_count));
    for (uint32_t i = 0; i < r->vertex_count; i++)
        w->world[i] = hw_far_vertex_world(&matrix, &w->mesh->vertices[i]);
    for (uint32_t k = 0; k < w->view_count; k++) {
        HW_TRY(HW_RESIZE(&w->views[k].points, r->vertex_count));
        if (!project(w, &w->views[k], &unused))
            return hw_fail(HW_INTERNAL, "a vertex lies behind its view");
        to_texels(w, &w->views[k]);
    }
    return HW_OK;
}

// Adds the capture from one more point, unless the object lies beside or too close to it.
static hw_status add_view(work *w, hw_vec3 eye)
{
    hw_far_record *r = &w->mesh->record;
    view *v = &w->views[w->view_count];
    hw_plane_bounds bounds;
    v->eye = eye;
    v->face = hw_mvmesh_face(w->job, eye);
    if (!v->points)
        HW_TRY(HW_NEW(&v->points, r->vertex_count));
    if (!project(w, v, &bounds) ||
        !hw_capture_window_fit(w->job, eye, v->face, &bounds, &v->window))
        return HW_OK;
    to_texels(w, v);
    hw_capture *capture = &w->mesh->view_captures[r->view_count];
    HW_TRY(hw_svmesh_capture(w->job, &v->window, w->job->options->capture_samples, capture));
    set_window(&v->window, &w->mesh->views[r->view_count]);
    v->capture = capture;
    r->view_count++;
    w->view_count++;
    return HW_OK;
}

static hw_status add_views(work *w)
{
    hw_vec3 eyes[HW_FAR_VIEWS_MAX];
    uint32_t wanted = w->job->options->multi_view_count, count = hw_mvmesh_eyes(w->job, eyes);
    HW_TRY(HW_NEW(&w->mesh->views, HW_FAR_VIEWS_MAX));
    HW_TRY(HW_NEW(&w->mesh->view_captures, HW_FAR_VIEWS_MAX));
    HW_TRY(add_own_view(w));
    for (uint32_t i = 1; i < count && w->view_count < wanted; i++)
        HW_TRY(add_view(w, eyes[i]));
    return HW_OK;
}

// ---- which view sees which triangle ----------------------------------------------------------

// Twice the signed area of a triangle in the view, texels.
static double area2(const view *v, const uint32_t *t)
{
    const double *a = v->points[t[0]], *b = v->points[t[1]], *c = v->points[t[2]];
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

// Texels of a triangle, and how many of them show something in front of it.
typedef struct coverage {
    uint32_t texels, hidden;
} coverage;

static void look_at(const view *v, double x, double y, double inverse_depth, double tolerance,
                    coverage *c)
{
    uint32_t i = (uint32_t)fmin(fmax(x, 0), v->capture->width - 1.0);
    uint32_t j = (uint32_t)fmin(fmax(y, 0), v->capture->height - 1.0);
    float depth = v->capture->depths[(size_t)j * v->capture->width + i];
    c->texels++;
    // Beyond the outline colours were spread from inside it.
    c->hidden += depth < INFINITY && fabs(1 / (double)depth - inverse_depth) > tolerance;
}

// The part [*x0, *x1] of the row at y that lies within the triangle.
static void row_of(const double *const p[3], double y, double *x0, double *x1)
{
    *x0 = INFINITY;
    *x1 = -INFINITY;
    for (int k = 0; k < 3; k++) {
        const double *a = p[k], *b = p[(k + 1) % 3];
        if ((a[1] <= y) == (b[1] <= y))
            continue;
        double x = a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
        *x0 = fmin(*x0, x);
        *x1 = fmax(*x1, x);
    }
}

static coverage cover(const view *v, const uint32_t *t, double area, double tolerance)
{
    coverage c = {0, 0};
    const double *const p[3] = {v->points[t[0]], v->points[t[1]], v->points[t[2]]};
    // Inverse depth is linear on the plane.
    double ux = p[1][0] - p[0][0], uy = p[1][1] - p[0][1], uz = p[1][2] - p[0][2];
    double wx = p[2][0] - p[0][0], wy = p[2][1] - p[0][1], wz = p[2][2] - p[0][2];
    double dx = (uz * wy - wz * uy) / area, dy = (wz * ux - uz * wx) / area;
    double low = fmin(p[0][1], fmin(p[1][1], p[2][1]));
    double high = fmax(p[0][1], fmax(p[1][1], p[2][1]));
    for (double y = ceil(low - 0.5) + 0.5; y <= high; y++) {
        double x0, x1;
        row_of(p, y, &x0, &x1);
        for (double x = ceil(x0 - 0.5) + 0.5; x <= x1; x++)
            look_at(v, x, y, p[0][2] + (x - p[0][0]) * dx + (y - p[0][1]) * dy, tolerance, &c);
    }
    if (c.texels == 0)
        look_at(v, (p[0][0] + p[1][0] + p[2][0]) / 3, (p[0][1] + p[1][1] + p[2][1]) / 3,
                (p[0][2] + p[1][2] + p[2][2]) / 3, tolerance, &c);
    return c;
}

// The view of the set that shows a triangle largest; the own one is preferred, as long as others do
// not show it much larger: they cost texels.
static uint32_t best_of(const work *w, uint32_t set, const double areas[HW_FAR_VIEWS_MAX])
{
    double largest = 0;
    uint32_t best = 0;
    for (uint32_t k = 0; k < w->view_count; k++) {
        double area = areas[k] * (k == 0 ? OWN_PREFERENCE : 1);
        if (!(set >> k & 1) || area <= largest)
            continue;
        largest = area;
        best = 1u << k;
    }
    return best;
}

// Inverse depth by which the mesh may differ from the original that it stands for.
static double surface_tolerance(const work *w)
{
    const hw_cell_view *cell = w->job->view;
    return (w->job->options->multi_interior_px + HIDDEN_PX) / (cell->focal_px * cell->size);
}

static void find_sets(work *w)
{
    double tolerance = surface_tolerance(w);
    for (uint32_t f = 0; f < w->mesh->record.index_count / 3; f++) {
        const uint32_t *t = w->mesh->indices + 3 * (size_t)f;
        double areas[HW_FAR_VIEWS_MAX], largest = 0;
        for (uint32_t k = 0; k < w->view_count; k++) {
            areas[k] = area2(&w->views[k], t);
            largest = fmax(largest, areas[k]);
        }
        w->sets[f] = 0;
        for (uint32_t k = 0; k < w->view_count; k++) {
            if (!(areas[k] > 0) || areas[k] < AREA_FRACTION * largest)
                continue;
            coverage c = cover(&w->views[k], t, areas[k], tolerance);
            if (c.hidden <= HIDDEN_FRACTION * c.texels)
                w->sets[f] |= 1u << k;
        }
        if (!w->job->options->multi_blend)
            w->sets[f] = best_of(w, w->sets[f], areas);
    }
}

// ---- what nobody sees ------------------------------------------------------------------------

static void find_eyes(work *w)
{
    const hw_cell_view *cell = w->job->view;
    uint32_t n = 0;
    for (int i = 0; i < HW_CELL_CORNERS; i++)
        w->eyes[n++] = cell->corners[i];
    w->eyes[n++] = cell->centre;
    for (int i = 0; i < 6; i++) {
        hw_vec3 corner = cell->corners[i], next = cell->corners[(i + 1) % 6];
        corner.z = next.z = cell->centre.z;
        hw_vec3 middle = hw_v3_scale(hw_v3_add(corner, next), 0.5f);
        w->eyes[n++] = corner;
        w->eyes[n++] = middle;
        w->eyes[n++] = hw_v3_scale(hw_v3_add(middle, cell->centre), 0.5f);
    }
}

#define BACKS_MAX 64 // that a ray passes

// Whether a ray from the eye to the point meets nothing in front of it but backs, which are not
// drawn.
static bool reaches(const work *w, hw_vec3 eye, hw_vec3 point, double tolerance)
{
    const hw_svmesh_job *job = w->job;
    hw_vec3 direction = hw_v3_sub(point, eye);
    float t_max = (float)(1 / (1 + tolerance * (double)hw_v3_length(direction)));
    hw_hit hit = {0};
    for (int i = 0; i < BACKS_MAX; i++) {
        hit = hw_rays_cast_object(hw_capturer_rays(job->capturer), job->object_idx, eye, direction,
                                  i == 0 ? 0 : hit.t * (1 + 1e-5f) + 1e-6f, t_max);
        if (hit.t == INFINITY)
            return true;
        if (hw_hit_is_front(job->scene, &hit, direction))
            return false;
    }
    return false;
}

static bool is_hidden(const work *w, const uint32_t *t, double tolerance)
{
    hw_vec3 a = w->world[t[0]], b = w->world[t[1]], c = w->world[t[2]];
    hw_vec3 normal = hw_v3_cross(hw_v3_sub(b, a), hw_v3_sub(c, a));
    hw_vec3 middle = hw_v3_scale(hw_v3_add(hw_v3_add(a, b), c), 1.0f / 3);
    const hw_vec3 rim[6] = {a,
                            b,
                            c,
                            hw_v3_scale(hw_v3_add(a, b), 0.5f),
                            hw_v3_scale(hw_v3_add(b, c), 0.5f),
                            hw_v3_scale(hw_v3_add(c, a), 0.5f)};
    for (uint32_t e = 0; e < EYES; e++) {
        if (hw_v3_dot(normal, hw_v3_sub(w->eyes[e], a)) <= 0)
            continue;
        if (reaches(w, w->eyes[e], middle, tolerance))
            return false;
        for (int k = 0; k < 6; k++)
            if (reaches(w, w->eyes[e], hw_v3_mad(middle, hw_v3_sub(rim[k], middle), SAMPLE_SPREAD),
                        tolerance))
                return false;
    }
    return true;
}

static hw_status drop_hidden(work *w)
{
    uint32_t mesh_idx = w->job->scene->objects[w->job->object_idx].mesh_idx;
    const hw_rays *rays = hw_capturer_rays(w->job->capturer);
    double tolerance = surface_tolerance(w);
    uint32_t n = 0, count = w->mesh->record.index_count / 3, *indices = w->mesh->indices;
    HW_TRY(hw_rays_pin(rays, mesh_idx));
    for (uint32_t f = 0; f < count; f++) {
        if (w->sets[f] == 0 && is_hidden(w, indices + 3 * (size_t)f, tolerance))
            continue;
        w->sets[n] = w->sets[f];
        memmove(indices + 3 * (size_t)n++, indices + 3 * (size_t)f, 3 * sizeof *indices);
    }
    hw_rays_unpin(rays, mesh_idx);
    w->mesh->record.index_count = 3 * n;
    return HW_OK;
}

// ---- splitting what is partly hidden ---------------------------------------------------------

// An edge (a < b) to be split, and the vertex in its middle.
typedef struct edge {
    uint32_t a, b, middle;
} edge;

typedef struct edge_list {
    edge *edges; // sorted
    uint32_t count;
} edge_list;

static int by_ends(const void *x, const void *y)
{
    const edge *p = x, *q = y;
    return p->a != q->a ? (p->a > q->a) - (p->a < q->a) : (p->b > q->b) - (p->b < q->b);
}

static edge make_edge(uint32_t a, uint32_t b)
{
    return a < b ? (edge){a, b, 0} : (edge){b, a, 0};
}

// The longest edge of a triangle, as the own view shows it.
static edge longest_edge(const work *w, const uint32_t *t)
{
    edge longest = {0, 0, 0};
    double most = -1;
    for (int k = 0; k < 3; k++) {
        const double *p = w->views[0].points[t[k]], *q = w->views[0].points[t[(k + 1) % 3]];
        double length = hypot(p[0] - q[0], p[1] - q[1]);
        if (length > most)
            longest = make_edge(t[k], t[(k + 1) % 3]);
        most = fmax(most, length);
    }
    return longest;
}

// The longest edges of the unseen triangles that are large in some view, each once.
static hw_status list_edges(const work *w, edge_list *list)
{
    uint32_t triangles = w->mesh->record.index_count / 3, n = 0;
    HW_TRY(HW_NEW(&list->edges, triangles));
    for (uint32_t f = 0; f < triangles; f++) {
        const uint32_t *t = w->mesh->indices + 3 * (size_t)f;
        double largest = 0;
        for (uint32_t k = 0; k < w->view_count; k++)
            largest = fmax(largest, area2(&w->views[k], t) / 2);
        if (w->sets[f] == 0 && largest > SPLIT_TEXELS)
            list->edges[n++] = longest_edge(w, t);
    }
    qsort(list->edges, n, sizeof *list->edges, by_ends);
    for (uint32_t i = 0; i < n; i++)
        if (i == 0 || by_ends(&list->edges[i], &list->edges[list->count - 1]) != 0)
            list->edges[list->count++] = list->edges[i];
    return HW_OK;
}

// Half way between two coordinates, in steps of the record's.
static uint16_t half_way(uint16_t a, uint16_t b, uint32_t step)
{
    return (uint16_t)(((uint32_t)a + b) / (2 * step) * step);
}

static uint32_t lowest_bit(uint32_t bits)
{
    return bits ? bits & -bits : 1;
}

static hw_status add_middles(work *w, edge_list *list)
{
    hw_far_record *r = &w->mesh->record;
    uint32_t x = 0, y = 0, z = 0, n = r->vertex_count + list->count;
    for (uint32_t i = 0; i < r->vertex_count; i++) {
        x |= w->mesh->vertices[i].x;
        y |= w->mesh->vertices[i].y;
        z |= w->mesh->vertices[i].z;
    }
    HW_TRY(HW_RESIZE(&w->mesh->vertices, n));
    for (uint32_t i = 0; i < list->count; i++) {
        const hw_far_vertex *a = &w->mesh->vertices[list->edges[i].a],
                            *b = &w->mesh->vertices[list->edges[i].b];
        list->edges[i].middle = r->vertex_count;
        w->mesh->vertices[r->vertex_count++] = (hw_far_vertex){
            half_way(a->x, b->x, lowest_bit(x)), half_way(a->y, b->y, lowest_bit(y)),
            half_way(a->z, b->z, lowest_bit(z)), 0};
    }
    return HW_OK;
}

// Replaces the triangle by its parts; *out grows by up to four.
static uint32_t *split_triangle(const edge_list *list, const uint32_t t[3], uint32_t *out)
{
    for (int k = 0; k < 3; k++) {
        uint32_t a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3];
        edge key = make_edge(a, b);
        const edge *found = bsearch(&key, list->edges, list->count, sizeof *list->edges, by_ends);
        if (!found)
            continue;
        const uint32_t parts[2][3] = {{a, found->middle, c}, {found->middle, b, c}};
        return split_triangle(list, parts[1], split_triangle(list, parts[0], out));
    }
    memcpy(out, t, 3 * sizeof *t);
    return out + 3;
}

static hw_status split_unseen(work *w)
{
    hw_status status;
    hw_far_record *r = &w->mesh->record;
    edge_list list = {0};
    uint32_t *indices = NULL, *end;
    HW_GO(list_edges(w, &list));
    if (list.count == 0)
        goto out;
    HW_GO(add_middles(w, &list));
    HW_GO(HW_NEW(&indices, 4 * (size_t)r->index_count));
    end = indices;
    for (uint32_t i = 0; i < r->index_count; i += 3)
        end = split_triangle(&list, w->mesh->indices + i, end);
    hw_free(w->mesh->indices);
    w->mesh->indices = indices;
    indices = NULL;
    r->index_count = (uint32_t)(end - w->mesh->indices);
    HW_GO(place_vertices(w));
out:
    hw_free(indices);
    hw_free(list.edges);
    return status;
}

// Finds the final triangles and their sets.
static hw_status settle_sets(work *w)
{
    find_eyes(w);
    for (uint32_t round = 0;; round++) {
        uint32_t before = w->mesh->record.vertex_count;
        HW_TRY(HW_RESIZE(&w->sets, w->mesh->record.index_count / 3));
        find_sets(w);
        HW_TRY(drop_hidden(w));
        if (round == SPLIT_ROUNDS)
            return HW_OK;
        HW_TRY(split_unseen(w));
        if (w->mesh->record.vertex_count == before)
            return HW_OK;
    }
}

// ---- what no view sees -----------------------------------------------------------------------

// The colour of the original near a vertex, looked for along the normal from outside.
static hw_color8 color_at(const work *w, hw_vec3 position, hw_vec3 normal)
{
    hw_color8 color = {128, 128, 128, 255};
    const hw_svmesh_job *job = w->job;
    double pixel = job->distance.effective / job->view->focal_px;
    for (double reach = 1; reach <= COLOR_REACH_PX; reach *= 4) {
        hw_vec3 step = hw_v3_scale(normal, (float)(reach * pixel));
        if (hw_capture_point(job->capturer, job->object_idx, hw_v3_add(position, step),
                             hw_v3_scale(step, -2), &color))
            break;
    }
    return color;
}

static hw_status add_colors(work *w)
{
    uint32_t mesh_idx = w->job->scene->objects[w->job->object_idx].mesh_idx;
    hw_status status = HW_OK;
    const hw_far_record *r = &w->mesh->record;
    const hw_rays *rays = hw_capturer_rays(w->job->capturer);
    hw_vec3 *normals = NULL, *inwards = NULL; // per vertex, of its unseen triangles
    bool pinned = false, all_seen = true;
    for (uint32_t f = 0; f < r->index_count / 3; f++)
        all_seen &= w->sets[f] != 0;
    if (all_seen)
        return HW_OK;
    HW_GO(HW_NEW(&normals, r->vertex_count));
    HW_GO(HW_NEW(&inwards, r->vertex_count));
    HW_GO(HW_NEW(&w->mesh->colors, r->vertex_count));
    for (uint32_t f = 0; f < r->index_count / 3; f++) {
        const uint32_t *t = w->mesh->indices + 3 * (size_t)f;
        hw_vec3 a = w->world[t[0]];
        hw_vec3 normal = hw_v3_cross(hw_v3_sub(w->world[t[1]], a), hw_v3_sub(w->world[t[2]], a));
        hw_vec3 middle =
            hw_v3_scale(hw_v3_add(hw_v3_add(a, w->world[t[1]]), w->world[t[2]]), 1.0f / 3);
        for (int k = 0; k < 3 && w->sets[f] == 0; k++) {
            normals[t[k]] = hw_v3_add(normals[t[k]], normal);
            inwards[t[k]] = hw_v3_sub(middle, w->world[t[k]]); // of the last: any will do
        }
    }
    HW_GO(hw_rays_pin(rays, mesh_idx));
    pinned = true;
    for (uint32_t i = 0; i < r->vertex_count; i++)
        if (hw_v3_length(normals[i]) > 0)
            w->mesh->colors[i] = color_at(w, hw_v3_mad(w->world[i], inwards[i], COLOR_INWARDS),
                                          hw_v3_normalize(normals[i]));
out:
    if (pinned)
        hw_rays_unpin(rays, mesh_idx);
    hw_free(normals);
    hw_free(inwards);
    return status;
}

// ---- ranges ----------------------------------------------------------------------------------

// Sorts the triangles by their sets, those of more views first.
static hw_status sort_triangles(work *w)
{
    hw_status status = HW_OK;
    hw_svmesh *mesh = w->mesh;
    hw_far_record *r = &mesh->record;
    uint32_t *sorted = NULL, n = 0, set_count = 1u << w->view_count;
    HW_GO(HW_NEW(&sorted, r->index_count));
    HW_GO(HW_NEW(&mesh->ranges, set_count));
    for (uint32_t set = set_count; set-- > 0;) {
        uint32_t first = n;
        for (uint32_t f = 0; f < r->index_count / 3; f++) {
            if (w->sets[f] != set)
                continue;
            memcpy(sorted + n, mesh->indices + 3 * (size_t)f, 3 * sizeof *sorted);
            n += 3;
        }
        if (n == first)
            continue;
        mesh->ranges[r->range_count++] = (hw_far_range){set, n - first};
        meshopt_optimizeVertexCacheStrip(sorted + first, sorted + first, n - first,
                                         r->vertex_count); // packs best
    }
    memcpy(mesh->indices, sorted, n * sizeof *sorted);
    r->index_count = n;
out:
    hw_free(sorted);
    return status;
}

// Vertices by first use, with their colours.
static hw_status sort_vertices(hw_svmesh *mesh)
{
    hw_status status = HW_OK;
    hw_far_record *r = &mesh->record;
    uint32_t *remap = NULL, n = r->vertex_count;
    HW_GO(HW_NEW(&remap, n));
    r->vertex_count =
        (uint32_t)meshopt_optimizeVertexFetchRemap(remap, mesh->indices, r->index_count, n);
    meshopt_remapIndexBuffer(mesh->indices, mesh->indices, r->index_count, remap);
    meshopt_remapVertexBuffer(mesh->vertices, mesh->vertices, n, sizeof *mesh->vertices, remap);
    if (mesh->colors)
        meshopt_remapVertexBuffer(mesh->colors, mesh->colors, n, sizeof *mesh->colors, remap);
out:
    hw_free(remap);
    return status;
}

// ---- texels that nothing shows ---------------------------------------------------------------

#define BLOCK 4u // sides of a block of BC1, which lie at multiples of it in the capture
// How far beyond a triangle texels are looked up: half by filtering, the rest for outlines that
// differ a little between the captures.
#define MARGIN 1.5

// Whether a counter-clockwise triangle meets the square block at (x, y), grown by the margin;
// conservative at the triangle's corners.
static bool meets_block(const double *const p[3], double x, double y)
{
    const double low[2] = {x - MARGIN, y - MARGIN};
    const double high[2] = {x + BLOCK + MARGIN, y + BLOCK + MARGIN};
    for (int k = 0; k < 3; k++) {
        const double *a = p[k], *b = p[(k + 1) % 3];
        double nx = a[1] - b[1], ny = b[0] - a[0]; // to the inside
        double far_x = nx > 0 ? high[0] : low[0], far_y = ny > 0 ? high[1] : low[1];
        if (nx * (far_x - a[0]) + ny * (far_y - a[1]) < 0)
            return false;
    }
    return true;
}

typedef struct block_map {
    uint32_t columns, rows;
    bool *needed;
} block_map;

static void need_triangle(const view *v, const uint32_t *t, block_map *map)
{
    const double *const p[3] = {v->points[t[0]], v->points[t[1]], v->points[t[2]]};
    double from[2], to[2];
    for (int k = 0; k < 2; k++) {
        from[k] = fmin(p[0][k], fmin(p[1][k], p[2][k])) - MARGIN;
        to[k] = fmax(p[0][k], fmax(p[1][k], p[2][k])) + MARGIN;
    }
    uint32_t column = (uint32_t)(fmax(from[0], 0) / BLOCK),
             row = (uint32_t)(fmax(from[1], 0) / BLOCK);
    for (uint32_t j = row; j < map->rows && j * BLOCK <= to[1]; j++)
        for (uint32_t i = column; i < map->columns && i * BLOCK <= to[0]; i++)
            map->needed[(size_t)j * map->columns + i] |= meets_block(p, i * BLOCK, j * BLOCK);
}

static hw_status find_needed(const work *w, uint32_t index, block_map *map)
{
    const view *v = &w->views[index];
    const uint32_t *t = w->mesh->indices;
    map->columns = (v->capture->width + BLOCK - 1) / BLOCK;
    map->rows = (v->capture->height + BLOCK - 1) / BLOCK;
    HW_TRY(HW_NEW(&map->needed, (size_t)map->columns * map->rows));
    for (uint32_t r = 0; r < w->mesh->record.range_count; r++) {
        const hw_far_range *range = &w->mesh->ranges[r];
        for (uint32_t i = 0; i < range->index_count; i += 3, t += 3)
            if (range->views >> index & 1)
                need_triangle(v, t, map);
    }
    return HW_OK;
}

static void blank(const block_map *map, hw_capture *capture)
{
    for (uint32_t y = 0; y < capture->height; y++)
        for (uint32_t x = 0; x < capture->width; x++)
            if (!map->needed[(size_t)(y / BLOCK) * map->columns + x / BLOCK])
                capture->colors[(size_t)y * capture->width + x] = (hw_color8){0, 0, 0, 0};
}

// The part of a capture that the needed blocks span, at least 2 x 2 of them. Empty if there are
// none.
static hw_rect needed_part(const block_map *map, const hw_capture *capture)
{
    uint32_t left = map->columns, right = 0, bottom = map->rows, top = 0;
    for (uint32_t j = 0; j < map->rows; j++)
        for (uint32_t i = 0; i < map->columns; i++) {
            if (!map->needed[(size_t)j * map->columns + i])
                continue;
            left = i < left ? i : left;
            right = i >= right ? i + 1 : right;
            bottom = j < bottom ? j : bottom;
            top = j + 1;
        }
    if (right == 0)
        return (hw_rect){0, 0, 0, 0};
    left = left > 0 && right - left < 2 ? left - 1 : left;
    bottom = bottom > 0 && top - bottom < 2 ? bottom - 1 : bottom;
    right = right - left < 2 ? left + 2 : right;
    top = top - bottom < 2 ? bottom + 2 : top;
    uint32_t x = left * BLOCK, y = bottom * BLOCK;
    uint32_t width = right * BLOCK < capture->width ? (right - left) * BLOCK : capture->width - x;
    uint32_t height = top * BLOCK < capture->height ? (top - bottom) * BLOCK : capture->height - y;
    return (hw_rect){x, y, width, height};
}

// Cuts a further view down to the part.
static void crop(const hw_rect *part, hw_capture_window *window, hw_capture *capture,
                 hw_far_view *out)
{
    float tx = (window->x_max - window->x_min) / (float)window->width;
    float ty = (window->y_max - window->y_min) / (float)window->height;
    for (uint32_t y = 0; y < part->height; y++)
        memmove(capture->colors + (size_t)y * part->width,
                capture->colors + (size_t)(part->y + y) * capture->width + part->x,
                part->width * sizeof *capture->colors);
    capture->width = window->width = part->width;
    capture->height = window->height = part->height;
    window->x_min += tx * (float)part->x;
    window->x_max = window->x_min + tx * (float)part->width;
    window->y_min += ty * (float)part->y;
    window->y_max = window->y_min + ty * (float)part->height;
    set_window(window, out);
}

// Takes view `index` (not the own) out of the mesh: no triangle shows it.
static void drop_view(work *w, uint32_t index)
{
    hw_svmesh *mesh = w->mesh;
    uint32_t from = index - 1, left = --mesh->record.view_count - from;
    hw_capture_free(&mesh->view_captures[from]);
    memmove(mesh->views + from, mesh->views + from + 1, left * sizeof *mesh->views);
    memmove(mesh->view_captures + from, mesh->view_captures + from + 1,
            left * sizeof *mesh->view_captures);
    mesh->view_captures[mesh->record.view_count] = (hw_capture){0};
    for (uint32_t r = 0; r < mesh->record.range_count; r++) {
        uint32_t low = mesh->ranges[r].views & ((1u << index) - 1);
        mesh->ranges[r].views = low | (mesh->ranges[r].views >> (index + 1) << index);
    }
}

// Leaves out what no triangle shows: blocks are blanked (those of one colour compress to next to
// nothing), captures cropped or dropped. The depths are of no use afterwards.
static hw_status trim_captures(work *w)
{
    hw_svmesh *mesh = w->mesh;
    for (uint32_t index = w->view_count; index-- > 0;) {
        hw_capture *capture = index > 0 ? &mesh->view_captures[index - 1] : &mesh->capture;
        block_map map = {0};
        HW_TRY(find_needed(w, index, &map));
        blank(&map, capture);
        hw_rect part = needed_part(&map, capture);
        hw_free(map.needed);
        if (index > 0 && part.width > 0)
            crop(&part, &w->views[index].window, capture, &mesh->views[index - 1]);
        else if (index > 0)
            drop_view(w, index);
    }
    return HW_OK;
}

hw_status hw_mvmesh_add_views(const hw_svmesh_job *job, hw_svmesh *mesh)
{
    hw_status status = HW_OK;
    work w = {.job = job, .mesh = mesh};
    HW_GO(place_vertices(&w));
    HW_GO(add_views(&w));
    HW_GO(settle_sets(&w));
    HW_GO(add_colors(&w));
    HW_GO(sort_triangles(&w));
    HW_GO(trim_captures(&w));
    HW_GO(sort_vertices(mesh));
out:
    for (uint32_t i = 0; i < HW_FAR_VIEWS_MAX; i++)
        hw_free(w.views[i].points);
    hw_free(w.world);
    hw_free(w.sets);
    return status;
}
