// Configurations A, B and L: analytic places and colours, and that they agree with each other.
#include "cull.h"
#include "gpu.h"
#include "lod_chain.h"
#include "models.h"
#include <stdlib.h>

static hw_scene cube_scene(void)
{
    hw_scene scene = model_scene(1, 1);
    scene.meshes[0] = model_box(hw_v3(1, 1, 1));
    scene.materials[0].base_color[0] = 0.9f;
    scene.materials[0].base_color[1] = 0.5f;
    scene.materials[0].base_color[2] = 0.25f;
    hw_scene_update_bounds(&scene);
    return scene;
}

static void assert_equal_images(const hw_image *a, const hw_image *b)
{
    assert_int_equal(a->width, b->width);
    assert_memory_equal(a->data, b->data, (size_t)a->width * a->height * 4);
}

// Pixels whose centres lie within the square `half` pixels round the image's middle are object.
static void check_square(const hw_image *image, double half, float r, float g, float b)
{
    double middle = image->width / 2.0;
    for (uint32_t y = 0; y < image->height; y++) {
        for (uint32_t x = 0; x < image->width; x++) {
            double dx = fabs(x + 0.5 - middle), dy = fabs(y + 0.5 - middle);
            bool inside = dx < half && dy < half;
            if (fabs(dx - half) < 0.01 || fabs(dy - half) < 0.01)
                continue;
            assert_int_equal(model_pixel(image, x, y)[3], inside ? 255 : 0);
            if (inside)
                model_assert_color(image, x, y, r, g, b, 1);
            else
                model_assert_color(image, x, y, HW_SKY_R, HW_SKY_G, HW_SKY_B, 1);
        }
    }
}

// A face of half size 1 at distance 9 covers focal / 9 pixels on each side of the middle, in the
// colour that hw_light gives its normal.
static void test_cube_place_and_color(void **state)
{
    (void)state;
    static const hw_vec3 normals[] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}};
    hw_scene scene = cube_scene();
    for (int i = 0; i < 4; i++) {
        hw_vec3 n = normals[i];
        hw_camera camera = model_camera(hw_v3_scale(n, 10), hw_v3_scale(n, -1), 256);
        hw_frame_stats stats;
        hw_image image = model_render(HW_CONFIG_B, &scene, &camera, 0, &stats);
        float light = hw_light(n);
        check_square(&image, hw_camera_focal_px(&camera) / 9, 0.9f * light, 0.5f * light,
                     0.25f * light);
        assert_int_equal(stats.triangles, 12);
        assert_int_equal(stats.draws, 1);
        hw_image_free(&image);
    }
    hw_scene_free(&scene);
}

// The light follows the object's rotation and is not misled by its scale.
static void test_transformed_normals(void **state)
{
    (void)state;
    hw_scene scene = cube_scene();
    double angle = 0.5;
    scene.objects[0].transform = hw_mat4_mul(hw_mat4_rotation_z(angle), hw_mat4_scale(2, 2, 0.5));
    hw_scene_update_bounds(&scene);
    hw_vec3 n = hw_v3((float)cos(angle), (float)sin(angle), 0);
    hw_camera camera = model_camera(hw_v3_scale(n, 10), hw_v3_scale(n, -1), 64);
    hw_image image = model_render(HW_CONFIG_B, &scene, &camera, 0, NULL);
    float light = hw_light(n);
    model_assert_color(&image, 32, 32, 0.9f * light, 0.5f * light, 0.25f * light, 1);
    hw_image_free(&image);
    hw_scene_free(&scene);
}

// A mirrored object still shows its outside.
static void test_mirrored(void **state)
{
    (void)state;
    hw_scene scene = cube_scene();
    hw_camera camera = model_camera(hw_v3(3, -10, 4), hw_v3(-3, 10, -4), 128);
    hw_image plain = model_render(HW_CONFIG_B, &scene, &camera, 0, NULL);
    scene.objects[0].transform = hw_mat4_scale(-1, 1, 1);
    hw_image mirrored = model_render(HW_CONFIG_B, &scene, &camera, 0, NULL);
    assert_equal_images(&plain, &mirrored);
    hw_image_free(&plain);
    hw_image_free(&mirrored);
    hw_scene_free(&scene);
}

