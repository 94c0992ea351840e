// The competitor's chains: from the original down, honest errors, compact and complete meshes.
#include "lod_chain.h"
#include "models.h"
#include <stdlib.h>

// Triangles as sorted lists of positions, so that meshes compare whatever the order.
typedef struct triangle {
    float p[9];
} triangle;

static int compare_triangles(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(triangle));
}

static triangle *list_triangles(const hw_mesh *mesh)
{
    triangle *list = NULL;
    assert_ok(HW_NEW(&list, mesh->index_count / 3));
    for (uint32_t i = 0; i < mesh->index_count; i += 3) {
        // Turned so that the smallest corner comes first; the winding stays.
        triangle best = {{0}};
        for (uint32_t turn = 0; turn < 3; turn++) {
            triangle t;
            for (uint32_t k = 0; k < 3; k++)
                memcpy(&t.p[k * 3], &mesh->positions[mesh->indices[i + (k + turn) % 3]], 12);
            if (turn == 0 || memcmp(&t, &best, sizeof t) < 0)
                best = t;
        }
        list[i / 3] = best;
    }
    qsort(list, mesh->index_count / 3, sizeof *list, compare_triangles);
    return list;
}

static void check_compact(const hw_mesh *mesh)
{
    uint32_t next = 0;
    assert_ok(hw_mesh_validate(mesh));
    assert_non_null(mesh->normals);
    for (uint32_t i = 0; i < mesh->index_count; i++) {
        assert_true(mesh->indices[i] <= next); // in the order of use
        next += mesh->indices[i] == next;
    }
    assert_int_equal(next, mesh->vertex_count);
}

static void test_reorder(void **state)
{
    (void)state;
    hw_mesh sphere = model_sphere(24, 12), made = {0};
    assert_ok(hw_mesh_reorder(&sphere, sphere.indices, sphere.index_count, &made));
    check_compact(&made);
    assert_int_equal(made.index_count, sphere.index_count);
    triangle *a = list_triangles(&sphere), *b = list_triangles(&made);
    assert_memory_equal(a, b, sphere.index_count / 3 * sizeof *a);
    hw_mesh_free(&made);
    // A part of it, and without normals.
    hw_vec3 *normals = sphere.normals;
    sphere.normals = NULL;
    assert_ok(hw_mesh_reorder(&sphere, sphere.indices, 30, &made));
    assert_null(sphere.normals);
    check_compact(&made);
    assert_true(made.vertex_count <= 30);
    for (uint32_t i = 0; i < made.vertex_count; i++)
        assert_true(hw_v3_dot(made.normals[i], made.positions[i]) > 0.9f);
    hw_mesh_free(&made);
    sphere.normals = normals;
    hw_mesh_free(&sphere);
    hw_free(a);
    hw_free(b);
}

// Largest distance of the level's vertices and triangle centres to the unit sphere.
static double sphere_deviation(const hw_mesh *mesh)
{
    double worst = 0;
    for (uint32_t i = 0; i < mesh->index_count; i += 3) {
        hw_vec3 c = hw_v3(0, 0, 0);
        for (uint32_t k = 0; k < 3; k++)
            c = hw_v3_mad(c, mesh->positions[mesh->indices[i + k]], 1 / 3.0f);
        worst = fmax(worst, fabs(hw_v3_length(c) - 1));
    }
    return worst;
}

static void test_chain(void **state)
{
    (void)state;
    hw_mesh sphere = model_sphere(96, 48);
    hw_lod_chain chain;
    assert_ok(hw_lod_chain_make(&sphere, &chain));
    assert_true(chain.count >= 6);
    assert_true(chain.levels[0].error == 0);
    assert_int_equal(chain.levels[0].mesh.index_count, sphere.index_count);
    for (uint32_t i = 1; i < chain.count; i++) {
        const hw_lod_level *level = &chain.levels[i], *finer = &chain.levels[i - 1];
        check_compact(&level->mesh);
        assert_true(level->error >= finer->error);
        double ratio = (double)level->mesh.index_count / finer->mesh.index_count;
        assert_true(ratio > 0.3 && ratio < 0.86);
        // meshoptimizer's error is an estimate by quadrics, not a bound: the order of size.
        assert_true(sphere_deviation(&level->mesh) < 4 * level->error + 0.01);
        // Colours and normals are those of kept vertices.
        for (uint32_t v = 0; v < level->mesh.vertex_count; v++)
            assert_true(hw_v3_dot(level->mesh.normals[v], level->mesh.positions[v]) > 0.999f);
    }
    hw_lod_chain_free(&chain);
    assert_int_equal(chain.count, 0);
    hw_mesh_free(&sphere);
}

// Errors are lengths of the mesh's own unit.
static void test_errors_scale(void **state)
{
    (void)state;
    hw_mesh sphere = model_sphere(48, 24);
    hw_lod_chain small, large;
    assert_ok(hw_lod_chain_make(&sphere, &small));
    for (uint32_t i = 0; i < sphere.vertex_count; i++)
        sphere.positions[i] = hw_v3_scale(sphere.positions[i], 256);
    assert_ok(hw_lod_chain_make(&sphere, &large));
    assert_int_equal(small.count, large.count);
    for (uint32_t i = 1; i < small.count; i++)
        assert_true(fabsf(large.levels[i].error / small.levels[i].error - 256) < 1);
    hw_lod_chain_free(&small);
    hw_lod_chain_free(&large);
    hw_mesh_free(&sphere);
}

static void test_choose(void **state)
{
    (void)state;
    const float errors[4] = {0, 0.1f, 0.2f, 0.4f};
    assert_int_equal(hw_lod_chain_choose(errors, 4, 0), 0);
    assert_int_equal(hw_lod_chain_choose(errors, 4, 0.15), 1);
    assert_int_equal(hw_lod_chain_choose(errors, 4, 0.21), 2);
    assert_int_equal(hw_lod_chain_choose(errors, 4, INFINITY), 3);
    assert_int_equal(hw_lod_chain_choose(errors, 1, INFINITY), 0);
}

static void test_failing_allocations(void **state)
{
    (void)state;
    hw_mesh sphere = model_sphere(16, 8);
    hw_lod_chain chain;
    for (uint64_t n = 1;; n++) {
        assert_true(n < 1000);
        hw_alloc_fail_after(n);
        hw_status status = hw_lod_chain_make(&sphere, &chain);
        hw_alloc_fail_after(0);
        if (status == HW_OK)
            break;
        assert_int_equal(status, HW_MEMORY);
        assert_int_equal(chain.count, 0);
        assert_null(chain.levels[0].mesh.positions);
    }
    hw_lod_chain_free(&chain);
    hw_mesh_free(&sphere);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_reorder),
        cmocka_unit_test(test_chain),
        cmocka_unit_test(test_errors_scale),
        cmocka_unit_test(test_choose),
        cmocka_unit_test(test_failing_allocations),
    };
    return cmocka_run_group_tests_name("lod_chain", tests, NULL, NULL);
}
