// Details: which level a capture is cast against, and that it shows what the original shows.
#include "capture.h"
#include "shapes.h"
#include <stdlib.h>

#define DISTANCE 200.0
#define SIDE     64u

typedef struct stage {
    hw_scene scene;
    hw_rays *rays;
    hw_chain chain;
    hw_details *details;
    hw_capturer *capturer;
} stage;

static void set_stage(stage *s, bool textured)
{
    const hw_chain_options options = {.pull_back = -1,
                                      .shade_step = textured ? 0 : HW_NEAR_LEVEL_STRIDE};
    hw_mesh mesh = shape_sphere(hw_v3(0, 0, 0), 1, 64, 32);
    if (textured)
        assert_int_equal(HW_NEW(&mesh.uvs, mesh.vertex_count), HW_OK);
    hw_vec3 axis, right, up; // of face 0, which it is captured through
    hw_face_basis(0, &axis, &right, &up);
    hw_mat4 place = hw_mat4_mul(hw_mat4_translation(DISTANCE * axis.x, DISTANCE * axis.y, 12),
                                hw_mat4_scale(10, 10, 10));
    s->scene = shape_scene(&mesh, &place, 1);
    assert_int_equal(hw_chain_make(&s->scene.meshes[0], &options, &s->chain), HW_OK);
    assert_int_equal(hw_rays_create_scene(&s->rays, &s->scene), HW_OK);
    assert_int_equal(hw_details_create(&s->scene, s->rays, &s->chain, NULL, &s->details), HW_OK);
    assert_int_equal(hw_capturer_create(&s->scene, s->rays, s->details, &s->capturer), HW_OK);
}

static void clear_stage(stage *s)
{
    hw_capturer_destroy(s->capturer);
    hw_details_destroy(s->details);
    hw_rays_destroy(s->rays);
    hw_chain_free(&s->chain);
    hw_scene_free(&s->scene);
}

static uint32_t level_of(const stage *s, const hw_mesh *mesh)
{
    for (uint32_t l = 1; l < s->chain.level_count; l++)
        if (s->chain.levels[l].indices == mesh->indices)
            return l;
    assert_ptr_equal(mesh, &s->scene.meshes[0]);
    return 0;
}

static void the_coarsest_within_the_error(void **state)
{
    (void)state;
    stage s;
    set_stage(&s, false);
    uint32_t before = 0, different = 0;
    assert_int_equal(level_of(&s, hw_details_choose(s.details, 0, 0).mesh), 0);
    for (double error = 1e-5; error < 1; error *= 1.3) {
        uint32_t l = level_of(&s, hw_details_choose(s.details, 0, error).mesh);
        assert_true(l >= before);
        assert_true(l == 0 || (double)hw_mesh_level_error(&s.chain.infos[l]) <= error);
        different += l != before;
        before = l;
    }
    assert_true(different >= 3);
    assert_true(s.chain.infos[before].index_count < s.chain.infos[0].index_count / 8);
    clear_stage(&s);
}

// Levels have no uvs.
static void what_has_uvs_stays_as_it_is(void **state)
{
    (void)state;
    stage s;
    set_stage(&s, true);
    assert_true(s.chain.level_count > 8);
    assert_int_equal(level_of(&s, hw_details_choose(s.details, 0, 1e9).mesh), 0);
    clear_stage(&s);
}

// Where both see the object, depths differ by no more than the error allows on a sphere (its face
// is seen under less than 60 degrees in the middle of the window); outlines by less than a texel.
static void a_capture_keeps_to_the_error(void **state)
{
    (void)state;
    stage s;
    set_stage(&s, false);
    const hw_capture_window window = {hw_v3(0, 0, 12), 0, -0.06f, 0.06f, -0.06f, 0.06f, SIDE, SIDE};
    const double error = 0.2; // world units: 0.02 of the mesh's
    assert_true(level_of(&s, hw_details_choose(s.details, 0, error / 10).mesh) > 0);
    hw_capture exact, cheap;
    assert_int_equal(hw_capture_object(s.capturer, 0, &window, 2, 0, &exact), HW_OK);
    assert_int_equal(hw_capture_object(s.capturer, 0, &window, 2, error, &cheap), HW_OK);
    uint32_t seen = 0, other = 0;
    for (uint32_t i = 0; i < SIDE * SIDE; i++) {
        seen += exact.coverage[i] == 255;
        other += exact.depths[i] != cheap.depths[i];
        if (exact.coverage[i] == 255 && cheap.coverage[i] == 255 &&
            exact.depths[i] < (float)DISTANCE - 5)
            assert_float_equal(exact.depths[i], cheap.depths[i], 2 * error + 1e-3);
    }
    assert_true(seen > 1000 && other > 1000); // it is another mesh
    uint32_t moved_outline = 0;
    for (uint32_t i = 0; i < SIDE * SIDE; i++)
        moved_outline += abs((int)exact.coverage[i] - (int)cheap.coverage[i]) > 128;
    assert_true(moved_outline < 20);
    hw_capture_free(&exact);
    hw_capture_free(&cheap);
    clear_stage(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_coarsest_within_the_error),
        cmocka_unit_test(what_has_uvs_stays_as_it_is),
        cmocka_unit_test(a_capture_keeps_to_the_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
