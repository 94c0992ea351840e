// Courts: a raster of rooms under the sky, divided by walls, hedges and colonnades with doorways,
// so that one can walk from any court to any other but sees little more than the one around.
#pragma once
#include "scene.h"

#define HW_COURT_SIDE 180.0 // units, from the middle of a wall to that of the next

// A square region of the x-y plane.
typedef struct hw_court_floor {
    double x_min, y_min, side;
} hw_court_floor;

// Where things may stand in court `index` of columns * rows: the raster is centred on the origin,
// and a way stays open along the walls.
hw_court_floor hw_court_floor_of(uint32_t columns, uint32_t rows, uint32_t index);
// Appends the meshes, materials and objects that divide columns x rows courts (each > 0) to the
// scene. Doorways are 38 units wide or more; the outer wall has none.
HW_MUST_USE hw_status hw_court_build(hw_scene *scene, uint32_t columns, uint32_t rows,
                                     uint64_t seed);
