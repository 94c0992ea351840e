#include "bytes.h"
#include "export.h"
#include "file.h"
#include "import.h"
#include "json.h"
#include "log.h"
#include "mesh_samples.h"
#include <stdio.h>
#include <unistd.h>

// ---- A scene with everything --------------------------------------------------------------------

static void set_material(hw_material *m, const char *name, float r, float g, float b)
{
    assert_ok(hw_strdup(&m->name, name));
    m->base_color[0] = r;
    m->base_color[1] = g;
    m->base_color[2] = b;
}

static void set_texture(hw_material *m, uint32_t channels)
{
    assert_ok(hw_image_make(&m->texture, 5, 3, channels));
    for (uint32_t i = 0; i < 15 * channels; i++)
        m->texture.data[i] = (uint8_t)(i * 37);
}

static void add_object(hw_scene *scene, uint32_t mesh, uint32_t material, hw_mat4 transform)
{
    assert_ok(HW_RESIZE(&scene->objects, scene->object_count + 1));
    scene->objects[scene->object_count++] = (hw_object){mesh, material, transform, hw_box_empty()};
}

// Three meshes (colours; texture coordinates; neither, with many vertices), four materials, two of
// them with the same texture; six objects; a ground. Meshes and materials in order of first use.
static hw_scene make_scene(void)
{
    hw_scene scene = {.mesh_count = 3, .material_count = 4};
    assert_ok(hw_strdup(&scene.path, "made up"));
    assert_ok(HW_NEW(&scene.meshes, 3));
    assert_ok(HW_NEW(&scene.materials, 4));
    scene.meshes[0] = sample_octahedron();
    scene.meshes[1] = sample_cube();
    scene.meshes[2] = sample_sphere(7); // 65,538 vertices: needs 32-bit indices
    assert_true(scene.meshes[2].vertex_count > UINT16_MAX);
    for (int i = 0; i < 3; i++)
        assert_ok(hw_mesh_compute_normals(&scene.meshes[i]));
    assert_ok(HW_NEW(&scene.meshes[0].colors, 6));
    assert_ok(HW_NEW(&scene.meshes[1].uvs, 8));
    for (uint32_t i = 0; i < 6; i++)
        scene.meshes[0].colors[i] = (hw_color8){(uint8_t)(50 * i), 7, 255, (uint8_t)(255 - i)};
    for (uint32_t i = 0; i < 8; i++)
        scene.meshes[1].uvs[i] = (hw_uv){0.1f * i, 1 - 0.3f * i};
    set_material(&scene.materials[0], "tint", 0.5f, 0.25f, 0.125f);
    set_material(&scene.materials[1], "b\xc3\xa4r", 0.9f, 0.8f, 0.7f);
    set_material(&scene.materials[2], "textured", 1, 1, 1);
    set_material(&scene.materials[3], "textured, darker", 0.5f, 0.5f, 0.5f);
    set_texture(&scene.materials[2], 3);
    set_texture(&scene.materials[3], 3);
    add_object(&scene, 0, 0, hw_mat4_identity());
    add_object(&scene, 0, 1, hw_mat4_translation(100, 200, 3));
    add_object(&scene, 1, 2, hw_mat4_mul(hw_mat4_translation(-7, 8, 9), hw_mat4_rotation_z(1)));
    add_object(&scene, 1, 3, hw_mat4_scale(2, 3, 4));
    add_object(&scene, 2, 0, hw_mat4_translation(0.1, 0.2, 0.3));
    add_object(&scene, 0, 1, hw_mat4_translation(5, 5, 5));
    scene.ground = (hw_ground){true, {{-300, -200, -1}, {400, 500, -1}}, {0.3f, 0.6f, 0.2f}};
    hw_scene_update_bounds(&scene);
    assert_ok(hw_scene_validate(&scene));
    return scene;
}

static void assert_floats_close(const float *a, const float *b, size_t count)
{
    for (size_t i = 0; i < count; i++)
        assert_close(a[i], b[i], 1e-6);
}

