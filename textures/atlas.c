#include "atlas.h"
#include "alloc.h"
#include <assert.h>
#include <math.h>
#include <stdbool.h>

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wcast-qual"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wundef"
#define STB_RECT_PACK_IMPLEMENTATION
#define STBRP_STATIC
#include <stb/stb_rect_pack.h>
#pragma GCC diagnostic pop

// Widths tried, from the narrowest sensible to twice the square's, and both heuristics of each.
#define TRIES 14

// Everything below counts in units of the alignment.
typedef struct packing {
    stbrp_rect *rects, *best;
    stbrp_node *nodes;
    uint32_t count;
    uint32_t limit;       // largest side, units
    uint32_t step;        // sides are multiples of this
    uint64_t area;        // of the best
    uint32_t best_width;  // 0: none yet
    uint32_t best_height; //
} packing;

static uint32_t round_up(uint32_t value, uint32_t step)
{
    return (value + step - 1) / step * step;
}

// Packs into a strip of this width; keeps the result if its area is the smallest yet (among equals
// the squarer one).
static void try_width(packing *p, uint32_t strip, int heuristic)
{
    stbrp_context context;
    stbrp_init_target(&context, (int)strip, (int)p->limit, p->nodes, (int)strip);
    stbrp_setup_heuristic(&context, heuristic);
    if (!stbrp_pack_rects(&context, p->rects, (int)p->count))
        return;
    uint32_t width = 1, height = 1;
    for (uint32_t i = 0; i < p->count; i++) {
        uint32_t right = (uint32_t)(p->rects[i].x + p->rects[i].w);
        uint32_t bottom = (uint32_t)(p->rects[i].y + p->rects[i].h);
        width = right > width ? right : width;
        height = bottom > height ? bottom : height;
    }
    width = round_up(width, p->step);
    height = round_up(height, p->step);
    uint64_t area = (uint64_t)width * height;
    uint32_t side = width > height ? width : height;
    uint32_t best_side = p->best_width > p->best_height ? p->best_width : p->best_height;
    if (p->best_width && (area > p->area || (area == p->area && side >= best_side)))
        return;
    p->area = area;
    p->best_width = width;
    p->best_height = height;
    for (uint32_t i = 0; i < p->count; i++)
        p->best[i] = p->rects[i];
}

static void try_widths(packing *p, uint32_t widest, uint64_t total)
{
    uint32_t low = (uint32_t)ceil(0.7 * sqrt((double)total));
    low = round_up(low > widest ? low : widest, p->step);
    low = low < p->limit ? low : p->limit;
    uint64_t wide = 3 * (uint64_t)low;
    uint32_t high = wide < p->limit ? (uint32_t)wide : p->limit, last = 0;
    for (uint32_t i = 0; i <= TRIES; i++) {
        uint32_t strip = low + (uint32_t)((uint64_t)(high - low) * i / TRIES);
        // The widest strip of all comes last, in case nothing narrower holds them.
        if (i == TRIES)
            strip = p->best_width ? high : p->limit;
        strip = strip / p->step * p->step;
        if (strip == last)
            continue;
        last = strip;
        try_width(p, strip, STBRP_HEURISTIC_Skyline_BL_sortHeight);
        try_width(p, strip, STBRP_HEURISTIC_Skyline_BF_sortHeight);
    }
}

// Sizes in units; false if one is too large by itself, or all together are.
static bool measure(packing *p, const hw_rect *rects, uint32_t align, uint32_t *widest,
                    uint64_t *total)
{
    for (uint32_t i = 0; i < p->count; i++) {
        uint64_t w = ((uint64_t)rects[i].width + align - 1) / align;
        uint64_t h = ((uint64_t)rects[i].height + align - 1) / align;
        if (w > p->limit || h > p->limit)
            return false;
        p->rects[i] = (stbrp_rect){.id = (int)i, .w = (int)w, .h = (int)h};
        *widest = w > *widest ? (uint32_t)w : *widest;
        *total += w * h;
    }
    return *total <= (uint64_t)p->limit * p->limit;
}

hw_status hw_atlas_pack(hw_rect *rects, uint32_t count, uint32_t align, uint32_t max_side,
                        uint32_t *width, uint32_t *height)
{
    assert(align > 0 && (align & (align - 1)) == 0);
    assert(max_side <= 32768 && count <= INT32_MAX);
    *width = *height = 0;
    packing p = {.count = count, .step = align < 4 ? 4 / align : 1};
    p.limit = max_side / align / p.step * p.step;
    uint32_t widest = 1;
    uint64_t total = 0;
    hw_status status = HW_OK;
    if (p.limit == 0)
        return hw_fail(HW_LIMIT, "an atlas of at most %u texels a side", max_side);
    HW_GO(HW_NEW(&p.rects, count));
    HW_GO(HW_NEW(&p.best, count));
    HW_GO(HW_NEW(&p.nodes, p.limit));
    if (measure(&p, rects, align, &widest, &total))
        try_widths(&p, widest, total);
    if (p.best_width == 0) {
        status = hw_fail(HW_LIMIT, "%u rectangles do not fit an atlas of %u x %u texels", count,
                         max_side, max_side);
        goto out;
    }
    for (uint32_t i = 0; i < count; i++) {
        rects[i].x = (uint32_t)p.best[i].x * align;
        rects[i].y = (uint32_t)p.best[i].y * align;
    }
    *width = p.best_width * align;
    *height = p.best_height * align;
out:
    hw_free(p.rects);
    hw_free(p.best);
    hw_free(p.nodes);
    return status;
}
