#include "pull_back.h"
#include "alloc.h"
#include "parallel.h"

#define BLOCK 1024 // vertices handed out at a time

typedef struct pull {
    hw_mesh *mesh;
    const hw_mesh *original;
    const hw_rays *rays;
    float part;
} pull;

static hw_color8 color_at(const hw_mesh *mesh, const hw_closest *at)
{
    const uint32_t *t = mesh->indices + 3 * (size_t)at->triangle_idx;
    float w[3] = {1 - at->u - at->v, at->u, at->v}, sum[4] = {0.5f, 0.5f, 0.5f, 0.5f};
    for (int i = 0; i < 3; i++) {
        hw_color8 c = mesh->colors[t[i]];
        sum[0] += w[i] * c.r;
        sum[1] += w[i] * c.g;
        sum[2] += w[i] * c.b;
        sum[3] += w[i] * c.a;
    }
    for (int i = 0; i < 4; i++)
        sum[i] = fminf(fmaxf(sum[i], 0), 255);
    return (hw_color8){(uint8_t)sum[0], (uint8_t)sum[1], (uint8_t)sum[2], (uint8_t)sum[3]};
}

static hw_status pull_block(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    const pull *job = context;
    hw_mesh *mesh = job->mesh;
    uint64_t first = index * BLOCK, last = first + BLOCK;
    if (last > mesh->vertex_count)
        last = mesh->vertex_count;
    for (uint64_t v = first; v < last; v++) {
        hw_closest at = hw_rays_closest(job->rays, mesh->positions[v], INFINITY);
        if (!(at.distance < INFINITY))
            continue;
        hw_vec3 way = hw_v3_sub(at.point, mesh->positions[v]);
        mesh->positions[v] = hw_v3_mad(mesh->positions[v], way, job->part);
        if (mesh->colors)
            mesh->colors[v] = color_at(job->original, &at);
    }
    return HW_OK;
}

hw_status hw_pull_back(hw_mesh *mesh, const hw_mesh *original, const hw_rays *rays, float part,
                       uint32_t threads)
{
    pull job = {mesh, original, rays, part};
    if (original->colors && !mesh->colors)
        HW_TRY(HW_NEW(&mesh->colors, mesh->vertex_count));
    if (!original->colors) {
        hw_free(mesh->colors);
        mesh->colors = NULL;
    }
    uint64_t blocks = (mesh->vertex_count + (uint64_t)BLOCK - 1) / BLOCK;
    return hw_parallel_for(blocks, threads, pull_block, &job, NULL);
}
