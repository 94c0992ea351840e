#include "split.h"
#include "alloc.h"
#include <math.h>
#include <stdbool.h>
#include <string.h>

#define NONE           UINT32_MAX
#define EDGE_FACES_MAX 16

typedef struct splitter {
    const double (*positions)[3];
    const uint32_t *indices;
    uint32_t *first_corner, *next_corner; // corners round each vertex
    uint32_t *parent; // union-find over corners: those of one fan are one vertex
} splitter;

// A half-edge on the edge (a, b) under study.
typedef struct spoke {
    uint32_t corner; // where it starts
    bool forward;    // runs a -> b
    double angle;    // of the face about the edge, seen along a -> b
} spoke;

static uint32_t find(uint32_t *parent, uint32_t c)
{
    while (parent[c] != c) {
        parent[c] = parent[parent[c]];
        c = parent[c];
    }
    return c;
}

static void join(uint32_t *parent, uint32_t x, uint32_t y)
{
    x = find(parent, x);
    y = find(parent, y);
    if (x < y)
        parent[y] = x;
    else
        parent[x] = y;
}

static uint32_t next_in_face(uint32_t corner)
{
    return corner % 3 == 2 ? corner - 2 : corner + 1;
}

static uint32_t previous_in_face(uint32_t corner)
{
    return corner % 3 == 0 ? corner + 2 : corner - 1;
}

// All half-edges between a and b. Returns how many there are, at most EDGE_FACES_MAX + 1.
static uint32_t gather(const splitter *s, uint32_t a, uint32_t b, spoke *spokes)
{
    uint32_t n = 0;
    for (uint32_t c = s->first_corner[a]; c != NONE; c = s->next_corner[c]) {
        bool forward = s->indices[next_in_face(c)] == b,
             backward = s->indices[previous_in_face(c)] == b;
        if (!forward && !backward)
            continue;
        if (n == EDGE_FACES_MAX)
            return n + 1;
        spokes[n++] = (spoke){forward ? c : previous_in_face(c), forward, 0};
    }
    return n;
}

static void measure_angles(const splitter *s, uint32_t a, uint32_t b, spoke *spokes, uint32_t n)
{
    const double *p = s->positions[a], *q = s->positions[b];
    double axis[3], u[3], v[3], l = 0;
    for (int i = 0; i < 3; i++) {
        axis[i] = q[i] - p[i];
        l += axis[i] * axis[i];
    }
    l = sqrt(l);
    int least = 0;
    for (int i = 0; i < 3; i++) {
        axis[i] = l > 0 ? axis[i] / l : 0;
        if (fabs(axis[i]) < fabs(axis[least]))
            least = i;
    }
    double e[3] = {least == 0, least == 1, least == 2};
    for (int i = 0; i < 3; i++)
        u[i] = axis[(i + 1) % 3] * e[(i + 2) % 3] - axis[(i + 2) % 3] * e[(i + 1) % 3];
    for (int i = 0; i < 3; i++)
        v[i] = axis[(i + 1) % 3] * u[(i + 2) % 3] - axis[(i + 2) % 3] * u[(i + 1) % 3];
    for (uint32_t k = 0; k < n; k++) {
        const double *r = s->positions[s->indices[previous_in_face(spokes[k].corner)]];
        double x = 0, y = 0;
        for (int i = 0; i < 3; i++) {
            x += (r[i] - p[i]) * u[i];
            y += (r[i] - p[i]) * v[i];
        }
        spokes[k].angle = atan2(y, x);
    }
}

// The backward half-edge that bounds the same solid as the forward one: a face a -> b has its
// outside towards rising angles, so the solid reaches down to the next face below.
static uint32_t partner(const spoke *spokes, uint32_t n, uint32_t forward)
{
    uint32_t best = NONE;
    double least = INFINITY;
    for (uint32_t k = 0; k < n; k++) {
        if (spokes[k].forward)
            continue;
        double down = spokes[forward].angle - spokes[k].angle;
        if (down < 0)
            down += 2 * 3.14159265358979323846;
        if (down < least) {
            least = down;
            best = k;
        }
    }
    return best;
}

// Joins the corners at both ends of the edge for faces that belong together across it.
static void join_across(splitter *s, uint32_t a, uint32_t b)
{
    spoke spokes[EDGE_FACES_MAX];
    uint32_t n = gather(s, a, b, spokes), forward = 0;
    if (n > EDGE_FACES_MAX)
        return;
    for (uint32_t k = 0; k < n; k++)
        forward += spokes[k].forward;
    if (forward * 2 != n)
        return; // an open border, or windings that do not fit
    if (n > 2)
        measure_angles(s, a, b, spokes, n);
    for (uint32_t k = 0; k < n; k++) {
        if (!spokes[k].forward)
            continue;
        uint32_t m = partner(spokes, n, k);
        join(s->parent, spokes[k].corner, next_in_face(spokes[m].corner));
        join(s->parent, next_in_face(spokes[k].corner), spokes[m].corner);
    }
}

