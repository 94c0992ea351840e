// The walker: motion, bounds, tours and recordings, all without a window.
#include "alloc.h"
#include "file.h"
#include "mesh_file.h"
#include "rng.h"
#include "walker.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#define STEP (1.0 / 60)

static hw_hexgrid test_grid(void)
{
    return hw_hexgrid_cover(0, 0, 400, 400, 25, 2, 40);
}

static hw_walker test_walker(void)
{
    hw_hexgrid grid = test_grid();
    hw_walker w;
    hw_walker_init(&w, &grid);
    hw_walker_place(&w, hw_v3(200, 200, 12), hw_v3(1, 0, 0));
    return w;
}

static void hold(hw_walker *w, const hw_key *keys, int count, double seconds, double step)
{
    hw_input input = {0};
    for (int i = 0; i < count; i++)
        input.down[keys[i]] = true;
    int steps = (int)lround(seconds / step);
    for (int i = 0; i < steps; i++)
        assert_int_equal(hw_walker_update(w, &input, step), HW_OK);
}

static void hold_one(hw_walker *w, hw_key key, double seconds)
{
    hold(w, &key, 1, seconds, STEP);
}

static void assert_at(const hw_walker *w, double x, double y, double z, double tolerance)
{
    assert_true(fabs(w->x - x) <= tolerance);
    assert_true(fabs(w->y - y) <= tolerance);
    assert_true(fabs(w->z - z) <= tolerance);
}

static void assert_near_v3(hw_vec3 a, hw_vec3 b, float tolerance)
{
    assert_true(hw_v3_length(hw_v3_sub(a, b)) <= tolerance);
}

// How far (x, y) is beyond the grid, at least; 0 or less inside.
static double outside(const hw_hexgrid *grid, double x, double y)
{
    double least = INFINITY;
    for (uint32_t i = 0; i < hw_hexgrid_cell_count(grid); i++) {
        hw_vec3 corners[HW_CELL_CORNERS];
        hw_cell_corners(grid, hw_hexgrid_cell(grid, i), corners);
        double worst = -INFINITY;
        for (int k = 0; k < 6; k++) {
            hw_vec3 a = corners[k], b = corners[(k + 1) % 6];
            double nx = (double)b.y - a.y, ny = (double)a.x - b.x;
            worst = fmax(worst, ((x - a.x) * nx + (y - a.y) * ny) / hypot(nx, ny));
        }
        least = fmin(least, worst);
    }
    return least;
}

// ---- Motion

static void test_every_direction(void **state)
{
    (void)state;
    static const struct {
        hw_key key;
        double x, y;
    } cases[] = {{HW_KEY_FORWARD, 30, 0},
                 {HW_KEY_BACK, -30, 0},
                 {HW_KEY_LEFT, 0, 30},
                 {HW_KEY_RIGHT, 0, -30}};
    for (int i = 0; i < 4; i++) {
        hw_walker w = test_walker();
        hold_one(&w, cases[i].key, 1);
        assert_at(&w, 200 + cases[i].x, 200 + cases[i].y, 12, 1e-9);
    }
    hw_walker w = test_walker();
    hold_one(&w, HW_KEY_UP, 0.5);
    assert_at(&w, 200, 200, 27, 1e-9);
    hold_one(&w, HW_KEY_DOWN, 0.25);
    assert_at(&w, 200, 200, 19.5, 1e-9);
}

static void test_running(void **state)
{
    (void)state;
    hw_walker w = test_walker();
    hold(&w, (hw_key[]){HW_KEY_FORWARD, HW_KEY_RUN}, 2, 1, STEP);
    assert_at(&w, 290, 200, 12, 1e-9);
    // Shift alone goes nowhere.
    hold_one(&w, HW_KEY_RUN, 1);
    assert_at(&w, 290, 200, 12, 1e-9);
}

