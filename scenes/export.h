// Writing scenes as GLB: meshes' buffers are shared between materials (several glTF meshes on the
// same accessors), so instancing and the tint of each object survive in any viewer. z-up is turned
// to glTF's y-up by the root node.
#pragma once
#include "scene.h"

// Atomic (temporary name, rename). HW_FORMAT for an invalid scene, HW_LIMIT beyond GLB's 4 GiB. A
// scene exported and imported again is equal up to float rounding of transforms and texture
// coordinates; what no object uses is left out, and meshes and materials come back in the order of
// their first use.
HW_MUST_USE hw_status hw_scene_export_glb(const hw_scene *scene, const char *path);
// One mesh as binary PLY (positions, normals and colours if there, faces), for tools and debugging.
HW_MUST_USE hw_status hw_mesh_export_ply(const hw_mesh *mesh, const char *path);
