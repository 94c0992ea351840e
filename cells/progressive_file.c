#include "progressive_file.h"
#include "progressive_codec.h"
#include "progressive_internal.h"
#include <assert.h>

#define TAG_HEAD         HW_FOURCC('H', 'E', 'A', 'D')
#define TAG_BASE         HW_FOURCC('B', 'A', 'S', 'E')
#define TAG_CONNECTIVITY HW_FOURCC('C', 'O', 'N', 'N')
#define TAG_GEOMETRY     HW_FOURCC('D', 'E', 'L', 'T')
#define TAG_LOOSE        HW_FOURCC('L', 'O', 'O', 'S')
#define TAG_ORDER        HW_FOURCC('O', 'R', 'D', 'R')

#define FIXED_CHUNKS 4u
_Static_assert(FIXED_CHUNKS + 2 * HW_PROGRESSIVE_BLOCKS_MAX <= HW_CONTAINER_CHUNKS_MAX,
               "two chunks a block");

struct hw_progressive_file {
    char *path;
    hw_container *container;
    hw_progressive_head head;
    hw_progressive_file_info info;
};

// --- Writing -------------------------------------------------------------------------------------

typedef struct chunk_list {
    hw_chunk chunks[FIXED_CHUNKS + 2 * HW_PROGRESSIVE_BLOCKS_MAX];
    uint8_t *bytes[FIXED_CHUNKS + 2 * HW_PROGRESSIVE_BLOCKS_MAX];
    uint32_t count;
} chunk_list;

static void add_chunk(chunk_list *list, uint32_t tag, uint32_t number, uint8_t *bytes, size_t size)
{
    list->bytes[list->count] = bytes;
    list->chunks[list->count++] = (hw_chunk){tag, number, bytes, size};
}

static hw_status pack(const hw_progressive *p, const hw_progressive_head *head,
                      hw_progressive_writer *w, chunk_list *list)
{
    uint8_t *bytes = NULL, *pair[2] = {NULL, NULL};
    size_t size = 0, sizes[2] = {0, 0};
    HW_TRY(hw_progressive_head_encode(head, &bytes, &size));
    add_chunk(list, TAG_HEAD, 0, bytes, size);
    HW_TRY(hw_progressive_writer_start(w, p, head));
    HW_TRY(hw_progressive_put_base(w, &bytes, &size));
    add_chunk(list, TAG_BASE, 0, bytes, size);
    for (uint32_t b = 0; b < head->block_count; b++) {
        hw_status status = hw_progressive_put_block(w, b, pair, sizes);
        add_chunk(list, TAG_CONNECTIVITY, b, pair[0], sizes[0]);
        add_chunk(list, TAG_GEOMETRY, b, pair[1], sizes[1]);
        if (status != HW_OK)
            return status;
    }
    bytes = NULL;
    size = 0;
    if (head->info.complete)
        HW_TRY(hw_progressive_put_loose(p, &bytes, &size));
    add_chunk(list, TAG_LOOSE, 0, bytes, size);
    bytes = NULL;
    size = 0;
    if (head->info.keep_order)
        HW_TRY(hw_progressive_put_order(p, &bytes, &size));
    add_chunk(list, TAG_ORDER, 0, bytes, size);
    return HW_OK;
}

// The whole file in memory (*bytes freed with hw_free).
static hw_status encode(const hw_progressive *p, uint32_t records, uint64_t key, uint8_t **bytes,
                        size_t *size)
{
    hw_progressive_head head = {0};
    hw_progressive_writer w = {0};
    chunk_list list = {.count = 0};
    *bytes = NULL;
    if (records > p->info.record_count)
        records = p->info.record_count;
    hw_status status = hw_progressive_head_make(p, records, &head);
    if (status == HW_OK)
        status = pack(p, &head, &w, &list);
    if (status == HW_OK)
        status =
            hw_container_encode(HW_PROGRESSIVE_MAGIC, key, list.chunks, list.count, bytes, size);
    for (uint32_t i = 0; i < list.count; i++)
        hw_free(list.bytes[i]);
    hw_progressive_writer_free(&w);
    hw_progressive_head_free(&head);
    return status;
}

