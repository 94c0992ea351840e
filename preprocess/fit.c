#include "fit.h"
#include "alloc.h"
#include "conjugate_gradients.h"
#include "parallel.h"
#include "surface_sampler.h"
#include <math.h>
#include <string.h>

#define DEFAULT_SAMPLES 6
#define BLOCK           1024 // equations handed out at a time
#define SEED            1993
#define INNER           4u   // samples of each face of the mesh
#define DAMPING         0.02 // holds vertices where samples leave them free; share of their weight
#define CG_STEPS        16
#define TURN_MIN        0.5 // cosine

// One distance: the shift of the mesh's point along n that would bring it to the other surface.
typedef struct equation {
    uint32_t v[3];
    float w[3]; // barycentric
    float n[3], r;
    float weight; // area of the sample
} equation;

typedef struct fit {
    hw_mesh *mesh;
    const hw_rays *original;
    hw_rays *rays;          // of the mesh as it is
    const hw_vec3 *samples; // of the original
    uint32_t sample_count;
    float sample_area;
    equation *equations; // of the samples, then INNER for each face
    uint32_t equation_count;
    double (*step)[3]; // per vertex: the solution
} fit;

static hw_vec3 point_at(const hw_mesh *mesh, const equation *e)
{
    hw_vec3 p = hw_v3(0, 0, 0);
    for (int i = 0; i < 3; i++)
        p = hw_v3_mad(p, mesh->positions[e->v[i]], e->w[i]);
    return p;
}

// `way` leads from the mesh's point to the other surface.
static void set_way(const hw_mesh *mesh, hw_vec3 way, equation *e)
{
    const hw_vec3 *p = mesh->positions;
    float length = hw_v3_length(way);
    hw_vec3 n = hw_v3_normalize(
        hw_v3_cross(hw_v3_sub(p[e->v[1]], p[e->v[0]]), hw_v3_sub(p[e->v[2]], p[e->v[0]])));
    float size = hw_v3_length(hw_v3_sub(p[e->v[1]], p[e->v[0]]));
    if (length > 1e-5f * size) // else the direction is rounding: the face's normal serves
        n = hw_v3_scale(way, 1 / length);
    else
        length = hw_v3_dot(way, n);
    e->n[0] = n.x;
    e->n[1] = n.y;
    e->n[2] = n.z;
    e->r = length;
}

static void set_face(const hw_mesh *mesh, uint32_t triangle, float u, float v, equation *e)
{
    memcpy(e->v, mesh->indices + 3 * (size_t)triangle, sizeof e->v);
    e->w[0] = 1 - u - v;
    e->w[1] = u;
    e->w[2] = v;
}

// From a point of the original to the mesh.
static void sample_outer(const fit *f, uint32_t i, equation *e)
{
    hw_closest at = hw_rays_closest(f->rays, f->samples[i], INFINITY);
    *e = (equation){.weight = at.distance < INFINITY ? f->sample_area : 0};
    if (e->weight == 0)
        return;
    set_face(f->mesh, at.triangle_idx, at.u, at.v, e);
    set_way(f->mesh, hw_v3_sub(f->samples[i], at.point), e);
}

// From a point of the mesh to the original.
static void sample_inner(const fit *f, uint32_t i, equation *e)
{
    static const float places[INNER][2] = {
        {1 / 3.0f, 1 / 3.0f}, {1 / 6.0f, 1 / 6.0f}, {2 / 3.0f, 1 / 6.0f}, {1 / 6.0f, 2 / 3.0f}};
    uint32_t triangle = i / INNER;
    *e = (equation){0};
    set_face(f->mesh, triangle, places[i % INNER][0], places[i % INNER][1], e);
    const hw_vec3 *p = f->mesh->positions;
    hw_vec3 normal =
        hw_v3_cross(hw_v3_sub(p[e->v[1]], p[e->v[0]]), hw_v3_sub(p[e->v[2]], p[e->v[0]]));
    hw_vec3 from = point_at(f->mesh, e);
    hw_closest at = hw_rays_closest(f->original, from, INFINITY);
    if (!(at.distance < INFINITY))
        return;
    e->weight = hw_v3_length(normal) / 2 / INNER;
    set_way(f->mesh, hw_v3_sub(at.point, from), e);
}

