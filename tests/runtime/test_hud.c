// The HUD: its line as text, and its pixels off screen.
#include "context.h"
#include "hud.h"
#include "minimap.h"
#include "target.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#define WIDTH  800u
#define HEIGHT 608u

static const hw_hud_info sample = {.config = "C hybrid",
                                   .fps = 59.7,
                                   .frame_ms = 16.78,
                                   .p99_ms = 18.04,
                                   .cell_q = 3,
                                   .cell_r = -2,
                                   .triangles = 1234567,
                                   .draws = 12,
                                   .ram_bytes = 91200000,
                                   .gpu_bytes = 182300000,
                                   .queue = -1,
                                   .recorded_s = -1};

static void test_format(void **state)
{
    (void)state;
    char text[512];
    hw_hud_info info = sample;
    size_t length = hw_hud_format(&info, text, sizeof text);
    assert_string_equal(text, "C hybrid   60 fps   16.8 ms (p99 18.0)   cell 3,-2   "
                              "1,234,567 triangles, 12 draws   RAM 91.2 MB   GPU 182.3 MB   "
                              "0.0 MB/s   0 stalls, 0 late");
    assert_int_equal(length, strlen(text));
    info.fps = 0; // not measured yet
    info.triangles = 0;
    info.waiting_bytes = 1900000;
    info.waiting_budget_bytes = 10000000;
    info.late = 12;
    info.gpu_budget_bytes = 96000000;
    info.queue = 7;
    info.loaded_bytes_s = 2.5e6;
    info.stalls = 3;
    info.recorded_s = 1.25;
    info.views = "wireframe";
    hw_hud_format(&info, text, sizeof text);
    assert_string_equal(text, "C hybrid   cell 3,-2   0 triangles, 12 draws   "
                              "RAM 91.2 MB   waiting 1.9 of 10 MB   GPU 182.3 of 96 MB   queue 7   "
                              "2.5 MB/s   3 stalls, 12 late   REC 1.2 s   [wireframe]");
    info.hidden = 7;
    hw_hud_format(&info, text, sizeof text);
    assert_non_null(strstr(text, " 12 draws, 7 hidden   "));
    info.triangles = 100;
    hw_hud_format(&info, text, sizeof text);
    assert_non_null(strstr(text, " 100 triangles"));
    info.triangles = UINT64_MAX;
    hw_hud_format(&info, text, sizeof text);
    assert_non_null(strstr(text, " 18,446,744,073,709,551,615 triangles"));
}

static void test_format_is_cut(void **state)
{
    (void)state;
    char whole[512], text[512];
    size_t length = hw_hud_format(&sample, whole, sizeof whole);
    for (size_t capacity = 1; capacity < length + 4; capacity++) {
        memset(text, 'x', sizeof text);
        size_t n = hw_hud_format(&sample, text, capacity);
        assert_int_equal(n, capacity - 1 < length ? capacity - 1 : length);
        assert_int_equal(text[n], '\0');
        assert_memory_equal(text, whole, n);
        assert_int_equal(text[capacity], 'x');
    }
}

// ---- Pixels

typedef struct fixture {
    hw_context *context;
    hw_target *target;
    hw_hud *hud;
    hw_image image;
} fixture;

static void draw(fixture *f, const hw_hud_content *content)
{
    hw_target_bind(f->target);
    hw_hud_blank(f->hud);
    hw_hud_draw(f->hud, WIDTH, HEIGHT, content);
    assert_int_equal(hw_target_read(f->target, &f->image), HW_OK);
}

// Pixels of a band of rows that are as bright as text.
static uint32_t bright(const fixture *f, uint32_t y0, uint32_t y1)
{
    uint32_t count = 0;
    for (size_t i = (size_t)y0 * WIDTH; i < (size_t)y1 * WIDTH; i++)
        count += f->image.data[4 * i] > 200;
    return count;
}

static void test_nothing(void **state)
{
    fixture *f = *state;
    draw(f, &(hw_hud_content){0});
    const uint8_t *first = f->image.data;
    assert_true(first[0] < 100);
    for (size_t i = 0; i < (size_t)WIDTH * HEIGHT; i++)
        assert_memory_equal(f->image.data + 4 * i, first, 4);
}

static void test_places(void **state)
{
    fixture *f = *state;
    draw(f, &(hw_hud_content){.line = "IIII"});
    // The font at twice its size: strokes 2 wide and 14 high.
    assert_true(bright(f, 0, 32) >= 4 * 2 * 14);
    assert_int_equal(bright(f, 32, HEIGHT), 0);
    // The panel behind it is darker than the background, and no wider than the text.
    const uint8_t *panel = f->image.data, *beyond = f->image.data + (size_t)4 * 400;
    assert_true(panel[0] < beyond[0]);
    draw(f, &(hw_hud_content){.message = "saved"});
    assert_int_equal(bright(f, 0, HEIGHT - 32), 0);
    assert_true(bright(f, HEIGHT - 32, HEIGHT) > 100);
    draw(f, &(hw_hud_content){.help = true});
    assert_true(bright(f, 100, HEIGHT - 100) > 3000);
    assert_int_equal(bright(f, 0, 60) + bright(f, HEIGHT - 60, HEIGHT), 0);
}

