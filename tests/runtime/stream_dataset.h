// A dataset made by hand for tests of streaming: six far walls close the view all round, so that a
// pixel without an object is a hole; and a near ball stands in every cell. With two levels of cells
// a group has three of the walls, and its cells have the other three. Include after models.h.
#pragma once
#include "block.h"
#include "cell_file.h"
#include "file.h"
#include "hierarchy.h"
#include "manifest.h"
#include "mesh_file.h"
#include "rng.h"
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>

#define STREAM_ATLAS      256u // texels a side
#define STREAM_WALL       900.0
#define STREAM_WALL_WIDTH 1100.0 // wider than the hexagon's side
#define STREAM_WALL_UP    900.0
#define STREAM_BALL_LODS  4u

typedef struct stream_dataset {
    char folder[64];
    hw_manifest manifest;
    int32_t levels; // 0: one
    bool colored;   // the walls of a cell have one colour, its own; else they are the same in all
} stream_dataset;

// Which walls a cell has. Not the same ones in all groups: the cell of one and the group of another
// would leave holes.
static bool stream_has_wall(const stream_dataset *d, hw_cell_id id, uint32_t face)
{
    if (d->levels < 2)
        return true;
    hw_cell_id group = hw_cell_ancestor(id, 1);
    return (((uint32_t)(group.q + group.r) + face) & 1) == (uint32_t)id.level;
}

// Of the cell at this place in the manifest.
static void stream_color(uint32_t index, uint8_t color[3])
{
    for (int k = 0; k < 3; k++, index /= 5)
        color[k] = (uint8_t)(20 + index % 5 * 50);
}

// Wall `face` as the capture from this cell's centre sees it.
static void stream_wall(hw_cell *cell, uint32_t face)
{
    uint32_t record = cell->far_count++;
    static const uint32_t pattern[6] = {0, 1, 3, 0, 3, 2};
    hw_vec3 axis, right, up;
    hw_face_basis((int)face, &axis, &right, &up);
    double depth = STREAM_WALL - (double)hw_v3_dot(cell->centre, axis);
    double x = (double)hw_v3_dot(cell->centre, right), y = (double)cell->centre.z;
    float iz = (float)(1 / depth);
    hw_far_record *f = &cell->far[record];
    *f = (hw_far_record){.object_idx = face,
                         .face = face,
                         .x_min = (float)((-STREAM_WALL_WIDTH / 2 - x) / depth),
                         .x_max = (float)((STREAM_WALL_WIDTH / 2 - x) / depth),
                         .y_min = (float)((-STREAM_WALL_UP - y) / depth),
                         .y_max = (float)((STREAM_WALL_UP - y) / depth),
                         .iz_min = iz * 0.5f,
                         .iz_max = iz * 1.5f,
                         .bounds = {{-1300, -1300, -1000}, {1300, 1300, 1000}},
                         .rect = {face * 40 + 4, 4, 32, 240},
                         .first_vertex = record * 4,
                         .vertex_count = 4,
                         .first_index = record * 6,
                         .index_count = 6};
    for (uint32_t i = 0; i < 4; i++)
        cell->vertices[record * 4 + i] =
            (hw_far_vertex){i % 2 ? 65535 : 0, i / 2 ? 65535 : 0, 32767, (uint16_t)record};
    for (uint32_t i = 0; i < 6; i++)
        cell->indices[record * 6 + i] = record * 4 + pattern[i];
    cell->vertex_count += 4;
    cell->index_count += 6;
}

// Balls stand in cells of level 0: object 6 + index.
static void stream_near(const stream_dataset *d, hw_cell *cell)
{
    const hw_hexgrid *grid = &d->manifest.grid;
    hw_cell_id around[7] = {cell->id};
    if (cell->id.level > 0)
        return;
    hw_cell_neighbours(cell->id, around + 1);
    assert_ok(HW_NEW(&cell->near, 7));
    for (uint32_t index = 0; index < hw_hexgrid_cell_count(grid); index++)
        for (int i = 0; i < 7; i++)
            if (hw_hexgrid_contains(grid, around[i]) && hw_hexgrid_index(grid, around[i]) == index)
                cell->near[cell->near_count++] = (hw_near_record){.object_idx = 6 + index};
}

static void stream_paint(const stream_dataset *d, hw_cell *cell)
{
    hw_rng rng = hw_rng_make(7, 0);
    hw_image image = {0};
    uint8_t color[3];
    uint32_t index = 0;
    cell->atlas_width = cell->atlas_height = STREAM_ATLAS;
    assert_true(hw_manifest_find_cell(&d->manifest, cell->id, &index));
    stream_color(index, color);
    assert_ok(hw_image_make(&image, STREAM_ATLAS, STREAM_ATLAS, 3));
    for (uint32_t i = 0; i < STREAM_ATLAS * STREAM_ATLAS * 3; i++) // noise does not compress
        image.data[i] = d->colored ? color[i % 3] : (uint8_t)hw_rng_below(&rng, 256);
    assert_ok(HW_NEW(&cell->atlas_bc1, hw_bc1_bytes(STREAM_ATLAS, STREAM_ATLAS)));
    hw_bc1_encode(&image, cell->atlas_bc1);
    assert_ok(HW_NEW(&cell->coverage_bc4, hw_bc1_bytes(STREAM_ATLAS, STREAM_ATLAS)));
    memset(cell->coverage_bc4, 255, hw_bc1_bytes(STREAM_ATLAS, STREAM_ATLAS));
    hw_image_free(&image);
}