hw_status hw_progressive_write(const hw_progressive *p, uint32_t records, const char *path,
                               uint64_t key)
{
    uint8_t *bytes = NULL;
    size_t size = 0;
    hw_status status = encode(p, records, key, &bytes, &size);
    if (status != HW_OK)
        return hw_fail_prefix(status, path);
    status = hw_file_write(path, bytes, size);
    hw_free(bytes);
    return status;
}

hw_status hw_progressive_encoded_bytes(const hw_progressive *p, uint32_t records, uint64_t *bytes)
{
    uint8_t *data = NULL;
    size_t size = 0;
    *bytes = 0;
    HW_TRY(encode(p, records, 0, &data, &size));
    *bytes = size;
    hw_free(data);
    return HW_OK;
}

// --- Reading -------------------------------------------------------------------------------------

static hw_status stored_bytes(const hw_progressive_file *f, uint32_t tag, uint32_t number,
                              bool there, uint64_t *sum)
{
    size_t raw, stored;
    HW_TRY(hw_container_chunk_size(f->container, tag, number, &raw, &stored));
    *sum += stored;
    return there || raw == 0 ? HW_OK
                             : hw_fail(HW_FORMAT, "%s: a chunk that should be empty", f->path);
}

static hw_status measure_chunks(hw_progressive_file *f)
{
    hw_progressive_file_info *info = &f->info;
    HW_TRY(stored_bytes(f, TAG_HEAD, 0, true, &info->head_bytes));
    HW_TRY(stored_bytes(f, TAG_BASE, 0, true, &info->base_bytes));
    HW_TRY(stored_bytes(f, TAG_LOOSE, 0, info->mesh.complete, &info->loose_bytes));
    HW_TRY(stored_bytes(f, TAG_ORDER, 0, info->mesh.keep_order, &info->order_bytes));
    for (uint32_t b = 0; b < f->head.block_count; b++) {
        uint64_t connectivity = 0, geometry = 0;
        HW_TRY(stored_bytes(f, TAG_CONNECTIVITY, b, true, &connectivity));
        HW_TRY(stored_bytes(f, TAG_GEOMETRY, b, true, &geometry));
        info->connectivity_bytes += connectivity;
        info->geometry_bytes += geometry;
        f->head.blocks[b].stored_bytes = connectivity + geometry;
    }
    if (hw_container_chunk_count(f->container) != FIXED_CHUNKS + 2 * f->head.block_count)
        return hw_fail(HW_FORMAT, "%s: unknown chunks", f->path);
    return HW_OK;
}

static void fill_info(hw_progressive_file *f)
{
    const hw_progressive_info *mesh = &f->head.info;
    hw_progressive_file_info *info = &f->info;
    info->mesh = *mesh;
    info->vertex_count =
        mesh->base_vertex_count + mesh->record_count + mesh->loose_vertex_count - mesh->copy_count;
    info->face_count = mesh->base_face_count + mesh->loose_face_count;
    for (uint32_t b = 0; b < f->head.block_count; b++)
        info->face_count += f->head.blocks[b].face_count;
    info->block_count = f->head.block_count;
    info->key = hw_container_key(f->container);
    info->file_bytes = hw_container_bytes(f->container);
}

static hw_status read_head(hw_progressive_file *f)
{
    uint8_t *bytes = NULL;
    size_t size = 0;
    HW_TRY(hw_container_chunk(f->container, TAG_HEAD, 0, &bytes, &size));
    hw_status status = hw_progressive_head_decode(bytes, size, &f->head);
    hw_free(bytes);
    if (status != HW_OK)
        return hw_fail_prefix(status, f->path);
    fill_info(f);
    return measure_chunks(f);
}

