// Groups of cells: each object is left to one level, whatever was asked before.
#include "groups.h"
#include "hierarchy.h"
#include "rng.h"
#include "shapes.h"

#define OBJECTS 40u
#define LEVELS  3

typedef struct stage {
    hw_scene scene;
    hw_chain chains[OBJECTS]; // of the original alone
    hw_mesh_level_info infos[OBJECTS];
    hw_hexgrid grid;
    hw_far_options far;
} stage;

static void set_stage(stage *s)
{
    hw_mesh meshes[OBJECTS];
    hw_mat4 places[OBJECTS];
    hw_rng rng = hw_rng_make(1, 1);
    for (uint32_t i = 0; i < OBJECTS; i++) {
        meshes[i] = shape_sphere(hw_v3(0, 0, 0), 2 + 6 * hw_rng_float(&rng), 24, 12);
        places[i] = hw_mat4_translation(3000.0 * hw_rng_float(&rng) - 1500,
                                        3000.0 * hw_rng_float(&rng) - 1500, 8);
    }
    s->scene = shape_scene(meshes, places, OBJECTS);
    for (uint32_t i = 0; i < OBJECTS; i++) {
        s->infos[i] = (hw_mesh_level_info){.index_count = s->scene.meshes[i].index_count};
        s->chains[i] = (hw_chain){1, &s->scene.meshes[i], &s->infos[i]};
    }
    s->grid = (hw_hexgrid){
        .cell_size = 20, .z_min = 8, .z_max = 16, .columns = 40, .rows = 40, .levels = LEVELS};
    s->far = (hw_far_options){.self_occlusion_px = 20, .impostor_px = 1, .capture_side_max = 1024};
}

static hw_groups *make_groups(const stage *s)
{
    hw_groups *groups;
    assert_int_equal(hw_groups_create(&s->grid, &s->scene, s->chains, &s->far, &groups), HW_OK);
    return groups;
}

static void one_level_each_whatever_was_asked(void **state)
{
    (void)state;
    stage s;
    set_stage(&s);
    hw_groups *groups = make_groups(&s);
    hw_rng rng = hw_rng_make(2, 2);
    uint32_t by_level[LEVELS] = {0};
    for (int i = 0; i < 400; i++) {
        hw_cell_id cell = {0, (int32_t)hw_rng_below(&rng, 40), (int32_t)hw_rng_below(&rng, 40)};
        hw_groups *fresh = make_groups(&s);
        for (int k = 0; k < 20; k++) {
            uint32_t object = hw_rng_below(&rng, OBJECTS), drawn = 0;
            for (int32_t l = 0; l < LEVELS; l++) {
                hw_cell_id of_level = hw_cell_ancestor(cell, l);
                bool left = hw_groups_leave_to(groups, of_level, object);
                assert_int_equal(left, hw_groups_leave_to(fresh, of_level, object));
                drawn += left;
                by_level[l] += left;
            }
            assert_int_equal(drawn, 1);
        }
        hw_groups_destroy(fresh);
    }
    for (int l = 0; l < LEVELS; l++)
        assert_true(by_level[l] > 100);
    hw_groups_destroy(groups);
    assert_true(hw_groups_leave_to(NULL, (hw_cell_id){0}, 0));
    hw_scene_free(&s.scene);
}

