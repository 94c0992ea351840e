#include "progressive_links.h"
#include "alloc.h"
#include "progressive_internal.h"
#include <stdlib.h>
#include <string.h>

hw_status hw_links_grow(hw_links *links, uint32_t vertices, uint32_t faces)
{
    if (vertices > links->vertex_count) {
        size_t added = vertices - links->vertex_count;
        HW_TRY(HW_RESIZE(&links->head, vertices));
        HW_TRY(HW_RESIZE(&links->mark, vertices));
        memset(links->head + links->vertex_count, 0xff, added * sizeof *links->head);
        memset(links->mark + links->vertex_count, 0, added * sizeof *links->mark);
        links->vertex_count = vertices;
    }
    if (faces > links->face_count) {
        HW_TRY(HW_RESIZE(&links->next, 3 * (size_t)faces));
        links->face_count = faces;
    }
    return HW_OK;
}

void hw_links_free(hw_links *links)
{
    hw_free(links->head);
    hw_free(links->next);
    hw_free(links->mark);
    *links = (hw_links){0};
}

static void add_corner(hw_links *links, uint32_t vertex, uint32_t corner)
{
    links->next[corner] = links->head[vertex];
    links->head[vertex] = corner;
}

void hw_links_add_face(hw_links *links, const uint32_t *corners, uint32_t face)
{
    for (uint32_t c = 3 * face; c < 3 * face + 3; c++)
        add_corner(links, corners[c], c);
}

void hw_fan_free(hw_fan *fan)
{
    hw_free(fan->corners);
    hw_free(fan->order);
    hw_free(fan->ring);
    hw_free(fan->moved);
    hw_free(fan->trial);
    *fan = (hw_fan){0};
}

