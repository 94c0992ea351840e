// Boxes that lie wholly inside a closed mesh: they hide what the mesh hides, or less, and a ray
// meets or misses them at a small part of the cost.
#pragma once
#include "mesh.h"

#define HW_INNER_BOXES_MAX 4u

typedef struct hw_inner_boxes {
    hw_box boxes[HW_INNER_BOXES_MAX];
    uint32_t count;
} hw_inner_boxes;

// Finds the largest boxes, parallel to the mesh's axes, that neither meet its surface nor can be
// reached from outside of it, each as large as it adds to those before. None if the mesh is thin
// everywhere, or so far from the origin that its coordinates are too coarse to tell. The mesh must
// be closed. Deterministic. Any thread; on failure *out has none.
HW_MUST_USE hw_status hw_inner_boxes_find(const hw_mesh *mesh, hw_inner_boxes *out);
// Moves the sides of such boxes out to the surface, along the longest axis of each first, but for
// the ten thousandth part of the mesh's diagonal: voxels leave room there.
void hw_inner_boxes_fit(const hw_mesh *mesh, hw_inner_boxes *boxes);

// Whether a mesh encloses what it holds: every edge is used as often in one direction as in the
// other, and the volume is positive.
HW_MUST_USE hw_status hw_mesh_is_solid(const hw_mesh *mesh, bool *out);
