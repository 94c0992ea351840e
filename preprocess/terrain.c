#include "terrain.h"
#include "alloc.h"
#include "conjugate_gradients.h"
#include "planar.h"
#include <math.h>
#include <string.h>

#define NONE     UINT32_MAX
#define CG_STEPS 12
#define DAMPING  0.05 // holds the vertices; share of the weight of their samples

typedef struct triangle {
    uint32_t v[3];
    uint32_t worst; // sample that it meets worst, NONE: all within their tolerances
    double error;   // there, over the tolerance
} triangle;

typedef struct surface {
    const hw_height_field *field;
    double (*vertices)[3];
    triangle *triangles;
    uint32_t vertex_count, triangle_count;
} surface;

// Whether d lies in the circle through a, b and c, by more than rounding.
static bool in_circle(const double *a, const double *b, const double *c, const double *d)
{
    double m[3][3];
    const double *corners[3] = {a, b, c};
    for (int i = 0; i < 3; i++) {
        m[i][0] = corners[i][0] - d[0];
        m[i][1] = corners[i][1] - d[1];
        m[i][2] = m[i][0] * m[i][0] + m[i][1] * m[i][1];
    }
    double det = m[0][2] * (m[1][0] * m[2][1] - m[2][0] * m[1][1]) +
                 m[1][2] * (m[2][0] * m[0][1] - m[0][0] * m[2][1]) +
                 m[2][2] * (m[0][0] * m[1][1] - m[1][0] * m[0][1]);
    return det > 1e-9 * (m[0][2] + m[1][2] + m[2][2]) * fabs(hw_turn(a, b, c));
}

// ---- samples of a triangle -------------------------------------------------------------------

// A walk over the samples in a triangle, or within a margin of its sides.
typedef struct walk {
    double edge[3][3]; // weight of corner k at (x, y): edge[k][0] x + edge[k][1] y + edge[k][2]
    double slack[3];   // down to minus which a weight counts as inside
    uint32_t x_begin, x_end, y_end; // of the triangle's bounds
    uint32_t x, x_stop, y;          // where it goes on, up to where in this row
} walk;

// The samples of row w->y that may lie inside, and perhaps one more at either end.
static void begin_row(walk *w)
{
    double begin = w->x_begin, end = w->x_end;
    for (int k = 0; k < 3; k++) {
        double slope = w->edge[k][0];
        double crossing = (-w->slack[k] - w->edge[k][1] * (w->y + 0.5) - w->edge[k][2]) / slope;
        if (slope > 0)
            begin = fmax(begin, floor(crossing - 0.5));
        else if (slope < 0)
            end = fmin(end, ceil(crossing - 0.5) + 1);
    }
    w->x = hw_clamp_index(begin, w->x_end);
    w->x_stop = hw_clamp_index(end, w->x_end);
}

static walk walk_make(const surface *t, const triangle *f, double margin)
{
    walk w;
    const double *p[3];
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int k = 0; k < 3; k++) {
        p[k] = t->vertices[f->v[k]];
        for (int a = 0; a < 2; a++) {
            low[a] = fmin(low[a], p[k][a]);
            high[a] = fmax(high[a], p[k][a]);
        }
    }
    double area = hw_turn(p[0], p[1], p[2]);
    for (int k = 0; k < 3; k++) {
        const double *a = p[(k + 1) % 3], *b = p[(k + 2) % 3];
        w.edge[k][0] = (a[1] - b[1]) / area;
        w.edge[k][1] = (b[0] - a[0]) / area;
        w.edge[k][2] = (a[0] * b[1] - b[0] * a[1]) / area;
        w.slack[k] = 1e-9 + margin * hypot(w.edge[k][0], w.edge[k][1]);
    }
    w.x_begin = hw_clamp_index(ceil(low[0] - 0.5 - margin), t->field->width);
    w.x_end = hw_clamp_index(floor(high[0] + 0.5 + margin), t->field->width);
    w.y = hw_clamp_index(ceil(low[1] - 0.5 - margin), t->field->height);
    w.y_end = hw_clamp_index(floor(high[1] + 0.5 + margin), t->field->height);
    begin_row(&w);
    return w;
}

