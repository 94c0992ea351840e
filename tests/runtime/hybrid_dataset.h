// A small dataset made by hand, for tests of configuration C: near objects of several kinds, and
// two far rectangles that are seen from the home cell.
#pragma once
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

#define UNUSED __attribute__((unused))

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

static UNUSED void basis(hw_vec3 *axis, hw_vec3 *right, hw_vec3 *up)
{
    hw_face_basis(FACE, axis, right, up);
}

static UNUSED hw_vec3 quad_point(const far_quad *quad, hw_vec3 centre, double u, double v)
{
    hw_vec3 a, r, up;
    basis(&a, &r, &up);
    double wx = quad->x_min + u * (quad->x_max - quad->x_min);
    double wy = quad->y_min + v * (quad->y_max - quad->y_min);
    hw_vec3 d = hw_v3_mad(hw_v3_mad(a, r, (float)wx), up, (float)wy);
    return hw_v3_mad(centre, d, quad->depth);
}

// Field i of a quad as a mesh of its own.
static UNUSED hw_mesh quad_field(const far_quad *quad, hw_vec3 centre, int i)
{
    hw_mesh mesh = model_mesh(4, 6);
    double u = i % 2 * 0.5, v = i / 2 * 0.5;
    hw_vec3 corner = quad_point(quad, centre, u, v);
    model_face(&mesh, 0, corner, hw_v3_sub(quad_point(quad, centre, u + 0.5, v), corner),
               hw_v3_sub(quad_point(quad, centre, u, v + 0.5), corner));
    return mesh;
}

static UNUSED hw_mesh textured_board(void)
{
    hw_mesh mesh = model_mesh(4, 6);
    assert_ok(HW_NEW(&mesh.uvs, 4));
    model_face(&mesh, 0, hw_v3(-4, 0, -4), hw_v3(8, 0, 0), hw_v3(0, 0, 8));
    return mesh;
}

// Meshes 0 cube, 1 sphere, 2 board; then the fields of the quads. Objects likewise.
enum { CUBE, SPHERE, BOARD, NEAR_OBJECTS };
#define CUBE_LEAST 4u // triangles of its coarser level
#define OBJECTS    (NEAR_OBJECTS + 8)

static UNUSED void make_scene(fixture *f, hw_vec3 centre)
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

