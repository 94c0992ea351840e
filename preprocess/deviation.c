#include "deviation.h"
#include "alloc.h"
#include "appearance.h"
#include "bit_raster.h"
#include "surface_sampler.h"
#include <stdlib.h>
#include <string.h>

#define DEFAULT_SAMPLES    10000
#define DEFAULT_VIEWS      8
#define DEFAULT_RESOLUTION 1024
#define MAX_RESOLUTION     8192
#define MARGIN             (1.0 / 16) // of the raster, on each side
#define LIGHTS             8

// --- surfaces ----------------------------------------------------------------------------------

typedef struct side {
    double sum, sum_squares, max;
    uint64_t count;
    double shading_squares; // of shaded points
    uint64_t shaded_count;
    float *distances; // of the sample points
} side;

static int by_value(const void *x, const void *y)
{
    float a = *(const float *)x, b = *(const float *)y;
    return a < b ? -1 : a > b;
}

// The distance that 99 in 100 samples stay within.
static float percentile_99(side *s)
{
    if (s->count == 0)
        return 0;
    qsort(s->distances, s->count, sizeof *s->distances, by_value);
    return s->distances[(s->count - 1) * 99 / 100];
}

static void add_sample(side *s, double d)
{
    s->sum += d;
    s->sum_squares += d * d;
    s->max = fmax(s->max, d);
    s->distances[s->count++] = (float)d;
}

// What a mesh shows at a point of its surface.
typedef struct shade {
    float values[LIGHTS][3]; // red, green, blue
    hw_vec3 normal;
} shade;

static void color_of(const hw_mesh *mesh, uint32_t vertex, float out[3])
{
    static const hw_color8 white = {255, 255, 255, 255};
    hw_color8 c = mesh->colors ? mesh->colors[vertex] : white;
    out[0] = (float)c.r / 255;
    out[1] = (float)c.g / 255;
    out[2] = (float)c.b / 255;
}

// The light comes from one side always; but objects stand turned.
static hw_vec3 turned(hw_vec3 n, int light)
{
    float angle = (float)light * (2 * (float)HW_PI / LIGHTS), c = cosf(angle), s = sinf(angle);
    return hw_v3(c * n.x - s * n.y, s * n.x + c * n.y, n.z);
}

static void shade_at(const hw_mesh *mesh, uint32_t triangle, const float w[3], shade *out)
{
    memset(out, 0, sizeof *out);
    for (int i = 0; i < 3; i++) {
        uint32_t v = mesh->indices[3 * (size_t)triangle + (size_t)i];
        float color[3];
        color_of(mesh, v, color);
        out->normal = hw_v3_mad(out->normal, mesh->normals[v], w[i]);
        for (int k = 0; k < LIGHTS; k++) {
            float light = w[i] * hw_light(turned(mesh->normals[v], k));
            for (int c = 0; c < 3; c++)
                out->values[k][c] += light * color[c];
        }
    }
}

// Barycentric coordinates of a point of a triangle that has an area.
static void locate(const hw_mesh *mesh, uint32_t triangle, hw_vec3 point, float w[3])
{
    const uint32_t *t = mesh->indices + 3 * (size_t)triangle;
    hw_vec3 to[3];
    float area[3], sum = 0;
    for (int i = 0; i < 3; i++)
        to[i] = hw_v3_sub(mesh->positions[t[i]], point);
    for (int i = 0; i < 3; i++)
        sum += area[i] = hw_v3_length(hw_v3_cross(to[(i + 1) % 3], to[(i + 2) % 3]));
    for (int i = 0; i < 3; i++)
        w[i] = sum > 0 ? area[i] / sum : 1.0f / 3;
}

static void add_shading(side *s, const hw_mesh *from, uint32_t triangle, hw_vec3 point,
                        const hw_mesh *to, const hw_closest *at)
{
    const float w_to[3] = {1 - at->u - at->v, at->u, at->v};
    float w_from[3];
    shade a, b;
    if (!from->normals || !to->normals || !(at->distance < INFINITY))
        return;
    locate(from, triangle, point, w_from);
    shade_at(from, triangle, w_from, &a);
    shade_at(to, at->triangle_idx, w_to, &b);
    if (!(hw_v3_dot(a.normal, b.normal) > 0))
        return;
    for (int k = 0; k < LIGHTS; k++)
        for (int c = 0; c < 3; c++) {
            double d = (double)(a.values[k][c] - b.values[k][c]);
            s->shading_squares += d * d / (3 * LIGHTS);
        }
    s->shaded_count++;
}

