#include "relief.h"
#include "alloc.h"
#include "bit_raster.h"
#include "outer_hull.h"
#include "planar.h"
#include "sketch.h"
#include "terrain.h"
#include <math.h>
#include <string.h>

// The window goes round the level that tells where outlines are, and this much further: levels are
// chosen by the mean deviation of outlines, and tips deviate more.
#define MARGIN_PX 2.0
// How far the parallax may be off: at outlines, where it moves them, and under the texture.
#define OUTLINE_PARALLAX_PX  0.6
#define INTERIOR_PARALLAX_PX 4.0
#define VERTICES_MAX         40
#define FIT_ERROR_MAX        0.5 // mean, of the tolerances: beyond it, limbs lie before each other
#define COVERED              128 // least coverage of a texel that shows
#define RASTER_MAX           256u
// Of a group's objects outlines may be off by this much more: they are many and small in the
// picture, and a group's file is all the smaller.
#define GROUP_FACTOR 2.0
// The outline slips by more than the self-occluding error over this, as a rule: of statues that
// were tried beyond it, five in a hundred kept their outlines.
#define SLIP_DIVISOR 25.0
#define BACKS_MAX    1.02 // of the area of fronts; above 1, for borders that were simplified

static double outline_limit(const hw_svmesh_job *job)
{
    return job->options->relief_px * (job->view->id.level > 0 ? GROUP_FACTOR : 1);
}

bool hw_relief_is_likely(const hw_svmesh_job *job, double self_occlusion)
{
    return !job->multi_view && (self_occlusion < job->options->impostor_px ||
                                self_occlusion < SLIP_DIVISOR * outline_limit(job));
}

// The level that outlines are told from.
static const hw_mesh *outline_level(const hw_svmesh_job *job)
{
    double pixel = job->distance.effective / (job->view->focal_px * job->scale);
    uint32_t l = hw_chain_level_by_silhouette(job->chain, job->options->outline_px * pixel);
    return &job->chain->levels[l];
}

// Whether the picture shows backs of faces: of a closed surface as much turns away as towards the
// eye. Captures have both sides of open surfaces, but only fronts are drawn.
static bool shows_backs(const hw_mesh *level, const double (*planes)[3], bool mirrored)
{
    double front = 0, back = 0;
    for (uint32_t i = 0; i + 2 < level->index_count; i += 3) {
        const uint32_t *t = level->indices + i;
        double turn = hw_turn(planes[t[0]], planes[t[1]], planes[t[2]]) * (mirrored ? -1 : 1);
        front += fmax(turn, 0);
        back += fmax(-turn, 0);
    }
    return back > front * BACKS_MAX;
}

// ---- the mesh --------------------------------------------------------------------------------

// The capture without its padding.
typedef struct texels {
    const hw_capture *capture;
    uint32_t width, height;
    bool *touched, *covered;      // at all; as far as it shows
    float *parallax, *tolerances; // px; parallax is NAN where nothing shows
} texels;

static void texels_free(texels *t)
{
    hw_free(t->touched);
    hw_free(t->covered);
    hw_free(t->parallax);
    hw_free(t->tolerances);
}

static bool is_covered(const texels *t, int64_t x, int64_t y)
{
    return x >= 0 && y >= 0 && x < t->width && y < t->height &&
           t->covered[(size_t)y * t->width + (size_t)x];
}

static hw_status texels_make(const hw_svmesh_job *job, const hw_capture *capture, texels *out)
{
    texels *t = out;
    *t = (texels){.capture = capture,
                  .width = capture->width - 2 * HW_CAPTURE_PADDING,
                  .height = capture->height - 2 * HW_CAPTURE_PADDING};
    size_t count = (size_t)t->width * t->height;
    HW_TRY(HW_NEW(&t->touched, count));
    HW_TRY(HW_NEW(&t->covered, count));
    HW_TRY(HW_NEW(&t->parallax, count));
    HW_TRY(HW_NEW(&t->tolerances, count));
    for (uint32_t y = 0; y < t->height; y++)
        for (uint32_t x = 0; x < t->width; x++) {
            size_t i = (size_t)y * t->width + x;
            size_t from =
                (size_t)(y + HW_CAPTURE_PADDING) * capture->width + x + HW_CAPTURE_PADDING;
            t->touched[i] = capture->coverage[from] > 0; // filtered, the outline passes here
            t->covered[i] = capture->coverage[from] >= COVERED;
            t->parallax[i] =
                t->covered[i] && capture->depths[from] < INFINITY
                    ? (float)(job->view->focal_px * job->view->size / (double)capture->depths[from])
                    : NAN;
        }
    for (uint32_t y = 0; y < t->height; y++)
        for (uint32_t x = 0; x < t->width; x++) {
            bool within = is_covered(t, (int64_t)x - 1, y) && is_covered(t, (int64_t)x + 1, y) &&
                          is_covered(t, x, (int64_t)y - 1) && is_covered(t, x, (int64_t)y + 1);
            t->tolerances[(size_t)y * t->width + x] =
                (float)(within ? INTERIOR_PARALLAX_PX : OUTLINE_PARALLAX_PX);
        }
    return HW_OK;
}

