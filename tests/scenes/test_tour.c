// Tours: files, hostile files, and the properties of the default tour on made-up scenes.
#include "clearance.h"
#include "file.h"
#include "rng.h"
#include "tour.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

// ---- Scenes of boxes

static hw_mesh *unit_box(void)
{
    static const uint32_t indices[36] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                         2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
    hw_mesh *mesh;
    assert_int_equal(HW_NEW(&mesh, 1), HW_OK);
    assert_int_equal(HW_NEW(&mesh->positions, 8), HW_OK);
    assert_int_equal(HW_NEW(&mesh->indices, 36), HW_OK);
    for (uint32_t i = 0; i < 8; i++)
        mesh->positions[i] = hw_box_corner((hw_box){{0, 0, 0}, {1, 1, 1}}, i);
    memcpy(mesh->indices, indices, sizeof indices);
    mesh->vertex_count = 8;
    mesh->index_count = 36;
    return mesh;
}

static void scene_make(hw_scene *scene, uint32_t objects)
{
    *scene = (hw_scene){.mesh_count = 1, .material_count = 1};
    scene->meshes = unit_box();
    assert_int_equal(HW_NEW(&scene->materials, 1), HW_OK);
    assert_int_equal(HW_NEW(&scene->objects, objects), HW_OK);
}

static void scene_add(hw_scene *scene, hw_box box)
{
    hw_vec3 size = hw_box_size(box);
    scene->objects[scene->object_count++].transform =
        hw_mat4_mul(hw_mat4_translation(box.min.x, box.min.y, box.min.z),
                    hw_mat4_scale(size.x, size.y, size.z));
    hw_scene_update_bounds(scene);
}

// Boxes of about `size`, one in most squares of a raster whose pitch is three times that, with its
// middle at (x, y).
static void scene_strewn(hw_scene *scene, uint32_t side, float size, float x, float y,
                         uint64_t seed)
{
    hw_rng rng = hw_rng_make(seed, 1);
    scene_make(scene, side * side);
    scene->ground = (hw_ground){.present = true, .rect = {{-1, -1, 0}, {1, 1, 0}}};
    for (uint32_t i = 0; i < side * side; i++) {
        float pitch = 3 * size, w = size * (0.5f + hw_rng_float(&rng));
        float px = x + pitch * ((float)(i % side) - (float)side / 2 + 0.4f * hw_rng_float(&rng));
        float py = y + pitch * ((float)(i / side) - (float)side / 2 + 0.4f * hw_rng_float(&rng));
        hw_box box = {{px, py, 0}, {px + w, py + w, size * (0.4f + hw_rng_float(&rng))}};
        if (hw_rng_below(&rng, 5) > 0)
            scene_add(scene, box);
    }
}

static double box_distance(hw_box box, hw_vec3 p)
{
    double sum = 0;
    const float *min = &box.min.x, *max = &box.max.x, *v = &p.x;
    for (int k = 0; k < 3; k++) {
        double d = fmax(0, fmax((double)min[k] - v[k], (double)v[k] - max[k]));
        sum += d * d;
    }
    return sqrt(sum);
}

static double scene_distance(const hw_scene *scene, hw_vec3 p)
{
    double least = INFINITY;
    for (uint32_t i = 0; i < scene->object_count; i++)
        least = fmin(least, box_distance(scene->objects[i].bounds, p));
    return least;
}

// ---- The default tour

typedef struct limits {
    double speed, turn_degrees, frame_rate, clearance, eye_z;
} limits;

static const limits standard = {30, 45, 60, 0, 12};

static double angle_degrees(hw_vec3 a, hw_vec3 b)
{
    return atan2((double)hw_v3_length(hw_v3_cross(a, b)), (double)hw_v3_dot(a, b)) * 180 / HW_PI;
}

// Every limit between consecutive frames, round the end too: that is what makes the loop closed.
static void assert_keeps_limits(const hw_scene *scene, const hw_tour *tour, limits l)
{
    assert_true(tour->frame_count >= 2);
    assert_float_equal(tour->fov_degrees, 60, 0);
    for (uint32_t i = 0; i < tour->frame_count; i++) {
        const hw_tour_frame *a = &tour->frames[i];
        const hw_tour_frame *b = &tour->frames[(i + 1) % tour->frame_count];
        double rounding = 3e-7 * (fabs((double)a->eye.x) + fabs((double)a->eye.y));
        double step = hw_v3_length(hw_v3_sub(b->eye, a->eye));
        assert_true(step <= l.speed / l.frame_rate * 1.0001 + rounding);
        assert_true(angle_degrees(a->forward, b->forward) <=
                    l.turn_degrees / l.frame_rate * 1.0001 + 1e-4);
        assert_float_equal(hw_v3_length(a->forward), 1, 1e-5);
        assert_float_equal(a->eye.z, l.eye_z, 1e-4);
        assert_float_equal(a->t, i / l.frame_rate, 1e-9);
        if (i % 4 == 0)
            assert_true(scene_distance(scene, a->eye) >= l.clearance - rounding);
    }
}

