#include "crossing.h"
#include "hierarchy.h"
#include <assert.h>
#include <math.h>

// ---- Cells and their shares

hw_crossing hw_crossing_none(hw_cell_id id)
{
    return (hw_crossing){.count = 1, .cells = {id}, .bounds = {0, 1}};
}

// Below, equal to or above 0: by their groups of the highest level, of the next, and so on.
static int compare(const hw_hexgrid *grid, hw_cell_id a, hw_cell_id b)
{
    int order = 0;
    for (int32_t l = grid->levels - 1; l >= 0 && order == 0; l--)
        order = hw_cell_compare(hw_cell_ancestor(a, l), hw_cell_ancestor(b, l));
    return order;
}

// Puts the cell in its place. shares: of the cells.
static void insert(const hw_hexgrid *grid, hw_crossing *c, double shares[HW_CROSSING_CELLS],
                   hw_cell_id id, double share)
{
    uint32_t i = c->count++;
    for (; i > 0 && compare(grid, id, c->cells[i - 1]) < 0; i--) {
        c->cells[i] = c->cells[i - 1];
        shares[i] = shares[i - 1];
    }
    c->cells[i] = id;
    shares[i] = share;
}

// shares: of any sum.
static void set_bounds(hw_crossing *c, const double shares[HW_CROSSING_CELLS])
{
    double sum = 0, below = 0;
    for (uint32_t i = 0; i < c->count; i++)
        sum += shares[i];
    for (uint32_t i = 0; i < c->count; below += shares[i++])
        c->bounds[i] = (float)(below / sum);
    c->bounds[c->count] = 1;
}

// A cell and how deep inside it the viewer is.
typedef struct place {
    hw_cell_id id;
    double depth;
} place;

// The three cells that the viewer is deepest in, of id and its neighbours, in falling order. Depth
// -INFINITY: there are not as many.
static void find_deepest(const hw_hexgrid *grid, hw_cell_id id, hw_vec3 eye,
                         place out[HW_CROSSING_CELLS])
{
    hw_cell_id around[7] = {id};
    hw_cell_neighbours(id, around + 1);
    for (int i = 0; i < HW_CROSSING_CELLS; i++)
        out[i].depth = -(double)INFINITY;
    for (int i = 0; i < 7; i++) {
        place p = {around[i], 0};
        if (!hw_hexgrid_contains(grid, p.id))
            continue;
        p.depth = hw_cell_depth(grid, p.id, (double)eye.x, (double)eye.y);
        for (int k = 0; k < HW_CROSSING_CELLS; k++) {
            if (p.depth <= out[k].depth)
                continue;
            place less = out[k];
            out[k] = p;
            p = less;
        }
    }
}

// Let p be the share that a cell beyond a border would have if it were the only one: 1/2 on the
// border, 0 at the strip's end. With p1 >= p2 of two cells they get p1 - p2 / 3 and 2 p2 / 3. That
// is steady everywhere, gives each a third where all three meet, and never changes more than 1.2
// times as fast as over a single border; shares in proportion to depths would 1.7 times.
// Beyond the grid the deepest cell is taken to begin where the viewer is.
hw_crossing hw_crossing_at(const hw_hexgrid *grid, hw_cell_id id, hw_vec3 eye, double width)
{
    place at[HW_CROSSING_CELLS];
    double strip = fmin(width, HW_CROSSING_MAX) * grid->cell_size;
    if (!(strip > 0))
        return hw_crossing_none(id);
    find_deepest(grid, id, eye, at);
    double beyond = strip - fmin(at[0].depth, 0), shares[HW_CROSSING_CELLS];
    double p1 = fmax(beyond + at[1].depth, 0) / (2 * strip);
    double p2 = fmax(beyond + at[2].depth, 0) / (2 * strip);
    const double wanted[HW_CROSSING_CELLS] = {1 - p1 - p2 / 3, p1 - p2 / 3, p2 * 2 / 3};
    hw_crossing c = {.count = 0};
    for (int i = 0; i < HW_CROSSING_CELLS; i++)
        if (wanted[i] > 0)
            insert(grid, &c, shares, at[i].id, wanted[i]);
    set_bounds(&c, shares);
    return c;
}

void hw_crossing_remove(hw_crossing *crossing, uint32_t i)
{
    assert(crossing->count > 1 && i < crossing->count);
    double shares[HW_CROSSING_CELLS];
    uint32_t count = 0;
    for (uint32_t k = 0; k < crossing->count; k++) {
        if (k == i)
            continue;
        shares[count] = (double)crossing->bounds[k + 1] - (double)crossing->bounds[k];
        crossing->cells[count++] = crossing->cells[k];
    }
    crossing->count = count;
    set_bounds(crossing, shares);
}

// ---- Objects and their turns

hw_turn hw_object_turn(uint32_t object_idx, uint32_t turns)
{
    // Objects next to each other in the scene come in turns that are far apart (Fibonacci hashing).
    uint32_t turn = (uint32_t)((uint64_t)(object_idx * 2654435769u) * turns >> 32);
    return (hw_turn){(float)turn / (float)turns, 1 / (float)turns};
}

// Where cells[i] begins in the object's pattern. Both neighbours get the same: no pixel is lost
// between them.
static float find_edge(const hw_crossing *c, uint32_t i, hw_turn turn)
{
    if (i == 0)
        return 0;
    if (i == c->count)
        return 1;
    return fminf(fmaxf((c->bounds[i] - turn.start) / turn.length, 0), 1);
}

hw_kept hw_crossing_kept(const hw_crossing *crossing, uint32_t first, uint32_t end, hw_turn turn)
{
    hw_kept kept = {find_edge(crossing, first, turn), find_edge(crossing, end, turn)};
    return kept.first < kept.end ? kept : (hw_kept){0, 0};
}
