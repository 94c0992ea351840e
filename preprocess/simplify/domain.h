// The edge collapse domain of an edge (GeMS 2, figure 3): what a metric sees of the mesh.
#pragma once
#include "collapse.h"
#include "quadric.h"

#define HW_DOMAIN_FACES_MAX 192 // edges whose ends touch more faces are never collapsed
#define HW_CANDIDATES       4

// A face round the edge, seen from its corner p that moves with the edge (q and r follow
// counter-clockwise). n . x + d is six times the volume between the face and a place x.
typedef struct hw_domain_face {
    double n[3], d;          // normal, twice the area long; -n . p
    double at_q[3], at_r[3]; // where q and r are
    uint32_t p, q, r;        // vertices
} hw_domain_face;

typedef struct hw_domain {
    const hw_collapser *mesh;
    uint32_t a, b;
    double origin[3];  // position of a; all coordinates here are relative to it
    double ends[2][3]; // of a (0, 0, 0) and b
    double length2;    // squared length of the edge
    // [0, kept): TOP and BOT, the faces that stay. [kept, walls): one upright triangle on each
    // border edge of those, so that to a metric a border counts as a surface. [walls, count): the
    // faces on the edge, which vanish (and the wall on it).
    uint32_t kept, walls, count;
    hw_domain_face faces[HW_DOMAIN_FACES_MAX];
    hw_quadric scratch;   // of the metric
    double constraint[4]; // of the metric: a plane
} hw_domain;

// One number for each candidate, computed with together (vectors of GCC and Clang).
typedef double hw_lanes __attribute__((vector_size(8 * HW_CANDIDATES)));

// Places for the merged vertex, lane by lane; unused lanes repeat the first.
typedef struct hw_candidates {
    hw_lanes x, y, z;
    int8_t end[HW_CANDIDATES]; // 0: at a, 1: at b, -1: neither
    uint32_t count;
} hw_candidates;

// The face's normals, twice the area long, with its corner p at each of the candidates.
static inline void hw_domain_normals(const hw_domain_face *f, const hw_candidates *c,
                                     hw_lanes normal[3])
{
    // (q - x) cross (r - x) = q cross r + x cross (q - r)
    const double *q = f->at_q, *r = f->at_r;
    const double e[3] = {q[0] - r[0], q[1] - r[1], q[2] - r[2]};
    normal[0] = (q[1] * r[2] - q[2] * r[1]) + c->y * e[2] - c->z * e[1];
    normal[1] = (q[2] * r[0] - q[0] * r[2]) + c->z * e[0] - c->x * e[2];
    normal[2] = (q[0] * r[1] - q[1] * r[0]) + c->x * e[1] - c->y * e[0];
}

// Origin, ends and length only.
void hw_domain_edge(const hw_collapser *collapser, uint32_t a, uint32_t b, hw_domain *out);
// All of it; false if there are too many faces.
bool hw_domain_gather(const hw_collapser *collapser, uint32_t a, uint32_t b, hw_domain *out);
// Sum over all faces and walls of area * squared distance to their planes.
void hw_domain_quadric(const hw_domain *domain, hw_quadric *out);
