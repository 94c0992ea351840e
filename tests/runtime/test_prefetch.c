// Streaming: what is fetched when, within which budgets, and what is drawn while data are late.
#include "stream_walks.h"

#include "../cells/web.h"
#include "prefetch.h"

#include <sys/stat.h>

static int open_fixture(void **state)
{
    static fixture f;
    *state = &f;
    assert_int_equal(model_context_open((void **)&f.context), 0);
    return open_dataset(&f);
}

static int close_fixture(void **state)
{
    fixture *f = *state;
    int status = close_dataset(f);
    hw_context_destroy(f->context);
    return status;
}

// ---- priorities ----

static hw_prefetch_view view(hw_vec3 aim, hw_vec3 motion)
{
    return (hw_prefetch_view){{0, 0, 0}, aim, motion, 30, 0.5};
}

static void test_priorities(void **state)
{
    (void)state;
    hw_prefetch_view v = view(hw_v3(1, 0, 0), hw_v3(0, 1, 0));
    double ahead = hw_prefetch_priority(&v, hw_v3(0, 86, 0), 40, 50);
    double aimed = hw_prefetch_priority(&v, hw_v3(86, 0, 0), 40, 50);
    double behind = hw_prefetch_priority(&v, hw_v3(0, -86, 0), 40, 50);
    double close = hw_prefetch_priority(&v, hw_v3(0, -86, 0), 1, 50);
    double farther = hw_prefetch_priority(&v, hw_v3(0, 172, 0), 120, 50);
    assert_true(ahead > behind && aimed > behind && close > behind && ahead > farther);
    // Within the frustum it is worth more than the angle alone; standing, the aim alone counts.
    double inside = hw_prefetch_priority(&v, hw_v3(80, 40, 0), 40, 50);
    double outside = hw_prefetch_priority(&v, hw_v3(80, 48, 0), 40, 50);
    assert_true(inside > outside + 0.05);
    hw_prefetch_view standing = view(hw_v3(1, 0, 0), hw_v3(0, 0, 0));
    assert_true(hw_prefetch_priority(&standing, hw_v3(86, 0, 0), 40, 50) >
                hw_prefetch_priority(&standing, hw_v3(0, 86, 0), 40, 50));
    for (int i = 0; i < 360; i++) {
        hw_vec3 to = hw_v3((float)(100 * cos(i)), (float)(100 * sin(i)), 0);
        double p = hw_prefetch_priority(&v, to, i, 50);
        assert_true(p >= 0 && p < 0.95);
    }
}

static void test_entries(void **state)
{
    const fixture *f = *state;
    const hw_hexgrid *grid = &f->dataset.manifest.grid;
    hw_cell_id home = hw_hexgrid_locate(grid, 0, 0), around[6];
    hw_vec3 c = hw_cell_centre(grid, home), from = hw_v3(c.x + 3, c.y + 2, 1);
    hw_vec3 in = hw_prefetch_entry(grid, home, from);
    assert_true(in.x == from.x && in.y == from.y && in.z == from.z);
    hw_cell_neighbours(home, around);
    for (int i = 0; i < 6; i++) {
        hw_vec3 e = hw_prefetch_entry(grid, around[i], hw_v3(c.x, c.y, 1)), axis, right, up;
        hw_face_basis(i, &axis, &right, &up);
        // The middle of the face between the two.
        float inner = (float)(50 * sqrt(3) / 2);
        assert_true(fabsf(e.x - c.x - axis.x * inner) < 0.01f);
        assert_true(fabsf(e.y - c.y - axis.y * inner) < 0.01f);
        assert_true(e.z == 1);
    }
}

