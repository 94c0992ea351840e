// Views for looking behind the picture: what stands for each object, the triangles, the culled set.
// They cost nothing while they are off. GL thread only.
#pragma once
#include "camera.h"
#include <stdbool.h>

typedef struct hw_debug_view {
    bool tint;        // objects in the colour of what stands for them, times their own
    bool wireframe;   // needs a desktop GL
    bool hard;        // crossings without dissolves
    bool frozen;      // cells, culling and levels of detail stay those of `camera`
    hw_camera camera; // of the moment that is kept
} hw_debug_view;

// What stands for an object in a frame (the colours of thesis figure 5.17c).
typedef enum hw_representation {
    HW_REPRESENTATION_FULL,   // A and B: the original mesh
    HW_REPRESENTATION_LOD,    // L: a level of detail
    HW_REPRESENTATION_NEAR,   // C: a near object's level of detail
    HW_REPRESENTATION_SVMESH, // C: textured, seen from one view
    HW_REPRESENTATION_MVMESH, // C: textured, seen from several
    HW_REPRESENTATION_COUNT
} hw_representation;

const char *hw_representation_name(hw_representation representation);
// Red, green and blue in [0, 1].
const float *hw_representation_color(hw_representation representation);

// For the renderers. The camera that chooses what is drawn: the frozen one, or the given one.
const hw_camera *hw_debug_culling_camera(const hw_debug_view *view, const hw_camera *camera);
// What is drawn from now on gets the tint; does nothing while tints are off.
void hw_debug_tint(const hw_debug_view *view, hw_representation representation);
// Before the first and after the last draw call of a frame.
void hw_debug_begin(const hw_debug_view *view);
void hw_debug_end(const hw_debug_view *view);
