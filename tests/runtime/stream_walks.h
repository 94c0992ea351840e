// Walks through the dataset of stream_dataset.h, of which every frame must be whole.
#pragma once
#include "models.h"

#include "stream_dataset.h"
#include <unistd.h>

#define UNUSED __attribute__((unused))

#define SIZE  96u
#define FRAME (1 / 30.0) // seconds

typedef struct fixture {
    hw_context *context;
    hw_target *target;
    stream_dataset dataset;
} fixture;

// The context must be there.
static UNUSED int open_dataset(fixture *f)
{
    assert_ok(hw_target_create(&f->target, SIZE, SIZE, 1));
    stream_make(&f->dataset);
    return 0;
}

static UNUSED int close_dataset(fixture *f)
{
    hw_target_destroy(f->target);
    return stream_remove(&f->dataset);
}

static UNUSED hw_renderer *open_crossing(const char *location, const hw_streaming *streaming,
                                         double width)
{
    const hw_renderer_desc desc = {.config = HW_CONFIG_C,
                                   .dataset = location,
                                   .streaming = *streaming,
                                   .crossing_width = width};
    hw_renderer *renderer = NULL;
    assert_ok(hw_renderer_create(&desc, &renderer));
    return renderer;
}

static UNUSED hw_renderer *open_renderer(const char *location, const hw_streaming *streaming)
{
    return open_crossing(location, streaming, 0);
}

// A walk in a straight line through several cells, with a look back in the middle.
static UNUSED hw_camera walk_camera(double t)
{
    double x = -150 + 30 * t, y = -60 + 9 * t, angle = 0.3 + (t > 5 && t < 6 ? 2.5 : 0);
    return model_camera(hw_v3((float)x, (float)y, 0),
                        hw_v3((float)cos(angle), (float)sin(angle), 0), SIZE);
}

static UNUSED uint32_t count_holes(const fixture *f)
{
    hw_image image = {0};
    uint32_t holes = 0;
    assert_ok(hw_target_read(f->target, &image));
    for (uint32_t i = 0; i < SIZE * SIZE; i++)
        holes += image.data[i * 4 + 3] != 255;
    hw_image_free(&image);
    return holes;
}

static UNUSED hw_frame_stats draw(const fixture *f, hw_renderer *renderer, const hw_camera *camera)
{
    hw_frame_stats stats;
    hw_target_bind(f->target);
    assert_ok(hw_renderer_draw(renderer, camera, &stats));
    assert_int_equal(count_holes(f), 0);
    return stats;
}

// What a walk by simulated time came to.
typedef struct walked {
    uint32_t frames, missing, late;
    uint64_t gpu_peak, ram_peak, upload_peak, read_bytes;
} walked;

static UNUSED walked walk(const fixture *f, hw_renderer *renderer, double seconds)
{
    walked sum = {0};
    uint64_t uploaded = 0;
    for (double t = 0; t < seconds; t += FRAME) {
        hw_camera camera = walk_camera(t);
        hw_frame_stats stats = draw(f, renderer, &camera);
        const hw_stream_stats *s = &stats.stream;
        uint64_t upload = s->uploaded_bytes - uploaded;
        uploaded = s->uploaded_bytes;
        sum.upload_peak = sum.frames > 0 && upload > sum.upload_peak ? upload : sum.upload_peak;
        sum.missing += sum.frames > 0 && s->missing > 0;
        sum.late += s->late_cells > 0;
        sum.gpu_peak = s->gpu_bytes > sum.gpu_peak ? s->gpu_bytes : sum.gpu_peak;
        sum.ram_peak = s->ram_bytes_peak;
        sum.read_bytes = s->read_bytes;
        sum.frames++;
        assert_int_equal(stats.stalls, 0);
        assert_int_equal(s->problem_count, 0);
        hw_renderer_advance(renderer, FRAME);
    }
    return sum;
}

// Stands where the walk is after t seconds; the last frame tells.
static UNUSED hw_frame_stats rest(const fixture *f, hw_renderer *renderer, double t, int frames)
{
    hw_camera camera = walk_camera(t);
    hw_frame_stats stats = {0};
    for (int i = 0; i < frames; i++) {
        stats = draw(f, renderer, &camera);
        hw_renderer_advance(renderer, FRAME);
    }
    return stats;
}

// One step of time, simulated or real.
static UNUSED hw_frame_stats step(const fixture *f, hw_renderer *renderer, const hw_camera *camera,
                                  bool real)
{
    hw_frame_stats stats = draw(f, renderer, camera);
    if (real)
        usleep(2000);
    hw_renderer_advance(renderer, FRAME);
    return stats;
}

// Whether a frame lacks nothing in the end.
static UNUSED bool catches_up(const fixture *f, hw_renderer *renderer, const hw_camera *camera,
                              bool real)
{
    for (int i = 0; i < 5000; i++)
        if (step(f, renderer, camera, real).stream.missing == 0)
            return true;
    return false;
}

// ---- late cells ----

