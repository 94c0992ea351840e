// Boxes by place: a grid of squares over the x-y plane, each with the list of boxes near it, so
// that a query looks at one list.
#pragma once
#include "status.h"
#include "vec.h"

typedef struct hw_box_grid hw_box_grid;

// Lists box i in every square that has a point within `reach` (> 0) of it in x and y. `bounds`
// holds all boxes; nothing of the arguments is kept. HW_LIMIT when there are too many boxes.
// Read-only afterwards: queries are thread-safe.
HW_MUST_USE hw_status hw_box_grid_create(hw_box_grid **out, const hw_box *boxes, uint32_t count,
                                         hw_box bounds, double reach);
void hw_box_grid_destroy(hw_box_grid *grid);
// The boxes that may be within reach of (x, y), in rising order: all that are, and some others.
// Returns how many; *indices points into the grid.
uint32_t hw_box_grid_at(const hw_box_grid *grid, double x, double y, const uint32_t **indices);
