#include "mesh_samples.h"

// ---- Value semantics ----------------------------------------------------------------------------

static void test_bounds_and_volume(void **state)
{
    (void)state;
    hw_mesh cube = sample_cube(), sphere = sample_sphere(4);
    hw_box box = hw_mesh_bounds(&cube);
    assert_true(box.min.x == -1 && box.min.y == -1 && box.min.z == -1);
    assert_true(box.max.x == 1 && box.max.y == 1 && box.max.z == 1);
    assert_close(hw_mesh_volume(&cube), 8, 1e-12);
    assert_int_equal(sphere.index_count / 3, 8 * 256);
    assert_int_equal(sphere.vertex_count, 2 + 8 * 256 / 2); // Euler: V = 2 + F / 2
    double volume = hw_mesh_volume(&sphere);
    assert_true(volume < 4 * HW_PI / 3 && volume > 0.99 * 4 * HW_PI / 3);
    assert_true(hw_box_is_empty(hw_mesh_bounds(&(hw_mesh){0})));
    hw_mesh_free(&cube);
    hw_mesh_free(&sphere);
    hw_mesh_free(NULL);
}

static void test_volume_far_from_origin(void **state)
{
    (void)state;
    hw_mesh cube = sample_cube();
    for (uint32_t i = 0; i < 8; i++)
        cube.positions[i] = hw_v3_add(cube.positions[i], hw_v3(1e6f, -1e6f, 1e6f));
    assert_close(hw_mesh_volume(&cube), 8, 1e-9);
    hw_mesh_free(&cube);
}

static void add_all_attributes(hw_mesh *mesh)
{
    assert_ok(hw_mesh_compute_normals(mesh));
    assert_ok(HW_NEW(&mesh->colors, mesh->vertex_count));
    assert_ok(HW_NEW(&mesh->uvs, mesh->vertex_count));
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        mesh->colors[i] = (hw_color8){(uint8_t)i, 2, 3, 255};
        mesh->uvs[i] = (hw_uv){(float)i, 0.5f};
    }
}

static void test_copy_hash_equal(void **state)
{
    (void)state;
    hw_mesh mesh = sample_octahedron(), copy;
    add_all_attributes(&mesh);
    assert_ok(hw_mesh_copy(&mesh, &copy));
    assert_true(hw_mesh_equal(&mesh, &copy));
    uint64_t hash = hw_mesh_hash(&mesh);
    assert_true(hash == hw_mesh_hash(&copy));
    hw_free(copy.name);
    copy.name = NULL; // the name does not count
    assert_true(hw_mesh_equal(&mesh, &copy) && hash == hw_mesh_hash(&copy));

    copy.positions[5].z -= 1;
    assert_false(hw_mesh_equal(&mesh, &copy));
    assert_true(hash != hw_mesh_hash(&copy));
    copy.positions[5].z += 1;
    copy.colors[0].a = 254;
    assert_false(hw_mesh_equal(&mesh, &copy));
    assert_true(hash != hw_mesh_hash(&copy));
    copy.colors[0].a = 255;
    sample_flip(&copy, 0);
    assert_false(hw_mesh_equal(&mesh, &copy));
    assert_true(hash != hw_mesh_hash(&copy));
    sample_flip(&copy, 0);
    assert_true(hw_mesh_equal(&mesh, &copy));
    hw_free(copy.uvs);
    copy.uvs = NULL;
    assert_false(hw_mesh_equal(&mesh, &copy));
    assert_true(hash != hw_mesh_hash(&copy));
    hw_mesh_free(&mesh);
    hw_mesh_free(&copy);
}

static void expect_invalid(const hw_mesh *mesh, const char *cause)
{
    assert_int_equal(hw_mesh_validate(mesh), HW_FORMAT);
    if (!strstr(hw_error_text(), cause) || !strstr(hw_error_text(), "octahedron"))
        fail_msg("\"%s\" does not name mesh and cause (%s)", hw_error_text(), cause);
}

