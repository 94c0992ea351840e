#include "shapes.h"

#include "appearance.h"
#include "capture.h"

typedef struct stage {
    hw_scene scene;
    hw_rays *rays;
    hw_capturer *capturer;
} stage;

// One object; the mesh is moved in.
static void set_stage(stage *s, hw_mesh *mesh, hw_mat4 transform, const hw_image *texture)
{
    s->scene = shape_scene(mesh, &transform, 1);
    if (texture)
        s->scene.materials[0].texture = *texture;
    assert_int_equal(hw_rays_create_scene(&s->rays, &s->scene), HW_OK);
    assert_int_equal(hw_capturer_create(&s->scene, s->rays, NULL, &s->capturer), HW_OK);
}

static void clear_stage(stage *s)
{
    hw_capturer_destroy(s->capturer);
    hw_rays_destroy(s->rays);
    hw_scene_free(&s->scene);
}

static hw_capture capture(const stage *s, hw_capture_window window, uint32_t samples)
{
    hw_capture out;
    assert_int_equal(hw_capture_object(s->capturer, 0, &window, samples, 0, &out), HW_OK);
    assert_int_equal(out.width, window.width);
    assert_int_equal(out.height, window.height);
    return out;
}

// The mesh-space square x = 0, y and z in [-1, 1], seen from -x: its normal is -x.
static hw_mesh square(uint32_t quads)
{
    return shape_plane(hw_v3(0, -1, -1), hw_v3(0, 0, 2), hw_v3(0, 2, 0), quads, quads);
}

// The object's place: `distance` out along the axis of `face` from the centre, facing it, of half
// size `half`; heights are the window's.
static hw_mat4 facing(int face, hw_vec3 centre, double distance, double half)
{
    hw_vec3 axis, right, up;
    hw_face_basis(face, &axis, &right, &up);
    double angle = atan2(axis.y, axis.x);
    hw_vec3 p = hw_v3_mad(centre, axis, (float)distance);
    return hw_mat4_mul(hw_mat4_translation(p.x, p.y, p.z),
                       hw_mat4_mul(hw_mat4_rotation_z(angle), hw_mat4_scale(half, half, half)));
}

static void test_depth_and_coverage(void **state)
{
    (void)state;
    for (int face = 0; face < 6; face++) {
        hw_vec3 centre = hw_v3(100, -40, 12);
        hw_mesh mesh = square(3);
        stage s;
        set_stage(&s, &mesh, facing(face, centre, 50, 5), NULL); // covers +-0.1 of the plane
        hw_capture_window window = {centre, face, -0.2f, 0.2f, -0.15f, 0.15f, 32, 24};
        hw_capture c = capture(&s, window, 1);
        for (uint32_t j = 0; j < 24; j++)
            for (uint32_t i = 0; i < 32; i++) {
                bool inside = i >= 8 && i < 24 && j >= 4 && j < 20;
                assert_int_equal(c.colors[j * 32 + i].a, inside ? 255 : 0);
                if (inside) // along the axis, so the same for all
                    assert_float_equal(c.depths[j * 32 + i], 50, 1e-3);
                else
                    assert_true(c.depths[j * 32 + i] == INFINITY);
            }
        hw_capture_free(&c);
        window.face = (face + 3) % 6; // behind the centre nothing shows
        c = capture(&s, window, 1);
        for (uint32_t k = 0; k < 32 * 24; k++)
            assert_int_equal(c.colors[k].a, 0);
        hw_capture_free(&c);
        clear_stage(&s);
    }
}

