// Configuration C on a dataset made by hand: it must look as the same scene does in B.
#include "crossing.h"
#include "hybrid_views.h"

// A view of each quad from beside the centre, through windows that are not parallel to it.
static const hw_far_view views[2] = {
    {.eye = {20, -30, 3}, .face = FACE + 1, .rect = {8, 76, 56, 44}},
    {.eye = {-35, 0, 0}, .face = FACE, .rect = {80, 12, 36, 40}},
};

// Which field of the quad the view shows at a point of its plane (beyond the quad, the nearest).
static int view_field(const hw_far_view *view, const far_quad *quad, hw_vec3 centre, double x,
                      double y)
{
    hw_vec3 a, r, u, axis, right, up;
    hw_face_basis((int)view->face, &a, &r, &u);
    basis(&axis, &right, &up);
    hw_vec3 d = hw_v3_mad(hw_v3_mad(a, r, (float)x), u, (float)y);
    hw_vec3 from = hw_v3_sub(view->eye, centre);
    float t = (quad->depth - hw_v3_dot(from, axis)) / hw_v3_dot(d, axis);
    hw_vec3 hit = hw_v3_mad(from, d, t);
    bool is_right = hw_v3_dot(hit, right) / quad->depth > (quad->x_min + quad->x_max) / 2;
    bool is_upper = hw_v3_dot(hit, up) / quad->depth > (quad->y_min + quad->y_max) / 2;
    return is_upper * 2 + is_right;
}

// Fills the rectangle of a view.
static void paint_view(hw_cell *cell, const hw_far_view *view, const far_quad *quad)
{
    hw_image image = {0};
    hw_rect r = view->rect;
    uint32_t width = r.width + 8, height = r.height + 8;
    assert_ok(hw_image_make(&image, width, height, 3));
    for (uint32_t j = 0; j < height; j++)
        for (uint32_t i = 0; i < width; i++) {
            double x = view->x_min + (i - 3.5) / r.width * ((double)view->x_max - view->x_min);
            double y = view->y_min + (j - 3.5) / r.height * ((double)view->y_max - view->y_min);
            int field = view_field(view, quad, cell->centre, x, y);
            memcpy(image.data + ((size_t)j * width + i) * 3, palette[quad->colors[field]], 3);
        }
    put_image(cell, &image, r);
    hw_image_free(&image);
}

// Makes MVMeshes of the quads: each triangle is seen by the captures of its set.
static void add_views(hw_cell *cell, const uint32_t sets[2][2])
{
    assert_ok(HW_NEW(&cell->views, 2));
    assert_ok(HW_NEW(&cell->ranges, 4));
    assert_ok(HW_NEW(&cell->colors, cell->vertex_count));
    cell->color_count = cell->vertex_count;
    for (uint32_t q = 0; q < 2; q++) {
        hw_far_view *v = &cell->views[cell->view_count++];
        hw_far_record *f = &cell->far[q];
        *v = views[q];
        v->eye = hw_v3_add(v->eye, cell->centre);
        set_window(v, &quads[q], cell->centre);
        paint_view(cell, v, &quads[q]);
        f->first_view = q;
        f->view_count = 1;
        f->first_range = cell->range_count;
        f->range_count = 2;
        for (int k = 0; k < 2; k++)
            cell->ranges[cell->range_count++] = (hw_far_range){sets[q][k], 3};
    }
    for (uint32_t i = 0; i < cell->color_count; i++)
        cell->colors[i] = (hw_color8){200, 100, 50, 255};
}

typedef struct crowd_square {
    uint32_t face, color;
    float depth, x, y, half; // image space at distance 1
} crowd_square;

static crowd_square crowd_place(uint32_t i)
{
    hw_rng rng = hw_rng_make(5, i);
    crowd_square s = {.face = i * 5 % 6, .color = i % 6};
    s.depth = 80 + 400 * hw_rng_float(&rng);
    s.x = hw_rng_float(&rng) - 0.5f;
    s.y = 0.3f * hw_rng_float(&rng);
    s.half = 0.01f + 0.02f * hw_rng_float(&rng);
    return s;
}

static hw_mesh crowd_mesh(const crowd_square *s, hw_vec3 centre)
{
    hw_mesh mesh = model_mesh(4, 6);
    hw_vec3 a, r, up;
    hw_face_basis((int)s->face, &a, &r, &up);
    hw_vec3 d = hw_v3_mad(hw_v3_mad(a, r, s->x - s->half), up, s->y - s->half);
    float side = 2 * s->half * s->depth;
    model_face(&mesh, 0, hw_v3_mad(centre, d, s->depth), hw_v3_scale(r, side),
               hw_v3_scale(up, side));
    return mesh;
}

