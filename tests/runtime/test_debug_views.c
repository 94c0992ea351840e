// Views for looking behind the picture: tints, wireframe, frozen culling, comparisons.
#include "models.h"

#include "compare_view.h"
#include "debug_view.h"
#include <math.h>

#define SIZE 96u

// A white board across the view, 10 ahead of the origin along +y, and one behind.
static hw_scene board_scene(void)
{
    hw_scene scene = model_scene(1, 2);
    scene.meshes[0] = model_mesh(4, 6);
    model_face(&scene.meshes[0], 0, hw_v3(-3, 10, -3), hw_v3(6, 0, 0), hw_v3(0, 0, 6));
    scene.objects[1].transform = hw_mat4_rotation_z(HW_PI);
    hw_scene_update_bounds(&scene);
    return scene;
}

static hw_camera ahead(void)
{
    return model_camera(hw_v3(0, 0, 0), hw_v3(0, 1, 0), SIZE);
}

typedef struct stage {
    hw_scene scene;
    hw_renderer *renderer;
    hw_target *target;
    hw_image image;
} stage;

static stage open_stage(hw_config config)
{
    stage s = {.scene = board_scene()};
    const hw_renderer_desc desc = {.config = config, .scene = &s.scene, .lod_error_px = 1};
    assert_ok(hw_renderer_create(&desc, &s.renderer));
    assert_ok(hw_target_create(&s.target, SIZE, SIZE, 1));
    return s;
}

static void close_stage(stage *s)
{
    hw_image_free(&s->image);
    hw_target_destroy(s->target);
    hw_renderer_destroy(s->renderer);
    hw_scene_free(&s->scene);
}

static hw_frame_stats draw(stage *s, const hw_debug_view *view, const hw_camera *camera)
{
    hw_frame_stats stats;
    hw_renderer_set_debug_view(s->renderer, view);
    hw_target_bind(s->target);
    assert_ok(hw_renderer_draw(s->renderer, camera, &stats));
    assert_ok(hw_target_read(s->target, &s->image));
    return stats;
}

static void test_tints(void **state)
{
    (void)state;
    static const struct {
        hw_config config;
        hw_representation representation;
    } cases[] = {{HW_CONFIG_A, HW_REPRESENTATION_FULL},
                 {HW_CONFIG_B, HW_REPRESENTATION_FULL},
                 {HW_CONFIG_L, HW_REPRESENTATION_LOD}};
    const float light = hw_light(hw_v3(0, -1, 0));
    const hw_camera camera = ahead();
    for (int i = 0; i < 3; i++) {
        stage s = open_stage(cases[i].config);
        draw(&s, &(hw_debug_view){.tint = true}, &camera);
        const float *c = hw_representation_color(cases[i].representation);
        model_assert_color(&s.image, SIZE / 2, SIZE / 2, c[0] * light, c[1] * light, c[2] * light,
                           1);
        assert_int_equal(model_pixel(&s.image, SIZE / 2, SIZE / 2)[3], 255);
        // Sky keeps its colour, and the next plain picture is plain.
        model_assert_color(&s.image, 2, 2, HW_SKY_R, HW_SKY_G, HW_SKY_B, 1);
        draw(&s, &(hw_debug_view){0}, &camera);
        model_assert_color(&s.image, SIZE / 2, SIZE / 2, light, light, light, 1);
        close_stage(&s);
    }
    for (int a = 0; a < HW_REPRESENTATION_COUNT; a++)
        for (int b = 0; b < a; b++)
            assert_memory_not_equal(hw_representation_color((hw_representation)a),
                                    hw_representation_color((hw_representation)b),
                                    3 * sizeof(float));
}

static uint32_t object_pixels(const hw_image *image)
{
    uint32_t count = 0;
    for (size_t i = 0; i < (size_t)SIZE * SIZE; i++)
        count += image->data[4 * i + 3] == 255;
    return count;
}

static void test_wireframe(void **state)
{
    (void)state;
    stage s = open_stage(HW_CONFIG_B);
    const hw_camera camera = ahead();
    draw(&s, &(hw_debug_view){0}, &camera);
    uint32_t whole = object_pixels(&s.image);
    draw(&s, &(hw_debug_view){.wireframe = true}, &camera);
    uint32_t lines = object_pixels(&s.image);
    // Four sides and a diagonal of a square of 50 pixels.
    assert_true(whole > 2000 && lines > 150 && lines < 400);
    draw(&s, &(hw_debug_view){0}, &camera);
    assert_int_equal(object_pixels(&s.image), whole);
    close_stage(&s);
}

// Frozen on the board ahead, the one behind is not drawn even when it is in view.
static void test_frozen_culling(void **state)
{
    (void)state;
    const hw_config configs[] = {HW_CONFIG_B, HW_CONFIG_L};
    for (int i = 0; i < 2; i++) {
        stage s = open_stage(configs[i]);
        const hw_camera camera = ahead(),
                        back = model_camera(hw_v3(0, 0, 0), hw_v3(0, -1, 0), SIZE);
        const hw_debug_view frozen = {.frozen = true, .camera = camera};
        assert_int_equal(draw(&s, &frozen, &back).triangles, 2);
        assert_int_equal(object_pixels(&s.image), 0);
        assert_int_equal(draw(&s, &frozen, &camera).triangles, 2);
        uint32_t whole = object_pixels(&s.image);
        assert_true(whole > 2000);
        draw(&s, &(hw_debug_view){0}, &back);
        assert_int_equal(object_pixels(&s.image), whole);
        close_stage(&s);
    }
}

// ---- Comparisons

