// Clusters on scenes of a few spheres round one cell of side 20: which objects join, what a union
// keeps, and that its capture shows the nearest.
#include "build_cell.h"
#include "shapes.h"

#define OBJECTS 3u

typedef struct stage {
    hw_scene scene;
    hw_rays *rays;
    hw_capturer *capturer;
    hw_occlusion *occlusion;
    hw_hexgrid grid;
    hw_chain chains[OBJECTS];
} stage;

typedef struct ball {
    float x, y, z, radius;
} ball;

static void set_stage(stage *s, const ball balls[OBJECTS])
{
    hw_mesh meshes[OBJECTS];
    hw_mat4 transforms[OBJECTS];
    const hw_chain_options chain = {.threads = 1};
    const hw_occlusion_options occlusion = hw_occlusion_defaults();
    *s = (stage){.grid = {.cell_size = 20, .z_min = 8, .z_max = 16, .columns = 1, .rows = 1}};
    s->grid.levels = 1;
    for (uint32_t i = 0; i < OBJECTS; i++) {
        const ball *b = &balls[i];
        meshes[i] = shape_sphere(hw_v3(b->x, b->y, b->z), b->radius, 32, 16);
        transforms[i] = hw_mat4_identity();
    }
    s->scene = shape_scene(meshes, transforms, OBJECTS);
    for (uint32_t i = 0; i < OBJECTS; i++)
        assert_int_equal(hw_chain_make(&s->scene.meshes[i], &chain, &s->chains[i]), HW_OK);
    assert_int_equal(hw_rays_create_scene(&s->rays, &s->scene), HW_OK);
    assert_int_equal(hw_capturer_create(&s->scene, s->rays, NULL, &s->capturer), HW_OK);
    assert_int_equal(hw_occlusion_create(&s->occlusion, &s->scene, s->rays, &s->grid, &occlusion),
                     HW_OK);
}

static void clear_stage(stage *s)
{
    hw_occlusion_destroy(s->occlusion);
    hw_capturer_destroy(s->capturer);
    hw_rays_destroy(s->rays);
    for (uint32_t i = 0; i < OBJECTS; i++)
        hw_chain_free(&s->chains[i]);
    hw_scene_free(&s->scene);
}

static hw_cell make_cell(const stage *s, bool clusters, double error_px, bool backwards)
{
    static const uint32_t order[OBJECTS] = {0, 1, 2};
    const hw_cell_inputs inputs = {.scene = &s->scene,
                                   .chains = s->chains,
                                   .capturer = s->capturer,
                                   .occlusion = s->occlusion,
                                   .grid = &s->grid,
                                   .clusters = clusters,
                                   .cluster_error_px = error_px,
                                   .far = {.policy = &hw_policy_screen,
                                           .self_occlusion_px = 30,
                                           .outline_px = 0.09,
                                           .interior_px = 5,
                                           .capture_side_max = 1024,
                                           .capture_samples = 2},
                                   .order = order,
                                   .backwards = backwards};
    hw_cell cell;
    hw_cell_seconds seconds = {0};
    assert_int_equal(hw_build_cell(&inputs, (hw_cell_id){0}, &cell, &seconds), HW_OK);
    assert_int_equal(hw_cell_validate(&cell, "cell"), HW_OK);
    return cell;
}

// Two balls, one partly behind the other, and a third far to the side.
static const ball pair[OBJECTS] = {{400, 0, 12, 10}, {440, 6, 14, 10}, {0, 400, 12, 10}};