// Points of `from` against `to`, the mesh of `rays`.
static hw_status measure_side(const hw_mesh *from, const hw_mesh *to, const hw_rays *rays,
                              uint32_t samples, uint32_t seed, side *out)
{
    HW_TRY(HW_NEW(&out->distances, (size_t)samples + from->index_count));
    hw_surface_sampler sampler;
    HW_TRY(hw_surface_sampler_make(from, &sampler));
    double area = sampler.area;
    hw_surface_walk walk = hw_surface_walk_start(&sampler, samples, hw_rng_make(seed, 1));
    hw_vec3 point;
    while (hw_surface_walk_next(&walk, &point)) {
        hw_closest at = hw_rays_closest(rays, point, INFINITY);
        add_sample(out, (double)at.distance);
        add_shading(out, from, walk.triangle, point, to, &at);
    }
    hw_surface_sampler_free(&sampler);
    uint32_t step = from->index_count / samples + 1; // corners, so only vertices in use
    for (uint32_t i = 0; i < from->index_count; i += step) {
        hw_vec3 p = from->positions[from->indices[i]];
        double d = hw_rays_closest(rays, p, INFINITY).distance;
        if (area > 0)
            out->max = fmax(out->max, d);
        else
            add_sample(out, d);
    }
    return HW_OK;
}

hw_status hw_surface_deviation(const hw_rays *original_rays, const hw_mesh *original,
                               const hw_mesh *level, uint32_t samples, uint32_t seed,
                               hw_deviation *out)
{
    hw_status status = HW_OK;
    hw_rays *level_rays = NULL;
    *out = (hw_deviation){0};
    side sides[2];
    memset(sides, 0, sizeof sides);
    if (original->index_count == 0 || level->index_count == 0)
        return hw_fail(HW_USAGE, "%s: no triangle to measure",
                       original->name ? original->name : "a mesh");
    if (samples == 0)
        samples = DEFAULT_SAMPLES;
    HW_GO(hw_rays_create_mesh(&level_rays, level));
    HW_GO(measure_side(level, original, original_rays, samples, seed, &sides[0]));
    HW_GO(measure_side(original, level, level_rays, samples, seed + 1, &sides[1]));
    for (int i = 0; i < 2; i++) {
        double n = (double)sides[i].count;
        out->rms = fmaxf(out->rms, (float)sqrt(sides[i].sum_squares / n));
        out->mean = fmaxf(out->mean, (float)(sides[i].sum / n));
        out->max = fmaxf(out->max, (float)sides[i].max);
        out->p99 = fmaxf(out->p99, percentile_99(&sides[i]));
        double shaded = fmax((double)sides[i].shaded_count, 1);
        out->shading = fmaxf(out->shading, (float)sqrt(sides[i].shading_squares / shaded));
    }
out:
    hw_free(sides[0].distances);
    hw_free(sides[1].distances);
    hw_rays_destroy(level_rays);
    return status;
}

// --- outlines ----------------------------------------------------------------------------------

typedef struct outline_view {
    hw_vec3 centre;           // of the original's box; coordinates count from there
    float right_x, right_y;   // horizontal unit vector across the picture; its y axis is world z
    float offset_x, offset_y; // pixel = (coordinate - offset) * scale
    float scale;              // pixels per unit
    double length;            // of the original's outline, units
    uint64_t *bits;           // resolution rows of resolution / 64 words; bit x % 64 of word x / 64
} outline_view;

struct hw_outline {
    uint32_t view_count, resolution;
    outline_view *views;
    uint64_t *bits; // of all views
};

// `projected` holds a point per vertex, `bits` a cleared raster.
static void fill_mesh(const outline_view *view, uint32_t resolution, const hw_mesh *mesh,
                      hw_point2 *projected, uint64_t *bits)
{
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        hw_vec3 p = hw_v3_sub(mesh->positions[i], view->centre);
        projected[i].x = (p.x * view->right_x + p.y * view->right_y - view->offset_x) * view->scale;
        projected[i].y = (p.z - view->offset_y) * view->scale;
    }
    for (uint32_t i = 0; i + 2 < mesh->index_count; i += 3)
        hw_raster_fill_triangle(bits, resolution, projected[mesh->indices[i]],
                                projected[mesh->indices[i + 1]], projected[mesh->indices[i + 2]]);
}

