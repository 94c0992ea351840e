// Reliefs: that they show what the object shows from all over the cell, and are refused where they
// cannot.
#include "alloc.h"
#include "relief.h"
#include "rng.h"
#include "shapes.h"

#define RADIUS 10.0f

typedef struct stage {
    hw_scene scene;
    hw_rays *rays;
    hw_capturer *capturer;
    hw_chain chain;
    hw_hexgrid grid;
    hw_cell_view view;
    hw_far_options far;
    hw_svmesh_job job;
} stage;

static void set_stage(stage *s, hw_mesh mesh)
{
    const hw_chain_options chain = {.threads = 1};
    const hw_mat4 here = hw_mat4_identity();
    *s = (stage){.grid = {.cell_size = 20, .z_min = 8, .z_max = 16, .columns = 1, .rows = 1},
                 .far = {.policy = &hw_policy_screen,
                         .self_occlusion_px = 30,
                         .outline_px = 0.03,
                         .interior_px = 5,
                         .relief_px = 0.2,
                         .capture_side_max = 1024,
                         .capture_samples = 2}};
    s->grid.levels = 1;
    s->scene = shape_scene(&mesh, &here, 1);
    assert_int_equal(hw_chain_make(&s->scene.meshes[0], &chain, &s->chain), HW_OK);
    assert_int_equal(hw_rays_create_scene(&s->rays, &s->scene), HW_OK);
    assert_int_equal(hw_capturer_create(&s->scene, s->rays, NULL, &s->capturer), HW_OK);
    s->view = hw_cell_view_make(&s->grid, (hw_cell_id){0});
    hw_box box = s->scene.objects[0].bounds;
    hw_vec3 towards = hw_v3_sub(hw_box_centre(box), s->view.centre);
    s->job = (hw_svmesh_job){.view = &s->view,
                             .options = &s->far,
                             .scene = &s->scene,
                             .capturer = s->capturer,
                             .chain = &s->chain,
                             .distance = hw_region_distance_to(&s->grid, s->view.id, box),
                             .scale = 1,
                             .face = hw_face_towards(towards.x, towards.y)};
}

static void clear_stage(stage *s)
{
    hw_capturer_destroy(s->capturer);
    hw_rays_destroy(s->rays);
    hw_chain_free(&s->chain);
    hw_scene_free(&s->scene);
}

// Whether a ray meets the relief where its coverage is one half or more.
static bool shows(const stage *s, const hw_relief *r, hw_vec3 eye, hw_vec3 direction)
{
    const hw_capture_window *w = &r->window;
    for (uint32_t i = 0; i < r->mesh.index_count; i += 3) {
        hw_vec3 p[3];
        for (int k = 0; k < 3; k++)
            p[k] =
                hw_svmesh_unproject(&s->job, r->mesh.positions[r->mesh.indices[i + (uint32_t)k]]);
        hw_vec3 a = hw_v3_sub(p[1], p[0]), b = hw_v3_sub(p[2], p[0]), n = hw_v3_cross(a, b);
        double facing = (double)hw_v3_dot(direction, n);
        if (facing >= 0)
            continue;
        double t = (double)hw_v3_dot(hw_v3_sub(p[0], eye), n) / facing;
        hw_vec3 hit = hw_v3_mad(eye, direction, (float)t);
        bool inside = t > 0;
        for (int k = 0; k < 3 && inside; k++) {
            hw_vec3 side = hw_v3_sub(p[(k + 1) % 3], p[k]);
            inside = hw_v3_dot(hw_v3_cross(side, hw_v3_sub(hit, p[k])), n) >= 0;
        }
        double plane[3];
        if (!inside || !hw_plane_project(w->centre, w->face, hit, plane))
            continue;
        double x = (plane[0] - (double)w->x_min) / ((double)w->x_max - (double)w->x_min) * w->width;
        double y =
            (plane[1] - (double)w->y_min) / ((double)w->y_max - (double)w->y_min) * w->height;
        uint32_t column = (uint32_t)(x - 0.5), row = (uint32_t)(y - 0.5);
        double u = x - 0.5 - column, v = y - 0.5 - row;
        const uint8_t *at = r->capture.coverage + (size_t)row * w->width + column;
        if ((1 - v) * ((1 - u) * at[0] + u * at[1]) +
                v * ((1 - u) * at[w->width] + u * at[w->width + 1]) >=
            127.5)
            return true;
    }
    return false;
}