static double length_of(const hw_tour *tour)
{
    double length = 0;
    for (uint32_t i = 0; i < tour->frame_count; i++)
        length += hw_v3_length(
            hw_v3_sub(tour->frames[(i + 1) % tour->frame_count].eye, tour->frames[i].eye));
    return length;
}

static double farthest_from(const hw_tour *tour, float x, float y)
{
    double most = 0;
    for (uint32_t i = 0; i < tour->frame_count; i++)
        most = fmax(most, hypot(tour->frames[i].eye.x - x, tour->frames[i].eye.y - y));
    return most;
}

static void a_park_is_a_good_course(void **state)
{
    (void)state;
    hw_scene scene;
    hw_tour tour;
    scene_strewn(&scene, 14, 40, 0, 0, 1);
    assert_int_equal(hw_tour_generate(&scene, NULL, &tour), HW_OK);
    limits l = standard;
    l.clearance = 8; // the median size is well over 32
    assert_keeps_limits(&scene, &tour, l);
    double seconds = tour.frame_count / 60.0, length = length_of(&tour);
    assert_true(seconds > 60 && seconds < 240);
    assert_true(length / seconds > 22); // mostly at full speed
    // Near the middle and far from it, close to statues and away from them; along the path.
    double innermost = INFINITY, closest = INFINITY, loneliest = 0;
    uint32_t astray = 0;
    for (uint32_t i = 0; i < tour.frame_count; i++) {
        hw_vec3 eye = tour.frames[i].eye, next = tour.frames[(i + 1) % tour.frame_count].eye;
        double gap = scene_distance(&scene, eye);
        closest = fmin(closest, gap);
        loneliest = fmax(loneliest, gap);
        innermost = fmin(innermost, hypot(eye.x, eye.y));
        astray += angle_degrees(hw_v3_sub(next, eye), tour.frames[i].forward) > 15;
    }
    assert_true(innermost < 400 && farthest_from(&tour, 0, 0) > 500);
    assert_true(closest < 30 && loneliest > 30);
    assert_true(astray < tour.frame_count / 20);
    hw_tour_free(&tour);
    hw_scene_free(&scene);
}

static void any_seed_and_place_keeps_limits(void **state)
{
    (void)state;
    for (uint64_t seed = 0; seed < 12; seed++) {
        hw_scene scene;
        hw_tour tour;
        float size = seed % 3 == 0 ? 4 : 40, x = seed % 2 ? 9000 : -30;
        hw_tour_options options = {.seed = seed};
        scene_strewn(&scene, 3 + 2 * (uint32_t)(seed % 4), size, x, -x, seed);
        assert_int_equal(hw_tour_generate(&scene, &options, &tour), HW_OK);
        limits l = standard;
        l.clearance = 0.2 * size;
        assert_keeps_limits(&scene, &tour, l);
        hw_tour_free(&tour);
        hw_scene_free(&scene);
    }
}

static void options_are_kept(void **state)
{
    (void)state;
    hw_scene scene;
    hw_tour tour;
    hw_tour_options options = {.eye_height = 7,
                               .speed = 90,
                               .turn_degrees = 30,
                               .frame_rate = 25,
                               .clearance = 21,
                               .seed = 3};
    limits l = {90, 30, 25, 21, 107};
    scene_strewn(&scene, 9, 40, 0, 0, 2);
    scene.ground.rect.min.z = 100;
    for (uint32_t i = 0; i < scene.object_count; i++)
        scene.objects[i].transform =
            hw_mat4_mul(hw_mat4_translation(0, 0, 100), scene.objects[i].transform);
    hw_scene_update_bounds(&scene);
    assert_int_equal(hw_tour_generate(&scene, &options, &tour), HW_OK);
    assert_keeps_limits(&scene, &tour, l);
    hw_tour_free(&tour);
    hw_scene_free(&scene);
}

