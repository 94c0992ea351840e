#include "lod_chain.h"
#include <meshoptimizer.h>
#include <string.h>

// Chains end where a level is this small, or when the simplifier is stuck.
#define SMALLEST_LEVEL_INDICES 36u
#define STUCK_RATIO            0.85

static hw_status gather(void **out, const void *array, size_t size, const uint32_t *remap,
                        uint32_t source_count, uint32_t count)
{
    if (!array)
        return HW_OK;
    HW_TRY(hw_alloc(out, count, size));
    for (uint32_t i = 0; i < source_count; i++) {
        if (remap[i] != UINT32_MAX)
            memcpy((uint8_t *)*out + remap[i] * size, (const uint8_t *)array + i * size, size);
    }
    return HW_OK;
}

hw_status hw_mesh_reorder(const hw_mesh *mesh, const uint32_t *indices, uint32_t index_count,
                          hw_mesh *out)
{
    hw_status status = HW_OK;
    uint32_t *remap = NULL;
    hw_mesh source = *mesh, made = {0};
    if (!mesh->normals)
        HW_GO(hw_mesh_compute_normals(&source));
    HW_GO(HW_NEW(&remap, mesh->vertex_count));
    HW_GO(HW_NEW(&made.indices, index_count));
    made.index_count = index_count;
    meshopt_optimizeVertexCache(made.indices, indices, index_count, mesh->vertex_count);
    made.vertex_count = (uint32_t)meshopt_optimizeVertexFetchRemap(remap, made.indices, index_count,
                                                                   mesh->vertex_count);
    for (uint32_t i = 0; i < index_count; i++)
        made.indices[i] = remap[made.indices[i]];
    uint32_t n = source.vertex_count, m = made.vertex_count;
    HW_GO(gather((void **)&made.positions, source.positions, sizeof *made.positions, remap, n, m));
    HW_GO(gather((void **)&made.normals, source.normals, sizeof *made.normals, remap, n, m));
    HW_GO(gather((void **)&made.colors, source.colors, sizeof *made.colors, remap, n, m));
    HW_GO(gather((void **)&made.uvs, source.uvs, sizeof *made.uvs, remap, n, m));
out:
    hw_free(remap);
    if (!mesh->normals)
        hw_free(source.normals);
    if (status != HW_OK)
        hw_mesh_free(&made);
    *out = made;
    return status;
}

hw_status hw_lod_chain_make(const hw_mesh *mesh, hw_lod_chain *out)
{
    hw_status status = HW_OK;
    uint32_t *indices = NULL;
    *out = (hw_lod_chain){0};
    const float *positions = &mesh->positions->x;
    const size_t stride = sizeof *mesh->positions;
    const float scale = meshopt_simplifyScale(positions, mesh->vertex_count, stride);
    HW_GO(HW_NEW(&indices, mesh->index_count));
    HW_GO(hw_mesh_reorder(mesh, mesh->indices, mesh->index_count, &out->levels[0].mesh));
    out->count = 1;
    size_t last = mesh->index_count;
    while (out->count < HW_LOD_LEVELS_MAX && last > SMALLEST_LEVEL_INDICES) {
        float error = 0;
        size_t target = last / 6 * 3;
        size_t got = meshopt_simplify(indices, mesh->indices, mesh->index_count, positions,
                                      mesh->vertex_count, stride, target, 1.0f, 0, &error);
        if (got == 0 || (double)got > STUCK_RATIO * (double)last)
            break;
        hw_lod_level *level = &out->levels[out->count];
        HW_GO(hw_mesh_reorder(mesh, indices, (uint32_t)got, &level->mesh));
        level->error = fmaxf(error * scale, out->levels[out->count - 1].error);
        out->count++;
        last = got;
    }
out:
    hw_free(indices);
    if (status != HW_OK)
        hw_lod_chain_free(out);
    return status;
}

void hw_lod_chain_free(hw_lod_chain *chain)
{
    if (!chain)
        return;
    for (uint32_t i = 0; i < HW_LOD_LEVELS_MAX; i++)
        hw_mesh_free(&chain->levels[i].mesh);
    *chain = (hw_lod_chain){0};
}

uint32_t hw_lod_chain_choose(const float *errors, uint32_t count, double error)
{
    uint32_t level = 0;
    while (level + 1 < count && errors[level + 1] <= error)
        level++;
    return level;
}