// Left the board in half its colour, right as it is.
static void test_split_and_errors(void **state)
{
    (void)state;
    stage left = open_stage(HW_CONFIG_B), right = open_stage(HW_CONFIG_A);
    const hw_camera camera = ahead();
    const float light = hw_light(hw_v3(0, -1, 0));
    const float *tint = hw_representation_color(HW_REPRESENTATION_FULL);
    hw_compare_view *view;
    assert_ok(hw_compare_view_create(&view));
    hw_renderer_set_debug_view(left.renderer, &(hw_debug_view){.tint = true});
    for (uint32_t samples = 1; samples <= 4; samples += 3) {
        hw_compare_desc desc = {.mode = HW_COMPARE_SPLIT,
                                .left = left.renderer,
                                .right = right.renderer,
                                .camera = &camera,
                                .samples = samples,
                                .seam = 0.5};
        hw_compare_result result;
        hw_target_bind(left.target);
        assert_ok(hw_compare_view_draw(view, &desc, &result));
        assert_ok(hw_target_read(left.target, &left.image));
        assert_int_equal(result.stats.triangles, 2);
        const uint32_t y = SIZE / 2;
        model_assert_color(&left.image, 40, y, tint[0] * light, tint[1] * light, tint[2] * light,
                           1);
        model_assert_color(&left.image, 56, y, light, light, light, 1);
        model_assert_color(&left.image, SIZE / 2, y, 1, 1, 1, 0); // the seam
        assert_int_equal(model_pixel(&left.image, 40, y)[3], 255);
        assert_int_equal(model_pixel(&left.image, 2, 2)[3], 0);
        // Errors: the ramp's colour on the board, dark sky where both agree.
        desc.mode = HW_COMPARE_ERRORS;
        desc.measure = true;
        hw_target_bind(left.target);
        assert_ok(hw_compare_view_draw(view, &desc, &result));
        assert_ok(hw_target_read(left.target, &left.image));
        double luma = 0.299 * tint[0] + 0.587 * tint[1] + 0.114 * tint[2];
        double error = 255 * light * (1 - luma);
        float rgb[3];
        hw_compare_error_color(fmin(error / HW_COMPARE_SCALE, 1), rgb);
        model_assert_color(&left.image, 56, y, rgb[0], rgb[1], rgb[2], 24);
        const float sky = 0.3f * (0.299f * HW_SKY_R + 0.587f * HW_SKY_G + 0.114f * HW_SKY_B);
        model_assert_color(&left.image, 2, 2, sky, sky, sky, 1);
        double share = (double)object_pixels(&left.image) / (SIZE * SIZE);
        double psnr = 10 * log10(255 * 255 / (error * error * share));
        assert_true(fabs(result.psnr - psnr) < 0.3);
    }
    // Equal pictures.
    hw_renderer_set_debug_view(left.renderer, &(hw_debug_view){0});
    const hw_compare_desc desc = {.mode = HW_COMPARE_ERRORS,
                                  .left = left.renderer,
                                  .right = right.renderer,
                                  .camera = &camera,
                                  .samples = 1,
                                  .measure = true};
    hw_compare_result result;
    hw_target_bind(left.target);
    assert_ok(hw_compare_view_draw(view, &desc, &result));
    assert_true(isinf(result.psnr));
    hw_compare_view_destroy(view);
    hw_compare_view_destroy(NULL);
    close_stage(&left);
    close_stage(&right);
}

// What it draws into afterwards is what was bound before, at any size.
static void test_comparison_of_changing_size(void **state)
{
    (void)state;
    stage s = open_stage(HW_CONFIG_B);
    hw_compare_view *view;
    assert_ok(hw_compare_view_create(&view));
    const uint32_t sizes[] = {96, 50, 128};
    for (int i = 0; i < 3; i++) {
        hw_target *target;
        hw_image image = {0};
        assert_ok(hw_target_create(&target, sizes[i], sizes[i], 1));
        hw_target_bind(target);
        const hw_camera camera = model_camera(hw_v3(0, 0, 0), hw_v3(0, 1, 0), sizes[i]);
        const hw_compare_desc desc = {.mode = HW_COMPARE_SPLIT,
                                      .left = s.renderer,
                                      .right = s.renderer,
                                      .camera = &camera,
                                      .samples = 1};
        hw_compare_result result;
        assert_ok(hw_compare_view_draw(view, &desc, &result));
        assert_ok(hw_target_read(target, &image));
        float light = hw_light(hw_v3(0, -1, 0));
        model_assert_color(&image, sizes[i] / 2, sizes[i] / 2, light, light, light, 1);
        hw_image_free(&image);
        hw_target_destroy(target);
    }
    hw_compare_view_destroy(view);
    close_stage(&s);
}

static void test_ramp(void **state)
{
    (void)state;
    static const struct {
        double t;
        float rgb[3];
    } cases[] = {{0, {0, 0, 1}}, {0.375, {0.25f, 1, 0}}, {0.75, {1, 0.5f, 0}}, {1, {1, 0, 0}}};
    for (int i = 0; i < 4; i++) {
        float rgb[3];
        hw_compare_error_color(cases[i].t, rgb);
        for (int k = 0; k < 3; k++)
            assert_true(fabsf(rgb[k] - cases[i].rgb[k]) < 1e-6f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_tints),
        cmocka_unit_test(test_wireframe),
        cmocka_unit_test(test_frozen_culling),
        cmocka_unit_test(test_split_and_errors),
        cmocka_unit_test(test_comparison_of_changing_size),
        cmocka_unit_test(test_ramp),
    };
    return cmocka_run_group_tests(tests, model_context_open, model_context_close);
}
