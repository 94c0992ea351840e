// Regional occlusion on small scenes with known answers, judged by the same count of pixels that
// check_occlusion uses, which must also catch a culling that looks from too few points.
#include "alloc.h"
#include "hierarchy.h"
#include "occlusion.h"
#include "parallel.h"
#include "rng.h"
#include "shapes.h"
#include "visibility.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#define OBJECTS_MAX 8u

// One cell of side 20 round the origin, eyes at heights 8 to 16.
static hw_hexgrid one_cell(void)
{
    return (hw_hexgrid){
        .cell_size = 20, .z_min = 8, .z_max = 16, .columns = 1, .rows = 1, .levels = 1};
}

static hw_box box(float x0, float y0, float z0, float x1, float y1, float z1)
{
    return (hw_box){{x0, y0, z0}, {x1, y1, z1}};
}

typedef struct stage {
    hw_scene scene;
    hw_rays *rays;
    hw_hexgrid grid;
} stage;

static stage stage_of_meshes(hw_mesh *meshes, uint32_t count)
{
    stage s = {.grid = one_cell()};
    hw_mat4 transforms[OBJECTS_MAX];
    for (uint32_t i = 0; i < count; i++)
        transforms[i] = hw_mat4_identity();
    s.scene = shape_scene(meshes, transforms, count);
    assert_int_equal(hw_rays_create_scene(&s.rays, &s.scene), HW_OK);
    return s;
}

static stage stage_of_boxes(const hw_box *boxes, uint32_t count)
{
    hw_mesh meshes[OBJECTS_MAX];
    for (uint32_t i = 0; i < count; i++)
        meshes[i] = shape_box(boxes[i], false);
    return stage_of_meshes(meshes, count);
}

static void stage_free(stage *s)
{
    hw_rays_destroy(s->rays);
    hw_scene_free(&s->scene);
}

static void query(const stage *s, hw_occlusion_options options, bool seen[OBJECTS_MAX])
{
    hw_occlusion *o;
    assert_int_equal(hw_occlusion_create(&o, &s->scene, s->rays, &s->grid, &options), HW_OK);
    assert_int_equal(hw_occlusion_query(o, (hw_cell_id){0}, seen), HW_OK);
    hw_occlusion_destroy(o);
}

// Pixels of objects that are not `seen` in pictures from many eyes of the cell, looking east.
static uint32_t lost_pixels(const stage *s, const bool *seen)
{
    hw_rng rng = hw_rng_make(3, 3);
    uint32_t pixels[OBJECTS_MAX] = {0}, lost = 0;
    for (int i = 0; i < 300; i++) {
        hw_camera camera = {
            .forward = {1, 0, 0}, .up = {0, 0, 1}, .fov_degrees = 60, .width = 512, .height = 512};
        camera.eye = hw_v3(17.3f * (2 * hw_rng_float(&rng) - 1), 10 * (2 * hw_rng_float(&rng) - 1),
                           8 + 8 * hw_rng_float(&rng));
        assert_int_equal(hw_visibility_count(&s->scene, s->rays, &camera, seen, pixels), HW_OK);
    }
    for (uint32_t i = 0; i < s->scene.object_count; i++)
        lost += seen[i] ? 0 : pixels[i];
    return lost;
}

// Queries, and compares with what should be seen and with the pictures.
static void expect_seen(const hw_box *boxes, uint32_t count, const bool *expected)
{
    bool seen[OBJECTS_MAX];
    stage s = stage_of_boxes(boxes, count);
    query(&s, hw_occlusion_defaults(), seen);
    for (uint32_t i = 0; i < count; i++)
        assert_int_equal(seen[i], expected[i]);
    assert_int_equal(lost_pixels(&s, seen), 0);
    stage_free(&s);
}

static void wall_hides_what_is_behind(void **state)
{
    (void)state;
    const hw_box boxes[] = {box(100, -200, 0, 103, 200, 30), box(200, -10, 0, 220, 10, 20),
                            box(60, -5, 0, 70, 5, 9)};
    expect_seen(boxes, 3, (const bool[]){true, false, true});
}

static void what_rises_above_a_wall_is_seen(void **state)
{
    (void)state;
    // From z = 16 and x = -20, the wall's top at 30 hides up to 30 + 97 * 14 / 120 = 41.3.
    const hw_box boxes[] = {box(100, -200, 0, 103, 200, 30), box(200, -10, 0, 220, 10, 44),
                            box(200, 30, 0, 220, 50, 34)};
    expect_seen(boxes, 3, (const bool[]){true, true, false});
}

static void what_shows_beside_a_wall_is_seen(void **state)
{
    (void)state;
    // Half behind the wall's end; and wholly behind it, where no eye looks round the end.
    const hw_box boxes[] = {box(100, -200, 0, 103, 0, 30), box(200, -10, 0, 210, 10, 20),
                            box(200, -160, 0, 210, -140, 20)};
    expect_seen(boxes, 3, (const bool[]){true, true, false});
}

