#include "container.h"
#include "alloc.h"
#include "hash.h"
#include <assert.h>
#include <string.h>
#include <zstd.h>
#include <zstd_errors.h>

// FORMAT.md has the layout: header, table, hash of both, then the chunks without gaps.
#define HEADER_BYTES 32u
#define ENTRY_BYTES  40u
#define HASH_BYTES   8u
#define FRONT_BYTES  (HEADER_BYTES + HW_CONTAINER_CHUNKS_MAX * ENTRY_BYTES + HASH_BYTES)
_Static_assert(FRONT_BYTES == HW_CONTAINER_FRONT_MAX, "as the header says");

// A chunk may not claim to become larger than this: what a reader allocates is bounded by what the
// file holds.
#define RATIO_MAX   4096u
#define RATIO_SLACK 65536u
// zstd packs a block of up to 128 KiB into as little as 3 bytes, far beyond that ratio. Blocks are
// no longer than the window: 8 KiB blocks stay below 2731 : 1.
#define WINDOW_LOG_SMALL  13
#define COMPRESSION_LEVEL 9

typedef struct entry {
    uint32_t tag, number;
    uint64_t offset, stored, raw, hash;
} entry;

struct hw_container {
    char *name;
    hw_reader *reader;   // of a file
    const uint8_t *data; // of memory,
    uint64_t in_memory;  // so many bytes: of a front fewer than the file's
    uint64_t size, key;
    uint32_t count;
    entry *entries;
};

static uint64_t front_bytes(uint32_t count)
{
    return HEADER_BYTES + (uint64_t)count * ENTRY_BYTES + HASH_BYTES;
}

static bool ratio_is_fine(uint64_t raw, uint64_t stored)
{
    return raw <= HW_CHUNK_BYTES_MAX && raw <= RATIO_MAX * stored + RATIO_SLACK;
}

static size_t compress(ZSTD_CCtx *context, const hw_chunk *chunk, int window_log, uint8_t *out,
                       size_t capacity)
{
    // Parameters of a fresh context do not fail for values within zstd's stated bounds; if one
    // does, its error code is what compress2 would give.
    size_t code = ZSTD_CCtx_reset(context, ZSTD_reset_session_and_parameters);
    if (!ZSTD_isError(code))
        code = ZSTD_CCtx_setParameter(context, ZSTD_c_compressionLevel, COMPRESSION_LEVEL);
    if (!ZSTD_isError(code))
        code = ZSTD_CCtx_setParameter(context, ZSTD_c_checksumFlag, 1);
    if (!ZSTD_isError(code) && window_log)
        code = ZSTD_CCtx_setParameter(context, ZSTD_c_windowLog, window_log);
    if (ZSTD_isError(code))
        return code;
    return ZSTD_compress2(context, out, capacity, chunk->data, chunk->size);
}

static hw_status put_chunk(ZSTD_CCtx *context, const hw_chunk *chunk, hw_bytes_writer *body)
{
    if (chunk->size > HW_CHUNK_BYTES_MAX)
        return hw_fail(HW_LIMIT, "a chunk of %zu bytes, the limit is %llu", chunk->size,
                       (unsigned long long)HW_CHUNK_BYTES_MAX);
    uint8_t *out = NULL;
    size_t capacity = ZSTD_compressBound(chunk->size);
    HW_TRY(HW_NEW(&out, capacity));
    size_t size = compress(context, chunk, 0, out, capacity);
    if (!ZSTD_isError(size) && !ratio_is_fine(chunk->size, size))
        size = compress(context, chunk, WINDOW_LOG_SMALL, out, capacity);
    hw_status status = HW_OK;
    if (ZSTD_isError(size))
        status = hw_fail(ZSTD_getErrorCode(size) == ZSTD_error_memory_allocation ? HW_MEMORY
                                                                                 : HW_INTERNAL,
                         "compression failed: %s", ZSTD_getErrorName(size));
    else
        hw_put_bytes(body, out, size);
    hw_free(out);
    return status;
}

static void put_entry(hw_bytes_writer *w, const entry *e)
{
    hw_put_u32(w, e->tag);
    hw_put_u32(w, e->number);
    hw_put_u64(w, e->offset);
    hw_put_u64(w, e->stored);
    hw_put_u64(w, e->raw);
    hw_put_u64(w, e->hash);
}

static void put_header(hw_bytes_writer *w, uint32_t kind, uint64_t key, uint32_t count,
                       uint64_t file_bytes)
{
    hw_put_u32(w, kind);
    hw_put_u32(w, HW_CONTAINER_VERSION);
    hw_put_u64(w, key);
    hw_put_u32(w, count);
    hw_put_u32(w, 0);
    hw_put_u64(w, file_bytes);
}