static hw_scene crowd_scene(hw_vec3 centre)
{
    hw_scene scene = model_scene(CROWD, CROWD);
    for (uint32_t i = 0; i < CROWD; i++) {
        crowd_square s = crowd_place(i);
        hw_vec3 a, r, up;
        hw_face_basis((int)s.face, &a, &r, &up);
        scene.meshes[i] = crowd_mesh(&s, centre);
        scene.objects[i].mesh_idx = scene.objects[i].material_idx = i;
        for (int k = 0; k < 3; k++)
            scene.materials[i].base_color[k] =
                palette[s.color][k] / 255.0f / hw_light(hw_v3_scale(a, -1));
    }
    hw_scene_update_bounds(&scene);
    return scene;
}

// Six fields of 8 x 8 texels, covered in the middle 4 x 4: the squares' rectangles.
static void crowd_atlas(hw_cell *cell)
{
    hw_image image = {0};
    assert_ok(hw_image_make(&image, 48, 8, 4));
    for (uint32_t i = 0; i < 48 * 8; i++) {
        uint32_t x = i % 8, y = i / 48;
        bool covered = x >= 2 && x < 6 && y >= 2 && y < 6;
        memcpy(image.data + (size_t)i * 4, palette[i % 48 / 8], 3);
        image.data[i * 4 + 3] = covered ? 255 : 0;
    }
    cell->atlas_width = 48;
    cell->atlas_height = 8;
    assert_ok(HW_NEW(&cell->atlas_bc1, hw_bc1_bytes(48, 8)));
    hw_bc1_encode(&image, cell->atlas_bc1);
    assert_ok(HW_NEW(&cell->coverage_bc4, hw_bc1_bytes(cell->atlas_width, cell->atlas_height)));
    hw_bc4_encode(&image, 3, cell->coverage_bc4);
    hw_image_free(&image);
}

static void write_crowd(const fixture *f, hw_cell_id id, const hw_scene *scene)
{
    static const uint32_t pattern[6] = {0, 1, 3, 0, 3, 2};
    hw_cell cell = {.id = id, .centre = hw_cell_centre(&f->manifest.grid, id), .far_count = CROWD};
    char *path = NULL;
    cell.vertex_count = CROWD * 4;
    cell.index_count = CROWD * 6;
    assert_ok(HW_NEW(&cell.far, CROWD));
    assert_ok(HW_NEW(&cell.vertices, cell.vertex_count));
    assert_ok(HW_NEW(&cell.indices, cell.index_count));
    for (uint32_t i = 0; i < CROWD; i++) {
        crowd_square s = crowd_place(i);
        // Every second one is twice as large as its square, and cut out.
        bool cut_out = i % 2;
        s.half *= cut_out ? 2 : 1;
        uint32_t border = cut_out ? 0 : 2;
        cell.far[i] =
            (hw_far_record){.object_idx = i,
                            .face = s.face,
                            .cut_out = cut_out,
                            .x_min = s.x - s.half,
                            .x_max = s.x + s.half,
                            .y_min = s.y - s.half,
                            .y_max = s.y + s.half,
                            .iz_min = 1 / s.depth,
                            .iz_max = 1.5f / s.depth,
                            .bounds = scene->objects[i].bounds,
                            .rect = {s.color * 8 + border, border, 8 - 2 * border, 8 - 2 * border},
                            .first_vertex = i * 4,
                            .vertex_count = 4,
                            .first_index = i * 6,
                            .index_count = 6};
        for (uint32_t k = 0; k < 4; k++)
            cell.vertices[i * 4 + k] =
                (hw_far_vertex){k % 2 ? 65535 : 0, k / 2 ? 65535 : 0, 0, (uint16_t)i};
        for (uint32_t k = 0; k < 6; k++)
            cell.indices[i * 6 + k] = i * 4 + pattern[k];
    }
    crowd_atlas(&cell);
    assert_ok(hw_cell_path(&path, f->folder, id));
    assert_ok(hw_cell_write(&cell, path));
    hw_free(path);
    hw_cell_free(&cell);
}

// ---- tests -----------------------------------------------------------------------------------

// Whether the pixel lies between the darkest and the lightest of the truth's pixels round it.
static bool is_near(const hw_image *truth, const uint8_t *p, uint32_t x, uint32_t y, uint32_t reach)
{
    for (int k = 0; k < 4; k++) {
        int low = 255, high = 0;
        for (uint32_t v = y >= reach ? y - reach : 0; v <= y + reach && v < SIZE; v++) {
            for (uint32_t u = x >= reach ? x - reach : 0; u <= x + reach && u < SIZE; u++) {
                int t = model_pixel(truth, u, v)[k];
                low = t < low ? t : low;
                high = t > high ? t : high;
            }
        }
        if (p[k] < low - 3 || p[k] > high + 3)
            return false;
    }
    return true;
}