// From texels to image space.
static hw_status take_terrain(const hw_svmesh_job *job, const texels *t,
                              const hw_capture_window *window, const hw_terrain *terrain,
                              hw_view_mesh *out)
{
    float range[4];
    hw_rect rect;
    double focal = job->view->focal_px;
    hw_capture_window_inner(window, range, &rect);
    double step[2] = {((double)range[1] - (double)range[0]) / t->width * focal,
                      ((double)range[3] - (double)range[2]) / t->height * focal};
    HW_TRY(HW_NEW(&out->positions, terrain->vertex_count));
    HW_TRY(HW_NEW(&out->indices, 3 * (size_t)terrain->triangle_count));
    for (uint32_t v = 0; v < terrain->vertex_count; v++) {
        for (int k = 0; k < 2; k++)
            out->positions[v][k] = (double)range[2 * k] * focal + terrain->vertices[v][k] * step[k];
        out->positions[v][2] = terrain->vertices[v][2];
    }
    memcpy(out->indices, terrain->triangles, terrain->triangle_count * sizeof *terrain->triangles);
    out->vertex_count = terrain->vertex_count;
    out->index_count = 3 * terrain->triangle_count;
    return hw_view_mesh_compact(out);
}

static hw_status fit_mesh(const hw_svmesh_job *job, bool flat, hw_relief *r)
{
    hw_status status;
    texels t = {0};
    double(*hull)[2] = NULL;
    uint32_t corner_count;
    hw_terrain terrain = {0};
    HW_GO(texels_make(job, &r->capture, &t));
    HW_GO(hw_outer_hull(t.touched, t.width, t.height, &hull, &corner_count));
    if (corner_count == 0)
        goto out;
    const hw_height_field field = {t.width, t.height, t.parallax, t.tolerances};
    HW_GO(hw_terrain_fit(&field, (const double(*)[2])hull, corner_count, VERTICES_MAX, &terrain));
    if (flat || terrain.mean_error < FIT_ERROR_MAX)
        HW_GO(take_terrain(job, &t, &r->window, &terrain, &r->mesh));
out:
    hw_terrain_free(&terrain);
    hw_free(hull);
    texels_free(&t);
    return status;
}

// ---- its outline from elsewhere --------------------------------------------------------------

// Both as an eye sees them, in pixels of the reference view (or larger ones, to fit a raster).
typedef struct comparison {
    const hw_relief *relief;
    const hw_mesh *level;        // the object
    const hw_vec3 *level_points; // world
    hw_vec3 *relief_points;      // world
    double (*texels)[2];         // of the relief's vertices, in the capture
    double (*planes)[3];         // of either's vertices, as the eye projects them
    hw_point2 *pixels;
    uint64_t *level_bits, *relief_bits;
    uint32_t size; // of the rasters
    hw_vec3 eye;
    int face;
    double origin[2], scale; // pixel = (plane point - origin) * scale
} comparison;

static void comparison_free(comparison *c)
{
    hw_free(c->relief_points);
    hw_free(c->texels);
    hw_free(c->planes);
    hw_free(c->pixels);
    hw_free(c->level_bits);
    hw_free(c->relief_bits);
}

static hw_status comparison_make(const hw_svmesh_job *job, const hw_relief *r, const hw_mesh *level,
                                 const hw_vec3 *level_points, comparison *out)
{
    const hw_view_mesh *mesh = &r->mesh;
    uint32_t most =
        level->vertex_count > mesh->vertex_count ? level->vertex_count : mesh->vertex_count;
    *out =
        (comparison){.relief = r, .level = level, .level_points = level_points, .face = job->face};
    HW_TRY(HW_NEW(&out->relief_points, mesh->vertex_count));
    HW_TRY(HW_NEW(&out->texels, mesh->vertex_count));
    HW_TRY(HW_NEW(&out->planes, most));
    HW_TRY(HW_NEW(&out->pixels, most));
    HW_TRY(HW_NEW(&out->level_bits, RASTER_MAX * RASTER_MAX / 64));
    HW_TRY(HW_NEW(&out->relief_bits, RASTER_MAX * RASTER_MAX / 64));
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        out->relief_points[v] = hw_svmesh_unproject(job, mesh->positions[v]);
        const double plane[2] = {mesh->positions[v][0] / job->view->focal_px,
                                 mesh->positions[v][1] / job->view->focal_px};
        hw_capture_window_texel(&r->window, plane, out->texels[v]);
    }
    return HW_OK;
}