// Compresses all chunks into `body` and lists them in `table`, offsets from the file's start.
static hw_status put_chunks(const hw_chunk *chunks, uint32_t count, hw_bytes_writer *body,
                            hw_bytes_writer *table)
{
    hw_status status = HW_OK;
    ZSTD_CCtx *context = ZSTD_createCCtx();
    if (!context)
        return hw_fail(HW_MEMORY, "out of memory for a compressor");
    for (uint32_t i = 0; i < count; i++) {
        size_t start = body->size;
        HW_GO(put_chunk(context, &chunks[i], body));
        HW_GO(hw_bytes_writer_check(body));
        entry e = {chunks[i].tag,      chunks[i].number, front_bytes(count) + start,
                   body->size - start, chunks[i].size,   0};
        e.hash = hw_hash(0, body->data + start, body->size - start);
        put_entry(table, &e);
    }
out:
    ZSTD_freeCCtx(context);
    return status;
}

hw_status hw_container_encode(uint32_t kind, uint64_t key, const hw_chunk *chunks, uint32_t count,
                              uint8_t **bytes, size_t *size)
{
    assert(count <= HW_CONTAINER_CHUNKS_MAX);
    hw_status status = HW_OK;
    hw_bytes_writer file = {0}, table = {0}, body = {0};
    *bytes = NULL;
    *size = 0;
    HW_GO(put_chunks(chunks, count, &body, &table));
    HW_GO(hw_bytes_writer_check(&table));
    put_header(&file, kind, key, count, front_bytes(count) + body.size);
    hw_put_bytes(&file, table.data, table.size);
    HW_GO(hw_bytes_writer_check(&file));
    hw_put_u64(&file, hw_hash(0, file.data, file.size));
    hw_put_bytes(&file, body.data, body.size);
    HW_GO(hw_bytes_writer_check(&file));
    *bytes = file.data;
    *size = file.size;
    file.data = NULL;
out:
    hw_bytes_writer_free(&file);
    hw_bytes_writer_free(&table);
    hw_bytes_writer_free(&body);
    return status;
}

hw_status hw_container_write(const char *path, uint32_t kind, uint64_t key, const hw_chunk *chunks,
                             uint32_t count)
{
    uint8_t *bytes = NULL;
    size_t size = 0;
    hw_status status = hw_container_encode(kind, key, chunks, count, &bytes, &size);
    if (status != HW_OK)
        return hw_fail_prefix(status, path);
    status = hw_file_write(path, bytes, size);
    hw_free(bytes);
    return status;
}

static hw_status read_at(const hw_container *c, uint64_t offset, void *out, size_t size)
{
    if (offset > c->size || size > c->size - offset)
        return hw_fail(HW_FORMAT, "%s: truncated: %llu bytes", c->name,
                       (unsigned long long)c->size);
    if (c->reader)
        return hw_reader_at(c->reader, offset, out, size);
    if (offset + size > c->in_memory)
        return hw_fail(HW_FORMAT, "%s: truncated: %llu bytes of its front", c->name,
                       (unsigned long long)c->in_memory);
    memcpy(out, c->data + offset, size);
    return HW_OK;
}

static hw_status fail_kind(const hw_container *c, uint32_t kind)
{
    return hw_fail(HW_FORMAT, "%s: not a %c%c%c%c file", c->name, (int)(kind & 127),
                   (int)(kind >> 8 & 127), (int)(kind >> 16 & 127), (int)(kind >> 24 & 127));
}

// The fixed part of the header: what the file is, and that it is as long as it says.
static hw_status read_header(hw_container *c, uint32_t kind)
{
    uint8_t bytes[HEADER_BYTES];
    if (c->size == 0 || (!c->reader && !c->data))
        return hw_fail(HW_FORMAT, "%s: the file is empty", c->name);
    HW_TRY(read_at(c, 0, bytes, sizeof bytes));
    hw_bytes_reader r = hw_bytes_reader_make(bytes, sizeof bytes);
    if (hw_get_u32(&r) != kind)
        return fail_kind(c, kind);
    uint32_t version = hw_get_u32(&r);
    if (version != HW_CONTAINER_VERSION)
        return hw_fail(HW_VERSION, "%s: container version %u, this program reads %u", c->name,
                       version, HW_CONTAINER_VERSION);
    c->key = hw_get_u64(&r);
    c->count = hw_get_u32(&r);
    uint32_t reserved = hw_get_u32(&r);
    uint64_t size = hw_get_u64(&r);
    if (reserved != 0)
        return hw_fail(HW_FORMAT, "%s: the header is damaged", c->name);
    if (size != c->size)
        return hw_fail(HW_FORMAT, "%s: %llu bytes, its header says %llu", c->name,
                       (unsigned long long)c->size, (unsigned long long)size);
    if (c->count > HW_CONTAINER_CHUNKS_MAX || front_bytes(c->count) > c->size)
        return hw_fail(HW_FORMAT, "%s: %u chunks do not fit", c->name, c->count);
    return HW_OK;
}