static void test_same_as_geometry(void **state)
{
    fixture *f = *state;
    static const float eyes[][3] = {
        {0, 0, 0}, {10, -5, 3}, {-20, 10, -6}, {25, 20, 8}, {0, -30, 0}};
    f->manifest.near_error_px = 1e-6; // near objects at full detail
    assert_ok(hw_manifest_write(f->folder, &f->manifest));
    hw_renderer *renderer = open_renderer(f);
    f->manifest.near_error_px = NEAR_PX;
    assert_ok(hw_manifest_write(f->folder, &f->manifest));
    for (size_t i = 0; i < sizeof eyes / sizeof *eyes; i++) {
        hw_camera camera = view(f, eyes[i][0], eyes[i][1], eyes[i][2]);
        hw_frame_stats stats;
        hw_image image = render(f, renderer, &camera, &stats);
        hw_image truth = model_render(HW_CONFIG_B, &f->scene, &camera, 0, NULL);
        uint32_t different = 0, objects = 0;
        for (uint32_t y = 0; y < SIZE; y++) {
            for (uint32_t x = 0; x < SIZE; x++) {
                const uint8_t *p = model_pixel(&image, x, y);
                objects += p[3] == 255;
                different += !is_near(&truth, p, x, y, 0);
                if (!is_near(&truth, p, x, y, 2))
                    fail_msg("eye %zu: pixel (%u, %u) is %d %d %d %d", i, x, y, p[0], p[1], p[2],
                             p[3]);
            }
        }
        assert_true(objects > 5000);
        assert_true(different < objects / 10); // the seams between texels and the silhouettes
        assert_int_equal(stats.far_triangles, 4);
        assert_true(stats.near_triangles >= 12);
        assert_int_equal(stats.triangles, stats.near_triangles + stats.far_triangles + 2);
        assert_int_equal(stats.stalls, 0);
        hw_image_free(&image);
        hw_image_free(&truth);
    }
    hw_renderer_destroy(renderer);
}

static uint32_t count_wrong(fixture *f, hw_renderer *renderer, const hw_camera *camera,
                            hw_frame_stats *stats)
{
    hw_image image = render(f, renderer, camera, stats);
    hw_image truth = model_render(HW_CONFIG_B, &f->scene, camera, 0, NULL);
    uint32_t wrong = 0;
    for (uint32_t y = 0; y < SIZE; y++)
        for (uint32_t x = 0; x < SIZE; x++)
            wrong += !is_near(&truth, model_pixel(&image, x, y), x, y, 2);
    hw_image_free(&image);
    hw_image_free(&truth);
    return wrong;
}

static void set_multi_view(fixture *f, bool multi_view)
{
    f->manifest.multi_view = multi_view;
    assert_ok(hw_manifest_write(f->folder, &f->manifest));
}

// Whatever captures see the triangles, the picture is the same; where none does, the colours of the
// vertices show.
static void test_views(void **state)
{
    fixture *f = *state;
    static const uint32_t sets[][2][2] = {{{1, 1}, {1, 1}}, {{2, 2}, {2, 2}}, {{1, 2}, {2, 1}},
                                          {{3, 3}, {3, 3}}, {{3, 2}, {1, 3}}, {{0, 3}, {3, 0}}};
    static const float eyes[][3] = {{0, 0, 0}, {10, -5, 3}, {-20, 10, -6}, {25, 20, 8}};
    hw_cell_id home = hw_hexgrid_locate(&f->manifest.grid, 0, 0);
    f->manifest.near_error_px = 1e-6;
    assert_ok(hw_manifest_write(f->folder, &f->manifest));
    for (size_t s = 0; s < sizeof sets / sizeof *sets; s++) {
        hw_cell cell = make_cell(f, home, true);
        add_views(&cell, sets[s]);
        save_cell(f, &cell);
        hw_renderer *renderer = open_renderer(f);
        for (size_t i = 0; i < sizeof eyes / sizeof *eyes; i++) {
            hw_camera camera = view(f, eyes[i][0], eyes[i][1], eyes[i][2]);
            hw_frame_stats stats;
            uint32_t wrong = count_wrong(f, renderer, &camera, &stats);
            assert_int_equal(stats.far_triangles, 4);
            if (s < 5) // where seams run askew through texels of 2.4 pixels
                assert_in_range(wrong, 0, 100);
            else
                assert_in_range(wrong, 2000, SIZE * SIZE / 2); // two triangles of plain colour
        }
        hw_renderer_destroy(renderer);
    }
    f->manifest.near_error_px = NEAR_PX;
    // Of a dataset that is to have none, views are an error: what draws them is not there.
    set_multi_view(f, false);
    hw_renderer *renderer = open_renderer(f);
    hw_camera camera = view(f, 0, 0, 0);
    hw_frame_stats stats;
    hw_target_bind(f->target);
    assert_int_equal(hw_renderer_draw(renderer, &camera, &stats), HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), "views"));
    hw_renderer_destroy(renderer);
    set_multi_view(f, true);
    write_cell(f, home, true);
}

