#include "collapse_queue.h"
#include "alloc.h"
#include <assert.h>
#include <string.h>

#define ARITY 4u // children of a node lie in one or two cache lines

hw_status hw_collapse_queue_create(uint32_t vertex_count, hw_collapse_queue **out)
{
    hw_status status;
    hw_collapse_queue *q = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&q, 1));
    q->vertex_count = vertex_count;
    HW_GO(HW_NEW(&q->generation, vertex_count));
    HW_GO(HW_NEW(&q->touched, vertex_count));
    HW_GO(HW_NEW(&q->mark, vertex_count));
    *out = q;
    q = NULL;
out:
    hw_collapse_queue_destroy(q);
    return status;
}

void hw_collapse_queue_destroy(hw_collapse_queue *q)
{
    if (!q)
        return;
    hw_free(q->heap);
    hw_free(q->generation);
    hw_free(q->touched);
    hw_free(q->mark);
    hw_free(q);
}

hw_status hw_collapse_queue_reset(hw_collapse_queue *q, uint32_t edges)
{
    q->count = 0;
    uint32_t capacity = edges + edges / 4 + 64;
    if (capacity > q->capacity) {
        HW_TRY(HW_RESIZE(&q->heap, capacity));
        q->capacity = capacity;
    }
    return HW_OK;
}

hw_queue_entry hw_collapse_queue_entry(const hw_collapse_queue *q, uint32_t a, uint32_t b,
                                       double cost)
{
    return (hw_queue_entry){a < b ? a : b, (float)cost, a < b ? b : a,
                            (uint16_t)(q->generation[a] + q->generation[b]),
                            (uint16_t)(q->touched[a] + q->touched[b])};
}

bool hw_collapse_queue_is_old(const hw_collapse_queue *q, const hw_queue_entry *e)
{
    return e->generation != (uint16_t)(q->generation[e->a] + q->generation[e->b]);
}

bool hw_collapse_queue_is_touched(const hw_collapse_queue *q, const hw_queue_entry *e)
{
    return e->touched != (uint16_t)(q->touched[e->a] + q->touched[e->b]);
}

// Costs are not negative, so their bits order as they do. Ties go by vertex: they must not depend
// on history.
static inline uint64_t order_key(const hw_queue_entry *e)
{
    uint32_t bits;
    memcpy(&bits, &e->cost, sizeof bits);
    return (uint64_t)bits << 32 | e->a;
}

static inline bool before(const hw_queue_entry *x, const hw_queue_entry *y)
{
    uint64_t kx = order_key(x), ky = order_key(y);
    return kx < ky || (kx == ky && x->b < y->b);
}

static void sift_up(hw_collapse_queue *q, uint32_t at, hw_queue_entry entry)
{
    while (at > 0) {
        uint32_t parent = (at - 1) / ARITY;
        if (!before(&entry, &q->heap[parent]))
            break;
        q->heap[at] = q->heap[parent];
        at = parent;
    }
    q->heap[at] = entry;
}

static void sift_down(hw_collapse_queue *q, uint32_t at, hw_queue_entry entry)
{
    for (;;) {
        uint64_t first = (uint64_t)at * ARITY + 1, last = first + ARITY;
        if (first >= q->count)
            break;
        if (last > q->count)
            last = q->count;
        uint32_t least = (uint32_t)first;
        for (uint32_t child = least + 1; child < last; child++)
            if (before(&q->heap[child], &q->heap[least]))
                least = child;
        if (!before(&q->heap[least], &entry))
            break;
        q->heap[at] = q->heap[least];
        at = least;
    }
    q->heap[at] = entry;
}

void hw_collapse_queue_append(hw_collapse_queue *q, hw_queue_entry entry)
{
    assert(q->count < q->capacity);
    q->heap[q->count++] = entry;
}

void hw_collapse_queue_order(hw_collapse_queue *q)
{
    for (uint32_t i = q->count; i-- > 0;)
        sift_down(q, i, q->heap[i]);
}

static void purge(hw_collapse_queue *q)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < q->count; i++)
        if (!hw_collapse_queue_is_old(q, &q->heap[i]))
            q->heap[n++] = q->heap[i];
    q->count = n;
    hw_collapse_queue_order(q);
}

hw_status hw_collapse_queue_push(hw_collapse_queue *q, hw_queue_entry entry)
{
    if (q->count == q->capacity) {
        purge(q);
        if (q->count > q->capacity / 8 * 7) { // little was out of date: it would soon be full again
            uint32_t capacity = q->capacity + q->capacity / 8 + 64;
            HW_TRY(HW_RESIZE(&q->heap, capacity));
            q->capacity = capacity;
        }
    }
    sift_up(q, q->count++, entry);
    return HW_OK;
}

hw_queue_entry hw_collapse_queue_pop(hw_collapse_queue *q)
{
    assert(q->count > 0);
    hw_queue_entry top = q->heap[0], last = q->heap[--q->count];
    if (q->count > 0)
        sift_down(q, 0, last);
    return top;
}

uint32_t hw_collapse_queue_new_mark(hw_collapse_queue *q)
{
    if (++q->mark_value == 0) {
        memset(q->mark, 0, q->vertex_count * sizeof *q->mark);
        q->mark_value = 1;
    }
    return q->mark_value;
}
