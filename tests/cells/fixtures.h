// Small made-up cells, meshes and manifests. Also used by the generator of the fuzz corpus.
#pragma once
#include "alloc.h"
#include "cell_file.h"
#include "file.h"
#include "manifest.h"
#include "mesh_file.h"
#include "rng.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define UNUSED __attribute__((unused))

// Tests cannot go on without their data.
static UNUSED void must(hw_status status)
{
    if (status == HW_OK)
        return;
    fprintf(stderr, "%s: %s\n", hw_status_text(status), hw_error_text());
    abort();
}

// Indices of a `side` x `side` grid of vertices that begins at `first`.
static UNUSED uint32_t grid_indices(uint32_t side, uint32_t first, uint32_t *out)
{
    uint32_t n = 0;
    for (uint32_t y = 0; y + 1 < side; y++) {
        for (uint32_t x = 0; x + 1 < side; x++) {
            uint32_t a = first + y * side + x, b = a + 1, c = a + side, d = c + 1;
            const uint32_t six[6] = {a, b, c, c, b, d};
            memcpy(out + n, six, sizeof six);
            n += 6;
        }
    }
    return n;
}

static UNUSED void fixture_far(hw_cell *cell, uint32_t index, uint32_t side, hw_rng *rng)
{
    hw_far_record *f = &cell->far[index];
    float x = hw_rng_float(rng), y = hw_rng_float(rng), iz = 0.001f + 0.01f * hw_rng_float(rng);
    *f = (hw_far_record){.object_idx = index * 7,
                         .face = index % 6,
                         .cut_out = index % 3 == 1,
                         .x_min = x - 0.5f,
                         .x_max = x + 0.1f,
                         .y_min = y - 0.7f,
                         .y_max = y,
                         .iz_min = iz,
                         .iz_max = iz * 1.5f,
                         .bounds = {{x, y, 0}, {x + 10, y + 20, 30}},
                         .rect = {4 * index, 4, 8, 12 + index % 17},
                         .first_vertex = cell->vertex_count,
                         .vertex_count = side * side,
                         .first_index = cell->index_count};
    for (uint32_t i = 0; i < f->vertex_count; i++) {
        hw_far_vertex *v = &cell->vertices[f->first_vertex + i];
        v->x = (uint16_t)(65535 * (i % side) / (side - 1));
        v->y = (uint16_t)(65535 * (i / side) / (side - 1));
        v->z = (uint16_t)hw_rng_below(rng, 65536);
        v->record = (uint16_t)index;
    }
    f->index_count = grid_indices(side, f->first_vertex, cell->indices + f->first_index);
    cell->vertex_count += f->vertex_count;
    cell->index_count += f->index_count;
}

// Makes an MVMesh of the record: two more views, and two ranges, the second of which no view sees.
static UNUSED void fixture_views(hw_cell *cell, uint32_t index, hw_rng *rng)
{
    hw_far_record *f = &cell->far[index];
    f->view_count = f->range_count = 2;
    f->first_view = cell->view_count;
    f->first_range = cell->range_count;
    for (uint32_t k = 0; k < 2; k++) {
        float x = hw_rng_float(rng), y = hw_rng_float(rng);
        cell->views[cell->view_count++] = (hw_far_view){.eye = {x * 100, y * 100, 12},
                                                        .face = (index + k) % 6,
                                                        .x_min = x,
                                                        .x_max = x + 1,
                                                        .y_min = y - 1,
                                                        .y_max = y,
                                                        .rect = {4 * k, 8, 4 + k, 5}};
    }
    cell->ranges[cell->range_count++] = (hw_far_range){5 + index % 3, f->index_count - 3};
    cell->ranges[cell->range_count++] = (hw_far_range){0, 3};
    cell->color_count = f->first_vertex + f->vertex_count;
    for (uint32_t i = f->first_vertex; i < cell->color_count; i++) {
        uint32_t c = hw_rng_u32(rng);
        cell->colors[i] = (hw_color8){(uint8_t)c, (uint8_t)(c >> 8), (uint8_t)(c >> 16), 255};
    }
}