// The weights of the corners at a sample; false if it lies outside.
static bool weights_at(const walk *w, uint32_t x, uint32_t y, double out[3])
{
    for (int k = 0; k < 3; k++) {
        out[k] = w->edge[k][0] * (x + 0.5) + w->edge[k][1] * (y + 0.5) + w->edge[k][2];
        if (out[k] < -w->slack[k])
            return false;
    }
    return true;
}

// The next sample that is to be met, and the weights of the corners there; false: no more.
static bool next_sample(const surface *t, walk *w, size_t *sample, double weights[3])
{
    while (w->y < w->y_end) {
        while (w->x < w->x_stop) {
            uint32_t x = w->x++;
            *sample = (size_t)w->y * t->field->width + x;
            if (!isnan(t->field->heights[*sample]) && weights_at(w, x, w->y, weights))
                return true;
        }
        w->y++;
        begin_row(w);
    }
    return false;
}

static double error_at(const surface *t, const triangle *f, const double weights[3], size_t sample)
{
    double height = 0;
    for (int k = 0; k < 3; k++)
        height += weights[k] * t->vertices[f->v[k]][2];
    return (height - (double)t->field->heights[sample]) / (double)t->field->tolerances[sample];
}

static void find_worst(const surface *t, triangle *f)
{
    double weights[3];
    size_t sample;
    walk w = walk_make(t, f, 0);
    f->worst = NONE;
    f->error = 1;
    while (next_sample(t, &w, &sample, weights)) {
        double error = fabs(error_at(t, f, weights, sample));
        if (error > f->error) {
            f->error = error;
            f->worst = (uint32_t)sample;
        }
    }
}

static bool meets_any(const surface *t, const triangle *f, double margin)
{
    double weights[3];
    size_t sample;
    walk w = walk_make(t, f, margin);
    return next_sample(t, &w, &sample, weights);
}

// ---- triangulation ---------------------------------------------------------------------------

static triangle *add_triangle(surface *t, uint32_t a, uint32_t b, uint32_t c)
{
    triangle *f = &t->triangles[t->triangle_count++];
    *f = (triangle){.v = {a, b, c}, .worst = NONE, .error = -1};
    return f;
}

// The triangle with the side a, b in this direction, turned so that its corner 2 is the third one.
static triangle *find_side(surface *t, uint32_t a, uint32_t b)
{
    for (uint32_t i = 0; i < t->triangle_count; i++) {
        triangle *f = &t->triangles[i];
        for (int k = 0; k < 3; k++)
            if (f->v[k] == a && f->v[(k + 1) % 3] == b) {
                uint32_t c = f->v[(k + 2) % 3];
                f->v[0] = a;
                f->v[1] = b;
                f->v[2] = c;
                return f;
            }
    }
    return NULL;
}

// Lawson's flips, from the side a, b of a triangle whose third corner is new, outwards.
static void make_delaunay(surface *t, uint32_t a, uint32_t b, uint32_t corner)
{
    triangle *near = find_side(t, a, b), *far = find_side(t, b, a);
    if (!far ||
        !in_circle(t->vertices[a], t->vertices[b], t->vertices[corner], t->vertices[far->v[2]]))
        return;
    uint32_t opposite = far->v[2];
    if (!(hw_turn(t->vertices[corner], t->vertices[a], t->vertices[opposite]) > 0) ||
        !(hw_turn(t->vertices[corner], t->vertices[opposite], t->vertices[b]) > 0))
        return;
    *near = (triangle){.v = {corner, a, opposite}, .worst = NONE, .error = -1};
    *far = (triangle){.v = {corner, opposite, b}, .worst = NONE, .error = -1};
    make_delaunay(t, a, opposite, corner);
    make_delaunay(t, opposite, b, corner);
}

