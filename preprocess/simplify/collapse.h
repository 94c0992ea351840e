// Edge collapse on indexed triangle meshes: the one engine behind every simplified mesh in Hexwalk
// (after GeMS, Southern, Marais and Blake 2001). What an edge costs and where the merged vertex
// goes is a metric's business (metric.h); the engine keeps the connectivity, the queue and the two
// validity tests (topology and face flip).
//
// Space is whatever the caller's coordinates are: world units for a chain level, pixels for a mesh
// in a capture's image space.
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stdint.h>

#define HW_NO_VERTEX UINT32_MAX

// Read-only for metrics. Corners are 3 * face + k; the faces round a vertex are the linked list of
// its corners.
typedef struct hw_collapser {
    uint32_t vertex_count,
        face_count;   // as created; vertex_count includes vertices that were split off
    uint32_t *source; // per vertex: the caller's vertex
    uint32_t live_faces;
    double (*positions)[3];
    uint32_t (*faces)[3];   // faces[f][0] == HW_NO_VERTEX: removed
    uint32_t *first_corner; // per vertex; HW_NO_VERTEX: none (removed or isolated)
    uint32_t *next_corner;  // per corner
    bool *locked;           // per vertex: neither moved nor removed
    bool *border;           // per vertex: on an edge with one face only
    bool upright; // set by the caller: faces that are counter-clockwise in x and y stay so (a patch
                  // in image space keeps covering what it covers, without folds)
    struct hw_collapse_queue *queue;
} hw_collapser;

// What collapsing the edge would do.
typedef struct hw_collapse {
    double cost;        // the queue's key; INFINITY forbids the collapse
    double position[3]; // of the merged vertex
    uint32_t kept;      // the end that lives on (half-edge collapse: its position is `position`)
} hw_collapse;

typedef struct hw_metric hw_metric;

typedef struct hw_collapse_limits {
    uint32_t faces; // stop at or below this many live faces
    double cost;    // stop when the cheapest edge costs more; INFINITY = no limit
} hw_collapse_limits;

// What becomes of edges with more than two faces, and of vertices where several sheets touch.
// Splitting gives each sheet vertices of its own (at an edge of four faces, those that bound the
// same solid stay together), so that scans with pinches simplify as if they were manifold. Locking
// leaves the connectivity as it is and keeps the ends of such edges.
typedef enum hw_complex_edges { HW_COMPLEX_LOCK, HW_COMPLEX_SPLIT } hw_complex_edges;

// Copies positions (3 doubles each) and faces. Faces with an index out of range or two equal
// indices are dropped. `locked` may be NULL.
HW_MUST_USE hw_status hw_collapser_create(const double (*positions)[3], uint32_t vertex_count,
                                          const uint32_t *indices, uint32_t face_count,
                                          const bool *locked, hw_complex_edges complex,
                                          hw_collapser **out);
void hw_collapser_destroy(hw_collapser *collapser);

// Collapses edges in order of rising cost until a limit is met or nothing can be collapsed. May be
// called again with lower limits and the same metric (levels of detail) without rebuilding the
// queue.
HW_MUST_USE hw_status hw_collapser_run(hw_collapser *collapser, const hw_metric *metric,
                                       const hw_collapse_limits *limits);

// Compacts what is left. `vertices` gets the old index of each new vertex (room for vertex_count),
// `indices` 3 * live_faces new indices. Vertices keep their order. Returns the number of vertices.
uint32_t hw_collapser_extract(const hw_collapser *collapser, uint32_t *vertices, uint32_t *indices);

// The distinct faces that touch a or b (b may be HW_NO_VERTEX), each once; at most `capacity`.
// Returns how many there are.
uint32_t hw_collapser_star(const hw_collapser *collapser, uint32_t a, uint32_t b, uint32_t *faces,
                           uint32_t capacity);

#define HW_STAR_MAX 256 // edges whose ends touch more faces are never collapsed
