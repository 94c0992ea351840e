// Metrics: what an edge costs. A metric is a table of functions and a context; a new one is one
// file and one constructor.
#pragma once
#include "collapse.h"

struct hw_metric {
    const char *name;
    void *context;
    // Cost and placement of collapsing edge (a, b). Deterministic; called again when the collapse
    // is carried out.
    void (*evaluate)(void *context, const hw_collapser *collapser, uint32_t a, uint32_t b,
                     hw_collapse *out);
    // After the collapse: `removed` went into `kept`. For per-vertex data of the metric; may be
    // NULL.
    void (*collapsed)(void *context, uint32_t kept, uint32_t removed);
};

// Memoryless area-weighted quadrics with free placement (GeMS 3.2; Lindstrom and Turk's memoryless
// idea): the quadric of an edge is made anew from the faces round it, each once; open borders add
// planes through their edges. `importance` (per vertex, borrowed and updated, or NULL) weights each
// face by the mean importance of its corners: features that make silhouettes last longer.
hw_metric hw_metric_quadric(float *importance);

// Classic quadrics that remember the original planes (Garland and Heckbert 1997), normalised by
// area, so that sqrt(cost) is the root-mean-square distance of the merged vertex from the planes it
// stands for, in the caller's units. Used where a collapse must stay within a tolerance.
typedef struct hw_qem hw_qem;
HW_MUST_USE hw_status hw_qem_create(const hw_collapser *collapser, hw_qem **out);
void hw_qem_destroy(hw_qem *qem);
hw_metric hw_metric_qem(hw_qem *qem);

// The cost of thesis 5.2.1: (1.5 - n_i . n_j)^2 l (w_i + w_j), half-edge collapse of the vertex of
// smaller weight into the other. `normals` are unit vertex normals, `image` the projected positions
// in pixels, `weights` the vertex weights; all per vertex, borrowed.
typedef struct hw_viewcell_metric {
    const float (*normals)[3];
    const float (*image)[2];
    const float *weights;
} hw_viewcell_metric;
hw_metric hw_metric_viewcell(hw_viewcell_metric *context);
