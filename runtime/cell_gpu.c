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

// MVMeshes front to back as seen from the cell centre; then the others sector by sector, in each
// front to back: order[i].index becomes the record to draw as the i-th. Returns how many MVMeshes
// there are.
static uint32_t order_records(const hw_cell *cell, hw_cull_item *order, hw_cull_item *scratch)
{
    for (uint32_t i = 0; i < cell->far_count; i++)
        order[i] = (hw_cull_item){hw_box_distance(cell->far[i].bounds, cell->centre), i};
    hw_cull_sort(order, cell->far_count, scratch);
    uint32_t starts[SECTORS + 2] = {0};
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t i = 0; i < cell->far_count; i++) {
            hw_vec3 d = hw_v3_sub(hw_box_centre(cell->far[order[i].index].bounds), cell->centre);
            int sector = (int)((atan2(d.y, d.x) / (2 * HW_PI) + 0.5) * SECTORS) % SECTORS + 1;
            if (cell->far[order[i].index].range_count > 0)
                sector = 0;
            if (pass == 0)
                starts[sector + 1]++;
            else
                scratch[starts[sector]++] = order[i];
        }
        for (int s = 0; pass == 0 && s < SECTORS + 1; s++)
            starts[s + 1] += starts[s];
    }
    memcpy(order, scratch, cell->far_count * sizeof *order);
    return starts[0];
}

static hw_far_draw make_draw(const hw_cell *cell, const hw_far_record *record, uint32_t first_index)
{
    float width = (float)cell->atlas_width, height = (float)cell->atlas_height;
    return (hw_far_draw){.matrix = hw_far_record_matrix(record, cell->centre),
                         .texture = {(float)record->rect.x / width, (float)record->rect.y / height,
                                     (float)record->rect.width / width / 65535.0f,
                                     (float)record->rect.height / height / 65535.0f},
                         .first_index = first_index,
                         .index_count = record->index_count,
                         .middle = hw_box_centre(record->bounds)};
}

static hw_far_view_draw make_view(const hw_cell *cell, const hw_far_record *record,
                                  const hw_far_view *view)
{
    hw_far_view_draw out = {.eye = view ? view->eye : cell->centre};
    hw_mat4 texels = hw_far_view_matrix(record, cell->centre, view);
    for (int c = 0; c < 4; c++) {
        texels.m[4 * c] /= cell->atlas_width;
        texels.m[4 * c + 1] /= cell->atlas_height;
    }
    hw_mat4_to_float(&texels, out.texture);
    return out;
}

// The captures of the MVMeshes, which are the first of the list. Ranges keep their places.
static hw_status arrange_views(hw_cell *cell, const hw_cull_item *order, hw_cell_gpu *out)
{
    HW_TRY(HW_NEW(&out->views, cell->view_count + out->multi_count));
    uint32_t n = 0;
    for (uint32_t i = 0; i < out->multi_count; i++) {
        const hw_far_record *record = &cell->far[order[i].index];
        hw_far_draw *draw = &out->far[i];
        draw->first_view = n;
        draw->view_count = record->view_count + 1;
        draw->first_range = record->first_range;
        draw->range_count = record->range_count;
        out->views[n++] = make_view(cell, record, NULL);
        for (uint32_t k = 0; k < record->view_count; k++)
            out->views[n++] = make_view(cell, record, &cell->views[record->first_view + k]);
    }
    out->ranges = cell->ranges;
    cell->ranges = NULL;
    cell->range_count = 0;
    return HW_OK;
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
    out->multi_count = order_records(cell, order, scratch);
    uint32_t first = 0;
    for (uint32_t i = 0; i < cell->far_count; i++) {
        const hw_far_record *record = &cell->far[order[i].index];
        out->far[i] = make_draw(cell, record, first);
        hw_cull_set_put(&out->far_bounds, i, record->bounds);
        for (uint32_t k = 0; k < record->vertex_count; k++)
            cell->vertices[record->first_vertex + k].record = (uint16_t)i;
        memcpy(indices + first, cell->indices + record->first_index,
               record->index_count * sizeof *indices);
        first += record->index_count;
    }
    out->far_count = cell->far_count;
    HW_GO(arrange_views(cell, order, out));
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
    if (cell->color_count > 0) { // read only where the indices stay below color_count
        HW_TRY(hw_gpu_buffer_create(account, GL_ARRAY_BUFFER, cell->colors,
                                    (uint64_t)cell->color_count * sizeof *cell->colors,
                                    GL_STATIC_DRAW, &out->colors));
        glVertexAttribPointer(1, 4, GL_UNSIGNED_BYTE, GL_TRUE, 0, hw_gpu_offset(0));
    }
    HW_TRY(hw_gpu_buffer_create(account, GL_ELEMENT_ARRAY_BUFFER, indices,
                                (uint64_t)cell->index_count * sizeof *indices, GL_STATIC_DRAW,
                                &out->indices));
    glBindVertexArray(0);
    HW_TRY(hw_gpu_texture_create_bc1(account, cell->atlas_bc1, cell->atlas_width,
                                     cell->atlas_height, &out->atlas));
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
    hw_free(cell->views);
    hw_free(cell->ranges);
    hw_cull_set_free(&cell->near_bounds);
    hw_cull_set_free(&cell->far_bounds);
    hw_gpu_buffer_destroy(account, &cell->vertices);
    hw_gpu_buffer_destroy(account, &cell->indices);
    hw_gpu_buffer_destroy(account, &cell->colors);
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
