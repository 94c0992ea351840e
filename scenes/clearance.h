// How far an eye at a given height is from the objects of a scene: what a camera path must keep.
#pragma once
#include "scene.h"

typedef struct hw_clearance hw_clearance;

// For eyes at height `eye_z`; distances are told up to `reach` (> 0). The scene's bounds must be up
// to date; nothing of it is kept. Read-only afterwards: queries are thread-safe.
HW_MUST_USE hw_status hw_clearance_create(hw_clearance **out, const hw_scene *scene, double eye_z,
                                          double reach);
void hw_clearance_destroy(hw_clearance *clearance);
// Distance from (x, y, eye_z) to the nearest object's bounds, at most `reach`; 0 inside. A non-null
// `away` gets the horizontal unit direction in which to leave that object, zeros if none is within
// reach.
double hw_clearance_at(const hw_clearance *clearance, double x, double y, double away[2]);