static void test_validate(void **state)
{
    (void)state;
    hw_mesh mesh = sample_octahedron();
    add_all_attributes(&mesh);
    assert_ok(hw_mesh_validate(&mesh));
    static const float bad[] = {NAN, INFINITY, -INFINITY, 2e9f};
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 3; k++) {
            float *c = (float *)&mesh.positions[4] + k, kept = *c;
            *c = bad[i];
            expect_invalid(&mesh, i < 3 ? "vertex 4 has a NaN or infinite coordinate" : "beyond");
            *c = kept;
        }
    mesh.normals[2].y = NAN;
    expect_invalid(&mesh, "normal 2");
    mesh.normals[2].y = 1;
    mesh.uvs[3].v = INFINITY;
    expect_invalid(&mesh, "texture coordinate 3");
    mesh.uvs[3].v = 0;
    mesh.indices[7] = 6;
    expect_invalid(&mesh, "index 6 out of range");
    mesh.indices[7] = 5;
    mesh.index_count = 23;
    expect_invalid(&mesh, "no whole number of triangles");
    mesh.index_count = 0;
    expect_invalid(&mesh, "no triangle");
    hw_mesh_free(&mesh);
}

// ---- Normals ------------------------------------------------------------------------------------

static void assert_near(hw_vec3 a, hw_vec3 b, float tolerance)
{
    hw_vec3 d = hw_v3_sub(a, b);
    if (!(hw_v3_length(d) <= tolerance))
        fail_msg("(%g %g %g) is not (%g %g %g)", a.x, a.y, a.z, b.x, b.y, b.z);
}

static void test_normals(void **state)
{
    (void)state;
    hw_mesh whole = sample_octahedron(), parts = sample_exploded(&whole);
    assert_ok(hw_mesh_compute_normals(&whole));
    assert_ok(hw_mesh_compute_normals(&parts));
    // By symmetry the smooth normal of an octahedron's vertex is its own direction, shared or not.
    for (uint32_t i = 0; i < whole.vertex_count; i++)
        assert_near(whole.normals[i], whole.positions[i], 1e-6f);
    for (uint32_t i = 0; i < parts.vertex_count; i++)
        assert_near(parts.normals[i], parts.positions[i], 1e-6f);
    hw_mesh_free(&whole);
    hw_mesh_free(&parts);
}

static void test_normals_are_weighted_by_area(void **state)
{
    (void)state;
    // Two right triangles on the edge 0-1: areas 1/2 (facing z) and 3/2 (facing y).
    static const hw_vec3 p[5] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 3}, {9, 9, 9}};
    static const uint32_t t[6] = {0, 1, 2, 0, 3, 1};
    hw_mesh mesh = sample_mesh("fold", p, 5, t, 6);
    assert_ok(hw_mesh_compute_normals(&mesh));
    assert_near(mesh.normals[0], hw_v3_normalize(hw_v3(0, 3, 1)), 1e-6f);
    assert_near(mesh.normals[2], hw_v3(0, 0, 1), 1e-6f);
    assert_near(mesh.normals[4], hw_v3(0, 0, 1), 1e-6f); // of no triangle: up
    hw_mesh_free(&mesh);
}

// ---- Welding and cleaning -----------------------------------------------------------------------

static void test_weld_map(void **state)
{
    (void)state;
    static const hw_vec3 p[6] = {{0, 1, 2},          {-0.0f, 1, 2}, {0, 1, 2.0000002f},
                                 {0, 1, 2.0000002f}, {0, 1, 2},     {5, 5, 5}};
    static const uint32_t t[3] = {0, 2, 5};
    hw_mesh mesh = sample_mesh("points", p, 6, t, 3);
    uint32_t map[6];
    assert_ok(hw_mesh_weld_map(&mesh, map));
    static const uint32_t expected[6] = {0, 0, 2, 2, 0, 5}; // -0 equals 0; almost is not equal
    assert_memory_equal(map, expected, sizeof map);
    hw_mesh_free(&mesh);
}

