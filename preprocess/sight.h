// Whether points can be seen from an eye past all that is in a scene, by rays in packets.
#pragma once
#include "rays.h"

typedef struct hw_sights hw_sights;

// Borrows scene and rays (of hw_rays_create_scene). Looks for boxes inside of closed meshes, which
// decide most questions quickly. Read-only afterwards: thread-safe.
HW_MUST_USE hw_status hw_sights_create(hw_sights **out, const hw_scene *scene, const hw_rays *rays);
void hw_sights_destroy(hw_sights *sights);

typedef enum hw_sight {
    HW_SIGHT_FREE,
    HW_SIGHT_WEAK,  // hidden by nothing but skin: the line passes an edge of something closely
    HW_SIGHT_HIDDEN // by the inside of something
} hw_sight;

// How points on an object or near it (`count` of them, at most HW_RAYS_PACKET) look from an eye.
// What lies in the object's box does not count: lines end where they enter it. Surfaces hide what
// is behind them from their front only, as they are drawn (closed meshes, turned outward, from all
// sides). With `hiders`, one value per object, those for which it is false hide nothing.
void hw_sights_look(const hw_sights *sights, hw_vec3 eye, hw_box box, const bool *hiders,
                    const hw_vec3 *points, uint32_t count, hw_sight *out);

// Where the line origin + t direction enters a box, t >= 0; INFINITY if it misses.
float hw_box_entry(hw_vec3 origin, hw_vec3 direction, hw_box box);