// far_count records of side x side vertices each, two thirds of them MVMeshes, the others cut out;
// free with hw_cell_free.
static UNUSED void fixture_cell(hw_cell *cell, uint32_t near_count, uint32_t far_count,
                                uint32_t side)
{
    hw_rng rng = hw_rng_make(11, far_count);
    *cell = (hw_cell){.id = {0, 3, -2},
                      .centre = {150, -86.5f, 12},
                      .key = UINT64_C(0x0123456789abcdef),
                      .near_count = near_count,
                      .far_count = far_count};
    must(HW_NEW(&cell->near, near_count));
    must(HW_NEW(&cell->far, far_count));
    must(HW_NEW(&cell->vertices, (size_t)far_count * side * side));
    must(HW_NEW(&cell->indices, (size_t)far_count * (side - 1) * (side - 1) * 6));
    for (uint32_t i = 0; i < near_count; i++)
        cell->near[i] = (hw_near_record){i * 3 + 1, i % 5};
    for (uint32_t i = 0; i < far_count; i++)
        fixture_far(cell, i, side, &rng);
    must(HW_NEW(&cell->views, 2 * (size_t)far_count));
    must(HW_NEW(&cell->ranges, 2 * (size_t)far_count));
    must(HW_NEW(&cell->colors, cell->vertex_count));
    for (uint32_t i = 0; i < far_count; i++) {
        cell->far[i].first_view = cell->view_count;
        cell->far[i].first_range = cell->range_count;
        if (!cell->far[i].cut_out)
            fixture_views(cell, i, &rng);
    }
    if (far_count == 0)
        return;
    cell->atlas_width = 4 * far_count + 8;
    cell->atlas_height = 32;
    size_t bytes = (size_t)cell->atlas_width * cell->atlas_height / 2;
    must(HW_NEW(&cell->atlas_bc1, bytes));
    for (size_t i = 0; i < bytes; i++)
        cell->atlas_bc1[i] = (uint8_t)hw_rng_below(&rng, 8);
    must(HW_NEW(&cell->coverage_bc4, bytes));
    for (size_t i = 0; i < bytes; i++)
        cell->coverage_bc4[i] = (uint8_t)hw_rng_below(&rng, 256);
}

// A bumpy grid of side x side vertices with every attribute (`full`) or positions alone.
static UNUSED void fixture_mesh(hw_mesh *mesh, uint32_t side, bool full)
{
    hw_rng rng = hw_rng_make(5, side);
    uint32_t n = side * side;
    *mesh = (hw_mesh){.vertex_count = n};
    must(HW_NEW(&mesh->positions, n));
    must(HW_NEW(&mesh->indices, (size_t)(side - 1) * (side - 1) * 6));
    mesh->index_count = grid_indices(side, 0, mesh->indices);
    for (uint32_t i = 0; i < n; i++)
        mesh->positions[i] = hw_v3((float)(i % side), (float)(i / side), hw_rng_float(&rng));
    if (!full)
        return;
    must(HW_NEW(&mesh->normals, n));
    must(HW_NEW(&mesh->colors, n));
    must(HW_NEW(&mesh->uvs, n));
    for (uint32_t i = 0; i < n; i++) {
        float x = hw_rng_float(&rng) - 0.5f, y = hw_rng_float(&rng) - 0.5f;
        mesh->normals[i] = hw_v3_normalize(hw_v3(x, y, hw_rng_float(&rng) - 0.5f));
        uint32_t c = hw_rng_u32(&rng);
        mesh->colors[i] = (hw_color8){(uint8_t)c, (uint8_t)(c >> 8), (uint8_t)(c >> 16), 255};
        mesh->uvs[i] = (hw_uv){x, y};
    }
}

