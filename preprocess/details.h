// What captures are cast against: the meshes of a scene, or, of objects far away, levels of their
// chains that look the same from there. A ray then costs by what is seen, not by what is stored,
// and finds in the cache what its neighbours have used.
#pragma once
#include "budget.h"

typedef struct hw_details hw_details;

// A mesh to cast against: through `rays`, as their mesh `mesh_idx`.
typedef struct hw_detail {
    const hw_mesh *mesh;
    const hw_rays *rays;
    uint32_t mesh_idx;
} hw_detail;

// Borrows the scene, its rays, the chains of its meshes and the budget (NULL: no bound). Trees of
// levels are made when they are pinned.
HW_MUST_USE hw_status hw_details_create(const hw_scene *scene, const hw_rays *scene_rays,
                                        const hw_chain *chains, hw_budget *budget,
                                        hw_details **out);
void hw_details_destroy(hw_details *details);

// Trees of levels built so far. Thread-safe.
uint64_t hw_details_builds(const hw_details *details);

// The coarsest detail of a mesh whose error (hw_mesh_level_error) is at most `error`, mesh units;
// the original if none is. Thread-safe.
hw_detail hw_details_choose(const hw_details *details, uint32_t mesh_idx, double error);