// On the viewer's way a cell is close, even one of which only a corner lies there.
static void test_distances(void **state)
{
    const fixture *f = *state;
    const hw_hexgrid *grid = &f->dataset.manifest.grid;
    hw_cell_id home = hw_hexgrid_locate(grid, 0, 0), around[6];
    hw_vec3 c = hw_cell_centre(grid, home), axis, right, up;
    hw_cell_neighbours(home, around);
    hw_face_basis(1, &axis, &right, &up);
    hw_prefetch_view v = view(axis, axis);
    v.eye = c;
    double inner = 50 * sqrt(3) / 2, ahead = hw_prefetch_distance(&v, grid, around[1]);
    assert_true(hw_prefetch_distance(&v, grid, home) == 0);
    assert_true(ahead < inner && ahead > inner / 3);
    assert_true(fabs(hw_prefetch_distance(&v, grid, around[4]) - inner) < 0.01); // behind
    for (int i = 0; i < 6; i++)
        assert_true(i == 1 || hw_prefetch_distance(&v, grid, around[i]) > ahead);
    // Towards a corner of the home cell: both that meet there are close.
    v.motion = hw_v3_normalize(hw_v3_add(axis, hw_v3_scale(right, (float)tan(HW_PI / 6.05))));
    int other = hw_v3_dot(hw_v3_sub(hw_cell_centre(grid, around[0]), c), right) > 0 ? 0 : 2;
    assert_true(hw_prefetch_distance(&v, grid, around[1]) < 32);
    assert_true(hw_prefetch_distance(&v, grid, around[other]) < 32);
    v.motion = hw_v3(0, 0, 0);
    v.speed = 0;
    assert_true(fabs(hw_prefetch_distance(&v, grid, around[1]) - inner) < 0.01);
}

// ---- walks by simulated time ----

static void test_nothing_missing(void **state)
{
    fixture *f = *state;
    const hw_streaming streaming = {.loading = HW_LOADING_SIMULATED};
    hw_renderer *renderer = open_renderer(f->dataset.folder, &streaming);
    walked sum = walk(f, renderer, 10);
    assert_int_equal(sum.missing, 0);
    assert_int_equal(sum.late, 0);
    assert_true(sum.frames >= 300);
    assert_true(sum.upload_peak <= UINT64_C(1) << 19);
    hw_renderer_destroy(renderer);
}

// The same walk, starved: every frame is whole, some with other data than wanted; a rest lets the
// data catch up.
static void test_late_data(void **state)
{
    fixture *f = *state;
    const hw_streaming streaming = {.loading = HW_LOADING_SIMULATED, .bytes_per_second = 15000};
    hw_renderer *renderer = open_renderer(f->dataset.folder, &streaming);
    walked sum = walk(f, renderer, 10);
    assert_true(sum.late > 10);
    assert_true(sum.late < sum.frames);
    assert_int_equal(rest(f, renderer, 10, 600).stream.missing, 0);
    hw_renderer_destroy(renderer);
}

// Late frames show the closest complete cell.
static void test_closest(void **state)
{
    (void)state;
    fixture f = {.dataset = {.colored = true}};
    assert_int_equal(open_dataset(&f), 0);
    check_closest(&f, NULL);
    assert_int_equal(close_dataset(&f), 0);
}

// Frames are the same whether data were waited for or prefetched.
static void test_same_frames(void **state)
{
    fixture *f = *state;
    const hw_streaming waits = {.loading = HW_LOADING_WAITS};
    const hw_streaming ahead = {.loading = HW_LOADING_SIMULATED};
    hw_renderer *a = open_renderer(f->dataset.folder, &waits);
    hw_renderer *b = open_renderer(f->dataset.folder, &ahead);
    hw_image first = {0}, second = {0};
    for (double t = 0; t < 6; t += FRAME) {
        hw_camera camera = walk_camera(t);
        draw(f, a, &camera);
        assert_ok(hw_target_read(f->target, &first));
        hw_frame_stats stats = draw(f, b, &camera);
        assert_ok(hw_target_read(f->target, &second));
        assert_int_equal(t > 0 && stats.stream.missing > 0, 0);
        // Blocks are filtered by the GL or decoded before: the last bit may differ.
        for (uint32_t i = 0; t > 0 && i < SIZE * SIZE * 4; i++)
            assert_in_range(first.data[i] + 2 - second.data[i], 0, 4);
        hw_renderer_advance(b, FRAME);
    }
    hw_image_free(&first);
    hw_image_free(&second);
    hw_renderer_destroy(a);
    hw_renderer_destroy(b);
}

