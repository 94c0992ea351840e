#include "cell_gpu.h"
#include "alloc.h"
#include "file.h"
#include <math.h>
#include <string.h>

// Sectors round the cell centre: records of one sector are drawn front to back, and the sectors in
// view are few long ranges of indices.
#define SECTORS 24

static hw_status check_cell(const hw_cell *cell, const hw_manifest *manifest, hw_cell_id id,
                            const char *path)
{
    if (cell->id.level != id.level || cell->id.q != id.q || cell->id.r != id.r) {
        return hw_fail(HW_FORMAT, "%s: holds cell %d/%d_%d", path, cell->id.level, cell->id.q,
                       cell->id.r);
    }
    for (uint32_t i = 0; i < cell->near_count; i++) {
        if (cell->near[i].object_idx >= manifest->object_count) {
            return hw_fail(HW_FORMAT, "%s: near record %u: object %u of %u", path, i,
                           cell->near[i].object_idx, manifest->object_count);
        }
    }
    return HW_OK;
}

static int find_bin(const hw_cell *cell, const hw_far_record *record)
{
    hw_vec3 d = hw_v3_sub(hw_box_centre(record->bounds), cell->centre);
    int sector = (int)((atan2(d.y, d.x) / (2 * HW_PI) + 0.5) * SECTORS) % SECTORS;
    return sector + (record->cut_out ? SECTORS : 0);
}

// Opaque records, then cut-out ones; of each, sector by sector, front to back as seen from the cell
// centre: order[i].index becomes the record to draw as the i-th.
static void order_records(const hw_cell *cell, hw_cull_item *order, hw_cull_item *scratch)
{
    for (uint32_t i = 0; i < cell->far_count; i++)
        order[i] = (hw_cull_item){hw_box_distance(cell->far[i].bounds, cell->centre), i};
    hw_cull_sort(order, cell->far_count, scratch);
    uint32_t starts[2 * SECTORS + 1] = {0};
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t i = 0; i < cell->far_count; i++) {
            int bin = find_bin(cell, &cell->far[order[i].index]);
            if (pass == 0)
                starts[bin + 1]++;
            else
                scratch[starts[bin]++] = order[i];
        }
        for (int s = 0; pass == 0 && s < 2 * SECTORS; s++)
            starts[s + 1] += starts[s];
    }
    memcpy(order, scratch, cell->far_count * sizeof *order);
}

static hw_far_draw make_draw(const hw_cell *cell, const hw_far_record *record, uint32_t first_index)
{
    float width = (float)cell->atlas_width, height = (float)cell->atlas_height;
    return (hw_far_draw){.matrix = hw_far_record_matrix(record, cell->centre),
                         .texture = {(float)record->rect.x / width, (float)record->rect.y / height,
                                     (float)record->rect.width / width / 65535.0f,
                                     (float)record->rect.height / height / 65535.0f},
                         .first_index = first_index,
                         .index_count = record->index_count};
}

// Fills the drawing list, and rewrites the cell's own arrays: each vertex's record becomes its
// place in the drawing order, and `indices` (index_count of them) gets the indices in that order.
static hw_status arrange(hw_cell *cell, uint32_t *indices, hw_cell_gpu *out)
{
    hw_status status = HW_OK;
    hw_cull_item *order = NULL, *scratch = NULL;
    HW_GO(HW_NEW(&order, cell->far_count));
    HW_GO(HW_NEW(&scratch, cell->far_count));
    HW_GO(HW_NEW(&out->far, cell->far_count));
    HW_GO(hw_cull_set_create(&out->far_bounds, cell->far_count));
    order_records(cell, order, scratch);
    uint32_t first = 0;
    for (uint32_t i = 0; i < cell->far_count; i++) {
        const hw_far_record *record = &cell->far[order[i].index];
        out->far[i] = make_draw(cell, record, first);
        out->opaque_count += !record->cut_out;
        hw_cull_set_put(&out->far_bounds, i, record->bounds);
        for (uint32_t k = 0; k < record->vertex_count; k++)
            cell->vertices[record->first_vertex + k].record = (uint16_t)i;
        memcpy(indices + first, cell->indices + record->first_index,
               record->index_count * sizeof *indices);
        first += record->index_count;
    }
    out->far_count = cell->far_count;
out:
    hw_free(order);
    hw_free(scratch);
    return status;
}

