// The statues of the park: which file each comes from, how to stand it upright facing +y, and the
// repairs it needs.
#pragma once
#include "mesh.h"

typedef struct hw_statue {
    const char *name; // "dragon", "bunny", ...
    const char *file; // below the folder that tools/fetch-statues fills
    float up[3];      // the file's direction that becomes +z
    float front[3];   // the file's direction that becomes +y; made orthogonal to up
} hw_statue;

// The table; *count gets its length. Static storage.
const hw_statue *hw_statue_table(uint32_t *count);
// NULL if unknown.
const hw_statue *hw_statue_find(const char *name);
// Whether the statue's file lies in the folder.
bool hw_statue_available(const hw_statue *statue, const char *folder);
// Loads, welds, drops degenerate faces and flaps, orients outward, closes holes (necks of busts,
// small defects), stands it upright on z = 0, centred on the z axis; normals computed, no colours.
// Units are those of the file. HW_NOT_FOUND names the missing file and tells of
// tools/fetch-statues. The caller frees *out with hw_mesh_free.
HW_MUST_USE hw_status hw_statue_load(const hw_statue *statue, const char *folder, hw_mesh *out);
// Drops pairs of triangles back to back: leaves without thickness that crude decimation leaves
// behind, and that make edges non-manifold. Vertices stay.
HW_MUST_USE hw_status hw_statue_drop_flaps(hw_mesh *mesh);
// Fills every hole of a consistently wound mesh: a triangle, or a fan round a new vertex in the
// middle of the hole's rim. Normals, colours and uvs must be absent.
HW_MUST_USE hw_status hw_statue_close_holes(hw_mesh *mesh);
