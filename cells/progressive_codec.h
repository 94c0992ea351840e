// The chunks of a progressive mesh; open to tests and fuzzers, which come here past the checksums.
// FORMAT.md has the layout.
#pragma once
#include "progressive_file.h"
#include "progressive_predict.h"

// Bytes of CONN and of DELT for a record, at least and exactly.
#define HW_CONNECTIVITY_BYTES 7u
#define HW_GEOMETRY_BYTES     24u

// The chunk HEAD.
typedef struct hw_progressive_head {
    hw_progressive_info info;
    uint32_t *batches; // [info.batch_count] records of each
    uint32_t block_count;
    hw_progressive_block blocks[HW_PROGRESSIVE_BLOCKS_MAX]; // stored_bytes is not in the chunk
} hw_progressive_head;

// The head of a file with the first `records` of p.
HW_MUST_USE hw_status hw_progressive_head_make(const hw_progressive *p, uint32_t records,
                                               hw_progressive_head *out);
HW_MUST_USE hw_status hw_progressive_head_encode(const hw_progressive_head *head, uint8_t **bytes,
                                                 size_t *size);
// On failure *out is zeroed. Messages have no file name here and below.
HW_MUST_USE hw_status hw_progressive_head_decode(const uint8_t *bytes, size_t size,
                                                 hw_progressive_head *out);
void hw_progressive_head_free(hw_progressive_head *head);

// Follows a mesh from the base on, record by record in the order of the file.
typedef struct hw_progressive_writer {
    const hw_progressive *p;
    const hw_progressive_head *head;
    uint32_t *corners; // of the state that it has come to
    int32_t (*codes)[3];
    hw_links links;
    hw_fan fan;
} hw_progressive_writer;

// p and head must outlive the writer. Free in any case.
HW_MUST_USE hw_status hw_progressive_writer_start(hw_progressive_writer *w, const hw_progressive *p,
                                                  const hw_progressive_head *head);
void hw_progressive_writer_free(hw_progressive_writer *w);
// Chunks into new blocks (hw_free): BASE; CONN and DELT of one block after the other; LOOS; ORDR.
HW_MUST_USE hw_status hw_progressive_put_base(const hw_progressive_writer *w, uint8_t **bytes,
                                              size_t *size);
HW_MUST_USE hw_status hw_progressive_put_block(hw_progressive_writer *w, uint32_t block,
                                               uint8_t *bytes[2], size_t size[2]);
HW_MUST_USE hw_status hw_progressive_put_loose(const hw_progressive *p, uint8_t **bytes,
                                               size_t *size);
HW_MUST_USE hw_status hw_progressive_put_order(const hw_progressive *p, uint8_t **bytes,
                                               size_t *size);

// Builds a mesh from chunks in the order of the file. What it allocates is bounded by the sizes of
// the chunks it is given.
typedef struct hw_progressive_reader {
    const hw_progressive_head *head;
    hw_progressive *p;
    hw_links links;
    hw_fan fan;
    size_t moved_capacity;
    uint32_t batch; // that the next record belongs to
    uint32_t batch_end;
} hw_progressive_reader;

// head must outlive the reader. Free in any case.
HW_MUST_USE hw_status hw_progressive_reader_start(hw_progressive_reader *r,
                                                  const hw_progressive_head *head);
void hw_progressive_reader_free(hw_progressive_reader *r);
HW_MUST_USE hw_status hw_progressive_get_base(hw_progressive_reader *r, const uint8_t *bytes,
                                              size_t size);
HW_MUST_USE hw_status hw_progressive_get_block(hw_progressive_reader *r, uint32_t block,
                                               const uint8_t *const bytes[2], const size_t size[2]);
// After the last block, if the file is complete.
HW_MUST_USE hw_status hw_progressive_get_finest(hw_progressive_reader *r, const uint8_t *loose,
                                                size_t loose_size, const uint8_t *order,
                                                size_t order_size);
// The mesh, of as many blocks as were given; complete if the finest level was.
HW_MUST_USE hw_status hw_progressive_reader_finish(hw_progressive_reader *r, hw_progressive **out);

// Shared by both sides.
// Whether hubs make the work too much: over 256 steps for each face up to the end of the block.
bool hw_progressive_too_much_work(const hw_links *links, uint32_t end_face);
static inline uint32_t hw_zigzag(uint32_t difference)
{
    return difference << 1 ^ (difference >> 31 ? UINT32_MAX : 0);
}
static inline uint32_t hw_unzigzag(uint32_t value)
{
    return value >> 1 ^ (value & 1 ? UINT32_MAX : 0);
}
