#include "importance.h"
#include "parallel.h"

#define DEFAULT_LINES 32
#define BLOCK         256 // vertices handed out at a time
#define OFFSET        1e-3f

typedef struct importance_job {
    const hw_mesh *mesh;
    const hw_rays *rays;
    uint32_t lines;
    double limit; // sine of the elevation
    float floor, power, offset;
    float *out;
} importance_job;

static float free_fraction(const importance_job *job, uint32_t vertex)
{
    hw_vec3 n = job->mesh->normals[vertex];
    if (hw_v3_length(n) == 0)
        return 0;
    // h and w span the tangent plane, h horizontal; cos(a) h + sin(a) w rises by |sin(a)| times
    // that of w.
    hw_vec3 h = hw_v3_cross(n, hw_v3(0, 0, 1));
    h = hw_v3_length(h) > 1e-6f ? hw_v3_normalize(h) : hw_v3(1, 0, 0);
    hw_vec3 w = hw_v3_cross(n, h);
    double rise = fabs((double)w.z);
    double widest =
        rise > job->limit ? asin(job->limit / rise) : HW_PI / 2; // half a turn holds every line
    hw_vec3 origin = hw_v3_mad(job->mesh->positions[vertex], n, job->offset);
    uint32_t open = 0;
    for (uint32_t i = 0; i < job->lines; i++) {
        double angle = widest * (2 * (i + 0.5) / job->lines - 1);
        hw_vec3 d = hw_v3_mad(hw_v3_scale(h, (float)cos(angle)), w, (float)sin(angle));
        open += !hw_rays_occluded(job->rays, origin, d, 0, INFINITY) &&
                !hw_rays_occluded(job->rays, origin, hw_v3_scale(d, -1), 0, INFINITY);
    }
    return (float)open / (float)job->lines;
}

static hw_status importance_block(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    const importance_job *job = context;
    uint64_t first = index * BLOCK, last = first + BLOCK;
    if (last > job->mesh->vertex_count)
        last = job->mesh->vertex_count;
    for (uint64_t i = first; i < last; i++)
        job->out[i] = fmaxf(job->floor, powf(free_fraction(job, (uint32_t)i), job->power));
    return HW_OK;
}

hw_status hw_silhouette_importance(const hw_mesh *mesh, const hw_rays *rays,
                                   const hw_importance_options *options, float *out)
{
    if (!mesh->normals)
        return hw_fail(HW_USAGE, "%s: silhouette importance needs normals",
                       mesh->name ? mesh->name : "a mesh");
    importance_job job = {mesh,
                          rays,
                          options->lines ? options->lines : DEFAULT_LINES,
                          sin(options->elevation_degrees * HW_PI / 180),
                          options->floor,
                          options->power > 0 ? options->power : 1,
                          OFFSET * hw_box_diagonal(hw_mesh_bounds(mesh)),
                          out};
    uint64_t blocks = (mesh->vertex_count + (uint64_t)BLOCK - 1) / BLOCK;
    return hw_parallel_for(blocks, options->threads, importance_block, &job, NULL);
}