// Twice the text has twice the pixels; what is too long for a row goes on below, for some rows.
static void test_text_is_wrapped(void **state)
{
    fixture *f = *state;
    char text[4000];
    memset(text, 'H', sizeof text - 1);
    text[sizeof text - 1] = '\0';
    draw(f, &(hw_hud_content){.line = "HHHH"});
    uint32_t one = bright(f, 0, 32) / 4;
    draw(f, &(hw_hud_content){.line = "HHHHHHHH"});
    assert_int_equal(bright(f, 0, HEIGHT), 8 * one);
    draw(f, &(hw_hud_content){.line = text, .message = text});
    uint32_t row = bright(f, 0, 32);
    assert_true(row % one == 0 && row > 8 * one && row < 100 * one);
    assert_int_equal(bright(f, 32, 56), row);
    assert_int_equal(bright(f, 0, HEIGHT / 2), 6 * row);
    assert_int_equal(bright(f, HEIGHT / 2, HEIGHT), 6 * row);
    for (size_t y = 0; y < 160; y++) // no half letter at the edge
        assert_true(f->image.data[4 * (y * WIDTH + WIDTH - 2)] < 200);
    // Words stay whole: a space in the middle of the row sends what follows to the next one.
    uint32_t letters = row / one;
    text[letters / 2] = ' ';
    text[letters + 1] = '\0';
    draw(f, &(hw_hud_content){.line = text});
    assert_int_equal(bright(f, 0, 32), letters / 2 * one);
    assert_int_equal(bright(f, 32, HEIGHT), (letters - letters / 2) * one);
}

static void test_odd_characters(void **state)
{
    fixture *f = *state;
    draw(f, &(hw_hud_content){.line = "????"});
    uint32_t questions = bright(f, 0, 32);
    draw(f, &(hw_hud_content){.line = "\xc3\xa4\n\x7f"});
    assert_int_equal(bright(f, 0, 32), questions);
    draw(f, &(hw_hud_content){.line = ""});
    assert_int_equal(bright(f, 0, HEIGHT), 0);
}

// Alpha tells objects from sky: text does not change it.
static void test_alpha_is_kept(void **state)
{
    fixture *f = *state;
    draw(f, &(hw_hud_content){.line = "HHHH", .help = true});
    for (size_t i = 0; i < (size_t)WIDTH * HEIGHT; i++)
        assert_int_equal(f->image.data[4 * i + 3], 0);
}

// Pixels of exactly this colour.
static uint32_t colored(const fixture *f, uint8_t r, uint8_t g, uint8_t b)
{
    uint32_t count = 0;
    for (size_t i = 0; i < (size_t)WIDTH * HEIGHT; i++) {
        const uint8_t *p = f->image.data + 4 * i;
        count += p[0] == r && p[1] == g && p[2] == b;
    }
    return count;
}

static void test_legend(void **state)
{
    fixture *f = *state;
    const hw_hud_legend_row rows[2] = {{{1, 0, 0}, "red"}, {{0, 0, 1}, "blue"}};
    draw(f, &(hw_hud_content){.legend = rows, .legend_count = 2});
    assert_int_equal(colored(f, 255, 0, 0), 16 * 16);
    assert_int_equal(colored(f, 0, 0, 255), 16 * 16);
    assert_int_equal(bright(f, 0, HEIGHT - 60), 0);
    assert_true(bright(f, HEIGHT - 60, HEIGHT) > 16 * 16 + 50);
}

// Every window, however small, gets its help, and nothing overflows.
static void test_small_windows(void **state)
{
    fixture *f = *state;
    char text[2000];
    memset(text, 'W', sizeof text - 1);
    text[sizeof text - 1] = '\0';
    const uint32_t sizes[][2] = {{160, 160}, {320, 240}, {640, 480}, {799, 599}};
    for (int i = 0; i < 4; i++) {
        hw_target_bind(f->target);
        hw_hud_blank(f->hud);
        hw_hud_draw(f->hud, sizes[i][0], sizes[i][1],
                    &(hw_hud_content){.help = true, .line = text, .message = text});
        assert_int_equal(hw_target_read(f->target, &f->image), HW_OK);
        assert_true(bright(f, 0, HEIGHT) > 1000);
    }
}