// The seam in the middle of quad 0 crosses the image where perspective says, to a twentieth of a
// pixel.
static void test_texture_placement(void **state)
{
    fixture *f = *state;
    hw_renderer *renderer = open_renderer(f);
    for (int i = 0; i < 5; i++) {
        hw_camera camera = view(f, i * 3.3f - 10, i * 2.0f, 10);
        hw_image image = render(f, renderer, &camera, NULL);
        hw_cell_id home = hw_hexgrid_locate(&f->manifest.grid, 0, 0);
        hw_vec3 seam = quad_point(&quads[0], hw_cell_centre(&f->manifest.grid, home), 0.5, 0.95);
        hw_mat4 matrix = hw_camera_view_projection(&camera);
        double clip[4];
        for (int k = 0; k < 4; k++)
            clip[k] = matrix.m[k] * seam.x + matrix.m[4 + k] * seam.y + matrix.m[8 + k] * seam.z +
                      matrix.m[12 + k];
        double wanted = (clip[0] / clip[3] * 0.5 + 0.5) * SIZE;
        uint32_t row = (uint32_t)((0.5 - clip[1] / clip[3] * 0.5) * SIZE);
        // Upper left is blue without red, upper right has red: where does red pass its half?
        double found = -1;
        for (uint32_t x = (uint32_t)wanted - 6; x < wanted + 6; x++) {
            double a = model_pixel(&image, x, row)[0], b = model_pixel(&image, x + 1, row)[0];
            if (a < 33 && b >= 33)
                found = x + 0.5 + (33 - a) / (b - a);
        }
        assert_true(fabs(found - wanted) < 0.05);
        hw_image_free(&image);
    }
    hw_renderer_destroy(renderer);
}

static void set_clusters(fixture *f, bool clusters)
{
    f->manifest.clusters = clusters;
    assert_ok(hw_manifest_write(f->folder, &f->manifest));
}

static hw_renderer *open_soft(const fixture *f)
{
    const hw_renderer_desc desc = {
        .config = HW_CONFIG_C, .dataset = f->folder, .crossing_width = 0.2};
    hw_renderer *renderer = NULL;
    assert_ok(hw_renderer_create(&desc, &renderer));
    return renderer;
}

// Where there may be clusters, all objects dissolve together. Inside a strip along the border each
// pixel is that of one cell or the other, the share of the other rises to one half on the border,
// and what is near in both cells is whole. Only the home cell has far objects.
static void check_dissolve(fixture *f)
{
    set_clusters(f, true);
    const double border = f->manifest.grid.cell_size * sqrt(0.75);
    hw_renderer *hard = open_renderer(f), *soft = open_soft(f);
    hw_vec3 out, right, up;
    hw_face_basis(0, &out, &right, &up);
    const double distances[] = {0.05, 2.5, 5, 7.5, 10.5}, shares[] = {0.5, 0.375, 0.25, 0.125, 0};
    for (int i = 0; i < 5; i++) {
        hw_vec3 eye = hw_v3_scale(out, (float)(border - distances[i]));
        hw_camera camera = view(f, eye.x, eye.y, 0);
        hw_image whole = render(f, hard, &camera, NULL), mixed = render(f, soft, &camera, NULL);
        uint32_t objects = 0, gone = 0;
        for (uint32_t p = 0; p < SIZE * SIZE; p++) {
            const uint8_t *a = whole.data + (size_t)p * 4, *b = mixed.data + (size_t)p * 4;
            objects += a[3] == 255;
            gone += a[3] == 255 && b[3] == 0;
            assert_true(b[3] == 0 || memcmp(a, b, 4) == 0 || a[3] == 255);
        }
        hw_image_free(&whole);
        hw_image_free(&mixed);
        uint32_t far = 0; // pixels where only far objects are
        hw_scene scene = f->scene;
        scene.object_count = NEAR_OBJECTS;
        camera = view(f, eye.x, eye.y, 0);
        hw_image near = model_render(HW_CONFIG_B, &scene, &camera, 0, NULL);
        for (uint32_t p = 0; p < SIZE * SIZE; p++)
            far += near.data[(size_t)p * 4 + 3] == 0;
        hw_image_free(&near);
        far -= SIZE * SIZE - objects;
        assert_true(far > 2000);
        assert_true(fabs((double)gone / far - shares[i]) < 0.02);
    }
    // Just before and just behind the border the picture is the same, but for a few edges.
    uint32_t changed = 0;
    hw_image sides[2];
    for (int i = 0; i < 2; i++) {
        hw_vec3 eye = hw_v3_scale(out, (float)(border + (i ? 1e-3 : -1e-3)));
        hw_camera camera = view(f, eye.x, eye.y, 0);
        sides[i] = render(f, soft, &camera, NULL);
    }
    for (uint32_t p = 0; p < SIZE * SIZE; p++)
        changed += memcmp(sides[0].data + (size_t)p * 4, sides[1].data + (size_t)p * 4, 4) != 0;
    assert_true(changed < SIZE);
    hw_image_free(&sides[0]);
    hw_image_free(&sides[1]);
    hw_renderer_destroy(hard);
    hw_renderer_destroy(soft);
    set_clusters(f, false);
}

