// Which objects a group of cells (a cell of level 1 or more) stands for: what is far enough from
// the group is stored with it, once, instead of with each of its cells.
#pragma once
#include "svmesh.h"

// Remembers what was found for the group of each level that was asked for last: have one per
// thread, and take the cells of a group one after the other.
typedef struct hw_groups hw_groups;

// Borrows everything. `chains` are those of the scene's meshes.
HW_MUST_USE hw_status hw_groups_create(const hw_hexgrid *grid, const hw_scene *scene,
                                       const hw_chain *chains, const hw_far_options *far,
                                       hw_groups **out);
void hw_groups_destroy(hw_groups *groups);

// Whether the object is the cell's to draw: no group above serves it, and a group serves it itself.
// Each object is thus drawn from one level at any view point. NULL as the groups: there are none.
bool hw_groups_leave_to(hw_groups *groups, hw_cell_id cell, uint32_t object_idx);