// With a clearance that is small beside the squares of the plan the way leads through all the same.
static void small_clearances_are_no_circles(void **state)
{
    (void)state;
    hw_scene scene;
    hw_tour tour;
    scene_strewn(&scene, 14, 40, 0, 0, 1);
    hw_tour_options options = {.clearance = 0.2};
    assert_int_equal(hw_tour_generate(&scene, &options, &tour), HW_OK);
    limits l = standard;
    l.clearance = 0.2;
    assert_keeps_limits(&scene, &tour, l);
    uint32_t inside = 0;
    for (uint32_t i = 0; i < tour.frame_count; i++)
        inside += fabsf(tour.frames[i].eye.x) < 700 && fabsf(tour.frames[i].eye.y) < 700;
    assert_true(inside > tour.frame_count / 2);
    hw_tour_free(&tour);
    hw_scene_free(&scene);
}

static void one_object_is_circled(void **state)
{
    (void)state;
    hw_scene scene;
    hw_tour tour;
    scene_make(&scene, 1);
    scene_add(&scene, (hw_box){{500, 700, 0}, {540, 730, 30}});
    assert_int_equal(hw_tour_generate(&scene, NULL, &tour), HW_OK);
    limits l = standard;
    l.clearance = 10;
    assert_keeps_limits(&scene, &tour, l);
    double turned = 0, radius = hypot(tour.frames[0].eye.x - 520, tour.frames[0].eye.y - 715);
    for (uint32_t i = 0; i < tour.frame_count; i++) {
        const hw_tour_frame *a = &tour.frames[i], *b = &tour.frames[(i + 1) % tour.frame_count];
        hw_vec3 inward = hw_v3_sub(hw_v3(520, 715, 12), a->eye);
        assert_true(angle_degrees(inward, a->forward) < 3);
        assert_float_equal(hypot(a->eye.x - 520, a->eye.y - 715), radius, 0.1);
        turned += angle_degrees(a->forward, b->forward);
    }
    assert_float_equal(turned, 360, 1);
    hw_tour_free(&tour);
    hw_scene_free(&scene);
}

static void odd_scenes_have_tours(void **state)
{
    (void)state;
    static const hw_box row[5] = {{{0, 0, 0}, {2, 2, 9}},
                                  {{10, 0, 0}, {12, 2, 9}},
                                  {{20, 0, 0}, {22, 2, 9}},
                                  {{30, 0, 0}, {32, 2, 9}},
                                  {{40, 0, 0}, {42, 2, 9}}};
    hw_scene scene;
    hw_tour tour;
    // A row, and the row inside a hall that leaves no room.
    for (int hall = 0; hall < 2; hall++) {
        scene_make(&scene, 6);
        for (int i = 0; i < 5; i++)
            scene_add(&scene, row[i]);
        if (hall)
            scene_add(&scene, (hw_box){{-100, -100, -1}, {100, 100, 50}});
        assert_int_equal(hw_tour_generate(&scene, NULL, &tour), HW_OK);
        limits l = standard;
        l.eye_z = hall ? 11 : 12;
        l.clearance = 2;
        assert_keeps_limits(&scene, &tour, l);
        if (hall)
            assert_true(farthest_from(&tour, 0, 0) > 102);
        hw_tour_free(&tour);
        hw_scene_free(&scene);
    }
    // Statues so low that the eye passes over them; and flat ones.
    for (int flat = 0; flat < 2; flat++) {
        scene_make(&scene, 25);
        for (int i = 0; i < 25; i++) {
            float x = 5.0f * (float)(i % 5), y = 5.0f * (float)(i / 5);
            float side = flat ? 0 : 4;
            scene_add(&scene, (hw_box){{x, y, 0}, {x + side, y + side, flat ? 0 : 4}});
        }
        assert_int_equal(hw_tour_generate(&scene, NULL, &tour), HW_OK);
        assert_keeps_limits(&scene, &tour, standard);
        hw_tour_free(&tour);
        hw_scene_free(&scene);
    }
}

