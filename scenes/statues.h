// The statues of the park: which file each comes from, how to stand it upright facing +y, and the
// repairs it needs.
#pragma once
#include "mesh.h"

typedef struct hw_statue {
    const char *name; // "dragon", "bunny", ...
    const char *file; // below the folder that tools/fetch-statues fills
    float up[3];      // the file's direction that becomes +z
    float front[3];   // the file's direction that becomes +y
} hw_statue;

// The table; *count gets its length.
const hw_statue *hw_statue_table(uint32_t *count);
// NULL if unknown.
const hw_statue *hw_statue_find(const char *name);
// Loads, welds, drops degenerate faces, orients outward, stands it upright on z = 0, centred on the
// z axis; normals computed. HW_NOT_FOUND names the missing file and tells of tools/fetch-statues.
HW_MUST_USE hw_status hw_statue_load(const hw_statue *statue, const char *folder, hw_mesh *out);