static void test_cells_dissolve(void **state)
{
    static const uint32_t sets[2][2] = {{0, 3}, {1, 3}}; // all kinds of programs
    fixture *f = *state;
    check_dissolve(f);
    hw_cell_id home = hw_hexgrid_locate(&f->manifest.grid, 0, 0);
    hw_cell cell = make_cell(f, home, true);
    add_views(&cell, sets);
    save_cell(f, &cell);
    check_dissolve(f);
    write_cell(f, home, true);
}

#define WAY_STEPS 60

// The most pixels that change in a step of half a unit on a straight way with `middle` half way, as
// seen from the home cell.
static uint32_t largest_change(const fixture *f, hw_renderer *renderer, hw_vec3 middle, float angle)
{
    const hw_camera camera = view(f, 0, 0, 0);
    const hw_vec3 step = hw_v3(0.5f * cosf(angle), 0.5f * sinf(angle), 0);
    hw_image before = {0};
    uint32_t most = 0;
    for (int i = 0; i <= WAY_STEPS; i++) {
        hw_camera there = camera;
        there.fov_degrees = 150; // all objects are in view
        there.eye = hw_v3_mad(middle, step, (float)i - WAY_STEPS / 2);
        hw_renderer_set_debug_view(renderer, &(hw_debug_view){.frozen = true, .camera = there});
        hw_image now = render(f, renderer, &camera, NULL);
        uint32_t changed = 0;
        for (uint32_t p = 0; i > 0 && p < SIZE * SIZE; p++)
            changed += memcmp(before.data + (size_t)p * 4, now.data + (size_t)p * 4, 4) != 0;
        most = changed > most ? changed : most;
        hw_image_free(&before);
        before = now;
    }
    hw_image_free(&before);
    return most;
}

// Past a point where three cells meet, each with far objects of its own, no step changes twice as
// much of the picture as one over the middle of a border: shares change 1.2 times as fast, and
// those of all three at once.
static void test_three_cells(void **state)
{
    fixture *f = *state;
    const hw_hexgrid *grid = &f->manifest.grid;
    enum { CORNER = 4 }; // below, so that all far objects are in view
    hw_cell_id home = hw_hexgrid_locate(grid, 0, 0), around[6];
    hw_vec3 corners[HW_CELL_CORNERS], centre = hw_cell_centre(grid, home);
    hw_cell_neighbours(home, around);
    hw_cell_corners(grid, home, corners);
    f->manifest.near_error_px = 1e-6; // near objects at full detail
    assert_ok(hw_manifest_write(f->folder, &f->manifest));
    const hw_cell_id others[2] = {around[CORNER - 1], around[CORNER]};
    for (int i = 0; i < 2; i++)
        write_cell(f, others[i], true);
    hw_renderer *soft = open_soft(f);
    uint32_t border = 0;
    for (int i = 0; i < 3; i++) {
        hw_vec3 from = i < 2 ? centre : hw_cell_centre(grid, others[0]);
        hw_vec3 to = hw_v3_sub(hw_cell_centre(grid, others[i % 2 + i / 2]), from);
        hw_vec3 middle = hw_v3_mad(from, to, 0.5f);
        uint32_t change = largest_change(f, soft, middle, atan2f(to.y, to.x));
        border = change > border ? change : border;
    }
    assert_true(border > 100);
    for (int i = 0; i < 8; i++) {
        hw_vec3 middle = corners[CORNER];
        middle.z = centre.z;
        middle.x += (float)(i % 3 - 1) * 2;
        assert_in_range(largest_change(f, soft, middle, (float)i * 0.4f), 1, border * 2);
    }
    hw_renderer_destroy(soft);
    for (int i = 0; i < 2; i++)
        write_cell(f, others[i], false);
    f->manifest.near_error_px = NEAR_PX;
    assert_ok(hw_manifest_write(f->folder, &f->manifest));
}