static void test_diagonal_is_not_faster(void **state)
{
    (void)state;
    hw_walker w = test_walker();
    hold(&w, (hw_key[]){HW_KEY_FORWARD, HW_KEY_LEFT}, 2, 1, STEP);
    assert_at(&w, 200 + 30 / sqrt(2), 200 + 30 / sqrt(2), 12, 1e-9);
    w = test_walker();
    hold(&w, (hw_key[]){HW_KEY_FORWARD, HW_KEY_LEFT, HW_KEY_UP}, 3, 1, STEP);
    double moved = sqrt(pow(w.x - 200, 2) + pow(w.y - 200, 2) + pow(w.z - 12, 2));
    assert_true(fabs(moved - 30) < 1e-9);
    // Opposite keys cancel.
    w = test_walker();
    hold(&w, (hw_key[]){HW_KEY_FORWARD, HW_KEY_BACK, HW_KEY_LEFT}, 3, 1, STEP);
    assert_at(&w, 200, 230, 12, 1e-9);
}

// Walking ahead while turning is a circle of radius v / omega, at any frame rate.
static void test_curve(void **state)
{
    (void)state;
    const double steps[] = {1.0 / 240, 1.0 / 60, 1.0 / 20};
    double radius = HW_WALKER_SPEED / HW_WALKER_TURN_RAD;
    for (int i = 0; i < 3; i++) {
        hw_walker w = test_walker();
        hold(&w, (hw_key[]){HW_KEY_FORWARD, HW_KEY_TURN_LEFT}, 2, 1, steps[i]);
        assert_true(fabs(w.heading_rad - HW_PI / 2) < 1e-9);
        assert_at(&w, 200 + radius, 200 + radius, 12, 0.01);
    }
}

static void test_frame_rate_does_not_matter(void **state)
{
    (void)state;
    hw_walker a = test_walker(), b = test_walker();
    hold(&a, (hw_key[]){HW_KEY_FORWARD}, 1, 3, 1.0 / 200);
    hold(&b, (hw_key[]){HW_KEY_FORWARD}, 1, 3, 1.0 / 5);
    assert_at(&a, b.x, b.y, b.z, 1e-9);
}

static void test_stalled_frame_does_not_fling(void **state)
{
    (void)state;
    hw_walker w = test_walker();
    hw_input input = {0};
    input.down[HW_KEY_FORWARD] = true;
    assert_int_equal(hw_walker_update(&w, &input, 3600), HW_OK);
    assert_at(&w, 200 + 30 * HW_WALKER_STEP_MAX_S, 200, 12, 1e-9);
    assert_int_equal(hw_walker_update(&w, &input, 0), HW_OK);
    assert_at(&w, 200 + 30 * HW_WALKER_STEP_MAX_S, 200, 12, 1e-9);
}

// ---- Looking

static void test_turning(void **state)
{
    (void)state;
    hw_walker w = test_walker();
    hold_one(&w, HW_KEY_TURN_RIGHT, 1);
    assert_near_v3(hw_walker_view(&w).forward, hw_v3(0, -1, 0), 1e-5f);
    hold_one(&w, HW_KEY_TURN_LEFT, 9);
    assert_near_v3(hw_walker_view(&w).forward, hw_v3(1, 0, 0), 1e-4f);
    assert_true(fabs(w.heading_rad) <= HW_PI);
}

static void test_mouse_and_pitch_limit(void **state)
{
    (void)state;
    hw_walker w = test_walker();
    hw_input input = {.mouse_dx = 100, .mouse_dy = -50};
    assert_int_equal(hw_walker_update(&w, &input, STEP), HW_OK);
    // To the right and up, by angles that do not depend on the frame's time.
    assert_true(fabs(w.heading_rad + 100 * HW_WALKER_MOUSE_RAD) < 1e-12);
    assert_true(fabs(w.pitch_rad - 50 * HW_WALKER_MOUSE_RAD) < 1e-12);
    input = (hw_input){.mouse_dy = -1e6};
    assert_int_equal(hw_walker_update(&w, &input, STEP), HW_OK);
    assert_true(w.pitch_rad == HW_WALKER_PITCH_RAD);
    hw_tour_frame view = hw_walker_view(&w);
    assert_true(fabsf(hw_v3_length(view.forward) - 1) < 1e-6f);
    assert_true(view.forward.z < 0.999f); // never parallel to up
    // Walking goes along the ground whatever the pitch.
    double x = w.x, y = w.y;
    hold_one(&w, HW_KEY_FORWARD, 1);
    assert_true(fabs(hypot(w.x - x, w.y - y) - 30) < 1e-9);
    assert_true(w.z == 12);
    input = (hw_input){.mouse_dy = 1e6};
    assert_int_equal(hw_walker_update(&w, &input, STEP), HW_OK);
    assert_true(w.pitch_rad == -HW_WALKER_PITCH_RAD);
}

