// Models of every format but glTF (test_import_gltf.c), and what is wrong with files.
#include "image_io.h"
#include "model_files.h"

// ---- Formats ------------------------------------------------------------------------------------

static void assert_octahedron(const char *path)
{
    hw_scene scene;
    hw_mesh mesh;
    assert_ok(hw_scene_import(path, &scene));
    assert_string_equal(scene.path, path);
    assert_int_equal(scene.mesh_count, 1);
    assert_int_equal(scene.object_count, 1);
    assert_int_equal(scene.material_count, 1);
    assert_int_equal(hw_scene_triangle_count(&scene), 8);
    assert_false(scene.ground.present);
    assert_int_equal(scene.meshes[0].vertex_count, 6); // welded
    assert_close(hw_mesh_volume(&scene.meshes[0]), 4.0 / 3, 1e-6);
    for (int k = 0; k < 3; k++)
        assert_close(scene.materials[0].base_color[k], 1, 0);
    for (uint32_t i = 0; i < 6; i++) { // smooth normals
        hw_vec3 d = hw_v3_sub(scene.meshes[0].normals[i], scene.meshes[0].positions[i]);
        assert_true(hw_v3_length(d) < 1e-6f);
    }
    hw_box box = scene.objects[0].bounds;
    assert_true(box.min.x == -1 && box.max.x == 1 && box.min.z == -1 && box.max.z == 1);
    hw_scene_free(&scene);

    assert_ok(hw_mesh_import(path, &mesh));
    assert_int_equal(mesh.vertex_count, 6);
    assert_int_equal(mesh.index_count, 24);
    assert_null(mesh.normals);
    assert_close(hw_mesh_volume(&mesh), 4.0 / 3, 1e-6);
    hw_mesh_free(&mesh);
}

static void test_formats(void **state)
{
    (void)state;
    hw_bytes_writer w = {0};
    put_off(&w);
    save(&w, "import_a.off");
    put_obj(&w);
    save(&w, "import_a.obj");
    put_ply(&w, ASCII);
    save(&w, "import_a.ply");
    put_ply(&w, LITTLE);
    save(&w, "import_le.ply");
    put_ply(&w, BIG);
    save(&w, "import_be.ply");
    put_stl(&w, true);
    save(&w, "import_a.stl");
    put_stl(&w, false);
    save(&w, "import_b.STL");
    static const char *const paths[] = {"import_a.off",  "import_a.obj",  "import_a.ply",
                                        "import_le.ply", "import_be.ply", "import_a.stl",
                                        "import_b.STL"};
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++)
        assert_octahedron(paths[i]);
}

static void test_3ds_stands_as_in_the_file(void **state)
{
    (void)state;
    hw_bytes_writer w = {0};
    put_3ds(&w);
    save(&w, "import_a.3ds");
    hw_mesh mesh;
    assert_ok(hw_mesh_import("import_a.3ds", &mesh));
    assert_int_equal(mesh.vertex_count, 6);
    assert_close(hw_mesh_volume(&mesh), 4, 1e-5);
    hw_box box = hw_mesh_bounds(&mesh);
    assert_close(box.max.z, 3, 1e-6);
    assert_close(box.max.y, 1, 1e-6);
    hw_mesh_free(&mesh);
}

static void test_ply_colors(void **state)
{
    (void)state;
    hw_bytes_writer w = {0};
    for (int e = ASCII; e <= BIG; e++) {
        put_ply(&w, (encoding)e);
        save(&w, "import_colors.ply");
        hw_mesh mesh;
        assert_ok(hw_mesh_import("import_colors.ply", &mesh));
        assert_non_null(mesh.colors);
        for (uint32_t i = 0; i < 6; i++) {
            hw_color8 c = mesh.colors[i];
            assert_true(c.r == 40 * i && c.g == 128 && c.b == 0 && c.a == 255);
        }
        hw_mesh_free(&mesh);
    }
}

