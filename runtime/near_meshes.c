#include "near_meshes.h"
#include "alloc.h"
#include "cell_gpu.h"
#include "file.h"
#include "image_io.h"
#include "mesh_file.h"
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct near_vertex {
    float position[3];
    int16_t normal[3];
    uint16_t unused;
    uint8_t color[4];
} near_vertex;
_Static_assert(sizeof(near_vertex) == 24, "a near vertex is 24 bytes");

typedef struct near_mesh {
    uint32_t level_count; // 0 = not opened
    float *errors;        // surface error per level, mesh units
    uint64_t *file_bytes; // per level
    hw_near_level *levels;
} near_mesh;

typedef struct loaded_level {
    uint32_t mesh_idx, level;
} loaded_level;

struct hw_near_meshes {
    hw_gpu_account *account;
    const char *dataset;
    uint32_t mesh_count, texture_count;
    near_mesh *meshes;
    hw_gpu_texture *textures;
    loaded_level *loaded; // in no order
    size_t loaded_count, loaded_capacity;
    uint64_t bytes, budget_bytes; // of the loaded levels
};

hw_status hw_near_meshes_create(hw_gpu_account *account, const char *dataset,
                                const hw_manifest *manifest, uint64_t budget_bytes,
                                hw_near_meshes **out)
{
    hw_status status = HW_OK;
    hw_near_meshes *m = NULL;
    *out = NULL;
    HW_TRY(HW_NEW(&m, 1));
    m->account = account;
    m->dataset = dataset;
    m->budget_bytes = budget_bytes;
    HW_GO(HW_NEW(&m->meshes, manifest->mesh_count));
    HW_GO(HW_NEW(&m->textures, manifest->texture_count));
    m->mesh_count = manifest->mesh_count;
    m->texture_count = manifest->texture_count;
    *out = m;
    m = NULL;
out:
    hw_near_meshes_destroy(m);
    return status;
}

static void free_level(hw_near_meshes *m, hw_near_level *level)
{
    m->bytes -= level->vertices.bytes + level->indices.bytes;
    hw_gpu_buffer_destroy(m->account, &level->vertices);
    hw_gpu_buffer_destroy(m->account, &level->indices);
    if (level->array)
        glDeleteVertexArrays(1, &level->array);
    *level = (hw_near_level){0};
}

void hw_near_meshes_destroy(hw_near_meshes *m)
{
    if (!m)
        return;
    for (uint32_t i = 0; i < m->mesh_count; i++) {
        for (uint32_t k = 0; k < m->meshes[i].level_count; k++)
            free_level(m, &m->meshes[i].levels[k]);
        hw_free(m->meshes[i].levels);
        hw_free(m->meshes[i].errors);
        hw_free(m->meshes[i].file_bytes);
    }
    for (uint32_t i = 0; i < m->texture_count; i++)
        hw_gpu_texture_destroy(m->account, &m->textures[i]);
    hw_free(m->meshes);
    hw_free(m->textures);
    hw_free(m->loaded);
    hw_free(m);
}

static hw_status open_file(const hw_near_meshes *m, uint32_t mesh_idx, hw_mesh_file **file,
                           uint64_t *bytes)
{
    char *path = NULL;
    HW_TRY(hw_mesh_path(&path, m->dataset, mesh_idx));
    hw_status status = hw_mesh_file_open(file, path);
    if (status == HW_OK && bytes)
        *bytes = hw_dataset_file_bytes(path);
    hw_free(path);
    return status;
}

// The file's bytes shared out to its levels by their size, for the load figures.
static void share_bytes(near_mesh *mesh, const hw_mesh_file *file, uint64_t bytes)
{
    double sum = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t i = 0; i < mesh->level_count; i++) {
            const hw_mesh_level_info *info = hw_mesh_file_level(file, i);
            double size = info->vertex_count * 4.0 + info->index_count;
            if (pass == 0)
                sum += size;
            else
                mesh->file_bytes[i] = (uint64_t)((double)bytes * size / sum);
        }
    }
}