// Colour = base x vertex colour x light of the world normal, interpolated, at every texel, for an
// object that is turned, squashed and placed away from the origin.
static void test_texel_equals_formula(void **state)
{
    (void)state;
    hw_mesh mesh = square(1);
    const hw_color8 colors[4] = {
        {255, 0, 30, 255}, {10, 200, 90, 255}, {80, 255, 255, 255}, {120, 10, 0, 255}};
    const hw_vec3 normals[4] = {{-1, 0, 0}, {-0.6f, 0.8f, 0}, {0, 0.6f, 0.8f}, {0.6f, 0, 0.8f}};
    assert_int_equal(HW_NEW(&mesh.colors, 4), HW_OK);
    memcpy(mesh.colors, colors, sizeof colors);
    memcpy(mesh.normals, normals, sizeof normals);
    hw_vec3 centre = hw_v3(3, 4, 5);
    hw_mat4 place = hw_mat4_mul(facing(2, centre, 20, 2), hw_mat4_scale(1.5, 1, 0.7));
    stage s;
    set_stage(&s, &mesh, place, NULL);
    const float base[3] = {0.9f, 0.5f, 1};
    memcpy(s.scene.materials[0].base_color, base, sizeof base);
    hw_capture_window window = {centre, 2, -0.1f, 0.1f, -0.07f, 0.07f, 20, 14};
    hw_capture c = capture(&s, window, 1);
    const hw_mesh *m = &s.scene.meshes[0];
    for (uint32_t j = 0; j < 14; j++)
        for (uint32_t i = 0; i < 20; i++) {
            // Plane coordinates of the square: right is mesh -y, up z (squashed to 0.7).
            float a = 0.5f + 0.5f * ((float)j + 0.5f - 7) / 7;   // along z
            float b = 0.5f - 0.5f * ((float)i + 0.5f - 10) / 10; // along y
            float w[4];
            // Triangles (0, 1, 3) and (0, 3, 2) of the quad: vertices by (a, b) = 00, 10, 01, 11.
            if (a >= b)
                w[0] = 1 - a, w[1] = a - b, w[3] = b, w[2] = 0;
            else
                w[0] = 1 - b, w[2] = b - a, w[3] = a, w[1] = 0;
            float expected[3] = {0, 0, 0};
            for (int k = 0; k < 4; k++) {
                float light = hw_light(hw_mat4_normal(&place, m->normals[k]));
                expected[0] += w[k] * light * m->colors[k].r * base[0];
                expected[1] += w[k] * light * m->colors[k].g * base[1];
                expected[2] += w[k] * light * m->colors[k].b * base[2];
            }
            hw_color8 found = c.colors[j * 20 + i];
            assert_int_equal(found.a, 255);
            assert_float_equal(found.r, expected[0], 0.51);
            assert_float_equal(found.g, expected[1], 0.51);
            assert_float_equal(found.b, expected[2], 0.51);
        }
    hw_capture_free(&c);
    clear_stage(&s);
}

static void test_samples_average_what_is_covered(void **state)
{
    (void)state;
    hw_mesh mesh = square(1);
    assert_int_equal(HW_NEW(&mesh.colors, 4), HW_OK);
    for (int k = 0; k < 4; k++)
        mesh.colors[k] = (hw_color8){201, 101, 51, 255};
    hw_vec3 centre = hw_v3(0, 0, 0);
    stage s;
    set_stage(&s, &mesh, facing(0, centre, 10, 1), NULL);
    hw_capture full =
        capture(&s, (hw_capture_window){centre, 0, -0.05f, 0.05f, -0.05f, 0.05f, 1, 1}, 1);
    // The left edge at -0.1 runs through the middle of the left texel: half of its samples.
    hw_capture half =
        capture(&s, (hw_capture_window){centre, 0, -0.11f, 0.09f, 0, 0.02f, 10, 1}, 2);
    assert_memory_equal(&half.colors[0], &full.colors[0], sizeof(hw_color8)); // no background in it
    assert_float_equal(half.depths[0], 10, 1e-4);
    assert_memory_equal(&half.colors[5], &full.colors[0], sizeof(hw_color8));
    hw_capture_free(&half);
    hw_capture_free(&full);
    clear_stage(&s);
}

// A roof edge: the depth is that of the sample nearest to the centre.
static void test_depth_is_the_middle_samples(void **state)
{
    (void)state;
    hw_mesh mesh = shape_plane(hw_v3(10, 5, -5), hw_v3(10, -10, 0), hw_v3(0, 0, 10), 1, 1);
    stage s;
    set_stage(&s, &mesh, hw_mat4_rotation_z(atan2(0.5, sqrt(0.75))), NULL); // towards face 0
    hw_capture_window window = {hw_v3(0, 0, 0), 0, -0.1f, 0.1f, -0.1f, 0.1f, 5, 5};
    hw_capture three = capture(&s, window, 3), one = capture(&s, window, 1);
    for (uint32_t k = 0; k < 25; k++) {
        float x = -0.1f + 0.2f * ((float)(k % 5) + 0.5f) / 5;
        float expected = 15 / (1 - x); // depth d where d x = d - 15
        assert_float_equal(one.depths[k], expected, 1e-3);
        assert_float_equal(three.depths[k], one.depths[k], 1e-3);
    }
    hw_capture_free(&one);
    hw_capture_free(&three);
    clear_stage(&s);
}

static hw_image checker(uint32_t side, uint32_t square_px)
{
    hw_image image;
    assert_int_equal(hw_image_make(&image, side, side, 3), HW_OK);
    for (uint32_t y = 0; y < side; y++)
        for (uint32_t x = 0; x < side; x++)
            memset(image.data + ((size_t)y * side + x) * 3,
                   (x / square_px + y / square_px) % 2 ? 255 : 0, 3);
    return image;
}

