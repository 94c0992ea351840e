// Statuary parks after table 5.2 of the thesis: statues of stated number and largest dimensions
// strewn over an area.
#pragma once
#include "scene.h"

typedef struct hw_park_options {
    const char *preset;    // "demo", "2m", "4m", "8m", "84m", "court", or NULL for the next four
    uint32_t object_count; // from 1 to HW_PARK_OBJECTS_MAX
    double width, depth;   // area in units (x, y); both 0: the density of the presets
    uint64_t seed;         //
    bool with_dragon;      // the mix of kinds of 8m, else that of demo
    const char *statue_folder;
} hw_park_options;

#define HW_PARK_OBJECTS_MAX 10000000u

// The scene: one mesh per kind of statue (named after it, scaled to the table's size), one object
// per statue, a palette of stone tints as materials, a ground. The area is centred on the origin,
// the ground reaches beyond it. 2m is a subset of 4m, 4m of 8m: the first objects are the same; 84m
// is ten times 8m at its density. court divides its area by walls and hedges (court.h), which come
// after the statues. No two statues' bounds overlap. Ambient occlusion is not baked here
// (preprocess/ambient does that). The caller frees *out with hw_scene_free; on failure it is
// zeroed. HW_USAGE for an unknown preset or senseless numbers, HW_LIMIT if the objects do not fit
// the area, HW_NOT_FOUND for a missing statue.
HW_MUST_USE hw_status hw_park_make(const hw_park_options *options, hw_scene *out);