// Budgets hold at every frame, down to what two cells take.
static void test_budgets(void **state)
{
    fixture *f = *state;
    const uint64_t cell = STREAM_ATLAS * STREAM_ATLAS * 4, ball = 64 * 32 * (24 + 12);
    for (uint64_t cells = 2; cells <= 8; cells *= 2) {
        const hw_streaming streaming = {.loading = HW_LOADING_SIMULATED,
                                        .gpu_budget = cells * cell + 3 * ball,
                                        .ram_budget = cell * cells / 4};
        hw_renderer *renderer = open_renderer(f->dataset.folder, &streaming);
        walked sum = walk(f, renderer, 10);
        assert_true(sum.gpu_peak <= streaming.gpu_budget);
        assert_true(sum.gpu_peak > streaming.gpu_budget / 3);
        assert_true(sum.ram_peak <= streaming.ram_budget);
        assert_true(sum.ram_peak > streaming.ram_budget / 3);
        assert_true(cells == 2 || sum.missing == 0);
        hw_renderer_destroy(renderer);
    }
}

// The first frame wishes for finer levels of what is near than there is room for beside the cell:
// that is not pushed out for them.
static void test_first_frame_is_tight(void **state)
{
    fixture *f = *state;
    const uint64_t cell = STREAM_ATLAS * STREAM_ATLAS * 4, ball = 64 * 32 * (24 + 12);
    const hw_hexgrid *grid = &f->dataset.manifest.grid;
    hw_vec3 centre = hw_cell_centre(grid, hw_hexgrid_locate(grid, 0, 0));
    hw_camera camera =
        model_camera(hw_v3_add(centre, hw_v3(12.5f, 12.5f, 0)), hw_v3(0.7f, 0.7f, 0), SIZE);
    for (uint64_t bytes = cell / 8; bytes <= 2 * cell; bytes += ball / 8) {
        const hw_streaming streaming = {
            .loading = HW_LOADING_SIMULATED, .gpu_budget = bytes, .bytes_per_second = 1000000};
        hw_renderer *renderer = open_renderer(f->dataset.folder, &streaming);
        hw_frame_stats stats = draw(f, renderer, &camera);
        assert_true(stats.near_triangles > 0);
        hw_renderer_destroy(renderer);
    }
}

// Without a budget of the user's, a frame's cells of every level have a share of the same size.
static void test_default_budget(void **state)
{
    fixture *f = *state;
    hw_manifest manifest = f->dataset.manifest;
    hw_gpu_account account = {0};
    for (int32_t levels = 1; levels <= 3; levels++) {
        manifest.grid.levels = levels;
        hw_store_desc desc = {.location = f->dataset.folder,
                              .manifest = &manifest,
                              .account = &account,
                              .mode = HW_LOADER_SIMULATED};
        for (uint64_t chosen = 0; chosen <= 1000000; chosen += 1000000) {
            desc.gpu_budget = chosen;
            hw_store *store = NULL;
            assert_ok(hw_store_create(&desc, &store));
            assert_int_equal(hw_store_gpu_budget(store),
                             chosen ? chosen : (uint64_t)levels * HW_STORE_GPU_BUDGET);
            hw_store_destroy(store);
        }
    }
}

// Where cells dissolve into each other all of them are there, with what is near in them, under a
// budget that holds hardly more than the three that a frame may show.
static void test_crossings(void **state)
{
    fixture *f = *state;
    const uint64_t cell = STREAM_ATLAS * STREAM_ATLAS + 1000, balls = 110000;
    const hw_streaming streaming = {
        .loading = HW_LOADING_SIMULATED, .gpu_budget = 4 * cell + balls, .ram_budget = 2 * cell};
    hw_renderer *renderer = open_crossing(f->dataset.folder, &streaming, HW_CROSSING_WIDTH);
    walked sum = walk(f, renderer, 10);
    assert_int_equal(sum.missing, 0);
    assert_true(sum.gpu_peak <= streaming.gpu_budget && sum.gpu_peak > 3 * cell);
    assert_true(sum.ram_peak <= streaming.ram_budget);
    hw_renderer_destroy(renderer);
}