static void test_off_oddities(void **state)
{
    (void)state;
    // Comments everywhere, counts on the first line, colours of faces, missing edge count.
    save_text("import_odd.off", "# a comment\nCOFF 4 2\n# another\n\n0 0 0 255 0 51#red\n"
                                "1 0 0 255 0 51 255 # more\n0 1 0 255 0 51\n1 1 0 1 0 0\n"
                                "# faces\n3  0 1 2  0.5 0.5 0.5\n\n#\n3 1 3 2\n# end");
    hw_mesh mesh;
    assert_ok(hw_mesh_import("import_odd.off", &mesh));
    assert_int_equal(mesh.index_count, 6);
    assert_int_equal(mesh.vertex_count, 4);
    assert_non_null(mesh.colors);
    assert_true(mesh.colors[0].r == 255 && mesh.colors[0].g == 0 && mesh.colors[0].b == 51);
    hw_mesh_free(&mesh);
    save_text("import_odd.off", "COFF\n3 1 0\n0 0 0 0.2 0.4 1.0\n1 0 0 0.2 0.4 1.0\n"
                                "0 1 0 0.2 0.4 1.0\n3 0 1 2\n");
    assert_ok(hw_mesh_import("import_odd.off", &mesh));
    assert_true(mesh.colors[1].r == 51 && mesh.colors[1].g == 102 && mesh.colors[1].b == 255);
    hw_mesh_free(&mesh);
    // Far out of range, on either side: as near as there is, and nothing else in the line.
    save_text("import_odd.off", "COFF\n3 1 0\n0 0 0 -1e300 0 0\n1 0 0 0.0 -1e9 1e300\n"
                                "0 1 0 1e300 0 51\n3 0 1 2");
    assert_ok(hw_mesh_import("import_odd.off", &mesh));
    assert_non_null(mesh.colors);
    assert_int_equal(mesh.index_count, 3);
    for (uint32_t i = 0; i < 3; i++) {
        const hw_color8 *c = &mesh.colors[i];
        int x = (int)mesh.positions[i].x, y = (int)mesh.positions[i].y;
        assert_true(c->r == (y ? 255 : 0) && c->g == 0 && c->b == (x ? 255 : y ? 51 : 0));
        assert_int_equal(c->a, 255);
    }
    hw_mesh_free(&mesh);
}

static double mesh_area(const hw_mesh *mesh)
{
    double area = 0;
    for (uint32_t i = 0; i < mesh->index_count; i += 3) {
        hw_vec3 a = mesh->positions[mesh->indices[i]], b = mesh->positions[mesh->indices[i + 1]];
        hw_vec3 c = mesh->positions[mesh->indices[i + 2]];
        hw_vec3 n = hw_v3_cross(hw_v3_sub(b, a), hw_v3_sub(c, a));
        assert_true(n.z > 0); // all wound as the polygon
        area += 0.5 * (double)hw_v3_length(n);
    }
    return area;
}

static void test_polygons(void **state)
{
    (void)state;
    // A comb: concave, area 7 + 4 x 3 = 19.
    save_text("import_comb.obj", "v 0 0 0\nv 7 0 0\nv 7 4 0\nv 6 4 0\nv 6 1 0\nv 5 1 0\nv 5 4 0\n"
                                 "v 4 4 0\nv 4 1 0\nv 3 1 0\nv 3 4 0\nv 2 4 0\nv 2 1 0\nv 1 1 0\n"
                                 "v 1 4 0\nv 0 4 0\nf 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16\n");
    hw_mesh mesh;
    assert_ok(hw_mesh_import("import_comb.obj", &mesh));
    assert_int_equal(mesh.index_count, 3 * 14);
    assert_close(mesh_area(&mesh), 19, 1e-5);
    hw_mesh_free(&mesh);

    hw_bytes_writer w = {0};
    for (int i = 0; i < 1200; i++)
        put_format(&w, "v %g %g 0\n", cos(i * HW_PI / 600), sin(i * HW_PI / 600));
    put_text(&w, "f");
    for (int i = 0; i < 1200; i++)
        put_format(&w, " %d", i + 1);
    put_text(&w, "\n");
    save(&w, "import_round.obj");
    assert_int_equal(hw_mesh_import("import_round.obj", &mesh), HW_LIMIT);
}