static hw_status open_mesh(hw_near_meshes *m, uint32_t mesh_idx)
{
    hw_status status = HW_OK;
    hw_mesh_file *file = NULL;
    uint64_t bytes = 0;
    near_mesh made = {0};
    HW_TRY(open_file(m, mesh_idx, &file, &bytes));
    made.level_count = hw_mesh_file_level_count(file);
    HW_GO(HW_NEW(&made.errors, made.level_count));
    HW_GO(HW_NEW(&made.file_bytes, made.level_count));
    HW_GO(HW_NEW(&made.levels, made.level_count));
    for (uint32_t i = 0; i < made.level_count; i++)
        made.errors[i] = hw_mesh_file_level(file, i)->error_p99;
    share_bytes(&made, file, bytes);
    m->meshes[mesh_idx] = made;
    made = (near_mesh){0};
out:
    hw_free(made.errors);
    hw_free(made.file_bytes);
    hw_free(made.levels);
    hw_mesh_file_close(file);
    return status;
}

static hw_status open_texture(hw_near_meshes *m, uint32_t texture_idx, hw_frame_stats *stats)
{
    hw_status status = HW_OK;
    hw_image image = {0};
    char name[48], *path = NULL;
    snprintf(name, sizeof name, "meshes/texture_%u.png", texture_idx);
    HW_GO(hw_path_join(&path, m->dataset, name));
    HW_GO(hw_image_read(path, &image));
    HW_GO(hw_gpu_texture_create(m->account, &image, &m->textures[texture_idx]));
    stats->stalls = 1;
    stats->loaded_bytes += hw_dataset_file_bytes(path);
out:
    hw_image_free(&image);
    hw_free(path);
    return status;
}

hw_status hw_near_meshes_open(hw_near_meshes *m, uint32_t mesh_idx, int32_t texture_idx,
                              hw_frame_stats *stats)
{
    assert(mesh_idx < m->mesh_count && texture_idx < (int32_t)m->texture_count);
    if (m->meshes[mesh_idx].level_count == 0) {
        stats->stalls = 1;
        HW_TRY(open_mesh(m, mesh_idx));
    }
    if (texture_idx >= 0 && m->textures[texture_idx].name == 0)
        HW_TRY(open_texture(m, (uint32_t)texture_idx, stats));
    return HW_OK;
}

uint32_t hw_near_meshes_choose(const hw_near_meshes *m, uint32_t mesh_idx, double error)
{
    const near_mesh *mesh = &m->meshes[mesh_idx];
    uint32_t level = 0;
    while (level + 1 < mesh->level_count && mesh->errors[level + 1] <= error)
        level++;
    return level;
}

GLuint hw_near_meshes_texture(const hw_near_meshes *m, int32_t texture_idx)
{
    return texture_idx < 0 ? 0 : m->textures[texture_idx].name;
}

static hw_status upload_vertices(hw_near_meshes *m, const hw_mesh *mesh, hw_near_level *out)
{
    uint64_t bytes = (uint64_t)mesh->vertex_count * sizeof(near_vertex);
    uint64_t uv_bytes = mesh->uvs ? (uint64_t)mesh->vertex_count * sizeof(hw_uv) : 0;
    near_vertex *packed = NULL;
    HW_TRY(HW_NEW(&packed, mesh->vertex_count));
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        near_vertex *v = &packed[i];
        memcpy(v->position, &mesh->positions[i], sizeof v->position);
        v->normal[0] = (int16_t)lrintf(mesh->normals[i].x * 32767);
        v->normal[1] = (int16_t)lrintf(mesh->normals[i].y * 32767);
        v->normal[2] = (int16_t)lrintf(mesh->normals[i].z * 32767);
        memset(v->color, 255, sizeof v->color);
        if (mesh->colors)
            memcpy(v->color, &mesh->colors[i], sizeof v->color);
    }
    hw_status status = hw_gpu_buffer_create(m->account, GL_ARRAY_BUFFER, NULL, bytes + uv_bytes,
                                            GL_STATIC_DRAW, &out->vertices);
    if (status == HW_OK) {
        glBufferSubData(GL_ARRAY_BUFFER, 0, (GLsizeiptr)bytes, packed);
        if (uv_bytes)
            glBufferSubData(GL_ARRAY_BUFFER, (GLintptr)bytes, (GLsizeiptr)uv_bytes, mesh->uvs);
    }
    hw_free(packed);
    return status;
}

static void describe_vertices(const hw_mesh *mesh)
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
    if (mesh->uvs) {
        glEnableVertexAttribArray(3);
        glVertexAttribPointer(3, 2, GL_FLOAT, GL_FALSE, sizeof(hw_uv),
                              hw_gpu_offset((size_t)mesh->vertex_count * stride));
    }
}

