#include "ambient.h"
#include "alloc.h"
#include "hash.h"
#include "parallel.h"
#include "rays.h"

#define DEFAULT_RAYS 256
#define GROUND_LIGHT 0.5f  // what a ray that leaves downwards meets: the ground reflects about half
#define BLOCK        256   // vertices handed out at a time
#define OFFSET       1e-4f // of the diagonal: off the surface, below any detail that could show

typedef struct bake_job {
    const hw_mesh *mesh;
    const hw_rays *rays;
    const uint32_t *weld;
    const hw_vec3 *directions; // around +z, cosine-weighted
    uint32_t direction_count;
    float offset;
    hw_color8 *colors;
} bake_job;

// Equal-area spiral on the disc, lifted to the hemisphere: density proportional to the cosine
// (Malley's method on a Vogel spiral).
static void make_directions(hw_vec3 *out, uint32_t count)
{
    const double golden_angle = HW_PI * (3 - sqrt(5.0));
    for (uint32_t i = 0; i < count; i++) {
        double r2 = (i + 0.5) / count, r = sqrt(r2), angle = i * golden_angle;
        out[i] = hw_v3((float)(r * cos(angle)), (float)(r * sin(angle)), (float)sqrt(1 - r2));
    }
}

// Two unit vectors perpendicular to unit n, right-handed with it (Duff et al., Building an
// Orthonormal Basis, Revisited, JCGT 2017).
static void make_basis(hw_vec3 n, hw_vec3 *s, hw_vec3 *t)
{
    float sign = copysignf(1, n.z);
    float a = -1 / (sign + n.z), b = n.x * n.y * a;
    *s = hw_v3(1 + sign * n.x * n.x * a, sign * b, -sign * n.x);
    *t = hw_v3(b, sign + n.y * n.y * a, -n.y);
}

static float openness(const bake_job *job, uint32_t vertex)
{
    hw_vec3 n = job->mesh->normals[vertex];
    if (hw_v3_length(n) == 0)
        return 1; // a vertex of degenerate triangles only
    hw_vec3 s, t;
    make_basis(n, &s, &t);
    // Each place turns the set by an angle of its own, so that the error is fine noise rather than
    // bands; vertices at one place turn alike, so that seams do not show.
    uint32_t place = job->weld[vertex];
    float angle = (float)((double)(hw_hash(0, &place, sizeof place) >> 40) * 0x1p-24 * 2 * HW_PI);
    float c = cosf(angle), d = sinf(angle);
    hw_vec3 origin = hw_v3_mad(job->mesh->positions[vertex], n, job->offset);
    float open = 0;
    for (uint32_t i = 0; i < job->direction_count; i++) {
        hw_vec3 l = job->directions[i];
        hw_vec3 w = hw_v3_scale(n, l.z);
        w = hw_v3_mad(w, s, c * l.x - d * l.y);
        w = hw_v3_mad(w, t, d * l.x + c * l.y);
        if (!hw_rays_occluded(job->rays, origin, w, 0, INFINITY))
            open += w.z < 0 ? GROUND_LIGHT : 1;
    }
    return open / (float)job->direction_count;
}

static uint8_t scale8(uint8_t value, float factor)
{
    return (uint8_t)((float)value * factor + 0.5f);
}

static hw_status bake_block(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    const bake_job *job = context;
    uint64_t first = index * BLOCK, last = first + BLOCK;
    if (last > job->mesh->vertex_count)
        last = job->mesh->vertex_count;
    for (uint64_t i = first; i < last; i++) {
        float factor = openness(job, (uint32_t)i);
        hw_color8 *color = &job->colors[i];
        color->r = scale8(color->r, factor);
        color->g = scale8(color->g, factor);
        color->b = scale8(color->b, factor);
    }
    return HW_OK;
}

static hw_status ensure_colors(hw_mesh *mesh)
{
    if (mesh->colors)
        return HW_OK;
    HW_TRY(HW_NEW(&mesh->colors, mesh->vertex_count));
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        mesh->colors[i] = (hw_color8){255, 255, 255, 255};
    return HW_OK;
}

hw_status hw_ambient_bake(hw_mesh *mesh, uint32_t rays_per_vertex, uint32_t threads)
{
    hw_status status = HW_OK;
    hw_rays *rays = NULL;
    uint32_t *weld = NULL;
    hw_vec3 *directions = NULL;
    uint32_t direction_count = rays_per_vertex ? rays_per_vertex : DEFAULT_RAYS;
    if (!mesh->normals)
        HW_GO(hw_mesh_compute_normals(mesh));
    HW_GO(hw_rays_create_mesh(&rays, mesh));
    HW_GO(HW_NEW(&weld, mesh->vertex_count));
    HW_GO(hw_mesh_weld_map(mesh, weld));
    HW_GO(HW_NEW(&directions, direction_count));
    make_directions(directions, direction_count);
    HW_GO(ensure_colors(mesh));
    bake_job job = {mesh,
                    rays,
                    weld,
                    directions,
                    direction_count,
                    OFFSET * hw_box_diagonal(hw_mesh_bounds(mesh)),
                    mesh->colors};
    HW_GO(hw_parallel_for((mesh->vertex_count + (uint64_t)BLOCK - 1) / BLOCK, threads, bake_block,
                          &job, NULL));
out:
    hw_free(directions);
    hw_free(weld);
    hw_rays_destroy(rays);
    return status;
}
