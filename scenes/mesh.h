// Indexed triangle meshes and the repairs that imported ones need.
#pragma once
#include "alloc.h"
#include "status.h"
#include "vec.h"
#include <stdbool.h>

typedef struct hw_color8 {
    uint8_t r, g, b, a;
} hw_color8;

typedef struct hw_uv {
    float u, v; // v = 0 is the top row of the image, as in glTF
} hw_uv;

// Counter-clockwise front faces. positions is always there; the others may be NULL. The mesh owns
// its arrays.
typedef struct hw_mesh {
    char *name;
    uint32_t vertex_count, index_count; // index_count is a multiple of 3
    hw_vec3 *positions;
    hw_vec3 *normals;  // unit length
    hw_color8 *colors; // multiplies the material's colour; holds baked ambient occlusion
    hw_uv *uvs;
    uint32_t *indices;
} hw_mesh;

// Largest magnitude of a coordinate: beyond it, areas and squared lengths overflow a float.
#define HW_COORDINATE_MAX 1e9f

// Frees the arrays and zeroes the struct; NULL is legal.
void hw_mesh_free(hw_mesh *mesh);
// On failure *out is zeroed.
HW_MUST_USE hw_status hw_mesh_copy(const hw_mesh *mesh, hw_mesh *out);
// Of all vertices, referenced or not; empty without vertices.
hw_box hw_mesh_bounds(const hw_mesh *mesh);
// Hash of everything but the name: equal meshes are stored once.
uint64_t hw_mesh_hash(const hw_mesh *mesh);
// Whether everything but the name is the same, bit by bit.
bool hw_mesh_equal(const hw_mesh *a, const hw_mesh *b);
// HW_FORMAT naming mesh and cause: no triangle, index out of range, an attribute that is NaN or
// infinite, a coordinate over HW_COORDINATE_MAX. Everything below expects a valid mesh.
HW_MUST_USE hw_status hw_mesh_validate(const hw_mesh *mesh);

// Area-weighted smooth vertex normals; allocates normals if NULL. Vertices with equal positions
// share one normal (so seams of uvs or colours do not show).
HW_MUST_USE hw_status hw_mesh_compute_normals(hw_mesh *mesh);
// Merges vertices that agree in every attribute and drops unreferenced ones; triangles are all
// kept. Vertices keep their order.
HW_MUST_USE hw_status hw_mesh_weld(hw_mesh *mesh);
// For each vertex the smallest index of a vertex with exactly the same position; `remap` holds
// vertex_count values.
HW_MUST_USE hw_status hw_mesh_weld_map(const hw_mesh *mesh, uint32_t *remap);
// hw_mesh_weld, then drops triangles of zero area, repeated triangles (same positions in the same
// cyclic order; the first is kept) and unreferenced vertices. May leave no triangle at all.
HW_MUST_USE hw_status hw_mesh_clean(hw_mesh *mesh);
// Makes the winding of each edge-connected component consistent and outward (positive volume).
// Works on welded positions; non-manifold edges stop the flood. Open components are judged by their
// volume about their own centroid. Normals, if there, are recomputed when a triangle was turned.
HW_MUST_USE hw_status hw_mesh_orient(hw_mesh *mesh);
// Signed volume (of a closed mesh).
double hw_mesh_volume(const hw_mesh *mesh);
// Sum of the triangles' areas.
double hw_mesh_area(const hw_mesh *mesh);
// Transforms positions and normals in place (a mirror flips the winding).
void hw_mesh_transform(hw_mesh *mesh, const hw_mat4 *matrix);