// Two walls with a slit of 0.4 units, 3.5 pixels as seen from the cell.
static void slit_scene(hw_box boxes[4])
{
    boxes[0] = box(100, -200, 0, 103, -0.2f, 40);
    boxes[1] = box(100, 0.2f, 0, 103, 200, 40);
    boxes[2] = box(200, -4, 0, 208, 4, 12);
    boxes[3] = box(200, -160, 0, 208, -150, 12);
}

static void slit_shows_what_is_behind(void **state)
{
    (void)state;
    hw_box boxes[4];
    slit_scene(boxes);
    expect_seen(boxes, 4, (const bool[]){true, true, true, false});
}

static void careless_culling_is_caught(void **state)
{
    (void)state;
    hw_box boxes[4];
    bool seen[OBJECTS_MAX];
    slit_scene(boxes);
    stage s = stage_of_boxes(boxes, 4);
    query(&s, (hw_occlusion_options){.eyes = 1, .margin = 0}, seen);
    assert_false(seen[2]);
    assert_true(lost_pixels(&s, seen) > 2);
    stage_free(&s);
}

static void what_meets_the_cell_is_seen(void **state)
{
    (void)state;
    const hw_box boxes[] = {box(-25, -25, 0, 25, 25, 7), box(0, 0, 9, 1, 1, 10),
                            box(-0.5f, -0.5f, 9.5f, 1.5f, 1.5f, 10.5f)};
    bool seen[OBJECTS_MAX];
    stage s = stage_of_boxes(boxes, 3);
    query(&s, (hw_occlusion_options){.eyes = 0, .margin = 0}, seen);
    assert_false(seen[0]); // below the eyes, and no ray was cast
    assert_true(seen[1] && seen[2]);
    stage_free(&s);
}

// What a cell's own rays miss is looked for where its neighbours see it: a few eyes of each cell
// are enough then to find most views through a slit.
static void neighbours_tell_what_to_look_for(void **state)
{
    (void)state;
    hw_box boxes[4];
    slit_scene(boxes);
    stage s = stage_of_boxes(boxes, 4);
    s.grid = hw_hexgrid_cover(-60, -60, 60, 60, 20, 8, 16);
    uint32_t found[2] = {0};
    for (int again = 0; again < 2; again++) {
        const hw_occlusion_options options = {.eyes = 16, .more = again ? 256 : 0};
        hw_occlusion *o;
        assert_int_equal(hw_occlusion_create(&o, &s.scene, s.rays, &s.grid, &options), HW_OK);
        for (uint32_t i = 0; i < hw_hexgrid_cell_count(&s.grid); i++) {
            bool seen[OBJECTS_MAX];
            assert_int_equal(hw_occlusion_query(o, hw_hexgrid_cell(&s.grid, i), seen), HW_OK);
            found[again] += seen[2];
        }
        hw_occlusion_destroy(o);
    }
    print_message("seen from %u cells, then %u of %u\n", found[0], found[1],
                  hw_hexgrid_cell_count(&s.grid));
    assert_true(found[1] > found[0]);
    stage_free(&s);
}

// An open sheet is drawn from its front alone, so it hides only from there.
static void open_sheets_hide_from_their_front(void **state)
{
    (void)state;
    for (int back = 0; back < 2; back++) {
        bool seen[OBJECTS_MAX];
        hw_vec3 along = hw_v3(0, back ? 400 : -400, 0);
        hw_mesh meshes[2] = {
            shape_plane(hw_v3(100, back ? -200 : 200, -5), along, hw_v3(0, 0, 60), 4, 4),
            shape_box(box(200, -10, 0, 220, 10, 20), false)};
        stage s = stage_of_meshes(meshes, 2);
        query(&s, hw_occlusion_defaults(), seen);
        assert_int_equal(seen[1], back);
        assert_int_equal(lost_pixels(&s, seen), 0);
        stage_free(&s);
    }
}

