// Options of configuration C that walk, render and measure have in common: rows of their tables.
#pragma once
#include "options.h"
#include "renderer.h"

// `value` points to a uint64_t.
#define HW_OPTION_NEAR_TRIANGLES(value)                                                            \
    {                                                                                              \
        "near-triangles", 0, HW_OPTION_UINT, value, "N", NULL, 1, UINT32_MAX,                      \
            "Triangles of a frame's near objects in configuration C, at most: beyond that all of " \
            "them "                                                                                \
            "become coarser together."                                                             \
    }
// `value` points to "on" or "off".
#define HW_OPTION_OCCLUSION_CULLING(value)                                                         \
    {                                                                                              \
        "occlusion-culling", 0, HW_OPTION_CHOICE, value, NULL, "on|off", 0, 0,                     \
            "Leave out what near objects hide in configuration C; changes no pixel."               \
    }
