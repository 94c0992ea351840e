// A queue of fixed capacity between two threads, one that puts and one that takes. Neither ever
// waits: there are no locks.
#pragma once
#include "status.h"
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

typedef struct hw_ring {
    _Atomic uint32_t put, taken; // counts since the start; they may wrap
    uint32_t mask;
    size_t item_bytes;
    uint8_t *items;
} hw_ring;

// capacity: a power of two. Free with hw_ring_free.
HW_MUST_USE hw_status hw_ring_create(hw_ring *out, uint32_t capacity, size_t item_bytes);
void hw_ring_free(hw_ring *ring);
// Copies the item in; false if the ring is full. Only the putting thread.
bool hw_ring_put(hw_ring *ring, const void *item);
// Copies the oldest item out; false if there is none. Only the taking thread.
bool hw_ring_take(hw_ring *ring, void *item);
// How many there are, or were a moment ago.
uint32_t hw_ring_count(const hw_ring *ring);
