// Meshes whose properties are known, for the tests of this folder.
#pragma once
#include "mesh.h"
#include "rng.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define assert_ok(expression)                                                                      \
    do {                                                                                           \
        hw_status assert_status = (expression);                                                    \
        if (assert_status != HW_OK)                                                                \
            fail_msg("%s", hw_error_text());                                                       \
    } while (0)

// In double precision, unlike cmocka's assert_float_equal.
#define assert_close(a, b, tolerance)                                                              \
    do {                                                                                           \
        double close_a = (a), close_b = (b);                                                       \
        if (!(fabs(close_a - close_b) <= (tolerance)))                                             \
            fail_msg("%.17g is not %.17g", close_a, close_b);                                      \
    } while (0)

// Copies positions and indices.
static inline hw_mesh sample_mesh(const char *name, const hw_vec3 *positions, uint32_t vertices,
                                  const uint32_t *indices, uint32_t index_count)
{
    hw_mesh mesh = {.vertex_count = vertices, .index_count = index_count};
    assert_ok(hw_strdup(&mesh.name, name));
    assert_ok(HW_NEW(&mesh.positions, vertices));
    assert_ok(HW_NEW(&mesh.indices, index_count));
    memcpy(mesh.positions, positions, vertices * sizeof *positions);
    memcpy(mesh.indices, indices, index_count * sizeof *indices);
    return mesh;
}

// The cube [-1, 1]^3, outward; volume 8.
static inline hw_mesh sample_cube(void)
{
    hw_vec3 positions[8];
    hw_box box = {{-1, -1, -1}, {1, 1, 1}};
    for (uint32_t i = 0; i < 8; i++)
        positions[i] = hw_box_corner(box, i);
    static const uint32_t indices[36] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                         2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    return sample_mesh("cube", positions, 8, indices, 36);
}

// The octahedron of radius 1, outward; volume 4/3.
static inline hw_mesh sample_octahedron(void)
{
    static const hw_vec3 positions[6] = {{1, 0, 0},  {-1, 0, 0}, {0, 1, 0},
                                         {0, -1, 0}, {0, 0, 1},  {0, 0, -1}};
    static const uint32_t indices[24] = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4,
                                         2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
    return sample_mesh("octahedron", positions, 6, indices, 24);
}

// Gives every corner of every triangle a vertex of its own.
static inline hw_mesh sample_exploded(const hw_mesh *mesh)
{
    hw_mesh out = {.vertex_count = mesh->index_count, .index_count = mesh->index_count};
    assert_ok(hw_strdup(&out.name, mesh->name));
    assert_ok(HW_NEW(&out.positions, out.vertex_count));
    assert_ok(HW_NEW(&out.indices, out.index_count));
    for (uint32_t i = 0; i < mesh->index_count; i++) {
        out.positions[i] = mesh->positions[mesh->indices[i]];
        out.indices[i] = i;
    }
    return out;
}

// Each triangle in four, new vertices pushed out to the unit sphere, `times` times; unshared
// vertices welded at the end.
static inline hw_mesh sample_sphere(int times)
{
    hw_mesh mesh = sample_octahedron();
    for (int t = 0; t < times; t++) {
        hw_mesh fine = {.vertex_count = 4 * mesh.index_count, .index_count = 4 * mesh.index_count};
        assert_ok(hw_strdup(&fine.name, "sphere"));
        assert_ok(HW_NEW(&fine.positions, fine.vertex_count));
        assert_ok(HW_NEW(&fine.indices, fine.index_count));
        for (uint32_t i = 0; i < mesh.index_count; i += 3) {
            hw_vec3 p[6];
            for (int k = 0; k < 3; k++) {
                p[k] = mesh.positions[mesh.indices[i + k]];
                hw_vec3 q = mesh.positions[mesh.indices[i + (k + 1) % 3]];
                p[3 + k] = hw_v3_normalize(hw_v3_add(p[k], q));
            }
            static const int corners[12] = {0, 3, 5, 3, 1, 4, 5, 4, 2, 3, 4, 5};
            for (uint32_t k = 0; k < 12; k++)
                fine.positions[4 * i + k] = p[corners[k]];
        }
        for (uint32_t i = 0; i < fine.index_count; i++)
            fine.indices[i] = i;
        hw_mesh_free(&mesh);
        assert_ok(hw_mesh_weld(&fine));
        mesh = fine;
    }
    return mesh;
}

// Appends b to a, moved by `offset`.
static inline void sample_append(hw_mesh *a, const hw_mesh *b, hw_vec3 offset)
{
    uint32_t v = a->vertex_count, n = a->index_count;
    assert_ok(HW_RESIZE(&a->positions, v + b->vertex_count));
    assert_ok(HW_RESIZE(&a->indices, n + b->index_count));
    for (uint32_t i = 0; i < b->vertex_count; i++)
        a->positions[v + i] = hw_v3_add(b->positions[i], offset);
    for (uint32_t i = 0; i < b->index_count; i++)
        a->indices[n + i] = v + b->indices[i];
    a->vertex_count += b->vertex_count;
    a->index_count += b->index_count;
}

static inline void sample_flip(hw_mesh *mesh, uint32_t triangle)
{
    uint32_t *t = mesh->indices + 3 * triangle, second = t[1];
    t[1] = t[2];
    t[2] = second;
}

static inline void sample_flip_some(hw_mesh *mesh, uint64_t seed)
{
    hw_rng rng = hw_rng_make(seed, 0);
    for (uint32_t i = 0; i < mesh->index_count / 3; i++)
        if (hw_rng_u32(&rng) & 1)
            sample_flip(mesh, i);
}
