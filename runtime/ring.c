#include "ring.h"
#include "alloc.h"
#include <assert.h>
#include <string.h>

hw_status hw_ring_create(hw_ring *out, uint32_t capacity, size_t item_bytes)
{
    assert(capacity > 0 && (capacity & (capacity - 1)) == 0);
    *out = (hw_ring){.mask = capacity - 1, .item_bytes = item_bytes};
    return hw_alloc((void **)&out->items, capacity, item_bytes);
}

void hw_ring_free(hw_ring *ring)
{
    hw_free(ring->items);
    ring->items = NULL;
}

// The counters are ordered so that an item is seen whole, and its place is free before it is used
// again.
bool hw_ring_put(hw_ring *ring, const void *item)
{
    uint32_t put = atomic_load_explicit(&ring->put, memory_order_relaxed);
    uint32_t taken = atomic_load_explicit(&ring->taken, memory_order_acquire);
    if (put - taken > ring->mask)
        return false;
    memcpy(ring->items + (put & ring->mask) * ring->item_bytes, item, ring->item_bytes);
    atomic_store_explicit(&ring->put, put + 1, memory_order_release);
    return true;
}

bool hw_ring_take(hw_ring *ring, void *item)
{
    uint32_t taken = atomic_load_explicit(&ring->taken, memory_order_relaxed);
    if (atomic_load_explicit(&ring->put, memory_order_acquire) == taken)
        return false;
    memcpy(item, ring->items + (taken & ring->mask) * ring->item_bytes, ring->item_bytes);
    atomic_store_explicit(&ring->taken, taken + 1, memory_order_release);
    return true;
}

uint32_t hw_ring_count(const hw_ring *ring)
{
    uint32_t taken = atomic_load_explicit(&ring->taken, memory_order_acquire);
    return atomic_load_explicit(&ring->put, memory_order_acquire) - taken;
}