static bool face_good(const uint32_t *t, uint32_t vertex_count)
{
    return t[0] < vertex_count && t[1] < vertex_count && t[2] < vertex_count && t[0] != t[1] &&
           t[1] != t[2] && t[2] != t[0];
}

static void link_corners(splitter *s, uint32_t vertex_count, uint32_t face_count)
{
    memset(s->first_corner, 0xff, vertex_count * sizeof *s->first_corner);
    for (uint32_t c = 3 * face_count; c-- > 0;) {
        s->parent[c] = c;
        if (!face_good(s->indices + c / 3 * 3, vertex_count))
            continue;
        s->next_corner[c] = s->first_corner[s->indices[c]];
        s->first_corner[s->indices[c]] = c;
    }
}

// Two faces on the same vertices with opposite windings enclose nothing: both go (their indices
// become NONE). Scans merged from range images are full of such flaps, and each makes edges of four
// faces.
static void cancel_flaps(splitter *s, uint32_t *indices, uint32_t face_count, uint32_t vertex_count)
{
    for (uint32_t f = 0; f < face_count; f++) {
        uint32_t *t = indices + 3 * (size_t)f;
        if (!face_good(t, vertex_count))
            continue;
        for (uint32_t c = s->first_corner[t[0]]; c != NONE; c = s->next_corner[c]) {
            uint32_t *u = indices + c / 3 * 3;
            if (u == t || u[0] == NONE || u[c % 3] != t[0] || u[(c + 1) % 3] != t[2] ||
                u[(c + 2) % 3] != t[1])
                continue;
            memset(t, 0xff, 3 * sizeof *t);
            memset(u, 0xff, 3 * sizeof *u);
            break;
        }
    }
}

// Every fan but the first of a vertex gets a copy of it.
static hw_status number_fans(splitter *s, uint32_t vertex_count, uint32_t face_count, hw_split *out)
{
    hw_status status = HW_OK;
    uint32_t *vertex_of = NULL; // per root corner
    size_t capacity = vertex_count;
    HW_GO(HW_NEW(&vertex_of, 3 * (size_t)face_count));
    memset(vertex_of, 0xff, 3 * (size_t)face_count * sizeof *vertex_of);
    for (uint32_t v = 0; v < vertex_count; v++) {
        out->source[v] = v;
        bool first = true;
        for (uint32_t c = s->first_corner[v]; c != NONE; c = s->next_corner[c]) {
            uint32_t root = find(s->parent, c);
            if (vertex_of[root] == NONE && first) {
                vertex_of[root] = v;
                first = false;
            } else if (vertex_of[root] == NONE) {
                HW_GO(HW_RESERVE(&out->source, &capacity, (size_t)out->vertex_count + 1));
                out->source[out->vertex_count] = v;
                vertex_of[root] = out->vertex_count++;
            }
            out->indices[c] = vertex_of[root];
        }
    }
out:
    hw_free(vertex_of);
    return status;
}

hw_status hw_split_sheets(const double (*positions)[3], uint32_t vertex_count,
                          const uint32_t *indices, uint32_t face_count, hw_split *out)
{
    hw_status status;
    splitter s = {.positions = positions, .indices = indices};
    memset(out, 0, sizeof *out);
    out->vertex_count = vertex_count;
    HW_GO(HW_NEW(&s.first_corner, vertex_count));
    HW_GO(HW_NEW(&s.next_corner, 3 * (size_t)face_count));
    HW_GO(HW_NEW(&s.parent, 3 * (size_t)face_count));
    HW_GO(HW_NEW(&out->source, vertex_count));
    HW_GO(HW_NEW(&out->indices, 3 * (size_t)face_count));
    memcpy(out->indices, indices, 3 * (size_t)face_count * sizeof *indices);
    s.indices = out->indices;
    link_corners(&s, vertex_count, face_count);
    cancel_flaps(&s, out->indices, face_count, vertex_count);
    link_corners(&s, vertex_count, face_count);
    for (uint32_t c = 0; c < 3 * face_count; c++) {
        if (!face_good(s.indices + c / 3 * 3, vertex_count))
            continue;
        uint32_t a = s.indices[c], b = s.indices[next_in_face(c)];
        if (a < b)
            join_across(&s, a, b);
    }
    HW_GO(number_fans(&s, vertex_count, face_count, out));
out:
    hw_free(s.first_corner);
    hw_free(s.next_corner);
    hw_free(s.parent);
    if (status != HW_OK)
        hw_split_free(out);
    return status;
}

void hw_split_free(hw_split *split)
{
    hw_free(split->source);
    hw_free(split->indices);
    memset(split, 0, sizeof *split);
}