// ---- The map

// A viewer in the middle of a grid, looking north.
static void draw_map(fixture *f, const hw_hexgrid *grid, const hw_camera *camera,
                     const hw_camera *frozen, const hw_box *box)
{
    hw_minimap map = {
        .grid = grid, .boxes = box, .box_count = box ? 1 : 0, .camera = camera, .frozen = frozen};
    draw(f, &(hw_hud_content){.map = &map});
}

static void test_map(void **state)
{
    fixture *f = *state;
    hw_hexgrid grid = hw_hexgrid_cover(0, 0, 1000, 1000, 50, 0, 40);
    const hw_camera camera = {.eye = {500, 500, 12},
                              .forward = {0, 1, 0},
                              .up = {0, 0, 1},
                              .fov_degrees = 60,
                              .width = 100,
                              .height = 100};
    draw_map(f, &grid, &camera, NULL, NULL);
    const uint32_t side = 243; // 0.4 of 608
    const uint8_t *data = f->image.data;
    // Outside its square nothing changes.
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++)
            if (y > side || x + side + 1 < WIDTH)
                assert_memory_equal(data + 4 * ((size_t)y * WIDTH + x), data + 4 * 5000, 4);
    // The viewer is white, in the middle; its wedge opens upwards: brighter there than below.
    const size_t cx = WIDTH - side / 2 - 1, cy = side / 2;
    assert_true(data[4 * (cy * WIDTH + cx)] > 250);
    uint32_t above = 0, below = 0;
    for (size_t d = 10; d < 50; d++) {
        above += data[4 * ((cy - d) * WIDTH + cx)];
        below += data[4 * ((cy + d) * WIDTH + cx)];
    }
    assert_true(above > below + 40 * 30);
    // An object to the east is drawn to the right.
    const hw_box box = {{600, 480, 0}, {640, 520, 20}};
    draw_map(f, &grid, &camera, NULL, &box);
    const double scale = side / (9.0 * 1.75 * 50);
    const uint8_t *object = data + 4 * (cy * WIDTH + cx + (size_t)(120 * scale));
    assert_true(object[0] > 110 && object[0] == object[1]);
    // Groups of higher levels have borders of their own colour.
    uint32_t amber = colored(f, 255, 214, 130);
    grid.levels = 3;
    draw_map(f, &grid, &camera, NULL, NULL);
    assert_int_equal(amber, 0);
    uint32_t warm = 0;
    for (size_t i = 0; i < (size_t)WIDTH * HEIGHT; i++)
        warm += data[4 * i] > 180 && data[4 * i + 2] < 150;
    assert_true(warm > 300);
}

// From anywhere, also beyond the grid, and with odd cameras.
static void test_map_at_odd_places(void **state)
{
    fixture *f = *state;
    hw_hexgrid grid = hw_hexgrid_cover(0, 0, 100, 100, 50, 0, 40);
    const hw_vec3 eyes[] = {{0, 0, 0}, {-1e6f, 1e6f, 0}, {99, 1, 1}};
    for (int i = 0; i < 3; i++) {
        const hw_camera camera = {.eye = eyes[i],
                                  .forward = {0, 0, i == 1 ? -1.0f : 1.0f},
                                  .up = {0, 1, 0},
                                  .fov_degrees = i == 2 ? 170.0f : 1.0f,
                                  .width = i == 2 ? 16384 : 1,
                                  .height = 160};
        draw_map(f, &grid, &camera, &camera, NULL);
        assert_true(bright(f, 0, HEIGHT) > 4);
    }
}

static int set_up(void **state)
{
    static fixture f;
    hw_context_desc desc = {.kind = HW_CONTEXT_OFFSCREEN, .width = 16, .height = 16};
    if (hw_context_create(&desc, &f.context) != HW_OK ||
        hw_target_create(&f.target, WIDTH, HEIGHT, 1) != HW_OK || hw_hud_create(&f.hud) != HW_OK)
        return -1;
    *state = &f;
    return 0;
}

static int tear_down(void **state)
{
    fixture *f = *state;
    hw_image_free(&f->image);
    hw_hud_destroy(f->hud);
    hw_hud_destroy(NULL);
    hw_target_destroy(f->target);
    hw_context_destroy(f->context);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_format),
        cmocka_unit_test(test_format_is_cut),
        cmocka_unit_test(test_nothing),
        cmocka_unit_test(test_places),
        cmocka_unit_test(test_text_is_wrapped),
        cmocka_unit_test(test_odd_characters),
        cmocka_unit_test(test_alpha_is_kept),
        cmocka_unit_test(test_legend),
        cmocka_unit_test(test_small_windows),
        cmocka_unit_test(test_map),
        cmocka_unit_test(test_map_at_odd_places),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
