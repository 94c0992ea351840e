// The walker: motion, bounds, tours and recordings, all without a window.
#include "walkers.h"

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

// ---- Gamepads

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
        cmocka_unit_test(test_sticks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