// A memory budget smaller than any piece: they come one at a time, and a rest brings all that is
// drawn.
static void test_least_memory(void **state)
{
    fixture *f = *state;
    const uint64_t atlas = STREAM_ATLAS * STREAM_ATLAS;
    const hw_streaming streaming = {.loading = HW_LOADING_SIMULATED, .ram_budget = 1};
    hw_renderer *renderer = open_renderer(f->dataset.folder, &streaming);
    walked sum = walk(f, renderer, 10);
    assert_int_equal(rest(f, renderer, 10, 60).stream.missing, 0);
    assert_true(sum.ram_peak >= atlas && sum.ram_peak < 2 * atlas);
    hw_renderer_destroy(renderer);
}

static void test_draw_allocates_nothing(void **state)
{
    fixture *f = *state;
    const hw_streaming streaming = {.loading = HW_LOADING_SIMULATED,
                                    .gpu_budget = 1200000,
                                    .ram_budget = 400000,
                                    .bytes_per_second = 100000};
    hw_renderer *renderer = open_renderer(f->dataset.folder, &streaming);
    for (double t = 0; t < 8; t += FRAME) {
        hw_camera camera = walk_camera(t);
        hw_frame_stats stats;
        hw_target_bind(f->target);
        hw_alloc_fail_after(0);
        assert_ok(hw_renderer_draw(renderer, &camera, &stats));
        assert_true(t < 0.1 || hw_alloc_count() == 0);
        hw_renderer_advance(renderer, FRAME);
    }
    hw_renderer_destroy(renderer);
}

// The limit of bandwidth counts in simulated time, waiting or not.
static void test_simulated_waits(void **state)
{
    fixture *f = *state;
    const hw_streaming streaming = {.loading = HW_LOADING_SIMULATED_WAITS,
                                    .bytes_per_second = 10000};
    hw_renderer *renderer = open_renderer(f->dataset.folder, &streaming);
    uint32_t stalls = 0;
    double waited_ms = 0;
    hw_frame_stats stats = {0};
    for (double t = 0; t < 10; t += FRAME) {
        hw_camera camera = walk_camera(t);
        stats = draw(f, renderer, &camera);
        stalls += stats.stalls;
        waited_ms += stats.stream.waited_ms;
        assert_int_equal(stats.stream.missing, 0);
        hw_renderer_advance(renderer, FRAME);
    }
    assert_true(stalls > 3);
    double wanted_ms = (double)stats.stream.read_bytes / 10;
    assert_true(waited_ms <= wanted_ms && waited_ms > wanted_ms * 0.8);
    hw_renderer_destroy(renderer);
}

// ---- faults ----

// The cell's file, or what hides it, under another name.
static void hide_cells(const fixture *f, bool hide)
{
    char from[96], to[96];
    snprintf(from, sizeof from, "%s/%s", f->dataset.folder, hide ? "cells" : "hidden");
    snprintf(to, sizeof to, "%s/%s", f->dataset.folder, hide ? "hidden" : "cells");
    assert_int_equal(rename(from, to), 0);
}

static void check_vanished(fixture *f, hw_loading loading)
{
    const hw_streaming streaming = {.loading = loading};
    bool real = loading == HW_LOADING_AHEAD;
    hw_renderer *renderer = open_renderer(f->dataset.folder, &streaming);
    hw_camera start = walk_camera(0), end = walk_camera(9);
    hw_frame_stats stats = {0};
    assert_true(catches_up(f, renderer, &start, real));
    hide_cells(f, true);
    for (int i = 0; i < 5000 && stats.stream.problem_count == 0; i++)
        stats = step(f, renderer, &end, real);
    assert_true(stats.stream.problem_count > 0);
    assert_non_null(strstr(stats.stream.problem, ".hxc"));
    assert_true(stats.stream.missing > 0 && stats.stream.late_cells > 0);
    hide_cells(f, false);
    assert_true(catches_up(f, renderer, &end, real));
    hw_renderer_destroy(renderer);
}

