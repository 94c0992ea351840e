// Configuration C on a dataset made by hand: it must look as the same scene does in B.
#include "models.h"

#include "block.h"
#include "cell_file.h"
#include "cull.h"
#include "file.h"
#include "image_io.h"
#include "manifest.h"
#include "mesh_file.h"
#include "rng.h"
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#define SIZE        256u
#define FACE        1 // looks along +y
#define ATLAS       128u
#define NEAR_PX     0.5
#define SPHERE_LODS 3

// Colours that BC1 holds exactly.
static const uint8_t palette[6][3] = {{66, 0, 0},   {0, 65, 0},  {0, 0, 66},
                                      {66, 65, 66}, {66, 65, 0}, {0, 65, 66}};

// A far object: a flat rectangle across the view at `depth`, of 2 x 2 fields in the atlas.
typedef struct far_quad {
    float depth, x_min, x_max, y_min, y_max; // image space at distance 1
    hw_rect rect;
    uint8_t colors[4]; // lower left, lower right, upper left, upper right
} far_quad;
static const far_quad quads[2] = {
    {100, -0.4f, 0.2f, -0.1f, 0.35f, {8, 16, 64, 48}, {0, 1, 2, 3}},
    {60, 0.05f, 0.30f, -0.05f, 0.20f, {80, 72, 32, 32}, {4, 0, 5, 2}},
};

typedef struct fixture {
    hw_context *context;
    hw_target *target;
    char folder[64];
    hw_scene scene; // the truth
    hw_manifest manifest;
} fixture;

// ---- the scene and its dataset ---------------------------------------------------------------

static void basis(hw_vec3 *axis, hw_vec3 *right, hw_vec3 *up)
{
    hw_face_basis(FACE, axis, right, up);
}

static hw_vec3 quad_point(const far_quad *quad, hw_vec3 centre, double u, double v)
{
    hw_vec3 a, r, up;
    basis(&a, &r, &up);
    double wx = quad->x_min + u * (quad->x_max - quad->x_min);
    double wy = quad->y_min + v * (quad->y_max - quad->y_min);
    hw_vec3 d = hw_v3_mad(hw_v3_mad(a, r, (float)wx), up, (float)wy);
    return hw_v3_mad(centre, d, quad->depth);
}

// Field i of a quad as a mesh of its own.
static hw_mesh quad_field(const far_quad *quad, hw_vec3 centre, int i)
{
    hw_mesh mesh = model_mesh(4, 6);
    double u = i % 2 * 0.5, v = i / 2 * 0.5;
    hw_vec3 corner = quad_point(quad, centre, u, v);
    model_face(&mesh, 0, corner, hw_v3_sub(quad_point(quad, centre, u + 0.5, v), corner),
               hw_v3_sub(quad_point(quad, centre, u, v + 0.5), corner));
    return mesh;
}

static hw_mesh textured_board(void)
{
    hw_mesh mesh = model_mesh(4, 6);
    assert_ok(HW_NEW(&mesh.uvs, 4));
    model_face(&mesh, 0, hw_v3(-4, 0, -4), hw_v3(8, 0, 0), hw_v3(0, 0, 8));
    return mesh;
}

// Meshes 0 cube, 1 sphere, 2 board; then the fields of the quads. Objects likewise.
enum { CUBE, SPHERE, BOARD, NEAR_OBJECTS };
#define OBJECTS (NEAR_OBJECTS + 8)

