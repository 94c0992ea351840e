#include "mesh_file.h"
#include "mesh_level.h"
#include <assert.h>
#include <math.h>
#include <stdio.h>

#define TAG_TABLE HW_FOURCC('L', 'E', 'V', 'S')
#define TAG_LEVEL HW_FOURCC('L', 'E', 'V', 'L')

struct hw_mesh_file {
    char *path;
    hw_container *container;
    uint32_t level_count;
    hw_mesh_level_info levels[HW_MESH_LEVELS_MAX];
};

static hw_status validate_levels(const char *path, const hw_mesh *levels,
                                 const hw_mesh_level_info *infos, const hw_inner_boxes *boxes,
                                 uint32_t count)
{
    HW_TRY(hw_mesh_table_validate(path, infos, count));
    for (uint32_t i = 0; i < count; i++) {
        hw_status status = hw_mesh_validate(&levels[i]);
        if (status == HW_OK && boxes)
            status = hw_mesh_boxes_validate(&levels[i], &boxes[i]);
        if (status != HW_OK)
            return hw_fail_prefix(status, path);
        if (levels[i].vertex_count != infos[i].vertex_count ||
            levels[i].index_count != infos[i].index_count)
            return hw_fail(HW_FORMAT, "%s: level %u is not as large as its entry says", path, i);
    }
    return HW_OK;
}

hw_status hw_mesh_file_write(const char *path, uint64_t key, const hw_mesh *levels,
                             const hw_mesh_level_info *infos, const hw_inner_boxes *boxes,
                             uint32_t count)
{
    hw_status status = HW_OK;
    uint8_t *bytes[HW_MESH_LEVELS_MAX + 1] = {NULL};
    hw_chunk chunks[HW_MESH_LEVELS_MAX + 1];
    HW_TRY(validate_levels(path, levels, infos, boxes, count));
    chunks[0] = (hw_chunk){TAG_TABLE, 0, NULL, 0};
    HW_GO(hw_mesh_table_encode(infos, count, &bytes[0], &chunks[0].size));
    for (uint32_t i = 1; i <= count; i++) {
        chunks[i] = (hw_chunk){TAG_LEVEL, i - 1, NULL, 0};
        const hw_inner_boxes *inside = boxes ? &boxes[i - 1] : NULL;
        HW_GO(hw_mesh_level_encode(&levels[i - 1], inside, &bytes[i], &chunks[i].size));
    }
    for (uint32_t i = 0; i <= count; i++)
        chunks[i].data = bytes[i];
    status = hw_container_write(path, HW_MESH_MAGIC, key, chunks, count + 1);
out:
    for (uint32_t i = 0; i <= HW_MESH_LEVELS_MAX; i++)
        hw_free(bytes[i]);
    return status;
}

// The table, and that there is a chunk for each of its levels and no other.
static hw_status read_table(hw_mesh_file *f)
{
    uint8_t *bytes = NULL;
    size_t size = 0, raw, stored;
    hw_status status = hw_container_chunk(f->container, TAG_TABLE, 0, &bytes, &size);
    if (status == HW_OK)
        status = hw_mesh_table_decode(f->path, bytes, size, f->levels, &f->level_count);
    hw_free(bytes);
    for (uint32_t i = 0; status == HW_OK && i < f->level_count; i++)
        status = hw_container_chunk_size(f->container, TAG_LEVEL, i, &raw, &stored);
    if (status == HW_OK && hw_container_chunk_count(f->container) != f->level_count + 1)
        status = hw_fail(HW_FORMAT, "%s: unknown chunks", f->path);
    // A missing chunk is a damaged file, not a missing one.
    return status == HW_NOT_FOUND ? HW_FORMAT : status;
}

// Takes the container, also on failure.
static hw_status open_container(hw_mesh_file **out, const char *name, hw_container *container)
{
    hw_status status = HW_OK;
    hw_mesh_file *f = NULL;
    *out = NULL;
    status = HW_NEW(&f, 1);
    if (status != HW_OK) {
        hw_container_close(container);
        return status;
    }
    f->container = container;
    HW_GO(hw_strdup(&f->path, name));
    HW_GO(read_table(f));
    *out = f;
    return HW_OK;
out:
    hw_mesh_file_close(f);
    return status;
}

