#include "sketch.h"
#include "alloc.h"
#include "bit_raster.h"
#include "planar.h"
#include <math.h>

#define FINE 4u // points of a texel, along each axis

// A vertex in the window: texels, and what runs straight over a triangle in the picture.
typedef struct point {
    double at[2], inverse_depth;
} point;

static hw_status project(const hw_vec3 *points, uint32_t count, const hw_capture_window *w,
                         point **out)
{
    HW_TRY(HW_NEW(out, count));
    for (uint32_t v = 0; v < count; v++) {
        double plane[3] = {0, 0, 1};
        (void)hw_plane_project(w->centre, w->face, points[v], plane); // in front, as promised
        hw_capture_window_texel(w, plane, (*out)[v].at);
        (*out)[v].inverse_depth = 1 / plane[2];
    }
    return HW_OK;
}

// From where to where a row of texel centres may lie in the triangle.
static void row_span(const point *const p[3], double y, double *begin, double *end)
{
    *begin = INFINITY;
    *end = -INFINITY;
    for (int k = 0; k < 3; k++) {
        const double *a = p[k]->at, *b = p[(k + 1) % 3]->at;
        if ((a[1] < y && b[1] < y) || (a[1] > y && b[1] > y))
            continue;
        double t = a[1] == b[1] ? 0 : (y - a[1]) / (b[1] - a[1]), x = a[0] + t * (b[0] - a[0]);
        *begin = fmin(*begin, a[1] == b[1] ? fmin(a[0], b[0]) : x);
        *end = fmax(*end, a[1] == b[1] ? fmax(a[0], b[0]) : x);
    }
}

// Keeps the depths of a triangle where they are the least so far.
static void fill_depths(const point *const p[3], hw_capture *out)
{
    double area = hw_turn(p[0]->at, p[1]->at, p[2]->at);
    if (area == 0)
        return;
    double low = fmin(p[0]->at[1], fmin(p[1]->at[1], p[2]->at[1]));
    double high = fmax(p[0]->at[1], fmax(p[1]->at[1], p[2]->at[1]));
    uint32_t y_end = hw_clamp_index(floor(high + 0.5), out->height);
    for (uint32_t j = hw_clamp_index(ceil(low - 0.5), out->height); j < y_end; j++) {
        double begin, end;
        row_span(p, j + 0.5, &begin, &end);
        uint32_t x_end = hw_clamp_index(floor(end + 0.5) + 1, out->width);
        for (uint32_t i = hw_clamp_index(ceil(begin - 0.5) - 1, out->width); i < x_end; i++) {
            const double centre[2] = {i + 0.5, j + 0.5};
            double u = hw_turn(centre, p[1]->at, p[2]->at) / area;
            double v = hw_turn(p[0]->at, centre, p[2]->at) / area;
            if (u < 0 || v < 0 || u + v > 1)
                continue;
            float *depth = &out->depths[(size_t)j * out->width + i];
            double inverse = u * p[0]->inverse_depth + v * p[1]->inverse_depth +
                             (1 - u - v) * p[2]->inverse_depth;
            if (1 / inverse < (double)*depth)
                *depth = (float)(1 / inverse);
        }
    }
}

// The share of the fine pixels of each texel.
static void count_coverage(const uint64_t *bits, uint32_t size, hw_capture *out)
{
    for (uint32_t j = 0; j < out->height; j++)
        for (uint32_t i = 0; i < out->width; i++) {
            uint32_t count = 0;
            for (uint32_t k = 0; k < FINE; k++) {
                size_t at = (size_t)(FINE * j + k) * size + FINE * i; // four within one word
                count += (uint32_t)__builtin_popcountll(bits[at / 64] >> (at % 64) & 15);
            }
            out->coverage[(size_t)j * out->width + i] =
                (uint8_t)((count * 255 + FINE * FINE / 2) / (FINE * FINE));
        }
}

hw_status hw_sketch(const hw_mesh *mesh, const hw_vec3 *points, const hw_capture_window *window,
                    hw_capture *out)
{
    hw_status status;
    point *projected = NULL;
    uint64_t *bits = NULL;
    uint32_t side = window->width > window->height ? window->width : window->height;
    uint32_t size = (FINE * side + 63) / 64 * 64;
    size_t count = (size_t)window->width * window->height;
    *out = (hw_capture){.width = window->width, .height = window->height};
    HW_GO(HW_NEW(&out->coverage, count));
    HW_GO(HW_NEW(&out->depths, count));
    HW_GO(HW_NEW(&bits, (size_t)size * size / 64));
    HW_GO(project(points, mesh->vertex_count, window, &projected));
    for (size_t i = 0; i < count; i++)
        out->depths[i] = INFINITY;
    for (uint32_t i = 0; i + 2 < mesh->index_count; i += 3) {
        const point *p[3];
        hw_point2 fine[3];
        for (uint32_t k = 0; k < 3; k++) {
            p[k] = &projected[mesh->indices[i + k]];
            fine[k] = (hw_point2){(float)(p[k]->at[0] * FINE), (float)(p[k]->at[1] * FINE)};
        }
        hw_raster_fill_triangle(bits, size, fine[0], fine[1], fine[2]);
        fill_depths(p, out);
    }
    count_coverage(bits, size, out);
out:
    hw_free(bits);
    hw_free(projected);
    if (status != HW_OK)
        hw_capture_free(out);
    return status;
}
