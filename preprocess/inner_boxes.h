// Boxes that lie wholly inside a closed mesh: they hide what the mesh hides, or less, and a ray
// meets or misses them at a small part of the cost.
#pragma once
#include "mesh.h"

#define HW_INNER_BOXES_MAX 4u

// Finds the largest boxes, parallel to the mesh's axes, that neither meet its surface nor can be
// reached from outside of it: at most HW_INNER_BOXES_MAX, each as large as it adds to those
// before. None if the mesh is thin everywhere. The mesh must be closed. Deterministic.
HW_MUST_USE hw_status hw_inner_boxes(const hw_mesh *mesh, hw_box boxes[HW_INNER_BOXES_MAX],
                                     uint32_t *count);
