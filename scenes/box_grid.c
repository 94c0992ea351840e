#include "box_grid.h"
#include "alloc.h"

struct hw_box_grid {
    double reach;
    double origin_x, origin_y, side;
    int32_t columns, rows;
    uint32_t *start; // columns * rows + 1, into `indices`
    uint32_t *indices;
};

#define SQUARES_MAX 65536.0
#define ENTRIES_MAX (1u << 24)

typedef struct square_range {
    int32_t c0, c1, r0, r1;
} square_range;

static int32_t square_of(double offset, double side, int32_t count)
{
    double i = floor(offset / side);
    return i < 0 ? 0 : i >= count ? count - 1 : (int32_t)i;
}

static square_range squares_near(const hw_box_grid *g, hw_box box)
{
    return (square_range){
        square_of(box.min.x - g->reach - g->origin_x, g->side, g->columns),
        square_of(box.max.x + g->reach - g->origin_x, g->side, g->columns),
        square_of(box.min.y - g->reach - g->origin_y, g->side, g->rows),
        square_of(box.max.y + g->reach - g->origin_y, g->side, g->rows),
    };
}

static uint64_t count_entries(const hw_box_grid *g, const hw_box *boxes, uint32_t count)
{
    uint64_t entries = 0;
    for (uint32_t i = 0; i < count; i++) {
        square_range s = squares_near(g, boxes[i]);
        entries += (uint64_t)(s.c1 - s.c0 + 1) * (uint64_t)(s.r1 - s.r0 + 1);
    }
    return entries;
}

static void choose_squares(hw_box_grid *g, hw_box bounds, double squares)
{
    if (hw_box_is_empty(bounds))
        bounds = (hw_box){0};
    double width = (double)bounds.max.x - bounds.min.x + 2 * g->reach;
    double depth = (double)bounds.max.y - bounds.min.y + 2 * g->reach;
    g->origin_x = bounds.min.x - g->reach;
    g->origin_y = bounds.min.y - g->reach;
    g->side = fmax(g->reach, fmax(sqrt(width * depth / squares), fmax(width, depth) / squares));
    g->columns = (int32_t)(width / g->side) + 1;
    g->rows = (int32_t)(depth / g->side) + 1;
}

// Counting sort of the boxes into the squares' lists.
static void fill_lists(hw_box_grid *g, const hw_box *boxes, uint32_t count)
{
    size_t squares = (size_t)g->columns * (size_t)g->rows;
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t i = 0; i < count; i++) {
            square_range s = squares_near(g, boxes[i]);
            for (int64_t at = 0, n = (int64_t)(s.c1 - s.c0 + 1) * (s.r1 - s.r0 + 1); at < n; at++) {
                int64_t column = s.c0 + at % (s.c1 - s.c0 + 1), row = s.r0 + at / (s.c1 - s.c0 + 1);
                size_t square = (size_t)(row * g->columns + column);
                if (pass == 0)
                    g->start[square + 1]++;
                else
                    g->indices[g->start[square]++] = i;
            }
        }
        for (size_t s = 0; pass == 0 && s < squares; s++)
            g->start[s + 1] += g->start[s];
    }
    // The second pass has moved each start to its end, which is the next one's start.
    for (size_t s = squares; s > 0; s--)
        g->start[s] = g->start[s - 1];
    g->start[0] = 0;
}

hw_status hw_box_grid_create(hw_box_grid **out, const hw_box *boxes, uint32_t count, hw_box bounds,
                             double reach)
{
    hw_status status = HW_OK;
    hw_box_grid *g = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&g, 1));
    g->reach = reach;
    // Coarser squares where many large boxes would fill the lists.
    uint64_t entries;
    double squares = SQUARES_MAX;
    do {
        choose_squares(g, bounds, squares);
        entries = count_entries(g, boxes, count);
        squares /= 4;
    } while (entries > ENTRIES_MAX && squares >= 1);
    if (entries > UINT32_MAX) {
        status = hw_fail(HW_LIMIT, "too many objects: %u", count);
        goto out;
    }
    HW_GO(HW_NEW(&g->start, (size_t)g->columns * (size_t)g->rows + 1));
    HW_GO(HW_NEW(&g->indices, entries));
    fill_lists(g, boxes, count);
    *out = g;
    g = NULL;
out:
    hw_box_grid_destroy(g);
    return status;
}

void hw_box_grid_destroy(hw_box_grid *grid)
{
    if (!grid)
        return;
    hw_free(grid->start);
    hw_free(grid->indices);
    hw_free(grid);
}

uint32_t hw_box_grid_at(const hw_box_grid *g, double x, double y, const uint32_t **indices)
{
    double column = floor((x - g->origin_x) / g->side), row = floor((y - g->origin_y) / g->side);
    *indices = g->indices;
    if (!(column >= 0 && row >= 0 && column < g->columns && row < g->rows))
        return 0;
    size_t square = (size_t)row * (size_t)g->columns + (size_t)column;
    *indices = g->indices + g->start[square];
    return g->start[square + 1] - g->start[square];
}