// Near by, the texture's squares show at their places; far away its mean does, not aliasing.
static void test_texture_is_filtered(void **state)
{
    (void)state;
    hw_mesh mesh = square(1); // u runs along z, v along y
    hw_image image = checker(256, 64);
    stage s;
    hw_vec3 centre = hw_v3(0, 0, 0);
    set_stage(&s, &mesh, facing(1, centre, 10, 1), &image);
    hw_vec3 axis, right, up;
    hw_face_basis(1, &axis, &right, &up);
    float light = hw_light(hw_v3_scale(axis, -1));
    hw_capture c = capture(&s, (hw_capture_window){centre, 1, -0.1f, 0.1f, -0.1f, 0.1f, 64, 64}, 1);
    for (uint32_t j = 8; j < 64; j += 16)
        for (uint32_t i = 8; i < 64; i += 16) { // middles of squares
            uint32_t u = j / 16, v = 3 - i / 16;
            float expected = (u + v) % 2 ? 255 * light : 0;
            assert_float_equal(c.colors[j * 64 + i].g, expected, 1.5);
        }
    hw_capture_free(&c);
    c = capture(&s, (hw_capture_window){centre, 1, -0.1f, 0.1f, -0.1f, 0.1f, 2, 2}, 1);
    for (uint32_t k = 0; k < 4; k++) // half a texture wide: the mean
        assert_float_equal(c.colors[k].g, 127.5f * light, 0.06 * 255);
    hw_capture_free(&c);
    clear_stage(&s);
}

// A capture of 4 x 4 samples sees what one of a sample in each of four times as many rows and
// columns does: the same coverage, and colours as close as four samples in place of 16 are.
static void test_outlines_get_all_samples(void **state)
{
    (void)state;
    hw_mesh mesh = shape_sphere(hw_v3(0, 0, 0), 1, 32, 16);
    stage s;
    hw_vec3 centre = hw_v3(0, 0, 0);
    set_stage(&s, &mesh, facing(0, centre, 50, 4.3), NULL);
    hw_capture_window window = {centre, 0, -0.1f, 0.1f, -0.1f, 0.1f, 23, 23};
    hw_capture c = capture(&s, window, 4);
    window.width = window.height = 4 * 23;
    hw_capture fine = capture(&s, window, 1);
    uint32_t partly = 0, whole = 0, none = 0;
    for (uint32_t j = 0; j < 23; j++)
        for (uint32_t i = 0; i < 23; i++) {
            uint32_t covered = 0, red = 0;
            for (uint32_t k = 0; k < 16; k++) {
                hw_color8 color = fine.colors[(4 * j + k / 4) * 4 * 23 + 4 * i + k % 4];
                covered += color.a == 255;
                red += color.a == 255 ? color.r : 0;
            }
            assert_int_equal(c.coverage[23 * j + i], (covered * 255 + 8) / 16);
            if (covered > 0)
                assert_float_equal(c.colors[23 * j + i].r, (double)red / covered, 4);
            partly += covered > 0 && covered < 16;
            whole += covered == 16;
            none += covered == 0;
        }
    assert_true(partly > 20 && whole > 100 && none > 50);
    hw_capture_free(&c);
    hw_capture_free(&fine);
    clear_stage(&s);
}

static void test_dilate(void **state)
{
    (void)state;
    hw_mesh mesh = square(1);
    stage s;
    hw_vec3 centre = hw_v3(0, 0, 0);
    set_stage(&s, &mesh, facing(0, centre, 10, 0.2), NULL); // 4 x 4 texels in the middle of 20
    hw_capture c = capture(&s, (hw_capture_window){centre, 0, -0.1f, 0.1f, -0.1f, 0.1f, 20, 20}, 1);
    hw_color8 color = c.colors[10 * 20 + 10];
    assert_int_equal(color.a, 255);
    hw_capture_dilate(&c, 3);
    for (uint32_t j = 0; j < 20; j++)
        for (uint32_t i = 0; i < 20; i++) {
            hw_color8 found = c.colors[j * 20 + i];
            bool covered = i >= 8 && i < 12 && j >= 8 && j < 12;
            bool reached = i >= 5 && i < 15 && j >= 5 && j < 15;
            assert_int_equal(found.a, covered ? 255 : 0);
            assert_int_equal(found.r, reached ? color.r : 0);
            if (!covered)
                assert_true(c.depths[j * 20 + i] == INFINITY);
        }
    hw_capture_free(&c);
    clear_stage(&s);

    hw_color8 row[5] = {{100, 0, 0, 255}, {0}, {0}, {0}, {50, 10, 0, 255}};
    hw_capture strip = {.width = 5, .height = 1, .colors = row};
    hw_capture_dilate(&strip, 1000);
    assert_int_equal(row[1].r, 100);
    assert_int_equal(row[2].r, 75); // both neighbours of the step before
    assert_int_equal(row[3].r, 50);
    assert_int_equal(row[2].a, 0);
    assert_int_equal(row[0].a, 255);
}

