#include "near_level.h"
#include "alloc.h"
#include <math.h>
#include <string.h>

typedef struct near_vertex {
    float position[3];
    int16_t normal[3];
    uint16_t unused;
    uint8_t color[4];
} near_vertex;
_Static_assert(sizeof(near_vertex) == 24, "a near vertex is 24 bytes");

static uint64_t vertex_bytes(uint32_t count, bool has_uvs)
{
    return (uint64_t)count * (sizeof(near_vertex) + (has_uvs ? sizeof(hw_uv) : 0));
}

uint64_t hw_near_level_bytes(uint32_t vertex_count, uint32_t index_count, bool has_uvs)
{
    return vertex_bytes(vertex_count, has_uvs) +
           (uint64_t)index_count * hw_gpu_index_bytes(vertex_count);
}

static void pack_vertices(const hw_mesh *mesh, uint8_t *out)
{
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        near_vertex v = {.color = {255, 255, 255, 255}};
        memcpy(v.position, &mesh->positions[i], sizeof v.position);
        v.normal[0] = (int16_t)lrintf(mesh->normals[i].x * 32767);
        v.normal[1] = (int16_t)lrintf(mesh->normals[i].y * 32767);
        v.normal[2] = (int16_t)lrintf(mesh->normals[i].z * 32767);
        if (mesh->colors)
            memcpy(v.color, &mesh->colors[i], sizeof v.color);
        memcpy(out + i * sizeof v, &v, sizeof v);
    }
    if (mesh->uvs)
        memcpy(out + mesh->vertex_count * sizeof(near_vertex), mesh->uvs,
               mesh->vertex_count * sizeof *mesh->uvs);
}

hw_status hw_near_data_make(hw_mesh *mesh, const hw_inner_boxes *boxes, hw_near_data *out)
{
    hw_status status = HW_OK;
    *out = (hw_near_data){.vertex_count = mesh->vertex_count,
                          .index_count = mesh->index_count,
                          .index_bytes = hw_gpu_index_bytes(mesh->vertex_count),
                          .has_uvs = mesh->uvs != NULL};
    if (!mesh->normals)
        HW_GO(hw_mesh_compute_normals(mesh));
    HW_GO(hw_alloc((void **)&out->vertices, vertex_bytes(out->vertex_count, out->has_uvs), 1));
    HW_GO(hw_alloc((void **)&out->indices, out->index_count, out->index_bytes));
    out->inside = (hw_near_inside){hw_mesh_bounds(mesh), *boxes};
    pack_vertices(mesh, out->vertices);
    hw_gpu_pack_indices(mesh->indices, mesh->index_count, out->index_bytes, out->indices);
out:
    if (status != HW_OK)
        hw_near_data_free(out);
    return status;
}

void hw_near_data_free(hw_near_data *data)
{
    hw_free(data->vertices);
    hw_free(data->indices);
    *data = (hw_near_data){0};
}

static void describe_vertices(const hw_near_data *data)
{
    const GLsizei stride = sizeof(near_vertex);
    glEnableVertexAttribArray(0);
    glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, stride,
                          hw_gpu_offset(offsetof(near_vertex, position)));
    glEnableVertexAttribArray(1);
    glVertexAttribPointer(1, 4, GL_SHORT, GL_TRUE, stride,
                          hw_gpu_offset(offsetof(near_vertex, normal)));
    glEnableVertexAttribArray(2);
    glVertexAttribPointer(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, stride,
                          hw_gpu_offset(offsetof(near_vertex, color)));
    if (data->has_uvs) {
        glEnableVertexAttribArray(3);
        glVertexAttribPointer(3, 2, GL_FLOAT, GL_FALSE, sizeof(hw_uv),
                              hw_gpu_offset((size_t)data->vertex_count * sizeof(near_vertex)));
    }
}

hw_status hw_near_level_create(hw_gpu_account *account, const hw_near_data *data,
                               hw_near_level *out, hw_upload *upload)
{
    hw_status status = HW_OK;
    *upload = (hw_upload){0};
    *out = (hw_near_level){
        .has_uvs = data->has_uvs, .index_count = data->index_count, .inside = data->inside};
    out->index_type = hw_gpu_index_type(data->index_bytes);
    glGenVertexArrays(1, &out->array);
    glBindVertexArray(out->array);
    HW_GO(hw_gpu_buffer_create(account, GL_ARRAY_BUFFER, NULL,
                               vertex_bytes(data->vertex_count, data->has_uvs), GL_STATIC_DRAW,
                               &out->vertices));
    describe_vertices(data);
    HW_GO(hw_gpu_buffer_create(account, GL_ELEMENT_ARRAY_BUFFER, NULL,
                               (uint64_t)data->index_count * data->index_bytes, GL_STATIC_DRAW,
                               &out->indices));
    hw_upload_add(upload, (hw_upload_part){.buffer = out->vertices.name,
                                           .data = data->vertices,
                                           .bytes = out->vertices.bytes});
    hw_upload_add(upload, (hw_upload_part){.buffer = out->indices.name,
                                           .data = data->indices,
                                           .bytes = out->indices.bytes});
out:
    glBindVertexArray(0);
    if (status != HW_OK)
        hw_near_level_free(account, out);
    return status;
}

void hw_near_level_free(hw_gpu_account *account, hw_near_level *level)
{
    hw_gpu_buffer_destroy(account, &level->vertices);
    hw_gpu_buffer_destroy(account, &level->indices);
    if (level->array)
        glDeleteVertexArrays(1, &level->array);
    *level = (hw_near_level){0};
}