static hw_status sample_block(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    const fit *f = context;
    uint64_t first = index * BLOCK, last = first + BLOCK;
    if (last > f->equation_count)
        last = f->equation_count;
    for (uint64_t i = first; i < last; i++)
        if (i < f->sample_count)
            sample_outer(f, (uint32_t)i, &f->equations[i]);
        else
            sample_inner(f, (uint32_t)(i - f->sample_count), &f->equations[i]);
    return HW_OK;
}

// ---- the solution ----------------------------------------------------------------------------

static double shift_along(const equation *e, const double *x)
{
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        const double *at = x + 3 * (size_t)e->v[i];
        sum += (double)e->w[i] *
               ((double)e->n[0] * at[0] + (double)e->n[1] * at[1] + (double)e->n[2] * at[2]);
    }
    return sum;
}

static void spread(const equation *e, double value, double *out)
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            out[3 * (size_t)e->v[i] + (size_t)k] += (double)e->w[i] * value * (double)e->n[k];
}

typedef double (*vectors)[3]; // one per vertex

typedef struct solver {
    const fit *f;
    double *damping;
    double *scratch; // for conjugate gradients
    vectors residual;
    vectors volume, answer; // gradient of the enclosed volume, and the step that it gives
} solver;

static void solver_free(solver *s)
{
    hw_free(s->damping);
    hw_free(s->scratch);
    hw_free(s->residual);
    hw_free(s->volume);
    hw_free(s->answer);
}

static hw_status solver_make(uint32_t n, solver *s)
{
    HW_TRY(HW_NEW(&s->damping, n));
    HW_TRY(HW_NEW(&s->scratch, 6 * (size_t)n));
    HW_TRY(HW_NEW(&s->residual, n));
    HW_TRY(HW_NEW(&s->volume, n));
    return HW_NEW(&s->answer, n);
}

// out = (J' W J + damping) x
static void apply(const void *context, const double *x, double *out)
{
    const solver *s = context;
    const fit *f = s->f;
    for (uint32_t v = 0; v < f->mesh->vertex_count; v++)
        for (int k = 0; k < 3; k++)
            out[3 * (size_t)v + (size_t)k] = s->damping[v] * x[3 * (size_t)v + (size_t)k];
    for (uint32_t i = 0; i < f->equation_count; i++) {
        const equation *e = &f->equations[i];
        spread(e, (double)e->weight * shift_along(e, x), out);
    }
}

// From s->residual, which is used up.
static void find_step(solver *s, vectors out)
{
    hw_conjugate_gradients(apply, s, 3 * (size_t)s->f->mesh->vertex_count, CG_STEPS, *s->residual,
                           *out, s->scratch);
}

static double product(const solver *s, vectors a, vectors b)
{
    return hw_inner_product(*a, *b, 3 * (size_t)s->f->mesh->vertex_count);
}

// What a shift of each vertex adds to the enclosed volume.
static void volume_gradient(const hw_mesh *m, vectors out)
{
    for (uint32_t i = 0; i < m->index_count; i += 3) {
        const uint32_t *t = m->indices + i;
        hw_vec3 n = hw_v3_cross(hw_v3_sub(m->positions[t[1]], m->positions[t[0]]),
                                hw_v3_sub(m->positions[t[2]], m->positions[t[0]]));
        for (int k = 0; k < 3; k++) {
            out[t[k]][0] += (double)n.x / 6;
            out[t[k]][1] += (double)n.y / 6;
            out[t[k]][2] += (double)n.z / 6;
        }
    }
}

// The step of least squares among those that sweep no volume.
static hw_status solve(fit *f)
{
    hw_status status;
    solver s = {.f = f};
    uint32_t n = f->mesh->vertex_count;
    HW_GO(solver_make(n, &s));
    for (uint32_t i = 0; i < f->equation_count; i++) {
        const equation *e = &f->equations[i];
        spread(e, (double)e->weight * (double)e->r, *s.residual);
        for (int k = 0; k < 3; k++)
            s.damping[e->v[k]] += DAMPING * (double)e->weight * (double)e->w[k] * (double)e->w[k];
    }
    find_step(&s, f->step);
    volume_gradient(f->mesh, s.volume);
    memcpy(s.residual, s.volume, n * sizeof *s.residual);
    find_step(&s, s.answer);
    double along = product(&s, s.volume, s.answer);
    double back = along > 0 ? product(&s, s.volume, f->step) / along : 0;
    for (uint32_t v = 0; v < n; v++)
        for (int k = 0; k < 3; k++)
            f->step[v][k] -= back * s.answer[v][k];
out:
    solver_free(&s);
    return status;
}