static void test_place_looks_along(void **state)
{
    (void)state;
    hw_walker w = test_walker();
    hw_vec3 forward = hw_v3_normalize(hw_v3(-1, 2, 0.5f));
    hw_walker_place(&w, hw_v3(100, 150, 20), forward);
    assert_near_v3(hw_walker_view(&w).forward, forward, 1e-6f);
    assert_near_v3(hw_walker_view(&w).eye, hw_v3(100, 150, 20), 1e-4f);
    // Straight down: the heading stays, the pitch goes to its limit.
    double heading = w.heading_rad;
    hw_walker_place(&w, hw_v3(100, 150, 20), hw_v3(0, 0, -1));
    assert_true(w.heading_rad == heading && w.pitch_rad == -HW_WALKER_PITCH_RAD);
}

static void test_camera(void **state)
{
    (void)state;
    hw_walker w = test_walker();
    hw_camera camera = hw_walker_camera(&w, 640, 480);
    assert_true(camera.width == 640 && camera.height == 480 && camera.fov_degrees == 60);
    assert_near_v3(camera.eye, hw_v3(200, 200, 12), 0);
    assert_near_v3(camera.up, hw_v3(0, 0, 1), 0);
}

// ---- Bounds

static void test_heights(void **state)
{
    (void)state;
    hw_walker w = test_walker();
    hold_one(&w, HW_KEY_UP, 5);
    assert_true(w.z == 40);
    hold_one(&w, HW_KEY_DOWN, 5);
    assert_true(w.z == 2);
}

// From the middle into every direction: the walker ends at the border, and never leaves the grid.
static void test_never_leaves_the_grid(void **state)
{
    (void)state;
    hw_hexgrid grid = test_grid();
    for (int i = 0; i < 48; i++) {
        hw_walker w = test_walker();
        double angle = i * HW_PI / 24;
        hw_walker_place(&w, hw_v3(200, 200, 12), hw_v3((float)cos(angle), (float)sin(angle), 0));
        hw_input input = {0};
        input.down[HW_KEY_FORWARD] = input.down[HW_KEY_RUN] = true;
        for (int k = 0; k < 300; k++) {
            assert_int_equal(hw_walker_update(&w, &input, 0.1), HW_OK);
            assert_true(outside(&grid, w.x, w.y) < 1e-3);
        }
        // A little farther out there is no grid any more.
        assert_true(outside(&grid, w.x + cos(angle), w.y + sin(angle)) > 1e-3);
    }
}

// Along a border at a slant one slides on instead of sticking.
static void test_slides_along_the_border(void **state)
{
    (void)state;
    hw_walker w = test_walker();
    hw_walker_place(&w, hw_v3(-1000, 100, 12), hw_v3(-0.8f, 0.6f, 0));
    double y = w.y;
    hold_one(&w, HW_KEY_FORWARD, 10);
    assert_true(w.y > y + 50);
}

static void test_far_places_come_inside(void **state)
{
    (void)state;
    hw_hexgrid grid = test_grid();
    const hw_vec3 places[] = {
        {-1e6f, -1e6f, -1e6f}, {1e6f, 200, 1e6f}, {200, 1e6f, 0}, {-50, 450, 12}, {450, -50, 12}};
    for (int i = 0; i < 5; i++) {
        hw_walker w = test_walker();
        hw_walker_place(&w, places[i], hw_v3(0, 1, 0));
        assert_true(outside(&grid, w.x, w.y) < 1e-3);
        assert_true(w.z >= 2 && w.z <= 40);
    }
}