static void test_vanished(void **state)
{
    check_vanished(*state, HW_LOADING_SIMULATED);
}

static void test_vanished_thread(void **state)
{
    check_vanished(*state, HW_LOADING_AHEAD);
}

// Every file cut in half, cells and meshes, while one walks.
static void test_truncated(void **state)
{
    fixture *f = *state;
    const hw_streaming streaming = {.loading = HW_LOADING_SIMULATED};
    const hw_manifest *m = &f->dataset.manifest;
    hw_renderer *renderer = open_renderer(f->dataset.folder, &streaming);
    hw_camera start = walk_camera(0), end = walk_camera(9);
    hw_frame_stats stats = {0};
    assert_true(catches_up(f, renderer, &start, false));
    for (uint32_t i = 0; i <= m->cell_count; i++) {
        char *path = NULL;
        if (i < m->cell_count)
            assert_ok(hw_cell_path(&path, f->dataset.folder, m->cells[i].id));
        else
            assert_ok(hw_mesh_path(&path, f->dataset.folder, 0));
        assert_int_equal(truncate(path, 1000), 0);
        hw_free(path);
    }
    for (int i = 0; i < 60; i++)
        stats = step(f, renderer, &end, false);
    assert_true(stats.stream.problem_count > 0 && stats.stream.missing > 0);
    for (uint32_t i = 0; i < m->cell_count; i++)
        stream_write_cell(&f->dataset, m->cells[i].id);
    stream_write_ball(&f->dataset);
    assert_true(catches_up(f, renderer, &end, false));
    hw_renderer_destroy(renderer);
}

// A first frame that cannot be had is an error, not a wait for ever.
static void test_no_first_frame(void **state)
{
    fixture *f = *state;
    const hw_loading loadings[] = {HW_LOADING_AHEAD, HW_LOADING_SIMULATED};
    hw_camera camera = walk_camera(0);
    for (int i = 0; i < 2; i++) {
        const hw_streaming streaming = {.loading = loadings[i]};
        hw_renderer *renderer = open_renderer(f->dataset.folder, &streaming);
        hide_cells(f, true);
        assert_int_equal(hw_renderer_draw(renderer, &camera, NULL), HW_IO);
        assert_non_null(strstr(hw_error_text(), ".hxc"));
        hide_cells(f, false);
        hw_renderer_destroy(renderer);
    }
}

// Damages the first `count` levels of the near mesh; its table stays sound.
static void damage_levels(const fixture *f, uint32_t count)
{
    char path[96];
    hw_mesh_file *file;
    snprintf(path, sizeof path, "%s/meshes/0.hxm", f->dataset.folder);
    assert_ok(hw_mesh_file_open(&file, path));
    FILE *out = fopen(path, "r+b");
    for (uint32_t i = 0; i < count; i++) {
        uint64_t offset, size;
        hw_mesh_file_level_place(file, i, &offset, &size);
        assert_int_equal(fseek(out, (long)(offset + size / 2), SEEK_SET), 0);
        assert_int_equal(fwrite("damaged", 1, 7, out), 7);
    }
    fclose(out);
    hw_mesh_file_close(file);
}

// Neither is one whose near mesh has no level that can be read.
static void test_no_first_level(void **state)
{
    fixture *f = *state;
    hw_camera camera = walk_camera(0);
    const hw_streaming streaming = {.loading = HW_LOADING_SIMULATED};
    hw_renderer *renderer = open_renderer(f->dataset.folder, &streaming);
    damage_levels(f, STREAM_BALL_LODS);
    assert_int_not_equal(hw_renderer_draw(renderer, &camera, NULL), HW_OK);
    assert_non_null(strstr(hw_error_text(), "0.hxm"));
    stream_write_ball(&f->dataset);
    hw_renderer_destroy(renderer);
}

