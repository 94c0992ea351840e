#include "domain.h"
#include <math.h>
#include <string.h>

// A wall's triangle is as high as its border edge is long, times this: its area is the weight of
// the border against the surface.
#define WALL_HEIGHT 8.0

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

// The face of corner k.
static inline void add_face(hw_domain *r, uint32_t k, const double p[3])
{
    const uint32_t *face = r->mesh->faces[k / 3];
    hw_domain_face *f = &r->faces[r->count++];
    double q[3], s[3];
    f->p = face[k % 3];
    f->q = face[(k + 1) % 3];
    f->r = face[(k + 2) % 3];
    relative(r, f->q, q);
    relative(r, f->r, s);
    set_planes(f, p, q, s);
}

// An upright triangle on the border edge from p to q of a face with normal n: it moves with p.
static void add_wall(hw_domain *r, uint32_t p, uint32_t q, const double n[3], bool backward)
{
    double ends[2][3], apex[3], length2 = 0, size = sqrt(dot(n, n));
    if (!(size > 0) || r->count == HW_DOMAIN_FACES_MAX)
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
    if (backward)
        set_planes(f, ends[0], apex, ends[1]);
    else
        set_planes(f, ends[0], ends[1], apex);
}

// Walls on those edges of faces [first, last) that end in their moving corner.
static void add_walls(hw_domain *r, uint32_t first, uint32_t last)
{
    const hw_collapser *c = r->mesh;
    for (uint32_t i = first; i < last; i++) {
        const hw_domain_face f = r->faces[i];
        if (!c->border[f.p])
            continue;
        if (c->border[f.q] && hw_collapser_edge_faces(c, f.p, f.q) == 1)
            add_wall(r, f.p, f.q, f.n, false);
        if (c->border[f.r] && hw_collapser_edge_faces(c, f.p, f.r) == 1)
            add_wall(r, f.p, f.r, f.n, true);
    }
}

// Walls on the open edges that the faces on the edge leave behind: at the corner of a sheet one end
// has no other face, and its border moves all the same.
static void add_corner_walls(hw_domain *r, const uint32_t *on_edge, uint32_t count)
{
    const hw_collapser *c = r->mesh;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t *face = c->faces[on_edge[i] / 3];
        uint32_t k = on_edge[i] % 3, q = face[(k + 1) % 3], s = face[(k + 2) % 3];
        uint32_t third = q == r->b ? s : q;
        if (!c->border[third])
            continue;
        hw_domain_face f;
        double corners[2][3];
        relative(r, q, corners[0]);
        relative(r, s, corners[1]);
        set_planes(&f, r->ends[0], corners[0], corners[1]);
        if (c->border[r->a] && hw_collapser_edge_faces(c, r->a, third) == 1)
            add_wall(r, r->a, third, f.n, third == s);
        if (c->border[r->b] && hw_collapser_edge_faces(c, r->b, third) == 1)
            add_wall(r, r->b, third, f.n, third == q);
    }
}

bool hw_domain_gather(const hw_collapser *c, uint32_t a, uint32_t b, hw_domain *r)
{
    uint32_t on_edge[HW_DOMAIN_FACES_MAX], edge_count = 0;
    hw_domain_edge(c, a, b, r);
    const uint32_t room = HW_DOMAIN_FACES_MAX / 2; // the other half is for walls
    for (uint32_t k = c->first_corner[a]; k != HW_NO_VERTEX; k = hw_next_corner(c, k)) {
        if (r->count + edge_count >= room)
            return false;
        if (hw_face_has(c->faces[k / 3], b))
            on_edge[edge_count++] = k;
        else
            add_face(r, k, r->ends[0]);
    }
    for (uint32_t k = c->first_corner[b]; k != HW_NO_VERTEX; k = hw_next_corner(c, k)) {
        if (hw_face_has(c->faces[k / 3], a))
            continue;
        if (r->count + edge_count >= room)
            return false;
        add_face(r, k, r->ends[1]);
    }
    r->kept = r->count;
    if (c->border[a] || c->border[b]) {
        add_walls(r, 0, r->kept);
        add_corner_walls(r, on_edge, edge_count);
    }
    r->walls = r->count;
    for (uint32_t i = 0; i < edge_count; i++)
        add_face(r, on_edge[i], r->ends[0]);
    if (c->border[a] && c->border[b])
        for (uint32_t i = r->walls, n = r->count; i < n; i++) {
            const hw_domain_face f = r->faces[i];
            if (hw_collapser_edge_faces(c, a, b) == 1)
                add_wall(r, a, b, f.n, f.r == b);
        }
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