// Projects the object; false if something of it lies behind the plane of the eye.
static bool look_from(comparison *c, hw_vec3 eye, double focal_px)
{
    hw_plane_bounds b;
    if (!hw_plane_project_all(eye, c->face, c->level_points, c->level->vertex_count, c->planes, &b))
        return false;
    double side = fmax(b.max[0] - b.min[0], b.max[1] - b.min[1]) * focal_px;
    c->size = 64;
    while (c->size < RASTER_MAX && c->size < side + 2 * MARGIN_PX)
        c->size *= 2;
    c->scale = focal_px * fmin(1, (c->size - 2 * MARGIN_PX) / side);
    for (int k = 0; k < 2; k++)
        c->origin[k] = b.min[k] - MARGIN_PX / c->scale;
    c->eye = eye;
    memset(c->level_bits, 0, (size_t)c->size * c->size / 8);
    memset(c->relief_bits, 0, (size_t)c->size * c->size / 8);
    return true;
}

static void find_pixels(comparison *c, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        c->pixels[i] = (hw_point2){(float)((c->planes[i][0] - c->origin[0]) * c->scale),
                                   (float)((c->planes[i][1] - c->origin[1]) * c->scale)};
}

// The coverage at a point of the capture, filtered as it is drawn.
static double coverage_at(const hw_capture *c, double x, double y)
{
    x = fmin(fmax(x - 0.5, 0), c->width - 1.001);
    y = fmin(fmax(y - 0.5, 0), c->height - 1.001);
    size_t i = (size_t)x, j = (size_t)y;
    double u = x - (double)i, v = y - (double)j;
    const uint8_t *at = c->coverage + j * c->width + i;
    return (1 - v) * ((1 - u) * at[0] + u * at[1]) +
           v * ((1 - u) * at[c->width] + u * at[c->width + 1]);
}

// Where on the capture a pixel shows a triangle; false if it lies outside of it, or sees its back.
static bool texel_at(const comparison *c, const uint32_t *t, double x, double y, double texel[2])
{
    double sum = 0;
    texel[0] = texel[1] = 0;
    for (int k = 0; k < 3; k++) {
        const hw_point2 a = c->pixels[t[(k + 1) % 3]], b = c->pixels[t[(k + 2) % 3]];
        double w = ((double)b.x - (double)a.x) * (y - (double)a.y) -
                   ((double)b.y - (double)a.y) * (x - (double)a.x);
        if (w < 0)
            return false;
        w /= c->planes[t[k]][2]; // straight in space, not in the picture
        sum += w;
        texel[0] += w * c->texels[t[k]][0];
        texel[1] += w * c->texels[t[k]][1];
    }
    texel[0] /= sum;
    texel[1] /= sum;
    return sum > 0;
}

// Sets the pixels in which a triangle of the relief shows.
static void fill_cut_out(comparison *c, const uint32_t *t)
{
    float low[2] = {(float)c->size, (float)c->size}, high[2] = {0, 0};
    for (int k = 0; k < 3; k++) {
        const float p[2] = {c->pixels[t[k]].x, c->pixels[t[k]].y};
        for (int a = 0; a < 2; a++) {
            low[a] = fminf(low[a], fmaxf(p[a], 0));
            high[a] = fmaxf(high[a], fminf(p[a], (float)c->size));
        }
    }
    for (uint32_t y = (uint32_t)low[1]; (float)y < high[1]; y++)
        for (uint32_t x = (uint32_t)low[0]; (float)x < high[0]; x++) {
            double texel[2];
            if (texel_at(c, t, x + 0.5, y + 0.5, texel) &&
                coverage_at(&c->relief->capture, texel[0], texel[1]) >= COVERED)
                c->relief_bits[((size_t)y * c->size + x) / 64] |= 1ull << (x & 63);
        }
}