static uint32_t ball_triangles(uint32_t level)
{
    return 2u * (64u >> level) * ((32u >> level) - 1);
}

// A ball whose wanted level is late is drawn as coarse as it is there, not left out.
static void test_late_level(void **state)
{
    fixture *f = *state;
    const hw_manifest *m = &f->dataset.manifest;
    const hw_streaming streaming = {.loading = HW_LOADING_SIMULATED};
    hw_vec3 ball = hw_box_centre(m->objects[6 + m->cell_count / 2].bounds);
    hw_camera camera = model_camera(hw_v3_add(ball, hw_v3(-4, 0, 0)), hw_v3(1, 0, 0), SIZE);
    camera.fov_degrees = 10; // no other ball is in view
    for (uint32_t best = 0; best < STREAM_BALL_LODS; best++) {
        damage_levels(f, best);
        hw_renderer *renderer = open_renderer(f->dataset.folder, &streaming);
        for (int i = 0; i < 60; i++) {
            hw_frame_stats stats = step(f, renderer, &camera, false);
            assert_int_equal(stats.stream.late_cells, 0);
            if (i >= 59 || best + 1 == STREAM_BALL_LODS)
                assert_int_equal(stats.near_triangles, ball_triangles(best));
            assert_true(stats.near_triangles >= ball_triangles(STREAM_BALL_LODS - 1));
            assert_true(best == 0 || stats.stream.missing == 1);
        }
        stream_write_ball(&f->dataset);
        assert_true(catches_up(f, renderer, &camera, false));
        assert_int_equal(draw(f, renderer, &camera).near_triangles, ball_triangles(0));
        hw_renderer_destroy(renderer);
    }
}

static uint64_t file_bytes(const char *path)
{
    struct stat info;
    assert_int_equal(stat(path, &info), 0);
    return (uint64_t)info.st_size;
}

// What is wished for in every frame until it is there is read once.
static void test_nothing_twice(void **state)
{
    fixture *f = *state;
    const hw_manifest *m = &f->dataset.manifest;
    const hw_loader_desc desc = {.location = f->dataset.folder,
                                 .manifest = m,
                                 .bytes_per_second = 300000,
                                 .ram_budget = 1000000000,
                                 .mode = HW_LOADER_SIMULATED};
    hw_loader *loader;
    hw_loaded *loaded;
    double now_s = 0;
    uint64_t bytes = 0;
    assert_ok(hw_loader_create(&desc, &loader));
    for (uint32_t i = 0; i < 8; i++) {
        const hw_wish wish = {{HW_DATA_CELL, i, 0}, 0.5};
        char *path = NULL;
        while (!(loaded = hw_loader_take(loader))) {
            assert_true(hw_loader_wish(loader, &wish));
            hw_loader_run(loader, now_s += FRAME);
        }
        assert_ok(loaded->status);
        assert_true(hw_data_key_equal(loaded->key, wish.key));
        hw_loader_dispose(loader, loaded, true);
        for (int k = 0; k < 10; k++) {
            hw_loader_run(loader, now_s += FRAME);
            assert_null(hw_loader_take(loader));
        }
        assert_ok(hw_cell_path(&path, f->dataset.folder, m->cells[i].id));
        bytes += file_bytes(path);
        hw_free(path);
        assert_int_equal(hw_loader_get_stats(loader).bytes, bytes);
    }
    hw_loader_destroy(loader);
}

