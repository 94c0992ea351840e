// Crossings without pops (thesis 5.2.2): near a border a frame takes some of its pixels from the
// cell beyond it, half of them on the border itself. The share depends on where the viewer stands
// and on nothing else: pictures do not depend on the way there, and one may linger on a border.
//
// Each pixel shows one of the two cells, chosen by a fixed pattern over the screen (a dissolve):
// unlike blending, this needs no order of drawing, and depth stays right.
#pragma once
#include "hexgrid.h"
#include <stdbool.h>

// What part of the pixels something is drawn in.
typedef enum hw_fade {
    HW_FADE_NONE, // all
    HW_FADE_OUT,  // those that show the viewer's cell
    HW_FADE_IN    // those that show the cell beyond the border
} hw_fade;

typedef struct hw_crossing {
    float share;      // of the pixels that show the other cell, 0 to 0.5; 0: there is none
    hw_cell_id other; // of level 0
} hw_crossing;

// From the viewer's cell (of level 0). width: of the strip along each side of a border, in cell
// sizes; 0: none.
hw_crossing hw_crossing_at(const hw_hexgrid *grid, hw_cell_id id, hw_vec3 eye, double width);
// Shaders come in two phases; only the second (with DISSOLVE defined) leaves pixels out.
enum { HW_PHASE_WHOLE, HW_PHASE_DISSOLVING, HW_PHASES };
int hw_fade_phase(hw_fade fade);
// The pixels of a fade: those whose number in [0, 1) (shaders/dissolve.glsl) lies in [out[0],
// out[1]).
void hw_fade_range(hw_fade fade, float share, float out[2]);
