// What stands in a walker's way: solids of a dataset and of meshes, sliding, no tunnels, ways out.
#include "walkers.h"

// A closed mesh of boxes, 12 triangles each.
static hw_mesh boxes_mesh(const hw_box *boxes, uint32_t count)
{
    static const uint32_t indices[36] = {0, 2, 1, 1, 2, 3, 0, 1, 4, 1, 5, 4, 1, 3, 5, 3, 7, 5,
                                         3, 2, 7, 2, 6, 7, 2, 0, 6, 0, 4, 6, 4, 5, 6, 5, 7, 6};
    hw_mesh mesh = {.vertex_count = 8 * count, .index_count = 36 * count};
    assert_int_equal(HW_NEW(&mesh.positions, 8 * count), HW_OK);
    assert_int_equal(HW_NEW(&mesh.indices, 36 * count), HW_OK);
    for (uint32_t b = 0; b < count; b++) {
        for (uint32_t i = 0; i < 8; i++)
            mesh.positions[8 * b + i] = hw_box_corner(boxes[b], i);
        for (uint32_t i = 0; i < 36; i++)
            mesh.indices[36 * b + i] = 8 * b + indices[i];
    }
    return mesh;
}

// One object of one mesh.
static hw_obstacles *obstacles_of(hw_mesh *mesh, const hw_mat4 *transform)
{
    hw_object object = {.transform = *transform};
    hw_scene scene = {.mesh_count = 1, .object_count = 1, .meshes = mesh, .objects = &object};
    hw_obstacles *obstacles;
    uint32_t missing;
    hw_scene_update_bounds(&scene);
    const hw_obstacles_desc desc = {.scene = &scene};
    assert_int_equal(hw_obstacles_create(&desc, &missing, &obstacles), HW_OK);
    assert_int_equal(missing, 0);
    hw_mesh_free(mesh);
    return obstacles;
}

static hw_obstacles *obstacles_of_boxes(const hw_box *boxes, uint32_t count)
{
    hw_mesh mesh = boxes_mesh(boxes, count);
    hw_mat4 identity = hw_mat4_identity();
    return obstacles_of(&mesh, &identity);
}

static bool is_clear(const hw_walker *w)
{
    const hw_body body = {w->x, w->y, w->z - HW_WALKER_BODY_BELOW, w->z + HW_WALKER_BODY_ABOVE,
                          HW_WALKER_RADIUS};
    return hw_obstacles_touch(w->obstacles, &body, NULL) == 0;
}

// A block 40 ahead, square to the way.
static const hw_box block = {{240, 170, 0}, {260, 230, 30}};

static void test_touch(void **state)
{
    (void)state;
    hw_obstacles *o = obstacles_of_boxes(&block, 1);
    double away[2];
    const double cube = 1;
    // Beside each face, by as much as the cubes are coarse.
    hw_body body = {240 - 3 - 2 * cube, 200, 2, 13, 3};
    assert_true(hw_obstacles_touch(o, &body, away) == 0 && away[0] == 0 && away[1] == 0);
    body.x = 240 - 3 + cube / 2;
    double depth = hw_obstacles_touch(o, &body, away);
    assert_true(depth > 0 && depth < 3 && away[0] < -0.9);
    body = (hw_body){250, 230 + 2, 2, 13, 3};
    assert_true(hw_obstacles_touch(o, &body, away) > 0 && away[1] > 0.9);
    body.y = 230 + 3 + 2 * cube;
    assert_true(hw_obstacles_touch(o, &body, NULL) == 0);
    // Over it, and inside.
    body = (hw_body){250, 200, 30 + 2 * cube, 40, 3};
    assert_true(hw_obstacles_touch(o, &body, NULL) == 0);
    body.z_min = 29;
    assert_true(hw_obstacles_touch(o, &body, NULL) >= 3);
    body = (hw_body){1e9, -1e9, 0, 1, 3};
    assert_true(hw_obstacles_touch(o, &body, NULL) == 0);
    hw_obstacles_destroy(o);
    hw_obstacles_destroy(NULL);
}