static void test_one_cell_grid(void **state)
{
    (void)state;
    hw_hexgrid grid = {.cell_size = 10, .z_min = 5, .z_max = 5, .columns = 1, .rows = 1};
    hw_walker w;
    hw_walker_init(&w, &grid);
    assert_at(&w, 0, 0, 5, 1e-6);
    hw_walker_place(&w, hw_v3(0, 0, 5), hw_v3(1, 0, 0));
    hold_one(&w, HW_KEY_FORWARD, 2);
    assert_at(&w, 10, 0, 5, 1e-4); // a corner
    hw_walker_place(&w, hw_v3(0, 0, 5), hw_v3(0, 1, 0));
    hold_one(&w, HW_KEY_FORWARD, 2);
    assert_at(&w, 0, 5 * sqrt(3), 5, 1e-4); // the middle of a face
}

// ---- The default place

static void test_default_place_is_clear(void **state)
{
    (void)state;
    // A block over the middle of the grid, and one thing to see far to the west.
    const hw_box boxes[] = {{{150, 150, 0}, {250, 250, 60}}, {{10, 190, 0}, {30, 210, 30}}};
    hw_walker w = test_walker();
    hw_walker_place_default(&w, boxes, 2, 1);
    hw_vec3 eye = hw_walker_view(&w).eye;
    double dx = fmax(150 - (double)eye.x, (double)eye.x - 250);
    double dy = fmax(150 - (double)eye.y, (double)eye.y - 250);
    assert_true(fmax(dx, dy) > 25.0 / 3 / sqrt(2)); // a third of a cell clear of the block
    assert_true(fmax(dx, dy) < 50);                 // and not far from the middle
    assert_true(eye.z == 13);
    // And it looks at something.
    hw_vec3 forward = hw_walker_view(&w).forward;
    hw_vec3 to_block = hw_v3_normalize(hw_v3_sub(hw_v3(200, 200, eye.z), eye));
    hw_vec3 to_west = hw_v3_normalize(hw_v3_sub(hw_v3(20, 200, eye.z), eye));
    assert_true(hw_v3_dot(forward, to_block) > 0.86f || hw_v3_dot(forward, to_west) > 0.86f);
}

static void test_default_place_without_objects(void **state)
{
    (void)state;
    hw_walker w = test_walker();
    hw_walker_place_default(&w, NULL, 0, 0);
    assert_true(outside(&w.grid, w.x, w.y) <= 0 && w.z == 12);
}

static void test_default_place_where_nothing_is_clear(void **state)
{
    (void)state;
    const hw_box everything = {{-1e4f, -1e4f, -1e4f}, {1e4f, 1e4f, 1e4f}};
    hw_walker w = test_walker();
    hw_walker_place_default(&w, &everything, 1, 1000);
    assert_true(outside(&w.grid, w.x, w.y) <= 0);
    assert_true(w.z == 40); // eye height above that ground is above the cells
}

// ---- Tours

static hw_tour_frame frame(double t, float x, float y, float fx, float fy)
{
    return (hw_tour_frame){t, {x, y, 12}, {fx, fy, 0}, {0, 0, 1}};
}

static void test_playback_hits_the_frames(void **state)
{
    (void)state;
    // At uneven times, as tours of other programs may be.
    hw_tour_frame frames[] = {frame(1, 100, 100, 1, 0), frame(1.5, 110, 100, 0, 1),
                              frame(3, 110, 130, -1, 0)};
    hw_tour tour = {.fov_degrees = 50, .frame_count = 3, .frames = frames};
    hw_walker w = test_walker();
    hw_input input = {0};
    hw_walker_play(&w, &tour);
    assert_true(hw_walker_camera(&w, 10, 10).fov_degrees == 50);
    assert_near_v3(hw_walker_view(&w).eye, frames[0].eye, 0);
    assert_int_equal(hw_walker_update(&w, &input, 0.5), HW_OK);
    assert_near_v3(hw_walker_view(&w).eye, frames[1].eye, 0);
    assert_near_v3(hw_walker_view(&w).forward, frames[1].forward, 0);
    assert_int_equal(hw_walker_update(&w, &input, 0.75), HW_OK);
    assert_near_v3(hw_walker_view(&w).eye, hw_v3(110, 115, 12), 1e-4f);
    assert_near_v3(hw_walker_view(&w).forward, hw_v3(-sqrtf(0.5f), sqrtf(0.5f), 0), 1e-5f);
    // This tour is open: at its end one stands free, where it ended.
    assert_int_equal(hw_walker_update(&w, &input, 100), HW_OK);
    assert_false(w.playing);
    assert_at(&w, 110, 130, 12, 0);
    assert_near_v3(hw_walker_view(&w).forward, hw_v3(-1, 0, 0), 1e-6f);
    // Once more from the start.
    hw_walker_toggle_playing(&w);
    assert_true(w.playing);
    assert_near_v3(hw_walker_view(&w).eye, frames[0].eye, 0);
}