static void make_scene(fixture *f, hw_vec3 centre)
{
    hw_vec3 axis, right, up;
    basis(&axis, &right, &up);
    float light = hw_light(hw_v3_scale(axis, -1));
    f->scene = model_scene(OBJECTS, OBJECTS);
    hw_scene *s = &f->scene;
    s->meshes[CUBE] = model_box(hw_v3(6, 6, 6));
    s->meshes[SPHERE] = model_sphere(64, 32);
    s->meshes[BOARD] = textured_board();
    for (int i = 0; i < 8; i++)
        s->meshes[NEAR_OBJECTS + i] = quad_field(&quads[i / 4], centre, i % 4);
    for (uint32_t i = 0; i < OBJECTS; i++) {
        s->objects[i].mesh_idx = s->objects[i].material_idx = i;
        if (i < NEAR_OBJECTS)
            continue;
        uint32_t q = (i - NEAR_OBJECTS) / 4, k = (i - NEAR_OBJECTS) % 4;
        for (int c = 0; c < 3; c++)
            s->materials[i].base_color[c] = palette[quads[q].colors[k]][c] / 255.0f / light;
    }
    s->materials[CUBE].base_color[1] = 0.3f;
    hw_vec3 cube = hw_v3_mad(hw_v3_mad(centre, axis, 80), right, 14);
    s->objects[CUBE].transform =
        hw_mat4_mul(hw_mat4_translation(cube.x, cube.y, cube.z), hw_mat4_rotation_z(0.4));
    hw_vec3 sphere = hw_v3_mad(hw_v3_mad(centre, axis, 40), right, -12);
    s->objects[SPHERE].transform =
        hw_mat4_mul(hw_mat4_translation(sphere.x, sphere.y, sphere.z), hw_mat4_scale(-3, 3, 4));
    hw_vec3 board = hw_v3_mad(hw_v3_mad(centre, axis, 50), up, -12);
    s->objects[BOARD].transform = hw_mat4_translation(board.x, board.y, board.z);
    assert_ok(hw_image_make(&s->materials[BOARD].texture, 16, 16, 3));
    for (uint32_t i = 0; i < 256 * 3; i++)
        s->materials[BOARD].texture.data[i] = (uint8_t)(i % 3 == 0   ? i / 3 % 16 * 15
                                                        : i % 3 == 1 ? i / 48 * 15
                                                                     : 60);
    s->ground = (hw_ground){true, {{-600, -600, -20}, {600, 600, -20}}, {0.3f, 0.4f, 0.3f}};
    hw_scene_update_bounds(s);
}

static void make_manifest(fixture *f)
{
    hw_manifest *m = &f->manifest;
    const hw_scene *s = &f->scene;
    m->near_error_px = NEAR_PX;
    assert_ok(hw_strdup(&m->scene_path, "/nowhere.glb"));
    assert_ok(hw_strdup(&m->policy, "by hand"));
    m->ground = s->ground;
    m->mesh_count = OBJECTS;
    m->texture_count = 1;
    m->object_count = OBJECTS;
    m->cell_count = hw_hexgrid_cell_count(&m->grid);
    assert_ok(HW_NEW(&m->objects, m->object_count));
    assert_ok(HW_NEW(&m->cells, m->cell_count));
    for (uint32_t i = 0; i < OBJECTS; i++) {
        hw_manifest_object *o = &m->objects[i];
        *o = (hw_manifest_object){.mesh_idx = i,
                                  .transform = s->objects[i].transform,
                                  .bounds = s->objects[i].bounds,
                                  .texture_idx = i == BOARD ? 0 : -1};
        memcpy(o->color, s->materials[i].base_color, sizeof o->color);
    }
    for (uint32_t i = 0; i < m->cell_count; i++)
        m->cells[i].id = hw_hexgrid_cell(&m->grid, i);
    assert_ok(hw_manifest_write(f->folder, m));
}

static void write_mesh(const fixture *f, uint32_t idx, const hw_mesh *levels,
                       const hw_mesh_level_info *infos, uint32_t count)
{
    char *path = NULL;
    assert_ok(hw_mesh_path(&path, f->folder, idx));
    assert_ok(hw_mesh_file_write(path, 1, levels, infos, count));
    hw_free(path);
}

static void write_meshes(const fixture *f)
{
    char path[96];
    for (uint32_t i = 0; i < NEAR_OBJECTS; i++) {
        const hw_mesh *mesh = &f->scene.meshes[i];
        const hw_mesh_level_info info = {mesh->vertex_count, mesh->index_count, 0, 0, 0};
        if (i != SPHERE)
            write_mesh(f, i, mesh, &info, 1);
    }
    hw_mesh levels[SPHERE_LODS];
    hw_mesh_level_info infos[SPHERE_LODS];
    for (uint32_t i = 0; i < SPHERE_LODS; i++) {
        levels[i] = model_sphere(64 >> i, 32 >> i);
        infos[i] = (hw_mesh_level_info){levels[i].vertex_count, levels[i].index_count, i * 0.01f,
                                        i * 0.02f, 0};
    }
    write_mesh(f, SPHERE, levels, infos, SPHERE_LODS);
    for (uint32_t i = 0; i < SPHERE_LODS; i++)
        hw_mesh_free(&levels[i]);
    snprintf(path, sizeof path, "%s/meshes/texture_0.png", f->folder);
    assert_ok(hw_image_write(path, &f->scene.materials[BOARD].texture));
}