static void assert_meshes_equal(const hw_mesh *a, const hw_mesh *b)
{
    assert_string_equal(a->name, b->name);
    assert_int_equal(a->vertex_count, b->vertex_count);
    assert_int_equal(a->index_count, b->index_count);
    assert_memory_equal(a->indices, b->indices, a->index_count * sizeof *a->indices);
    assert_memory_equal(a->positions, b->positions, a->vertex_count * sizeof *a->positions);
    assert_memory_equal(a->normals, b->normals, a->vertex_count * sizeof *a->normals);
    assert_int_equal(!a->colors, !b->colors);
    if (a->colors)
        assert_memory_equal(a->colors, b->colors, a->vertex_count * sizeof *a->colors);
    assert_int_equal(!a->uvs, !b->uvs);
    if (a->uvs)
        assert_floats_close(&a->uvs->u, &b->uvs->u, 2 * (size_t)a->vertex_count);
}

static void assert_scenes_equal(const hw_scene *a, const hw_scene *b)
{
    assert_int_equal(a->mesh_count, b->mesh_count);
    for (uint32_t i = 0; i < a->mesh_count; i++)
        assert_meshes_equal(&a->meshes[i], &b->meshes[i]);
    assert_int_equal(a->material_count, b->material_count);
    for (uint32_t i = 0; i < a->material_count; i++) {
        const hw_material *m = &a->materials[i], *n = &b->materials[i];
        assert_string_equal(m->name, n->name);
        assert_floats_close(m->base_color, n->base_color, 3);
        assert_int_equal(!m->texture.data, !n->texture.data);
        if (!m->texture.data)
            continue;
        assert_int_equal(m->texture.width, n->texture.width);
        assert_int_equal(m->texture.height, n->texture.height);
        assert_int_equal(m->texture.channels, n->texture.channels);
        assert_memory_equal(m->texture.data, n->texture.data, 15 * m->texture.channels);
    }
    assert_int_equal(a->object_count, b->object_count);
    for (uint32_t i = 0; i < a->object_count; i++) {
        assert_int_equal(a->objects[i].mesh_idx, b->objects[i].mesh_idx);
        assert_int_equal(a->objects[i].material_idx, b->objects[i].material_idx);
        for (int k = 0; k < 16; k++)
            assert_close(a->objects[i].transform.m[k], b->objects[i].transform.m[k], 1e-5);
        for (int k = 0; k < 3; k++)
            assert_close((&a->objects[i].bounds.min.x)[k], (&b->objects[i].bounds.min.x)[k], 1e-4);
    }
    assert_int_equal(a->ground.present, b->ground.present);
    assert_floats_close(&a->ground.rect.min.x, &b->ground.rect.min.x, 6);
    assert_floats_close(a->ground.color, b->ground.color, 3);
}

static void test_round_trip(void **state)
{
    (void)state;
    hw_scene scene = make_scene(), back, again;
    assert_ok(hw_scene_export_glb(&scene, "export_a.glb"));
    assert_ok(hw_scene_import("export_a.glb", &back));
    assert_scenes_equal(&scene, &back);
    // From then on nothing changes any more, to the bit (but for texture coordinates: 1 - (1 - v)).
    assert_ok(hw_scene_export_glb(&back, "export_b.glb"));
    assert_ok(hw_scene_import("export_b.glb", &again));
    assert_scenes_equal(&back, &again);
    assert_memory_equal(back.objects, again.objects, back.object_count * sizeof *back.objects);
    hw_scene_free(&scene);
    hw_scene_free(&back);
    hw_scene_free(&again);
}

static void test_same_bytes(void **state)
{
    (void)state;
    hw_scene scene = make_scene();
    uint8_t *a, *b;
    size_t a_size, b_size;
    assert_ok(hw_scene_export_glb(&scene, "export_a.glb"));
    assert_ok(hw_scene_export_glb(&scene, "export_b.glb"));
    assert_ok(hw_file_read("export_a.glb", 0, &a, &a_size));
    assert_ok(hw_file_read("export_b.glb", 0, &b, &b_size));
    assert_int_equal(a_size, b_size);
    assert_memory_equal(a, b, a_size);
    hw_free(a);
    hw_free(b);
    hw_scene_free(&scene);
}

// ---- The document -------------------------------------------------------------------------------