hw_status hw_mesh_file_open(hw_mesh_file **out, const char *path)
{
    hw_container *container = NULL;
    *out = NULL;
    HW_TRY(hw_container_open(&container, path, HW_MESH_MAGIC));
    return open_container(out, path, container);
}

hw_status hw_mesh_file_open_front(hw_mesh_file **out, const char *name, const void *bytes,
                                  size_t size, uint64_t file_bytes)
{
    hw_container *container = NULL;
    *out = NULL;
    HW_TRY(hw_container_open_front(&container, name, bytes, size, file_bytes, HW_MESH_MAGIC));
    HW_TRY(open_container(out, name, container));
    hw_container_release(container);
    return HW_OK;
}

float hw_mesh_level_error(const hw_mesh_level_info *info)
{
    return fmaxf(info->error_p99, HW_MESH_SHADING_WEIGHT * info->error_shading);
}

void hw_mesh_file_close(hw_mesh_file *file)
{
    if (!file)
        return;
    hw_container_close(file->container);
    hw_free(file->path);
    hw_free(file);
}

uint64_t hw_mesh_file_key(const hw_mesh_file *file)
{
    return hw_container_key(file->container);
}

uint32_t hw_mesh_file_level_count(const hw_mesh_file *file)
{
    return file->level_count;
}

const hw_mesh_level_info *hw_mesh_file_level(const hw_mesh_file *file, uint32_t level)
{
    assert(level < file->level_count);
    return &file->levels[level];
}

hw_status hw_mesh_file_read(const hw_mesh_file *file, uint32_t level, hw_mesh *out,
                            hw_inner_boxes *boxes)
{
    assert(level < file->level_count);
    uint8_t *bytes = NULL;
    size_t size = 0;
    *out = (hw_mesh){0};
    if (boxes)
        *boxes = (hw_inner_boxes){0};
    HW_TRY(hw_container_chunk(file->container, TAG_LEVEL, level, &bytes, &size));
    hw_status status =
        hw_mesh_level_decode(file->path, &file->levels[level], bytes, size, out, boxes);
    hw_free(bytes);
    return status;
}

void hw_mesh_file_level_place(const hw_mesh_file *file, uint32_t level, uint64_t *offset,
                              uint64_t *size)
{
    assert(level < file->level_count);
    hw_status status = hw_container_chunk_place(file->container, TAG_LEVEL, level, offset, size);
    assert(status == HW_OK); // read_table has made sure of the chunk
    (void)status;
}

hw_status hw_mesh_file_decode(const hw_mesh_file *file, uint32_t level, const void *bytes,
                              size_t size, hw_mesh *out, hw_inner_boxes *boxes)
{
    assert(level < file->level_count);
    uint8_t *raw = NULL;
    size_t raw_size = 0;
    *out = (hw_mesh){0};
    if (boxes)
        *boxes = (hw_inner_boxes){0};
    HW_TRY(hw_container_unpack(file->container, TAG_LEVEL, level, bytes, size, &raw, &raw_size));
    hw_status status =
        hw_mesh_level_decode(file->path, &file->levels[level], raw, raw_size, out, boxes);
    hw_free(raw);
    return status;
}

void hw_mesh_name(char out[HW_FILE_NAME_BYTES], uint32_t mesh_idx)
{
    snprintf(out, HW_FILE_NAME_BYTES, "meshes/%u.hxm", mesh_idx);
}

hw_status hw_mesh_path(char **out, const char *dataset, uint32_t mesh_idx)
{
    char name[HW_FILE_NAME_BYTES];
    hw_mesh_name(name, mesh_idx);
    return hw_path_join(out, dataset, name);
}

void hw_texture_name(char out[HW_FILE_NAME_BYTES], uint32_t texture_idx)
{
    snprintf(out, HW_FILE_NAME_BYTES, "meshes/texture_%u.png", texture_idx);
}

hw_status hw_texture_path(char **out, const char *dataset, uint32_t texture_idx)
{
    char name[HW_FILE_NAME_BYTES];
    hw_texture_name(name, texture_idx);
    return hw_path_join(out, dataset, name);
}