static int compare_corners(const void *a, const void *b)
{
    const uint32_t *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

// Lists of a vertex are short but for hubs.
static void sort_corners(uint32_t *corners, uint32_t count)
{
    if (count > 32) {
        qsort(corners, count, sizeof *corners, compare_corners);
        return;
    }
    for (uint32_t i = 1; i < count; i++) {
        uint32_t c = corners[i], k = i;
        for (; k > 0 && corners[k - 1] > c; k--)
            corners[k] = corners[k - 1];
        corners[k] = c;
    }
}

static uint32_t corner_after(uint32_t corner)
{
    return corner % 3 == 2 ? corner - 2 : corner + 1;
}

static uint32_t corner_before(uint32_t corner)
{
    return corner % 3 == 0 ? corner + 2 : corner - 1;
}

// Walks from face to face: the next one begins at the vertex where this one ends. mark[v] is one
// more than the face that begins at v.
static void walk(hw_fan *fan, const uint32_t *mark, const uint32_t *corners, uint32_t start)
{
    uint32_t n = 0, i = start;
    do {
        fan->order[n] = i;
        fan->ring[n++] = corners[corner_after(fan->corners[i])];
        uint32_t end = corners[corner_before(fan->corners[i])];
        if (mark[end] == 0) { // open
            fan->ring[n] = end;
            fan->ring_count = n == fan->count ? n + 1 : 0;
            return;
        }
        i = mark[end] - 1;
    } while (n < fan->count && i != start);
    fan->ring_count = n == fan->count && i == start ? n : 0;
}

// The face to start at: the only one that no face leads to, else the first.
static uint32_t find_start(const hw_fan *fan, hw_links *links, const uint32_t *corners)
{
    uint32_t start = 0;
    memset(fan->order, 0, fan->count * sizeof *fan->order);
    for (uint32_t i = 0; i < fan->count; i++) {
        uint32_t follower = links->mark[corners[corner_before(fan->corners[i])]];
        if (follower > 0)
            fan->order[follower - 1] = 1;
    }
    while (start < fan->count && fan->order[start])
        start++;
    return start < fan->count ? start : 0;
}

static void arrange(hw_fan *fan, hw_links *links, const uint32_t *corners)
{
    bool fine = fan->count > 0;
    for (uint32_t i = 0; i < fan->count; i++) {
        uint32_t *mark = &links->mark[corners[corner_after(fan->corners[i])]];
        fine = fine && *mark == 0;
        *mark = i + 1;
    }
    if (fine)
        walk(fan, links->mark, corners, find_start(fan, links, corners));
    for (uint32_t i = 0; i < fan->count; i++)
        links->mark[corners[corner_after(fan->corners[i])]] = 0;
}

hw_status hw_fan_look(hw_fan *fan, hw_links *links, const uint32_t *corners, uint32_t vertex)
{
    uint32_t n = 0;
    fan->count = fan->ring_count = 0;
    for (uint32_t c = links->head[vertex]; c != HW_NO_INDEX; c = links->next[c]) {
        HW_TRY(HW_RESERVE(&fan->corners, &fan->corner_capacity, (size_t)n + 1));
        fan->corners[n++] = c;
    }
    HW_TRY(HW_RESERVE(&fan->order, &fan->order_capacity, (size_t)n + 1));
    HW_TRY(HW_RESERVE(&fan->ring, &fan->ring_capacity, (size_t)n + 1));
    HW_TRY(HW_RESERVE(&fan->moved, &fan->moved_capacity, (size_t)n + 1));
    HW_TRY(HW_RESERVE(&fan->trial, &fan->trial_capacity, (size_t)n + 1));
    memset(fan->moved, 0, n);
    fan->count = n;
    links->steps += n;
    sort_corners(fan->corners, n);
    arrange(fan, links, corners);
    return HW_OK;
}

static void take(const hw_fan *fan, uint8_t *moved, uint32_t from, uint32_t to)
{
    for (uint32_t i = from; i < to; i++)
        moved[fan->order[i]] = 1;
}

static bool divide(const hw_fan *fan, hw_split_kind kind, uint32_t s, uint32_t t, uint8_t *moved)
{
    uint32_t count = fan->count, ring = fan->ring_count;
    memset(moved, 0, count);
    if (s >= ring || t > ring)
        return false;
    if (kind != HW_SPLIT_BOTH) {
        take(fan, moved, kind == HW_SPLIT_AGAINST ? s : 0, kind == HW_SPLIT_AGAINST ? count : s);
        return ring > count;
    }
    if (s + t < ring) {
        take(fan, moved, s, s + t);
        return true;
    }
    // In an open fan, crossing the gap from the ring's last vertex to its first takes a step of t
    // but no face.
    take(fan, moved, s, count);
    take(fan, moved, 0, s + t - ring);
    return true;
}

bool hw_fan_divide(hw_fan *fan, hw_split_kind kind, uint32_t s, uint32_t t)
{
    return divide(fan, kind, s, t, fan->moved);
}

static uint32_t find_ring(const hw_fan *fan, uint32_t vertex)
{
    uint32_t i = 0;
    while (i < fan->ring_count && fan->ring[i] != vertex)
        i++;
    return i;
}

static bool divides(const hw_fan *fan, hw_split_kind kind, uint32_t s, uint32_t t)
{
    return divide(fan, kind, s, t, fan->trial) && memcmp(fan->trial, fan->moved, fan->count) == 0;
}

hw_split_kind hw_fan_recognise(const hw_fan *fan, uint32_t against, uint32_t along, uint32_t *s,
                               uint32_t *t)
{
    uint32_t ring = fan->ring_count;
    *t = 0;
    if (ring == 0)
        return HW_SPLIT_EXPLICIT;
    if (along == HW_NO_INDEX || against == HW_NO_INDEX) {
        hw_split_kind kind = along == HW_NO_INDEX ? HW_SPLIT_AGAINST : HW_SPLIT_ALONG;
        *s = find_ring(fan, along == HW_NO_INDEX ? against : along);
        return divides(fan, kind, *s, 0) ? kind : HW_SPLIT_EXPLICIT;
    }
    uint32_t e = find_ring(fan, along);
    *s = find_ring(fan, against);
    if (*s >= ring || e >= ring)
        return HW_SPLIT_EXPLICIT;
    *t = (e + ring - *s) % ring;
    if (divides(fan, HW_SPLIT_BOTH, *s, *t))
        return HW_SPLIT_BOTH;
    *t = ring; // from s all the way round to s
    return e == *s && divides(fan, HW_SPLIT_BOTH, *s, ring) ? HW_SPLIT_BOTH : HW_SPLIT_EXPLICIT;
}

void hw_fan_move(const hw_fan *fan, hw_links *links, uint32_t k, uint32_t l)
{
    links->head[k] = HW_NO_INDEX;
    for (uint32_t i = 0; i < fan->count; i++)
        add_corner(links, fan->moved[i] ? l : k, fan->corners[i]);
}
