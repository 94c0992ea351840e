// The queue of edge collapses: a heap of what edges cost, made for an engine that changes the cost
// of some twenty edges with every collapse.
//
// GeMS keeps one record per edge and a hash table to find it, so that records can be erased and
// reinserted. This queue never searches: vertices carry two counters, an entry remembers their
// sums, and an entry that does not match them is out of date. The *generation* of a vertex rises
// when it was merged: its old entries are dropped where they come up, new ones were pushed. It is
// *touched* when a neighbour was merged: its entries are evaluated again only when they come up,
// which most never do. Entries out of date are purged when the heap is full, so it holds little
// more than the edges of the mesh at the start. That saves the hash table, and against evaluating
// all touched edges at once, as GeMS does, more than half of the time, for distances that are less
// than one percent larger (the dragon, to a tenth).
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stdint.h>

typedef struct hw_queue_entry {
    uint32_t a;
    float cost;                   // not negative
    uint32_t b;                   // above a
    uint16_t generation, touched; // sums over both ends when evaluated, modulo 2^16
} hw_queue_entry;

typedef struct hw_collapse_queue {
    hw_queue_entry *heap;
    uint32_t count, capacity;
    uint16_t *generation, *touched; // per vertex
    uint32_t *mark;                 // per vertex: scratch for walks round vertices
    uint32_t vertex_count, mark_value;
    bool filled; // holds the edges of the mesh as it is
} hw_collapse_queue;

HW_MUST_USE hw_status hw_collapse_queue_create(uint32_t vertex_count, hw_collapse_queue **out);
void hw_collapse_queue_destroy(hw_collapse_queue *queue);
// Room for a mesh with that many edges. Empties the queue.
HW_MUST_USE hw_status hw_collapse_queue_reset(hw_collapse_queue *queue, uint32_t edges);
// An entry for the edge as of now.
hw_queue_entry hw_collapse_queue_entry(const hw_collapse_queue *queue, uint32_t a, uint32_t b,
                                       double cost);
bool hw_collapse_queue_is_old(const hw_collapse_queue *queue, const hw_queue_entry *entry);
bool hw_collapse_queue_is_touched(const hw_collapse_queue *queue, const hw_queue_entry *entry);
HW_MUST_USE hw_status hw_collapse_queue_push(hw_collapse_queue *queue, hw_queue_entry entry);
// Adds without order; hw_collapse_queue_order comes after the last.
void hw_collapse_queue_append(hw_collapse_queue *queue, hw_queue_entry entry);
void hw_collapse_queue_order(hw_collapse_queue *queue);
// Of a queue that is not empty.
hw_queue_entry hw_collapse_queue_pop(hw_collapse_queue *queue);
// A mark that no vertex has yet.
uint32_t hw_collapse_queue_new_mark(hw_collapse_queue *queue);