// Fills the atlas: magenta, with each quad's fields at their place, row 0 at the bottom, spread by
// 4 texels beyond the rectangle as captures are.
static void paint_atlas(hw_cell *cell)
{
    hw_image image = {0};
    assert_ok(hw_image_make(&image, ATLAS, ATLAS, 3));
    memset(image.data, 200, (size_t)ATLAS * ATLAS * 3);
    for (int q = 0; q < 2; q++) {
        hw_rect r = quads[q].rect;
        for (uint32_t y = r.y - 4; y < r.y + r.height + 4; y++) {
            for (uint32_t x = r.x - 4; x < r.x + r.width + 4; x++) {
                int field = (y >= r.y + r.height / 2) * 2 + (x >= r.x + r.width / 2);
                memcpy(image.data + ((size_t)y * ATLAS + x) * 3, palette[quads[q].colors[field]],
                       3);
            }
        }
    }
    cell->atlas_width = cell->atlas_height = ATLAS;
    assert_ok(HW_NEW(&cell->atlas_bc1, hw_bc1_bytes(ATLAS, ATLAS)));
    hw_bc1_encode(&image, cell->atlas_bc1);
    assert_ok(HW_NEW(&cell->coverage_bc4, hw_bc1_bytes(cell->atlas_width, cell->atlas_height)));
    memset(cell->coverage_bc4, 255, hw_bc1_bytes(cell->atlas_width, cell->atlas_height));
    hw_image_free(&image);
}

// The cell with all near objects; far ones only in the cell they were made for.
static void write_cell(const fixture *f, hw_cell_id id, bool with_far)
{
    hw_cell cell = {.id = id, .centre = hw_cell_centre(&f->manifest.grid, id), .key = 1};
    char *path = NULL;
    cell.near_count = NEAR_OBJECTS;
    assert_ok(HW_NEW(&cell.near, NEAR_OBJECTS));
    for (uint32_t i = 0; i < NEAR_OBJECTS; i++)
        cell.near[i].object_idx = i;
    cell.far_count = with_far ? 2 : 0;
    cell.vertex_count = cell.far_count * 4;
    cell.index_count = cell.far_count * 6;
    assert_ok(HW_NEW(&cell.far, cell.far_count));
    assert_ok(HW_NEW(&cell.vertices, cell.vertex_count));
    assert_ok(HW_NEW(&cell.indices, cell.index_count));
    for (uint32_t q = 0; q < cell.far_count; q++) {
        static const uint32_t pattern[6] = {0, 1, 3, 0, 3, 2};
        const far_quad *quad = &quads[q];
        float iz = 1 / quad->depth;
        // The depth range is wider than the flat quad: iz lies at 1/4 or 3/4 of it.
        float low = q == 0 ? 0.9f : 0.7f;
        uint16_t z = q == 0 ? 16384 : 49151;
        cell.far[q] = (hw_far_record){.object_idx = NEAR_OBJECTS + q * 4,
                                      .face = FACE,
                                      .x_min = quad->x_min,
                                      .x_max = quad->x_max,
                                      .y_min = quad->y_min,
                                      .y_max = quad->y_max,
                                      .iz_min = iz * low,
                                      .iz_max = iz * (low + 0.4f),
                                      .bounds = hw_box_empty(),
                                      .rect = quad->rect,
                                      .first_vertex = q * 4,
                                      .vertex_count = 4,
                                      .first_index = q * 6,
                                      .index_count = 6};
        for (uint32_t i = 0; i < 4; i++) {
            hw_box_add(&cell.far[q].bounds, quad_point(quad, cell.centre, i % 2, i / 2));
            cell.vertices[q * 4 + i] =
                (hw_far_vertex){i % 2 ? 65535 : 0, i / 2 ? 65535 : 0, z, (uint16_t)q};
        }
        for (uint32_t i = 0; i < 6; i++)
            cell.indices[q * 6 + i] = q * 4 + pattern[i];
    }
    if (with_far)
        paint_atlas(&cell);
    assert_ok(hw_cell_path(&path, f->folder, id));
    assert_ok(hw_cell_write(&cell, path));
    hw_free(path);
    hw_cell_free(&cell);
}

