// Small meshes with known answers, for the tests of this layer. Failures to allocate end the test.
#pragma once
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include "alloc.h"
#include "mesh.h"
#include "scene.h"
#include <cmocka.h>
#include <string.h>

static inline hw_mesh shape_alloc(uint32_t vertex_count, uint32_t index_count)
{
    hw_mesh mesh = {.vertex_count = vertex_count, .index_count = index_count};
    assert_int_equal(hw_strdup(&mesh.name, "shape"), HW_OK);
    assert_int_equal(HW_NEW(&mesh.positions, vertex_count), HW_OK);
    assert_int_equal(HW_NEW(&mesh.normals, vertex_count), HW_OK);
    assert_int_equal(HW_NEW(&mesh.indices, index_count), HW_OK);
    return mesh;
}

// A closed sphere around `centre`: `rings` >= 2 bands of `segments` quads, poles at +-z; outward
// normals.
static inline hw_mesh shape_sphere(hw_vec3 centre, float radius, uint32_t segments, uint32_t rings)
{
    hw_mesh mesh = shape_alloc((rings - 1) * segments + 2, 6 * segments * (rings - 1));
    uint32_t south = mesh.vertex_count - 2, north = mesh.vertex_count - 1;
    for (uint32_t r = 1; r < rings; r++)
        for (uint32_t s = 0; s < segments; s++) {
            double latitude = HW_PI * r / rings - HW_PI / 2, longitude = 2 * HW_PI * s / segments;
            mesh.normals[(r - 1) * segments + s] =
                hw_v3((float)(cos(latitude) * cos(longitude)),
                      (float)(cos(latitude) * sin(longitude)), (float)sin(latitude));
        }
    mesh.normals[south] = hw_v3(0, 0, -1);
    mesh.normals[north] = hw_v3(0, 0, 1);
    for (uint32_t i = 0; i < mesh.vertex_count; i++)
        mesh.positions[i] = hw_v3_mad(centre, mesh.normals[i], radius);
    uint32_t *index = mesh.indices;
    for (uint32_t s = 0; s < segments; s++) {
        uint32_t next = (s + 1) % segments, top = (rings - 2) * segments;
        *index++ = south, *index++ = next, *index++ = s;
        *index++ = north, *index++ = top + s, *index++ = top + next;
        for (uint32_t r = 0; r + 2 < rings; r++) {
            uint32_t a = r * segments + s, b = r * segments + next;
            *index++ = a, *index++ = b, *index++ = b + segments;
            *index++ = a, *index++ = b + segments, *index++ = a + segments;
        }
    }
    return mesh;
}

// The rectangle origin + a u + b v, u, v in [0, 1], as nu x nv quads; normal a x b; uvs (u, v).
static inline hw_mesh shape_plane(hw_vec3 origin, hw_vec3 a, hw_vec3 b, uint32_t nu, uint32_t nv)
{
    hw_mesh mesh = shape_alloc((nu + 1) * (nv + 1), nu * nv * 6);
    assert_int_equal(HW_NEW(&mesh.uvs, mesh.vertex_count), HW_OK);
    hw_vec3 normal = hw_v3_normalize(hw_v3_cross(a, b));
    for (uint32_t j = 0; j <= nv; j++)
        for (uint32_t i = 0; i <= nu; i++) {
            uint32_t k = j * (nu + 1) + i;
            float u = (float)i / (float)nu, v = (float)j / (float)nv;
            mesh.positions[k] = hw_v3_mad(hw_v3_mad(origin, a, u), b, v);
            mesh.normals[k] = normal;
            mesh.uvs[k] = (hw_uv){u, v};
        }
    uint32_t *index = mesh.indices;
    for (uint32_t j = 0; j < nv; j++)
        for (uint32_t i = 0; i < nu; i++) {
            uint32_t k = j * (nu + 1) + i;
            *index++ = k, *index++ = k + 1, *index++ = k + nu + 2;
            *index++ = k, *index++ = k + nu + 2, *index++ = k + nu + 1;
        }
    return mesh;
}

// A box with eight shared vertices, normals along the diagonals; `inward` turns it inside out.
static inline hw_mesh shape_box(hw_box box, bool inward)
{
    static const uint8_t quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                        {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    hw_mesh mesh = shape_alloc(8, 36);
    for (uint32_t i = 0; i < 8; i++) {
        mesh.positions[i] = hw_box_corner(box, i);
        hw_vec3 n = hw_v3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
        mesh.normals[i] = hw_v3_scale(hw_v3_normalize(n), inward ? -1 : 1);
    }
    uint32_t *index = mesh.indices;
    for (uint32_t f = 0; f < 6; f++) {
        uint32_t a = quads[f][0], b = quads[f][1], c = quads[f][2], d = quads[f][3];
        *index++ = a, *index++ = inward ? c : b, *index++ = inward ? b : c;
        *index++ = a, *index++ = inward ? d : c, *index++ = inward ? c : d;
    }
    return mesh;
}

// Appends b to a and frees b; both have positions and normals alone.
static inline void shape_append(hw_mesh *a, hw_mesh *b)
{
    uint32_t vertices = a->vertex_count, indices = a->index_count;
    assert_int_equal(HW_RESIZE(&a->positions, vertices + b->vertex_count), HW_OK);
    assert_int_equal(HW_RESIZE(&a->normals, vertices + b->vertex_count), HW_OK);
    assert_int_equal(HW_RESIZE(&a->indices, indices + b->index_count), HW_OK);
    memcpy(a->positions + vertices, b->positions, b->vertex_count * sizeof *b->positions);
    memcpy(a->normals + vertices, b->normals, b->vertex_count * sizeof *b->normals);
    for (uint32_t i = 0; i < b->index_count; i++)
        a->indices[indices + i] = vertices + b->indices[i];
    a->vertex_count += b->vertex_count;
    a->index_count += b->index_count;
    hw_free(a->uvs);
    a->uvs = NULL;
    hw_mesh_free(b);
}

// A scene that takes the meshes (moved in) and has one object per mesh, all of one white material.
static inline hw_scene shape_scene(hw_mesh *meshes, const hw_mat4 *transforms, uint32_t count)
{
    hw_scene scene = {.mesh_count = count, .material_count = 1, .object_count = count};
    assert_int_equal(HW_NEW(&scene.meshes, count), HW_OK);
    assert_int_equal(HW_NEW(&scene.materials, 1), HW_OK);
    assert_int_equal(HW_NEW(&scene.objects, count), HW_OK);
    for (int k = 0; k < 3; k++)
        scene.materials[0].base_color[k] = 1;
    for (uint32_t i = 0; i < count; i++) {
        scene.meshes[i] = meshes[i];
        meshes[i] = (hw_mesh){0};
        scene.objects[i].mesh_idx = i;
        scene.objects[i].transform = transforms[i];
    }
    hw_scene_update_bounds(&scene);
    return scene;
}