// Thin walls in rows, every other row shifted by half a wall: the way turns at every row, and
// smoothing it draws it across the walls.
static void narrow_ways_are_kept(void **state)
{
    (void)state;
    hw_scene scene;
    hw_tour tour;
    scene_make(&scene, 10 * 30);
    for (int i = 0; i < 10 * 30; i++) {
        float x = 92 * (float)(i % 10) + 46 * (float)(i / 10 % 2), y = 13.5f * (float)(i / 10);
        scene_add(&scene, (hw_box){{x, y, 0}, {x + 80, y + 0.5f, 30}});
    }
    for (uint64_t seed = 0; seed < 4; seed++) {
        hw_tour_options options = {.clearance = 4, .seed = seed};
        limits l = standard;
        l.clearance = 4;
        assert_int_equal(hw_tour_generate(&scene, &options, &tour), HW_OK);
        assert_keeps_limits(&scene, &tour, l);
        // Through it, not only around it.
        uint32_t inside = 0;
        for (uint32_t i = 0; i < tour.frame_count; i++) {
            hw_vec3 eye = tour.frames[i].eye;
            inside += eye.x > 50 && eye.x < 850 && eye.y > 10 && eye.y < 390;
        }
        assert_true(inside > tour.frame_count / 2);
        hw_tour_free(&tour);
    }
    hw_scene_free(&scene);
}

static void huge_scenes_are_toured_in_part(void **state)
{
    (void)state;
    hw_scene scene;
    hw_tour tour;
    scene_make(&scene, 10000);
    for (uint32_t i = 0; i < 10000; i++) {
        float x = 300.0f * (float)(i % 100) - 15000, y = 300.0f * (float)(i / 100) - 15000;
        hw_vec3 min = {x, y, 0};
        scene.objects[i].transform =
            hw_mat4_mul(hw_mat4_translation(min.x, min.y, min.z), hw_mat4_scale(50, 40, 30));
    }
    scene.object_count = 10000;
    hw_scene_update_bounds(&scene);
    assert_int_equal(hw_tour_generate(&scene, NULL, &tour), HW_OK);
    assert_true(tour.frame_count < 300 * 60);
    assert_true(farthest_from(&tour, 0, 0) < 3000);
    for (uint32_t i = 0; i < tour.frame_count; i += 97)
        assert_true(scene_distance(&scene, tour.frames[i].eye) >= 12);
    hw_tour_free(&tour);
    hw_scene_free(&scene);
}

static void same_seed_same_tour(void **state)
{
    (void)state;
    hw_scene scene;
    hw_tour a, b, c;
    scene_strewn(&scene, 8, 40, 0, 0, 4);
    assert_int_equal(hw_tour_generate(&scene, &(hw_tour_options){.seed = 1}, &a), HW_OK);
    assert_int_equal(hw_tour_generate(&scene, &(hw_tour_options){.seed = 1}, &b), HW_OK);
    assert_int_equal(hw_tour_generate(&scene, &(hw_tour_options){.seed = 2}, &c), HW_OK);
    assert_int_equal(a.frame_count, b.frame_count);
    for (uint32_t i = 0; i < a.frame_count; i++) {
        assert_memory_equal(&a.frames[i].eye, &b.frames[i].eye, sizeof(hw_vec3));
        assert_memory_equal(&a.frames[i].forward, &b.frames[i].forward, sizeof(hw_vec3));
    }
    assert_true(hw_v3_length(hw_v3_sub(a.frames[0].eye, c.frames[0].eye)) > 1);
    hw_tour_free(&a);
    hw_tour_free(&b);
    hw_tour_free(&c);
    hw_scene_free(&scene);
}

static void senseless_tours_are_refused(void **state)
{
    (void)state;
    hw_scene scene;
    hw_tour tour;
    scene_make(&scene, 1);
    assert_int_equal(hw_tour_generate(&scene, NULL, &tour), HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), "no objects"));
    scene_add(&scene, (hw_box){{0, 0, 0}, {1, 1, 1}});
    const hw_tour_options bad[] = {{.eye_height = -1},
                                   {.speed = NAN},
                                   {.turn_degrees = INFINITY},
                                   {.frame_rate = -60},
                                   {.clearance = -0.1}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_int_equal(hw_tour_generate(&scene, &bad[i], &tour), HW_USAGE);
        assert_null(tour.frames);
    }
    assert_int_equal(hw_tour_generate(&scene, &(hw_tour_options){.speed = 1e-6}, &tour), HW_LIMIT);
    hw_scene_free(&scene);
}

