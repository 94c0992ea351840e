#include "triangulate.h"
#include <assert.h>
#include <string.h>

typedef struct point2 {
    double x, y;
} point2;

// Newell's normal: right for concave and not quite flat polygons.
static void newell_normal(const hw_vec3 *positions, const uint32_t *corners, uint32_t count,
                          double n[3])
{
    n[0] = n[1] = n[2] = 0;
    for (uint32_t i = 0; i < count; i++) {
        hw_vec3 a = positions[corners[i]], b = positions[corners[(i + 1) % count]];
        n[0] += ((double)a.y - b.y) * ((double)a.z + b.z);
        n[1] += ((double)a.z - b.z) * ((double)a.x + b.x);
        n[2] += ((double)a.x - b.x) * ((double)a.y + b.y);
    }
}

// Drops the normal's largest coordinate, so that the polygon runs counter-clockwise.
static point2 flatten(hw_vec3 p, int axis, bool flip)
{
    const float c[3] = {p.x, p.y, p.z};
    point2 q = {c[(axis + 1) % 3], c[(axis + 2) % 3]};
    if (flip)
        q.x = -q.x;
    return q;
}

static double cross2(point2 a, point2 b, point2 c)
{
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

static bool inside(point2 p, point2 a, point2 b, point2 c)
{
    return cross2(a, b, p) >= 0 && cross2(b, c, p) >= 0 && cross2(c, a, p) >= 0;
}

static bool same(point2 a, point2 b)
{
    return a.x == b.x && a.y == b.y;
}

// Whether the corner ring[i] can be cut off: convex, and no other corner within.
static bool is_ear(const point2 *points, const uint32_t *ring, uint32_t count, uint32_t i)
{
    point2 a = points[ring[(i + count - 1) % count]], b = points[ring[i]];
    point2 c = points[ring[(i + 1) % count]];
    if (cross2(a, b, c) <= 0)
        return false;
    for (uint32_t k = 2; k < count - 1; k++) {
        point2 p = points[ring[(i + k) % count]];
        if (!same(p, a) && !same(p, b) && !same(p, c) && inside(p, a, b, c))
            return false;
    }
    return true;
}

void hw_triangulate(const hw_vec3 *positions, const uint32_t *corners, uint32_t count,
                    uint32_t *out)
{
    assert(count >= 3 && count <= HW_POLYGON_MAX);
    if (count == 3) {
        memcpy(out, corners, 3 * sizeof *out);
        return;
    }
    point2 points[HW_POLYGON_MAX];
    uint32_t ring[HW_POLYGON_MAX];
    double n[3];
    newell_normal(positions, corners, count, n);
    int axis = fabs(n[0]) > fabs(n[1]) ? 0 : 1;
    axis = fabs(n[2]) > fabs(n[axis]) ? 2 : axis;
    for (uint32_t i = 0; i < count; i++) {
        points[i] = flatten(positions[corners[i]], axis, n[axis] < 0);
        ring[i] = i;
    }
    uint32_t at = 1;
    while (count > 3) {
        uint32_t tried = 0; // where there is no ear (a crossing polygon), any corner goes
        while (tried < count && !is_ear(points, ring, count, at % count)) {
            at++;
            tried++;
        }
        uint32_t i = at % count;
        *out++ = corners[ring[(i + count - 1) % count]];
        *out++ = corners[ring[i]];
        *out++ = corners[ring[(i + 1) % count]];
        count--;
        for (uint32_t k = i; k < count; k++)
            ring[k] = ring[k + 1];
        at = i + 1; // skip a corner: fewer slivers than in a fan
    }
    for (uint32_t k = 0; k < 3; k++)
        *out++ = corners[ring[k]];
}
