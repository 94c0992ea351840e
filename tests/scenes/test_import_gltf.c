// glTF: what stands where, and what is refused.
#include "model_files.h"

static void test_gltf_turns_upright(void **state)
{
    (void)state;
    save_triangle("import_up.glb",
                  "\"scenes\":[{\"nodes\":[0]}],\"meshes\":[{\"primitives\":[" PRIMITIVE
                  "]}],\"nodes\":[{\"mesh\":0,"
                  "\"translation\":[10,20,30]}]");
    hw_mesh mesh;
    assert_ok(hw_mesh_import("import_up.glb", &mesh));
    // (x, y, z) becomes (x, -z, y): the triangle's third corner stands above the first.
    assert_true(mesh.positions[0].x == 10 && mesh.positions[0].y == -30 &&
                mesh.positions[0].z == 20);
    assert_true(mesh.positions[2].x == 10 && mesh.positions[2].y == -30 &&
                mesh.positions[2].z == 21);
    hw_mesh_free(&mesh);
}

static void test_gltf_instances(void **state)
{
    (void)state;
    // Two glTF meshes with the same arrays and different materials, each placed twice, in a tree;
    // one object scaled to nothing; a ground.
    save_triangle(
        "import_tree.glb",
        "\"scenes\":[{\"nodes\":[0]}],"
        "\"materials\":[{\"pbrMetallicRoughness\":{\"baseColorFactor\":[0.5,0.25,1,1]}},{}],"
        "\"meshes\":[{\"name\":\"a\",\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":"
        "1,"
        "\"material\":0}]},{\"name\":\"b\",\"primitives\":[{\"attributes\":{\"POSITION\":0},"
        "\"indices\":1,\"material\":1}]}],"
        "\"nodes\":[{\"children\":[1,2,3,4],\"scale\":[2,2,2]},{\"mesh\":0},"
        "{\"mesh\":1,\"translation\":[5,0,0],\"children\":[5]},"
        "{\"mesh\":0,\"scale\":[1,0,1]},"
        "{\"mesh\":0,\"name\":\"" HW_GROUND_NAME "\",\"rotation\":[-0.70710678,0,0,0.70710678]},"
        "{\"mesh\":1,\"translation\":[0,0,1]}]");
    hw_scene scene;
    assert_ok(hw_scene_import("import_tree.glb", &scene));
    assert_int_equal(scene.mesh_count, 1); // equal geometry is one mesh
    assert_int_equal(scene.material_count, 2);
    assert_int_equal(scene.object_count, 3);
    const hw_material *blue = &scene.materials[scene.objects[0].material_idx];
    assert_true(blue->base_color[0] == 0.5f && blue->base_color[1] == 0.25f);
    assert_true(scene.objects[1].material_idx != scene.objects[0].material_idx);
    assert_int_equal(scene.objects[2].material_idx, scene.objects[1].material_idx);
    hw_vec3 p = hw_mat4_point(&scene.objects[2].transform, hw_v3(1, 0, 0));
    assert_true(p.x == 12 && p.y == -2 && p.z == 0); // (1+0+5) * 2, (0+1) * 2 turned
    assert_close(scene.objects[2].bounds.max.z, 2, 1e-6);
    assert_true(scene.ground.present);
    assert_close(scene.ground.rect.max.x, 2, 1e-5);
    assert_close(scene.ground.rect.max.y, 2, 1e-5);
    assert_close(scene.ground.rect.max.z, scene.ground.rect.min.z, 0);
    assert_close(scene.ground.color[1], 0.25, 0);
    hw_scene_free(&scene);
}

static void test_gltf_flattened(void **state)
{
    (void)state;
    // Turned, flattened, turned again: flat, yet no row and no column of the product is 0, and with
    // some turns rounding leaves a little of the determinant.
    hw_bytes_writer rest = {0};
    put_text(&rest, "\"scenes\":[{\"nodes\":[0,1");
    for (int i = 1; i < 20; i++)
        put_format(&rest, ",%d", 1 + 3 * i);
    put_text(&rest, "]}],\"meshes\":[{\"primitives\":[" PRIMITIVE "]}],\"nodes\":[{\"mesh\":0}");
    for (int i = 0; i < 20; i++) {
        double a = 0.3 + 0.1 * i, b = 1.1 + 0.17 * i;
        put_format(&rest, ",{\"rotation\":[%.7f,%.7f,0,0.8],\"children\":[%d]}", 0.6 * sin(a),
                   0.6 * cos(a), 2 + 3 * i);
        put_format(&rest, ",{\"scale\":[1,0,1],\"children\":[%d]}", 3 + 3 * i);
        put_format(&rest, ",{\"rotation\":[0,%.7f,%.7f,0.6],\"mesh\":0}", 0.8 * sin(b),
                   0.8 * cos(b));
    }
    put_text(&rest, "]");
    hw_put_u8(&rest, 0);
    save_triangle("import_flattened.glb", (const char *)rest.data);
    hw_bytes_writer_free(&rest);
    hw_scene scene;
    assert_ok(hw_scene_import("import_flattened.glb", &scene));
    assert_int_equal(scene.object_count, 1);
    hw_scene_free(&scene);
}