static void pictures_count_pixels(void **state)
{
    (void)state;
    // A face of 10 x 10 at distance 100: (10 / 100 * focal)^2 pixels; the box behind it none.
    const hw_box boxes[] = {box(100, -5, -5, 110, 5, 5), box(150, -5, -5, 160, 5, 5)};
    stage s = stage_of_boxes(boxes, 2);
    hw_camera camera = {
        .forward = {1, 0, 0}, .up = {0, 0, 1}, .fov_degrees = 60, .width = 1024, .height = 1024};
    uint32_t pixels[2] = {0};
    const bool none[2] = {false, false};
    assert_int_equal(hw_visibility_count(&s.scene, s.rays, &camera, none, pixels), HW_OK);
    double side = 0.1 * hw_camera_focal_px(&camera);
    assert_float_equal(pixels[0], side * side, 2 * side + 1);
    assert_int_equal(pixels[1], 0);
    assert_true(hw_visibility_inside(&s.scene, s.rays, hw_v3(105, 0, 0)));
    assert_false(hw_visibility_inside(&s.scene, s.rays, hw_v3(95, 0, 0)));
    stage_free(&s);
    // Inside of one box, with another that sits in its top straight above.
    const hw_box pile[] = {box(0, 0, 0, 10, 10, 10), box(-1, -1, 9, 11, 11, 12)};
    s = stage_of_boxes(pile, 2);
    assert_true(hw_visibility_inside(&s.scene, s.rays, hw_v3(5, 5, 5)));
    assert_false(hw_visibility_inside(&s.scene, s.rays, hw_v3(-0.5f, 5, 5)));
    stage_free(&s);
}

// ---- faces -----------------------------------------------------------------------------------

// A tower behind a wall: what rises above the wall from somewhere stays, with its neighbours; the
// rest goes. Cut into 24 x 24 squares, so that a ring of faces is thin.
static void wall_hides_the_foot_of_a_tower(void **state)
{
    (void)state;
    const hw_box boxes[] = {box(100, -200, 0, 103, 200, 30), box(200, -12, 0, 220, 12, 60)};
    stage s = stage_of_boxes(boxes, 2);
    hw_mesh front = shape_plane(hw_v3(200, 12, 0), hw_v3(0, -24, 0), hw_v3(0, 0, 60), 24, 24);
    hw_occlusion *o;
    const hw_occlusion_options options = hw_occlusion_defaults();
    assert_int_equal(hw_occlusion_create(&o, &s.scene, s.rays, &s.grid, &options), HW_OK);
    const hw_sight_surface surface = {.box = boxes[1],
                                      .vertex_count = front.vertex_count,
                                      .index_count = front.index_count,
                                      .positions = front.positions,
                                      .indices = front.indices,
                                      .spacing = 2};
    bool *seen;
    assert_int_equal(HW_NEW(&seen, front.index_count / 3), HW_OK);
    assert_int_equal(hw_occlusion_faces(o, (hw_cell_id){0}, &surface, seen), HW_OK);
    // From the corner farthest away, (-20, 0, 16), the line over the wall's far edge meets the
    // tower at 16 + 14 / 123 * 220 = 41; no eye sees lower.
    for (uint32_t i = 0; i < front.index_count / 3; i++) {
        float high = 0;
        for (uint32_t k = 0; k < 3; k++)
            high = fmaxf(high, front.positions[front.indices[3 * i + k]].z);
        if (high > 42)
            assert_true(seen[i]);
        if (high < 41 - 3 * 60 / 24.0f) // two rings, and the square that the limit lies in
            assert_false(seen[i]);
    }
    hw_free(seen);
    hw_mesh_free(&front);
    hw_occlusion_destroy(o);
    stage_free(&s);
}

// A large face of which only a spot in the middle shows, through a window in a wall.
static void spot_of_a_large_face_is_seen(void **state)
{
    (void)state;
    const hw_box boxes[] = {box(100, -200, -90, 103, -3, 90), box(100, 3, -90, 103, 200, 90),
                            box(100, -3, -90, 103, 3, 9), box(100, -3, 15, 103, 3, 90),
                            box(200, -60, -40, 220, 60, 60)};
    stage s = stage_of_boxes(boxes, 5);
    hw_mesh front = shape_plane(hw_v3(200, 60, -40), hw_v3(0, -120, 0), hw_v3(0, 0, 100), 1, 1);
    hw_occlusion *o;
    const hw_occlusion_options options = hw_occlusion_defaults();
    assert_int_equal(hw_occlusion_create(&o, &s.scene, s.rays, &s.grid, &options), HW_OK);
    for (int fine = 0; fine < 2; fine++) { // corners alone would not do
        const hw_sight_surface surface = {.box = boxes[4],
                                          .vertex_count = front.vertex_count,
                                          .index_count = front.index_count,
                                          .positions = front.positions,
                                          .indices = front.indices,
                                          .spacing = fine ? 10 : 1e6};
        bool seen[2];
        assert_int_equal(hw_occlusion_faces(o, (hw_cell_id){0}, &surface, seen), HW_OK);
        assert_int_equal(seen[0], fine);
        assert_int_equal(seen[1], fine);
    }
    hw_mesh_free(&front);
    hw_occlusion_destroy(o);
    stage_free(&s);
}

// ---- groups ----------------------------------------------------------------------------------

