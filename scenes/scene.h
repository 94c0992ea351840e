// A scene: meshes stored once, objects that place them, a ground, the light. z is up, the ground is
// the x-y plane.
#pragma once
#include "image.h"
#include "mesh.h"

typedef struct hw_material {
    char *name;
    float base_color[3]; // multiplies texture and vertex colour
    hw_image texture;    // base-colour texture, data NULL if none
} hw_material;

typedef struct hw_object {
    uint32_t mesh_idx, material_idx;
    hw_mat4 transform; // mesh to world; affine
    hw_box bounds;     // world space
} hw_object;

typedef struct hw_ground {
    bool present;
    hw_box rect; // x and y extents; z is rect.min.z
    float color[3];
} hw_ground;

typedef struct hw_scene {
    char *path; // where it came from
    uint32_t mesh_count, material_count, object_count;
    hw_mesh *meshes;
    hw_material *materials;
    hw_object *objects;
    hw_ground
        ground; // a glTF node named HW_GROUND_NAME; drawn by every configuration, never an object
} hw_scene;

#define HW_GROUND_NAME "hexwalk-ground"

void hw_scene_free(hw_scene *scene);
// Recomputes each object's bounds from its mesh's vertices and transform (exact, not the box of a
// box).
void hw_scene_update_bounds(hw_scene *scene);
// Union of the objects' bounds.
hw_box hw_scene_bounds(const hw_scene *scene);
// Triangles of all objects (instances counted each).
uint64_t hw_scene_triangle_count(const hw_scene *scene);
// Hash of everything that a build depends on.
uint64_t hw_scene_hash(const hw_scene *scene);
// HW_FORMAT naming path and cause: no object, a bad mesh, indices out of range, transforms that are
// not finite.
HW_MUST_USE hw_status hw_scene_validate(const hw_scene *scene);
