#include "sight_faces.h"
#include <string.h>

#define PARTS_MAX 12u // into which an edge is cut, at most

// A point that nothing has been seen of yet: of a vertex, or of a face (from vertex_count on).
typedef struct point {
    hw_vec3 at;
    uint32_t owner;
} point;

typedef struct faces {
    const hw_sight_surface *surface;
    const hw_sights *sights;
    point *open;
    uint32_t open_count;
    bool *owners; // seen, per vertex, then per face
    bool *ring;   // per vertex: of a face that is seen
    bool *needed; // per vertex: of a face that is not settled
} faces;

static hw_vec3 corner(const faces *f, uint32_t face, int k)
{
    return f->surface->positions[f->surface->indices[3 * (size_t)face + k]];
}

// Into how many parts the edges of a face are cut, so that points lie close enough.
static uint32_t parts_of(const faces *f, uint32_t face)
{
    double longest = 0;
    for (int k = 0; k < 3; k++) {
        hw_vec3 edge = hw_v3_sub(corner(f, face, k), corner(f, face, (k + 1) % 3));
        longest = fmax(longest, (double)hw_v3_length(edge));
    }
    return (uint32_t)fmin(fmax(ceil(longest / f->surface->spacing), 1), PARTS_MAX);
}

// The lattice of a face that is cut into parts, without its corners.
static void add_face_points(faces *f, uint32_t face)
{
    uint32_t n = parts_of(f, face);
    hw_vec3 a = corner(f, face, 0);
    hw_vec3 u = hw_v3_sub(corner(f, face, 1), a), v = hw_v3_sub(corner(f, face, 2), a);
    for (uint32_t i = 0; i <= n; i++)
        for (uint32_t j = 0; i + j <= n; j++) {
            if (i == n || j == n || i + j == 0)
                continue;
            hw_vec3 p = hw_v3_mad(hw_v3_mad(a, u, (float)i / (float)n), v, (float)j / (float)n);
            f->open[f->open_count++] = (point){p, f->surface->vertex_count + face};
        }
}

static hw_status make_points(faces *f)
{
    const hw_sight_surface *s = f->surface;
    size_t count = s->vertex_count;
    for (uint32_t i = 0; i < s->index_count / 3; i++) {
        size_t n = parts_of(f, i);
        count += (n + 1) * (n + 2) / 2 - 3;
    }
    HW_TRY(HW_NEW(&f->open, count));
    HW_TRY(HW_NEW(&f->owners, (size_t)s->vertex_count + s->index_count / 3));
    HW_TRY(HW_NEW(&f->ring, s->vertex_count));
    HW_TRY(HW_NEW(&f->needed, s->vertex_count));
    for (uint32_t i = 0; i < s->vertex_count; i++)
        f->open[f->open_count++] = (point){s->positions[i], i};
    for (uint32_t i = 0; i < s->index_count / 3; i++)
        add_face_points(f, i);
    return HW_OK;
}

static bool face_is_seen(const faces *f, uint32_t face)
{
    const uint32_t *t = f->surface->indices + 3 * (size_t)face;
    return f->owners[t[0]] || f->owners[t[1]] || f->owners[t[2]] ||
           f->owners[f->surface->vertex_count + face];
}

static void mark_ring(faces *f)
{
    for (uint32_t i = 0; i < f->surface->index_count; i++)
        if (face_is_seen(f, i / 3))
            f->ring[f->surface->indices[i]] = true;
}

static bool in_ring(const faces *f, uint32_t face)
{
    const uint32_t *t = f->surface->indices + 3 * (size_t)face;
    return f->ring[t[0]] || f->ring[t[1]] || f->ring[t[2]];
}

// Whether it would change nothing to see the face.
static bool is_settled(const faces *f, uint32_t face)
{
    const uint32_t *t = f->surface->indices + 3 * (size_t)face;
    return f->ring[t[0]] && f->ring[t[1]] && f->ring[t[2]];
}

// Points that can change nothing any more go.
static void drop_settled(faces *f)
{
    uint32_t left = 0, vertex_count = f->surface->vertex_count;
    mark_ring(f);
    memset(f->needed, 0, vertex_count * sizeof *f->needed);
    for (uint32_t i = 0; i < f->surface->index_count; i++)
        f->needed[f->surface->indices[i]] |= !is_settled(f, i / 3);
    for (uint32_t i = 0; i < f->open_count; i++) {
        point p = f->open[i];
        f->open[left] = p;
        left +=
            p.owner < vertex_count ? f->needed[p.owner] : !is_settled(f, p.owner - vertex_count);
    }
    f->open_count = left;
}

// Looks at every open point once, each packet from the next eye of its class.
static void look_once(faces *f, const hw_vec3 *eyes, uint32_t round)
{
    uint32_t left = 0;
    for (uint32_t first = 0, c = 0; first < f->open_count; first += HW_RAYS_PACKET, c++) {
        uint32_t n =
            f->open_count - first < HW_RAYS_PACKET ? f->open_count - first : HW_RAYS_PACKET;
        hw_vec3 points[HW_RAYS_PACKET];
        hw_sight sights[HW_RAYS_PACKET];
        for (uint32_t k = 0; k < n; k++)
            points[k] = f->open[first + k].at;
        hw_sights_look(f->sights, eyes[round * HW_SIGHT_EYE_CLASSES + c % HW_SIGHT_EYE_CLASSES],
                       f->surface->box, f->surface->hiders, points, n, sights);
        for (uint32_t k = 0; k < n; k++) {
            point p = f->open[first + k];
            f->owners[p.owner] |= sights[k] == HW_SIGHT_FREE;
            f->open[left] = p;
            left += !f->owners[p.owner];
        }
    }
    f->open_count = left;
}

hw_status hw_sights_faces(const hw_sights *sights, const hw_sight_surface *surface,
                          const hw_vec3 *eyes, uint32_t eye_count, bool *seen)
{
    hw_status status = HW_OK;
    faces f = {.surface = surface, .sights = sights};
    HW_GO(make_points(&f));
    for (uint32_t r = 0; r < eye_count / HW_SIGHT_EYE_CLASSES && f.open_count > 0; r++) {
        look_once(&f, eyes, r);
        if ((r & (r + 1)) == 0) // after 1, 2, 4, ... rounds
            drop_settled(&f);
    }
    mark_ring(&f);
    for (uint32_t i = 0; i < surface->index_count / 3; i++)
        seen[i] = in_ring(&f, i);
out:
    hw_free(f.open);
    hw_free(f.owners);
    hw_free(f.ring);
    hw_free(f.needed);
    return status;
}