// A group sees what any of its cells sees, and nothing else.
static void group_sees_what_its_cells_see(void **state)
{
    (void)state;
    // Boxes behind a wall along the grid's columns, which ends half way.
    const hw_box boxes[] = {box(130, -300, 0, 133, 0, 40), box(230, -160, 0, 240, -150, 20),
                            box(230, -20, 0, 240, -10, 20), box(230, 20, 0, 240, 30, 20)};
    stage s = stage_of_boxes(boxes, 4);
    s.grid = hw_hexgrid_cover(-60, -60, 60, 60, 20, 8, 16);
    s.grid.levels = 2;
    hw_occlusion *o;
    const hw_occlusion_options options = hw_occlusion_defaults();
    assert_int_equal(hw_occlusion_create(&o, &s.scene, s.rays, &s.grid, &options), HW_OK);
    hw_cell_id *cells;
    uint32_t count, groups = 0;
    assert_int_equal(hw_hierarchy_cells(&s.grid, &cells, &count), HW_OK);
    for (uint32_t i = 0; i < count; i++) {
        if (cells[i].level == 0)
            continue;
        bool seen[4], expected[4] = {false};
        hw_cell_id children[HW_CELL_CHILDREN];
        assert_int_equal(hw_occlusion_query(o, cells[i], seen), HW_OK);
        hw_cell_children(cells[i], children);
        for (int k = 0; k < HW_CELL_CHILDREN; k++) {
            bool own[4];
            if (!hw_hexgrid_contains(&s.grid, children[k]))
                continue;
            assert_int_equal(hw_occlusion_query(o, children[k], own), HW_OK);
            for (int n = 0; n < 4; n++)
                expected[n] |= own[n];
        }
        assert_memory_equal(seen, expected, sizeof seen);
        assert_true(seen[0] && seen[3] && !seen[1]);
        groups++;
    }
    assert_true(groups > 2);
    hw_free(cells);
    hw_occlusion_destroy(o);
    stage_free(&s);
}

// ---- many objects ----------------------------------------------------------------------------

typedef struct job {
    hw_occlusion *occlusion;
    bool seen[8][OBJECTS_MAX];
} job;

static hw_status query_in_thread(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    job *j = context;
    return hw_occlusion_query(j->occlusion, (hw_cell_id){0}, j->seen[index]);
}

static void threads_agree(void **state)
{
    (void)state;
    hw_box boxes[4];
    slit_scene(boxes);
    stage s = stage_of_boxes(boxes, 4);
    hw_occlusion *o;
    hw_occlusion_options options = {.eyes = 3, .margin = 0};
    assert_int_equal(hw_occlusion_create(&o, &s.scene, s.rays, &s.grid, &options), HW_OK);
    job j = {.occlusion = o};
    assert_int_equal(hw_parallel_for(8, 4, query_in_thread, &j, NULL), HW_OK);
    for (int i = 1; i < 8; i++)
        assert_memory_equal(j.seen[0], j.seen[i], 4 * sizeof(bool));
    hw_occlusion_destroy(o);
    stage_free(&s);
}

static void exhausted_memory_is_an_error(void **state)
{
    (void)state;
    hw_box boxes[4];
    slit_scene(boxes);
    stage s = stage_of_boxes(boxes, 4);
    hw_status status = HW_MEMORY;
    uint64_t n = 1;
    for (; status != HW_OK && n < 100; n++) {
        hw_occlusion *o = NULL;
        hw_occlusion_options options = {.eyes = 1};
        bool seen[OBJECTS_MAX];
        hw_alloc_fail_after(n);
        status = hw_occlusion_create(&o, &s.scene, s.rays, &s.grid, &options);
        if (status == HW_OK)
            status = hw_occlusion_query(o, (hw_cell_id){0}, seen);
        hw_alloc_fail_after(0);
        assert_true(status == HW_OK || status == HW_MEMORY);
        hw_occlusion_destroy(o);
    }
    assert_int_equal(status, HW_OK);
    assert_true(n > 6);
    stage_free(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(wall_hides_what_is_behind),
        cmocka_unit_test(what_rises_above_a_wall_is_seen),
        cmocka_unit_test(what_shows_beside_a_wall_is_seen),
        cmocka_unit_test(slit_shows_what_is_behind),
        cmocka_unit_test(careless_culling_is_caught),
        cmocka_unit_test(neighbours_tell_what_to_look_for),
        cmocka_unit_test(what_meets_the_cell_is_seen),
        cmocka_unit_test(open_sheets_hide_from_their_front),
        cmocka_unit_test(pictures_count_pixels),
        cmocka_unit_test(wall_hides_the_foot_of_a_tower),
        cmocka_unit_test(spot_of_a_large_face_is_seen),
        cmocka_unit_test(group_sees_what_its_cells_see),
        cmocka_unit_test(threads_agree),
        cmocka_unit_test(exhausted_memory_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
