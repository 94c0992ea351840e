// What is to be fetched, by urgency: the priority queue of thesis 5.2.2. Belongs to one thread;
// never allocates.
#pragma once
#include <stdbool.h>
#include <stdint.h>

// A piece of a dataset that is loaded as a whole.
typedef enum hw_data_kind {
    HW_DATA_CELL,    // index: of the manifest's cells
    HW_DATA_MESH,    // a near mesh's table of levels
    HW_DATA_LEVEL,   // one of its levels
    HW_DATA_TEXTURE, // of near meshes
} hw_data_kind;

typedef struct hw_data_key {
    hw_data_kind kind;
    uint32_t index; // cell, mesh or texture
    uint32_t level; // HW_DATA_LEVEL; else 0
} hw_data_key;

// t_priority is the sum of the timestamp at which it was wished for and a priority in [0, 1): what
// was wished for later is more urgent.
typedef struct hw_wish {
    hw_data_key key;
    double t_priority;
} hw_wish;

#define HW_PREFETCH_QUEUE_MAX 1024u
#define HW_PREFETCH_STALE     2.0 // timestamps after which a wish counts no more

typedef struct hw_prefetch_queue {
    uint32_t count;
    hw_wish wishes[HW_PREFETCH_QUEUE_MAX]; // in no order
} hw_prefetch_queue;

bool hw_data_key_equal(hw_data_key a, hw_data_key b);
// Adds the wish, or makes it as urgent as it now is if it was there. A full queue gives up its
// least urgent wish, which may be the new one: true, and *lost is that.
bool hw_prefetch_queue_put(hw_prefetch_queue *queue, const hw_wish *wish, hw_wish *lost);
// Copies, or takes out, the most urgent wish; false if the queue is empty.
bool hw_prefetch_queue_peek(const hw_prefetch_queue *queue, hw_wish *out);
bool hw_prefetch_queue_take(hw_prefetch_queue *queue, hw_wish *out);
// Takes out a wish whose t-priority is below timestamp - HW_PREFETCH_STALE; false if there is none.
bool hw_prefetch_queue_drop(hw_prefetch_queue *queue, double timestamp, hw_wish *out);