// Many records: pages, ranges and culling must leave every square in its place, and draw only those
// in view.
static void test_crowd(void **state)
{
    fixture *f = *state;
    hw_cell_id id = hw_hexgrid_locate(&f->manifest.grid, 90, 20);
    hw_vec3 centre = hw_cell_centre(&f->manifest.grid, id);
    hw_scene scene = crowd_scene(centre);
    write_crowd(f, id, &scene);
    scene.ground = f->scene.ground;
    hw_renderer *renderer = open_renderer(f);
    for (int i = 0; i < 8; i++) {
        double angle = i * 0.8;
        hw_camera camera = model_camera(hw_v3_add(centre, hw_v3(3.0f * (float)i - 10, 5, 2)),
                                        hw_v3((float)cos(angle), (float)sin(angle), 0.05f), SIZE);
        hw_frame_stats stats;
        hw_image image = render(f, renderer, &camera, &stats);
        hw_image truth = model_render(HW_CONFIG_B, &scene, &camera, 0, NULL);
        hw_mat4 matrix = hw_camera_view_projection(&camera);
        hw_frustum frustum = hw_frustum_make(&matrix);
        uint32_t visible = 0, objects = 0;
        for (uint32_t k = 0; k < CROWD; k++)
            visible += hw_frustum_meets_box(&frustum, scene.objects[k].bounds);
        assert_int_equal(stats.far_triangles, visible * 2);
        assert_true(visible > 20 && visible < CROWD / 2);
        for (uint32_t p = 0; p < SIZE * SIZE; p++) {
            const uint8_t *pixel = model_pixel(&image, p % SIZE, p / SIZE);
            objects += pixel[3] == 255;
            if (!is_near(&truth, pixel, p % SIZE, p / SIZE, 1))
                fail_msg("view %d: pixel (%u, %u)", i, p % SIZE, p / SIZE);
        }
        assert_true(objects > 500);
        hw_image_free(&image);
        hw_image_free(&truth);
    }
    hw_renderer_destroy(renderer);
    hw_scene_free(&scene);
    write_cell(f, id, false);
}

// Near the border to a cell that has no far objects: those whose turn is over are not drawn, those
// whose turn it is dissolve, and the others are drawn as they are.
static void test_crowd_dissolves(void **state)
{
    fixture *f = *state;
    const hw_hexgrid *grid = &f->manifest.grid;
    hw_cell_id id = hw_hexgrid_locate(grid, 90, 20);
    hw_vec3 centre = hw_cell_centre(grid, id), axis, right, up;
    hw_scene scene = crowd_scene(centre);
    hw_renderer *soft, *hard;
    uint32_t dissolving = 0;
    write_crowd(f, id, &scene);
    soft = open_soft(f);
    hard = open_renderer(f);
    hw_face_basis(4, &axis, &right, &up);
    for (int i = 0; i < 10; i++) {
        hw_vec3 eye = hw_v3_mad(centre, axis, 50 * sqrtf(0.75f) - 9.5f + (float)i);
        hw_camera camera = model_camera(eye, hw_v3(0.1f, 1, 0.05f), SIZE);
        hw_crossing crossing = hw_crossing_at(grid, id, eye, 0.2);
        hw_mat4 matrix = hw_camera_view_projection(&camera);
        hw_frustum frustum = hw_frustum_make(&matrix);
        uint32_t drawn = 0, own = hw_cell_compare(crossing.cells[0], id) == 0 ? 0 : 1;
        assert_int_equal(crossing.count, 2);
        for (uint32_t k = 0; k < CROWD; k++) {
            hw_turn turn = hw_object_turn(k, HW_CROSSING_TURNS);
            hw_kept kept = hw_crossing_kept(&crossing, own, own + 1, turn);
            bool visible = hw_frustum_meets_box(&frustum, scene.objects[k].bounds);
            drawn += visible && !hw_kept_none(kept);
            dissolving += visible && !hw_kept_none(kept) && hw_kept_phase(kept);
        }
        hw_frame_stats stats;
        hw_image mixed = render(f, soft, &camera, &stats), whole = render(f, hard, &camera, NULL);
        assert_int_equal(stats.far_triangles, drawn * 2);
        uint32_t objects = 0, left = 0;
        for (uint32_t p = 0; p < SIZE * SIZE; p++) {
            objects += model_pixel(&whole, p % SIZE, p / SIZE)[3] == 255;
            left += model_pixel(&mixed, p % SIZE, p / SIZE)[3] == 255;
        }
        double share = (double)crossing.bounds[own + 1] - (double)crossing.bounds[own];
        assert_true(fabs((double)left / objects - share) < 0.2);
        hw_image_free(&mixed);
        hw_image_free(&whole);
    }
    assert_true(dissolving > 50);
    hw_renderer_destroy(soft);
    hw_renderer_destroy(hard);
    hw_scene_free(&scene);
    write_cell(f, id, false);
}

static uint32_t sphere_triangles(uint32_t level)
{
    return 2u * (64u >> level) * ((32u >> level) - 1);
}