// Up to HW_INNER_BOXES_MAX boxes within the mesh's bounds; the first are the bounds and a point.
static UNUSED void fixture_boxes(hw_inner_boxes *boxes, const hw_mesh *mesh, uint32_t count)
{
    hw_box all = hw_mesh_bounds(mesh);
    *boxes = (hw_inner_boxes){.count = count};
    for (uint32_t i = 0; i < count; i++) {
        hw_vec3 size = hw_v3_scale(hw_box_size(all), i == 0 ? 1 : 0.1f * (float)(i - 1));
        boxes->boxes[i] = (hw_box){all.min, i == 0 ? all.max : hw_v3_add(all.min, size)};
    }
}

#define FIXTURE_LEVELS 3
static UNUSED void fixture_levels(hw_mesh levels[FIXTURE_LEVELS],
                                  hw_mesh_level_info infos[FIXTURE_LEVELS], uint32_t side)
{
    for (uint32_t i = 0; i < FIXTURE_LEVELS; i++) {
        fixture_mesh(&levels[i], side - i, i < 2);
        infos[i] = (hw_mesh_level_info){levels[i].vertex_count,
                                        levels[i].index_count,
                                        0.5f * i,
                                        1.5f * i,
                                        0.25f * i,
                                        0.125f * i};
    }
}

static UNUSED void fixture_manifest(hw_manifest *m, uint32_t objects, uint32_t cells)
{
    hw_rng rng = hw_rng_make(3, 1);
    *m = (hw_manifest){.scene_hash = UINT64_C(0xfedcba9876543210),
                       .key = 42,
                       .scene_triangles = 8460000,
                       .self_occlusion_px = 20,
                       .edge_length_px = 4.5,
                       .near_error_px = 0.3,
                       .build_seconds = 12.375,
                       .mesh_bytes = UINT64_C(5000000000),
                       .texture_bytes = 77,
                       .near_bytes = 123456,
                       .mesh_count = 4,
                       .texture_count = 2,
                       .object_count = objects,
                       .cell_count = cells};
    m->grid = hw_hexgrid_cover(-825, -1017.5, 825, 1017.5, 50, 0, 24);
    m->ground = (hw_ground){true, {{-900, -1100, 0}, {900, 1100, 0}}, {0.1f, 0.6f, 0.2f}};
    must(hw_strdup(&m->scene_path, "/data/park \"8m\".glb"));
    must(hw_strdup(&m->policy, "screen"));
    must(HW_NEW(&m->objects, objects));
    must(HW_NEW(&m->cells, cells));
    for (uint32_t i = 0; i < objects; i++) {
        float x = hw_rng_float(&rng) * 1000, y = hw_rng_float(&rng) / 3;
        m->objects[i] = (hw_manifest_object){.mesh_idx = i % 4,
                                             .texture_idx = (int32_t)(i % 3) - 1,
                                             .bounds = {{x, y, 0}, {x + 1, y + 1, 2}},
                                             .color = {0.3f, y, 1}};
        m->objects[i].transform = hw_mat4_mul(hw_mat4_translation((double)x, (double)y, 1.0 / 3),
                                              hw_mat4_rotation_z(0.1 * i));
    }
    for (uint32_t i = 0; i < cells; i++)
        m->cells[i] = (hw_manifest_cell){hw_hexgrid_cell(&m->grid, i * 5), 1000 + i};
}

// Reads a whole file that a test has just written.
static UNUSED uint8_t *read_bytes(const char *path, size_t *size)
{
    uint8_t *bytes = NULL;
    must(hw_file_read(path, 0, &bytes, size));
    return bytes;
}

// Not by hw_file_write, which syncs: tests write thousands of damaged files.
static UNUSED void write_bytes(const char *path, const void *bytes, size_t size)
{
    FILE *file = fopen(path, "wb");
    if (!file || fwrite(bytes, 1, size, file) != size || fclose(file) != 0) {
        perror(path);
        abort();
    }
}