// What groups have promised to draw of an object with this box, in 60 cells: it lies in front of
// their captures, and fits. Returns how often they did.
static uint32_t check_served(hw_box box, hw_rng *rng)
{
    const hw_mat4 here = hw_mat4_identity();
    hw_mesh mesh = shape_box(box, false);
    uint32_t served = 0;
    hw_groups *groups;
    stage s;
    set_stage(&s);
    hw_scene_free(&s.scene);
    s.scene = shape_scene(&mesh, &here, 1);
    s.infos[0] = (hw_mesh_level_info){.index_count = s.scene.meshes[0].index_count};
    s.chains[0] = (hw_chain){1, &s.scene.meshes[0], &s.infos[0]};
    groups = make_groups(&s);
    for (int k = 0; k < 60; k++) {
        hw_cell_id cell = {0, (int32_t)hw_rng_below(rng, 40), (int32_t)hw_rng_below(rng, 40)};
        for (int32_t l = 1; l < LEVELS; l++) {
            hw_cell_id group = hw_cell_ancestor(cell, l);
            if (!hw_groups_leave_to(groups, group, 0))
                continue;
            hw_cell_view view = hw_cell_view_make(&s.grid, group);
            hw_vec3 corners[8], to = hw_v3_sub(hw_box_centre(box), view.centre);
            const hw_svmesh_job job = {.view = &view,
                                       .options = &s.far,
                                       .distance = hw_region_distance_to(&s.grid, group, box)};
            double planes[8][3];
            hw_plane_bounds bounds;
            hw_capture_window window;
            int face = hw_face_towards(to.x, to.y);
            for (uint32_t c = 0; c < 8; c++)
                corners[c] = hw_box_corner(box, c);
            assert_true(hw_plane_project_all(view.centre, face, corners, 8, planes, &bounds));
            assert_true(hw_capture_window_fit(&job, view.centre, face, &bounds, &window));
            served++;
        }
    }
    hw_groups_destroy(groups);
    hw_scene_free(&s.scene);
    return served;
}

// Poles at all heights.
static void poles_that_are_served_can_be_captured(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(5, 5);
    uint32_t served = 0;
    for (int i = 0; i < 60; i++) {
        float x = 900 * (hw_rng_float(&rng) - 0.5f), y = 900 * (hw_rng_float(&rng) - 0.5f),
              z = 500 * hw_rng_float(&rng);
        served += check_served((hw_box){{x, y, z}, {x + 0.2f, y + 0.2f, z + 100}}, &rng);
    }
    assert_true(served > 1000);
}

// Clouds: high above, they are much larger on the upright plane of a capture than to the eye.
static void clouds_that_are_served_can_be_captured(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(6, 6);
    uint32_t served = 0;
    for (int i = 0; i < 120; i++) {
        float x = 2000 + 3000 * hw_rng_float(&rng), y = 400 * hw_rng_float(&rng),
              z = 10000 * hw_rng_float(&rng), size = 100 + 500 * hw_rng_float(&rng);
        served += check_served((hw_box){{x, y, z}, {x + size, y + size, z + 20}}, &rng);
    }
    assert_true(served > 100);
}

// Levels of a chain may reach beyond the object, which a group has promised to draw by its box.
static void no_error_is_above_its_bound(void **state)
{
    (void)state;
    stage s;
    set_stage(&s);
    for (uint32_t i = 0; i < OBJECTS; i++)
        for (uint32_t v = 0; v < s.scene.meshes[i].vertex_count; v++)
            s.scene.meshes[i].positions[v] = hw_v3_scale(s.scene.meshes[i].positions[v], 3);
    hw_rng rng = hw_rng_make(3, 3);
    for (int i = 0; i < 300; i++) {
        hw_cell_id cell = {0, (int32_t)hw_rng_below(&rng, 40), (int32_t)hw_rng_below(&rng, 40)};
        hw_cell_view view =
            hw_cell_view_make(&s.grid, hw_cell_ancestor(cell, (int32_t)hw_rng_below(&rng, LEVELS)));
        uint32_t object_idx = hw_rng_below(&rng, OBJECTS);
        const hw_svmesh_job job = {.view = &view,
                                   .scene = &s.scene,
                                   .chain = &s.chains[object_idx],
                                   .object_idx = object_idx};
        double bound =
            hw_svmesh_self_occlusion_bound(&view, view.size, s.scene.objects[object_idx].bounds);
        assert_true(hw_svmesh_self_occlusion(&job, 0) <= bound);
    }
    hw_scene_free(&s.scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(one_level_each_whatever_was_asked),
                                       cmocka_unit_test(poles_that_are_served_can_be_captured),
                                       cmocka_unit_test(clouds_that_are_served_can_be_captured),
                                       cmocka_unit_test(no_error_is_above_its_bound)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
