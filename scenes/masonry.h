// What courts are divided by: walls, hedges, colonnades, and the piers between them. Meshes of
// closed surfaces that lie along the x axis, centred on the z axis, and stand on z = 0.
#pragma once
#include "mesh.h"

typedef enum hw_masonry {
    HW_MASONRY_WALL,      // with a coping
    HW_MASONRY_HEDGE,     // clipped, bumpy
    HW_MASONRY_COLONNADE, // columns on a step, under an architrave: one sees through
    HW_MASONRY_PIER,      // with a ball on top; as wide as deep, `length` is ignored
    HW_MASONRY_COUNT
} hw_masonry;

// A piece to be set beside others at every `length` units (> 0), named after kind and length;
// positions and normals. Deterministic. The caller frees *out with hw_mesh_free.
HW_MUST_USE hw_status hw_masonry_make(hw_masonry kind, double length, hw_mesh *out);