static int integer(const cJSON *object, const char *key)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
    assert_true(cJSON_IsNumber(item));
    return item->valueint;
}

static const cJSON *member(const cJSON *object, const char *key)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
    if (!item)
        fail_msg("no %s", key);
    return item;
}

// What glTF 2.0 demands of buffers and accessors.
static void assert_layout(const cJSON *json, size_t bin_bytes)
{
    assert_int_equal(cJSON_GetArraySize(member(json, "buffers")), 1);
    assert_int_equal(integer(cJSON_GetArrayItem(member(json, "buffers"), 0), "byteLength"),
                     bin_bytes);
    const cJSON *views = member(json, "bufferViews"), *item;
    int end = 0;
    cJSON_ArrayForEach(item, views)
    {
        int offset = integer(item, "byteOffset");
        assert_int_equal(offset % 4, 0);
        assert_true(offset >= end); // no overlap: nothing is stored twice
        end = offset + integer(item, "byteLength");
        assert_true((size_t)end <= bin_bytes);
    }
    cJSON_ArrayForEach(item, member(json, "accessors"))
    {
        const char *type = member(item, "type")->valuestring;
        int component = integer(item, "componentType");
        int bytes = component == 5121 ? 1 : component == 5123 ? 2 : 4;
        int count = type[0] == 'S' ? 1 : type[3] - '0';
        const cJSON *view = cJSON_GetArrayItem(views, integer(item, "bufferView"));
        assert_int_equal(integer(view, "byteLength"), integer(item, "count") * bytes * count);
    }
}

static void test_document(void **state)
{
    (void)state;
    hw_scene scene = make_scene();
    uint8_t *data;
    size_t size;
    cJSON *json;
    assert_ok(hw_scene_export_glb(&scene, "export_a.glb"));
    assert_ok(hw_file_read("export_a.glb", 0, &data, &size));
    hw_bytes_reader r = hw_bytes_reader_make(data, size);
    assert_int_equal(hw_get_u32(&r), 0x46546c67);
    assert_int_equal(hw_get_u32(&r), 2);
    assert_int_equal(hw_get_u32(&r), size);
    uint32_t json_bytes = hw_get_u32(&r);
    assert_int_equal(json_bytes % 4, 0);
    assert_int_equal(hw_get_u32(&r), 0x4e4f534a);
    const char *text = (const char *)hw_get_span(&r, json_bytes);
    uint32_t bin_bytes = hw_get_u32(&r);
    assert_int_equal(bin_bytes % 4, 0);
    assert_int_equal(hw_get_u32(&r), 0x004e4942);
    assert_false(r.failed);
    assert_int_equal(hw_bytes_left(&r), bin_bytes);
    assert_ok(hw_json_parse("export_a.glb", text, json_bytes, &json));
    assert_layout(json, bin_bytes);

    // Six objects use five pairs of mesh and material; arrays are shared between pairs.
    const cJSON *meshes = member(json, "meshes");
    assert_int_equal(cJSON_GetArraySize(meshes), 5 + 1);
    const cJSON *p[2];
    for (int i = 0; i < 2; i++)
        p[i] = cJSON_GetArrayItem(member(cJSON_GetArrayItem(meshes, i), "primitives"), 0);
    assert_true(cJSON_Compare(member(p[0], "attributes"), member(p[1], "attributes"), true));
    assert_int_equal(integer(p[0], "indices"), integer(p[1], "indices"));
    assert_true(integer(p[0], "material") != integer(p[1], "material"));
    // Mesh 0: three attributes and indices; mesh 1 likewise, mesh 2 and the ground one less.
    assert_int_equal(cJSON_GetArraySize(member(json, "accessors")), 4 + 4 + 3 + 3);
    assert_int_equal(cJSON_GetArraySize(member(json, "images")), 1); // of two equal textures
    assert_int_equal(cJSON_GetArraySize(member(json, "nodes")), 1 + 6 + 1);

    const cJSON *accessors = member(json, "accessors");
    const cJSON *position =
        cJSON_GetArrayItem(accessors, integer(member(p[0], "attributes"), "POSITION"));
    double low[3], high[3];
    assert_ok(hw_json_numbers("accessor", position, "min", low, 3));
    assert_ok(hw_json_numbers("accessor", position, "max", high, 3));
    for (int k = 0; k < 3; k++)
        assert_true(low[k] == -1 && high[k] == 1);
    const cJSON *color =
        cJSON_GetArrayItem(accessors, integer(member(p[0], "attributes"), "COLOR_0"));
    assert_int_equal(integer(color, "componentType"), 5121);
    assert_true(cJSON_IsTrue(member(color, "normalized")));
    cJSON_Delete(json);
    hw_free(data);
    hw_scene_free(&scene);
}

