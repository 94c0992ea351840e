// Meshes are turned so that z is up; the world stays as it is.
#include "rng.h"
#include "scene_upright.h"
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

static hw_scene make_scene(uint32_t objects)
{
    hw_rng rng = hw_rng_make(3, 0);
    hw_scene s = {.mesh_count = 1, .material_count = 1, .object_count = objects};
    assert_int_equal(HW_NEW(&s.meshes, 1), HW_OK);
    assert_int_equal(HW_NEW(&s.materials, 1), HW_OK);
    assert_int_equal(HW_NEW(&s.objects, objects), HW_OK);
    hw_mesh *m = &s.meshes[0];
    m->vertex_count = m->index_count = 30;
    assert_int_equal(HW_NEW(&m->positions, 30), HW_OK);
    assert_int_equal(HW_NEW(&m->normals, 30), HW_OK);
    assert_int_equal(HW_NEW(&m->indices, 30), HW_OK);
    for (uint32_t i = 0; i < 30; i++) {
        m->positions[i] =
            hw_v3(9 * hw_rng_float(&rng) - 4, hw_rng_float(&rng), 3 * hw_rng_float(&rng));
        m->normals[i] = hw_v3_normalize(hw_v3(hw_rng_float(&rng), 1, hw_rng_float(&rng)));
        m->indices[i] = i;
    }
    for (uint32_t i = 0; i < objects; i++)
        s.objects[i].transform = hw_mat4_identity();
    hw_scene_update_bounds(&s);
    return s;
}

// Rotation by an angle about x, or z.
static hw_mat4 rotation(double angle, bool about_z)
{
    hw_mat4 m = hw_mat4_identity();
    int a = about_z ? 0 : 1, b = about_z ? 1 : 2;
    m.m[5 * a] = m.m[5 * b] = cos(angle);
    m.m[4 * a + b] = sin(angle);
    m.m[4 * b + a] = -sin(angle);
    return m;
}

static void assert_same_world(const hw_scene *a, const hw_scene *b, double tolerance)
{
    for (uint32_t i = 0; i < a->object_count; i++) {
        for (uint32_t v = 0; v < a->meshes[0].vertex_count; v++) {
            hw_vec3 p = hw_mat4_point(&a->objects[i].transform, a->meshes[0].positions[v]);
            hw_vec3 q = hw_mat4_point(&b->objects[i].transform, b->meshes[0].positions[v]);
            hw_vec3 n = hw_mat4_normal(&a->objects[i].transform, a->meshes[0].normals[v]);
            hw_vec3 o = hw_mat4_normal(&b->objects[i].transform, b->meshes[0].normals[v]);
            assert_true((double)hw_v3_length(hw_v3_sub(p, q)) <= tolerance);
            assert_true((double)hw_v3_length(hw_v3_sub(n, o)) <= tolerance);
        }
        hw_box p = a->objects[i].bounds, q = b->objects[i].bounds;
        assert_true((double)hw_v3_length(hw_v3_sub(p.min, q.min)) <= tolerance);
        assert_true((double)hw_v3_length(hw_v3_sub(p.max, q.max)) <= tolerance);
    }
}

// As glTF has it: y is up. A quarter turn is exact.
static void test_y_up(void **state)
{
    (void)state;
    hw_scene s = make_scene(1), same = make_scene(1);
    const double y_up[16] = {1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 5, 6, 7, 1};
    memcpy(s.objects[0].transform.m, y_up, sizeof y_up);
    memcpy(same.objects[0].transform.m, y_up, sizeof y_up);
    hw_scene_update_bounds(&s);
    hw_scene_update_bounds(&same);
    assert_int_equal(hw_scene_stand_upright(&s), HW_OK);
    for (uint32_t v = 0; v < 30; v++) {
        assert_true(s.meshes[0].positions[v].x == same.meshes[0].positions[v].x);
        assert_true(s.meshes[0].positions[v].y == -same.meshes[0].positions[v].z);
        assert_true(s.meshes[0].positions[v].z == same.meshes[0].positions[v].y);
    }
    assert_same_world(&s, &same, 1e-6);
    hw_scene_free(&s);
    hw_scene_free(&same);
}

// What stands upright stays bit by bit, however it is turned about z, scaled and moved, and
// whatever a later object does.
static void test_upright(void **state)
{
    (void)state;
    hw_scene s = make_scene(2);
    s.objects[0].transform = rotation(0.7, true);
    for (int k = 0; k < 12; k++)
        s.objects[0].transform.m[k] *= 2.5;
    s.objects[0].transform.m[12] = 40;
    s.objects[1].transform = rotation(1, false);
    hw_scene_update_bounds(&s);
    uint64_t hash = hw_scene_hash(&s);
    assert_int_equal(hw_scene_stand_upright(&s), HW_OK);
    assert_true(hw_scene_hash(&s) == hash);
    hw_scene_free(&s);
}

// Any tilt, upside down too: the first object's up becomes z, the second goes along.
static void test_tilts(void **state)
{
    (void)state;
    for (int i = 1; i <= 12; i++) {
        hw_scene s = make_scene(2), same = make_scene(2);
        hw_mat4 tilt = hw_mat4_mul(rotation(i * 0.31, true),
                                   hw_mat4_mul(rotation(i * HW_PI / 6, false), rotation(i, true)));
        s.objects[0].transform = same.objects[0].transform = tilt;
        s.objects[1].transform = same.objects[1].transform = rotation(0.2 * i, false);
        hw_scene_update_bounds(&s);
        hw_scene_update_bounds(&same);
        assert_int_equal(hw_scene_stand_upright(&s), HW_OK);
        const double *m = s.objects[0].transform.m;
        assert_true(fabs(m[2]) < 1e-6 && fabs(m[6]) < 1e-6 && m[10] > 0.999);
        assert_same_world(&s, &same, 1e-4);
        hw_scene_free(&s);
        hw_scene_free(&same);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_y_up), cmocka_unit_test(test_upright),
                                       cmocka_unit_test(test_tilts)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