// Turned, stretched and moved: the obstacle is where the object is drawn.
static void test_obstacles_are_placed(void **state)
{
    (void)state;
    const hw_box unit = {{-1, -1, 0}, {1, 1, 1}};
    hw_mesh mesh = boxes_mesh(&unit, 1);
    hw_mat4 m = hw_mat4_mul(hw_mat4_translation(200, 100, 0),
                            hw_mat4_mul(hw_mat4_rotation_z(HW_PI / 4), hw_mat4_scale(20, 5, 30)));
    hw_obstacles *o = obstacles_of(&mesh, &m);
    const double s = sqrt(0.5);
    for (double along = -30; along <= 30; along += 0.5) {
        for (double across = -15; across <= 15; across += 0.5) {
            hw_body body = {200 + s * (along - across), 100 + s * (along + across), 2, 13, 3};
            double outside = hypot(fmax(fabs(along) - 20, 0), fmax(fabs(across) - 5, 0));
            double depth = hw_obstacles_touch(o, &body, NULL);
            if (outside < 2)
                assert_true(depth > 0);
            if (outside > 6)
                assert_true(depth == 0);
            if (fabs(along) < 19 && fabs(across) < 4)
                assert_true(depth >= 3);
        }
    }
    hw_obstacles_destroy(o);
}

// Writes levels of a mesh file: a wide box, and a thin one as the coarse level.
static void write_wide_and_thin(const char *folder, uint32_t mesh_idx, float error)
{
    const hw_box wide = {{-10, -10, 0}, {10, 10, 30}}, thin = {{-2, -2, 0}, {2, 2, 30}};
    hw_mesh levels[2] = {boxes_mesh(&wide, 1), boxes_mesh(&thin, 1)};
    hw_mesh_level_info infos[2] = {{8, 36, 0, 0, 0, 0}, {8, 36, error, error, error, 0}};
    char *path = NULL;
    for (int i = 0; i < 2; i++) {
        assert_int_equal(hw_strdup(&levels[i].name, "box"), HW_OK);
        assert_int_equal(hw_mesh_compute_normals(&levels[i]), HW_OK);
    }
    assert_int_equal(hw_mesh_path(&path, folder, mesh_idx), HW_OK);
    assert_int_equal(hw_mesh_file_write(path, 1, levels, infos, NULL, 2), HW_OK);
    hw_free(path);
    hw_mesh_free(&levels[0]);
    hw_mesh_free(&levels[1]);
}

static bool touches(const hw_obstacles *o, double x, double y)
{
    const hw_body body = {x, y, 2, 13, 3};
    return hw_obstacles_touch(o, &body, NULL) > 0;
}

// Coarse levels are used where they are exact enough; what cannot be read is left out and counted.
static void test_obstacles_of_a_dataset(void **state)
{
    (void)state;
    char folder[] = "/tmp/test_walker_XXXXXX", path[64];
    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/meshes", folder);
    assert_int_equal(hw_dir_make(path), HW_OK);
    write_wide_and_thin(folder, 0, 0.4f);
    write_wide_and_thin(folder, 1, 0.6f);
    snprintf(path, sizeof path, "%s/meshes/2.hxm", folder);
    assert_int_equal(hw_file_write(path, "rubbish", 7), HW_OK);
    hw_manifest_object objects[4];
    for (uint32_t i = 0; i < 4; i++) {
        float x = 100.0f * (float)i;
        objects[i] = (hw_manifest_object){.mesh_idx = i,
                                          .transform = hw_mat4_translation(x, 0, 0),
                                          .bounds = {{x - 10, -10, 0}, {x + 10, 10, 30}}};
    }
    const hw_manifest manifest = {.mesh_count = 4, .object_count = 4, .objects = objects};
    atomic_bool stop = false;
    const hw_obstacles_desc desc = {.dataset = folder, .manifest = &manifest, .stop = &stop};
    hw_obstacles *o;
    uint32_t missing;
    assert_int_equal(hw_obstacles_create(&desc, &missing, &o), HW_OK);
    assert_int_equal(missing, 2); // one is rubbish, one is not there
    assert_true(touches(o, 0, 0) && !touches(o, 9, 0));
    assert_true(touches(o, 100, 0) && touches(o, 109, 0) && !touches(o, 116, 0));
    assert_true(!touches(o, 200, 0) && !touches(o, 300, 0));
    hw_obstacles_destroy(o);
    atomic_store(&stop, true);
    assert_int_equal(hw_obstacles_create(&desc, &missing, &o), HW_INTERRUPTED);
    assert_null(o);
    for (int i = 0; i < 3; i++) {
        snprintf(path, sizeof path, "%s/meshes/%d.hxm", folder, i);
        unlink(path);
    }
    snprintf(path, sizeof path, "%s/meshes", folder);
    rmdir(path);
    rmdir(folder);
}

