// Reading scenes and meshes through Assimp (import.c is the only file that includes it).
#pragma once
#include "scene.h"

// Reads glTF/GLB, PLY, OBJ, OFF, STL, 3DS, ... Instancing is kept (equal meshes are stored once, an
// object per node and mesh), vertex colours and base-colour textures too (embedded or beside the
// file). Y-up formats (glTF) are turned to z-up; a node named HW_GROUND_NAME becomes scene->ground.
// Meshes without normals get smooth ones. Lines and points are ignored. The result is validated.
// Errors name the file and the cause: missing, empty, not a model, NaN, index out of range, no
// triangle.
HW_MUST_USE hw_status hw_scene_import(const char *path, hw_scene *out);
// Reads a file and merges everything in it into one mesh in world space (positions and triangles;
// colours where there), cleaned.
HW_MUST_USE hw_status hw_mesh_import(const char *path, hw_mesh *out);