static void test_gltf_extensions(void **state)
{
    (void)state;
    save_triangle("import_ext.glb",
                  "\"scenes\":[{\"nodes\":[0]}],\"meshes\":[{\"primitives\":[" PRIMITIVE
                  "]}],\"nodes\":[{\"mesh\":0}],\"extensionsRequired\":[\"KHR_materials_unlit\","
                  "\"KHR_lights_punctual\"]");
    hw_mesh mesh;
    assert_ok(hw_mesh_import("import_ext.glb", &mesh));
    hw_mesh_free(&mesh);
}

static void test_gltf_buffer_names(void **state)
{
    (void)state;
    // A buffer that is named by URI, beside one that is named as it is.
    assert_ok(hw_dir_make("import_buffers"));
    spill("import_buffers/the bin.bin", triangle.positions, sizeof triangle.positions);
    spill("import_buffers/100%25.bin", triangle.indices, sizeof triangle.indices);
    save_text(
        "import_buffers/named.gltf",
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
        "\"nodes\":[{\"mesh\":0}],\"buffers\":[{\"byteLength\":36,\"uri\":\"the%20bin.bin\"},"
        "{\"byteLength\":12,\"uri\":\"100%25.bin\"}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteLength\":36},{\"buffer\":1,\"byteLength\":12}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"},"
        "{\"bufferView\":1,\"componentType\":5125,\"count\":3,\"type\":\"SCALAR\"}],"
        "\"meshes\":[{\"primitives\":[" PRIMITIVE "]}]}");
    hw_mesh mesh;
    assert_ok(hw_mesh_import("import_buffers/named.gltf", &mesh));
    assert_int_equal(mesh.index_count, 3);
    assert_close(hw_mesh_bounds(&mesh).max.z, 1, 0);
    hw_mesh_free(&mesh);
    assert_int_equal(unlink("import_buffers/the bin.bin"), 0);
    expect_refused("import_buffers/named.gltf", HW_FORMAT, "the%20bin.bin is missing");
}

static void test_gltf_mirrors(void **state)
{
    (void)state;
    save_triangle("import_mirror.glb",
                  "\"scenes\":[{\"nodes\":[0,1,2]}],\"meshes\":[{\"primitives\":[" PRIMITIVE
                  "]}],\"nodes\":[{\"mesh\":0},{\"mesh\":0,\"scale\":[1,1,-1]},"
                  "{\"mesh\":0,\"scale\":[-2,1,1]}]");
    hw_scene scene;
    assert_ok(hw_scene_import("import_mirror.glb", &scene));
    assert_int_equal(scene.object_count, 3);
    assert_int_equal(scene.mesh_count, 2); // the mesh and its mirror image
    for (uint32_t i = 0; i < 3; i++) {
        const double *m = scene.objects[i].transform.m;
        double det = m[0] * (m[5] * m[10] - m[9] * m[6]) - m[4] * (m[1] * m[10] - m[9] * m[2]) +
                     m[8] * (m[1] * m[6] - m[5] * m[2]);
        assert_true(det > 0);
    }
    assert_close(scene.objects[2].bounds.min.x, -2, 1e-6);
    assert_close(scene.objects[2].bounds.max.x, 0, 1e-6);
    hw_scene_free(&scene);
}

static void test_gltf_drops_other_primitives_vertices(void **state)
{
    (void)state;
    // A line and a triangle share three vertices and one more that only the line uses.
    static const struct {
        hw_vec3 positions[4];
        uint32_t triangle[3], line[2];
    } bin = {{{9, 9, 9}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {1, 2, 3}, {0, 1}};
    const char *json =
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
        "\"nodes\":[{\"mesh\":0}],\"buffers\":[{\"byteLength\":68}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteLength\":48},{\"buffer\":0,\"byteOffset\":48,"
        "\"byteLength\":12},{\"buffer\":0,\"byteOffset\":60,\"byteLength\":8}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"},"
        "{\"bufferView\":1,\"componentType\":5125,\"count\":3,\"type\":\"SCALAR\"},"
        "{\"bufferView\":2,\"componentType\":5125,\"count\":2,\"type\":\"SCALAR\"}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1},"
        "{\"attributes\":{\"POSITION\":0},\"indices\":2,\"mode\":1}]}]}";
    hw_bytes_writer w = {0};
    put_glb(&w, json, &bin, sizeof bin);
    save(&w, "import_line.glb");
    hw_scene scene;
    assert_ok(hw_scene_import("import_line.glb", &scene));
    assert_int_equal(scene.object_count, 1);
    assert_int_equal(scene.meshes[0].vertex_count, 3);
    assert_close(scene.objects[0].bounds.max.x, 1, 1e-6);
    hw_scene_free(&scene);
}