static UNUSED void unlink_cell(const fixture *f, hw_cell_id id)
{
    char *path = NULL;
    assert_ok(hw_cell_path(&path, f->dataset.folder, id));
    assert_int_equal(unlink(path), 0);
    hw_free(path);
}

static UNUSED bool is_one_of(hw_cell_id id, const hw_cell_id *cells, uint32_t count)
{
    uint32_t i = 0;
    while (i < count && hw_cell_compare(cells[i], id) != 0)
        i++;
    return i < count;
}

// Leaves the cell at the origin and its neighbours, with their groups except `lost`, which may be
// NULL. Returns those that are complete in `out`.
static UNUSED uint32_t leave_few(const fixture *f, const hw_cell_id *lost, hw_cell_id out[7])
{
    const hw_manifest *m = &f->dataset.manifest;
    hw_cell_id here[7] = {hw_hexgrid_locate(&m->grid, 0, 0)}, groups[7];
    uint32_t count = 0;
    hw_cell_neighbours(here[0], here + 1);
    for (int i = 0; i < 7; i++) {
        groups[i] = hw_cell_parent(here[i]);
        if (!lost || hw_cell_compare(groups[i], *lost) != 0)
            out[count++] = here[i];
    }
    for (uint32_t i = 0; i < m->cell_count; i++) {
        hw_cell_id id = m->cells[i].id;
        bool is_lost = lost && hw_cell_compare(id, *lost) == 0;
        if (is_lost || !is_one_of(id, id.level > 0 ? groups : here, 7))
            unlink_cell(f, id);
    }
    return count;
}

static UNUSED hw_cell_id closest_of(const hw_hexgrid *grid, const hw_cell_id *cells, uint32_t count,
                                    hw_vec3 eye)
{
    hw_cell_id best = cells[0];
    double least = INFINITY;
    for (uint32_t i = 0; i < count; i++) {
        hw_vec3 centre = hw_cell_centre(grid, cells[i]);
        double distance = hypot((double)(centre.x - eye.x), (double)(centre.y - eye.y));
        if (distance < least)
            best = cells[i];
        least = fmin(least, distance);
    }
    return best;
}

// Whether the picture has the colour of the cell high up, where there are walls only.
static UNUSED bool shows(const fixture *f, hw_cell_id id)
{
    hw_image image = {0};
    uint32_t index = 0;
    uint8_t color[3];
    bool same = true;
    assert_true(hw_manifest_find_cell(&f->dataset.manifest, id, &index));
    stream_color(index, color);
    assert_ok(hw_target_read(f->target, &image));
    for (int k = 0; k < 3; k++)
        same = same && abs(model_pixel(&image, SIZE / 2, 2)[k] - color[k]) <= 6;
    hw_image_free(&image);
    return same;
}

// Of a coloured dataset: where a cell is late, frames show the closest complete one, with the group
// that it lies in. The files of the others are gone for good.
static UNUSED void check_closest(const fixture *f, const hw_cell_id *lost)
{
    const hw_streaming streaming = {.loading = HW_LOADING_SIMULATED};
    const hw_hexgrid *grid = &f->dataset.manifest.grid;
    hw_cell_id complete[7], home = hw_hexgrid_locate(grid, 0, 0);
    uint32_t count = leave_few(f, lost, complete), late = 0, own = 0, group = 0;
    hw_renderer *renderer = open_renderer(f->dataset.folder, &streaming);
    hw_camera camera = model_camera(hw_cell_centre(grid, home), hw_v3(1, 0, 0), SIZE);
    for (int i = 0; i < 120; i++)
        step(f, renderer, &camera, false);
    for (int i = 0; i < 300; i++) {
        double turn = i * 0.7, radius = i * 0.8;
        camera.eye = hw_v3((float)(radius * cos(turn)), (float)(radius * sin(turn)), 0);
        camera.forward = hw_v3((float)cos(i), (float)sin(i), 0);
        hw_frame_stats stats = draw(f, renderer, &camera);
        hw_cell_id here = hw_hexgrid_locate(grid, (double)camera.eye.x, (double)camera.eye.y);
        bool is_late = !is_one_of(here, complete, count);
        hw_cell_id wanted = is_late ? closest_of(grid, complete, count, camera.eye) : here;
        assert_int_equal(stats.stream.late_cells, is_late ? (uint32_t)grid->levels : 0);
        assert_true(!is_late || stats.stream.missing > 0);
        bool shows_own = shows(f, wanted);
        bool shows_group = grid->levels > 1 && shows(f, hw_cell_parent(wanted));
        if (!shows_own && !shows_group)
            fail_msg("at %g %g the cell %d_%d should show", (double)camera.eye.x,
                     (double)camera.eye.y, wanted.q, wanted.r);
        late += is_late;
        own += shows_own;
        group += shows_group;
    }
    assert_true(late > 100 && late < 290 && own > 100);
    assert_true(group > 100 || grid->levels == 1);
    hw_renderer_destroy(renderer);
}