// Mean distance of both outlines as the eye sees them, pixels: the area that only one of them
// covers over the length of the object's, which was projected. INFINITY if the relief lies behind
// the eye's plane.
static double outline_distance(comparison *c, double focal_px)
{
    const uint32_t *t = c->level->indices;
    const hw_view_mesh *mesh = &c->relief->mesh;
    hw_plane_bounds unused;
    find_pixels(c, c->level->vertex_count);
    for (uint32_t i = 0; i + 2 < c->level->index_count; i += 3)
        hw_raster_fill_triangle(c->level_bits, c->size, c->pixels[t[i]], c->pixels[t[i + 1]],
                                c->pixels[t[i + 2]]);
    if (!hw_plane_project_all(c->eye, c->face, c->relief_points, mesh->vertex_count, c->planes,
                              &unused))
        return INFINITY;
    find_pixels(c, mesh->vertex_count);
    for (uint32_t i = 0; i + 2 < mesh->index_count; i += 3)
        fill_cut_out(c, mesh->indices + i);
    double length = hw_raster_border_length(c->level_bits, c->size);
    uint64_t different = hw_raster_difference(c->level_bits, c->relief_bits, c->size);
    return (double)different / fmax(length, 1) * focal_px / c->scale;
}

// The mean over three corners of the cell, every other one, the second at the top of the cell; at
// least the limit if it is not below.
static hw_status outline_error(const hw_svmesh_job *job, const hw_relief *r, const hw_mesh *level,
                               const hw_vec3 *level_points, double *out)
{
    hw_status status;
    comparison c = {0};
    *out = 0;
    HW_GO(comparison_make(job, r, level, level_points, &c));
    static const int seen_from[3] = {0, 8, 4}; // the lower ones come first
    for (int i = 0; i < 3 && *out < outline_limit(job); i++)
        *out += look_from(&c, job->view->corners[seen_from[i]], job->view->focal_px)
                    ? outline_distance(&c, job->view->focal_px) / 3
                    : (double)INFINITY;
out:
    comparison_free(&c);
    return status;
}

// Whether a relief that is made of a sketch does, so that no ray is cast in vain.
static hw_status keeps_outline(const hw_svmesh_job *job, const hw_mesh *level,
                               const hw_vec3 *level_points, const hw_capture_window *window,
                               bool *out)
{
    hw_status status;
    hw_relief trial = {.window = *window};
    double error = INFINITY;
    HW_GO(hw_sketch(level, level_points, window, &trial.capture));
    HW_GO(fit_mesh(job, false, &trial));
    if (trial.mesh.index_count > 0)
        HW_GO(outline_error(job, &trial, level, level_points, &error));
    *out = error < outline_limit(job);
out:
    hw_relief_free(&trial);
    return status;
}

// ---- all of it -------------------------------------------------------------------------------

hw_status hw_relief_make(const hw_svmesh_job *job, bool flat, bool *good, hw_relief *out)
{
    hw_status status = HW_OK;
    const hw_mat4 *transform = &job->scene->objects[job->object_idx].transform;
    const hw_mesh *level = outline_level(job);
    hw_vec3 *points = NULL;
    double(*planes)[3] = NULL;
    hw_plane_bounds bounds;
    double margin = MARGIN_PX / job->view->focal_px;
    memset(out, 0, sizeof *out);
    *good = false;
    HW_GO(HW_NEW(&points, level->vertex_count));
    HW_GO(HW_NEW(&planes, level->vertex_count));
    for (uint32_t v = 0; v < level->vertex_count; v++)
        points[v] = hw_mat4_point(transform, level->positions[v]);
    if (!hw_plane_project_all(job->view->centre, job->face, points, level->vertex_count, planes,
                              &bounds) ||
        level->index_count == 0 ||
        shows_backs(level, (const double(*)[3])planes, hw_mat4_mirrors(transform)))
        goto out;
    for (int k = 0; k < 2; k++) {
        bounds.min[k] -= margin;
        bounds.max[k] += margin;
    }
    if (!hw_capture_window_fit(job, job->view->centre, job->face, &bounds, &out->window))
        goto out;
    if (!flat) {
        HW_GO(keeps_outline(job, level, points, &out->window, good));
        if (!*good)
            goto out;
    }
    HW_GO(hw_svmesh_capture(job, &out->window, HW_CUT_OUT_SAMPLES, &out->capture));
    HW_GO(fit_mesh(job, flat, out));
    *good = out->mesh.index_count > 0;
out:
    hw_free(points);
    hw_free(planes);
    if (status != HW_OK || !*good)
        hw_relief_free(out);
    return status;
}

void hw_relief_free(hw_relief *relief)
{
    if (!relief)
        return;
    hw_capture_free(&relief->capture);
    hw_view_mesh_free(&relief->mesh);
    memset(relief, 0, sizeof *relief);
}
