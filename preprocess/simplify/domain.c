#include "domain.h"
#include <math.h>
#include <string.h>

// A wall's triangle is as high as its border edge is long, times this: its area is the weight of
// the border against the surface.
#define WALL_HEIGHT 8.0

// Room for faces that stay, for walls after them, then for the faces on the edge and its wall.
#define EDGE_FACES_MAX 8
#define FACES_END      (HW_DOMAIN_FACES_MAX / 2)
#define WALLS_END      (HW_DOMAIN_FACES_MAX - EDGE_FACES_MAX - 1)

static inline void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void hw_domain_edge(const hw_collapser *c, uint32_t a, uint32_t b, hw_domain *r)
{
    const double *p = c->positions[a], *q = c->positions[b];
    r->mesh = c;
    r->a = a;
    r->b = b;
    for (int i = 0; i < 3; i++) {
        r->origin[i] = p[i];
        r->ends[0][i] = 0;
        r->ends[1][i] = q[i] - p[i];
    }
    r->length2 = dot(r->ends[1], r->ends[1]);
    r->kept = r->walls = r->count = 0;
}

// The plane of a face whose corner p is there.
static inline void set_plane(hw_domain_face *f, const double p[3])
{
    const double u[3] = {f->at_q[0] - p[0], f->at_q[1] - p[1], f->at_q[2] - p[2]},
                 v[3] = {f->at_r[0] - p[0], f->at_r[1] - p[1], f->at_r[2] - p[2]};
    cross(u, v, f->n);
    f->d = -dot(f->n, p);
}

static inline void relative(const hw_domain *r, uint32_t v, double out[3])
{
    const double *p = r->mesh->positions[v];
    for (int i = 0; i < 3; i++)
        out[i] = p[i] - r->origin[i];
}

// The face of corner k, whose vertex is at p.
static inline void make_face(const hw_domain *r, uint32_t k, const double p[3], hw_domain_face *f)
{
    const uint32_t *face = r->mesh->faces[k / 4];
    f->p = face[k % 4];
    f->q = face[hw_next_place[k % 4]];
    f->r = face[hw_last_place[k % 4]];
    relative(r, f->q, f->at_q);
    relative(r, f->r, f->at_r);
    set_plane(f, p);
}

// An upright triangle on the edge from p to q of a face with normal n, if that is a border: it
// moves with p.
static void add_wall(hw_domain *r, uint32_t p, uint32_t q, const double n[3])
{
    double at_p[3], length2 = 0, size = sqrt(dot(n, n));
    if (!r->mesh->border[p] || !r->mesh->border[q] || hw_collapser_edge_faces(r->mesh, p, q) != 1 ||
        !(size > 0) || r->count >= HW_DOMAIN_FACES_MAX - 1)
        return;
    hw_domain_face *f = &r->faces[r->count++];
    relative(r, p, at_p);
    relative(r, q, f->at_q);
    for (int i = 0; i < 3; i++)
        length2 += (f->at_q[i] - at_p[i]) * (f->at_q[i] - at_p[i]);
    for (int i = 0; i < 3; i++)
        f->at_r[i] = (at_p[i] + f->at_q[i]) / 2 + n[i] / size * WALL_HEIGHT * sqrt(length2);
    f->p = p;
    f->q = f->r = q;
    set_plane(f, at_p);
}

// Walls on the borders that move: those of the faces that stay, and the outer ones of those that
// vanish.
static void add_walls(hw_domain *r, const uint32_t *on_edge, uint32_t edge_count)
{
    for (uint32_t i = 0; i < r->kept; i++) {
        const hw_domain_face f = r->faces[i];
        add_wall(r, f.p, f.q, f.n);
        add_wall(r, f.p, f.r, f.n);
    }
    for (uint32_t i = 0; i < edge_count; i++) {
        hw_domain_face f;
        make_face(r, on_edge[i], r->ends[0], &f);
        uint32_t opposite = f.q == r->b ? f.r : f.q;
        add_wall(r, r->a, opposite, f.n);
        add_wall(r, r->b, opposite, f.n);
    }
}

bool hw_domain_gather(const hw_collapser *c, uint32_t a, uint32_t b, hw_domain *r)
{
    uint32_t on_edge[EDGE_FACES_MAX], edge_count = 0;
    hw_domain_edge(c, a, b, r);
    for (uint32_t k = c->first_corner[a]; k != HW_NO_VERTEX; k = hw_next_corner(c, k)) {
        if (r->count + edge_count == FACES_END)
            return false;
        if (!hw_face_has(c->faces[k / 4], b))
            make_face(r, k, r->ends[0], &r->faces[r->count++]);
        else if (edge_count < EDGE_FACES_MAX)
            on_edge[edge_count++] = k;
        else
            return false;
    }
    for (uint32_t k = c->first_corner[b]; k != HW_NO_VERTEX; k = hw_next_corner(c, k)) {
        if (hw_face_has(c->faces[k / 4], a))
            continue;
        if (r->count + edge_count == FACES_END)
            return false;
        make_face(r, k, r->ends[1], &r->faces[r->count++]);
    }
    r->kept = r->count;
    bool border = c->border[a] || c->border[b];
    if (border)
        add_walls(r, on_edge, edge_count);
    r->walls = r->count = r->count < WALLS_END ? r->count : WALLS_END;
    for (uint32_t i = 0; i < edge_count; i++)
        make_face(r, on_edge[i], r->ends[0], &r->faces[r->count++]);
    if (border && edge_count == 1)
        add_wall(r, a, b, r->faces[r->walls].n);
    return true;
}

void hw_domain_quadric(const hw_domain *r, hw_quadric *out)
{
    hw_quadric q = {0}; // on the stack, where nothing can alias it
    for (uint32_t i = 0; i < r->count; i++) {
        const hw_domain_face *f = &r->faces[i];
        double size = sqrt(dot(f->n, f->n));
        if (size > 0)
            hw_quadric_add_plane(&q, f->n, f->d, 0.5 / size, 0.5 * size);
    }
    *out = q;
}