// A triangle that is 1 wide, 2 deep and 3 high for who reads x, y, z as right, back and up.
static void save_collada(const char *path, const char *asset)
{
    hw_bytes_writer w = {0};
    put_text(&w, "<?xml version=\"1.0\"?>\n<COLLADA version=\"1.4.1\" "
                 "xmlns=\"http://www.collada.org/2005/11/COLLADASchema\">\n<asset>");
    put_text(&w, asset);
    put_text(&w, "</asset><library_geometries><geometry id=\"g\"><mesh><source id=\"p\">"
                 "<float_array id=\"a\" count=\"9\">0 0 0 1 0 0 0 2 3</float_array>"
                 "<technique_common><accessor source=\"#a\" count=\"3\" stride=\"3\">");
    put_text(&w, "<param name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/>"
                 "<param name=\"Z\" type=\"float\"/></accessor></technique_common></source>"
                 "<vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>");
    put_text(&w, "<triangles count=\"1\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>"
                 "<p>0 1 2</p></triangles></mesh></geometry></library_geometries>"
                 "<library_visual_scenes><visual_scene id=\"s\"><node id=\"n\">");
    put_text(&w, "<instance_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes>"
                 "<scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>\n");
    save(&w, path);
}

static void test_collada_stands_as_it_says(void **state)
{
    (void)state;
    static const struct {
        const char *asset;
        float min[3], max[3];
    } cases[] = {{"<up_axis>Z_UP</up_axis>", {0, 0, 0}, {1, 2, 3}},
                 {"<up_axis>Y_UP</up_axis>", {0, -3, 0}, {1, 0, 2}},
                 {"", {0, -3, 0}, {1, 0, 2}}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        hw_mesh mesh;
        save_collada("import_a.dae", cases[i].asset);
        assert_ok(hw_mesh_import("import_a.dae", &mesh));
        hw_box box = hw_mesh_bounds(&mesh);
        const float min[3] = {box.min.x, box.min.y, box.min.z};
        const float max[3] = {box.max.x, box.max.y, box.max.z};
        for (int k = 0; k < 3; k++) {
            assert_close(min[k], cases[i].min[k], 1e-6);
            assert_close(max[k], cases[i].max[k], 1e-6);
        }
        hw_mesh_free(&mesh);
    }
}

// ---- Materials ----------------------------------------------------------------------------------

static void test_obj_materials(void **state)
{
    (void)state;
    hw_image image;
    assert_ok(hw_image_make(&image, 2, 2, 3));
    for (int i = 0; i < 12; i++)
        image.data[i] = (uint8_t)(20 * i);
    assert_ok(hw_dir_make("import_textures"));
    assert_ok(hw_image_write("import_textures/check board.png", &image));
    save_text("import_mat.mtl", "newmtl red\nKd 1 0.25 0.5\nnewmtl board\nKd 1 1 1\n"
                                "map_Kd import_textures\\check board.png\n"
                                "newmtl lost\nKd 0.5 0.5 0.5\nmap_Kd nowhere.png\n");
    save_text("import_mat.obj", "mtllib import_mat.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5\n"
                                "vt 0 0\nvt 1 0\nvt 0 1\n"
                                "o one\nusemtl red\nf 1/1 2/2 3/3\n"
                                "o two\nusemtl board\nf 1/1 2/2 4/3\n"
                                "o three\nusemtl lost\nf 2/1 3/2 4/3\n");
    hw_scene scene;
    assert_ok(hw_scene_import("import_mat.obj", &scene)); // the lost texture is only a warning
    assert_int_equal(scene.object_count, 3);
    assert_int_equal(scene.material_count, 3);
    const hw_material *red = &scene.materials[scene.objects[0].material_idx];
    assert_true(red->base_color[0] == 1 && red->base_color[1] == 0.25f);
    assert_null(red->texture.data);
    const hw_material *board = &scene.materials[scene.objects[1].material_idx];
    assert_string_equal(board->name, "board");
    assert_int_equal(board->texture.width, 2);
    assert_memory_equal(board->texture.data, image.data, 12);
    assert_null(scene.materials[scene.objects[2].material_idx].texture.data);
    const hw_mesh *mesh = &scene.meshes[scene.objects[1].mesh_idx];
    for (uint32_t i = 0; i < 3; i++) // an OBJ's v runs upward, ours downward
        if (mesh->positions[i].x == 0 && mesh->positions[i].y == 0)
            assert_true(mesh->uvs[i].u == 0 && mesh->uvs[i].v == 1);
    hw_scene_free(&scene);
    hw_image_free(&image);
}

// ---- Bad input ----------------------------------------------------------------------------------

