// Models as files of every format, for the tests of what reads them.
#pragma once
#include "bytes.h"
#include "file.h"
#include "import.h"
#include "log.h"
#include "mesh_samples.h"
#include <stdio.h>
#include <unistd.h>

static inline void put_text(hw_bytes_writer *w, const char *text)
{
    hw_put_bytes(w, text, strlen(text));
}

static inline void HW_PRINTF(2, 3) put_format(hw_bytes_writer *w, const char *format, ...)
{
    char line[256];
    va_list args;
    va_start(args, format);
    int n = vsnprintf(line, sizeof line, format, args);
    va_end(args);
    assert_true(n >= 0 && (size_t)n < sizeof line);
    hw_put_bytes(w, line, (size_t)n);
}

// Without hw_file_write's fsync, or the one that some file systems do for a truncated file: some
// tests write thousands of files.
static inline void spill(const char *path, const void *data, size_t size)
{
    (void)unlink(path);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(size ? fwrite(data, 1, size, file) : 0, size);
    assert_int_equal(fclose(file), 0);
}

// Writes the file and empties the writer.
static inline void save(hw_bytes_writer *w, const char *path)
{
    assert_ok(hw_bytes_writer_check(w));
    spill(path, w->data, w->size);
    hw_bytes_writer_free(w);
    *w = (hw_bytes_writer){0};
}

static inline void save_text(const char *path, const char *text)
{
    spill(path, text, strlen(text));
}

static inline void put_off(hw_bytes_writer *w)
{
    hw_mesh m = sample_octahedron();
    put_text(w, "OFF\n6 8 0\n");
    for (uint32_t i = 0; i < 6; i++)
        put_format(w, "%g %g %g\n", m.positions[i].x, m.positions[i].y, m.positions[i].z);
    for (uint32_t i = 0; i < 24; i += 3)
        put_format(w, "3 %u %u %u\n", m.indices[i], m.indices[i + 1], m.indices[i + 2]);
    hw_mesh_free(&m);
}

static inline void put_obj(hw_bytes_writer *w)
{
    hw_mesh m = sample_octahedron();
    put_text(w, "# an octahedron\no stone\n");
    for (uint32_t i = 0; i < 6; i++)
        put_format(w, "v %g %g %g\n", m.positions[i].x, m.positions[i].y, m.positions[i].z);
    for (uint32_t i = 0; i < 24; i += 3) // from 1, and the last one from the end
        put_format(w, "f %u %u %d\n", m.indices[i] + 1, m.indices[i + 1] + 1,
                   (int)m.indices[i + 2] - 6);
    hw_mesh_free(&m);
}

typedef enum encoding { ASCII, LITTLE, BIG } encoding;

static inline void put_value(hw_bytes_writer *w, const void *value, size_t size, encoding e)
{
    const uint8_t *bytes = value;
    for (size_t i = 0; i < size; i++)
        hw_put_u8(w, bytes[e == BIG ? size - 1 - i : i]);
}

static inline void put_ply(hw_bytes_writer *w, encoding e)
{
    static const char *const names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    hw_mesh m = sample_octahedron();
    put_format(w, "ply\nformat %s 1.0\ncomment made for a test\nelement vertex 6\n", names[e]);
    put_text(w, "property float x\nproperty float y\nproperty float z\nproperty uchar red\n"
                "property uchar green\nproperty uchar blue\nelement face 8\n"
                "property list uchar int vertex_indices\nend_header\n");
    for (uint32_t i = 0; i < 6; i++) {
        hw_vec3 p = m.positions[i];
        if (e == ASCII) {
            put_format(w, "%g %g %g %u 128 0\n", p.x, p.y, p.z, 40 * i);
            continue;
        }
        put_value(w, &p.x, 4, e);
        put_value(w, &p.y, 4, e);
        put_value(w, &p.z, 4, e);
        uint8_t rgb[3] = {(uint8_t)(40 * i), 128, 0};
        hw_put_bytes(w, rgb, 3);
    }
    for (uint32_t i = 0; i < 24; i += 3) {
        const uint32_t *t = m.indices + i;
        if (e == ASCII) {
            put_format(w, "3 %u %u %u\n", t[0], t[1], t[2]);
            continue;
        }
        hw_put_u8(w, 3);
        for (int k = 0; k < 3; k++)
            put_value(w, t + k, 4, e);
    }
    hw_mesh_free(&m);
}

static inline void put_stl(hw_bytes_writer *w, bool text)
{
    hw_mesh m = sample_octahedron();
    char header[80] = "solid by name, yet binary";
    if (text) {
        put_text(w, "solid octahedron\n");
    } else {
        hw_put_bytes(w, header, sizeof header);
        hw_put_u32(w, 8);
    }
    for (uint32_t i = 0; i < 24; i += 3) {
        if (text)
            put_text(w, "facet normal 0 0 0\nouter loop\n");
        for (int k = 0; !text && k < 3; k++)
            hw_put_f32(w, 0);
        for (int k = 0; k < 3; k++) {
            hw_vec3 p = m.positions[m.indices[i + k]];
            if (text)
                put_format(w, "vertex %g %g %g\n", p.x, p.y, p.z);
            else
                hw_put_bytes(w, &p, sizeof p);
        }
        if (text)
            put_text(w, "endloop\nendfacet\n");
        else
            hw_put_u16(w, 0);
    }
    if (text)
        put_text(w, "endsolid octahedron\n");
    hw_mesh_free(&m);
}