static hw_status check_entry(const hw_container *c, uint32_t index, uint64_t expected_offset)
{
    const entry *e = &c->entries[index];
    // Even an empty chunk is a frame. Of no bytes a source would read the whole file.
    if (e->offset != expected_offset || e->stored == 0 || e->stored > c->size - expected_offset)
        return hw_fail(HW_FORMAT, "%s: chunk %u lies outside of its place", c->name, index);
    if (!ratio_is_fine(e->raw, e->stored))
        return hw_fail(HW_FORMAT, "%s: chunk %u claims %llu bytes out of %llu", c->name, index,
                       (unsigned long long)e->raw, (unsigned long long)e->stored);
    for (uint32_t i = 0; i < index; i++)
        if (c->entries[i].tag == e->tag && c->entries[i].number == e->number)
            return hw_fail(HW_FORMAT, "%s: chunks %u and %u are the same", c->name, i, index);
    return HW_OK;
}

static hw_status read_table(hw_container *c)
{
    uint8_t front[FRONT_BYTES];
    size_t size = (size_t)front_bytes(c->count);
    HW_TRY(read_at(c, 0, front, size));
    hw_bytes_reader r = hw_bytes_reader_make(front, size);
    (void)hw_get_span(&r, HEADER_BYTES);
    HW_TRY(HW_NEW(&c->entries, c->count));
    for (uint32_t i = 0; i < c->count; i++) {
        entry *e = &c->entries[i];
        e->tag = hw_get_u32(&r);
        e->number = hw_get_u32(&r);
        e->offset = hw_get_u64(&r);
        e->stored = hw_get_u64(&r);
        e->raw = hw_get_u64(&r);
        e->hash = hw_get_u64(&r);
    }
    if (hw_get_u64(&r) != hw_hash(0, front, size - HASH_BYTES) || r.failed)
        return hw_fail(HW_FORMAT, "%s: the header is damaged", c->name);
    uint64_t offset = size;
    for (uint32_t i = 0; i < c->count; i++) {
        HW_TRY(check_entry(c, i, offset));
        offset += c->entries[i].stored;
    }
    if (offset != c->size)
        return hw_fail(HW_FORMAT, "%s: %llu bytes follow the last chunk", c->name,
                       (unsigned long long)(c->size - offset));
    return HW_OK;
}

static hw_status open_any(hw_container **out, const char *name, const char *path, const void *bytes,
                          size_t size, uint64_t file_bytes, uint32_t kind)
{
    hw_status status = HW_OK;
    hw_container *c = NULL;
    *out = NULL;
    HW_TRY(HW_NEW(&c, 1));
    HW_GO(hw_strdup(&c->name, name));
    if (path)
        HW_GO(hw_reader_open(&c->reader, path));
    c->data = bytes;
    c->in_memory = size;
    c->size = path ? hw_reader_size(c->reader) : file_bytes;
    HW_GO(read_header(c, kind));
    HW_GO(read_table(c));
    *out = c;
    return HW_OK;
out:
    hw_container_close(c);
    return status;
}

hw_status hw_container_open(hw_container **out, const char *path, uint32_t kind)
{
    return open_any(out, path, path, NULL, 0, 0, kind);
}

hw_status hw_container_open_memory(hw_container **out, const char *name, const void *bytes,
                                   size_t size, uint32_t kind)
{
    return open_any(out, name, NULL, bytes, size, size, kind);
}

hw_status hw_container_open_front(hw_container **out, const char *name, const void *bytes,
                                  size_t size, uint64_t file_bytes, uint32_t kind)
{
    return open_any(out, name, NULL, bytes, size, file_bytes, kind);
}

void hw_container_release(hw_container *container)
{
    container->data = NULL;
    container->in_memory = 0;
}

void hw_container_close(hw_container *container)
{
    if (!container)
        return;
    hw_reader_close(container->reader);
    hw_free(container->name);
    hw_free(container->entries);
    hw_free(container);
}

