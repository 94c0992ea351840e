#include "groups.h"
#include "alloc.h"
#include "hierarchy.h"
#include <string.h>

// A group of cells stands for an object from this many of its sides away.
#define GROUP_DISTANCE 2.0
// A capture is at most this much larger than the object's angle tells: windows lie askew, and the
// nearest viewer counts.
#define GROUP_WINDOW 2.0

enum { UNKNOWN, SERVED, LEFT };

// The group of a level that was asked for last.
typedef struct group {
    hw_cell_view view;
    uint8_t *answers; // per object; NULL: none was asked for yet
} group;

struct hw_groups {
    const hw_hexgrid *grid;
    const hw_scene *scene;
    const hw_chain *chains;
    const hw_far_options *far;
    group levels[HW_CELL_LEVELS_MAX];
};

hw_status hw_groups_create(const hw_hexgrid *grid, const hw_scene *scene, const hw_chain *chains,
                           const hw_far_options *far, hw_groups **out)
{
    hw_status status = HW_OK;
    hw_groups *groups = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&groups, 1));
    *groups = (hw_groups){.grid = grid, .scene = scene, .chains = chains, .far = far};
    for (int32_t l = 1; l < grid->levels; l++) {
        HW_GO(HW_NEW(&groups->levels[l].answers, scene->object_count));
        groups->levels[l].view.id.level = -1; // none yet
    }
    *out = groups;
    groups = NULL;
out:
    hw_groups_destroy(groups);
    return status;
}

void hw_groups_destroy(hw_groups *groups)
{
    if (!groups)
        return;
    for (int32_t l = 0; l < HW_CELL_LEVELS_MAX; l++)
        hw_free(groups->levels[l].answers);
    hw_free(groups);
}

// Whether the object is flat from the group's cells but not from the group: then it stays with
// them, where a relief costs less than the group's mesh.
static bool is_flat_from_cells_only(const hw_groups *groups, const hw_cell_view *view,
                                    uint32_t object_idx)
{
    const hw_object *object = &groups->scene->objects[object_idx];
    const hw_svmesh_job job = {.view = view,
                               .scene = groups->scene,
                               .chain = &groups->chains[object->mesh_idx],
                               .object_idx = object_idx};
    double flat = groups->far->impostor_px;
    return hw_svmesh_self_occlusion_bound(view, groups->grid->cell_size, object->bounds) < flat &&
           hw_svmesh_self_occlusion(&job, flat) >= flat;
}

// Whether a group stands for an object, for all the cells that it groups. Told from the group and
// the object alone, so that every cell comes to the same answer without deriving anything; an
// object that passes can be derived from the group: it lies two cell sides away at least (on the
// map: captures look along it), its self-occluding error stays below the limit however it is
// shaped, and its capture is not too large.
static bool serves(const hw_groups *groups, const hw_cell_view *view, uint32_t object_idx)
{
    hw_box box = groups->scene->objects[object_idx].bounds, level = box;
    level.max.z = fmaxf(box.max.z, (float)view->grid->z_min); // as if at the eyes' heights
    level.min.z = fminf(box.min.z, (float)view->grid->z_max);
    double nearest = hw_region_nearest(view->grid, view->id, level);
    if (nearest < GROUP_DISTANCE * view->size)
        return false;
    double angle = (double)hw_box_diagonal(box) / nearest;
    double high =
        fmax((double)box.max.z - view->grid->z_min, view->grid->z_max - (double)box.min.z);
    angle *= fmax(1, GROUP_WINDOW * high / nearest); // the picture plane is upright
    return hw_svmesh_self_occlusion_bound(view, view->size, box) < groups->far->self_occlusion_px &&
           GROUP_WINDOW * angle * view->focal_px < groups->far->capture_side_max &&
           !is_flat_from_cells_only(groups, view, object_idx);
}

static bool ask(hw_groups *groups, hw_cell_id id, uint32_t object_idx)
{
    group *g = &groups->levels[id.level];
    if (hw_cell_compare(g->view.id, id) != 0) {
        g->view = hw_cell_view_make(groups->grid, id);
        memset(g->answers, UNKNOWN, groups->scene->object_count);
    }
    uint8_t *answer = &g->answers[object_idx];
    if (*answer == UNKNOWN)
        *answer = serves(groups, &g->view, object_idx) ? SERVED : LEFT;
    return *answer == SERVED;
}

bool hw_groups_leave_to(hw_groups *groups, hw_cell_id cell, uint32_t object_idx)
{
    if (!groups)
        return true;
    for (int32_t l = cell.level + 1; l < groups->grid->levels; l++)
        if (ask(groups, hw_cell_ancestor(cell, l), object_idx))
            return false;
    return cell.level == 0 || ask(groups, cell, object_idx);
}