// A 3DS chunk's header; returns where its length is to be set.
static size_t begin_chunk(hw_bytes_writer *w, uint16_t tag)
{
    hw_put_u16(w, tag);
    hw_put_u32(w, 0);
    return w->size - 6;
}

static inline void end_chunk(hw_bytes_writer *w, size_t begin)
{
    uint32_t length = (uint32_t)(w->size - begin);
    memcpy(w->data + begin + 2, &length, 4);
}

static inline void put_3ds(hw_bytes_writer *w)
{
    hw_mesh m = sample_octahedron();
    size_t all = begin_chunk(w, 0x4d4d), edit = begin_chunk(w, 0x3d3d);
    size_t object = begin_chunk(w, 0x4000);
    hw_put_bytes(w, "thing", 6);
    size_t mesh = begin_chunk(w, 0x4100), vertices = begin_chunk(w, 0x4110);
    hw_put_u16(w, 6);
    for (uint32_t i = 0; i < 6; i++) { // taller than wide: up shows
        hw_vec3 p = hw_v3(m.positions[i].x, m.positions[i].y, 3 * m.positions[i].z);
        hw_put_bytes(w, &p, sizeof p);
    }
    end_chunk(w, vertices);
    size_t faces = begin_chunk(w, 0x4120);
    hw_put_u16(w, 8);
    for (uint32_t i = 0; i < 24; i++) {
        hw_put_u16(w, (uint16_t)m.indices[i]);
        if (i % 3 == 2)
            hw_put_u16(w, 7); // all edges visible
    }
    end_chunk(w, faces);
    end_chunk(w, mesh);
    end_chunk(w, object);
    end_chunk(w, edit);
    end_chunk(w, all);
    hw_mesh_free(&m);
}

static inline void put_glb(hw_bytes_writer *w, const char *json, const void *bin, size_t bin_bytes)
{
    size_t json_bytes = strlen(json), padded = (json_bytes + 3) & ~(size_t)3;
    assert_int_equal(bin_bytes % 4, 0);
    hw_put_u32(w, 0x46546c67);
    hw_put_u32(w, 2);
    hw_put_u32(w, (uint32_t)(12 + 8 + padded + 8 + bin_bytes));
    hw_put_u32(w, (uint32_t)padded);
    hw_put_u32(w, 0x4e4f534a);
    hw_put_bytes(w, json, json_bytes);
    hw_put_bytes(w, "   ", padded - json_bytes);
    hw_put_u32(w, (uint32_t)bin_bytes);
    hw_put_u32(w, 0x004e4942);
    hw_put_bytes(w, bin, bin_bytes);
}

// One triangle (0,0,0) (1,0,0) (0,1,0), with indices; the rest of the document is the test's.
typedef struct triangle_bin {
    hw_vec3 positions[3];
    uint32_t indices[3];
} triangle_bin;
static const triangle_bin triangle = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 2}};

#define TRIANGLE_JSON                                                                              \
    "\"asset\":{\"version\":\"2.0\"},\"scene\":0,"                                                 \
    "\"buffers\":[{\"byteLength\":48}],"                                                           \
    "\"bufferViews\":[{\"buffer\":0,\"byteLength\":36},"                                           \
    "{\"buffer\":0,\"byteOffset\":36,\"byteLength\":12}],"                                         \
    "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\","       \
    "\"min\":[0,0,0],\"max\":[1,1,0]},"                                                            \
    "{\"bufferView\":1,\"componentType\":5125,\"count\":3,\"type\":\"SCALAR\"}]"
#define PRIMITIVE "{\"attributes\":{\"POSITION\":0},\"indices\":1}"

static inline void save_triangle(const char *path, const char *rest)
{
    hw_bytes_writer w = {0}, json = {0};
    put_text(&json, "{" TRIANGLE_JSON ",");
    put_text(&json, rest);
    put_text(&json, "}");
    hw_put_u8(&json, 0);
    put_glb(&w, (const char *)json.data, &triangle, sizeof triangle);
    save(&w, path);
    hw_bytes_writer_free(&json);
}

// The import fails with `expected` (any failure if HW_OK), names the file first, and the cause.
static inline void expect_refused(const char *path, hw_status expected, const char *cause)
{
    hw_scene scene;
    hw_mesh mesh;
    hw_status status = hw_scene_import(path, &scene);
    if (status == HW_OK)
        fail_msg("%s was accepted", path);
    if (expected != HW_OK && status != expected)
        fail_msg("%s: %s", hw_status_text(status), hw_error_text());
    if (strncmp(hw_error_text(), path, strlen(path)) != 0 || !strstr(hw_error_text(), cause))
        fail_msg("\"%s\" does not name %s and the cause (%s)", hw_error_text(), path, cause);
    assert_true(scene.object_count == 0 && scene.meshes == NULL);
    assert_int_equal(hw_mesh_import(path, &mesh), status);
    assert_null(mesh.positions);
}

// For cmocka: warnings are expected.
static inline int quiet(void **state)
{
    (void)state;
    hw_log_set_quiet(true);
    return 0;
}