static void test_no_way_through(void **state)
{
    (void)state;
    hw_obstacles *o = obstacles_of_boxes(&block, 1);
    const double steps[] = {1.0 / 240, 1.0 / 60, 1.0 / 7, 0.25, 100};
    for (int i = 0; i < 5; i++) {
        for (int run = 0; run < 2; run++) {
            hw_walker w = test_walker();
            w.obstacles = o;
            hold(&w, (hw_key[]){HW_KEY_FORWARD, run ? HW_KEY_RUN : HW_KEY_FORWARD}, 2,
                 steps[i] < 1 ? 5 : 500, steps[i]);
            assert_true(w.x > 233 && w.x < 237);
            assert_true(fabs(w.y - 200) < 1);
            assert_true(is_clear(&w));
            // And back again.
            hold_one(&w, HW_KEY_BACK, 0.5);
            assert_true(w.x < 224);
        }
    }
    // Without obstacles one walks through.
    hw_walker w = test_walker();
    hold_one(&w, HW_KEY_FORWARD, 3);
    assert_at(&w, 290, 200, 12, 1e-6);
    hw_obstacles_destroy(o);
}

// Running into a thin wall with the longest of steps does not jump it.
static void test_thin_wall(void **state)
{
    (void)state;
    const hw_box wall = {{220, 100, 0}, {220.2f, 300, 30}};
    hw_obstacles *o = obstacles_of_boxes(&wall, 1);
    for (int i = 0; i < 40; i++) {
        hw_walker w = test_walker();
        w.obstacles = o;
        w.x -= i / 3.0;
        hold(&w, (hw_key[]){HW_KEY_FORWARD, HW_KEY_RUN}, 2, 2, 0.25);
        assert_true(w.x > 214 && w.x < 218);
    }
    hw_obstacles_destroy(o);
}

static void test_sliding(void **state)
{
    (void)state;
    hw_obstacles *o = obstacles_of_boxes(&block, 1);
    hw_walker w = test_walker();
    w.obstacles = o;
    // At 45 degrees along the face, then past the corner and on.
    w.x = 233;
    w.heading_rad = HW_PI / 4;
    hold_one(&w, HW_KEY_FORWARD, 1);
    assert_true(w.y > 200 + 0.8 * 30 * sqrt(0.5)); // the way along the face is kept
    assert_true(w.x > 233 && w.x < 237 && is_clear(&w));
    hold_one(&w, HW_KEY_FORWARD, 2);
    assert_true(w.x > 260 && w.y > 233);
    hw_obstacles_destroy(o);
}

// Above it is free; one cannot sink into it.
static void test_flying_over(void **state)
{
    (void)state;
    const hw_box low = {{240, 170, 0}, {260, 230, 15}};
    hw_obstacles *o = obstacles_of_boxes(&low, 1);
    hw_walker w = test_walker();
    w.obstacles = o;
    w.z = 30;
    hold_one(&w, HW_KEY_FORWARD, 50.0 / 30);
    assert_at(&w, 250, 200, 30, 1e-6);
    hold_one(&w, HW_KEY_DOWN, 2);
    assert_true(w.z > 25 && w.z < 28 && is_clear(&w));
    hold_one(&w, HW_KEY_BACK, 2);
    assert_true(w.x < 195);
    hold_one(&w, HW_KEY_DOWN, 2);
    assert_at(&w, w.x, w.y, 2, 0);
    hw_obstacles_destroy(o);
}