// Adds a vertex at a sample of the triangle. One that lies on a side would leave a triangle without
// an area: the side's other triangle is split too.
static void insert(surface *t, uint32_t triangle_idx, uint32_t sample)
{
    const hw_height_field *field = t->field;
    uint32_t v[3], added = t->vertex_count++;
    double *p = t->vertices[added];
    memcpy(v, t->triangles[triangle_idx].v, sizeof v);
    p[0] = sample % field->width + 0.5;
    p[1] = sample / field->width + 0.5;
    p[2] = (double)field->heights[sample];
    t->triangles[triangle_idx] = t->triangles[--t->triangle_count];
    for (int k = 0; k < 3; k++) {
        uint32_t a = v[k], b = v[(k + 1) % 3];
        if (hw_turn(t->vertices[a], t->vertices[b], p) > 1e-9) {
            (void)add_triangle(t, a, b, added);
            continue;
        }
        triangle *beyond = find_side(t, b, a);
        if (!beyond)
            continue; // on the rim
        uint32_t c = beyond->v[2];
        *beyond = (triangle){.v = {a, c, added}, .worst = NONE, .error = -1};
        (void)add_triangle(t, c, b, added);
        make_delaunay(t, a, c, added);
        make_delaunay(t, c, b, added);
    }
    for (int k = 0; k < 3; k++)
        if (find_side(t, v[k], v[(k + 1) % 3]))
            make_delaunay(t, v[k], v[(k + 1) % 3], added);
}

// A vertex with the height of the nearest sample.
static void set_corner(const surface *t, const double at[2], double out[3])
{
    const hw_height_field *field = t->field;
    double best = INFINITY;
    out[0] = at[0];
    out[1] = at[1];
    out[2] = 0;
    // Rows next to it first, until they are farther away than what was found.
    for (uint32_t i = 0; i < 2 * field->height; i++) {
        int64_t row = (int64_t)at[1] + (i % 2 ? -(int64_t)(i / 2 + 1) : (int64_t)(i / 2));
        if (i / 2 > 0 && (double)(i / 2 - 1) * (i / 2 - 1) >= best)
            return;
        for (uint32_t x = 0; row >= 0 && row < field->height && x < field->width; x++) {
            double dx = x + 0.5 - at[0], dy = (double)row + 0.5 - at[1], d = dx * dx + dy * dy;
            float height = field->heights[(size_t)row * field->width + x];
            if (d < best && !isnan(height)) {
                best = d;
                out[2] = (double)height;
            }
        }
    }
}

static void refine(surface *t, uint32_t vertices_max)
{
    for (;;) {
        triangle *worst = NULL;
        for (uint32_t i = 0; i < t->triangle_count; i++) {
            triangle *f = &t->triangles[i];
            if (f->error < 0)
                find_worst(t, f);
            if (f->worst != NONE && (!worst || f->error > worst->error))
                worst = f;
        }
        if (!worst || t->vertex_count == vertices_max)
            return;
        insert(t, (uint32_t)(worst - t->triangles), worst->worst);
    }
}

// ---- heights ---------------------------------------------------------------------------------

// The normal equations of the heights: a sum over the samples, weighted by their tolerances, of the
// products of the weights of two corners; dense, as there are few vertices.
typedef struct normal_equations {
    uint32_t n;
    double *matrix, *right; // n x n, n: of the change of the heights
} normal_equations;

static void apply(const void *context, const double *x, double *out)
{
    const normal_equations *e = context;
    for (uint32_t i = 0; i < e->n; i++)
        out[i] = hw_inner_product(e->matrix + (size_t)i * e->n, x, e->n);
}

// Errors beyond HW_TERRAIN_ERROR_MAX lie behind a step of the field that no surface follows.
static double cut_off(double error)
{
    return fmax(-HW_TERRAIN_ERROR_MAX, fmin(HW_TERRAIN_ERROR_MAX, error));
}

static void add_samples(const surface *t, const triangle *f, normal_equations *e)
{
    double weights[3];
    size_t sample;
    walk w = walk_make(t, f, 0);
    while (next_sample(t, &w, &sample, weights)) {
        double tolerance = (double)t->field->tolerances[sample];
        double error = error_at(t, f, weights, sample);
        // They pull no harder than it (Huber's weights).
        double pull = error == 0 ? 1 : cut_off(error) / error;
        for (int i = 0; i < 3; i++) {
            e->right[f->v[i]] -= pull * weights[i] * error / tolerance;
            for (int k = 0; k < 3; k++)
                e->matrix[(size_t)f->v[i] * e->n + f->v[k]] +=
                    pull * weights[i] * weights[k] / (tolerance * tolerance);
        }
    }
}

