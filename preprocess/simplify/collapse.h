// Edge collapse on indexed triangle meshes: the one engine behind every simplified mesh in Hexwalk
// (after GeMS, Southern, Marais and Blake 2001). What an edge costs and where the merged vertex
// goes is a metric's business (metric.h); the engine keeps the connectivity, the queue and the two
// validity tests (topology and face flip).
//
// Space is whatever the caller's coordinates are: world units for a chain level, pixels for a mesh
// in a capture's image space.
//
// Memoryless: between two collapses nothing is kept but the mesh and the queue. About 110 bytes a
// face. A collapser belongs to one thread.
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stdint.h>

#define HW_NO_VERTEX UINT32_MAX

typedef struct hw_collapse hw_collapse;
typedef struct hw_metric hw_metric;

// Read-only for metrics. Corners are 4 * face + 0, 1 or 2; the faces round a vertex are the linked
// list of its corners, whose links lie beside the faces' vertices: one cache line serves both.
typedef struct hw_collapser {
    uint32_t vertex_count,
        face_count;   // as created; vertex_count includes vertices that were split off
    uint32_t *source; // per vertex: the caller's vertex
    uint32_t live_faces, live_vertices; // vertices with a face
    double (*positions)[3];
    uint32_t (*faces)[6];   // 3 vertices, then for each of their corners the next one round that
                            // vertex; faces[f][0] == HW_NO_VERTEX: removed
    uint32_t *first_corner; // per vertex; HW_NO_VERTEX: none (removed or isolated)
    bool *locked;           // per vertex: neither moved nor removed
    bool *border;           // per vertex: on an edge with one face only
    // Set by the caller, before the first run:
    bool upright; // faces that are counter-clockwise in x and y stay so (a patch in image space
                  // keeps covering what it covers, without folds)
    bool keep_components; // lone closed tetrahedra stay (removing one is no edge collapse)
    void (*observer)(void *context, const struct hw_collapser *collapser,
                     const hw_collapse *collapse); // told before each collapse; may be NULL
    void *observer_context;
    void (*snap)(const void *context, double position[3]); // moves a merged vertex to where it can
                                                           // be stored; may be NULL
    const void *snap_context;
    // What examination found; see hw_complex_edges.
    uint32_t complex_edges; // with more than two faces or faces that disagree in winding
    uint32_t border_edges;
    uint32_t dropped_faces; // bad or repeated indices, or pairs that enclose nothing
    struct hw_collapse_queue *queue;
} hw_collapser;

// What collapsing an edge would do.
struct hw_collapse {
    double cost;        // the queue's key; INFINITY forbids the collapse
    double position[3]; // of the merged vertex
    uint32_t kept;      // the end that lives on (half-edge collapse: its position is `position`)
    uint32_t removed;   // the other end
};

typedef struct hw_collapse_limits {
    uint32_t faces;    // stop at or below this many live faces
    uint32_t vertices; // ... or this many live vertices
    double cost;       // stop when the cheapest edge costs more; INFINITY = no limit
} hw_collapse_limits;

// What becomes of edges with more than two faces, and of vertices where several sheets touch.
// Splitting gives each sheet vertices of its own (at an edge of four faces, those that bound the
// same solid stay together), so that scans with pinches simplify as if they were manifold. Locking
// leaves the connectivity as it is and keeps the ends of such edges.
typedef enum hw_complex_edges { HW_COMPLEX_LOCK, HW_COMPLEX_SPLIT } hw_complex_edges;

// Copies positions (3 doubles each) and faces. Faces with an index out of range or two equal
// indices are dropped. `locked` may be NULL. O(n) for bounded degrees.
HW_MUST_USE hw_status hw_collapser_create(const double (*positions)[3], uint32_t vertex_count,
                                          const uint32_t *indices, uint32_t face_count,
                                          const bool *locked, hw_complex_edges complex,
                                          hw_collapser **out);
void hw_collapser_destroy(hw_collapser *collapser);

// Collapses edges in order of rising cost until a limit is met or nothing can be collapsed. May be
// called again with lower limits and the same metric (levels of detail) without rebuilding the
// queue; hw_collapser_forget_queue comes between two metrics.
HW_MUST_USE hw_status hw_collapser_run(hw_collapser *collapser, const hw_metric *metric,
                                       const hw_collapse_limits *limits);
// One batch of independent collapses (GeMS 6): no vertex takes part in two, so that their inverses
// may be applied in any order. The queue is made anew and left empty, so the next batch may use
// another metric. *collapses gets their number; 0: nothing more can go within the limits.
HW_MUST_USE hw_status hw_collapser_run_batch(hw_collapser *collapser, const hw_metric *metric,
                                             const hw_collapse_limits *limits, uint32_t *collapses);
void hw_collapser_forget_queue(hw_collapser *collapser);

// Compacts what is left. `vertices` gets the old index of each new vertex (room for vertex_count),
// `indices` 3 * live_faces new indices. Vertices keep their order. Returns the number of vertices.
uint32_t hw_collapser_extract(const hw_collapser *collapser, uint32_t *vertices, uint32_t *indices);

// Number of faces that have both vertices.
uint32_t hw_collapser_edge_faces(const hw_collapser *collapser, uint32_t a, uint32_t b);
// Number of faces round a vertex.
uint32_t hw_collapser_degree(const hw_collapser *collapser, uint32_t v);

// Places of a face counter-clockwise.
static const uint8_t hw_next_place[3] = {1, 2, 0}, hw_last_place[3] = {2, 0, 1};

// The next corner round the vertex of corner k; HW_NO_VERTEX after the last.
static inline uint32_t hw_next_corner(const hw_collapser *collapser, uint32_t k)
{
    return collapser->faces[k / 4][3 + k % 4];
}

static inline bool hw_face_has(const uint32_t face[3], uint32_t v)
{
    return face[0] == v || face[1] == v || face[2] == v;
}
