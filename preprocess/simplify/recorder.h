// Writes down what the engine does, so that it can be undone: the vertex splits of a progressive
// mesh (GeMS 5, vsplit records).
#pragma once
#include "collapse.h"
#include "progressive.h"

typedef struct hw_recorder hw_recorder;

// Observes the collapser (which must not have run yet) until destroyed; both outlive each other's
// use. Sets collapser->observer, ->snap and ->keep_components. Merged vertices, and those of the
// mesh, must lie on `grid` (borrowed).
HW_MUST_USE hw_status hw_recorder_create(hw_collapser *collapser, const hw_position_grid *grid,
                                         hw_recorder **out);
void hw_recorder_destroy(hw_recorder *recorder);
// Ends a batch; empty ones do not count. Without any call the order is strict.
HW_MUST_USE hw_status hw_recorder_end_batch(hw_recorder *recorder);
// The progressive mesh of what was recorded. `indices` are those that the collapser was created
// from: faces that it dropped come back at full resolution. HW_MEMORY also if memory ran out while
// recording.
HW_MUST_USE hw_status hw_recorder_finish(hw_recorder *recorder, const uint32_t *indices,
                                         uint32_t original_vertex_count, bool keep_order,
                                         hw_progressive **out);