static hw_status fit_heights(surface *t)
{
    hw_status status;
    double *change = NULL, *scratch = NULL;
    normal_equations e = {.n = t->vertex_count};
    HW_GO(HW_NEW(&e.matrix, (size_t)e.n * e.n));
    HW_GO(HW_NEW(&e.right, e.n));
    HW_GO(HW_NEW(&change, e.n));
    HW_GO(HW_NEW(&scratch, 2 * (size_t)e.n));
    for (uint32_t i = 0; i < t->triangle_count; i++)
        add_samples(t, &t->triangles[i], &e);
    for (uint32_t i = 0; i < e.n; i++)
        e.matrix[(size_t)i * e.n + i] = e.matrix[(size_t)i * e.n + i] * (1 + DAMPING) + 1e-12;
    hw_conjugate_gradients(apply, &e, e.n, CG_STEPS, e.right, change, scratch);
    double low = INFINITY, high = -INFINITY; // no vertex goes where the field never does
    for (uint32_t i = 0; i < e.n; i++) {
        low = fmin(low, t->vertices[i][2]);
        high = fmax(high, t->vertices[i][2]);
    }
    for (uint32_t i = 0; i < e.n; i++)
        t->vertices[i][2] = fmax(low, fmin(high, t->vertices[i][2] + change[i]));
out:
    hw_free(e.matrix);
    hw_free(e.right);
    hw_free(change);
    hw_free(scratch);
    return status;
}

static double mean_error(const surface *t)
{
    double sum = 0, count = 0, weights[3];
    size_t sample;
    for (uint32_t i = 0; i < t->triangle_count; i++) {
        walk w = walk_make(t, &t->triangles[i], 0);
        while (next_sample(t, &w, &sample, weights)) {
            sum += fabs(cut_off(error_at(t, &t->triangles[i], weights, sample)));
            count++;
        }
    }
    return count > 0 ? sum / count : 0;
}

void hw_terrain_free(hw_terrain *terrain)
{
    if (!terrain)
        return;
    hw_free(terrain->vertices);
    hw_free(terrain->triangles);
    memset(terrain, 0, sizeof *terrain);
}

hw_status hw_terrain_fit(const hw_height_field *field, const double (*polygon)[2],
                         uint32_t corner_count, uint32_t vertices_max, hw_terrain *out)
{
    hw_status status;
    uint32_t capacity = corner_count > vertices_max ? corner_count : vertices_max;
    surface t = {.field = field};
    memset(out, 0, sizeof *out);
    HW_GO(HW_NEW(&t.vertices, capacity));
    HW_GO(HW_NEW(&t.triangles, 2 * (size_t)capacity + 2));
    for (uint32_t i = 0; i < corner_count; i++)
        set_corner(&t, polygon[i], t.vertices[t.vertex_count++]);
    for (uint32_t i = 2; i < corner_count; i++) {
        (void)add_triangle(&t, 0, i - 1, i);
        make_delaunay(&t, 0, i - 1, i);
    }
    if (corner_count < vertices_max)
        refine(&t, vertices_max);
    HW_GO(fit_heights(&t));
    out->mean_error = mean_error(&t);
    HW_GO(HW_NEW(&out->triangles, t.triangle_count));
    for (uint32_t i = 0; i < t.triangle_count; i++)
        if (meets_any(&t, &t.triangles[i], 1))
            memcpy(out->triangles[out->triangle_count++], t.triangles[i].v, sizeof *out->triangles);
    out->vertex_count = t.vertex_count;
    out->vertices = t.vertices;
    t.vertices = NULL;
out:
    hw_free(t.vertices);
    hw_free(t.triangles);
    if (status != HW_OK)
        hw_terrain_free(out);
    return status;
}
