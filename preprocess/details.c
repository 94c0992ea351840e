#include "details.h"
#include "alloc.h"

// Every so many-th level of a chain is a detail: each has half the faces of the one before. Levels
// between those that are drawn have no fitted shading.
#define STRIDE 4u
_Static_assert(STRIDE % HW_NEAR_LEVEL_STRIDE == 0, "details are shaded as near levels are");

struct hw_details {
    const hw_scene *scene;
    const hw_rays *scene_rays;
    const hw_chain *chains; // per mesh of the scene
    hw_scene levels;        // no objects; its meshes are borrowed from the chains
    uint32_t *first;        // per mesh of the scene: its first detail among `levels`
    hw_rays *rays;          // of `levels`
};

// Seams cannot be kept, so a mesh with uvs has no other levels that look like it.
static uint32_t detail_count(const hw_chain *chain)
{
    return chain->levels[0].uvs ? 0 : (chain->level_count - 1) / STRIDE;
}

static hw_status list_levels(hw_details *d)
{
    uint32_t count = 0;
    HW_TRY(HW_NEW(&d->first, d->scene->mesh_count));
    for (uint32_t i = 0; i < d->scene->mesh_count; i++) {
        d->first[i] = count;
        count += detail_count(&d->chains[i]);
    }
    HW_TRY(HW_NEW(&d->levels.meshes, count));
    for (uint32_t i = 0; i < d->scene->mesh_count; i++)
        for (uint32_t k = 1; k <= detail_count(&d->chains[i]); k++)
            d->levels.meshes[d->levels.mesh_count++] = d->chains[i].levels[k * STRIDE];
    return HW_OK;
}

hw_status hw_details_create(const hw_scene *scene, const hw_rays *scene_rays,
                            const hw_chain *chains, hw_budget *budget, hw_details **out)
{
    hw_status status = HW_OK;
    hw_details *d = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&d, 1));
    *d = (hw_details){.scene = scene, .scene_rays = scene_rays, .chains = chains};
    HW_GO(list_levels(d));
    HW_GO(budget ? hw_budget_create_rays(budget, &d->levels, &d->rays)
                 : hw_rays_create_paged(&d->rays, &d->levels, NULL));
    *out = d;
    d = NULL;
out:
    hw_details_destroy(d);
    return status;
}

void hw_details_destroy(hw_details *d)
{
    if (!d)
        return;
    hw_rays_destroy(d->rays);
    hw_free(d->levels.meshes);
    hw_free(d->first);
    hw_free(d);
}

uint64_t hw_details_builds(const hw_details *d)
{
    return hw_rays_builds(d->rays);
}

hw_detail hw_details_choose(const hw_details *d, uint32_t mesh_idx, double error)
{
    const hw_chain *chain = &d->chains[mesh_idx];
    uint32_t k =
        detail_count(chain) > 0 ? hw_chain_level_to_draw(chain, STRIDE, error) / STRIDE : 0;
    if (k == 0)
        return (hw_detail){&d->scene->meshes[mesh_idx], d->scene_rays, mesh_idx};
    uint32_t place = d->first[mesh_idx] + k - 1;
    return (hw_detail){&d->levels.meshes[place], d->rays, place};
}