static int remove_entry(const char *path, const struct stat *info, int type, struct FTW *ftw)
{
    (void)info;
    (void)type;
    (void)ftw;
    return remove(path);
}

static int open_fixture(void **state)
{
    static fixture f;
    char path[96];
    assert_int_equal(model_context_open((void **)&f.context), 0);
    assert_ok(hw_target_create(&f.target, SIZE, SIZE, 1));
    snprintf(f.folder, sizeof f.folder, "hybrid-XXXXXX");
    assert_non_null(mkdtemp(f.folder));
    snprintf(path, sizeof path, "%s/cells/0", f.folder);
    assert_ok(hw_dir_make(path));
    snprintf(path, sizeof path, "%s/meshes", f.folder);
    assert_ok(hw_dir_make(path));
    f.manifest.grid = hw_hexgrid_cover(-200, -200, 200, 200, 50, -10, 10);
    hw_cell_id home = hw_hexgrid_locate(&f.manifest.grid, 0, 0);
    make_scene(&f, hw_cell_centre(&f.manifest.grid, home));
    make_manifest(&f);
    write_meshes(&f);
    for (uint32_t i = 0; i < f.manifest.cell_count; i++) {
        hw_cell_id id = f.manifest.cells[i].id;
        write_cell(&f, id, id.q == home.q && id.r == home.r);
    }
    *state = &f;
    return 0;
}

static int close_fixture(void **state)
{
    fixture *f = *state;
    hw_target_destroy(f->target);
    hw_scene_free(&f->scene);
    hw_manifest_free(&f->manifest);
    hw_context_destroy(f->context);
    return nftw(f->folder, remove_entry, 8, FTW_DEPTH | FTW_PHYS);
}

static hw_renderer *open_renderer(const fixture *f)
{
    const hw_renderer_desc desc = {.config = HW_CONFIG_C, .dataset = f->folder};
    hw_renderer *renderer = NULL;
    assert_ok(hw_renderer_create(&desc, &renderer));
    return renderer;
}

// Looks along the face's axis from an eye off the centre of the home cell.
static hw_camera view(const fixture *f, float dx, float dy, float dz)
{
    hw_vec3 axis, right, up;
    basis(&axis, &right, &up);
    hw_vec3 c = hw_cell_centre(&f->manifest.grid, hw_hexgrid_locate(&f->manifest.grid, 0, 0));
    return model_camera(hw_v3_add(c, hw_v3(dx, dy, dz)), axis, SIZE);
}

static hw_image render(const fixture *f, hw_renderer *renderer, const hw_camera *camera,
                       hw_frame_stats *stats)
{
    hw_image image = {0};
    hw_target_bind(f->target);
    assert_ok(hw_renderer_prepare(renderer, camera, NULL));
    assert_ok(hw_renderer_draw(renderer, camera, stats));
    assert_ok(hw_target_read(f->target, &image));
    return image;
}

// ---- a crowd of far objects --------------------------------------------------------------------

