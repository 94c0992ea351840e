// Edge collapse as in CGAL, to be measured against. Only where CGAL is installed.
#pragma once
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum bench_cgal_policy {
    BENCH_CGAL_LINDSTROM_TURK,
    BENCH_CGAL_GARLAND_HECKBERT
} bench_cgal_policy;

// Simplifies a triangle mesh to at most face_target faces; what is not manifold is cut open.
// `positions` (3 a vertex) and `indices` are overwritten with the result, *vertex_count and
// *index_count lowered. *cpu_seconds is the time of the collapse itself on this thread, without
// building CGAL's mesh. False if CGAL fails.
int bench_cgal_simplify(bench_cgal_policy policy, double *positions, uint32_t *vertex_count,
                        uint32_t *indices, uint32_t *index_count, uint32_t face_target,
                        double *cpu_seconds);

#ifdef __cplusplus
}
#endif