hw_status hw_progressive_file_open(hw_progressive_file **out, const char *path)
{
    hw_status status = HW_OK;
    hw_progressive_file *f = NULL;
    *out = NULL;
    HW_TRY(HW_NEW(&f, 1));
    HW_GO(hw_strdup(&f->path, path));
    HW_GO(hw_container_open(&f->container, path, HW_PROGRESSIVE_MAGIC));
    status = read_head(f);
    // A missing chunk is a damaged file, not a missing one.
    if (status == HW_NOT_FOUND)
        status = HW_FORMAT;
    if (status != HW_OK)
        goto out;
    *out = f;
    return HW_OK;
out:
    hw_progressive_file_close(f);
    return status;
}

void hw_progressive_file_close(hw_progressive_file *file)
{
    if (!file)
        return;
    hw_container_close(file->container);
    hw_progressive_head_free(&file->head);
    hw_free(file->path);
    hw_free(file);
}

const hw_progressive_file_info *hw_progressive_file_get_info(const hw_progressive_file *file)
{
    return &file->info;
}

const hw_progressive_block *hw_progressive_file_block(const hw_progressive_file *file,
                                                      uint32_t block)
{
    assert(block < file->head.block_count);
    return &file->head.blocks[block];
}

const uint32_t *hw_progressive_file_batches(const hw_progressive_file *file)
{
    return file->head.batches;
}

static hw_status read_block(const hw_progressive_file *f, uint32_t block, hw_progressive_reader *r)
{
    uint8_t *bytes[2] = {NULL, NULL};
    size_t size[2] = {0, 0};
    hw_status status =
        hw_container_chunk(f->container, TAG_CONNECTIVITY, block, &bytes[0], &size[0]);
    if (status == HW_OK)
        status = hw_container_chunk(f->container, TAG_GEOMETRY, block, &bytes[1], &size[1]);
    if (status == HW_OK) {
        status = hw_progressive_get_block(r, block, (const uint8_t *const *)bytes, size);
        if (status != HW_OK)
            (void)hw_fail_prefix(status, f->path);
    }
    hw_free(bytes[0]);
    hw_free(bytes[1]);
    return status;
}

static hw_status read_base(const hw_progressive_file *f, hw_progressive_reader *r)
{
    uint8_t *bytes = NULL;
    size_t size = 0;
    HW_TRY(hw_container_chunk(f->container, TAG_BASE, 0, &bytes, &size));
    hw_status status = hw_progressive_get_base(r, bytes, size);
    hw_free(bytes);
    return status == HW_OK ? status : hw_fail_prefix(status, f->path);
}

static hw_status read_finest(const hw_progressive_file *f, hw_progressive_reader *r)
{
    uint8_t *loose = NULL, *order = NULL;
    size_t loose_size = 0, order_size = 0;
    hw_status status = hw_container_chunk(f->container, TAG_LOOSE, 0, &loose, &loose_size);
    if (status == HW_OK)
        status = hw_container_chunk(f->container, TAG_ORDER, 0, &order, &order_size);
    if (status == HW_OK) {
        status = hw_progressive_get_finest(r, loose, loose_size, order, order_size);
        if (status != HW_OK)
            (void)hw_fail_prefix(status, f->path);
    }
    hw_free(loose);
    hw_free(order);
    return status;
}

hw_status hw_progressive_file_read(const hw_progressive_file *file, uint32_t blocks,
                                   hw_progressive **out)
{
    hw_status status = HW_OK;
    hw_progressive_reader r = {0};
    uint32_t all = file->head.block_count;
    *out = NULL;
    HW_GO(hw_progressive_reader_start(&r, &file->head));
    HW_GO(read_base(file, &r));
    for (uint32_t b = 0; b < blocks && b < all; b++)
        HW_GO(read_block(file, b, &r));
    if (blocks >= all && file->head.info.complete)
        HW_GO(read_finest(file, &r));
    HW_GO(hw_progressive_reader_finish(&r, out));
out:
    hw_progressive_reader_free(&r);
    return status;
}

hw_status hw_progressive_read(hw_progressive **out, const char *path)
{
    hw_progressive_file *file = NULL;
    *out = NULL;
    HW_TRY(hw_progressive_file_open(&file, path));
    hw_status status = hw_progressive_file_read(file, UINT32_MAX, out);
    hw_progressive_file_close(file);
    return status;
}
