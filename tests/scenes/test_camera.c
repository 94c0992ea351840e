#include "camera.h"
#include "camera_text.h"
#include "mesh_samples.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static hw_camera make_camera(void)
{
    return (hw_camera){.eye = {0, 0, 0},
                       .forward = {0, 1, 0},
                       .up = {0, 0, 1},
                       .fov_degrees = 60,
                       .width = 800,
                       .height = 600};
}

// Pixel coordinates (x right, y down, 0 at the top left corner of the image) and depth in [-1, 1].
static bool project(const hw_camera *camera, hw_vec3 p, double out[3])
{
    hw_mat4 m = hw_camera_view_projection(camera);
    const double v[4] = {p.x, p.y, p.z, 1};
    double clip[4] = {0};
    for (int r = 0; r < 4; r++)
        for (int k = 0; k < 4; k++)
            clip[r] += m.m[k * 4 + r] * v[k];
    out[0] = (clip[0] / clip[3] + 1) / 2 * camera->width;
    out[1] = (1 - clip[1] / clip[3]) / 2 * camera->height;
    out[2] = clip[2] / clip[3];
    return clip[3] > 0;
}

static void assert_pixel(const hw_camera *camera, hw_vec3 p, double x, double y)
{
    double q[3];
    assert_true(project(camera, p, q));
    if (fabs(q[0] - x) > 1e-3 || fabs(q[1] - y) > 1e-3)
        fail_msg("(%g %g) is not (%g %g)", q[0], q[1], x, y);
}

static void test_known_projections(void **state)
{
    (void)state;
    hw_camera camera = make_camera();
    double f = 300 / tan(HW_PI / 6);
    assert_close(hw_camera_focal_px(&camera), f, 1e-4);
    assert_pixel(&camera, hw_v3(0, 10, 0), 400, 300);
    assert_pixel(&camera, hw_v3(1, 10, 0), 400 + f / 10, 300); // x to the right, looking along y
    assert_pixel(&camera, hw_v3(0, 10, 1), 400, 300 - f / 10); // z up
    assert_pixel(&camera, hw_v3(0, 100, (float)(100 * tan(HW_PI / 6))), 400, 0); // upper border
    double q[3];
    assert_false(project(&camera, hw_v3(0, -1, 0), q)); // behind
}

static void test_depth_range(void **state)
{
    (void)state;
    hw_camera camera = make_camera();
    double q[3];
    project(&camera, hw_v3(0, HW_CAMERA_NEAR, 0), q);
    assert_close(q[2], -1, 1e-6);
    project(&camera, hw_v3(0, HW_CAMERA_FAR, 0), q);
    assert_close(q[2], 1, 1e-6);
    camera.near = 2;
    camera.far = 9;
    project(&camera, hw_v3(0, 2, 0), q);
    assert_close(q[2], -1, 1e-6);
    project(&camera, hw_v3(0, 9, 0), q);
    assert_close(q[2], 1, 1e-6);
}

static void test_jitter_moves_the_image(void **state)
{
    (void)state;
    hw_camera plain = make_camera(), moved = plain;
    moved.jitter_x = 1;
    moved.jitter_y = 0.25f;
    hw_rng rng = hw_rng_make(4, 0);
    for (int i = 0; i < 100; i++) {
        hw_vec3 p = hw_v3(hw_rng_float(&rng) * 20 - 10, 1 + hw_rng_float(&rng) * 100,
                          hw_rng_float(&rng) * 20 - 10);
        double a[3], b[3];
        project(&plain, p, a);
        project(&moved, p, b);
        assert_close(b[0] - a[0], 1, 1e-6);     // one pixel right
        assert_close(b[1] - a[1], -0.25, 1e-6); // a quarter up
        assert_close(b[2], a[2], 1e-9);
    }
}

static hw_camera random_camera(hw_rng *rng)
{
    hw_camera camera = make_camera();
    camera.eye = hw_v3(hw_rng_float(rng) * 100, hw_rng_float(rng) * 100, hw_rng_float(rng) * 10);
    camera.forward =
        hw_v3(hw_rng_float(rng) - 0.5f, hw_rng_float(rng) - 0.5f, 0.3f * hw_rng_float(rng) - 0.15f);
    camera.forward.x += camera.forward.x < 0 ? -0.1f : 0.1f;
    camera.fov_degrees = 20 + 80 * hw_rng_float(rng);
    camera.near = 1;
    camera.far = 60;
    return camera;
}

