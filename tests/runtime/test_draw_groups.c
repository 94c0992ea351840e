// Cells of two levels: what a group has and what its cells have are one picture, the same as that
// of cells of one level, at rest, where cells dissolve into each other, and while data are late.
#include "crossing.h"
#include "stream_walks.h"

typedef struct fixtures {
    fixture one, two;
} fixtures;

static int open_fixtures(void **state)
{
    static fixtures f;
    *state = &f;
    f.two.dataset.levels = 2;
    assert_int_equal(model_context_open((void **)&f.one.context), 0);
    return open_dataset(&f.one) | open_dataset(&f.two);
}

static int close_fixtures(void **state)
{
    fixtures *f = *state;
    int status = close_dataset(&f->one) | close_dataset(&f->two);
    hw_context_destroy(f->one.context);
    return status;
}

// Both kinds of cells have walls, each three of the six.
static void test_split(void **state)
{
    const fixtures *f = *state;
    const hw_manifest *m = &f->two.dataset.manifest;
    uint32_t groups = 0;
    for (uint32_t i = 0; i < m->cell_count; i++) {
        hw_cell cell;
        char *path = NULL;
        assert_ok(hw_cell_path(&path, f->two.dataset.folder, m->cells[i].id));
        assert_ok(hw_cell_read(path, &cell));
        assert_int_equal(cell.far_count, 3);
        assert_int_equal(cell.near_count > 0, cell.id.level == 0);
        groups += cell.id.level == 1;
        hw_cell_free(&cell);
        hw_free(path);
    }
    assert_in_range(groups, 7, hw_hexgrid_cell_count(&m->grid) / 3);
}

// But for the seams between walls, of which one is no wider than a pixel and two are in view.
static void assert_same(const hw_image *a, const hw_image *b, double t)
{
    uint32_t different = 0;
    for (uint32_t i = 0; i < SIZE * SIZE; i++) {
        bool same = true;
        for (uint32_t k = 4 * i; k < 4 * i + 4; k++)
            same = same && abs(a->data[k] - b->data[k]) <= 3;
        different += !same;
    }
    if (different > 2 * SIZE)
        fail_msg("at %g seconds %u pixels are others", t, different);
}

// How many frames show cells of one group, and of several.
typedef struct seen {
    uint32_t alone, one_group, more_groups;
} seen;

static void see(const hw_hexgrid *grid, hw_vec3 eye, double width, seen *out)
{
    hw_cell_id id = hw_hexgrid_locate(grid, (double)eye.x, (double)eye.y);
    hw_crossing c = hw_crossing_at(grid, id, eye, width);
    bool same = true;
    for (uint32_t i = 1; i < c.count; i++)
        same = same && hw_cell_compare(hw_cell_parent(c.cells[0]), hw_cell_parent(c.cells[i])) == 0;
    out->alone += c.count == 1;
    out->one_group += c.count > 1 && same;
    out->more_groups += c.count > 1 && !same;
}

// With loading that waits.
static seen compare_walks(const fixtures *f, double width)
{
    const hw_streaming streaming = {.loading = HW_LOADING_WAITS};
    hw_renderer *one = open_crossing(f->one.dataset.folder, &streaming, width);
    hw_renderer *two = open_crossing(f->two.dataset.folder, &streaming, width);
    hw_image wanted = {0}, got = {0};
    seen sum = {0};
    for (double t = 0; t < 10; t += FRAME) {
        hw_camera camera = walk_camera(t);
        see(&f->two.dataset.manifest.grid, camera.eye, width, &sum);
        hw_frame_stats a = draw(&f->one, one, &camera);
        assert_ok(hw_target_read(f->one.target, &wanted));
        hw_frame_stats b = draw(&f->two, two, &camera);
        assert_ok(hw_target_read(f->two.target, &got));
        assert_same(&wanted, &got, t);
        assert_int_equal(b.near_triangles, a.near_triangles);
        assert_true(width > 0 || (a.far_triangles == 12 && b.far_triangles == 12));
        // What dissolves is drawn twice, except walls that both cells have from one group.
        assert_in_range(b.far_triangles, 12, a.far_triangles);
    }
    hw_image_free(&wanted);
    hw_image_free(&got);
    hw_renderer_destroy(one);
    hw_renderer_destroy(two);
    return sum;
}

static void test_waits(void **state)
{
    seen sum = compare_walks(*state, 0);
    assert_true(sum.alone > 290);
}

static void test_crossings(void **state)
{
    seen sum = compare_walks(*state, HW_CROSSING_WIDTH);
    assert_true(sum.alone > 20 && sum.one_group > 20 && sum.more_groups > 20);
}

// A walk with too little bandwidth: frames are whole (see draw), though some lack what they want.
static void test_late_data(void **state)
{
    const fixtures *f = *state;
    const hw_streaming streaming = {.loading = HW_LOADING_SIMULATED, .bytes_per_second = 25000};
    for (int soft = 0; soft < 2; soft++) {
        hw_renderer *renderer =
            open_crossing(f->two.dataset.folder, &streaming, soft * HW_CROSSING_WIDTH);
        walked sum = walk(&f->two, renderer, 10);
        assert_true(sum.late > 10 && sum.late < sum.frames);
        assert_int_equal(rest(&f->two, renderer, 10, 600).stream.missing, 0);
        hw_renderer_destroy(renderer);
    }
}

// With enough of it nothing is.
static void test_nothing_missing(void **state)
{
    const fixtures *f = *state;
    const hw_streaming streaming = {.loading = HW_LOADING_SIMULATED};
    for (int soft = 0; soft < 2; soft++) {
        hw_renderer *renderer =
            open_crossing(f->two.dataset.folder, &streaming, soft * HW_CROSSING_WIDTH);
        walked sum = walk(&f->two, renderer, 10);
        assert_int_equal(sum.missing, 0);
        assert_int_equal(sum.late, 0);
        hw_renderer_destroy(renderer);
    }
}

// A cell whose group is not there is as late as one that is not there itself.
static void test_closest(void **state)
{
    (void)state;
    fixture f = {.dataset = {.levels = 2, .colored = true}};
    assert_int_equal(open_dataset(&f), 0);
    const hw_hexgrid *grid = &f.dataset.manifest.grid;
    hw_cell_id home = hw_hexgrid_locate(grid, 0, 0), around[6], lost = home;
    hw_cell_neighbours(home, around);
    uint32_t others = 0;
    for (int i = 0; i < 6; i++) {
        hw_cell_id parent = hw_cell_parent(around[i]);
        bool is_other = hw_cell_compare(parent, hw_cell_parent(home)) != 0;
        if (is_other)
            lost = parent;
        others += is_other;
    }
    assert_true(others > 0);
    check_closest(&f, &lost);
    assert_int_equal(close_dataset(&f), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_split),           cmocka_unit_test(test_waits),
        cmocka_unit_test(test_crossings),       cmocka_unit_test(test_late_data),
        cmocka_unit_test(test_nothing_missing), cmocka_unit_test(test_closest),
    };
    return cmocka_run_group_tests_name("draw_groups", tests, open_fixtures, close_fixtures);
}
