// Small scenes with known answers and an off-screen context, for the tests of this layer. Failures
// to allocate end the test.
#pragma once
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include "alloc.h"
#include "appearance.h"
#include "context.h"
#include "renderer.h"
#include "target.h"
#include <cmocka.h>
#include <string.h>

#define assert_ok(expression)                                                                      \
    do {                                                                                           \
        if ((expression) != HW_OK)                                                                 \
            fail_msg("%s: %s", #expression, hw_error_text());                                      \
    } while (0)

// Group fixtures: one context for all tests of a program.
static inline int model_context_open(void **state)
{
    const hw_context_desc desc = {.kind = HW_CONTEXT_OFFSCREEN, .width = 16, .height = 16};
    return hw_context_create(&desc, (hw_context **)state) == HW_OK ? 0 : -1;
}

static inline int model_context_close(void **state)
{
    hw_context_destroy(*state);
    return 0;
}

static inline hw_mesh model_mesh(uint32_t vertex_count, uint32_t index_count)
{
    hw_mesh mesh = {.vertex_count = vertex_count, .index_count = index_count};
    assert_ok(hw_strdup(&mesh.name, "model"));
    assert_ok(HW_NEW(&mesh.positions, vertex_count));
    assert_ok(HW_NEW(&mesh.normals, vertex_count));
    assert_ok(HW_NEW(&mesh.colors, vertex_count));
    assert_ok(HW_NEW(&mesh.indices, index_count));
    memset(mesh.colors, 255, vertex_count * sizeof *mesh.colors);
    return mesh;
}

// A parallelogram: corner, corner + a, corner + a + b, corner + b; facing along a x b. Corner i has
// uv (0,1), (1,1), (1,0), (0,0): v runs from the top, as images do.
static inline void model_face(hw_mesh *mesh, uint32_t face, hw_vec3 corner, hw_vec3 a, hw_vec3 b)
{
    static const uint32_t pattern[6] = {0, 1, 2, 0, 2, 3};
    hw_vec3 normal = hw_v3_normalize(hw_v3_cross(a, b));
    hw_vec3 *p = mesh->positions + (size_t)face * 4;
    p[0] = corner;
    p[1] = hw_v3_add(corner, a);
    p[2] = hw_v3_add(p[1], b);
    p[3] = hw_v3_add(corner, b);
    for (uint32_t i = 0; i < 4; i++)
        mesh->normals[face * 4 + i] = normal;
    for (uint32_t i = 0; i < 6; i++)
        mesh->indices[face * 6 + i] = face * 4 + pattern[i];
    if (mesh->uvs) {
        static const hw_uv uvs[4] = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
        memcpy(mesh->uvs + (size_t)face * 4, uvs, sizeof uvs);
    }
}

// A box round the origin with half sizes h: flat faces, 24 vertices, 12 triangles.
static inline hw_mesh model_box(hw_vec3 h)
{
    hw_mesh mesh = model_mesh(24, 36);
    hw_vec3 x = hw_v3(2 * h.x, 0, 0), y = hw_v3(0, 2 * h.y, 0), z = hw_v3(0, 0, 2 * h.z);
    model_face(&mesh, 0, hw_v3(-h.x, -h.y, h.z), x, y);
    model_face(&mesh, 1, hw_v3(-h.x, -h.y, -h.z), y, x);
    model_face(&mesh, 2, hw_v3(-h.x, -h.y, -h.z), x, z);
    model_face(&mesh, 3, hw_v3(-h.x, h.y, -h.z), z, x);
    model_face(&mesh, 4, hw_v3(h.x, -h.y, -h.z), y, z);
    model_face(&mesh, 5, hw_v3(-h.x, -h.y, -h.z), z, y);
    return mesh;
}

// A sphere of radius 1 round the origin with smooth normals and striped colours.
static inline hw_mesh model_sphere(uint32_t segments, uint32_t rings)
{
    hw_mesh mesh = model_mesh((rings - 1) * segments + 2, 6 * segments * (rings - 1));
    uint32_t south = mesh.vertex_count - 2, north = mesh.vertex_count - 1, n = 0;
    for (uint32_t r = 1; r < rings; r++) {
        for (uint32_t s = 0; s < segments; s++) {
            double a = HW_PI * r / rings - HW_PI / 2, b = 2 * HW_PI * s / segments;
            mesh.positions[(r - 1) * segments + s] =
                hw_v3((float)(cos(a) * cos(b)), (float)(cos(a) * sin(b)), (float)sin(a));
            mesh.colors[(r - 1) * segments + s].g = (uint8_t)(127 + 127 * sin(8 * b));
        }
    }
    mesh.positions[south] = hw_v3(0, 0, -1);
    mesh.positions[north] = hw_v3(0, 0, 1);
    memcpy(mesh.normals, mesh.positions, mesh.vertex_count * sizeof *mesh.normals);
    for (uint32_t s = 0; s < segments; s++) {
        uint32_t t = (s + 1) % segments, top = (rings - 2) * segments;
        const uint32_t caps[6] = {south, t, s, north, top + s, top + t};
        memcpy(mesh.indices + n, caps, sizeof caps);
        n += 6;
        for (uint32_t r = 0; r + 2 < rings; r++) {
            uint32_t a = r * segments + s, b = r * segments + t;
            const uint32_t quad[6] = {a, b, b + segments, a, b + segments, a + segments};
            memcpy(mesh.indices + n, quad, sizeof quad);
            n += 6;
        }
    }
    assert_int_equal(n, mesh.index_count);
    return mesh;
}

// A scene of mesh_count meshes and as many white materials; objects to be filled in.
static inline hw_scene model_scene(uint32_t mesh_count, uint32_t object_count)
{
    hw_scene scene = {
        .mesh_count = mesh_count, .material_count = mesh_count, .object_count = object_count};
    assert_ok(hw_strdup(&scene.path, "model scene"));
    assert_ok(HW_NEW(&scene.meshes, mesh_count));
    assert_ok(HW_NEW(&scene.materials, mesh_count));
    assert_ok(HW_NEW(&scene.objects, object_count));
    for (uint32_t i = 0; i < mesh_count; i++) {
        assert_ok(hw_strdup(&scene.materials[i].name, "white"));
        for (int k = 0; k < 3; k++)
            scene.materials[i].base_color[k] = 1;
    }
    for (uint32_t i = 0; i < object_count; i++)
        scene.objects[i].transform = hw_mat4_identity();
    return scene;
}

static inline hw_camera model_camera(hw_vec3 eye, hw_vec3 forward, uint32_t size)
{
    return (hw_camera){.eye = eye,
                       .forward = forward,
                       .up = hw_v3(0, 0, 1),
                       .fov_degrees = 60,
                       .width = size,
                       .height = size};
}

// One frame of a fresh renderer of A, B or L.
static inline hw_image model_render(hw_config config, const hw_scene *scene,
                                    const hw_camera *camera, double lod_error_px,
                                    hw_frame_stats *stats)
{
    hw_renderer *renderer = NULL;
    hw_target *target = NULL;
    hw_image image = {0};
    const hw_renderer_desc desc = {.config = config, .scene = scene, .lod_error_px = lod_error_px};
    assert_ok(hw_renderer_create(&desc, &renderer));
    assert_ok(hw_target_create(&target, camera->width, camera->height, 1));
    hw_target_bind(target);
    assert_ok(hw_renderer_prepare(renderer, camera, NULL));
    assert_ok(hw_renderer_draw(renderer, camera, stats));
    assert_ok(hw_target_read(target, &image));
    hw_target_destroy(target);
    hw_renderer_destroy(renderer);
    return image;
}

static inline const uint8_t *model_pixel(const hw_image *image, uint32_t x, uint32_t y)
{
    return image->data + ((size_t)y * image->width + x) * image->channels;
}

// Fails unless the pixel is this colour (0..1) within `tolerance` of 255.
static inline void model_assert_color(const hw_image *image, uint32_t x, uint32_t y, float r,
                                      float g, float b, int tolerance)
{
    const uint8_t *p = model_pixel(image, x, y);
    const float wanted[3] = {r, g, b};
    for (int k = 0; k < 3; k++) {
        int w = (int)(wanted[k] * 255 + 0.5f);
        if (p[k] > w + tolerance || p[k] < w - tolerance) {
            fail_msg("pixel (%u, %u) is %d %d %d %d, channel %d should be %d", x, y, p[0], p[1],
                     p[2], p[3], k, w);
        }
    }
}