static void exhausted_memory_is_an_error(void **state)
{
    (void)state;
    hw_scene scene;
    scene_strewn(&scene, 3, 40, 0, 0, 4);
    hw_status status = HW_MEMORY;
    uint64_t n = 1, calls = 1;
    for (; status != HW_OK; n += 1 + calls / 60) {
        hw_tour tour;
        hw_alloc_fail_after(n);
        status = hw_tour_generate(&scene, NULL, &tour);
        calls = hw_alloc_count();
        hw_alloc_fail_after(0);
        assert_true(status == HW_OK || status == HW_MEMORY);
        hw_tour_free(&tour);
    }
    assert_true(n > 10);
    hw_scene_free(&scene);
}

// ---- Clearance

static void clearance_is_that_of_brute_force(void **state)
{
    (void)state;
    hw_scene scene;
    hw_clearance *clearance;
    scene_strewn(&scene, 7, 40, 120, -60, 9);
    scene_add(&scene, (hw_box){{-900, -500, 0}, {-895, 500, 40}}); // a wall over many squares
    assert_int_equal(hw_clearance_create(&clearance, &scene, 12, 45), HW_OK);
    hw_rng rng = hw_rng_make(1, 1);
    for (int i = 0; i < 20000; i++) {
        hw_vec3 p = {2400 * hw_rng_float(&rng) - 1200, 1800 * hw_rng_float(&rng) - 900, 12};
        double expected = fmin(45, scene_distance(&scene, p)), away[2];
        double got = hw_clearance_at(clearance, p.x, p.y, away);
        assert_float_equal(got, expected, 1e-4);
        if (got > 1 && got < 40) {
            hw_vec3 moved = {p.x + 0.01f * (float)away[0], p.y + 0.01f * (float)away[1], 12};
            assert_true(scene_distance(&scene, moved) > expected - 0.011);
            assert_float_equal(hypot(away[0], away[1]), 1, 1e-6);
        }
    }
    hw_clearance_destroy(clearance);
    hw_clearance_destroy(NULL);
    hw_scene_free(&scene);
}

// ---- Files

static void files_bring_floats_back(void **state)
{
    (void)state;
    char path[] = "/tmp/hexwalk-tour-XXXXXX";
    int descriptor = mkstemp(path);
    assert_true(descriptor >= 0);
    close(descriptor);
    hw_rng rng = hw_rng_make(3, 1);
    hw_tour_frame frames[100];
    hw_tour tour = {.fov_degrees = 47.25, .frame_count = 100, .frames = frames}, read;
    for (int i = 0; i < 100; i++)
        frames[i] = (hw_tour_frame){
            .t = i / 60.0,
            .eye = hw_v3(3000 * hw_rng_float(&rng), hw_rng_float(&rng) * 1e-7f, -1e20f),
            .forward = hw_v3(hw_rng_float(&rng) - 0.5f, 1, hw_rng_float(&rng)),
            .up = hw_v3(0, 0, 1)};
    assert_int_equal(hw_tour_write(path, &tour), HW_OK);
    assert_int_equal(hw_tour_read(path, &read), HW_OK);
    assert_int_equal(read.frame_count, 100);
    assert_true(read.fov_degrees == 47.25);
    for (int i = 0; i < 100; i++) {
        assert_true(read.frames[i].t == frames[i].t);
        assert_memory_equal(&read.frames[i].eye, &frames[i].eye, sizeof(hw_vec3));
        assert_memory_equal(&read.frames[i].forward, &frames[i].forward, sizeof(hw_vec3));
        assert_memory_equal(&read.frames[i].up, &frames[i].up, sizeof(hw_vec3));
    }
    hw_camera camera = hw_tour_camera(&read, 7, 320, 240);
    assert_memory_equal(&camera.eye, &frames[7].eye, sizeof(hw_vec3));
    assert_memory_equal(&camera.forward, &frames[7].forward, sizeof(hw_vec3));
    assert_float_equal(camera.fov_degrees, 47.25, 0);
    assert_int_equal(camera.width, 320);
    assert_int_equal(camera.height, 240);
    hw_tour_free(&read);
    unlink(path);
    assert_int_equal(hw_tour_read(path, &read), HW_NOT_FOUND);
    assert_non_null(strstr(hw_error_text(), path));
    assert_int_equal(hw_tour_write("/nonexistent/folder/tour.json", &tour), HW_IO);
}

#define FRAME(t, eye, forward, up)                                                                 \
    "{\"t\":" t ",\"eye\":" eye ",\"forward\":" forward ",\"up\":" up "}"
#define GOOD           FRAME("0", "[1,2,3]", "[0,1,0]", "[0,0,1]")
#define TOUR(fov, ...) "{\"fov_degrees\":" fov ",\"frames\":[" __VA_ARGS__ "]}"