// A real thread, a real web server, and all that can go wrong on the way.
static void test_web(void **state)
{
    static const web_fault faults[] = {WEB_FINE,    WEB_HANG_UP, WEB_CUT,      WEB_LONG, WEB_SHORT,
                                       WEB_CORRUPT, WEB_BUSY,    WEB_NO_RANGE, WEB_GONE};
    fixture *f = *state;
    web w;
    web_open(&w, f->dataset.folder);
    const hw_streaming streaming = {.loading = HW_LOADING_AHEAD};
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        hw_renderer *renderer = open_renderer(w.location, &streaming);
        double t = 0;
        hw_camera camera = walk_camera(t);
        assert_true(catches_up(f, renderer, &camera, true));
        web_misbehave(&w, faults[i], 2);
        // A way long enough to meet it: what is there already needs no server.
        while (atomic_load(&w.faults_left) > 0 && t < 12) {
            camera = walk_camera(t += 0.5);
            assert_true(catches_up(f, renderer, &camera, true));
        }
        assert_int_equal(atomic_load(&w.faults_left), 0);
        assert_true(catches_up(f, renderer, &camera, true));
        hw_renderer_destroy(renderer);
    }
    web_close(&w);
}

// A web server that is away at the start is an error that names it; one that goes away later is a
// problem, no more.
static void test_web_goes(void **state)
{
    fixture *f = *state;
    web w;
    web_open(&w, f->dataset.folder);
    const hw_streaming streaming = {.loading = HW_LOADING_AHEAD};
    hw_renderer *renderer = open_renderer(w.location, &streaming);
    hw_camera start = walk_camera(0), end = walk_camera(9);
    assert_true(catches_up(f, renderer, &start, true));
    web_close(&w);
    const hw_renderer_desc desc = {
        .config = HW_CONFIG_C, .dataset = w.location, .streaming = streaming};
    hw_renderer *none = NULL;
    assert_int_equal(hw_renderer_create(&desc, &none), HW_IO);
    assert_null(none);
    assert_non_null(strstr(hw_error_text(), w.location));
    hw_frame_stats stats = {0};
    for (int i = 0; i < 5000 && stats.stream.problem_count == 0; i++) {
        stats = step(f, renderer, &end, true);
        assert_int_equal(stats.stalls, 0);
    }
    assert_true(stats.stream.problem_count > 0);
    assert_non_null(strstr(stats.stream.problem, w.location));
    hw_renderer_destroy(renderer);
}

// A walk with the thread, to be run under the thread sanitizer; quick turns make it give up wishes.
static void test_thread(void **state)
{
    fixture *f = *state;
    const hw_streaming streaming = {
        .loading = HW_LOADING_AHEAD, .gpu_budget = 1500000, .ram_budget = 500000};
    hw_renderer *renderer = open_renderer(f->dataset.folder, &streaming);
    for (int i = 0; i < 400; i++) {
        hw_camera camera = walk_camera(i * 0.05 - (i % 50 > 40 ? 3 : 0));
        hw_frame_stats stats = draw(f, renderer, &camera);
        assert_int_equal(stats.stream.problem_count, 0);
        assert_true(stats.stream.gpu_bytes <= streaming.gpu_budget);
        usleep(200);
    }
    hw_camera camera = walk_camera(5);
    assert_true(catches_up(f, renderer, &camera, true));
    hw_renderer_destroy(renderer);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_priorities),
        cmocka_unit_test(test_entries),
        cmocka_unit_test(test_distances),
        cmocka_unit_test(test_nothing_missing),
        cmocka_unit_test(test_late_data),
        cmocka_unit_test(test_closest),
        cmocka_unit_test(test_same_frames),
        cmocka_unit_test(test_budgets),
        cmocka_unit_test(test_first_frame_is_tight),
        cmocka_unit_test(test_crossings),
        cmocka_unit_test(test_default_budget),
        cmocka_unit_test(test_least_memory),
        cmocka_unit_test(test_draw_allocates_nothing),
        cmocka_unit_test(test_no_first_level),
        cmocka_unit_test(test_late_level),
        cmocka_unit_test(test_nothing_twice),
        cmocka_unit_test(test_simulated_waits),
        cmocka_unit_test(test_vanished),
        cmocka_unit_test(test_vanished_thread),
        cmocka_unit_test(test_truncated),
        cmocka_unit_test(test_no_first_frame),
        cmocka_unit_test(test_web),
        cmocka_unit_test(test_web_goes),
        cmocka_unit_test(test_thread),
    };
    return cmocka_run_group_tests_name("prefetch", tests, open_fixture, close_fixture);
}