static void what_overlaps_becomes_one(void **state)
{
    (void)state;
    stage s;
    set_stage(&s, pair);
    hw_cell alone = make_cell(&s, false, 10, false), joined = make_cell(&s, true, 10, false);
    assert_int_equal(alone.far_count, 3);
    assert_int_equal(joined.far_count, 2);
    assert_true(joined.atlas_width * joined.atlas_height <= alone.atlas_width * alone.atlas_height);
    // Part of the farther ball can be seen, so the union reaches as far as both do alone (one step
    // of its coarser vertices aside).
    const hw_far_record *both = NULL;
    hw_box box = hw_box_empty();
    for (uint32_t i = 0; i < 2; i++)
        if (joined.far[i].object_idx <= 1)
            both = &joined.far[i];
    for (uint32_t i = 0; i < 3; i++)
        if (alone.far[i].object_idx <= 1)
            box = hw_box_union(box, alone.far[i].bounds);
    assert_non_null(both);
    assert_float_equal(both->bounds.min.x, box.min.x, 0.2);
    assert_float_equal(both->bounds.max.x, box.max.x, 0.2);
    assert_float_equal(both->bounds.max.y, box.max.y, 0.2);
    assert_float_equal(both->bounds.max.z, box.max.z, 0.2);
    assert_true(joined.index_count <= alone.index_count);
    hw_cell_free(&alone);
    hw_cell_free(&joined);
    clear_stage(&s);
}

static void what_would_show_holes_stays_apart(void **state)
{
    (void)state;
    stage s;
    set_stage(&s, pair);
    hw_cell cell = make_cell(&s, true, 1, false);
    assert_int_equal(cell.far_count, 3);
    hw_cell_free(&cell);
    clear_stage(&s);
}

// A small ball behind a large one: nothing of it is kept.
static void what_members_hide_is_dropped(void **state)
{
    (void)state;
    static const ball balls[OBJECTS] = {{300, 0, 12, 30}, {350, 0, 12, 6}, {0, 400, 12, 10}};
    stage s;
    set_stage(&s, balls);
    hw_cell alone = make_cell(&s, false, 29, false), joined = make_cell(&s, true, 29, false);
    assert_int_equal(joined.far_count, 2);
    for (uint32_t i = 0; i < 2; i++)
        if (joined.far[i].object_idx == 0)
            assert_true(joined.far[i].bounds.max.x < 335);
    assert_true(joined.index_count < alone.index_count);
    hw_cell_free(&alone);
    hw_cell_free(&joined);
    clear_stage(&s);
}

static void order_does_not_matter(void **state)
{
    (void)state;
    stage s;
    set_stage(&s, pair);
    hw_cell a = make_cell(&s, true, 10, false), b = make_cell(&s, true, 10, true);
    assert_int_equal(a.vertex_count, b.vertex_count);
    assert_memory_equal(a.far, b.far, a.far_count * sizeof *a.far);
    assert_memory_equal(a.vertices, b.vertices, a.vertex_count * sizeof *a.vertices);
    assert_memory_equal(a.indices, b.indices, a.index_count * sizeof *a.indices);
    hw_cell_free(&a);
    hw_cell_free(&b);
    clear_stage(&s);
}

static void exhausted_memory_is_an_error(void **state)
{
    (void)state;
    stage s;
    set_stage(&s, pair);
    const hw_cell_inputs inputs = {.scene = &s.scene,
                                   .chains = s.chains,
                                   .capturer = s.capturer,
                                   .occlusion = s.occlusion,
                                   .grid = &s.grid,
                                   .clusters = true,
                                   .cluster_error_px = 10,
                                   .far = {.policy = &hw_policy_screen,
                                           .self_occlusion_px = 30,
                                           .outline_px = 0.09,
                                           .interior_px = 5,
                                           .capture_side_max = 1024,
                                           .capture_samples = 1}};
    hw_status status = HW_MEMORY;
    uint64_t n = 1;
    for (; status != HW_OK && n < 5000; n++) {
        hw_cell cell;
        hw_cell_seconds seconds = {0};
        hw_alloc_fail_after(n);
        status = hw_build_cell(&inputs, (hw_cell_id){0}, &cell, &seconds);
        hw_alloc_fail_after(0);
        assert_true(status == HW_OK || status == HW_MEMORY);
        if (status == HW_OK)
            hw_cell_free(&cell);
    }
    assert_int_equal(status, HW_OK);
    assert_true(n > 50);
    clear_stage(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_overlaps_becomes_one),
        cmocka_unit_test(what_would_show_holes_stays_apart),
        cmocka_unit_test(what_members_hide_is_dropped),
        cmocka_unit_test(order_does_not_matter),
        cmocka_unit_test(exhausted_memory_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
