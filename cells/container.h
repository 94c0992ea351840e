// The chunked file under cells and meshes: header (magic, version, key, chunk table), then chunks,
// each a zstd frame with checksum. Layout in FORMAT.md. Reading checks every length, offset and
// checksum; nothing is trusted.
#pragma once
#include "bytes.h"
#include "file.h"
#include "status.h"

#define HW_CONTAINER_VERSION    1u
#define HW_CONTAINER_CHUNKS_MAX 256u
#define HW_CHUNK_BYTES_MAX      (UINT64_C(1) << 31)
#define HW_FILE_NAME_BYTES      64u // room for the name of any file below its dataset
#define HW_FOURCC(a, b, c, d)                                                                      \
    ((uint32_t)(a) | (uint32_t)(b) << 8 | (uint32_t)(c) << 16 | (uint32_t)(d) << 24)

typedef struct hw_chunk {
    uint32_t tag;    // HW_FOURCC
    uint32_t number; // several chunks may share a tag (levels of a mesh)
    const void *data;
    size_t size;
} hw_chunk;

// Writes all chunks atomically. `kind` is the magic of the file type; `key` the hash of the inputs
// the content was made from.
HW_MUST_USE hw_status hw_container_write(const char *path, uint32_t kind, uint64_t key,
                                         const hw_chunk *chunks, uint32_t count);
// The same into memory (*bytes freed with hw_free).
HW_MUST_USE hw_status hw_container_encode(uint32_t kind, uint64_t key, const hw_chunk *chunks,
                                          uint32_t count, uint8_t **bytes, size_t *size);

// An open container: a file or a block of memory (borrowed, must outlive it). `name` is for
// messages.
typedef struct hw_container hw_container;
HW_MUST_USE hw_status hw_container_open(hw_container **out, const char *path, uint32_t kind);
HW_MUST_USE hw_status hw_container_open_memory(hw_container **out, const char *name,
                                               const void *bytes, size_t size, uint32_t kind);
// From the first `size` bytes of a file of `file_bytes`, which hold at least header and table (so
// does everything up to HW_CONTAINER_FRONT_MAX). Borrows the bytes; chunks beyond them are had with
// hw_container_unpack.
#define HW_CONTAINER_FRONT_MAX (40u + HW_CONTAINER_CHUNKS_MAX * 40u)
HW_MUST_USE hw_status hw_container_open_front(hw_container **out, const char *name,
                                              const void *bytes, size_t size, uint64_t file_bytes,
                                              uint32_t kind);
// Forgets the borrowed bytes of hw_container_open_front: from now on only hw_container_unpack
// gives chunks.
void hw_container_release(hw_container *container);
void hw_container_close(hw_container *container);
uint64_t hw_container_key(const hw_container *container);
uint64_t hw_container_bytes(const hw_container *container);
uint32_t hw_container_chunk_count(const hw_container *container);
// Size of a chunk once decompressed / as stored; HW_NOT_FOUND if there is none.
HW_MUST_USE hw_status hw_container_chunk_size(const hw_container *container, uint32_t tag,
                                              uint32_t number, size_t *raw, size_t *stored);
// Decompresses one chunk into a new block (hw_free). Only its bytes are read. Thread-safe.
HW_MUST_USE hw_status hw_container_chunk(const hw_container *container, uint32_t tag,
                                         uint32_t number, uint8_t **data, size_t *size);
// Where a chunk lies in the file, and the same decompression from its `size` bytes there, fetched
// by the caller. Thread-safe.
HW_MUST_USE hw_status hw_container_chunk_place(const hw_container *container, uint32_t tag,
                                               uint32_t number, uint64_t *offset, uint64_t *size);
HW_MUST_USE hw_status hw_container_unpack(const hw_container *container, uint32_t tag,
                                          uint32_t number, const uint8_t *stored,
                                          size_t stored_size, uint8_t **data, size_t *size);