// Returns the bytes of its file.
static uint64_t stream_write_cell(const stream_dataset *d, hw_cell_id id)
{
    hw_cell cell = {
        .id = id, .centre = hw_cell_centre(&d->manifest.grid, id), .key = d->manifest.key};
    char *path = NULL;
    assert_ok(HW_NEW(&cell.far, 6));
    assert_ok(HW_NEW(&cell.vertices, 24));
    assert_ok(HW_NEW(&cell.indices, 36));
    for (uint32_t face = 0; face < 6; face++)
        if (stream_has_wall(d, id, face))
            stream_wall(&cell, face);
    stream_near(d, &cell);
    stream_paint(d, &cell);
    assert_ok(hw_cell_path(&path, d->folder, id));
    assert_ok(hw_cell_write(&cell, path));
    hw_reader *reader = NULL;
    assert_ok(hw_reader_open(&reader, path));
    uint64_t bytes = hw_reader_size(reader);
    hw_reader_close(reader);
    hw_free(path);
    hw_cell_free(&cell);
    return bytes;
}

static void stream_write_ball(const stream_dataset *d)
{
    char path[96];
    hw_mesh levels[STREAM_BALL_LODS];
    hw_mesh_level_info infos[STREAM_BALL_LODS];
    for (uint32_t i = 0; i < STREAM_BALL_LODS; i++) {
        levels[i] = model_sphere(64 >> i, 32 >> i);
        infos[i] = (hw_mesh_level_info){levels[i].vertex_count,
                                        levels[i].index_count,
                                        (float)i * 0.01f,
                                        (float)i * 0.02f,
                                        0,
                                        0};
    }
    snprintf(path, sizeof path, "%s/meshes/0.hxm", d->folder);
    assert_ok(hw_mesh_file_write(path, 1, levels, infos, NULL, STREAM_BALL_LODS));
    for (uint32_t i = 0; i < STREAM_BALL_LODS; i++)
        hw_mesh_free(&levels[i]);
}

static void stream_make(stream_dataset *d)
{
    char path[96];
    hw_manifest *m = &d->manifest;
    hw_cell_id *cells = NULL;
    *m = (hw_manifest){.near_error_px = 0.5, .mesh_count = 1};
    snprintf(d->folder, sizeof d->folder, "stream-XXXXXX");
    assert_non_null(mkdtemp(d->folder));
    snprintf(path, sizeof path, "%s/cells/0", d->folder);
    assert_ok(hw_dir_make(path));
    snprintf(path, sizeof path, "%s/cells/1", d->folder);
    assert_ok(hw_dir_make(path));
    snprintf(path, sizeof path, "%s/meshes", d->folder);
    assert_ok(hw_dir_make(path));
    m->grid = hw_hexgrid_cover(-250, -250, 250, 250, 50, -10, 10);
    m->grid.levels = d->levels ? d->levels : 1;
    assert_ok(hw_hierarchy_cells(&m->grid, &cells, &m->cell_count));
    m->object_count = 6 + hw_hexgrid_cell_count(&m->grid);
    assert_ok(hw_strdup(&m->scene_path, "/nowhere.glb"));
    assert_ok(hw_strdup(&m->policy, "by hand"));
    assert_ok(HW_NEW(&m->objects, m->object_count));
    assert_ok(HW_NEW(&m->cells, m->cell_count));
    for (uint32_t i = 0; i < m->object_count; i++) {
        hw_vec3 c = {0, 0, 0};
        if (i >= 6)
            c = hw_cell_centre(&m->grid, hw_hexgrid_cell(&m->grid, i - 6));
        m->objects[i] = (hw_manifest_object){
            .transform = hw_mat4_translation(c.x + 15, c.y + 15, c.z),
            .bounds = {{c.x + 14, c.y + 14, c.z - 1}, {c.x + 16, c.y + 16, c.z + 1}},
            .color = {0.8f, 0.7f, 0.6f},
            .texture_idx = -1};
    }
    for (uint32_t i = 0; i < m->cell_count; i++)
        m->cells[i].id = cells[i];
    for (uint32_t i = 0; i < m->cell_count; i++)
        m->cells[i].bytes = stream_write_cell(d, cells[i]);
    hw_free(cells);
    stream_write_ball(d);
    assert_ok(hw_manifest_write(d->folder, m));
    hw_manifest_free(m);
    assert_ok(hw_manifest_read(d->folder, m));
}

static int stream_remove_entry(const char *path, const struct stat *info, int type, struct FTW *ftw)
{
    (void)info;
    (void)type;
    (void)ftw;
    return remove(path);
}

static int stream_remove(stream_dataset *d)
{
    hw_manifest_free(&d->manifest);
    return nftw(d->folder, stream_remove_entry, 8, FTW_DEPTH | FTW_PHYS);
}
