// What an hw_progressive is made of, for the files that make, move, write and read one.
#pragma once
#include "progressive.h"

#define HW_NO_INDEX UINT32_MAX

// Why the state depends on nothing but the set of applied records: in a batch no vertex is kept or
// removed by more than one record, so each corner changes between at most two vertices, and which
// of them it has depends on one record. `moved` lists for each record the corners that have its
// removed vertex once all of its batch is applied, whoever brings their faces. Corners of faces
// that are not there yet take part: they always have what they should show when they appear.
struct hw_progressive {
    hw_progressive_info info;
    uint32_t vertex_count;  // of base and records, without loose ones
    uint32_t face_count;    // of base and records
    uint32_t *corners;      // [3 * face_count] vertices
    int32_t (*codes)[3];    // [vertex_count + loose vertices] positions; of a vertex that is not
                            // there, those that it will come back with
    uint32_t *kept;         // [records]
    int32_t (*deltas)[3];   // [records] code of `kept` after the split minus before, modulo 2^32
    uint32_t *first_face;   // [records + 1]
    uint32_t *first_moved;  // [records + 1] into moved
    uint32_t *moved;        // corners
    uint32_t *batch_first;  // [batches + 1]
    uint64_t *applied;      // a bit for each record
    uint32_t applied_count; // how many of them
    uint32_t gap;           // all records below are applied
    uint32_t top;           // none from here on
    uint32_t live_faces;    // without loose ones
    // The finest level: [copy, what it is a copy of] in rising order; faces that took no part.
    uint32_t (*copies)[2];
    uint32_t (*loose_faces)[3];
    // If keep_order: for each vertex of the finest level in canonical order, and each face, its
    // number in the original; and which of its corners is the original's first.
    uint32_t *vertex_order, *face_order;
    uint8_t *face_turns; // [face_count]; loose faces are not turned
};

// Canonical numbers of base, record and loose vertices: below this.
uint32_t hw_progressive_all_vertices(const hw_progressive *p);
// Vertices and faces of the finest level, whether p is complete or not.
uint32_t hw_progressive_finest_vertices(const hw_progressive *p);
uint32_t hw_progressive_finest_faces(const hw_progressive *p);
// Copies, loose faces and order, with p at its finest: what a writer may write and a reader accept.
HW_MUST_USE hw_status hw_progressive_check_finest(const hw_progressive *p);
// Marks all records applied, where the arrays are already at the finest.
void hw_progressive_mark_all(hw_progressive *p);
// The record's step on other arrays than p's own (corners and codes of the same sizes).
void hw_progressive_put(const hw_progressive *p, uint32_t record, bool split, uint32_t *corners,
                        int32_t (*codes)[3]);

static inline bool hw_progressive_bit(const hw_progressive *p, uint32_t record)
{
    return p->applied[record / 64] >> (record % 64) & 1;
}