// Textured: the image's top row is up, its left column left (seen from the front).
static void test_texture_orientation(void **state)
{
    (void)state;
    static const uint8_t corners[4][3] = {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {255, 255, 0}};
    hw_scene scene = model_scene(1, 1);
    hw_image *texture = &scene.materials[0].texture;
    scene.meshes[0] = model_mesh(4, 6);
    assert_ok(HW_NEW(&scene.meshes[0].uvs, 4));
    model_face(&scene.meshes[0], 0, hw_v3(-1, 0, -1), hw_v3(2, 0, 0), hw_v3(0, 0, 2));
    hw_scene_update_bounds(&scene);
    assert_ok(hw_image_make(texture, 16, 16, 3));
    for (uint32_t i = 0; i < 256; i++)
        memcpy(texture->data + i * 3, corners[(i / 16 >= 8) * 2 + (i % 16 >= 8)], 3);
    hw_camera camera = model_camera(hw_v3(0, -2, 0), hw_v3(0, 1, 0), 128);
    hw_image image = model_render(HW_CONFIG_B, &scene, &camera, 0, NULL);
    float light = hw_light(hw_v3(0, -1, 0));
    model_assert_color(&image, 44, 44, light, 0, 0, 2);
    model_assert_color(&image, 84, 44, 0, light, 0, 2);
    model_assert_color(&image, 44, 84, 0, 0, light, 2);
    model_assert_color(&image, 84, 84, light, light, 0, 2);
    hw_image_free(&image);
    hw_scene_free(&scene);
}

static void test_ground(void **state)
{
    (void)state;
    hw_scene scene = cube_scene();
    scene.objects[0].transform = hw_mat4_translation(0, 0, 1);
    hw_scene_update_bounds(&scene);
    scene.ground = (hw_ground){true, {{-500, -500, 0}, {500, 500, 0}}, {0.4f, 0.6f, 0.2f}};
    hw_camera camera = model_camera(hw_v3(0, -20, 5), hw_v3(0, 1, 0), 128);
    hw_frame_stats stats;
    hw_image image = model_render(HW_CONFIG_B, &scene, &camera, 0, &stats);
    float light = hw_light(hw_v3(0, 0, 1));
    model_assert_color(&image, 5, 125, 0.4f * light, 0.6f * light, 0.2f * light, 1);
    assert_int_equal(model_pixel(&image, 5, 125)[3], 0);
    model_assert_color(&image, 5, 5, HW_SKY_R, HW_SKY_G, HW_SKY_B, 1);
    assert_int_equal(model_pixel(&image, 64, 85)[3], 255); // the cube stands on it
    assert_int_equal(stats.triangles, 14);
    hw_image_free(&image);
    hw_scene_free(&scene);
}

// Half sunk, an object shows its upper half only.
static void test_ground_hides_what_is_below(void **state)
{
    (void)state;
    hw_scene scene = cube_scene();
    scene.ground = (hw_ground){true, {{-500, -500, 0}, {500, 500, 0}}, {0.4f, 0.6f, 0.2f}};
    hw_camera camera = model_camera(hw_v3(0, -10, 0.5f), hw_v3(0, 1, 0), 256);
    hw_image image = model_render(HW_CONFIG_B, &scene, &camera, 0, NULL);
    // The front face is 9 away; the ground's line across it is half a unit below the eye.
    uint32_t line = (uint32_t)(128 + 0.5 * hw_camera_focal_px(&camera) / 9);
    assert_int_equal(model_pixel(&image, 128, line - 2)[3], 255);
    assert_int_equal(model_pixel(&image, 128, line + 2)[3], 0);
    hw_image_free(&image);
    hw_scene_free(&scene);
}

