// Progressive meshes as files, type .hxp: the base, then blocks of records from coarse to fine, so
// that the first blocks are a coarser mesh. Layout in FORMAT.md.
#pragma once
#include "container.h"
#include "progressive.h"

#define HW_PROGRESSIVE_MAGIC      HW_FOURCC('H', 'X', 'W', 'P')
#define HW_PROGRESSIVE_VERSION    1u
#define HW_PROGRESSIVE_BLOCKS_MAX 100u

// Writes the first `records` of p (at most all of them; fewer make a file without the finest
// level). The state of p does not matter. Atomic, deterministic. HW_LIMIT if very many faces meet
// at vertices again and again.
HW_MUST_USE hw_status hw_progressive_write(const hw_progressive *p, uint32_t records,
                                           const char *path, uint64_t key);
// The size of that file in bytes, by encoding it: for a search by halves. Grows with `records` but
// for a few bytes of the compressor's whims.
HW_MUST_USE hw_status hw_progressive_encoded_bytes(const hw_progressive *p, uint32_t records,
                                                   uint64_t *bytes);
// Reads a whole file and checks everything. The state is the finest.
HW_MUST_USE hw_status hw_progressive_read(hw_progressive **out, const char *path);

typedef struct hw_progressive_file hw_progressive_file;

typedef struct hw_progressive_block {
    uint32_t first_record, record_count; // ends where a batch does
    uint32_t face_count;                 // that it brings
    uint64_t stored_bytes;
} hw_progressive_block;

typedef struct hw_progressive_file_info {
    hw_progressive_info mesh;          // of all records in the file
    uint32_t vertex_count, face_count; // of the finest level in the file
    uint32_t block_count;
    uint64_t key, file_bytes;
    // Stored bytes by kind of chunk; the rest is the container's table.
    uint64_t head_bytes, base_bytes, connectivity_bytes, geometry_bytes, loose_bytes, order_bytes;
} hw_progressive_file_info;

// Opens and checks header and tables.
HW_MUST_USE hw_status hw_progressive_file_open(hw_progressive_file **out, const char *path);
void hw_progressive_file_close(hw_progressive_file *file); // NULL is legal
const hw_progressive_file_info *hw_progressive_file_get_info(const hw_progressive_file *file);
const hw_progressive_block *hw_progressive_file_block(const hw_progressive_file *file,
                                                      uint32_t block);
// Records in each of the batches, coarse to fine (batch_count of them).
const uint32_t *hw_progressive_file_batches(const hw_progressive_file *file);
// Reads the base and the first `blocks` blocks (at most all; then also the finest level), no other
// bytes. Thread-safe.
HW_MUST_USE hw_status hw_progressive_file_read(const hw_progressive_file *file, uint32_t blocks,
                                               hw_progressive **out);
