// Visible sets: many boxes against a frustum, and their order by distance. No GL.
#pragma once
#include "camera.h"
#include "status.h"

// Boxes as six arrays (centre x, y, z and half sizes x, y, z), so that the test runs in vectors.
typedef struct hw_cull_set {
    uint32_t count;
    float *data; // 6 * count
} hw_cull_set;

// A set of `count` boxes, all empty (never visible) until put. Free with hw_cull_set_free.
HW_MUST_USE hw_status hw_cull_set_create(hw_cull_set *out, uint32_t count);
void hw_cull_set_free(hw_cull_set *set);
// Stores box i, enlarged by float rounding so that tests stay conservative.
void hw_cull_set_put(hw_cull_set *set, uint32_t i, hw_box box);

// Indices of the boxes that are not wholly outside one plane, rising. `visible` holds set->count
// values. Conservative: keeps whatever hw_frustum_meets_box keeps.
uint32_t hw_cull_visible(const hw_cull_set *set, const hw_frustum *frustum, uint32_t *visible);

// Sorts `count` items by rising keys (>= 0, to one part in 128: enough for front to back), stable.
// `scratch` holds `count` items.
typedef struct hw_cull_item {
    float key;
    uint32_t index;
} hw_cull_item;
void hw_cull_sort(hw_cull_item *items, uint32_t count, hw_cull_item *scratch);

// Distance from a point to a box; 0 inside.
float hw_box_distance(hw_box box, hw_vec3 point);
