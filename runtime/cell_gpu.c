#include "cell_gpu.h"
#include "alloc.h"
#include "block.h"
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
    if (cell->key != manifest->key)
        return hw_fail(HW_FORMAT, "%s: is of another build than the dataset's manifest", path);
    if (cell->range_count > 0 && !manifest->multi_view)
        return hw_fail(HW_FORMAT, "%s: has views, which its manifest says there are none of", path);
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
    if (record->range_count > 0)
        return 0;
    return 1 + sector + (record->cut_out ? SECTORS : 0);
}

// MVMeshes, front to back as seen from the cell centre; then other opaque records, then cut-out
// ones; of each of these, sector by sector, front to back: order[i].index becomes the record to
// draw as the i-th.
static void order_records(const hw_cell *cell, hw_cull_item *order, hw_cull_item *scratch)
{
    for (uint32_t i = 0; i < cell->far_count; i++)
        order[i] = (hw_cull_item){hw_box_distance(cell->far[i].bounds, cell->centre), i};
    hw_cull_sort(order, cell->far_count, scratch);
    uint32_t starts[2 * SECTORS + 2] = {0};
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t i = 0; i < cell->far_count; i++) {
            int bin = find_bin(cell, &cell->far[order[i].index]);
            if (pass == 0)
                starts[bin + 1]++;
            else
                scratch[starts[bin]++] = order[i];
        }
        for (int s = 0; pass == 0 && s < 2 * SECTORS + 1; s++)
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
                         .object_idx = record->object_idx,
                         .first_index = first_index,
                         .index_count = record->index_count,
                         .bounds = record->bounds};
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

// The captures of the MVMeshes, which are the first of the list.
static hw_status arrange_views(const hw_cell *cell, const hw_cull_item *order,
                               hw_cell_records *records)
{
    uint32_t n = 0;
    HW_TRY(HW_NEW(&records->views, cell->view_count + records->multi_count));
    for (uint32_t i = 0; i < records->multi_count; i++) {
        const hw_far_record *record = &cell->far[order[i].index];
        hw_far_draw *draw = &records->far[i];
        draw->first_view = n;
        draw->view_count = record->view_count + 1;
        draw->first_range = record->first_range;
        draw->range_count = record->range_count;
        records->views[n++] = make_view(cell, record, NULL);
        for (uint32_t k = 0; k < record->view_count; k++)
            records->views[n++] = make_view(cell, record, &cell->views[record->first_view + k]);
    }
    return HW_OK;
}

// Fills the drawing list; vertices get their record's place in the drawing order, indices come in
// that order.
static hw_status arrange(const hw_cell *cell, hw_cell_data *out)
{
    hw_status status = HW_OK;
    hw_cull_item *order = NULL, *scratch = NULL;
    hw_cell_records *records = &out->records;
    HW_GO(HW_NEW(&order, cell->far_count));
    HW_GO(HW_NEW(&scratch, cell->far_count));
    out->index_bytes = hw_gpu_index_bytes(cell->vertex_count);
    HW_GO(hw_alloc((void **)&out->indices, cell->index_count, out->index_bytes));
    HW_GO(HW_NEW(&records->far, cell->far_count));
    HW_GO(hw_cull_set_create(&records->far_bounds, cell->far_count));
    order_records(cell, order, scratch);
    uint32_t first = 0;
    for (uint32_t i = 0; i < cell->far_count; i++) {
        const hw_far_record *record = &cell->far[order[i].index];
        records->far[i] = make_draw(cell, record, first);
        records->multi_count += record->range_count > 0;
        records->opaque_count += !record->cut_out;
        hw_cull_set_put(&records->far_bounds, i, record->bounds);
        for (uint32_t k = 0; k < record->vertex_count; k++)
            out->vertices[record->first_vertex + k].record = (uint16_t)i;
        hw_gpu_pack_indices(cell->indices + record->first_index, record->index_count,
                            out->index_bytes, out->indices + (size_t)first * out->index_bytes);
        first += record->index_count;
    }
    records->far_count = cell->far_count;
    HW_GO(arrange_views(cell, order, records));
out:
    hw_free(order);
    hw_free(scratch);
    return status;
}

static hw_status take_near(hw_cell *cell, const hw_manifest *manifest, hw_cell_records *out)
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

static hw_status take_bulk(hw_cell *cell, hw_cell_data *out)
{
    size_t bytes = hw_bc3_bytes(cell->atlas_width, cell->atlas_height);
    HW_TRY(hw_alloc((void **)&out->atlas, bytes, 1));
    hw_bc3_join(cell->atlas_bc1, cell->coverage_bc4, bytes, out->atlas);
    out->atlas_width = cell->atlas_width;
    out->atlas_height = cell->atlas_height;
    out->vertex_count = cell->vertex_count;
    out->index_count = cell->index_count;
    out->color_count = cell->color_count;
    out->vertices = cell->vertices;
    cell->vertices = NULL;
    out->colors = cell->colors;
    cell->colors = NULL;
    out->records.ranges = cell->ranges;
    cell->ranges = NULL;
    return HW_OK;
}

hw_status hw_cell_data_make(const hw_manifest *manifest, hw_cell_id id, const char *name,
                            const void *bytes, size_t size, hw_cell_data *out)
{
    hw_status status = HW_OK;
    hw_cell cell = {0};
    *out = (hw_cell_data){.id = id};
    HW_GO(hw_cell_decode(name, bytes, size, &cell));
    HW_GO(check_cell(&cell, manifest, id, name));
    HW_GO(take_near(&cell, manifest, &out->records));
    if (cell.far_count > 0) {
        HW_GO(take_bulk(&cell, out));
        HW_GO(arrange(&cell, out));
    }
out:
    hw_cell_free(&cell);
    if (status != HW_OK)
        hw_cell_data_free(out);
    return status;
}