static void test_weld_keeps_triangles(void **state)
{
    (void)state;
    hw_mesh cube = sample_cube(), mesh = sample_exploded(&cube);
    assert_ok(hw_mesh_weld(&mesh));
    assert_int_equal(mesh.vertex_count, 8);
    assert_int_equal(mesh.index_count, 36);
    assert_close(hw_mesh_volume(&mesh), 8, 1e-12);
    hw_mesh_free(&mesh);
    // Other attributes keep vertices apart.
    mesh = sample_exploded(&cube);
    assert_ok(HW_NEW(&mesh.colors, mesh.vertex_count));
    for (uint32_t i = 0; i < mesh.vertex_count; i++)
        mesh.colors[i].r = (uint8_t)(i / 6); // one colour for each face
    assert_ok(hw_mesh_weld(&mesh));
    assert_int_equal(mesh.vertex_count, 24);
    for (uint32_t i = 0; i < mesh.index_count; i++)
        assert_int_equal(mesh.colors[mesh.indices[i]].r, i / 6);
    hw_mesh_free(&mesh);
    hw_mesh_free(&cube);
}

static void test_clean(void **state)
{
    (void)state;
    static const hw_vec3 p[7] = {{7, 7, 7}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0},
                                 {2, 0, 0}, {1, 0, 0}, {0, 0, 0}};
    static const uint32_t t[] = {
        1, 2, 3, // good
        1, 1, 3, // a corner twice
        1, 5, 2, // two corners at one place
        1, 2, 4, // collinear
        2, 3, 1, // the first again, rotated
        3, 6, 5, // the first again, by twins
        1, 3, 2, // the first's back: stays
        2, 4, 3, // good
    };
    hw_mesh mesh = sample_mesh("mess", p, 7, t, sizeof t / sizeof *t);
    assert_ok(hw_mesh_clean(&mesh));
    static const uint32_t expected[9] = {0, 1, 2, 0, 2, 1, 1, 3, 2};
    assert_int_equal(mesh.vertex_count, 4);
    assert_int_equal(mesh.index_count, 9);
    assert_memory_equal(mesh.indices, expected, sizeof expected);
    assert_near(mesh.positions[3], hw_v3(2, 0, 0), 0);
    hw_mesh_free(&mesh);
}

static void test_clean_may_leave_nothing(void **state)
{
    (void)state;
    static const hw_vec3 p[3] = {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}};
    static const uint32_t t[3] = {0, 1, 2};
    hw_mesh mesh = sample_mesh("line", p, 3, t, 3);
    assert_ok(hw_mesh_clean(&mesh));
    assert_int_equal(mesh.index_count, 0);
    assert_int_equal(mesh.vertex_count, 0);
    hw_mesh_free(&mesh);
}

static void test_clean_keeps_thin_triangles(void **state)
{
    (void)state;
    // One float step off the line: an area of 6e-8, yet not zero.
    static const hw_vec3 p[3] = {{0, 0, 0}, {0.5f, 0.50000006f, 0}, {1, 1, 0}};
    static const uint32_t t[3] = {0, 1, 2};
    hw_mesh mesh = sample_mesh("sliver", p, 3, t, 3);
    assert_ok(hw_mesh_clean(&mesh));
    assert_int_equal(mesh.index_count, 3);
    hw_mesh_free(&mesh);
}

// ---- Orientation --------------------------------------------------------------------------------

// For star-shaped meshes about `centre`: all triangles face away from it.
static void assert_outward(const hw_mesh *mesh, uint32_t begin, uint32_t end, hw_vec3 centre)
{
    for (uint32_t i = begin; i < end; i++) {
        const uint32_t *t = mesh->indices + 3 * i;
        hw_vec3 a = hw_v3_sub(mesh->positions[t[0]], centre);
        hw_vec3 b = hw_v3_sub(mesh->positions[t[1]], centre);
        hw_vec3 c = hw_v3_sub(mesh->positions[t[2]], centre);
        if (!(hw_v3_dot(a, hw_v3_cross(b, c)) > 0))
            fail_msg("triangle %u faces inward", i);
    }
}

