// The cells from above, round the viewer: north (+y) is up. Part of the HUD.
#pragma once
#include "camera.h"
#include "hexgrid.h"
#include "hud_internal.h"

typedef struct hw_minimap {
    const hw_hexgrid *grid;
    const hw_box *boxes; // of the objects
    uint32_t box_count;
    const hw_camera *camera;
    const hw_camera *frozen; // whose cells and culling are kept; NULL: none
} hw_minimap;

// Draws a square of `side` pixels with its upper left corner at (x, y): objects, cells (lines),
// groups of the higher levels (stronger lines), the current cell (filled), the viewer and what it
// sees of the horizon.
void hw_minimap_draw(hw_hud *hud, const hw_minimap *map, float x, float y, float side);
