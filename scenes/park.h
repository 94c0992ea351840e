// Statuary parks after table 5.2 of the thesis: statues of stated number and largest dimensions
// strewn over an area.
#pragma once
#include "scene.h"

typedef struct hw_park_options {
    const char *preset;    // "demo", "2m", "4m", "8m", or NULL for the next three
    uint32_t object_count; //
    double width, depth;   // area in units
    uint64_t seed;         //
    const char *statue_folder;
} hw_park_options;

// The scene: one mesh per kind of statue (scaled to the table's size), one object per statue, a
// palette of stone tints as materials, a ground. 2m is a subset of 4m, 4m of 8m. No two objects'
// bounds overlap. Ambient occlusion is not baked here (preprocess/ambient does that). HW_USAGE for
// an unknown preset, HW_LIMIT if the objects do not fit the area.
HW_MUST_USE hw_status hw_park_make(const hw_park_options *options, hw_scene *out);