static void test_orient_random_flips(void **state)
{
    (void)state;
    for (uint64_t seed = 0; seed < 10; seed++) {
        hw_mesh mesh = sample_sphere(3);
        double volume = hw_mesh_volume(&mesh);
        if (seed % 2) { // unshared vertices make no difference
            hw_mesh parts = sample_exploded(&mesh);
            hw_mesh_free(&mesh);
            mesh = parts;
        }
        sample_flip_some(&mesh, seed);
        assert_true(fabs(hw_mesh_volume(&mesh) - volume) > 0.1);
        assert_ok(hw_mesh_orient(&mesh));
        assert_close(hw_mesh_volume(&mesh), volume, 1e-9);
        assert_outward(&mesh, 0, mesh.index_count / 3, hw_v3(0, 0, 0));
        hw_mesh_free(&mesh);
    }
}

static void test_orient_components(void **state)
{
    (void)state;
    hw_mesh mesh = sample_sphere(2), other = sample_sphere(2);
    uint32_t count = mesh.index_count / 3;
    for (uint32_t i = 0; i < count; i++)
        sample_flip(&other, i); // wholly inside out, and far away
    sample_append(&mesh, &other, hw_v3(-50, 3, 20));
    assert_ok(hw_mesh_orient(&mesh));
    assert_outward(&mesh, 0, count, hw_v3(0, 0, 0));
    assert_outward(&mesh, count, 2 * count, hw_v3(-50, 3, 20));
    hw_mesh_free(&mesh);
    hw_mesh_free(&other);
}

static void test_orient_open_bowl(void **state)
{
    (void)state;
    hw_mesh mesh = sample_sphere(3);
    uint32_t kept = 0; // the upper half only, far from the origin
    for (uint32_t i = 0; i < mesh.index_count; i += 3) {
        const uint32_t *t = mesh.indices + i;
        if (mesh.positions[t[0]].z < -1e-3f || mesh.positions[t[1]].z < -1e-3f ||
            mesh.positions[t[2]].z < -1e-3f)
            continue;
        memmove(mesh.indices + kept, t, 3 * sizeof *t);
        kept += 3;
    }
    mesh.index_count = kept;
    for (uint32_t i = 0; i < mesh.vertex_count; i++)
        mesh.positions[i].z -= 100;
    sample_flip_some(&mesh, 5);
    assert_ok(hw_mesh_orient(&mesh));
    assert_outward(&mesh, 0, kept / 3, hw_v3(0, 0, -100));
    hw_mesh_free(&mesh);
}

static void test_orient_non_manifold_edge(void **state)
{
    (void)state;
    // Two octahedra that share an edge (four triangles on it): neither may turn the other.
    hw_mesh mesh = sample_octahedron(), other = sample_octahedron();
    for (uint32_t i = 0; i < 8; i++)
        sample_flip(&other, i);
    sample_append(&mesh, &other, hw_v3(1, 1, 0)); // edge (1,0,0)-(0,1,0) is common to both
    assert_ok(hw_mesh_orient(&mesh));
    assert_outward(&mesh, 0, 8, hw_v3(0, 0, 0));
    assert_outward(&mesh, 8, 16, hw_v3(1, 1, 0));
    hw_mesh_free(&mesh);
    hw_mesh_free(&other);
}

static void test_orient_moebius(void **state)
{
    (void)state;
    enum { N = 30 };
    hw_vec3 p[2 * N];
    uint32_t t[6 * N];
    for (uint32_t i = 0; i < N; i++) {
        double a = 2 * HW_PI * i / N;
        for (int s = 0; s < 2; s++) {
            double w = s ? 0.3 : -0.3, r = 1 + w * cos(a / 2);
            p[2 * i + s] = hw_v3((float)(r * cos(a)), (float)(r * sin(a)), (float)(w * sin(a / 2)));
        }
        uint32_t j = (i + 1) % N, twist = i + 1 == N;
        uint32_t quad[4] = {2 * i, 2 * j + twist, 2 * j + 1 - twist, 2 * i + 1};
        uint32_t two[6] = {quad[0], quad[1], quad[2], quad[0], quad[2], quad[3]};
        memcpy(t + 6 * i, two, sizeof two);
    }
    hw_mesh mesh = sample_mesh("moebius", p, 2 * N, t, 6 * N);
    assert_ok(hw_mesh_orient(&mesh)); // has no orientation: any will do
    assert_int_equal(mesh.index_count, 6 * N);
    assert_ok(hw_mesh_validate(&mesh));
    hw_mesh_free(&mesh);
}