static void hostile_files_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *text, *word; // a word of the message
    } cases[] = {
        {"", ""},
        {"[]", "object"},
        {"null", "object"},
        {"{}", "fov_degrees"},
        {"{\"fov_degrees\":60}", "frames"},
        {"{\"fov_degrees\":60,\"frames\":{}}", "frames"},
        {"{\"fov_degrees\":60,\"frames\":7}", "frames"},
        {TOUR("60", ""), "frames"},
        {TOUR("0", GOOD), "fov_degrees"},
        {TOUR("180", GOOD), "fov_degrees"},
        {TOUR("-60", GOOD), "fov_degrees"},
        {TOUR("\"60\"", GOOD), "fov_degrees"},
        {TOUR("1e999", GOOD), "fov_degrees"},
        {TOUR("60", "[]"), "frames[0]"},
        {TOUR("60", GOOD ",3"), "frames[1]"},
        {TOUR("60", "{}"), "\"t\""},
        {TOUR("60", FRAME("null", "[1,2,3]", "[0,1,0]", "[0,0,1]")), "\"t\""},
        {TOUR("60", FRAME("1", "[1,2,3]", "[0,1,0]", "[0,0,1]") "," GOOD), "falls"},
        {TOUR("60", FRAME("0", "[1,2]", "[0,1,0]", "[0,0,1]")), "eye"},
        {TOUR("60", FRAME("0", "[1,2,3,4]", "[0,1,0]", "[0,0,1]")), "eye"},
        {TOUR("60", FRAME("0", "[1,2,1e39]", "[0,1,0]", "[0,0,1]")), "eye"},
        {TOUR("60", FRAME("0", "[1,2,true]", "[0,1,0]", "[0,0,1]")), "eye"},
        {TOUR("60", FRAME("0", "7", "[0,1,0]", "[0,0,1]")), "eye"},
        {TOUR("60", FRAME("0", "[1,2,3]", "[0,0,0]", "[0,0,1]")), "forward"},
        {TOUR("60", FRAME("0", "[1,2,3]", "[0,0,-5]", "[0,0,1]")), "forward"},
        {TOUR("60", FRAME("0", "[1,2,3]", "[1e30,0,0]", "[0,0,1]")), "forward"},
        {TOUR("60", FRAME("0", "[1,2,3]", "[0,1,0]", "[0,0,0]")), "up"},
        {"{\"fov_degrees\":60,\"frames\":[{\"t\":0,\"forward\":[0,1,0],\"up\":[0,0,1]}]}", "eye"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        hw_tour tour;
        hw_status status =
            hw_tour_parse("hostile.json", cases[i].text, strlen(cases[i].text), &tour);
        assert_int_equal(status, HW_FORMAT);
        assert_non_null(strstr(hw_error_text(), "hostile.json"));
        assert_non_null(strstr(hw_error_text(), cases[i].word));
        assert_null(tour.frames);
    }
}

static void every_prefix_is_refused(void **state)
{
    (void)state;
    static const char text[] = TOUR("60", GOOD "," GOOD);
    hw_tour tour;
    for (size_t size = 0; size < sizeof text - 1; size++) {
        assert_int_equal(hw_tour_parse("cut.json", text, size, &tour), HW_FORMAT);
        assert_null(tour.frames);
    }
    assert_int_equal(hw_tour_parse("whole.json", text, sizeof text - 1, &tour), HW_OK);
    assert_int_equal(tour.frame_count, 2);
    hw_tour_free(&tour);
    hw_tour_free(&tour);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_park_is_a_good_course),
        cmocka_unit_test(any_seed_and_place_keeps_limits),
        cmocka_unit_test(options_are_kept),
        cmocka_unit_test(small_clearances_are_no_circles),
        cmocka_unit_test(one_object_is_circled),
        cmocka_unit_test(odd_scenes_have_tours),
        cmocka_unit_test(narrow_ways_are_kept),
        cmocka_unit_test(huge_scenes_are_toured_in_part),
        cmocka_unit_test(same_seed_same_tour),
        cmocka_unit_test(senseless_tours_are_refused),
        cmocka_unit_test(exhausted_memory_is_an_error),
        cmocka_unit_test(clearance_is_that_of_brute_force),
        cmocka_unit_test(files_bring_floats_back),
        cmocka_unit_test(hostile_files_are_refused),
        cmocka_unit_test(every_prefix_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