static void expect_refused_glb(const char *rest, const char *cause)
{
    save_triangle("import_x.glb", rest);
    expect_refused("import_x.glb", HW_OK, cause);
}

static void test_bad_gltf(void **state)
{
    (void)state;
#define SCENE "\"scenes\":[{\"nodes\":[0]}],\"meshes\":[{\"primitives\":[" PRIMITIVE "]}],"
    expect_refused_glb(SCENE "\"nodes\":[{\"mesh\":1}]", "mesh is out of range");
    expect_refused_glb(SCENE "\"nodes\":[{\"mesh\":0,\"children\":[0]}]", "cycle");
    expect_refused_glb(SCENE "\"nodes\":[{\"children\":[1]},{\"children\":[0],\"mesh\":0}]",
                       "cycle");
    expect_refused_glb(SCENE "\"nodes\":[{\"children\":[1,1]},{\"mesh\":0}]", "parent");
    expect_refused_glb(SCENE "\"nodes\":[{\"children\":[7]},{\"mesh\":0}]", "child");
    expect_refused_glb(SCENE "\"nodes\":[{\"mesh\":0,\"matrix\":[1,2]}]", "transform");
    expect_refused_glb(SCENE "\"nodes\":[{\"mesh\":0,\"scale\":[1e30,1e30,1e30]}]", "");
    expect_refused_glb(SCENE "\"nodes\":[{\"mesh\":0,\"scale\":[1e39,1,1]}]", "");
    expect_refused_glb(SCENE "\"nodes\":[{}]", "no triangle");
    expect_refused_glb("\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
                       "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":2}}]}]",
                       "without positions");
    expect_refused_glb("\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
                       "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":1}}]}]",
                       "three floats");
    expect_refused_glb(SCENE "\"nodes\":[{\"mesh\":0}],"
                             "\"extensionsRequired\":[\"KHR_draco_mesh_compression\"]",
                       "KHR_draco_mesh_compression");
    expect_refused_glb(SCENE "\"nodes\":[{\"mesh\":0}],\"extensionsRequired\":["
                             "\"KHR_materials_unlit\",\"EXT_mesh_gpu_instancing\"]",
                       "EXT_mesh_gpu_instancing");
    expect_refused_glb(SCENE "\"nodes\":[{\"mesh\":0}],\"extensionsRequired\":[7]", "an extension");
    expect_refused_glb(SCENE "\"nodes\":[{\"mesh\":0}],\"images\":[{\"bufferView\":0,"
                             "\"mimeType\":\"picture\"}]",
                       "media type");
#undef SCENE
}

static void test_gltf_index_out_of_range(void **state)
{
    (void)state;
    triangle_bin bad = triangle;
    bad.indices[1] = 3;
    hw_bytes_writer w = {0};
    put_glb(&w,
            "{" TRIANGLE_JSON ",\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
            "\"meshes\":[{\"primitives\":[" PRIMITIVE "]}]}",
            &bad, sizeof bad);
    save(&w, "import_x.glb");
    expect_refused("import_x.glb", HW_FORMAT, "index 3 out of range");
    bad = triangle;
    bad.positions[2].y = NAN;
    put_glb(&w,
            "{" TRIANGLE_JSON ",\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
            "\"meshes\":[{\"primitives\":[" PRIMITIVE "]}]}",
            &bad, sizeof bad);
    save(&w, "import_x.glb");
    expect_refused("import_x.glb", HW_FORMAT, "NaN");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_gltf_turns_upright),
        cmocka_unit_test(test_gltf_instances),
        cmocka_unit_test(test_gltf_flattened),
        cmocka_unit_test(test_gltf_extensions),
        cmocka_unit_test(test_gltf_buffer_names),
        cmocka_unit_test(test_gltf_mirrors),
        cmocka_unit_test(test_gltf_drops_other_primitives_vertices),
        cmocka_unit_test(test_bad_gltf),
        cmocka_unit_test(test_gltf_index_out_of_range),
    };
    return cmocka_run_group_tests(tests, quiet, NULL);
}