static void test_textured_material_without_coordinates(void **state)
{
    (void)state;
    hw_scene scene = make_scene(), back;
    scene.objects[5].material_idx = 2; // the octahedron has no texture coordinates
    assert_ok(hw_scene_export_glb(&scene, "export_a.glb"));
    assert_ok(hw_scene_import("export_a.glb", &back));
    assert_null(back.materials[back.objects[5].material_idx].texture.data);
    assert_non_null(back.materials[back.objects[2].material_idx].texture.data);
    hw_scene_free(&scene);
    hw_scene_free(&back);
}

static void test_names_become_utf8(void **state)
{
    (void)state;
    hw_scene scene = make_scene(), back;
    static const char *const names[][2] = {{"b\xe4r", "b_r"},
                                           {"\xff\xc3", "__"},
                                           {"a\xe2\x82", "a__"},
                                           {"\xe2\x82\xac \"q\"\n", "\xe2\x82\xac \"q\"\n"}};
    for (int i = 0; i < 4; i++) {
        hw_free(scene.materials[0].name);
        assert_ok(hw_strdup(&scene.materials[0].name, names[i][0]));
        assert_ok(hw_scene_export_glb(&scene, "export_a.glb"));
        assert_ok(hw_scene_import("export_a.glb", &back));
        assert_string_equal(back.materials[0].name, names[i][1]);
        hw_scene_free(&back);
    }
    hw_scene_free(&scene);
}

// ---- Failures -----------------------------------------------------------------------------------

static void test_bad_scene(void **state)
{
    (void)state;
    hw_scene scene = make_scene(), empty = {0};
    assert_int_equal(hw_scene_export_glb(&empty, "export_x.glb"), HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), "no object"));
    scene.objects[1].mesh_idx = 3;
    assert_int_equal(hw_scene_validate(&scene), HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), "object 1: mesh 3 out of range"));
    assert_int_equal(strncmp(hw_error_text(), "made up", 7), 0);
    scene.objects[1].mesh_idx = 0;
    scene.objects[1].material_idx = 4;
    assert_int_equal(hw_scene_validate(&scene), HW_FORMAT);
    scene.objects[1].material_idx = 0;
    scene.objects[1].transform.m[12] = NAN;
    assert_int_equal(hw_scene_validate(&scene), HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), "not finite"));
    scene.objects[1].transform.m[12] = 0;
    scene.objects[1].transform.m[3] = 0.5;
    assert_int_equal(hw_scene_export_glb(&scene, "export_x.glb"), HW_FORMAT);
    assert_false(hw_path_exists("export_x.glb"));
    scene.objects[1].transform.m[3] = 0;
    assert_ok(hw_scene_validate(&scene));
    hw_scene_free(&scene);
}

static void test_failed_write_keeps_the_old_file(void **state)
{
    (void)state;
    hw_scene scene = make_scene();
    hw_status status = HW_IO;
    uint64_t n = 0;
    while (status != HW_OK) {
        assert_ok(hw_file_write("export_old.glb", "old", 3));
        hw_file_fail_after(++n);
        status = hw_scene_export_glb(&scene, "export_old.glb");
        hw_file_fail_after(0);
        uint8_t *data;
        size_t size;
        assert_ok(hw_file_read("export_old.glb", 0, &data, &size));
        if (status != HW_OK) {
            assert_int_equal(status, HW_IO);
            assert_non_null(strstr(hw_error_text(), "export_old.glb"));
        }
        // Only the sync of the folder comes after the rename.
        assert_true((size == 3 && memcmp(data, "old", 3) == 0) || size > 1000);
        hw_free(data);
    }
    assert_true(n > 2);
    assert_int_equal(hw_scene_export_glb(&scene, "export_no/such/folder/a.glb"), HW_IO);
    assert_non_null(strstr(hw_error_text(), "export_no/such/folder/a.glb"));
    hw_scene_free(&scene);
}