static void test_tour_at_odd_frames(void **state)
{
    (void)state;
    hw_tour_frame one = frame(5, 1, 2, 1, 0);
    hw_tour tour = {.fov_degrees = 60, .frame_count = 1, .frames = &one};
    for (int i = -1; i <= 1; i++)
        assert_near_v3(hw_walker_tour_at(&tour, 5 + i).eye, one.eye, 0);
    // Equal times and opposite directions have no middle, but give no NaN.
    hw_tour_frame frames[] = {frame(0, 0, 0, 1, 0), frame(1, 1, 0, 1, 0), frame(1, 2, 0, -1, 0),
                              frame(2, 3, 0, 1, 0)};
    tour = (hw_tour){.fov_degrees = 60, .frame_count = 4, .frames = frames};
    for (int i = -5; i < 30; i++) {
        hw_tour_frame f = hw_walker_tour_at(&tour, i / 10.0);
        assert_true(hw_v3_finite(f.eye) && hw_v3_length(f.forward) > 0.9f);
    }
}

// A square that ends one side before its start.
static void test_closed_tour_goes_round(void **state)
{
    (void)state;
    hw_tour_frame frames[] = {frame(0, 100, 100, 1, 0), frame(1, 110, 100, 0, 1),
                              frame(2, 110, 110, -1, 0), frame(3, 100, 110, 0, -1)};
    hw_tour tour = {.fov_degrees = 60, .frame_count = 4, .frames = frames};
    hw_walker w = test_walker();
    hw_input input = {0};
    hw_walker_play(&w, &tour);
    assert_int_equal(hw_walker_update(&w, &input, 30.5), HW_OK);
    assert_true(w.playing);
    assert_near_v3(hw_walker_view(&w).eye, hw_v3(105, 100, 12), 1e-4f);
}

static void test_motion_leaves_the_tour(void **state)
{
    (void)state;
    hw_tour_frame frames[] = {frame(0, 100, 100, 0, 1), frame(10, 100, 200, 0, 1)};
    hw_tour tour = {.fov_degrees = 60, .frame_count = 2, .frames = frames};
    hw_walker w = test_walker();
    hw_input still = {0};
    hw_walker_play(&w, &tour);
    still.down[HW_KEY_RUN] = true; // no motion
    assert_int_equal(hw_walker_update(&w, &still, 2), HW_OK);
    assert_true(w.playing);
    hold_one(&w, HW_KEY_RIGHT, 1);
    assert_false(w.playing);
    assert_at(&w, 130, 120, 12, 1e-3);
    assert_true(fabs(w.heading_rad - HW_PI / 2) < 1e-6);
    hw_walker_toggle_playing(&w); // goes on where it was left
    assert_near_v3(hw_walker_view(&w).eye, hw_v3(100, 120, 12), 1e-4f);
    hw_walker_toggle_playing(&w); // and rests
    assert_int_equal(hw_walker_update(&w, &still, 1), HW_OK);
    assert_at(&w, 100, 120, 12, 1e-3);
    hw_input look = {.mouse_dx = 1};
    hw_walker_toggle_playing(&w);
    assert_int_equal(hw_walker_update(&w, &look, STEP), HW_OK);
    assert_false(w.playing);
}

static void test_toggle_without_tour(void **state)
{
    (void)state;
    hw_walker w = test_walker();
    hw_walker_toggle_playing(&w);
    assert_false(w.playing);
}