static hw_status upload(hw_gpu_account *account, const hw_cell *cell, const uint32_t *indices,
                        hw_cell_gpu *out)
{
    glGenVertexArrays(1, &out->array);
    glBindVertexArray(out->array);
    HW_TRY(hw_gpu_buffer_create(account, GL_ARRAY_BUFFER, cell->vertices,
                                (uint64_t)cell->vertex_count * sizeof *cell->vertices,
                                GL_STATIC_DRAW, &out->vertices));
    glEnableVertexAttribArray(0);
    glVertexAttribPointer(0, 4, GL_UNSIGNED_SHORT, GL_FALSE, 0, hw_gpu_offset(0));
    HW_TRY(hw_gpu_buffer_create(account, GL_ELEMENT_ARRAY_BUFFER, indices,
                                (uint64_t)cell->index_count * sizeof *indices, GL_STATIC_DRAW,
                                &out->indices));
    glBindVertexArray(0);
    HW_TRY(hw_gpu_texture_create_bc3(account, cell->atlas_bc1, cell->coverage_bc4,
                                     cell->atlas_width, cell->atlas_height, &out->atlas));
    return HW_OK;
}

static hw_status take_near(hw_cell *cell, const hw_manifest *manifest, hw_cell_gpu *out)
{
    HW_TRY(hw_cull_set_create(&out->near_bounds, cell->near_count));
    out->near = cell->near;
    out->near_count = cell->near_count;
    cell->near = NULL;
    cell->near_count = 0;
    for (uint32_t i = 0; i < out->near_count; i++)
        hw_cull_set_put(&out->near_bounds, i, manifest->objects[out->near[i].object_idx].bounds);
    return HW_OK;
}

hw_status hw_cell_gpu_load(hw_gpu_account *account, const char *dataset,
                           const hw_manifest *manifest, hw_cell_id id, hw_cell_gpu *out)
{
    hw_status status = HW_OK;
    hw_cell cell = {0};
    uint32_t *indices = NULL;
    char *path = NULL;
    uint64_t before = account->bytes;
    *out = (hw_cell_gpu){.id = id};
    HW_GO(hw_cell_path(&path, dataset, id));
    HW_GO(hw_cell_read(path, &cell));
    HW_GO(check_cell(&cell, manifest, id, path));
    HW_GO(take_near(&cell, manifest, out));
    if (cell.far_count > 0) {
        HW_GO(HW_NEW(&indices, cell.index_count));
        HW_GO(arrange(&cell, indices, out));
        HW_GO(upload(account, &cell, indices, out));
    }
    out->gpu_bytes = account->bytes - before;
    out->file_bytes = hw_dataset_file_bytes(path);
    out->loaded = true;
out:
    hw_free(path);
    hw_free(indices);
    hw_cell_free(&cell);
    if (status != HW_OK)
        hw_cell_gpu_free(account, out);
    return status;
}

void hw_cell_gpu_free(hw_gpu_account *account, hw_cell_gpu *cell)
{
    hw_free(cell->near);
    hw_free(cell->far);
    hw_cull_set_free(&cell->near_bounds);
    hw_cull_set_free(&cell->far_bounds);
    hw_gpu_buffer_destroy(account, &cell->vertices);
    hw_gpu_buffer_destroy(account, &cell->indices);
    hw_gpu_texture_destroy(account, &cell->atlas);
    if (cell->array)
        glDeleteVertexArrays(1, &cell->array);
    *cell = (hw_cell_gpu){0};
}

uint64_t hw_dataset_file_bytes(const char *path)
{
    hw_reader *reader = NULL;
    if (hw_reader_open(&reader, path) != HW_OK)
        return 0;
    uint64_t bytes = hw_reader_size(reader);
    hw_reader_close(reader);
    return bytes;
}