// The level of the sphere is the coarsest whose error stays below the dataset's pixels.
static void test_near_levels(void **state)
{
    fixture *f = *state;
    hw_renderer *renderer = open_renderer(f);
    const hw_manifest_object *sphere = &f->manifest.objects[SPHERE];
    uint32_t seen = 0;
    for (int i = 0; i < 60; i++) {
        // From within the sphere's box outward; looking at it along x.
        float distance = i < 2 ? 0 : (float)i * 1.7f;
        hw_camera camera = view(f, 0, 0, 0);
        hw_vec3 c = hw_box_centre(sphere->bounds);
        camera.eye = hw_v3(sphere->bounds.max.x + distance - (i == 0), c.y, c.z);
        camera.forward = hw_v3(-1, 0, 0);
        double d = hw_box_distance(sphere->bounds, camera.eye);
        double limit = NEAR_PX * d / hw_camera_focal_px(&camera) / 4; // scaled by 4
        uint32_t level = limit >= 0.04 ? 2 : limit >= 0.02 ? 1 : 0;
        if (fabs(limit - 0.04) < 1e-4 || fabs(limit - 0.02) < 1e-4)
            continue;
        hw_frame_stats stats;
        hw_image image = render(f, renderer, &camera, &stats);
        hw_image_free(&image);
        // Nothing else is in view there but, perhaps, cube and board.
        uint32_t rest = stats.near_triangles - sphere_triangles(level);
        assert_true(rest == 0 || rest == 12 || rest == 2 || rest == 14);
        seen |= 1u << level;
    }
    assert_int_equal(seen, 7);
    hw_renderer_destroy(renderer);
}

// Near objects keep to their budget of triangles together, and give up no more than that needs.
static void test_near_budget(void **state)
{
    fixture *f = *state;
    const uint32_t budgets[] = {0, 4000, 1000, 300, 1};
    const hw_manifest_object *sphere = &f->manifest.objects[SPHERE];
    hw_camera camera = view(f, 0, 0, 0);
    hw_vec3 c = hw_box_centre(sphere->bounds);
    camera.eye = hw_v3(sphere->bounds.max.x + 1, c.y, c.z);
    camera.forward = hw_v3(-1, 0, 0);
    for (int i = 0; i < 5; i++) {
        const hw_renderer_desc desc = {
            .config = HW_CONFIG_C, .dataset = f->folder, .near_triangles = budgets[i]};
        hw_renderer *renderer;
        hw_frame_stats stats;
        assert_ok(hw_renderer_create(&desc, &renderer));
        hw_image image = render(f, renderer, &camera, &stats);
        hw_image_free(&image);
        hw_renderer_destroy(renderer);
        uint32_t level = 0, rest = 14; // of cube and board, in view or not
        while (budgets[i] && level + 1 < SPHERE_LODS && sphere_triangles(level) + rest > budgets[i])
            level++;
        assert_true(stats.near_triangles >= sphere_triangles(level));
        assert_true(stats.near_triangles <= sphere_triangles(level) + rest);
    }
}

// Who stands in the box of an object sees it as it is, and what is over the budget by it is not
// taken from the others: they have half of it at least.
static void test_near_budget_inside(void **state)
{
    fixture *f = *state;
    const hw_manifest_object *sphere = &f->manifest.objects[SPHERE];
    const uint32_t others = 14; // triangles of cube and board
    uint64_t drawn[2];
    for (int i = 0; i < 2; i++) {
        const hw_renderer_desc desc = {.config = HW_CONFIG_C,
                                       .dataset = f->folder,
                                       .near_triangles = i ? 2 * others : 1000000};
        hw_renderer *renderer;
        hw_frame_stats stats;
        hw_camera camera = view(f, 0, 0, 0);
        hw_vec3 cube = hw_box_centre(f->manifest.objects[CUBE].bounds);
        camera.eye = hw_box_centre(sphere->bounds);
        camera.forward = hw_v3_normalize(hw_v3_sub(cube, camera.eye));
        assert_ok(hw_renderer_create(&desc, &renderer));
        hw_image image = render(f, renderer, &camera, &stats);
        hw_image_free(&image);
        hw_renderer_destroy(renderer);
        drawn[i] = stats.near_triangles;
        assert_true(drawn[i] >= sphere_triangles(0) + 12 && sphere_triangles(0) > 2 * others);
    }
    assert_int_equal(drawn[0], drawn[1]);
}

