// Which faces of a surface can be seen from some of many eyes.
#pragma once
#include "sight.h"

// A surface that stands for an object, or several.
typedef struct hw_sight_surface {
    hw_box box;         // of what it stands for: nothing within hides it
    const bool *hiders; // per object of the scene: which hide it; NULL: all
    uint32_t vertex_count, index_count;
    const hw_vec3 *positions; // world
    const uint32_t *indices;
    double spacing; // of the points of a face that are looked at, at most; world units
} hw_sight_surface;

// Each point is looked at from one eye in so many: its neighbours are from others.
#define HW_SIGHT_EYE_CLASSES 4u

// seen[i] tells whether face i may be seen: a point of it is from one of its eyes, or a point of a
// face that shares a vertex with it. eye_count is a multiple of HW_SIGHT_EYE_CLASSES.
HW_MUST_USE hw_status hw_sights_faces(const hw_sights *sights, const hw_sight_surface *surface,
                                      const hw_vec3 *eyes, uint32_t eye_count, bool *seen);
