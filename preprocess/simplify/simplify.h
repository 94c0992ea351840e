// Simplifies one mesh from beginning to end: the engine, a plan of metrics, a hierarchy, and what
// comes out of it (GeMS 3 to 6).
#pragma once
#include "metric.h"
#include "progressive.h"

#define HW_SIMPLIFY_STAGES_MAX 8

// A metric and how far it goes (adaptive simplification, GeMS 6): down to `until` of the original
// faces, then the next stage takes over. The last stage goes as far as the limits let it.
typedef struct hw_simplify_stage {
    const hw_metric_kind *metric;
    double until; // in (0, 1]; ignored in the last stage
} hw_simplify_stage;

typedef struct hw_simplify_options {
    hw_simplify_stage stages[HW_SIMPLIFY_STAGES_MAX];
    uint32_t stage_count; // 0: quadric alone
    bool placement_set;   // else each metric's own
    hw_placement placement;
    double kappa, kappa_decay; // of `pm`, 0 = HW_PM_KAPPA and 1: after each batch kappa is
                               // multiplied by the decay
    hw_vec3 eye;               // of metrics that look from somewhere
    double focal_px, elevation_degrees;
    uint32_t threads; // 0 = default; the result does not depend on it
    // Where to stop, whichever comes first. Zeros mean no limit.
    uint32_t faces, vertices;
    double error; // of a collapse, in the unit of the last stage's metric
    // Rounds of fitting the result to the original (fit.h); the progressive mesh stays as it is.
    uint32_t fit_rounds;
    // Batches of independent collapses instead of one order.
    bool batched;
    // The progressive mesh, if wanted: the grid its positions lie on (NULL: none is recorded).
    const hw_position_grid *grid;
    bool keep_order;
    // Called after each batch with the mesh as it is then; may be NULL. A failure ends the run.
    hw_status (*level)(void *context, uint32_t batch, const hw_mesh *mesh);
    void *level_context;
} hw_simplify_options;

typedef struct hw_simplify_facts {
    uint32_t faces_before, vertices_before; // of the welded original
    uint32_t dropped_faces;                 // degenerate ones, and pairs back to back
    uint32_t split_vertices;                // copies made where sheets touch
    uint32_t complex_edges;                 // that could not be split: their ends stayed
    uint32_t border_edges;                  // of the original
    uint32_t batches;                       // 0: one order
    double seconds, fit_seconds;            // of this thread, for the collapses and for fitting
} hw_simplify_facts;

typedef struct hw_simplified {
    hw_mesh mesh; // positions, normals of its own, colours of the original's closest points
    hw_progressive *progressive; // NULL unless recorded; at full resolution
    hw_simplify_facts facts;
} hw_simplified;

// The original may have anything but an empty or invalid mesh (hw_mesh_validate): vertices are
// welded by position; uvs and materials are left behind. HW_USAGE for senseless options. On failure
// *out is zeroed; free it with hw_simplified_free.
HW_MUST_USE hw_status hw_simplify(const hw_mesh *mesh, const hw_simplify_options *options,
                                  hw_simplified *out);
void hw_simplified_free(hw_simplified *simplified);

// ---- parts, for those that drive the engine themselves ---------------------------------------

// A mesh of positions and indices alone, welded by position: what collapsers are made from.
HW_MUST_USE hw_status hw_mesh_weld_positions(const hw_mesh *mesh, hw_mesh *out);
// A collapser on such a mesh, sheets split.
HW_MUST_USE hw_status hw_collapser_from_mesh(const hw_mesh *welded, hw_collapser **out);
// What is left of it: positions and indices.
HW_MUST_USE hw_status hw_collapser_to_mesh(const hw_collapser *collapser, hw_mesh *out);