static hw_vec3 point_in_cell(hw_rng *rng)
{
    double angle = 2 * HW_PI * (double)hw_rng_float(rng),
           r = 17 * sqrt((double)hw_rng_float(rng)); // the circle within the hexagon
    return hw_v3((float)(r * cos(angle)), (float)(r * sin(angle)), 8 + 8 * hw_rng_float(rng));
}

// Against a ball by its formula: what differs lies within half a pixel of its outline, wherever the
// eye is.
static void a_ball_is_met_from_all_over_the_cell(void **state)
{
    (void)state;
    const hw_vec3 middle = hw_v3(400, 30, 12);
    stage s;
    set_stage(&s, shape_sphere(middle, RADIUS, 96, 48));
    hw_relief r;
    bool good;
    assert_int_equal(hw_relief_make(&s.job, false, &good, &r), HW_OK);
    assert_true(good);
    assert_in_range(r.mesh.index_count / 3, 2, 78);
    for (uint32_t v = 0; v < r.mesh.vertex_count; v++) {
        const double *p = r.mesh.positions[v];
        assert_true(p[0] >= (double)r.window.x_min * s.view.focal_px - 1e-3 &&
                    p[0] <= (double)r.window.x_max * s.view.focal_px + 1e-3 &&
                    p[1] >= (double)r.window.y_min * s.view.focal_px - 1e-3 &&
                    p[1] <= (double)r.window.y_max * s.view.focal_px + 1e-3);
    }
    hw_rng rng = hw_rng_make(7, 7);
    uint32_t hits = 0, misses = 0;
    for (int i = 0; i < 20000; i++) {
        hw_vec3 eye = point_in_cell(&rng);
        hw_vec3 aim = hw_v3(middle.x, middle.y + 3 * RADIUS * (hw_rng_float(&rng) - 0.5f),
                            middle.z + 3 * RADIUS * (hw_rng_float(&rng) - 0.5f));
        hw_vec3 direction = hw_v3_normalize(hw_v3_sub(aim, eye)), way = hw_v3_sub(middle, eye);
        double by = (double)hw_v3_length(hw_v3_cross(way, direction)); // the ray passes the middle
        double pixel = (double)hw_v3_length(way) / s.view.focal_px;
        if (fabs(by - (double)RADIUS) < 0.5 * pixel)
            continue;
        bool expected = by < (double)RADIUS;
        assert_int_equal(shows(&s, &r, eye, direction), expected);
        hits += expected;
        misses += !expected;
    }
    assert_true(hits > 5000 && misses > 5000);
    hw_relief_free(&r);

    s.far.relief_px = 0.01; // finer than texels can be
    assert_int_equal(hw_relief_make(&s.job, false, &good, &r), HW_OK);
    assert_false(good);
    assert_null(r.mesh.indices);
    clear_stage(&s);
}

// One ball before the other: a gap opens between them to the side. What is known to be flat is
// taken unseen.
static void what_opens_gaps_is_refused(void **state)
{
    (void)state;
    hw_mesh near = shape_sphere(hw_v3(150, 0, 12), 5, 48, 24);
    hw_mesh far = shape_sphere(hw_v3(230, 9, 12), 5, 48, 24);
    shape_append(&near, &far);
    stage s;
    set_stage(&s, near);
    hw_relief r;
    bool good;
    assert_int_equal(hw_relief_make(&s.job, false, &good, &r), HW_OK);
    assert_false(good);
    assert_int_equal(hw_relief_make(&s.job, true, &good, &r), HW_OK);
    assert_true(good);
    hw_relief_free(&r);
    s.far.capture_side_max = 16; // too large a capture
    assert_int_equal(hw_relief_make(&s.job, true, &good, &r), HW_OK);
    assert_false(good);
    clear_stage(&s);
}

