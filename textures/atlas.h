// Packs rectangles into one atlas (stb_rect_pack).
#pragma once
#include "status.h"
#include <stdint.h>

typedef struct hw_rect {
    uint32_t x, y, width, height;
} hw_rect;

// Places all rectangles (width and height given, x and y set) without overlap in an atlas whose
// sides are multiples of 4 and at most `max_side`, trying for the smallest area; positions are
// multiples of `align` (a power of two). Deterministic. count 0 gives a 4 x 4 atlas. HW_LIMIT when
// they do not fit.
HW_MUST_USE hw_status hw_atlas_pack(hw_rect *rects, uint32_t count, uint32_t align,
                                    uint32_t max_side, uint32_t *width, uint32_t *height);