static void test_failures(void **state)
{
    (void)state;
    hw_mesh mesh = square(2);
    hw_image image = checker(16, 4);
    stage s;
    set_stage(&s, &mesh, facing(0, hw_v3(0, 0, 0), 10, 1), &image);
    hw_capture_window window = {hw_v3(0, 0, 0), 0, -0.1f, 0.1f, -0.1f, 0.1f, 4, 4};
    hw_capture out;
    for (uint64_t n = 1;; n++) {
        hw_alloc_fail_after(n);
        hw_status status = hw_capture_object(s.capturer, 0, &window, 2, 0, &out);
        hw_alloc_fail_after(0);
        if (status == HW_OK)
            break;
        assert_int_equal(status, HW_MEMORY);
        assert_null(out.colors);
    }
    hw_capture_free(&out);
    window.width = 0;
    assert_int_equal(hw_capture_object(s.capturer, 0, &window, 2, 0, &out), HW_USAGE);
    window.width = 4;
    window.x_max = window.x_min;
    assert_int_equal(hw_capture_object(s.capturer, 0, &window, 2, 0, &out), HW_USAGE);
    hw_capturer *capturer = NULL;
    hw_free(s.scene.meshes[0].normals);
    s.scene.meshes[0].normals = NULL;
    assert_int_equal(hw_capturer_create(&s.scene, s.rays, NULL, &capturer), HW_USAGE);
    assert_null(capturer);
    clear_stage(&s);
    hw_capturer_destroy(NULL);
    hw_capture_free(NULL);
}

// Two squares, the second half way behind the first: the nearest shows, and where only one is, it
// is captured as it is alone.
static void test_several_objects(void **state)
{
    (void)state;
    hw_mesh meshes[2] = {square(1), square(1)};
    const hw_mat4 transforms[2] = {
        hw_mat4_mul(hw_mat4_translation(100, 0, 0), hw_mat4_scale(10, 10, 10)),
        hw_mat4_mul(hw_mat4_translation(120, 12, 0), hw_mat4_scale(12, 12, 12))};
    stage s;
    s.scene = shape_scene(meshes, transforms, 2);
    hw_scene_update_bounds(&s.scene);
    assert_int_equal(hw_rays_create_scene(&s.rays, &s.scene), HW_OK);
    assert_int_equal(hw_capturer_create(&s.scene, s.rays, NULL, &s.capturer), HW_OK);
    const int face = hw_face_towards(1, 0);
    hw_capture_window window = {{0, 0, 0}, face, -0.8f, 0.8f, -0.2f, 0.2f, 96, 40};
    hw_capture alone[2], both, reversed;
    const uint32_t order[2] = {0, 1}, backwards[2] = {1, 0};
    for (uint32_t i = 0; i < 2; i++)
        assert_int_equal(hw_capture_object(s.capturer, i, &window, 1, 0, &alone[i]), HW_OK);
    assert_int_equal(hw_capture_objects(s.capturer, order, 2, &window, 1, 0, &both), HW_OK);
    assert_int_equal(hw_capture_objects(s.capturer, backwards, 2, &window, 1, 0, &reversed), HW_OK);
    uint32_t shared = 0, single = 0, none = 0;
    for (uint32_t i = 0; i < 96 * 40; i++) {
        float nearest = fminf(alone[0].depths[i], alone[1].depths[i]);
        bool first = alone[0].colors[i].a > 0, second = alone[1].colors[i].a > 0;
        shared += first && second;
        single += first != second;
        none += !first && !second;
        assert_int_equal(both.colors[i].a > 0, first || second);
        if (nearest < INFINITY)
            assert_float_equal(both.depths[i], nearest, 1e-3 * (double)nearest);
        else
            assert_true(isinf(both.depths[i]));
    }
    assert_true(shared > 20 && single > 20 && none > 20);
    assert_memory_equal(both.depths, reversed.depths, 96 * 40 * sizeof *both.depths);
    for (int i = 0; i < 2; i++)
        hw_capture_free(&alone[i]);
    hw_capture_free(&both);
    hw_capture_free(&reversed);
    clear_stage(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_depth_and_coverage),
        cmocka_unit_test(test_texel_equals_formula),
        cmocka_unit_test(test_samples_average_what_is_covered),
        cmocka_unit_test(test_depth_is_the_middle_samples),
        cmocka_unit_test(test_texture_is_filtered),
        cmocka_unit_test(test_outlines_get_all_samples),
        cmocka_unit_test(test_dilate),
        cmocka_unit_test(test_failures),
        cmocka_unit_test(test_several_objects),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