// ---- Recording

// At any display rate a recording has a frame every 1/60 s, where the walker was then.
static void test_recording_has_fixed_steps(void **state)
{
    (void)state;
    const double steps[] = {1.0 / 60, 1.0 / 144, 1.0 / 25, 0.2};
    for (int i = 0; i < 4; i++) {
        hw_walker w = test_walker();
        assert_int_equal(hw_walker_record(&w), HW_OK);
        hold(&w, (hw_key[]){HW_KEY_FORWARD}, 1, 2, steps[i]);
        hw_tour tour;
        hw_walker_take_recorded(&w, &tour);
        assert_false(w.recording);
        assert_int_equal(tour.frame_count, 121);
        assert_true(tour.fov_degrees == 60);
        for (uint32_t k = 0; k < tour.frame_count; k++) {
            assert_true(tour.frames[k].t == k / 60.0);
            assert_near_v3(tour.frames[k].eye, hw_v3(200 + 0.5f * (float)k, 200, 12), 1e-3f);
            assert_near_v3(tour.frames[k].forward, hw_v3(1, 0, 0), 1e-6f);
        }
        hw_tour_free(&tour);
        hw_walker_free(&w);
    }
}

static void walk_a_little(hw_walker *w)
{
    hold(w, (hw_key[]){HW_KEY_FORWARD, HW_KEY_TURN_LEFT}, 2, 1, STEP);
    hold(w, (hw_key[]){HW_KEY_UP, HW_KEY_RUN}, 2, 0.2, STEP);
    hw_input look = {.mouse_dx = 30, .mouse_dy = 20};
    for (int i = 0; i < 10; i++)
        assert_int_equal(hw_walker_update(w, &look, STEP), HW_OK);
}

static void test_recorded_tour_reads_back(void **state)
{
    (void)state;
    char path[] = "/tmp/hexwalk_tour_XXXXXX";
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    close(fd);
    hw_walker w = test_walker();
    assert_int_equal(hw_walker_record(&w), HW_OK);
    walk_a_little(&w);
    hw_tour_frame last = hw_walker_view(&w);
    hw_tour tour, read;
    hw_walker_take_recorded(&w, &tour);
    assert_int_equal(hw_tour_write(path, &tour), HW_OK);
    assert_int_equal(hw_tour_read(path, &read), HW_OK);
    assert_int_equal(read.frame_count, tour.frame_count);
    assert_int_equal(read.frame_count, 1 + 60 + 12 + 10);
    hw_input input = {0};
    hw_walker_play(&w, &read);
    w.loops = false;
    for (uint32_t i = 0; i < read.frame_count; i++) {
        assert_near_v3(hw_walker_view(&w).eye, tour.frames[i].eye, 1e-3f);
        assert_near_v3(hw_walker_view(&w).forward, tour.frames[i].forward, 1e-4f);
        assert_int_equal(hw_walker_update(&w, &input, STEP), HW_OK);
    }
    assert_near_v3(hw_walker_view(&w).eye, last.eye, 1e-3f);
    assert_near_v3(hw_walker_view(&w).forward, last.forward, 1e-4f);
    unlink(path);
    hw_tour_free(&tour);
    hw_tour_free(&read);
    hw_walker_free(&w);
}

static void test_recording_again_starts_anew(void **state)
{
    (void)state;
    hw_walker w = test_walker();
    assert_int_equal(hw_walker_record(&w), HW_OK);
    hold_one(&w, HW_KEY_FORWARD, 1);
    assert_int_equal(w.recorded.frame_count, 61);
    assert_int_equal(hw_walker_record(&w), HW_OK);
    assert_int_equal(w.recorded.frame_count, 1);
    assert_near_v3(w.recorded.frames[0].eye, hw_v3(230, 200, 12), 1e-3f);
    hw_walker_free(&w);
    hw_walker_free(&w);
    hw_walker_free(NULL);
}