// The cube behind the sphere is left out, in front of it not; no pixel changes in either view.
static void test_hidden(void **state)
{
    fixture *f = *state;
    hw_vec3 sphere = hw_box_centre(f->manifest.objects[SPHERE].bounds);
    hw_vec3 away = hw_v3_sub(sphere, hw_box_centre(f->manifest.objects[CUBE].bounds));
    away = hw_v3_normalize(away);
    for (int behind = 0; behind < 2; behind++) {
        hw_camera camera = view(f, 0, 0, 0);
        if (behind) {
            camera.eye = hw_v3_mad(sphere, away, 7);
            camera.forward = hw_v3_scale(away, -1);
        }
        hw_image images[2];
        hw_frame_stats stats[2];
        for (int hide = 0; hide < 2; hide++) {
            const hw_renderer_desc desc = {
                .config = HW_CONFIG_C, .dataset = f->folder, .hide = hide == 1};
            hw_renderer *renderer;
            assert_ok(hw_renderer_create(&desc, &renderer));
            images[hide] = render(f, renderer, &camera, &stats[hide]);
            if (hide && behind) { // lines hide nothing
                hw_frame_stats lines;
                hw_renderer_set_debug_view(renderer, &(hw_debug_view){.wireframe = true});
                hw_image image = render(f, renderer, &camera, &lines);
                assert_int_equal(lines.hidden, 0);
                hw_image_free(&image);
            }
            hw_renderer_destroy(renderer);
        }
        assert_memory_equal(images[0].data, images[1].data, (size_t)SIZE * SIZE * 4);
        assert_int_equal(stats[0].hidden, 0);
        assert_int_equal(stats[1].hidden > 0, behind);
        assert_int_equal(stats[1].near_triangles < stats[0].near_triangles, behind);
        for (int hide = 0; hide < 2; hide++)
            hw_image_free(&images[hide]);
    }
}

static bool is_tinted(const uint8_t *plain, const uint8_t *tinted, const float *color)
{
    for (int k = 0; k < 3; k++)
        if (fabs(plain[k] * (double)color[k] - tinted[k]) > 1.5)
            return false;
    return true;
}

// Every object's pixel is its own colour times that of near objects or of SVMeshes; both occur.
static void test_tints(void **state)
{
    const fixture *f = *state;
    hw_renderer *renderer = open_renderer(f);
    hw_camera camera = view(f, 0, 0, 0);
    hw_image plain = render(f, renderer, &camera, NULL);
    hw_renderer_set_debug_view(renderer, &(hw_debug_view){.tint = true});
    hw_image tinted = render(f, renderer, &camera, NULL);
    uint32_t near = 0, far = 0;
    for (size_t i = 0; i < (size_t)SIZE * SIZE; i++) {
        const uint8_t *a = plain.data + 4 * i, *b = tinted.data + 4 * i;
        assert_int_equal(a[3], b[3]);
        if (a[3] == 0) {
            assert_memory_equal(a, b, 3);
            continue;
        }
        bool is_near = is_tinted(a, b, hw_representation_color(HW_REPRESENTATION_NEAR));
        bool is_far = is_tinted(a, b, hw_representation_color(HW_REPRESENTATION_SVMESH));
        assert_true(is_near || is_far);
        near += is_near && !is_far;
        far += is_far && !is_near;
    }
    assert_true(near > 500 && far > 500);
    hw_image_free(&plain);
    hw_image_free(&tinted);
    hw_renderer_destroy(renderer);
}

// From another cell, and looking back: what is drawn is still what was chosen at home.
static void test_frozen(void **state)
{
    const fixture *f = *state;
    hw_renderer *renderer = open_renderer(f);
    hw_camera home = view(f, 0, 0, 0), away = view(f, 0, 0, 0);
    away.eye = hw_v3_add(away.eye, hw_v3(0, -2 * (float)f->manifest.grid.cell_size, 0));
    away.forward = hw_v3_scale(away.forward, -1);
    hw_frame_stats at_home, frozen, thawed;
    hw_image image = render(f, renderer, &home, &at_home);
    hw_image_free(&image);
    hw_renderer_set_debug_view(renderer, &(hw_debug_view){.frozen = true, .camera = home});
    image = render(f, renderer, &away, &frozen);
    hw_image_free(&image);
    assert_int_equal(frozen.triangles, at_home.triangles);
    assert_true(frozen.cell_q == at_home.cell_q && frozen.cell_r == at_home.cell_r);
    hw_renderer_set_debug_view(renderer, &(hw_debug_view){0});
    image = render(f, renderer, &away, &thawed);
    hw_image_free(&image);
    assert_true(thawed.triangles < at_home.triangles);
    assert_true(thawed.cell_r != at_home.cell_r);
    hw_renderer_destroy(renderer);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_as_geometry),
        cmocka_unit_test(test_views),
        cmocka_unit_test(test_texture_placement),
        cmocka_unit_test(test_cells_dissolve),
        cmocka_unit_test(test_three_cells),
        cmocka_unit_test(test_crowd_dissolves),
        cmocka_unit_test(test_crowd),
        cmocka_unit_test(test_near_levels),
        cmocka_unit_test(test_near_budget),
        cmocka_unit_test(test_near_budget_inside),
        cmocka_unit_test(test_hidden),
        cmocka_unit_test(test_tints),
        cmocka_unit_test(test_frozen),
    };
    return cmocka_run_group_tests_name("draw_hybrid", tests, open_fixture, close_fixture);
}
