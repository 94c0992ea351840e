// Maps of a dataset: its cells from above, coloured by what they hold.
#pragma once
#include "image.h"
#include "manifest.h"

#define HW_MAP_QUANTITIES "bytes|triangles|far|near"

typedef struct hw_map_legend {
    double least, most; // of the quantity: the darkest and the brightest colour
    double mean;
    uint32_t cells;
    uint32_t missing; // cells whose files could not be read; grey
} hw_map_legend;

// North (y) is up, the longer side has `side` pixels; objects are dots. `quantity` is one of
// HW_MAP_QUANTITIES; all but bytes read the head of every cell file. Free the image with
// hw_image_free.
HW_MUST_USE hw_status hw_map_draw(const char *dataset, const hw_manifest *manifest,
                                  const char *quantity, uint32_t side, hw_image *out,
                                  hw_map_legend *legend);