void hw_cell_data_free_bulk(hw_cell_data *data)
{
    hw_free(data->vertices);
    hw_free(data->indices);
    hw_free(data->colors);
    hw_free(data->atlas);
    data->colors = NULL;
    data->vertices = NULL;
    data->indices = NULL;
    data->atlas = NULL;
}

void hw_cell_data_free(hw_cell_data *data)
{
    hw_cell_data_free_bulk(data);
    hw_free(data->records.near);
    hw_free(data->records.far);
    hw_free(data->records.views);
    hw_free(data->records.ranges);
    hw_cull_set_free(&data->records.near_bounds);
    hw_cull_set_free(&data->records.far_bounds);
    *data = (hw_cell_data){0};
}

static uint64_t vertex_bytes(const hw_cell_data *data)
{
    return (uint64_t)data->vertex_count * sizeof *data->vertices;
}

static uint64_t index_bytes(const hw_cell_data *data)
{
    return (uint64_t)data->index_count * data->index_bytes;
}

static uint64_t color_bytes(const hw_cell_data *data)
{
    return (uint64_t)data->color_count * sizeof *data->colors;
}

static uint64_t atlas_bytes(const hw_cell_data *data, bool blocks)
{
    return data->atlas_width > 0 ? hw_gpu_atlas_bytes(data->atlas_width, data->atlas_height, blocks)
                                 : 0;
}

uint64_t hw_cell_data_bytes(const hw_cell_data *data)
{
    return vertex_bytes(data) + index_bytes(data) + color_bytes(data) + atlas_bytes(data, true) +
           data->records.near_count * (sizeof *data->records.near + 6 * sizeof(float)) +
           data->records.far_count * (sizeof *data->records.far + 6 * sizeof(float));
}

uint64_t hw_cell_data_gpu_bytes(const hw_cell_data *data, bool blocks)
{
    return vertex_bytes(data) + index_bytes(data) + color_bytes(data) + atlas_bytes(data, blocks);
}

static hw_status create_objects(hw_gpu_account *account, const hw_cell_data *data, bool blocks,
                                hw_cell_gpu *out)
{
    glGenVertexArrays(1, &out->array);
    glBindVertexArray(out->array);
    HW_TRY(hw_gpu_buffer_create(account, GL_ARRAY_BUFFER, NULL, vertex_bytes(data), GL_STATIC_DRAW,
                                &out->vertices));
    glEnableVertexAttribArray(0);
    glVertexAttribPointer(0, 4, GL_UNSIGNED_SHORT, GL_FALSE, 0, hw_gpu_offset(0));
    if (data->color_count > 0) { // enabled only where the indices stay below color_count
        HW_TRY(hw_gpu_buffer_create(account, GL_ARRAY_BUFFER, NULL, color_bytes(data),
                                    GL_STATIC_DRAW, &out->colors));
        glVertexAttribPointer(1, 4, GL_UNSIGNED_BYTE, GL_TRUE, 0, hw_gpu_offset(0));
    }
    HW_TRY(hw_gpu_buffer_create(account, GL_ELEMENT_ARRAY_BUFFER, NULL, index_bytes(data),
                                GL_STATIC_DRAW, &out->indices));
    return hw_gpu_atlas_create(account, data->atlas_width, data->atlas_height, blocks, &out->atlas);
}

hw_status hw_cell_gpu_create(hw_gpu_account *account, const hw_cell_data *data, bool blocks,
                             hw_cell_gpu *out, hw_upload *upload)
{
    *out =
        (hw_cell_gpu){.id = data->id, .records = &data->records, .index_bytes = data->index_bytes};
    *upload = (hw_upload){0};
    if (data->records.far_count == 0)
        return HW_OK;
    hw_status status = create_objects(account, data, blocks, out);
    glBindVertexArray(0);
    if (status != HW_OK) {
        hw_cell_gpu_free(account, out);
        return status;
    }
    hw_upload_add(upload, (hw_upload_part){.buffer = out->vertices.name,
                                           .data = (const uint8_t *)data->vertices,
                                           .bytes = vertex_bytes(data)});
    hw_upload_add(upload, (hw_upload_part){.buffer = out->indices.name,
                                           .data = data->indices,
                                           .bytes = index_bytes(data)});
    if (data->color_count > 0)
        hw_upload_add(upload, (hw_upload_part){.buffer = out->colors.name,
                                               .data = (const uint8_t *)data->colors,
                                               .bytes = color_bytes(data)});
    hw_upload_add(upload,
                  (hw_upload_part){.texture = out->atlas.name,
                                   .data = data->atlas,
                                   .bytes = out->atlas.bytes,
                                   .width = data->atlas_width,
                                   .height = data->atlas_height,
                                   .format = blocks ? HW_UPLOAD_BLOCKS : HW_UPLOAD_DECODED_BLOCKS});
    return HW_OK;
}

void hw_cell_gpu_free(hw_gpu_account *account, hw_cell_gpu *cell)
{
    hw_gpu_buffer_destroy(account, &cell->vertices);
    hw_gpu_buffer_destroy(account, &cell->indices);
    hw_gpu_buffer_destroy(account, &cell->colors);
    hw_gpu_texture_destroy(account, &cell->atlas);
    if (cell->array)
        glDeleteVertexArrays(1, &cell->array);
    *cell = (hw_cell_gpu){0};
}
