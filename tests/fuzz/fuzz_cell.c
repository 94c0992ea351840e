// Cell files. The first byte of the input picks: 0, a whole file follows; else the six chunks of a
// cell follow, past container and checksums: for each its size (u32) and its bytes.
#include "bytes.h"
#include "cell_chunks.h"
#include "fuzz_target.h"
#include <stdlib.h>
#include <string.h>

bool fuzz_accepted;

// Blocks of their own, so that a sanitizer sees a read beyond the end of a chunk.
static void copy_chunks(hw_bytes_reader *r, hw_cell_chunks *out)
{
    for (int i = 0; i < HW_CELL_CHUNK_COUNT; i++) {
        size_t size = hw_get_u32(r);
        if (size > hw_bytes_left(r))
            size = hw_bytes_left(r);
        out->data[i] = malloc(size ? size : 1);
        if (!out->data[i])
            abort();
        hw_get_bytes(r, out->data[i], size);
        out->size[i] = size;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    hw_cell cell = {0};
    fuzz_accepted = false;
    if (size == 0)
        return 0;
    if (data[0] == 0) {
        fuzz_accepted = hw_cell_decode("fuzz", data + 1, size - 1, &cell) == HW_OK;
    } else {
        hw_bytes_reader r = hw_bytes_reader_make(data + 1, size - 1);
        hw_cell_chunks chunks = {0};
        copy_chunks(&r, &chunks);
        fuzz_accepted = hw_cell_from_chunks("fuzz", 1, &chunks, &cell) == HW_OK;
        hw_cell_chunks_free(&chunks);
    }
    // What was read can be written: validation and packing accept it.
    if (fuzz_accepted) {
        hw_cell_chunks again = {0};
        if (hw_cell_validate(&cell, "accepted") != HW_OK ||
            hw_cell_to_chunks(&cell, &again) != HW_OK)
            abort();
        hw_cell_chunks_free(&again);
    }
    hw_cell_free(&cell);
    return 0;
}
