#include "prefetch_queue.h"

bool hw_data_key_equal(hw_data_key a, hw_data_key b)
{
    return a.kind == b.kind && a.index == b.index && a.level == b.level;
}

static void take_out(hw_prefetch_queue *queue, uint32_t i, hw_wish *out)
{
    *out = queue->wishes[i];
    queue->wishes[i] = queue->wishes[--queue->count];
}

bool hw_prefetch_queue_put(hw_prefetch_queue *queue, const hw_wish *wish, hw_wish *lost)
{
    uint32_t least = 0;
    for (uint32_t i = 0; i < queue->count; i++) {
        if (hw_data_key_equal(queue->wishes[i].key, wish->key)) {
            queue->wishes[i].t_priority = wish->t_priority;
            return false;
        }
        if (queue->wishes[i].t_priority < queue->wishes[least].t_priority)
            least = i;
    }
    if (queue->count < HW_PREFETCH_QUEUE_MAX) {
        queue->wishes[queue->count++] = *wish;
        return false;
    }
    *lost = *wish;
    if (queue->wishes[least].t_priority < wish->t_priority) {
        *lost = queue->wishes[least];
        queue->wishes[least] = *wish;
    }
    return true;
}

// Of a queue that is not empty.
static uint32_t find_best(const hw_prefetch_queue *queue)
{
    uint32_t best = 0;
    for (uint32_t i = 1; i < queue->count; i++)
        if (queue->wishes[i].t_priority > queue->wishes[best].t_priority)
            best = i;
    return best;
}

bool hw_prefetch_queue_peek(const hw_prefetch_queue *queue, hw_wish *out)
{
    if (queue->count == 0)
        return false;
    *out = queue->wishes[find_best(queue)];
    return true;
}

bool hw_prefetch_queue_take(hw_prefetch_queue *queue, hw_wish *out)
{
    if (queue->count == 0)
        return false;
    take_out(queue, find_best(queue), out);
    return true;
}

bool hw_prefetch_queue_drop(hw_prefetch_queue *queue, double timestamp, hw_wish *out)
{
    for (uint32_t i = 0; i < queue->count; i++) {
        if (queue->wishes[i].t_priority < timestamp - HW_PREFETCH_STALE) {
            take_out(queue, i, out);
            return true;
        }
    }
    return false;
}