// Spheres of several sizes, turned and scaled, all round the camera.
static hw_scene sphere_scene(void)
{
    hw_scene scene = model_scene(2, 60);
    scene.meshes[0] = model_sphere(64, 32);
    scene.meshes[1] = model_box(hw_v3(1, 2, 0.5f));
    scene.ground = (hw_ground){true, {{-900, -900, -3}, {900, 900, -3}}, {0.5f, 0.5f, 0.5f}};
    for (uint32_t i = 0; i < scene.object_count; i++) {
        double angle = i * 2.4, distance = 6 + i * 2, size = 0.6 + i * 0.1;
        hw_object *object = &scene.objects[i];
        object->mesh_idx = object->material_idx = i % 3 == 2;
        object->transform = hw_mat4_mul(
            hw_mat4_translation(distance * cos(angle), distance * sin(angle), i % 5 - 2.0),
            hw_mat4_mul(hw_mat4_rotation_z(i * 0.3), hw_mat4_scale(size, size, size)));
    }
    hw_scene_update_bounds(&scene);
    return scene;
}

static void test_culling_changes_nothing(void **state)
{
    (void)state;
    hw_scene scene = sphere_scene();
    for (int i = 0; i < 12; i++) {
        double a = i * 0.5;
        hw_camera camera =
            model_camera(hw_v3(i * 0.5f, 1, 0.3f), hw_v3((float)cos(a), (float)sin(a), -0.1f), 160);
        hw_frame_stats all, culled;
        hw_image a_image = model_render(HW_CONFIG_A, &scene, &camera, 0, &all);
        hw_image b_image = model_render(HW_CONFIG_B, &scene, &camera, 0, &culled);
        assert_equal_images(&a_image, &b_image);
        assert_int_equal(all.triangles, hw_scene_triangle_count(&scene) + 2);
        assert_int_equal(all.draws, 61);
        assert_true(culled.draws < 40 && culled.triangles < all.triangles);
        hw_image_free(&a_image);
        hw_image_free(&b_image);
    }
    hw_scene_free(&scene);
}

static double mean_difference(const hw_image *a, const hw_image *b)
{
    double sum = 0;
    size_t count = (size_t)a->width * a->height * 4;
    for (size_t i = 0; i < count; i++)
        sum += abs(a->data[i] - b->data[i]);
    return sum / (double)count;
}

static void test_levels_of_detail(void **state)
{
    (void)state;
    hw_scene scene = sphere_scene();
    hw_camera camera = model_camera(hw_v3(0, 0, 0), hw_v3(1, 0.2f, 0), 256);
    hw_frame_stats full, last = {0};
    hw_image truth = model_render(HW_CONFIG_B, &scene, &camera, 0, &full);
    double last_difference = 0;
    for (double px = 1e-6; px < 50; px *= 10) {
        hw_frame_stats stats;
        hw_image image = model_render(HW_CONFIG_L, &scene, &camera, px, &stats);
        double difference = mean_difference(&truth, &image);
        if (px == 1e-6) {
            assert_int_equal(stats.triangles, full.triangles);
            assert_equal_images(&truth, &image);
        } else {
            assert_true(stats.triangles <= last.triangles);
        }
        if (px <= 0.02)
            assert_true(difference < 0.5);
        last = stats;
        last_difference = difference;
        hw_image_free(&image);
    }
    assert_true(last.triangles < full.triangles / 4);
    assert_true(last_difference > 0.1 && last_difference < 20);
    hw_image_free(&truth);
    hw_scene_free(&scene);
}

// The level is the coarsest one whose error, seen from the box's distance, is within the limit.
static void test_level_by_projected_error(void **state)
{
    (void)state;
    hw_scene scene = model_scene(1, 1);
    hw_lod_chain chain;
    const double px = 0.7;
    uint32_t seen = 0, last = 0;
    scene.meshes[0] = model_sphere(96, 48);
    scene.objects[0].transform = hw_mat4_mul(hw_mat4_translation(0, 50, 0), hw_mat4_scale(3, 3, 3));
    hw_scene_update_bounds(&scene);
    assert_ok(hw_lod_chain_make(&scene.meshes[0], &chain));
    for (float y = 46; y > -3000; y = y * 1.4f - 30) {
        hw_camera camera = model_camera(hw_v3(0, y, 0), hw_v3(0, 1, 0), 512);
        double distance = hw_box_distance(scene.objects[0].bounds, camera.eye);
        double pixels = 3 * hw_camera_focal_px(&camera) / distance; // of a unit of the mesh
        uint32_t level = 0;
        while (level + 1 < chain.count && chain.levels[level + 1].error * pixels <= px)
            level++;
        hw_frame_stats stats;
        hw_image image = model_render(HW_CONFIG_L, &scene, &camera, px, &stats);
        hw_image_free(&image);
        assert_int_equal(stats.triangles, chain.levels[level].mesh.index_count / 3);
        assert_true(level >= last);
        seen += level > last;
        last = level;
    }
    assert_true(seen >= 4);
    hw_lod_chain_free(&chain);
    hw_scene_free(&scene);
}

