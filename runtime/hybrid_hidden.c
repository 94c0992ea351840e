// What the near objects of a frame hide: other near objects, and far ones.
#include "hybrid_internal.h"

// What dissolves has gaps, and the near plane opens what it cuts.
static bool hides(const hybrid *h, const near_draw *draw)
{
    return draw->level && draw->fade == HW_FADE_NONE &&
           (double)draw->distance > 2 * hw_hiding_near_reach(h->hiding);
}

void hw_hybrid_hide_near(hybrid *h, const hw_camera *camera, uint32_t *count)
{
    uint32_t left = 0;
    h->hidden_count = 0;
    h->hides = h->hiding && !h->debug->wireframe;
    if (!h->hides)
        return;
    hw_hiding_begin(h->hiding, camera);
    for (uint32_t i = 0; i < *count; i++) {
        const near_draw *draw = &h->near[i];
        const hw_manifest_object *object = &h->manifest.objects[draw->object_idx];
        for (uint32_t k = 0; hides(h, draw) && k < draw->level->inside.box_count; k++)
            hw_hiding_add(h->hiding, &object->transform, draw->level->inside.boxes[k]);
    }
    for (uint32_t i = 0; i < *count; i++) {
        const near_draw *draw = &h->near[i];
        const hw_manifest_object *object = &h->manifest.objects[draw->object_idx];
        bool hidden = draw->level && hw_hiding_hides(h->hiding, &object->transform,
                                                     draw->level->inside.bounds);
        h->near[left] = *draw;
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
        bool hidden = hw_hiding_hides(h->hiding, NULL, cell->records->far[visible[i]].drawn);
        visible[left] = visible[i];
        left += !hidden;
        h->hidden_count += hidden;
    }
    return left;
}
