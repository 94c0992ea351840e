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

// Fills the planes of a triangle from its corners, p the one that moves.
static inline void set_planes(hw_domain_face *f, const double p[3], const double q[3],
                              const double r[3])
{
    double turn[3];
    for (int i = 0; i < 3; i++)
        f->e[i] = q[i] - r[i];
    cross(q, r, f->m);
    cross(p, f->e, turn);
    for (int i = 0; i < 3; i++)
        f->n[i] = f->m[i] + turn[i];
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
    const uint32_t *face = r->mesh->faces[k / 3];
    double q[3], s[3];
    f->p = face[k % 3];
    f->q = face[(k + 1) % 3];
    f->r = face[(k + 2) % 3];
    relative(r, f->q, q);
    relative(r, f->r, s);
    set_planes(f, p, q, s);
}

// An upright triangle on the edge from p to q of a face with normal n, if that is a border: it
// moves with p.
static void add_wall(hw_domain *r, uint32_t p, uint32_t q, const double n[3])
{
    double ends[2][3], apex[3], length2 = 0, size = sqrt(dot(n, n));
    if (!r->mesh->border[p] || !r->mesh->border[q] || hw_collapser_edge_faces(r->mesh, p, q) != 1 ||
        !(size > 0) || r->count >= HW_DOMAIN_FACES_MAX - 1)
        return;
    relative(r, p, ends[0]);
    relative(r, q, ends[1]);
    for (int i = 0; i < 3; i++)
        length2 += (ends[1][i] - ends[0][i]) * (ends[1][i] - ends[0][i]);
    for (int i = 0; i < 3; i++)
        apex[i] = (ends[0][i] + ends[1][i]) / 2 + n[i] / size * WALL_HEIGHT * sqrt(length2);
    hw_domain_face *f = &r->faces[r->count++];
    f->p = p;
    f->q = f->r = q;
    set_planes(f, ends[0], ends[1], apex);
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
        if (!hw_face_has(c->faces[k / 3], b))
            make_face(r, k, r->ends[0], &r->faces[r->count++]);
        else if (edge_count < EDGE_FACES_MAX)
            on_edge[edge_count++] = k;
        else
            return false;
    }
    for (uint32_t k = c->first_corner[b]; k != HW_NO_VERTEX; k = hw_next_corner(c, k)) {
        if (hw_face_has(c->faces[k / 3], a))
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
    *out = (hw_quadric){0};
    for (uint32_t i = 0; i < r->count; i++) {
        const hw_domain_face *f = &r->faces[i];
        double size = sqrt(dot(f->n, f->n));
        if (size > 0)
            hw_quadric_add_plane(out, f->n, f->d, 0.5 / size, 0.5 * size);
    }
}