// Small upright squares all round the cell in six colours, more than two uniform blocks hold; the
// same as a scene.
#define CROWD 450u

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
            (hw_far_record){.face = s.face,
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

// Inside a strip along the border each pixel is that of one cell or the other, the share of the
// other rises to one half on the border, and what is near in both cells is whole. Only the home
// cell has far objects.
static void test_cells_dissolve(void **state)
{
    fixture *f = *state;
    hw_cell_id home = hw_hexgrid_locate(&f->manifest.grid, 0, 0), other;
    hw_vec3 centre = hw_cell_centre(&f->manifest.grid, home);
    hw_renderer *hard = open_renderer(f), *soft;
    const hw_renderer_desc desc = {
        .config = HW_CONFIG_C, .dataset = f->folder, .crossing_width = 0.2};
    assert_ok(hw_renderer_create(&desc, &soft));
    const double border = hw_cell_border(&f->manifest.grid, home, centre.x, centre.y, &other);
    hw_vec3 out = hw_v3_normalize(hw_v3_sub(hw_cell_centre(&f->manifest.grid, other), centre));
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
    hw_renderer_destroy(hard);
    hw_renderer_destroy(soft);
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

static void test_draw_allocates_nothing(void **state)
{
    fixture *f = *state;
    hw_renderer *renderer = open_renderer(f);
    for (int i = 0; i < 12; i++) {
        hw_camera camera = view(f, (float)i * 30 - 180, 0, 0);
        hw_frame_stats stats;
        hw_target_bind(f->target);
        assert_ok(hw_renderer_prepare(renderer, &camera, NULL));
        hw_alloc_fail_after(0);
        assert_ok(hw_renderer_draw(renderer, &camera, &stats));
        assert_int_equal(hw_alloc_count(), 0);
        assert_int_equal(stats.stalls, 0);
        assert_int_equal(stats.loaded_bytes, 0);
    }
    hw_renderer_destroy(renderer);
}

// Cells come on demand, and stay while there is room.
static void test_cells_come(void **state)
{
    fixture *f = *state;
    hw_renderer *renderer = open_renderer(f);
    hw_frame_stats stats;
    uint64_t first_round = 0;
    hw_target_bind(f->target);
    assert_true(f->manifest.cell_count > 20);
    for (int round = 0; round < 3; round++) {
        for (uint32_t i = 0; i < f->manifest.cell_count; i++) {
            hw_cell_id id = f->manifest.cells[i].id;
            hw_vec3 c = hw_cell_centre(&f->manifest.grid, id);
            hw_camera camera = model_camera(c, hw_v3(0, 1, 0), SIZE);
            assert_ok(hw_renderer_draw(renderer, &camera, &stats)); // without prepare: it waits
            assert_int_equal(stats.cell_q, id.q);
            assert_int_equal(stats.cell_r, id.r);
            assert_int_equal(stats.stalls, round == 0);
            assert_true(round > 0 || (stats.loaded_bytes > 0 && stats.load_ms > 0));
            assert_ok(hw_renderer_draw(renderer, &camera, &stats));
            assert_int_equal(stats.stalls, 0);
        }
        // A step back is free.
        hw_vec3 c =
            hw_cell_centre(&f->manifest.grid, f->manifest.cells[f->manifest.cell_count - 2].id);
        hw_camera camera = model_camera(c, hw_v3(0, 1, 0), SIZE);
        assert_ok(hw_renderer_prepare(renderer, &camera, &stats));
        assert_int_equal(stats.stalls, 0);
        if (round == 0)
            first_round = hw_renderer_gpu_bytes(renderer);
        assert_true(hw_renderer_gpu_bytes(renderer) <= first_round);
    }
    hw_renderer_destroy(renderer);
}

// Runs the function with the file replaced (or missing, with data NULL); puts it back.
static void check_broken(fixture *f, const char *name, const void *data, size_t size,
                         hw_status wanted)
{
    char path[96];
    uint8_t *saved = NULL;
    size_t saved_size;
    const hw_renderer_desc desc = {.config = HW_CONFIG_C, .dataset = f->folder};
    hw_camera camera = view(f, 0, 0, 0);
    hw_renderer *renderer = NULL;
    snprintf(path, sizeof path, "%s/%s", f->folder, name);
    assert_ok(hw_file_read(path, 0, &saved, &saved_size));
    if (data)
        assert_ok(hw_file_write(path, data, size));
    else
        assert_int_equal(unlink(path), 0);
    hw_status status = hw_renderer_create(&desc, &renderer);
    if (status == HW_OK)
        status = hw_renderer_prepare(renderer, &camera, NULL);
    if (status == HW_OK || (wanted != HW_OK && status != wanted))
        fail_msg("%s: %s (%s)", name, hw_status_text(status), hw_error_text());
    if (!strstr(hw_error_text(), name))
        fail_msg("\"%s\" does not name %s", hw_error_text(), name);
    assert_ok(hw_file_write(path, saved, saved_size));
    if (renderer) {
        // The renderer survives, and goes on once the file is there.
        hw_target_bind(f->target);
        assert_ok(hw_renderer_draw(renderer, &camera, NULL));
    }
    hw_renderer_destroy(renderer);
    hw_free(saved);
}

static void test_broken_files(void **state)
{
    fixture *f = *state;
    char cell[64], path[96];
    hw_cell_id home = hw_hexgrid_locate(&f->manifest.grid, 0, 0);
    snprintf(cell, sizeof cell, "cells/0/%d_%d.hxc", home.q, home.r);
    const char *const names[] = {"manifest.json", "meshes/0.hxm", "meshes/1.hxm",
                                 "meshes/texture_0.png", cell};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        uint8_t *data = NULL;
        size_t size;
        // hw_image_read has its own words for a missing image.
        if (i != 0)
            check_broken(f, names[i], NULL, 0, i == 3 ? HW_OK : HW_NOT_FOUND);
        check_broken(f, names[i], "rubbish", 7, HW_OK);
        snprintf(path, sizeof path, "%s/%s", f->folder, names[i]);
        assert_ok(hw_file_read(path, 0, &data, &size));
        check_broken(f, names[i], data, size / 2, HW_OK);
        hw_free(data);
    }
    hw_renderer *renderer = NULL;
    const hw_renderer_desc nowhere = {.config = HW_CONFIG_C, .dataset = "no-such-folder"};
    assert_int_equal(hw_renderer_create(&nowhere, &renderer), HW_NOT_FOUND);
    assert_non_null(strstr(hw_error_text(), "no-such-folder"));
}

// A cell of another place, or with objects the manifest does not have.
static void test_cells_that_do_not_belong(void **state)
{
    fixture *f = *state;
    char name[64], path[96];
    hw_cell_id home = hw_hexgrid_locate(&f->manifest.grid, 0, 0);
    snprintf(name, sizeof name, "cells/0/%d_%d.hxc", home.q, home.r);
    snprintf(path, sizeof path, "%s/other.hxc", f->folder);
    hw_near_record near = {OBJECTS, 0};
    for (int i = 0; i < 2; i++) {
        hw_cell cell = {.id = home, .near_count = (uint32_t)i, .near = &near};
        cell.id.q += i == 0;
        uint8_t *data = NULL;
        size_t size;
        assert_ok(hw_cell_write(&cell, path));
        assert_ok(hw_file_read(path, 0, &data, &size));
        check_broken(f, name, data, size, HW_FORMAT);
        hw_free(data);
    }
}

static void test_failing_allocations(void **state)
{
    fixture *f = *state;
    const hw_renderer_desc desc = {.config = HW_CONFIG_C, .dataset = f->folder};
    hw_camera camera = view(f, 0, 0, 0);
    hw_target_bind(f->target);
    for (uint64_t n = 1;; n++) {
        hw_renderer *renderer = NULL;
        hw_alloc_fail_after(n);
        hw_status status = hw_renderer_create(&desc, &renderer);
        if (status == HW_OK)
            status = hw_renderer_draw(renderer, &camera, NULL);
        bool passed = hw_alloc_count() < n;
        hw_alloc_fail_after(0);
        if (renderer) // whatever failed, it can go on
            assert_ok(hw_renderer_draw(renderer, &camera, NULL));
        hw_renderer_destroy(renderer);
        if (passed)
            break;
        assert_true(n < 5000);
    }
}

// ---- debug views --------------------------------------------------------------------------------

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
        cmocka_unit_test(test_texture_placement),
        cmocka_unit_test(test_cells_dissolve),
        cmocka_unit_test(test_crowd),
        cmocka_unit_test(test_near_levels),
        cmocka_unit_test(test_near_budget),
        cmocka_unit_test(test_draw_allocates_nothing),
        cmocka_unit_test(test_cells_come),
        cmocka_unit_test(test_broken_files),
        cmocka_unit_test(test_cells_that_do_not_belong),
        cmocka_unit_test(test_failing_allocations),
        cmocka_unit_test(test_tints),
        cmocka_unit_test(test_frozen),
    };
    return cmocka_run_group_tests_name("draw_hybrid", tests, open_fixture, close_fixture);
}
