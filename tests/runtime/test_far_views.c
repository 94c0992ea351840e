// Which captures of an MVMesh are drawn, and with what weights.
#include "hybrid_views.h"

// Captures of quad 0, its own from the centre first.
#define FLAT_VIEWS 3
static const hw_far_view flat_views[FLAT_VIEWS] = {
    {.face = FACE, .rect = {8, 16, 64, 48}},
    {.eye = {30, -30, 3}, .face = FACE + 1, .rect = {8, 76, 56, 44}},
    {.eye = {-25, 10, 0}, .face = FACE, .rect = {84, 112, 8, 8}},
};

// Quad 0 as an MVMesh, of which each capture has a colour of its own: red, green and blue.
static void add_flat_views(hw_cell *cell)
{
    hw_far_record *f = &cell->far[0];
    assert_ok(HW_NEW(&cell->views, FLAT_VIEWS - 1));
    assert_ok(HW_NEW(&cell->ranges, 1));
    cell->ranges[cell->range_count++] = (hw_far_range){(1 << FLAT_VIEWS) - 1, f->index_count};
    f->view_count = FLAT_VIEWS - 1;
    f->range_count = 1;
    cell->far[1].first_view = FLAT_VIEWS - 1; // it has none
    cell->far[1].first_range = 1;
    for (uint32_t k = 0; k < FLAT_VIEWS; k++) {
        hw_far_view v = flat_views[k];
        hw_image image = {0};
        assert_ok(hw_image_make(&image, v.rect.width + 8, v.rect.height + 8, 3));
        for (uint32_t i = k; i < image.width * image.height * 3; i += 3)
            image.data[i] = 255;
        put_image(cell, &image, v.rect);
        hw_image_free(&image);
        v.eye = hw_v3_add(v.eye, cell->centre);
        set_window(&v, &quads[0], cell->centre);
        if (k > 0)
            cell->views[cell->view_count++] = v;
    }
}

// Of the two captures of the smallest angles a1 <= a2, seen from the object, the first has the
// weight a2 / (a1 + a2), the second the rest (thesis 5.2.2); next to nothing of it is left out.
static void find_weights(hw_vec3 eye, hw_vec3 centre, double out[FLAT_VIEWS])
{
    hw_vec3 middle = quad_point(&quads[0], centre, 0.5, 0.5);
    hw_vec3 to_eye = hw_v3_normalize(hw_v3_sub(eye, middle));
    double angles[FLAT_VIEWS];
    int farthest = 0, order[2], n = 0;
    for (int k = 0; k < FLAT_VIEWS; k++) {
        hw_vec3 to_view = hw_v3_normalize(hw_v3_sub(hw_v3_add(flat_views[k].eye, centre), middle));
        angles[k] = atan2((double)hw_v3_length(hw_v3_cross(to_eye, to_view)),
                          (double)hw_v3_dot(to_eye, to_view));
        farthest = angles[k] > angles[farthest] ? k : farthest;
    }
    for (int k = 0; k < FLAT_VIEWS; k++)
        if (k != farthest)
            order[n++] = k;
    int first = angles[order[0]] <= angles[order[1]] ? 0 : 1;
    double share = angles[order[1 - first]] / (angles[order[0]] + angles[order[1]]);
    for (int k = 0; k < FLAT_VIEWS; k++)
        out[k] = 0;
    out[order[first]] = share >= 0.85 ? 1 : share;
    out[order[1 - first]] = share >= 0.85 ? 0 : 1 - share;
}

// Captures blend by their angles to the viewer; the farthest of the three is left out.
static void test_view_weights(void **state)
{
    fixture *f = *state;
    static const float eyes[][3] = {{11, -10, 2}, {20, -20, 0}, {-10, 5, 0}, {-16, 6, -3},
                                    {1, 0, 0},    {30, -29, 3}, {-25, 8, 1}};
    hw_cell_id home = hw_hexgrid_locate(&f->manifest.grid, 0, 0);
    hw_vec3 centre = hw_cell_centre(&f->manifest.grid, home);
    hw_cell cell = make_cell(f, home, true);
    add_flat_views(&cell);
    save_cell(f, &cell);
    hw_renderer *renderer = open_renderer(f);
    uint32_t firsts = 0, blended = 0;
    for (size_t i = 0; i < sizeof eyes / sizeof *eyes; i++) {
        hw_camera camera = view(f, eyes[i][0], eyes[i][1], eyes[i][2]);
        // A point of the quad that nothing hides, in the middle of the picture.
        hw_vec3 point = quad_point(&quads[0], centre, 0.4, 0.9);
        camera.forward = hw_v3_normalize(hw_v3_sub(point, camera.eye));
        hw_image image = render(f, renderer, &camera, NULL);
        const uint8_t *p = model_pixel(&image, SIZE / 2, SIZE / 2);
        double weights[FLAT_VIEWS];
        find_weights(camera.eye, centre, weights);
        for (int k = 0; k < FLAT_VIEWS; k++) {
            if (fabs(p[k] - 255 * weights[k]) > 2)
                fail_msg("eye %zu: %d %d %d, weights %g %g %g", i, p[0], p[1], p[2], weights[0],
                         weights[1], weights[2]);
            firsts |= (uint32_t)(weights[k] > 0.5) << k;
        }
        blended += fmax(fmax(weights[0], weights[1]), weights[2]) < 0.8;
        hw_image_free(&image);
    }
    assert_int_equal(firsts, 7); // each is the closest once
    assert_true(blended >= 3);
    hw_renderer_destroy(renderer);
    write_cell(f, home, true);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_view_weights),
    };
    return cmocka_run_group_tests_name("far_views", tests, open_fixture, close_fixture);
}
