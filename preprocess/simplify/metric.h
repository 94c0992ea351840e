// Metrics: what an edge costs. A metric is a table of functions and a context; a new one is one
// file and one row of the table in metrics.c. README.md shows how.
#pragma once
#include "collapse.h"
#include "domain.h"
#include "mesh.h"

// Where the merged vertex may go (GeMS 2; the dissertation's section 4.1). Bits are what a file
// would need to tell which.
typedef enum hw_placement {
    HW_PLACEMENT_MIDPOINT, // 0 bit
    HW_PLACEMENT_ENDS,     // 1 bit: half-edge collapse
    HW_PLACEMENT_SUBSET,   // 2 bits: both ends and the midpoint
    HW_PLACEMENT_OPTIMAL // anywhere near the edge; the best of the subset where there is no minimum
} hw_placement;

struct hw_metric {
    const char *name;
    void *context;
    hw_placement placement;
    bool edge_only; // looks at the ends alone: the domain may come without faces
    // What `error` and `optimum` both need, into domain->scratch; may be NULL.
    void (*prepare)(void *context, hw_domain *domain);
    // The cost of moving the merged vertex to each of candidates->count places; INFINITY forbids.
    // Deterministic. Coordinates are relative to domain->origin.
    void (*error)(void *context, const hw_domain *domain, const hw_candidates *candidates,
                  double error[HW_CANDIDATES]);
    // The place of least error, false if there is none. NULL: that of the area-weighted quadric
    // of the region is tried.
    bool (*optimum)(void *context, const hw_domain *domain, double x[3]);
    // After the collapse: `removed` went into `kept`. For per-vertex data; may be NULL.
    void (*collapsed)(void *context, uint32_t kept, uint32_t removed);
    // Improves the simplified mesh once it is made; may be NULL.
    hw_status (*finish)(void *context, hw_mesh *mesh);
    void (*destroy)(void *context); // may be NULL
};

// Cost and place of collapsing the edge (a, b) under the metric; cost INFINITY if it must not be.
void hw_metric_evaluate(const hw_metric *metric, const hw_collapser *collapser, uint32_t a,
                        uint32_t b, hw_collapse *out);

// For metrics whose `prepare` leaves a quadric in domain->scratch: its value at the places (plus a
// billionth of length2 * weight, so that among equals the shorter edge goes first), its minimum.
void hw_scratch_error(void *context, const hw_domain *domain, const hw_candidates *candidates,
                      double error[HW_CANDIDATES]);
bool hw_scratch_optimum(void *context, const hw_domain *domain, double x[3]);

// ---- metrics by name -------------------------------------------------------------------------

#define HW_PM_KAPPA 1e-3

// What metrics are made from. All borrowed for the metric's life.
typedef struct hw_metric_setup {
    const hw_collapser *collapser;
    const hw_mesh *mesh;      // what that was made of: vertex source[v] is that of vertex v
    double kappa;             // of `pm`: stiffness of its springs; 0 = HW_PM_KAPPA
    hw_vec3 eye;              // of `viewcell` and `screen`: where the mesh is seen from ...
    double focal_px;          // ... and pixels per unit at distance 1
    double elevation_degrees; // of `silhouette`: how steep a line of sight may be; 0 = 90
    float importance_floor;   // of `silhouette`; 0 = 0.01
    uint32_t threads;         // 0 = default
} hw_metric_setup;

typedef struct hw_metric_kind {
    const char *name, *summary;
    const char *unit;       // of its error
    hw_placement placement; // unless the user says otherwise
    bool needs_eye, uses_kappa;
    hw_status (*create)(const hw_metric_setup *setup, hw_metric *out);
} hw_metric_kind;

extern const hw_metric_kind hw_metric_kinds[]; // ends with a NULL name
// NULL if there is none of that name.
const hw_metric_kind *hw_metric_find(const char *name);
// HW_USAGE if the setup lacks what the kind needs. On failure *out is zeroed.
HW_MUST_USE hw_status hw_metric_create(const hw_metric_kind *kind, const hw_metric_setup *setup,
                                       hw_metric *out);
void hw_metric_destroy(hw_metric *metric); // a zeroed one is legal

// ---- metrics from parts, for those that embed the engine -------------------------------------

// Memoryless area-weighted quadrics with free placement. `importance` (per vertex, borrowed and
// updated, or NULL) weights each face by the mean importance of its corners: features that make
// silhouettes last longer.
hw_metric hw_metric_quadric(float *importance);
// Classic quadrics that remember the original planes (Garland and Heckbert 1997), normalised by
// area, so that sqrt(cost) is the root-mean-square distance of the merged vertex from the planes it
// stands for, in the caller's units. Used where a collapse must stay within a tolerance.
HW_MUST_USE hw_status hw_metric_qem(const hw_collapser *collapser, hw_metric *out);
// The cost of thesis 5.2.1: (1.5 - n_i . n_j)^2 l (w_i + w_j), half-edge collapse of the vertex of
// smaller weight into the other. `normals` are unit vertex normals, `image` the projected positions
// in pixels, `weights` the vertex weights; all per vertex, borrowed.
typedef struct hw_viewcell_metric {
    const float (*normals)[3];
    const float (*image)[2];
    const float *weights;
} hw_viewcell_metric;
hw_metric hw_metric_viewcell(hw_viewcell_metric *context);
// The same for an MVMesh: l is the largest projected length in any of the images, weights are the
// largest of all views, and an edge collapses only if both ends are seen by some common view or by
// none. `sets` has a bit for each view that sees the vertex; the images that count are `images[0]`
// to `images[view_count - 1]`, the `image` of `base` is not used.
#define HW_MULTIVIEW_MAX 8
typedef struct hw_multiview_metric {
    hw_viewcell_metric base;
    const float (*images[HW_MULTIVIEW_MAX])[2];
    uint32_t view_count;
    const uint32_t *sets;
} hw_multiview_metric;
hw_metric hw_metric_multiview(hw_multiview_metric *context);
// Whether a vertex at a depth, some face round which looks to the viewer or not, is what its pixel
// of the depth image shows.
bool hw_viewcell_visible(bool front, double depth, float pixel_depth);
// The weight of a vertex at a depth: whether some face round it looks to the viewer, and what the
// depth image has at its pixel (hw_category).
float hw_viewcell_weight(bool front, double depth, float pixel_depth, uint8_t category);
