// Ray casting and closest-point queries on scenes and meshes (Embree 3; rays.c is the only file
// that includes it). Committed once, then read-only: every query is thread-safe.
#pragma once
#include "scene.h"

typedef struct hw_rays hw_rays;

// One mesh in its own space. Borrows the mesh.
HW_MUST_USE hw_status hw_rays_create_mesh(hw_rays **out, const hw_mesh *mesh);
// A whole scene, instanced: hits give the object. Borrows the scene.
HW_MUST_USE hw_status hw_rays_create_scene(hw_rays **out, const hw_scene *scene);

// Who is asked for memory before the tree of a mesh is built, and told once it stands.
typedef struct hw_rays_memory {
    void *context;
    hw_status (*reserve)(void *context, uint64_t bytes); // about what the build needs at its peak
    void (*release)(void *context, uint64_t bytes);
} hw_rays_memory;
// What is reserved for one mesh.
uint64_t hw_rays_build_bytes(const hw_mesh *mesh);
// A whole scene, of which a mesh's tree is built when it is pinned and may go when it is not. The
// hits on an object are those of hw_rays_create_scene; there is no tree of all objects, so
// hw_rays_cast and hw_rays_occluded must not be called. Borrows the scene. `memory` may be NULL:
// there is enough.
HW_MUST_USE hw_status hw_rays_create_paged(hw_rays **out, const hw_scene *scene,
                                           const hw_rays_memory *memory);
// Before and after rays are cast against a mesh or its objects: its tree stays meanwhile. Nothing
// to do but with paged scenes. Thread-safe.
HW_MUST_USE hw_status hw_rays_pin(const hw_rays *rays, uint32_t mesh_idx);
void hw_rays_unpin(const hw_rays *rays, uint32_t mesh_idx);
// Frees the least recently used tree that is not pinned; false if there is none. Thread-safe.
bool hw_rays_evict(hw_rays *rays);
// How many pins are held. Thread-safe.
uint32_t hw_rays_pins(const hw_rays *rays);
// Trees built so far. Thread-safe.
uint64_t hw_rays_builds(const hw_rays *rays);
void hw_rays_destroy(hw_rays *rays);
// The mesh of hw_rays_create_mesh, NULL for a scene.
const hw_mesh *hw_rays_mesh(const hw_rays *rays);

typedef struct hw_hit {
    float t; // distance in units of the direction's length; INFINITY = none
    uint32_t object_idx, triangle_idx; // object_idx 0 for a mesh
    float u, v;                        // barycentric: p = (1 - u - v) a + u b + v c
} hw_hit;

// Whether a ray in this direction meets the triangle's front, for rays of the scene.
bool hw_hit_is_front(const hw_scene *scene, const hw_hit *hit, hw_vec3 direction);

// Nearest hit along origin + t direction, t in [t_min, t_max].
hw_hit hw_rays_cast(const hw_rays *rays, hw_vec3 origin, hw_vec3 direction, float t_min,
                    float t_max);
// `count` rays of one origin against the whole scene, t in [t_min, INFINITY), in packets of 16:
// fastest where each run of 16 directions lies close together. hits holds `count`.
void hw_rays_cast_many(const hw_rays *rays, hw_vec3 origin, const hw_vec3 *directions,
                       uint32_t count, float t_min, hw_hit *hits);
// The same as hw_rays_cast against one object of a scene only (through its own mesh; not occluded
// by others).
hw_hit hw_rays_cast_object(const hw_rays *rays, uint32_t object_idx, hw_vec3 origin,
                           hw_vec3 direction, float t_min, float t_max);
// `count` rays of one origin against one mesh of a scene, in its own space, t in [0, INFINITY): in
// packets, up to twice as fast. `coherent` promises that neighbouring directions mostly meet the
// same triangles or near ones (it is only a hint for speed). hits holds `count`; their object_idx
// is 0.
void hw_rays_cast_mesh_many(const hw_rays *rays, uint32_t mesh_idx, hw_vec3 origin,
                            const hw_vec3 *directions, uint32_t count, bool coherent, hw_hit *hits);
// `count` rays of one direction against a mesh (hw_rays_create_mesh), t in [0, INFINITY), in
// packets of 16: fastest where each run of 16 origins lies close together. hits holds `count`.
void hw_rays_cast_parallel(const hw_rays *rays, const hw_vec3 *origins, hw_vec3 direction,
                           uint32_t count, hw_hit *hits);
// Whether anything lies on the segment.
bool hw_rays_occluded(const hw_rays *rays, hw_vec3 origin, hw_vec3 direction, float t_min,
                      float t_max);

// What of a scene hides, where not all does.
typedef struct hw_rays_hiders {
    const bool *solid;   // per mesh; false: hides from the front of its triangles only. NULL: all
    const bool *objects; // per object; false: hides nothing. NULL: all
} hw_rays_hiders;

// The most segments of one call of hw_rays_occluded_many.
#define HW_RAYS_PACKET 16u
// `count` segments (at most HW_RAYS_PACKET) from one origin against the scene or mesh, together:
// hidden[i] tells whether anything lies on origin + t directions[i], t in [0, t_max[i]]. `hiders`
// may be NULL, and is for a mesh.
void hw_rays_occluded_many(const hw_rays *rays, hw_vec3 origin, const hw_vec3 *directions,
                           const float *t_max, uint32_t count, const hw_rays_hiders *hiders,
                           bool *hidden);

typedef struct hw_closest {
    float distance; // INFINITY if nothing lies within the radius
    uint32_t triangle_idx;
    float u, v; // barycentric as above
    hw_vec3 point;
} hw_closest;
// Closest surface point of a mesh (hw_rays_create_mesh) within radius.
hw_closest hw_rays_closest(const hw_rays *rays, hw_vec3 point, float radius);