static UNUSED void make_manifest(fixture *f)
{
    hw_manifest *m = &f->manifest;
    const hw_scene *s = &f->scene;
    m->near_error_px = NEAR_PX;
    m->multi_view = true;
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

static UNUSED void write_mesh(const fixture *f, uint32_t idx, const hw_mesh *levels,
                              const hw_mesh_level_info *infos, uint32_t count)
{
    char *path = NULL;
    hw_inner_boxes boxes[HW_MESH_LEVELS_MAX] = {{.count = 0}};
    for (uint32_t i = 0; i < count; i++) {
        bool solid;
        assert_ok(hw_mesh_is_solid(&levels[i], &solid));
        if (solid)
            assert_ok(hw_inner_boxes_find(&levels[i], &boxes[i]));
    }
    assert_ok(hw_mesh_path(&path, f->folder, idx));
    assert_ok(hw_mesh_file_write(path, 1, levels, infos, boxes, count));
    hw_free(path);
}

static UNUSED void write_meshes(const fixture *f)
{
    char path[96];
    for (uint32_t i = 0; i < NEAR_OBJECTS; i++) {
        const hw_mesh *mesh = &f->scene.meshes[i];
        const hw_mesh_level_info info = {mesh->vertex_count, mesh->index_count, 0, 0, 0, 0};
        if (i == BOARD)
            write_mesh(f, i, mesh, &info, 1);
    }
    // A few faces stand for the cube where next to nothing is left of the budget of triangles.
    hw_mesh cubes[2] = {f->scene.meshes[CUBE], f->scene.meshes[CUBE]};
    cubes[1].index_count = 3 * CUBE_LEAST;
    const hw_mesh_level_info cube_infos[2] = {
        {.vertex_count = cubes[0].vertex_count, .index_count = cubes[0].index_count},
        {.vertex_count = cubes[1].vertex_count,
         .index_count = cubes[1].index_count,
         .error_rms = 20,
         .error_p99 = 20}};
    write_mesh(f, CUBE, cubes, cube_infos, 2);
    hw_mesh levels[SPHERE_LODS];
    hw_mesh_level_info infos[SPHERE_LODS];
    for (uint32_t i = 0; i < SPHERE_LODS; i++) {
        levels[i] = model_sphere(64 >> i, 32 >> i);
        // Errors are 0.02 i: that of level 1 is in its surface, that of level 2 in its shading.
        infos[i] =
            (hw_mesh_level_info){.vertex_count = levels[i].vertex_count,
                                 .index_count = levels[i].index_count,
                                 .error_rms = i ? 0.01f : 0,
                                 .error_p99 = i ? 0.02f : 0,
                                 .error_shading = i > 1 ? 0.02f * i / HW_MESH_SHADING_WEIGHT : 0};
    }
    write_mesh(f, SPHERE, levels, infos, SPHERE_LODS);
    for (uint32_t i = 0; i < SPHERE_LODS; i++)
        hw_mesh_free(&levels[i]);
    snprintf(path, sizeof path, "%s/meshes/texture_0.png", f->folder);
    assert_ok(hw_image_write(path, &f->scene.materials[BOARD].texture));
}

// Fills the atlas: magenta, with each quad's fields at their place, row 0 at the bottom, spread by
// 4 texels beyond the rectangle as captures are.
static UNUSED void paint_atlas(hw_cell *cell)
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
static UNUSED hw_cell make_cell(const fixture *f, hw_cell_id id, bool with_far)
{
    hw_cell cell = {
        .id = id, .centre = hw_cell_centre(&f->manifest.grid, id), .key = f->manifest.key};
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
    return cell;
}

// Frees it.
static UNUSED void save_cell(const fixture *f, hw_cell *cell)
{
    char *path = NULL;
    assert_ok(hw_cell_path(&path, f->folder, cell->id));
    assert_ok(hw_cell_write(cell, path));
    hw_free(path);
    hw_cell_free(cell);
}

static UNUSED void write_cell(const fixture *f, hw_cell_id id, bool with_far)
{
    hw_cell cell = make_cell(f, id, with_far);
    save_cell(f, &cell);
}

static UNUSED int remove_entry(const char *path, const struct stat *info, int type, struct FTW *ftw)
{
    (void)info;
    (void)type;
    (void)ftw;
    return remove(path);
}

static UNUSED int open_fixture(void **state)
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

static UNUSED int close_fixture(void **state)
{
    fixture *f = *state;
    hw_target_destroy(f->target);
    hw_scene_free(&f->scene);
    hw_manifest_free(&f->manifest);
    hw_context_destroy(f->context);
    return nftw(f->folder, remove_entry, 8, FTW_DEPTH | FTW_PHYS);
}

static UNUSED hw_renderer *open_renderer(const fixture *f)
{
    const hw_renderer_desc desc = {.config = HW_CONFIG_C, .dataset = f->folder};
    hw_renderer *renderer = NULL;
    assert_ok(hw_renderer_create(&desc, &renderer));
    return renderer;
}

// Looks along the face's axis from an eye off the centre of the home cell.
static UNUSED hw_camera view(const fixture *f, float dx, float dy, float dz)
{
    hw_vec3 axis, right, up;
    basis(&axis, &right, &up);
    hw_vec3 c = hw_cell_centre(&f->manifest.grid, hw_hexgrid_locate(&f->manifest.grid, 0, 0));
    return model_camera(hw_v3_add(c, hw_v3(dx, dy, dz)), axis, SIZE);
}

static UNUSED hw_image render(const fixture *f, hw_renderer *renderer, const hw_camera *camera,
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