// Places the raster of view `index` around the mesh; false if it has no extent there.
static bool fit_view(outline_view *view, uint32_t index, uint32_t resolution, const hw_mesh *mesh)
{
    float x_min = INFINITY, x_max = -INFINITY, z_min = INFINITY, z_max = -INFINITY;
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        hw_vec3 p = hw_v3_sub(mesh->positions[i], view->centre);
        float x = p.x * view->right_x + p.y * view->right_y;
        x_min = fminf(x_min, x);
        x_max = fmaxf(x_max, x);
        z_min = fminf(z_min, p.z);
        z_max = fmaxf(z_max, p.z);
    }
    float extent = fmaxf(x_max - x_min, z_max - z_min);
    float window = extent / (float)(1 - 2 * MARGIN);
    view->scale = (float)resolution / window;
    // Each view's raster is shifted by another part of a pixel (the R2 sequence): a level or
    // upright edge, which lies alike in every view, would else meet the same row of samples in all
    // of them.
    double shift_x = fmod(index * 0.7548776662, 1), shift_y = fmod(index * 0.5698402910, 1);
    view->offset_x = (x_min + x_max - window) / 2 + (float)shift_x / view->scale;
    view->offset_y = (z_min + z_max - window) / 2 + (float)shift_y / view->scale;
    return extent > 0 && isfinite(view->scale);
}

hw_status hw_outline_create(hw_outline **out, const hw_mesh *original, uint32_t views,
                            uint32_t resolution)
{
    hw_status status = HW_OK;
    hw_outline *outline = NULL;
    hw_point2 *projected = NULL;
    const char *name = original->name ? original->name : "a mesh";
    *out = NULL;
    if (original->index_count == 0 || resolution > MAX_RESOLUTION)
        return hw_fail(HW_USAGE, "%s: no triangle, or an outline resolution of %u", name,
                       resolution);
    HW_GO(HW_NEW(&outline, 1));
    outline->view_count = views ? views : DEFAULT_VIEWS;
    outline->resolution = resolution ? (resolution + 63) / 64 * 64 : DEFAULT_RESOLUTION;
    size_t raster = (size_t)outline->resolution * outline->resolution / 64;
    HW_GO(HW_NEW(&outline->views, outline->view_count));
    HW_GO(hw_alloc((void **)&outline->bits, outline->view_count, raster * sizeof(uint64_t)));
    HW_GO(HW_NEW(&projected, original->vertex_count));
    for (uint32_t i = 0; i < outline->view_count; i++) {
        outline_view *view = &outline->views[i];
        // The golden section as the offset keeps every view off the axes for any number of views.
        double azimuth = HW_PI * (i + 0.381966) / outline->view_count;
        view->centre = hw_box_centre(hw_mesh_bounds(original));
        view->right_x = (float)-sin(azimuth);
        view->right_y = (float)cos(azimuth);
        view->bits = outline->bits + i * raster;
        if (!fit_view(view, i, outline->resolution, original))
            HW_GO(hw_fail(HW_USAGE, "%s: no extent to outline", name));
        fill_mesh(view, outline->resolution, original, projected, view->bits);
        view->length = hw_raster_border_length(view->bits, outline->resolution) / view->scale;
    }
    *out = outline;
    outline = NULL;
out:
    hw_free(projected);
    hw_outline_destroy(outline);
    return status;
}

void hw_outline_destroy(hw_outline *outline)
{
    if (!outline)
        return;
    hw_free(outline->views);
    hw_free(outline->bits);
    hw_free(outline);
}

hw_status hw_outline_deviation(const hw_outline *outline, const hw_mesh *level, float *out)
{
    hw_status status = HW_OK;
    hw_point2 *projected = NULL;
    uint64_t *bits = NULL;
    *out = 0;
    size_t raster = (size_t)outline->resolution * outline->resolution / 64;
    double sum = 0;
    HW_GO(HW_NEW(&projected, level->vertex_count));
    HW_GO(HW_NEW(&bits, raster));
    for (uint32_t i = 0; i < outline->view_count; i++) {
        const outline_view *view = &outline->views[i];
        memset(bits, 0, raster * sizeof *bits);
        fill_mesh(view, outline->resolution, level, projected, bits);
        uint64_t different = hw_raster_difference(bits, view->bits, outline->resolution);
        double area = (double)different / ((double)view->scale * view->scale);
        sum += view->length > 0 ? area / view->length : 0;
    }
    *out = (float)(sum / outline->view_count);
out:
    hw_free(projected);
    hw_free(bits);
    return status;
}

float hw_outline_length(const hw_outline *outline)
{
    double sum = 0;
    for (uint32_t i = 0; i < outline->view_count; i++)
        sum += outline->views[i].length;
    return (float)(sum / outline->view_count);
}

float hw_outline_pixel(const hw_outline *outline)
{
    double sum = 0;
    for (uint32_t i = 0; i < outline->view_count; i++)
        sum += 1 / (double)outline->views[i].scale;
    return (float)(sum / outline->view_count);
}
