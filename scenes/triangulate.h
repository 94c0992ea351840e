// Polygons into triangles.
#pragma once
#include "vec.h"

#define HW_POLYGON_MAX 1000u // corners

// Cuts a polygon of `count` corners (3 to HW_POLYGON_MAX; positions[corners[i]], in order, concave
// or not, nearly flat) into count - 2 triangles and writes 3 (count - 2) vertex indices to `out`.
// Every corner is used even where the polygon is degenerate or crosses itself; the winding is kept.
void hw_triangulate(const hw_vec3 *positions, const uint32_t *corners, uint32_t count,
                    uint32_t *out);
