// Which corners meet at a vertex, and how a split divides them: what the writer and the reader of
// progressive meshes follow record by record. Moves in memory do without (progressive_internal.h).
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct hw_links {
    uint32_t *head; // [vertices] a corner of it, or none
    uint32_t *next; // [corners] another corner of the same vertex, or none
    uint32_t *mark; // [vertices] 0 between calls
    uint32_t vertex_count, face_count;
    uint64_t steps; // corners visited so far: a measure of work
} hw_links;

// Grows to at least so many; new vertices have no corners. Free with hw_links_free.
HW_MUST_USE hw_status hw_links_grow(hw_links *links, uint32_t vertices, uint32_t faces);
void hw_links_free(hw_links *links);
void hw_links_add_face(hw_links *links, const uint32_t *corners, uint32_t face);

// The faces round a vertex. If they are one fan: in counter-clockwise order, from its first face if
// it is open, else from the face with the least number.
typedef struct hw_fan {
    uint32_t count;
    uint32_t *corners;   // [count] those of the vertex, rising
    uint32_t *order;     // [count] indices into corners, round the vertex
    uint32_t *ring;      // [ring_count] the vertices round it
    uint32_t ring_count; // count if closed, count + 1 if open, 0 if the faces are not one fan
    uint8_t *moved;      // [count] which corners a split gives to the new vertex
    uint8_t *trial;      // [count]
    size_t corner_capacity, order_capacity, ring_capacity, moved_capacity, trial_capacity;
} hw_fan;

// moved is zeroed. Free with hw_fan_free.
HW_MUST_USE hw_status hw_fan_look(hw_fan *fan, hw_links *links, const uint32_t *corners,
                                  uint32_t vertex);
void hw_fan_free(hw_fan *fan);

// A split of vertex k inserts vertex l and one or two faces at their edge: *against* it, (k, n, l),
// where n is the ring's vertex s; *along* it, (k, l, n), where n is the ring's vertex e.
typedef enum hw_split_kind {
    HW_SPLIT_BOTH,     // l takes the faces from s to e = (s + t) mod ring_count; none if t is 0,
                       // all if t is ring_count. Across the gap of an open fan if e < s.
    HW_SPLIT_AGAINST,  // of an open fan: l takes the faces from s on
    HW_SPLIT_ALONG,    // of an open fan: l takes the faces up to s (which is e)
    HW_SPLIT_EXPLICIT, // anything else: written out
    HW_SPLIT_KINDS
} hw_split_kind;

// Fills fan->moved; false if the fan cannot be split so.
bool hw_fan_divide(hw_fan *fan, hw_split_kind kind, uint32_t s, uint32_t t);
// Finds kind, s and t that give fan->moved and insert faces with these vertices (HW_NO_INDEX: no
// such face). HW_SPLIT_EXPLICIT if there are none.
hw_split_kind hw_fan_recognise(const hw_fan *fan, uint32_t against, uint32_t along, uint32_t *s,
                               uint32_t *t);
// Gives the fan's moved corners, which belong to k, to l; links alone.
void hw_fan_move(const hw_fan *fan, hw_links *links, uint32_t k, uint32_t l);