static void test_every_allocation_may_fail(void **state)
{
    (void)state;
    hw_scene scene = make_scene();
    hw_status status = HW_MEMORY;
    uint64_t n = 0;
    while (status != HW_OK) {
        hw_alloc_fail_after(++n);
        status = hw_scene_export_glb(&scene, "export_alloc.glb");
        hw_alloc_fail_after(0);
        if (status != HW_OK && status != HW_MEMORY)
            fail_msg("%s", hw_error_text());
    }
    assert_true(n > 8);
    hw_scene_free(&scene);
}

// ---- Scenes and PLY -----------------------------------------------------------------------------

static void test_scene_queries(void **state)
{
    (void)state;
    hw_scene scene = make_scene();
    assert_int_equal(hw_scene_triangle_count(&scene), 3 * 8 + 2 * 12 + 8 * 16384);
    hw_box box = hw_scene_bounds(&scene);
    assert_close(box.max.y, 201, 1e-4);
    assert_close(box.min.z, -4, 1e-4);
    // Exact, not the box of a box: the cube turned by 1 rad about z.
    assert_close(hw_box_size(scene.objects[2].bounds).x, 2 * (cos(1) + sin(1)), 1e-5);
    uint64_t hash = hw_scene_hash(&scene);
    assert_true(hash == hw_scene_hash(&scene));
    scene.objects[3].transform.m[13] += 1e-9;
    assert_true(hash != hw_scene_hash(&scene));
    scene.objects[3].transform.m[13] -= 1e-9;
    scene.materials[2].texture.data[44] ^= 1;
    assert_true(hash != hw_scene_hash(&scene));
    scene.materials[2].texture.data[44] ^= 1;
    scene.ground.color[2] = 0;
    assert_true(hash != hw_scene_hash(&scene));
    hw_scene_free(&scene);
}

static void test_ply(void **state)
{
    (void)state;
    hw_mesh mesh = sample_sphere(3), back;
    hw_scene scene;
    assert_ok(hw_mesh_compute_normals(&mesh));
    assert_ok(HW_NEW(&mesh.colors, mesh.vertex_count));
    for (uint32_t i = 0; i < mesh.vertex_count; i++)
        mesh.colors[i] = (hw_color8){(uint8_t)i, (uint8_t)(i >> 3), 9, 255};
    assert_ok(hw_mesh_export_ply(&mesh, "export_a.ply"));
    assert_ok(hw_scene_import("export_a.ply", &scene));
    hw_free(scene.meshes[0].name);
    assert_ok(hw_strdup(&scene.meshes[0].name, "sphere"));
    assert_meshes_equal(&mesh, &scene.meshes[0]);
    hw_scene_free(&scene);
    assert_ok(hw_mesh_import("export_a.ply", &back));
    assert_memory_equal(mesh.indices, back.indices, mesh.index_count * sizeof *mesh.indices);
    assert_memory_equal(mesh.colors, back.colors, mesh.vertex_count * sizeof *mesh.colors);
    hw_mesh_free(&back);
    mesh.index_count = 0;
    assert_int_equal(hw_mesh_export_ply(&mesh, "export_x.ply"), HW_FORMAT);
    assert_int_equal(strncmp(hw_error_text(), "export_x.ply: ", 14), 0);
    hw_mesh_free(&mesh);
}

int main(void)
{
    hw_log_set_quiet(true);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_document),
        cmocka_unit_test(test_textured_material_without_coordinates),
        cmocka_unit_test(test_names_become_utf8),
        cmocka_unit_test(test_bad_scene),
        cmocka_unit_test(test_failed_write_keeps_the_old_file),
        cmocka_unit_test(test_every_allocation_may_fail),
        cmocka_unit_test(test_scene_queries),
        cmocka_unit_test(test_ply),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