// Holds the corners of faces that the step would turn too far, until no face is left that does.
static void hold_turning(const fit *f)
{
    const hw_mesh *m = f->mesh;
    for (bool again = true; again;) {
        again = false;
        for (uint32_t i = 0; i < m->index_count; i += 3) {
            const uint32_t *t = m->indices + i;
            hw_vec3 p[3], q[3];
            bool moves = false;
            for (int k = 0; k < 3; k++) {
                const double *s = f->step[t[k]];
                p[k] = m->positions[t[k]];
                q[k] = hw_v3_add(p[k], hw_v3((float)s[0], (float)s[1], (float)s[2]));
                moves |= s[0] != 0 || s[1] != 0 || s[2] != 0;
            }
            hw_vec3 before = hw_v3_cross(hw_v3_sub(p[1], p[0]), hw_v3_sub(p[2], p[0]));
            hw_vec3 after = hw_v3_cross(hw_v3_sub(q[1], q[0]), hw_v3_sub(q[2], q[0]));
            float least = (float)TURN_MIN * hw_v3_length(before) * hw_v3_length(after);
            if (!moves || hw_v3_dot(before, after) > least)
                continue;
            for (int k = 0; k < 3; k++)
                memset(f->step[t[k]], 0, sizeof f->step[0]);
            again = true;
        }
    }
}

static hw_status fit_once(fit *f, uint32_t threads)
{
    HW_TRY(hw_rays_create_mesh(&f->rays, f->mesh));
    uint64_t blocks = (f->equation_count + (uint64_t)BLOCK - 1) / BLOCK;
    hw_status status = hw_parallel_for(blocks, threads, sample_block, f, NULL);
    hw_rays_destroy(f->rays);
    HW_TRY(status);
    HW_TRY(solve(f));
    hold_turning(f);
    for (uint32_t v = 0; v < f->mesh->vertex_count; v++) {
        const double *s = f->step[v];
        f->mesh->positions[v] =
            hw_v3_add(f->mesh->positions[v], hw_v3((float)s[0], (float)s[1], (float)s[2]));
    }
    return HW_OK;
}

static hw_status draw_samples(const hw_mesh *original, uint32_t count, hw_vec3 **out, float *area)
{
    hw_surface_sampler sampler = {0};
    hw_status status;
    HW_GO(HW_NEW(out, count));
    HW_GO(hw_surface_sampler_make(original, &sampler));
    hw_surface_walk walk = hw_surface_walk_start(&sampler, count, hw_rng_make(SEED, 1));
    for (uint32_t i = 0; hw_surface_walk_next(&walk, &(*out)[i]);)
        i++;
    *area = (float)(sampler.area / count);
out:
    hw_surface_sampler_free(&sampler);
    return status;
}

hw_status hw_fit(hw_mesh *mesh, const hw_rays *original, const hw_fit_options *options)
{
    hw_status status;
    hw_vec3 *samples = NULL;
    uint32_t faces = mesh->index_count / 3;
    uint64_t count = (uint64_t)faces * (options->samples ? options->samples : DEFAULT_SAMPLES);
    fit f = {.mesh = mesh, .original = original};
    if (faces == 0 || options->rounds == 0)
        return HW_OK;
    if (count + (uint64_t)faces * INNER > UINT32_MAX)
        return hw_fail(HW_LIMIT, "too many samples to fit a mesh of %u triangles", faces);
    f.sample_count = (uint32_t)count;
    f.equation_count = f.sample_count + faces * INNER;
    HW_GO(draw_samples(hw_rays_mesh(original), f.sample_count, &samples, &f.sample_area));
    f.samples = samples;
    HW_GO(HW_NEW(&f.equations, f.equation_count));
    HW_GO(HW_NEW(&f.step, mesh->vertex_count));
    for (uint32_t i = 0; i < options->rounds; i++)
        HW_GO(fit_once(&f, options->threads));
out:
    hw_free(samples);
    hw_free(f.equations);
    hw_free(f.step);
    return status;
}
