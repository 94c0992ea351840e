// How parts of the HUD add their quads.
#pragma once
#include "hud.h"

// Four corners in pixels of the window, y down, in order round the quad. Ignored once the HUD is
// full.
void hw_hud_add_quad(hw_hud *hud, const float corners[4][2], const uint8_t color[4]);
