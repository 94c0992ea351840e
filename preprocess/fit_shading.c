#include "fit_shading.h"
#include "alloc.h"
#include "conjugate_gradients.h"
#include <math.h>
#include <string.h>

#define VALUES      6  // of a vertex: normal, colour (0 to 1)
#define SAMPLES_MIN 4u // of a face
#define SAMPLES_MAX 12u
#define DAMPING     0.02 // holds vertices that few samples reach; share of their weight
#define CG_STEPS    12

typedef float values[VALUES];

// What the samples of one face ask of its corners: the upper half of a symmetric matrix, and for
// each corner the weighted sum of what the original has.
typedef struct face_sums {
    float matrix[6]; // 00 01 02 11 12 22
    values wanted[3];
} face_sums;

typedef struct shading_fit {
    const hw_mesh *mesh, *original;
    const hw_rays *rays;
    face_sums *faces;
    float *damping;                    // per vertex
    double *residual, *step, *scratch; // VALUES per vertex; twice that of scratch
} shading_fit;

static size_t count_of(const shading_fit *f)
{
    return VALUES * (size_t)f->mesh->vertex_count;
}

static void fit_free(shading_fit *f)
{
    hw_free(f->faces);
    hw_free(f->damping);
    hw_free(f->residual);
    hw_free(f->step);
    hw_free(f->scratch);
}

static hw_status fit_make(shading_fit *f)
{
    HW_TRY(HW_NEW(&f->faces, f->mesh->index_count / 3));
    HW_TRY(HW_NEW(&f->damping, f->mesh->vertex_count));
    HW_TRY(HW_NEW(&f->residual, count_of(f)));
    HW_TRY(HW_NEW(&f->step, count_of(f)));
    return HW_NEW(&f->scratch, 2 * count_of(f));
}

// ---- samples ---------------------------------------------------------------------------------

static void read_vertex(const hw_mesh *mesh, uint32_t v, values out)
{
    hw_color8 white = {255, 255, 255, 255}, c = mesh->colors ? mesh->colors[v] : white;
    const values got = {mesh->normals[v].x, mesh->normals[v].y, mesh->normals[v].z,
                        (float)c.r / 255,   (float)c.g / 255,   (float)c.b / 255};
    memcpy(out, got, sizeof got);
}

// What the original shows at a point of its surface.
static void read_surface(const hw_mesh *mesh, const hw_closest *at, values out)
{
    const uint32_t *t = mesh->indices + 3 * (size_t)at->triangle_idx;
    const float w[3] = {1 - at->u - at->v, at->u, at->v};
    memset(out, 0, sizeof(values));
    for (int i = 0; i < 3; i++) {
        values corner;
        read_vertex(mesh, t[i], corner);
        for (int k = 0; k < VALUES; k++)
            out[k] += w[i] * corner[k];
    }
}

// Point k of a face, spread evenly (the R2 sequence, M. Roberts 2018, folded into the triangle).
static void sample_place(uint32_t face, uint32_t k, float w[3])
{
    double n = (double)face * SAMPLES_MAX + k + 1;
    double u = fmod(n * 0.7548776662466927, 1), v = fmod(n * 0.5698402909980532, 1);
    bool fold = u + v > 1;
    w[1] = (float)(fold ? 1 - u : u);
    w[2] = (float)(fold ? 1 - v : v);
    w[0] = 1 - w[1] - w[2];
}

static void add_sample(const float w[3], const values wanted, float weight, face_sums *sums)
{
    int at = 0;
    for (int i = 0; i < 3; i++) {
        for (int j = i; j < 3; j++)
            sums->matrix[at++] += weight * w[i] * w[j];
        for (int k = 0; k < VALUES; k++)
            sums->wanted[i][k] += weight * w[i] * wanted[k];
    }
}

// Samples the face, and leaves out where the closest surface is the back of another.
static void sample_face(const shading_fit *f, uint32_t face, uint32_t count)
{
    const uint32_t *t = f->mesh->indices + 3 * (size_t)face;
    const hw_vec3 *p = f->mesh->positions;
    hw_vec3 normal = hw_v3_cross(hw_v3_sub(p[t[1]], p[t[0]]), hw_v3_sub(p[t[2]], p[t[0]]));
    float weight = hw_v3_length(normal) / 2 / (float)count;
    for (uint32_t k = 0; k < count; k++) {
        float w[3];
        values wanted;
        hw_vec3 point = hw_v3(0, 0, 0);
        sample_place(face, k, w);
        for (int i = 0; i < 3; i++)
            point = hw_v3_mad(point, p[t[i]], w[i]);
        hw_closest at = hw_rays_closest(f->rays, point, INFINITY);
        if (!(at.distance < INFINITY))
            continue;
        read_surface(f->original, &at, wanted);
        if (hw_v3_dot(normal, hw_v3(wanted[0], wanted[1], wanted[2])) > 0)
            add_sample(w, wanted, weight, &f->faces[face]);
    }
}

