#include "surface_sampler.h"
#include "alloc.h"

static double triangle_area(const hw_mesh *mesh, uint32_t triangle)
{
    const uint32_t *t = mesh->indices + 3 * (size_t)triangle;
    hw_vec3 a = mesh->positions[t[0]];
    return 0.5 * hw_v3_length(hw_v3_cross(hw_v3_sub(mesh->positions[t[1]], a),
                                          hw_v3_sub(mesh->positions[t[2]], a)));
}

hw_status hw_surface_sampler_make(const hw_mesh *mesh, hw_surface_sampler *out)
{
    *out = (hw_surface_sampler){.mesh = mesh};
    HW_TRY(HW_NEW(&out->running, mesh->index_count / 3));
    for (uint32_t i = 0; i < mesh->index_count / 3; i++)
        out->running[i] = out->area += triangle_area(mesh, i);
    return HW_OK;
}

void hw_surface_sampler_free(hw_surface_sampler *sampler)
{
    hw_free(sampler->running);
    *sampler = (hw_surface_sampler){0};
}

hw_surface_walk hw_surface_walk_start(const hw_surface_sampler *sampler, uint64_t count, hw_rng rng)
{
    return (hw_surface_walk){
        .sampler = sampler, .count = sampler->area > 0 ? count : 0, .rng = rng};
}

static hw_vec3 random_point(const hw_mesh *mesh, uint32_t triangle, hw_rng *rng)
{
    const uint32_t *t = mesh->indices + 3 * (size_t)triangle;
    hw_vec3 a = mesh->positions[t[0]], b = mesh->positions[t[1]], c = mesh->positions[t[2]];
    float r = sqrtf(hw_rng_float(rng)), s = hw_rng_float(rng); // uniform over the triangle
    hw_vec3 p = hw_v3_scale(a, 1 - r);
    return hw_v3_mad(hw_v3_mad(p, b, r * (1 - s)), c, r * s);
}

bool hw_surface_walk_next(hw_surface_walk *walk, hw_vec3 *out)
{
    const hw_surface_sampler *sampler = walk->sampler;
    if (walk->next == walk->count)
        return false;
    double part = (double)walk->next + (double)hw_rng_float(&walk->rng);
    double place = part / (double)walk->count * sampler->area;
    while (sampler->running[walk->triangle] <= place &&
           walk->triangle + 1 < sampler->mesh->index_count / 3)
        walk->triangle++;
    *out = random_point(sampler->mesh, walk->triangle, &walk->rng);
    walk->next++;
    return true;
}