// From the middle of an object, and from half inside of it, one walks out in any direction, and
// then not back in.
static void test_walking_out(void **state)
{
    (void)state;
    hw_obstacles *o = obstacles_of_boxes(&block, 1);
    const double places[][2] = {{250, 200}, {241, 200}, {238, 200}, {259, 229}, {250, 171}};
    for (int p = 0; p < 5; p++) {
        for (int turn = 0; turn < 16; turn++) {
            hw_walker w = test_walker();
            w.obstacles = o;
            w.x = places[p][0];
            w.y = places[p][1];
            w.heading_rad = turn * HW_PI / 8;
            hold_one(&w, HW_KEY_FORWARD, 4);
            assert_true(is_clear(&w));
            w.heading_rad += HW_PI;
            hold_one(&w, HW_KEY_FORWARD, 0.5);
            assert_true(is_clear(&w));
        }
    }
    hw_obstacles_destroy(o);
}

// Round and round between pillars, at all frame rates: never inside, and never stuck for long.
static void test_among_pillars(void **state)
{
    (void)state;
    hw_box pillars[49];
    for (int i = 0; i < 49; i++) {
        float x = 80 + 40.0f * (float)(i % 7), y = 80 + 40.0f * (float)(i / 7);
        pillars[i] =
            (hw_box){{x, y, 0}, {x + 4 + (float)(i % 5) * 5, y + 6 + (float)(i % 3) * 9, 30}};
    }
    hw_obstacles *o = obstacles_of_boxes(pillars, 49);
    hw_rng rng = hw_rng_make(11, 0);
    hw_walker w = test_walker();
    w.obstacles = o;
    w.x = 60;
    w.y = 60;
    assert_true(is_clear(&w));
    double walked = 0;
    for (int i = 0; i < 2000; i++) {
        hw_input input = {.down = {[HW_KEY_FORWARD] = true}};
        input.down[HW_KEY_RUN] = hw_rng_below(&rng, 2);
        input.down[HW_KEY_LEFT] = hw_rng_below(&rng, 3) == 0;
        input.down[HW_KEY_UP] = hw_rng_below(&rng, 9) == 0;
        input.down[HW_KEY_DOWN] = hw_rng_below(&rng, 9) == 0;
        if (hw_rng_below(&rng, 12) == 0)
            w.heading_rad = 2 * HW_PI * hw_rng_float(&rng);
        double x = w.x, y = w.y;
        assert_int_equal(hw_walker_update(&w, &input, 0.3 * hw_rng_float(&rng)), HW_OK);
        walked += hypot(w.x - x, w.y - y);
        assert_true(is_clear(&w));
    }
    assert_true(walked > 2000 * 2);
    hw_obstacles_destroy(o);
}

// A corner between walls that meet at a right angle, and one that narrows to nothing.
static void test_corners_hold_nobody(void **state)
{
    (void)state;
    const hw_box right_angle[2] = {{{240, 100, 0}, {250, 300, 30}},
                                   {{100, 240, 0}, {250, 250, 30}}};
    hw_obstacles *o = obstacles_of_boxes(right_angle, 2);
    hw_walker w = test_walker();
    w.obstacles = o;
    w.heading_rad = HW_PI / 4;
    hold(&w, (hw_key[]){HW_KEY_FORWARD, HW_KEY_RUN}, 2, 3, STEP);
    assert_true(w.x > 230 && w.y > 230 && is_clear(&w));
    hold_one(&w, HW_KEY_BACK, 1);
    assert_true(w.x < 220 && w.y < 220);
    hw_obstacles_destroy(o);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_touch),
        cmocka_unit_test(test_obstacles_are_placed),
        cmocka_unit_test(test_obstacles_of_a_dataset),
        cmocka_unit_test(test_no_way_through),
        cmocka_unit_test(test_thin_wall),
        cmocka_unit_test(test_sliding),
        cmocka_unit_test(test_flying_over),
        cmocka_unit_test(test_walking_out),
        cmocka_unit_test(test_among_pillars),
        cmocka_unit_test(test_corners_hold_nobody),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
