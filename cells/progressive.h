// Progressive meshes: a coarse base mesh and the vertex splits that lead from it to the original
// (GeMS, section 5), in strict order or in batches whose splits are independent of each other
// (section 6). A split is the inverse of an edge collapse that merged `removed` into `kept`, moved
// `kept`, and took away the one or two faces at their edge.
//
// Numbers are canonical: base vertices and faces first; record i (coarse to fine) brings vertex
// base_vertex_count + i and the next one or two faces. The finest level is the original: copies of
// vertices merge with what they are copies of, and faces that took no part come back.
//
// One thread at a time may use an hw_progressive; const functions may run at the same time.
#pragma once
#include "mesh.h"
#include "position_grid.h"

#define HW_PROGRESSIVE_VERTICES_MAX (1u << 28) // copies and loose ones included
#define HW_PROGRESSIVE_FACES_MAX    (1u << 28)

// An edge collapse in the numbers of whoever carried it out.
typedef struct hw_progressive_collapse {
    uint32_t kept, removed;              // vertices
    uint32_t faces[2];                   // removed faces; faces[1] is UINT32_MAX if there is one
    uint32_t face_corners[2][3];         // their vertices just before, counter-clockwise
    uint32_t first_corner, corner_count; // of `corners`: those that were `removed`, now `kept`
    float kept_before[3], removed_before[3], merged[3];
} hw_progressive_collapse;

// What a simplifier did. All positions lie on the grid (hw_position_grid_snap).
typedef struct hw_progressive_source {
    uint32_t vertex_count, face_count; // of the arrays below, alive or not
    const float (*positions)[3];       // at the end, of what is not removed
    const uint32_t (*faces)[3];        // at the end; [0] is UINT32_MAX where there is no face
    const hw_progressive_collapse *collapses; // fine to coarse, as carried out
    uint32_t collapse_count;
    const uint32_t *corners; // 3 * face + i, of faces that stay
    // Collapses in each batch, as carried out; none is empty, the sum is collapse_count. In a batch
    // every vertex is kept or removed by one collapse at most. batch_count 0: a strict order.
    const uint32_t *batches;
    uint32_t batch_count;
    // What was changed before the first collapse. source[v] == v for v < original_vertex_count; for
    // the others the original that v is a copy of (same position). NULL: there are no copies.
    const uint32_t *source;
    uint32_t original_vertex_count; // at most vertex_count
    // Faces of the original that took no part, by original vertices. Vertices of no other face are
    // loose: they have a position above, and come back with the finest level alone.
    const uint32_t (*loose_faces)[3];
    uint32_t loose_face_count;
    // For keep_order: the number in the original of each face that ever was; NULL: its own number.
    // Loose faces have the numbers that remain, in rising order. Faces are not rotated.
    const uint32_t *face_numbers;
} hw_progressive_source;

typedef struct hw_progressive hw_progressive;

// HW_FORMAT if the source contradicts itself, its batches are not independent, or a position is not
// on the grid. keep_order: the finest level gives the original's very arrays, at the cost of some
// bytes; else vertices and faces come in canonical order. The state is the finest. The source is
// not needed afterwards.
HW_MUST_USE hw_status hw_progressive_create(hw_progressive **out, const hw_position_grid *grid,
                                            const hw_progressive_source *source, bool keep_order);
void hw_progressive_destroy(hw_progressive *p); // NULL is legal

typedef struct hw_progressive_info {
    hw_position_grid grid;
    uint32_t base_vertex_count, base_face_count;
    uint32_t record_count;
    uint32_t batch_count; // 0: strict order
    uint32_t copy_count;  // vertices that merge at the finest level
    uint32_t loose_vertex_count, loose_face_count;
    bool complete; // false if only the first records were read: there is no finest level
    bool keep_order;
} hw_progressive_info;
hw_progressive_info hw_progressive_get_info(const hw_progressive *p);
// Records first to first + count - 1 of batch b, coarse to fine. In a strict order every record is
// a batch.
void hw_progressive_batch(const hw_progressive *p, uint32_t batch, uint32_t *first,
                          uint32_t *count);
// Of the mesh with the first n records applied; with all of them, that of the original.
uint32_t hw_progressive_faces_at(const hw_progressive *p, uint32_t n);
uint32_t hw_progressive_vertices_at(const hw_progressive *p, uint32_t n);

typedef struct hw_progressive_record {
    uint32_t kept, removed;          // vertices
    uint32_t first_face, face_count; // 1 or 2
} hw_progressive_record;
hw_progressive_record hw_progressive_get_record(const hw_progressive *p, uint32_t record);

// --- State: which records are applied ------------------------------------------------------------
// All of the batches before some batch, none of those after it, any of that batch. The mesh depends
// on that set alone, not on how it was reached. Moves allocate nothing and cost as much as the
// record has corners (some six).

uint32_t hw_progressive_applied_count(const hw_progressive *p);
bool hw_progressive_is_applied(const hw_progressive *p, uint32_t record);
// Of what hw_progressive_extract gives.
uint32_t hw_progressive_face_count(const hw_progressive *p);
uint32_t hw_progressive_vertex_count(const hw_progressive *p);

// One step: applies the first record that is not, undoes the last one that is. False at the end.
bool hw_progressive_refine(hw_progressive *p);
bool hw_progressive_coarsen(hw_progressive *p);
// To the first n records (at most all of them).
void hw_progressive_go(hw_progressive *p, uint32_t n);
// To the most records with at most this many faces (or to the base).
void hw_progressive_go_faces(hw_progressive *p, uint32_t faces);
// HW_USAGE if the record is applied already (is not), or a batch before is not all applied (one
// after is).
HW_MUST_USE hw_status hw_progressive_split(hw_progressive *p, uint32_t record);
HW_MUST_USE hw_status hw_progressive_collapse_record(hw_progressive *p, uint32_t record);

// Positions and indices of the state; *out is overwritten, free with hw_mesh_free. Vertices are
// those there are, in canonical order. At the finest level the original, see keep_order.
HW_MUST_USE hw_status hw_progressive_extract(const hw_progressive *p, hw_mesh *out);