static void test_view_is_rigid(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(1, 0);
    for (int i = 0; i < 100; i++) {
        hw_camera camera = random_camera(&rng);
        hw_mat4 view = hw_camera_view(&camera);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) {
                double dot = 0;
                for (int r = 0; r < 3; r++)
                    dot += view.m[a * 4 + r] * view.m[b * 4 + r];
                assert_close(dot, a == b, 1e-12);
            }
        hw_vec3 eye = hw_mat4_point(&view, camera.eye);
        assert_true(hw_v3_length(eye) < 1e-4f);
        hw_vec3 ahead = hw_mat4_direction(&view, hw_v3_normalize(camera.forward));
        assert_close(ahead.z, -1, 1e-5);
        hw_vec3 up = hw_mat4_direction(&view, hw_v3(0, 0, 1));
        assert_true(up.y > 0 && fabsf(up.x) < 1e-5f);
    }
}

static bool inside_clip(const hw_mat4 *m, hw_vec3 p)
{
    const double v[4] = {p.x, p.y, p.z, 1};
    double clip[4] = {0};
    for (int r = 0; r < 4; r++)
        for (int k = 0; k < 4; k++)
            clip[r] += m->m[k * 4 + r] * v[k];
    return fabs(clip[0]) <= clip[3] && fabs(clip[1]) <= clip[3] && fabs(clip[2]) <= clip[3];
}

// A box that holds a visible point must never be culled; a box beyond one plane must be.
static void test_frustum_against_brute_force(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(2, 0);
    int visible = 0, culled = 0;
    for (int i = 0; i < 3000; i++) {
        hw_camera camera = random_camera(&rng);
        hw_mat4 m = hw_camera_view_projection(&camera);
        hw_frustum frustum = hw_frustum_make(&m);
        hw_vec3 lo =
            hw_v3(hw_rng_float(&rng) * 100, hw_rng_float(&rng) * 100, hw_rng_float(&rng) * 20);
        hw_vec3 size =
            hw_v3(hw_rng_float(&rng) * 20, hw_rng_float(&rng) * 20, hw_rng_float(&rng) * 20);
        hw_box box = {lo, hw_v3_add(lo, size)};
        bool seen = false;
        for (int k = 0; k < 216; k++) {
            hw_vec3 t = hw_v3((k % 6) / 5.0f, (k / 6 % 6) / 5.0f, (k / 36) / 5.0f);
            seen |= inside_clip(
                &m, hw_v3(lo.x + t.x * size.x, lo.y + t.y * size.y, lo.z + t.z * size.z));
        }
        bool meets = hw_frustum_meets_box(&frustum, box);
        if (seen)
            assert_true(meets);
        bool outside_one = false;
        for (int f = 0; f < 6; f++) {
            bool all = true;
            for (uint32_t k = 0; k < 8; k++) {
                hw_vec3 c = hw_box_corner(box, k);
                const double *p = frustum.planes[f];
                all &= p[0] * c.x + p[1] * c.y + p[2] * c.z + p[3] < 0;
            }
            outside_one |= all;
        }
        assert_int_equal(meets, !outside_one);
        visible += seen;
        culled += !meets;
    }
    assert_true(visible > 300 && culled > 300); // the test has something to say
}

static void test_frustum_planes(void **state)
{
    (void)state;
    hw_camera camera = make_camera();
    camera.near = 1;
    camera.far = 10;
    hw_mat4 m = hw_camera_view_projection(&camera);
    hw_frustum frustum = hw_frustum_make(&m);
    const double *near = frustum.planes[4], *far = frustum.planes[5];
    assert_close(near[1], 1, 1e-9); // y - 1 >= 0
    assert_close(near[3], -1, 1e-6);
    assert_close(far[1], -1, 1e-9); // 10 - y >= 0
    assert_close(far[3], 10, 1e-5);
    for (int i = 0; i < 4; i++) // the side planes pass through the eye
        assert_close(frustum.planes[i][3], 0, 1e-9);
    assert_true(frustum.planes[0][0] > 0 && frustum.planes[1][0] < 0); // left, right
    assert_true(frustum.planes[2][2] > 0 && frustum.planes[3][2] < 0); // bottom, top
}