static hw_status upload_indices(hw_near_meshes *m, const hw_mesh *mesh, hw_near_level *out)
{
    bool is_small = mesh->vertex_count < 65536;
    uint64_t bytes = (uint64_t)mesh->index_count * (is_small ? 2 : 4);
    uint16_t *small = NULL;
    HW_TRY(HW_NEW(&small, is_small ? mesh->index_count : 0));
    for (uint32_t i = 0; is_small && i < mesh->index_count; i++)
        small[i] = (uint16_t)mesh->indices[i];
    const void *data = is_small ? (const void *)small : mesh->indices;
    hw_status status = hw_gpu_buffer_create(m->account, GL_ELEMENT_ARRAY_BUFFER, data, bytes,
                                            GL_STATIC_DRAW, &out->indices);
    hw_free(small);
    out->index_count = mesh->index_count;
    out->index_type = is_small ? GL_UNSIGNED_SHORT : GL_UNSIGNED_INT;
    return status;
}

static hw_status upload(hw_near_meshes *m, hw_mesh *mesh, hw_near_level *out)
{
    hw_status status = HW_OK;
    hw_near_level made = {.has_uvs = mesh->uvs != NULL};
    if (!mesh->normals)
        HW_TRY(hw_mesh_compute_normals(mesh));
    glGenVertexArrays(1, &made.array);
    glBindVertexArray(made.array);
    HW_GO(upload_vertices(m, mesh, &made));
    describe_vertices(mesh);
    HW_GO(upload_indices(m, mesh, &made));
out:
    glBindVertexArray(0);
    m->bytes += made.vertices.bytes + made.indices.bytes;
    if (status != HW_OK)
        free_level(m, &made);
    *out = made;
    return status;
}

// Drops the levels that have not been used for longest, but none of this frame, until the budget is
// kept.
static void evict(hw_near_meshes *m, uint64_t frame)
{
    while (m->bytes > m->budget_bytes) {
        size_t oldest = SIZE_MAX;
        uint64_t oldest_used = frame;
        for (size_t i = 0; i < m->loaded_count; i++) {
            const loaded_level *l = &m->loaded[i];
            uint64_t used = m->meshes[l->mesh_idx].levels[l->level].used;
            if (used < oldest_used) {
                oldest_used = used;
                oldest = i;
            }
        }
        if (oldest == SIZE_MAX)
            return;
        loaded_level l = m->loaded[oldest];
        free_level(m, &m->meshes[l.mesh_idx].levels[l.level]);
        m->loaded[oldest] = m->loaded[--m->loaded_count];
    }
}

static hw_status load_level(hw_near_meshes *m, uint32_t mesh_idx, uint32_t level)
{
    hw_status status = HW_OK;
    hw_mesh_file *file = NULL;
    hw_mesh mesh = {0};
    near_mesh *near = &m->meshes[mesh_idx];
    HW_TRY(HW_RESERVE(&m->loaded, &m->loaded_capacity, m->loaded_count + 1));
    HW_TRY(open_file(m, mesh_idx, &file, NULL));
    // The table was read before: the file may have been replaced meanwhile.
    if (level >= hw_mesh_file_level_count(file)) {
        status = hw_fail(HW_FORMAT, "%s/meshes/%u.hxm: has changed: no level %u", m->dataset,
                         mesh_idx, level);
        goto out;
    }
    HW_GO(hw_mesh_file_read(file, level, &mesh));
    HW_GO(upload(m, &mesh, &near->levels[level]));
    m->loaded[m->loaded_count++] = (loaded_level){mesh_idx, level};
out:
    hw_mesh_free(&mesh);
    hw_mesh_file_close(file);
    return status;
}

hw_status hw_near_meshes_get(hw_near_meshes *m, uint32_t mesh_idx, uint32_t level, uint64_t frame,
                             hw_frame_stats *stats, const hw_near_level **out)
{
    near_mesh *mesh = &m->meshes[mesh_idx];
    assert(level < mesh->level_count);
    hw_near_level *l = &mesh->levels[level];
    if (!l->array) {
        stats->stalls = 1;
        stats->loaded_bytes += mesh->file_bytes[level];
        HW_TRY(load_level(m, mesh_idx, level));
        l->used = frame;
        evict(m, frame);
    }
    l->used = frame;
    *out = l;
    return HW_OK;
}