// ---- the solution ----------------------------------------------------------------------------

// out = (M + damping) x
static void apply(const void *context, const double *x, double *out)
{
    static const int place[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    const shading_fit *f = context;
    for (size_t i = 0; i < count_of(f); i++)
        out[i] = (double)f->damping[i / VALUES] * x[i];
    for (uint32_t face = 0; face < f->mesh->index_count / 3; face++) {
        const uint32_t *t = f->mesh->indices + 3 * (size_t)face;
        const float *m = f->faces[face].matrix;
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                for (int k = 0; k < VALUES; k++)
                    out[VALUES * (size_t)t[i] + (size_t)k] +=
                        (double)m[place[i][j]] * x[VALUES * (size_t)t[j] + (size_t)k];
    }
}

// What is missing where the fit starts: wanted - M start. Damping, which holds the step, comes
// after that.
static void begin(shading_fit *f)
{
    static const int diagonal[3] = {0, 3, 5};
    double *start = f->step; // not needed yet
    for (uint32_t v = 0; v < f->mesh->vertex_count; v++) {
        values at;
        read_vertex(f->mesh, v, at);
        for (int k = 0; k < VALUES; k++)
            start[VALUES * (size_t)v + (size_t)k] = (double)at[k];
    }
    apply(f, start, f->residual);
    for (size_t i = 0; i < count_of(f); i++)
        f->residual[i] = -f->residual[i];
    for (uint32_t face = 0; face < f->mesh->index_count / 3; face++) {
        const uint32_t *t = f->mesh->indices + 3 * (size_t)face;
        for (int i = 0; i < 3; i++) {
            f->damping[t[i]] += (float)DAMPING * f->faces[face].matrix[diagonal[i]];
            for (int k = 0; k < VALUES; k++)
                f->residual[VALUES * (size_t)t[i] + (size_t)k] +=
                    (double)f->faces[face].wanted[i][k];
        }
    }
}

static uint8_t to_byte(float value)
{
    return (uint8_t)lrintf(fminf(fmaxf(value, 0), 1) * 255);
}

static void write_back(const shading_fit *f, hw_mesh *mesh)
{
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        values at;
        read_vertex(mesh, v, at);
        for (int k = 0; k < VALUES; k++)
            at[k] += (float)f->step[VALUES * (size_t)v + (size_t)k];
        hw_vec3 normal = hw_v3(at[0], at[1], at[2]);
        if (hw_v3_length(normal) > 1e-3f) // else it has none to speak of: a spike
            mesh->normals[v] = hw_v3_normalize(normal);
        if (mesh->colors) {
            mesh->colors[v].r = to_byte(at[3]);
            mesh->colors[v].g = to_byte(at[4]);
            mesh->colors[v].b = to_byte(at[5]);
        }
    }
}

static hw_status prepare(hw_mesh *mesh, const hw_mesh *original)
{
    if (!mesh->normals)
        HW_TRY(hw_mesh_compute_normals(mesh));
    if (original->colors && !mesh->colors) {
        HW_TRY(HW_NEW(&mesh->colors, mesh->vertex_count));
        memset(mesh->colors, 255, mesh->vertex_count * sizeof *mesh->colors);
    }
    return HW_OK;
}

hw_status hw_fit_shading(hw_mesh *mesh, const hw_mesh *original, const hw_rays *rays)
{
    hw_status status;
    hw_mesh copy = {0}; // of the original, with normals, where it has none
    shading_fit f = {.mesh = mesh, .original = original, .rays = rays};
    uint32_t faces = mesh->index_count / 3;
    if (faces == 0)
        return HW_OK;
    HW_GO(prepare(mesh, original));
    if (!original->normals) {
        HW_GO(hw_mesh_copy(original, &copy));
        HW_GO(hw_mesh_compute_normals(&copy));
        f.original = &copy;
    }
    HW_GO(fit_make(&f));
    uint32_t count = original->index_count / 3 / faces;
    count = count < SAMPLES_MIN ? SAMPLES_MIN : count > SAMPLES_MAX ? SAMPLES_MAX : count;
    for (uint32_t face = 0; face < faces; face++)
        sample_face(&f, face, count);
    begin(&f);
    hw_conjugate_gradients(apply, &f, count_of(&f), CG_STEPS, f.residual, f.step, f.scratch);
    write_back(&f, mesh);
out:
    fit_free(&f);
    hw_mesh_free(&copy);
    return status;
}