static void test_draw_allocates_nothing(void **state)
{
    (void)state;
    static const hw_config configs[] = {HW_CONFIG_A, HW_CONFIG_B, HW_CONFIG_L};
    hw_scene scene = sphere_scene();
    hw_target *target = NULL;
    assert_ok(hw_target_create(&target, 64, 64, 4));
    for (int i = 0; i < 3; i++) {
        const hw_renderer_desc desc = {.config = configs[i], .scene = &scene};
        hw_renderer *renderer = NULL;
        assert_ok(hw_renderer_create(&desc, &renderer));
        assert_true(hw_renderer_gpu_bytes(renderer) > 64 * 31 * 24);
        assert_true(hw_renderer_gpu_bytes_peak(renderer) >= hw_renderer_gpu_bytes(renderer));
        for (int frame = 0; frame < 6; frame++) {
            hw_camera camera =
                model_camera(hw_v3(0, (float)frame, 0), hw_v3(1, (float)frame - 3, 0), 64);
            hw_target_bind(target);
            assert_ok(hw_renderer_prepare(renderer, &camera, NULL));
            hw_alloc_fail_after(0);
            assert_ok(hw_renderer_draw(renderer, &camera, NULL));
            assert_int_equal(hw_alloc_count(), 0);
        }
        hw_renderer_destroy(renderer);
    }
    hw_target_destroy(target);
    hw_scene_free(&scene);
}

static void test_failing_allocations(void **state)
{
    (void)state;
    static const hw_config configs[] = {HW_CONFIG_B, HW_CONFIG_L};
    hw_scene scene = cube_scene();
    for (int i = 0; i < 2; i++) {
        const hw_renderer_desc desc = {.config = configs[i], .scene = &scene};
        hw_renderer *renderer = NULL;
        for (uint64_t n = 1;; n++) {
            assert_true(n < 500);
            hw_alloc_fail_after(n);
            hw_status status = hw_renderer_create(&desc, &renderer);
            hw_alloc_fail_after(0);
            if (status == HW_OK)
                break;
            assert_int_equal(status, HW_MEMORY);
            assert_null(renderer);
        }
        hw_renderer_destroy(renderer);
    }
    hw_scene_free(&scene);
}

static void test_names(void **state)
{
    (void)state;
    hw_config config;
    for (int i = HW_CONFIG_A; i <= HW_CONFIG_C; i++) {
        assert_true(hw_config_parse(hw_config_name((hw_config)i), &config));
        assert_int_equal(config, i);
    }
    assert_false(hw_config_parse("D", &config));
    assert_false(hw_config_parse("", &config));
    hw_renderer *renderer = NULL;
    assert_int_equal(hw_renderer_create(&(hw_renderer_desc){.config = HW_CONFIG_B}, &renderer),
                     HW_USAGE);
    assert_int_equal(hw_renderer_create(&(hw_renderer_desc){.config = HW_CONFIG_C}, &renderer),
                     HW_USAGE);
    assert_null(renderer);
    hw_renderer_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cube_place_and_color),
        cmocka_unit_test(test_transformed_normals),
        cmocka_unit_test(test_mirrored),
        cmocka_unit_test(test_texture_orientation),
        cmocka_unit_test(test_ground),
        cmocka_unit_test(test_ground_hides_what_is_below),
        cmocka_unit_test(test_culling_changes_nothing),
        cmocka_unit_test(test_levels_of_detail),
        cmocka_unit_test(test_level_by_projected_error),
        cmocka_unit_test(test_draw_allocates_nothing),
        cmocka_unit_test(test_failing_allocations),
        cmocka_unit_test(test_names),
    };
    return cmocka_run_group_tests_name("draw_geometry", tests, model_context_open,
                                       model_context_close);
}
