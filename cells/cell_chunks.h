// Between a cell and its chunks: what cell_file.c stores in a container, open to tests and fuzzers,
// which come here past the checksums.
#pragma once
#include "cell_file.h"

// FORMAT.md describes each. All are always there, if empty.
#define HW_CELL_CHUNK_LIST(X)                                                                      \
    X(INFO, HW_FOURCC('I', 'N', 'F', 'O'))                                                         \
    X(NEAR, HW_FOURCC('N', 'E', 'A', 'R'))                                                         \
    X(FARS, HW_FOURCC('F', 'A', 'R', 'S'))                                                         \
    X(VERT, HW_FOURCC('V', 'E', 'R', 'T'))                                                         \
    X(INDX, HW_FOURCC('I', 'N', 'D', 'X'))                                                         \
    X(VIEW, HW_FOURCC('V', 'I', 'E', 'W'))                                                         \
    X(RNGE, HW_FOURCC('R', 'N', 'G', 'E'))                                                         \
    X(COLR, HW_FOURCC('C', 'O', 'L', 'R'))                                                         \
    X(ATLS, HW_FOURCC('A', 'T', 'L', 'S'))                                                         \
    X(COVR, HW_FOURCC('C', 'O', 'V', 'R'))

enum {
#define X(name, tag) HW_CELL_CHUNK_##name,
    HW_CELL_CHUNK_LIST(X)
#undef X
        HW_CELL_CHUNK_COUNT
};

// Raw (decompressed) chunks; owns the bytes. Zero-initialise.
typedef struct hw_cell_chunks {
    uint8_t *data[HW_CELL_CHUNK_COUNT];
    size_t size[HW_CELL_CHUNK_COUNT];
} hw_cell_chunks;

void hw_cell_chunks_free(hw_cell_chunks *chunks);
// cell must be valid.
HW_MUST_USE hw_status hw_cell_to_chunks(const hw_cell *cell, hw_cell_chunks *out);
// Checks everything; `key` and `name` are handed through. On failure *out is zeroed.
HW_MUST_USE hw_status hw_cell_from_chunks(const char *name, uint64_t key,
                                          const hw_cell_chunks *chunks, hw_cell *out);