// ---- As text

static void test_text_brings_the_floats_back(void **state)
{
    (void)state;
    const hw_camera camera = {.eye = {123.456789f, -1e-7f, 3e8f},
                              .forward = {0.1f, 0.7071068f, -1.0f / 3},
                              .up = {0, 0, 1},
                              .fov_degrees = 59.9f};
    char text[512], cut[8];
    hw_camera back;
    hw_camera_format(&camera, text, sizeof text);
    assert_null(strchr(text, '\n'));
    assert_int_equal(hw_camera_parse("text", text, &back), HW_OK);
    assert_memory_equal(&back, &camera, sizeof back);
    hw_camera_format(&camera, cut, sizeof cut);
    assert_int_equal(strlen(cut), sizeof cut - 1);
    // Every part of it is refused, or is the whole.
    for (size_t n = 0; n < strlen(text); n++) {
        char part[512];
        snprintf(part, sizeof part, "%.*s", (int)n, text);
        assert_int_equal(hw_camera_parse("text", part, &back), HW_FORMAT);
    }
    assert_int_equal(hw_camera_parse("text",
                                     " {\"fov_degrees\": 60, \"eye\": [1, 2, 3],\n"
                                     "\"forward\": [1, 0, 0]} ",
                                     &back),
                     HW_OK);
    assert_true(back.up.z == 1 && back.eye.y == 2 && back.fov_degrees == 60);
}

static void test_odd_texts(void **state)
{
    (void)state;
    static const char *const texts[] = {
        "",
        "hello",
        "[]",
        "null",
        "{}",
        "{\"eye\":[0,0,0],\"forward\":[0,1,0]}",
        "{\"eye\":[0,0],\"forward\":[0,1,0],\"fov_degrees\":60}",
        "{\"eye\":[0,0,0,0],\"forward\":[0,1,0],\"fov_degrees\":60}",
        "{\"eye\":[0,0,\"x\"],\"forward\":[0,1,0],\"fov_degrees\":60}",
        "{\"eye\":[0,0,1e300],\"forward\":[0,1,0],\"fov_degrees\":60}",
        "{\"eye\":[0,0,1e999],\"forward\":[0,1,0],\"fov_degrees\":60}",
        "{\"eye\":[0,0,0],\"forward\":[0,0,0],\"fov_degrees\":60}",
        "{\"eye\":[0,0,0],\"forward\":[0,0,-1],\"fov_degrees\":60}",
        "{\"eye\":[0,0,0],\"forward\":[0,1,0],\"up\":[0,2,0],\"fov_degrees\":60}",
        "{\"eye\":[0,0,0],\"forward\":[0,1,0],\"fov_degrees\":0}",
        "{\"eye\":[0,0,0],\"forward\":[0,1,0],\"fov_degrees\":180}",
        "{\"eye\":[0,0,0],\"forward\":[0,1,0],\"fov_degrees\":\"60\"}",
    };
    const hw_camera before = {.fov_degrees = 7};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        hw_camera camera = before;
        assert_int_equal(hw_camera_parse("text", texts[i], &camera), HW_FORMAT);
        assert_memory_equal(&camera, &before, sizeof camera);
        assert_non_null(strstr(hw_error_text(), "text"));
    }
    char *longer = malloc(100001);
    memset(longer, '[', 100000);
    longer[100000] = '\0';
    hw_camera camera;
    assert_int_equal(hw_camera_parse("text", longer, &camera), HW_FORMAT);
    free(longer);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_text_brings_the_floats_back), cmocka_unit_test(test_odd_texts),
        cmocka_unit_test(test_known_projections),           cmocka_unit_test(test_depth_range),
        cmocka_unit_test(test_jitter_moves_the_image),      cmocka_unit_test(test_view_is_rigid),
        cmocka_unit_test(test_frustum_against_brute_force), cmocka_unit_test(test_frustum_planes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
