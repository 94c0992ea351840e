#include "hierarchy.h"
#include "alloc.h"
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#define SQRT_3      1.7320508075688772
#define HALF_SQRT_3 0.8660254037844386

// a + b w with w = e^(i 60 degrees), w^2 = w - 1.
typedef struct eisenstein {
    int64_t a, b;
} eisenstein;

static eisenstein times(eisenstein x, eisenstein y)
{
    return (eisenstein){x.a * y.a - x.b * y.b, x.a * y.b + x.b * y.a + x.b * y.b};
}

static int64_t norm(eisenstein x)
{
    return x.a * x.a + x.a * x.b + x.b * x.b;
}

// What takes the lattice of level l + 1 to that of level l.
static eisenstein factor(int32_t level)
{
    return level % 2 == 0 ? (eisenstein){2, 1} : (eisenstein){3, -1};
}

static eisenstein conjugate(eisenstein x)
{
    return (eisenstein){x.a + x.b, -x.b};
}

// 1, w, w^2, ...
static const eisenstein units[6] = {{1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}};

// Odd columns of level 0 stand half a row higher; above, ids are axial already.
static eisenstein axial(hw_cell_id id)
{
    if (id.level > 0)
        return (eisenstein){id.q, id.r};
    return (eisenstein){id.q, id.r - (id.q - (id.q & 1)) / 2};
}

static hw_cell_id cell_at(int32_t level, eisenstein z)
{
    int32_t q = (int32_t)z.a, r = (int32_t)z.b;
    return (hw_cell_id){level, q, level > 0 ? r : r + (q - (q & 1)) / 2};
}

static int64_t divide_down(int64_t x, int64_t y)
{
    return x / y - (x % y != 0 && (x < 0) != (y < 0));
}

hw_cell_id hw_cell_parent(hw_cell_id id)
{
    // The quotient's neighbourhood holds the one multiple whose rest is 0 or a unit: those seven
    // rests are all there are modulo a number of norm 7.
    eisenstein z = axial(id), f = factor(id.level), product = times(z, conjugate(f));
    eisenstein low = {divide_down(product.a, 7), divide_down(product.b, 7)};
    for (int64_t i = 0; i <= 1; i++)
        for (int64_t k = 0; k <= 1; k++) {
            eisenstein parent = {low.a + i, low.b + k}, multiple = times(parent, f);
            if (norm((eisenstein){z.a - multiple.a, z.b - multiple.b}) <= 1)
                return cell_at(id.level + 1, parent);
        }
    assert(!"every cell has a parent");
    return cell_at(id.level + 1, low);
}

void hw_cell_children(hw_cell_id id, hw_cell_id out[HW_CELL_CHILDREN])
{
    assert(id.level > 0);
    eisenstein middle = times(axial(id), factor(id.level - 1));
    out[0] = cell_at(id.level - 1, middle);
    for (int i = 0; i < 6; i++)
        out[i + 1] =
            cell_at(id.level - 1, (eisenstein){middle.a + units[i].a, middle.b + units[i].b});
}

hw_cell_id hw_cell_middle_child(hw_cell_id id)
{
    assert(id.level > 0);
    return cell_at(id.level - 1, times(axial(id), factor(id.level - 1)));
}

hw_cell_id hw_cell_ancestor(hw_cell_id id, int32_t level)
{
    while (id.level < level)
        id = hw_cell_parent(id);
    return id;
}

// How far the group reaches from its centre along a horizontal direction, in sides of level 0.
static double reach(int32_t level, double x, double y)
{
    double most = 0;
    if (level == 0) {
        for (int i = 0; i < 6; i++)
            most = fmax(most, cos(i * HW_PI / 3) * x + sin(i * HW_PI / 3) * y);
        return most;
    }
    for (int i = 0; i < 6; i++) {
        eisenstein z = units[i];
        for (int32_t l = level - 1; l > 0; l--)
            z = times(z, factor(l - 1));
        double east = 1.5 * (double)z.a, north = SQRT_3 * ((double)z.b + 0.5 * (double)z.a);
        most = fmax(most, east * x + north * y);
    }
    return most + reach(level - 1, x, y);
}

double hw_cell_side(const hw_hexgrid *grid, int32_t level)
{
    assert(level >= 0 && level < HW_CELL_LEVELS_MAX);
    double most = 0;
    for (int i = 0; i < 6 && level > 0; i++) {
        double angle = (i + 0.5) * HW_PI / 3; // of the upright hexagon's faces
        most = fmax(most, reach(level, cos(angle), sin(angle)));
    }
    return level == 0 ? grid->cell_size : grid->cell_size * most / HALF_SQRT_3;
}

static int by_id(const void *x, const void *y)
{
    return hw_cell_compare(*(const hw_cell_id *)x, *(const hw_cell_id *)y);
}

// The parents of `count` cells, each once, in order. Returns how many.
static uint32_t parents_of(const hw_cell_id *cells, uint32_t count, hw_cell_id *out)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; i++)
        out[i] = hw_cell_parent(cells[i]);
    qsort(out, count, sizeof *out, by_id);
    for (uint32_t i = 0; i < count; i++)
        if (n == 0 || by_id(&out[n - 1], &out[i]) != 0)
            out[n++] = out[i];
    return n;
}

hw_status hw_hierarchy_cells(const hw_hexgrid *grid, hw_cell_id **out, uint32_t *count)
{
    uint32_t level_count = hw_hexgrid_cell_count(grid), first = 0;
    size_t room = (size_t)level_count * (size_t)grid->levels;
    HW_TRY(HW_NEW(out, room));
    *count = level_count;
    for (uint32_t i = 0; i < level_count; i++)
        (*out)[i] = hw_hexgrid_cell(grid, i);
    for (int32_t l = 1; l < grid->levels; l++) {
        uint32_t above = parents_of(*out + first, level_count, *out + *count);
        first = *count;
        *count += above;
        level_count = above;
    }
    return HW_OK;
}

uint32_t hw_hierarchy_find(const hw_cell_id *cells, uint32_t count, hw_cell_id id)
{
    const hw_cell_id *found = bsearch(&id, cells, count, sizeof *cells, by_id);
    return found ? (uint32_t)(found - cells) : count;
}