// An upright sheet, across the view along +x, that turns its front or its back on the cell.
static void set_sheet(stage *s, float y_min, float y_max, bool front)
{
    hw_vec3 along = hw_v3(0, y_max - y_min, 0), up = hw_v3(0, 0, 8);
    set_stage(s, front ? shape_plane(hw_v3(200, y_min, 8), up, along, 4, 4)
                       : shape_plane(hw_v3(200, y_min, 8), along, up, 4, 4));
}

// Near by only the front of a sheet is drawn.
static void backs_of_sheets_are_refused(void **state)
{
    (void)state;
    for (int front = 0; front < 2; front++) {
        stage s;
        hw_relief r;
        bool good;
        set_sheet(&s, -10, 10, front);
        assert_int_equal(hw_relief_make(&s.job, true, &good, &r), HW_OK);
        assert_int_equal(good, front);
        hw_relief_free(&r);
        clear_stage(&s);
    }
}

// Wherever between texels an edge lies, it is drawn there.
static void no_edge_is_cut_off(void **state)
{
    (void)state;
    for (int i = 0; i < 16; i++) {
        stage s;
        hw_relief r;
        bool good;
        float edge = -10 - 0.02f * (float)i; // on the right; a texel is 0.2 wide
        set_sheet(&s, edge, 10, true);
        double texel = 200 / s.view.focal_px / HW_TEXELS_PER_PX;
        assert_int_equal(hw_relief_make(&s.job, true, &good, &r), HW_OK);
        assert_true(good);
        for (int side = -1; side <= 1; side += 2) {
            hw_vec3 aim = hw_v3(200, edge - (float)(side * 0.2 * texel), 12);
            hw_vec3 direction = hw_v3_normalize(hw_v3_sub(aim, s.view.centre));
            assert_int_equal(shows(&s, &r, s.view.centre, direction), side < 0);
        }
        hw_relief_free(&r);
        clear_stage(&s);
    }
}

// Rays may all miss what is much thinner than a texel: it is shown in its colours or not at all.
static void what_is_thin_is_not_black(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(8, 8);
    uint32_t shown = 0, gone = 0;
    for (int i = 0; i < 60; i++) {
        stage s;
        float wide = 0.02f + 0.5f * hw_rng_float(&rng), x = 300 + 600 * hw_rng_float(&rng);
        set_stage(&s, shape_box((hw_box){{x, 5, 0}, {x + wide, 5 + wide, 40}}, false));
        s.far.relief_px = 0;
        bool is_near;
        hw_svmesh mesh;
        assert_int_equal(hw_svmesh_derive(&s.job, &is_near, &mesh), HW_OK);
        assert_false(is_near);
        uint32_t met = 0;
        for (uint32_t k = 0; k < mesh.capture.width * mesh.capture.height; k++)
            met += mesh.capture.colors[k].a != 0;
        assert_true(met > 0 || mesh.record.index_count == 0);
        shown += met > 0;
        gone += met == 0;
        hw_svmesh_free(&mesh);
        clear_stage(&s);
    }
    assert_true(shown > 30 && gone < 10);
}

static void memory_may_end_anywhere(void **state)
{
    (void)state;
    stage s;
    set_stage(&s, shape_sphere(hw_v3(400, 30, 12), RADIUS, 32, 16));
    hw_relief r;
    bool good;
    uint64_t n = 1;
    for (;; n++) {
        hw_alloc_fail_after(n);
        hw_status status = hw_relief_make(&s.job, false, &good, &r);
        hw_alloc_fail_after(0);
        if (status == HW_OK)
            break;
        assert_int_equal(status, HW_MEMORY);
        assert_null(r.mesh.positions);
        assert_null(r.capture.colors);
    }
    assert_true(n > 20);
    hw_relief_free(&r);
    clear_stage(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_ball_is_met_from_all_over_the_cell),
        cmocka_unit_test(what_opens_gaps_is_refused),
        cmocka_unit_test(backs_of_sheets_are_refused),
        cmocka_unit_test(no_edge_is_cut_off),
        cmocka_unit_test(what_is_thin_is_not_black),
        cmocka_unit_test(memory_may_end_anywhere),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
