// Crossings without pops (thesis 5.2.2): near borders a frame takes some of what it shows from the
// cells beyond, half of it on a border, a third where three cells meet. The shares depend on where
// the viewer stands and on nothing else: pictures do not depend on the way there, and one may
// linger on a border.
//
// The cells of a frame divide a scale from 0 to 1 into intervals as long as their shares. Every
// pixel of every object has a number on that scale, and shows the object as the cell has it in
// whose interval the number lies (a dissolve): unlike blending, this needs no order of drawing, and
// depth stays right. The numbers of one object cover only a part of the scale, its turn. So only
// a part of the objects dissolve at a time, and the others are drawn once.
#pragma once
#include "hexgrid.h"
#include <stdbool.h>

#define HW_CROSSING_CELLS 3    // that a frame shows at most
#define HW_CROSSING_MAX   0.43 // cell sizes: in wider strips four cells would meet
// Turns that objects take. With more of them fewer are drawn twice, but each changes faster: in
// equal strips four jump 10 % more than two at 57 % of the cost. A strip wider by half makes up for
// it, and frames in which three cells meet stay below three medians.
#define HW_CROSSING_TURNS 4u

typedef struct hw_crossing {
    uint32_t count; // 1 to HW_CROSSING_CELLS
    // Of level 0, in an order in which those of a group (of any level) are neighbours.
    hw_cell_id cells[HW_CROSSING_CELLS];
    float bounds[HW_CROSSING_CELLS + 1]; // the interval of cells[i] is [bounds[i], bounds[i + 1])
} hw_crossing;

// The whole scale for one cell.
hw_crossing hw_crossing_none(hw_cell_id id);
// For a viewer in or next to the cell id (of level 0). width: of the strip along each side of a
// border, in cell sizes, up to HW_CROSSING_MAX; 0: the cell id alone.
hw_crossing hw_crossing_at(const hw_hexgrid *grid, hw_cell_id id, hw_vec3 eye, double width);
// Without cells[i], of at least two: the others divide its share as they do theirs.
void hw_crossing_remove(hw_crossing *crossing, uint32_t i);

// The part of the scale in which an object dissolves.
typedef struct hw_turn {
    float start, length; // length > 0, start + length at most 1
} hw_turn;
// `turns`: into how many equal parts the scale is divided; with 1 all objects dissolve together.
hw_turn hw_object_turn(uint32_t object_idx, uint32_t turns);

// Pixels of an object: those whose number in its pattern (shaders/dissolve.glsl), from 0 to 1, lies
// in [first, end). The number on the scale is turn.start + turn.length * that one.
typedef struct hw_kept {
    float first, end; // empty: 0, 0; all: 0, 1
} hw_kept;
// Those that show what cells[first] to cells[end - 1] have in common.
hw_kept hw_crossing_kept(const hw_crossing *crossing, uint32_t first, uint32_t end, hw_turn turn);

// Shaders come in two phases; only the second (with DISSOLVE defined) leaves pixels out.
enum { HW_PHASE_WHOLE, HW_PHASE_DISSOLVING, HW_PHASES };
static inline int hw_kept_phase(hw_kept kept)
{
    return kept.first > 0 || kept.end < 1 ? HW_PHASE_DISSOLVING : HW_PHASE_WHOLE;
}
static inline bool hw_kept_none(hw_kept kept)
{
    return kept.first >= kept.end;
}
