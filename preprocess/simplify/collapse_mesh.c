// The collapser's mesh: made, examined, and taken out again.
#include "alloc.h"
#include "collapse.h"
#include "collapse_queue.h"
#include "split.h"
#include <string.h>

static void link_faces(hw_collapser *c, const uint32_t *indices, uint32_t face_count)
{
    memset(c->first_corner, 0xff, c->vertex_count * sizeof *c->first_corner);
    for (uint32_t f = 0; f < face_count; f++) {
        const uint32_t *in = indices + 3 * (size_t)f;
        bool good = in[0] < c->vertex_count && in[1] < c->vertex_count && in[2] < c->vertex_count &&
                    in[0] != in[1] && in[1] != in[2] && in[2] != in[0];
        for (uint32_t i = 0; i < 3; i++) {
            c->faces[f][i] = good ? in[i] : HW_NO_VERTEX;
            if (!good)
                continue;
            c->faces[f][3 + i] = c->first_corner[in[i]];
            c->first_corner[in[i]] = 4 * f + i;
        }
        c->live_faces += good;
        c->dropped_faces += !good;
    }
    for (uint32_t v = 0; v < c->vertex_count; v++)
        c->live_vertices += c->first_corner[v] != HW_NO_VERTEX;
}

// Whether no face before f has the edge.
static bool first_of_edge(const hw_collapser *c, uint32_t f, uint32_t a, uint32_t b)
{
    for (uint32_t k = c->first_corner[a]; k != HW_NO_VERTEX; k = hw_next_corner(c, k))
        if (k / 4 < f && hw_face_has(c->faces[k / 4], b))
            return false;
    return true;
}

// Marks the ends of open edges; locks the ends of edges with more than two faces, or whose two
// faces disagree in winding.
static void examine_edges(hw_collapser *c)
{
    for (uint32_t f = 0; f < c->face_count; f++) {
        if (c->faces[f][0] == HW_NO_VERTEX)
            continue;
        for (int i = 0; i < 3; i++) {
            uint32_t a = c->faces[f][i], b = c->faces[f][(i + 1) % 3];
            uint32_t same = 0, all = 0;
            for (uint32_t k = c->first_corner[a]; k != HW_NO_VERTEX; k = hw_next_corner(c, k)) {
                const uint32_t *face = c->faces[k / 4];
                all += hw_face_has(face, b);
                same += face[hw_next_place[k % 4]] == b;
            }
            if (all == 1) {
                c->border[a] = c->border[b] = true;
                c->border_edges++;
            }
            if (all > 2 || same > 1) {
                c->locked[a] = c->locked[b] = true;
                c->complex_edges += first_of_edge(c, f, a, b);
            }
        }
    }
}

hw_status hw_collapser_create(const double (*positions)[3], uint32_t vertex_count,
                              const uint32_t *indices, uint32_t face_count, const bool *locked,
                              hw_complex_edges complex, hw_collapser **out)
{
    hw_status status;
    hw_collapser *c = NULL;
    hw_split split = {0};
    *out = NULL;
    if (face_count > UINT32_MAX / 4 - 1)
        return hw_fail(HW_LIMIT, "a mesh of %u faces is too large to simplify", face_count);
    HW_GO(HW_NEW(&c, 1));
    if (complex == HW_COMPLEX_SPLIT) {
        HW_GO(hw_split_sheets(positions, vertex_count, indices, face_count, &split));
        indices = split.indices;
    }
    c->vertex_count = split.indices ? split.vertex_count : vertex_count;
    c->face_count = face_count;
    HW_GO(HW_NEW(&c->positions, c->vertex_count));
    HW_GO(HW_NEW(&c->source, c->vertex_count));
    HW_GO(HW_NEW(&c->faces, face_count));
    HW_GO(HW_NEW(&c->first_corner, c->vertex_count));
    HW_GO(HW_NEW(&c->locked, c->vertex_count));
    HW_GO(HW_NEW(&c->border, c->vertex_count));
    HW_GO(hw_collapse_queue_create(c->vertex_count, &c->queue));
    for (uint32_t v = 0; v < c->vertex_count; v++) {
        c->source[v] = split.indices ? split.source[v] : v;
        memcpy(c->positions[v], positions[c->source[v]], sizeof *positions);
        c->locked[v] = locked && locked[c->source[v]];
    }
    link_faces(c, indices, face_count);
    examine_edges(c);
    *out = c;
    c = NULL;
out:
    hw_split_free(&split);
    hw_collapser_destroy(c);
    return status;
}

void hw_collapser_destroy(hw_collapser *c)
{
    if (!c)
        return;
    hw_collapse_queue_destroy(c->queue);
    hw_free(c->positions);
    hw_free(c->source);
    hw_free(c->faces);
    hw_free(c->first_corner);
    hw_free(c->locked);
    hw_free(c->border);
    hw_free(c);
}

uint32_t hw_collapser_extract(const hw_collapser *c, uint32_t *vertices, uint32_t *indices)
{
    struct hw_collapse_queue *q = c->queue;
    uint32_t vertex_count = 0;
    for (uint32_t v = 0; v < c->vertex_count; v++) {
        if (c->first_corner[v] == HW_NO_VERTEX)
            continue;
        q->mark[v] = vertex_count; // marks are scratch; mark_value is renewed below
        vertices[vertex_count++] = v;
    }
    size_t n = 0;
    for (uint32_t f = 0; f < c->face_count; f++)
        if (c->faces[f][0] != HW_NO_VERTEX)
            for (int i = 0; i < 3; i++)
                indices[n++] = q->mark[c->faces[f][i]];
    memset(q->mark, 0, c->vertex_count * sizeof *q->mark);
    q->mark_value = 0;
    return vertex_count;
}