// Memory that runs out is an error that loses nothing.
static void test_recording_without_memory(void **state)
{
    (void)state;
    hw_walker w = test_walker();
    hw_alloc_fail_after(1);
    assert_int_equal(hw_walker_record(&w), HW_MEMORY);
    hw_alloc_fail_after(0);
    assert_false(w.recording);
    assert_int_equal(hw_walker_record(&w), HW_OK);
    hw_input input = {0};
    // Beyond ten minutes the store has to grow.
    hw_status status = HW_OK;
    hw_alloc_fail_after(1);
    for (int i = 0; i < 60 * 60 * 11 && status == HW_OK; i++)
        status = hw_walker_update(&w, &input, STEP);
    hw_alloc_fail_after(0);
    assert_int_equal(status, HW_MEMORY);
    assert_true(w.recorded.frame_count >= 60 * 600);
    assert_int_equal(hw_walker_update(&w, &input, STEP), HW_OK);
    hw_walker_free(&w);
}

// ---- Obstacles

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
    hw_mesh_level_info infos[2] = {{8, 36, 0, 0, 0}, {8, 36, error, error, error}};
    char *path = NULL;
    for (int i = 0; i < 2; i++) {
        assert_int_equal(hw_strdup(&levels[i].name, "box"), HW_OK);
        assert_int_equal(hw_mesh_compute_normals(&levels[i]), HW_OK);
    }
    assert_int_equal(hw_mesh_path(&path, folder, mesh_idx), HW_OK);
    assert_int_equal(hw_mesh_file_write(path, 1, levels, infos, 2), HW_OK);
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

// Sticks add to the keys, up to full speed.
static void test_sticks(void **state)
{
    (void)state;
    hw_walker w = test_walker();
    const hw_input half = {.ahead = 0.5};
    assert_int_equal(hw_walker_update(&w, &half, 0.2), HW_OK);
    assert_at(&w, 203, 200, 12, 1e-9);
    const hw_input full = {.ahead = 1, .down = {[HW_KEY_FORWARD] = true}};
    assert_int_equal(hw_walker_update(&w, &full, 0.2), HW_OK);
    assert_at(&w, 209, 200, 12, 1e-9);
    const hw_input turn = {.turn = -1, .pitch = 0.5};
    assert_int_equal(hw_walker_update(&w, &turn, 0.1), HW_OK);
    assert_true(fabs(w.heading_rad - HW_WALKER_TURN_RAD / 10) < 1e-12);
    assert_true(fabs(w.pitch_rad - HW_WALKER_TURN_RAD / 20) < 1e-12);
    hold_one(&w, HW_KEY_LOOK_DOWN, 3);
    assert_true(fabs(w.pitch_rad + HW_WALKER_PITCH_RAD) < 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_direction),
        cmocka_unit_test(test_running),
        cmocka_unit_test(test_diagonal_is_not_faster),
        cmocka_unit_test(test_curve),
        cmocka_unit_test(test_frame_rate_does_not_matter),
        cmocka_unit_test(test_stalled_frame_does_not_fling),
        cmocka_unit_test(test_turning),
        cmocka_unit_test(test_mouse_and_pitch_limit),
        cmocka_unit_test(test_place_looks_along),
        cmocka_unit_test(test_camera),
        cmocka_unit_test(test_heights),
        cmocka_unit_test(test_never_leaves_the_grid),
        cmocka_unit_test(test_slides_along_the_border),
        cmocka_unit_test(test_far_places_come_inside),
        cmocka_unit_test(test_one_cell_grid),
        cmocka_unit_test(test_default_place_is_clear),
        cmocka_unit_test(test_default_place_without_objects),
        cmocka_unit_test(test_default_place_where_nothing_is_clear),
        cmocka_unit_test(test_playback_hits_the_frames),
        cmocka_unit_test(test_tour_at_odd_frames),
        cmocka_unit_test(test_closed_tour_goes_round),
        cmocka_unit_test(test_motion_leaves_the_tour),
        cmocka_unit_test(test_toggle_without_tour),
        cmocka_unit_test(test_recording_has_fixed_steps),
        cmocka_unit_test(test_recorded_tour_reads_back),
        cmocka_unit_test(test_recording_again_starts_anew),
        cmocka_unit_test(test_recording_without_memory),
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
        cmocka_unit_test(test_sticks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
