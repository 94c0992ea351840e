// Sketches: that they tell the outline and depths that a capture does.
#include "alloc.h"
#include "shapes.h"
#include "sketch.h"
#include <stdlib.h>

static const hw_capture_window window = {
    .centre = {1, 2, 3}, // looks along +y (face 1)
    .face = 1,
    .x_min = -0.3f,
    .x_max = 0.34f,
    .y_min = -0.25f,
    .y_max = 0.23f,
    .width = 80,
    .height = 60,
};

static hw_scene make_scene(void)
{
    hw_vec3 axis, right, up;
    hw_face_basis(window.face, &axis, &right, &up);
    hw_vec3 ahead = hw_v3_mad(window.centre, axis, 50);
    hw_mesh ball = shape_sphere(ahead, 8, 64, 32);
    hw_mesh before = shape_sphere(hw_v3_mad(hw_v3_mad(ahead, axis, -20), right, 4), 3, 64, 32);
    shape_append(&ball, &before);
    const hw_mat4 here = hw_mat4_identity();
    return shape_scene(&ball, &here, 1);
}

// Rays and triangles, by different code: they may differ where a point lies on an outline.
static void outline_and_depths_are_those_of_rays(void **state)
{
    (void)state;
    hw_scene scene = make_scene();
    hw_rays *rays;
    hw_capturer *capturer;
    hw_capture cast, drawn;
    assert_int_equal(hw_rays_create_scene(&rays, &scene), HW_OK);
    assert_int_equal(hw_capturer_create(&scene, rays, NULL, &capturer), HW_OK);
    assert_int_equal(hw_capture_object(capturer, 0, &window, 4, 0, &cast), HW_OK);
    assert_int_equal(hw_sketch(&scene.meshes[0], scene.meshes[0].positions, &window, &drawn),
                     HW_OK);
    assert_int_equal(drawn.width, window.width);
    assert_int_equal(drawn.height, window.height);
    uint32_t inside = 0, outside = 0, apart = 0;
    for (uint32_t i = 0; i < cast.width * cast.height; i++) {
        assert_true(abs(cast.coverage[i] - drawn.coverage[i]) <= 16);
        if (cast.coverage[i] == 0)
            assert_true(drawn.depths[i] == INFINITY);
        outside += cast.coverage[i] == 0;
        inside += cast.coverage[i] == 255;
        // A ray beside the texel's centre tells the cast depth; at the rim of the nearer ball the
        // one may lie on it, the other on the ball behind.
        apart += cast.coverage[i] == 255 && fabsf(cast.depths[i] - drawn.depths[i]) > 1;
    }
    assert_true(inside > 1000 && outside > 1000);
    assert_true(apart < 30);
    hw_capture_free(&cast);
    hw_capture_free(&drawn);
    hw_capturer_destroy(capturer);
    hw_rays_destroy(rays);
    hw_scene_free(&scene);
}

// A triangle across the line of sight: half of a texel's points, and exactly its depth.
static void a_flat_triangle_is_told_exactly(void **state)
{
    (void)state;
    hw_vec3 axis, right, up;
    hw_face_basis(window.face, &axis, &right, &up);
    hw_vec3 ahead = hw_v3_mad(window.centre, axis, 10), points[3];
    const float texel = 0.64f / 80, at[3][2] = {{10.5f, 20}, {30.5f, 20}, {10.5f, 40}};
    for (int k = 0; k < 3; k++)
        points[k] = hw_v3_mad(hw_v3_mad(ahead, right, 10 * (window.x_min + at[k][0] * texel)), up,
                              10 * (window.y_min + at[k][1] * texel));
    uint32_t indices[3] = {0, 2, 1}; // from behind, too
    const hw_mesh mesh = {.vertex_count = 3, .index_count = 3, .indices = indices};
    hw_capture out;
    assert_int_equal(hw_sketch(&mesh, points, &window, &out), HW_OK);
    const size_t row = 25 * 80;
    assert_int_equal(out.coverage[row + 9], 0);
    assert_int_equal(out.coverage[row + 10], 128);
    assert_int_equal(out.coverage[row + 11], 255);
    assert_int_equal(out.coverage[19 * 80 + 15], 0);
    assert_true(out.depths[row + 9] == INFINITY);
    assert_true(fabsf(out.depths[row + 12] - 10) < 1e-4f);
    hw_capture_free(&out);
}

static void memory_may_end_anywhere(void **state)
{
    (void)state;
    hw_scene scene = make_scene();
    hw_capture out;
    uint64_t n = 1;
    for (;; n++) {
        hw_alloc_fail_after(n);
        hw_status status = hw_sketch(&scene.meshes[0], scene.meshes[0].positions, &window, &out);
        hw_alloc_fail_after(0);
        if (status == HW_OK)
            break;
        assert_int_equal(status, HW_MEMORY);
        assert_null(out.coverage);
        assert_null(out.depths);
    }
    assert_int_equal(n, 5);
    hw_capture_free(&out);
    hw_scene_free(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(outline_and_depths_are_those_of_rays),
        cmocka_unit_test(a_flat_triangle_is_told_exactly),
        cmocka_unit_test(memory_may_end_anywhere),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