uint64_t hw_container_key(const hw_container *container)
{
    return container->key;
}

uint64_t hw_container_bytes(const hw_container *container)
{
    return container->size;
}

uint32_t hw_container_chunk_count(const hw_container *container)
{
    return container->count;
}

static hw_status find(const hw_container *c, uint32_t tag, uint32_t number, const entry **out)
{
    for (uint32_t i = 0; i < c->count; i++) {
        *out = &c->entries[i];
        if ((*out)->tag == tag && (*out)->number == number)
            return HW_OK;
    }
    return hw_fail(HW_NOT_FOUND, "%s: chunk %c%c%c%c %u is missing", c->name, (int)(tag & 127),
                   (int)(tag >> 8 & 127), (int)(tag >> 16 & 127), (int)(tag >> 24 & 127), number);
}

hw_status hw_container_chunk_size(const hw_container *container, uint32_t tag, uint32_t number,
                                  size_t *raw, size_t *stored)
{
    const entry *e = NULL;
    *raw = *stored = 0;
    HW_TRY(find(container, tag, number, &e));
    *raw = (size_t)e->raw;
    *stored = (size_t)e->stored;
    return HW_OK;
}

// One whole frame of exactly the size that the table states.
static bool frame_is_right(const entry *e, const uint8_t *stored)
{
    size_t frame = ZSTD_findFrameCompressedSize(stored, (size_t)e->stored);
    return !ZSTD_isError(frame) && frame == e->stored &&
           ZSTD_getFrameContentSize(stored, (size_t)e->stored) == e->raw;
}

hw_status hw_container_chunk_place(const hw_container *container, uint32_t tag, uint32_t number,
                                   uint64_t *offset, uint64_t *size)
{
    const entry *e = NULL;
    *offset = *size = 0;
    HW_TRY(find(container, tag, number, &e));
    *offset = e->offset;
    *size = e->stored;
    return HW_OK;
}

static hw_status unpack(const hw_container *c, const entry *e, const uint8_t *stored,
                        uint8_t **data)
{
    const int tag[4] = {(int)(e->tag & 127), (int)(e->tag >> 8 & 127), (int)(e->tag >> 16 & 127),
                        (int)(e->tag >> 24 & 127)};
    if (hw_hash(0, stored, (size_t)e->stored) != e->hash || !frame_is_right(e, stored))
        return hw_fail(HW_FORMAT, "%s: chunk %c%c%c%c %u is damaged", c->name, tag[0], tag[1],
                       tag[2], tag[3], e->number);
    HW_TRY(HW_NEW(data, (size_t)e->raw));
    size_t got = ZSTD_decompress(*data, (size_t)e->raw, stored, (size_t)e->stored);
    if (!ZSTD_isError(got) && got == e->raw)
        return HW_OK;
    hw_free(*data);
    *data = NULL;
    if (ZSTD_isError(got) && ZSTD_getErrorCode(got) == ZSTD_error_memory_allocation)
        return hw_fail(HW_MEMORY, "%s: out of memory for a decompressor", c->name);
    return hw_fail(HW_FORMAT, "%s: chunk %c%c%c%c %u does not decompress", c->name, tag[0], tag[1],
                   tag[2], tag[3], e->number);
}

hw_status hw_container_unpack(const hw_container *container, uint32_t tag, uint32_t number,
                              const uint8_t *stored, size_t stored_size, uint8_t **data,
                              size_t *size)
{
    const entry *e = NULL;
    *data = NULL;
    *size = 0;
    HW_TRY(find(container, tag, number, &e));
    if (stored_size != e->stored)
        return hw_fail(HW_FORMAT, "%s: truncated: %zu bytes of a chunk of %llu", container->name,
                       stored_size, (unsigned long long)e->stored);
    HW_TRY(unpack(container, e, stored, data));
    *size = (size_t)e->raw;
    return HW_OK;
}

hw_status hw_container_chunk(const hw_container *container, uint32_t tag, uint32_t number,
                             uint8_t **data, size_t *size)
{
    hw_status status = HW_OK;
    const entry *e = NULL;
    uint8_t *stored = NULL;
    *data = NULL;
    *size = 0;
    HW_TRY(find(container, tag, number, &e));
    HW_GO(HW_NEW(&stored, (size_t)e->stored));
    HW_GO(read_at(container, e->offset, stored, (size_t)e->stored));
    HW_GO(unpack(container, e, stored, data));
    *size = (size_t)e->raw;
out:
    hw_free(stored);
    return status;
}