static void test_bad_files(void **state)
{
    (void)state;
    (void)unlink("import_missing.ply");
    expect_refused("import_missing.ply", HW_NOT_FOUND, "");
    expect_refused("import_missing.glb", HW_NOT_FOUND, "");
    assert_ok(hw_dir_make("import_folder.obj"));
    expect_refused("import_folder.obj", HW_IO, "");
    static const char *const empty[] = {"import_e.ply",  "import_e.off", "import_e.obj",
                                        "import_e.stl",  "import_e.3ds", "import_e.glb",
                                        "import_e.gltf", "import_e.xyz"};
    for (size_t i = 0; i < sizeof empty / sizeof *empty; i++) {
        save_text(empty[i], "");
        expect_refused(empty[i], HW_FORMAT, "empty");
        save_text(empty[i], "Dear reader, this is a letter and no model of anything.\n");
        expect_refused(empty[i], HW_FORMAT, "");
    }
}

static void test_bad_text_models(void **state)
{
    (void)state;
    static const struct {
        const char *path, *text, *cause;
    } cases[] = {
        {"import_x.obj", "v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n", "NaN"},
        {"import_x.obj", "v 0 0 0\nv 1 0 0\nv 0 inf 0\nf 1 2 3\n", "infinite"},
        {"import_x.obj", "v 0 0 0\nv 1 0 0\nv 0 1e12 0\nf 1 2 3\n", "beyond"},
        {"import_x.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4"},
        {"import_x.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n", "line 4"},
        {"import_x.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", "line 4"},
        {"import_x.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1 2/1 3/1\n", "line 4"},
        {"import_x.obj", "v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n", "line 2"},
        {"import_x.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no triangle"},
        {"import_x.obj", "v 0 0 0\nv 1 0 0\nf 1 2\n", "line 3"},
        {"import_x.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 nan 0\n3 0 1 2\n", "NaN"},
        {"import_x.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "index 3 out of range"},
        {"import_x.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n", "index -1 out of range"},
        {"import_x.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "truncated"},
        {"import_x.off", "OFF\n4000000000 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "truncated"},
        {"import_x.off", "OFF\n3 4000000000 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "truncated"},
        {"import_x.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n400000000 0 1 2\n", "fewer indices"},
        {"import_x.off", "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n", "no triangle"},
        {"import_x.off", "4OFF\n3 1 0\n0 0 0 1\n1 0 0 1\n0 1 0 1\n3 0 1 2\n", "dimensions"},
        {"import_x.ply",
         "ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\n"
         "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
         "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
         "line 13"},
        {"import_x.ply",
         "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
         "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
         "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
         "index 3 out of range"},
        {"import_x.ply",
         "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
         "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
         "0 0 0\n1 0 0\n0 1 nan\n3 0 1 2\n",
         "NaN"},
        {"import_x.ply",
         "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
         "property float z\nend_header\n0 0 0\n1 0 0\n0 1 0\n",
         "no triangle"},
        {"import_x.ply",
         "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\n"
         "property float y\nproperty float z\nelement face 4000000000\n"
         "property list uchar int vertex_indices\nend_header\nabc",
         "truncated"},
        {"import_x.ply", "ply\nformat ascii 2.0 or so\nelement vertex\n", "line 3"},
        {"import_x.stl", "solid a\nendsolid a\n", "no triangle"},
        {"import_x.stl",
         "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex nan 1 0\n"
         "endloop\nendfacet\nendsolid a\n",
         "NaN"},
        {"import_x.gltf", "{\"asset\":{\"version\":\"1.0\"}}", "version"},
        {"import_x.gltf", "{\"asset\":{\"version\":\"2.0\"}}", "no triangle"},
        {"import_x.gltf", "{\"asset\":{\"version\":\"2.0\"},\"meshes\":[{}]", "JSON"},
        {"import_x.gltf",
         "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":9,\"uri\":\"no.bin\"}]}",
         "no.bin is missing"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        save_text(cases[i].path, cases[i].text);
        expect_refused(cases[i].path, HW_OK, cases[i].cause);
    }
}

static void test_zero_area(void **state)
{
    (void)state;
    // Kept in a scene; nothing is left of it as a clean mesh.
    save_text("import_flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    hw_scene scene;
    hw_mesh mesh;
    assert_ok(hw_scene_import("import_flat.obj", &scene));
    assert_int_equal(hw_scene_triangle_count(&scene), 1);
    hw_scene_free(&scene);
    assert_int_equal(hw_mesh_import("import_flat.obj", &mesh), HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), "zero area"));
}

static void test_every_truncation(void **state)
{
    (void)state;
    static const char *const paths[] = {"import_t.ply", "import_t.ply", "import_t.stl",
                                        "import_t.stl", "import_t.3ds", "import_t.glb",
                                        "import_t.off"};
    for (int i = 0; i < 7; i++) {
        hw_bytes_writer w = {0};
        if (i < 2)
            put_ply(&w, i ? LITTLE : ASCII);
        else if (i < 4)
            put_stl(&w, i == 2);
        else if (i == 4)
            put_3ds(&w);
        else if (i == 5)
            put_glb(&w,
                    "{" TRIANGLE_JSON ",\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
                    "\"meshes\":[{\"primitives\":[" PRIMITIVE "]}]}",
                    &triangle, sizeof triangle);
        else
            put_off(&w);
        // Text may lose its last newline, OFF and PLY even digits of the last index (3 0 4 5).
        size_t complete = i == 0 || i == 2 || i == 6 ? w.size - 1 : w.size;
        for (size_t n = 0; n < complete; n++) {
            spill(paths[i], w.data, n);
            if (i == 2 && n >= w.size - 12)
                break; // "endsolid" is whole: only the name is missing
            expect_refused(paths[i], HW_FORMAT, "");
        }
        hw_bytes_writer_free(&w);
    }
}

static void test_random_damage(void **state)
{
    (void)state;
    hw_bytes_writer w[3] = {{0}};
    static const char *const paths[] = {"import_d.ply", "import_d.3ds", "import_d.glb"};
    put_ply(&w[0], LITTLE);
    put_3ds(&w[1]);
    put_glb(&w[2],
            "{" TRIANGLE_JSON ",\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
            "\"meshes\":[{\"primitives\":[" PRIMITIVE "]}]}",
            &triangle, sizeof triangle);
    hw_rng rng = hw_rng_make(11, 0);
    for (int i = 0; i < 600; i++) {
        hw_bytes_writer *f = &w[i % 3];
        size_t at = hw_rng_below(&rng, (uint32_t)f->size);
        uint8_t kept = f->data[at];
        f->data[at] = (uint8_t)hw_rng_u32(&rng);
        spill(paths[i % 3], f->data, f->size);
        hw_scene scene;
        if (hw_scene_import(paths[i % 3], &scene) == HW_OK) // then what came in is sound
            assert_ok(hw_scene_validate(&scene));
        hw_scene_free(&scene);
        f->data[at] = kept;
    }
    for (int i = 0; i < 3; i++)
        hw_bytes_writer_free(&w[i]);
}

static void test_every_allocation_may_fail(void **state)
{
    (void)state;
    save_triangle("import_alloc.glb",
                  "\"scenes\":[{\"nodes\":[0,1]}],\"meshes\":[{\"primitives\":[" PRIMITIVE
                  "]}],\"nodes\":[{\"mesh\":0},{\"mesh\":0,"
                  "\"scale\":[-1,1,1]}]");
    hw_status status = HW_MEMORY;
    uint64_t n = 0;
    while (status != HW_OK) {
        hw_scene scene;
        hw_alloc_fail_after(++n);
        status = hw_scene_import("import_alloc.glb", &scene);
        hw_alloc_fail_after(0);
        if (status != HW_OK && status != HW_MEMORY)
            fail_msg("%s", hw_error_text());
        hw_scene_free(&scene);
    }
    assert_true(n > 20);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_formats),
        cmocka_unit_test(test_3ds_stands_as_in_the_file),
        cmocka_unit_test(test_collada_stands_as_it_says),
        cmocka_unit_test(test_ply_colors),
        cmocka_unit_test(test_off_oddities),
        cmocka_unit_test(test_polygons),
        cmocka_unit_test(test_obj_materials),
        cmocka_unit_test(test_bad_files),
        cmocka_unit_test(test_bad_text_models),
        cmocka_unit_test(test_zero_area),
        cmocka_unit_test(test_every_truncation),
        cmocka_unit_test(test_random_damage),
        cmocka_unit_test(test_every_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, quiet, NULL);
}