static void test_orient_renews_normals(void **state)
{
    (void)state;
    hw_mesh mesh = sample_octahedron();
    for (uint32_t i = 0; i < 8; i++)
        sample_flip(&mesh, i);
    assert_ok(hw_mesh_compute_normals(&mesh));
    assert_near(mesh.normals[0], hw_v3(-1, 0, 0), 1e-6f);
    assert_ok(hw_mesh_orient(&mesh));
    assert_near(mesh.normals[0], hw_v3(1, 0, 0), 1e-6f);
    hw_mesh_free(&mesh);
}

// ---- Transforms ---------------------------------------------------------------------------------

static void test_transform(void **state)
{
    (void)state;
    hw_mesh mesh = sample_sphere(3);
    double volume = hw_mesh_volume(&mesh);
    assert_ok(hw_mesh_compute_normals(&mesh));
    hw_mat4 m = hw_mat4_mul(hw_mat4_rotation_z(0.7), hw_mat4_scale(2, -3, 0.5)); // mirrors
    hw_mesh_transform(&mesh, &m);
    assert_close(hw_mesh_volume(&mesh), 3 * volume, 1e-4);
    // The normals of the image: as if computed from it.
    hw_mesh again;
    assert_ok(hw_mesh_copy(&mesh, &again));
    assert_ok(hw_mesh_compute_normals(&again));
    for (uint32_t i = 0; i < mesh.vertex_count; i++) {
        assert_close(hw_v3_length(mesh.normals[i]), 1, 1e-5);
        assert_true(hw_v3_dot(mesh.normals[i], again.normals[i]) > 0.97);
    }
    hw_mesh_free(&mesh);
    hw_mesh_free(&again);
}

// ---- Exhaustion ---------------------------------------------------------------------------------

static hw_status do_copy(hw_mesh *mesh)
{
    hw_mesh copy;
    hw_status status = hw_mesh_copy(mesh, &copy);
    hw_mesh_free(&copy);
    return status;
}

static void test_every_allocation_may_fail(void **state)
{
    (void)state;
    hw_status (*const steps[])(hw_mesh *) = {do_copy, hw_mesh_weld, hw_mesh_clean,
                                             hw_mesh_compute_normals, hw_mesh_orient};
    for (int s = 0; s < 5; s++) {
        hw_status status = HW_MEMORY;
        uint64_t n = 0;
        while (status != HW_OK) {
            hw_mesh mesh = sample_sphere(1);
            add_all_attributes(&mesh);
            sample_flip_some(&mesh, 1);
            hw_alloc_fail_after(++n);
            status = steps[s](&mesh);
            hw_alloc_fail_after(0);
            assert_true(status == HW_OK || status == HW_MEMORY);
            hw_mesh_free(&mesh);
        }
        assert_true(n > 2);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bounds_and_volume),
        cmocka_unit_test(test_volume_far_from_origin),
        cmocka_unit_test(test_copy_hash_equal),
        cmocka_unit_test(test_validate),
        cmocka_unit_test(test_normals),
        cmocka_unit_test(test_normals_are_weighted_by_area),
        cmocka_unit_test(test_weld_map),
        cmocka_unit_test(test_weld_keeps_triangles),
        cmocka_unit_test(test_clean),
        cmocka_unit_test(test_clean_may_leave_nothing),
        cmocka_unit_test(test_clean_keeps_thin_triangles),
        cmocka_unit_test(test_orient_random_flips),
        cmocka_unit_test(test_orient_components),
        cmocka_unit_test(test_orient_open_bowl),
        cmocka_unit_test(test_orient_non_manifold_edge),
        cmocka_unit_test(test_orient_moebius),
        cmocka_unit_test(test_orient_renews_normals),
        cmocka_unit_test(test_transform),
        cmocka_unit_test(test_every_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
