// A scratch file that takes blocks out of the heap and gives them back as read-only memory: their
// pages come in when they are read, and go when memory is short.
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stdint.h>

typedef struct hw_spill hw_spill;

// The file lies in the folder but has no name there: it vanishes with the process, however that
// ends.
HW_MUST_USE hw_status hw_spill_create(hw_spill **out, const char *folder);
// Unmaps everything. NULL is legal.
void hw_spill_destroy(hw_spill *spill);

typedef struct hw_spill_block {
    const void *data; // NULL stays NULL
    size_t size;
    void *mapped; // out: the same bytes, aligned to 64, until the spill is destroyed; read only
} hw_spill_block;
// Writes the blocks as one region. The caller still owns `data`. HW_IO names the folder (a full
// disk). Thread-safe, like all that follows.
HW_MUST_USE hw_status hw_spill_put(hw_spill *spill, hw_spill_block *blocks, uint32_t count,
                                   uint32_t *region);
// Marks a region as used now.
void hw_spill_touch(hw_spill *spill, uint32_t region);
// Gives back the memory of the least recently used half of the regions, or of all. What is read
// later, even at this moment by another thread, comes in again.
void hw_spill_drop(hw_spill *spill, bool all);
uint64_t hw_spill_bytes(hw_spill *spill);
