// What the near objects of a frame hide: other near objects, and far ones.
#include "hybrid_internal.h"

// What dissolves has gaps, and the near plane opens what it cuts.
static bool hides(const hybrid *h, const near_draw *draw)
{
    return draw->level && hw_kept_phase(draw->kept) == HW_PHASE_WHOLE &&
           (double)draw->distance > 2 * hw_hiding_near_reach(h->hiding);
}

static const hw_mat4 *transform_of(const hybrid *h, const near_draw *draw)
{
    return &h->manifest.objects[draw->object_idx].transform;
}

static void add(hybrid *h, const near_draw *draw)
{
    const hw_inner_boxes *filled = &draw->level->inside.filled;
    for (uint32_t k = 0; k < filled->count; k++)
        hw_hiding_add(h->hiding, transform_of(h, draw), filled->boxes[k]);
}

static bool is_hidden(const hybrid *h, const near_draw *draw)
{
    return draw->level &&
           hw_hiding_hides(h->hiding, transform_of(h, draw), draw->level->inside.bounds);
}

void hw_hybrid_hide_near(hybrid *h, const hw_camera *camera, uint32_t *count)
{
    uint32_t left = 0;
    h->hidden_count = 0;
    h->hides = h->hiding && !h->debug->wireframe;
    if (!h->hides)
        return;
    hw_hiding_begin(h->hiding, camera);
    for (uint32_t i = 0; i < *count; i++)
        if (hides(h, &h->near[i]) && !is_hidden(h, &h->near[i]))
            add(h, &h->near[i]);
    for (uint32_t i = 0; i < *count; i++) {
        bool hidden = is_hidden(h, &h->near[i]);
        h->near[left] = h->near[i];
        left += !hidden;
        h->hidden_count += hidden;
    }
    *count = left;
}

uint32_t hw_hybrid_hide_far(hybrid *h, const hw_cell_gpu *cell, uint32_t *visible, uint32_t count)
{
    uint32_t left = 0;
    if (!h->hides)
        return count;
    for (uint32_t i = 0; i < count; i++) {
        bool hidden = hw_hiding_hides(h->hiding, NULL, cell->records->far[visible[i]].bounds);
        visible[left] = visible[i];
        left += !hidden;
        h->hidden_count += hidden;
    }
    return left;
}
