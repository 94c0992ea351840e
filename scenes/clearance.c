#include "clearance.h"
#include "alloc.h"

// Lists of nearby boxes per square of a grid: a square lists every box within reach of any of its
// points, so that a query looks at one list.
struct hw_clearance {
    double reach, eye_z;
    double origin_x, origin_y, side;
    int32_t columns, rows;
    uint32_t *start; // columns * rows + 1, into `boxes`
    hw_box *boxes;
};

#define SQUARES_MAX 65536.0
#define ENTRIES_MAX (1u << 24)

static bool within_height(const hw_clearance *c, hw_box box)
{
    return box.min.z - c->eye_z < c->reach && c->eye_z - box.max.z < c->reach;
}

typedef struct square_range {
    int32_t c0, c1, r0, r1;
} square_range;

static int32_t square_of(double offset, double side, int32_t count)
{
    double i = floor(offset / side);
    return i < 0 ? 0 : i >= count ? count - 1 : (int32_t)i;
}

static square_range squares_near(const hw_clearance *c, hw_box box)
{
    return (square_range){
        square_of(box.min.x - c->reach - c->origin_x, c->side, c->columns),
        square_of(box.max.x + c->reach - c->origin_x, c->side, c->columns),
        square_of(box.min.y - c->reach - c->origin_y, c->side, c->rows),
        square_of(box.max.y + c->reach - c->origin_y, c->side, c->rows),
    };
}

static uint64_t count_entries(const hw_clearance *c, const hw_scene *scene)
{
    uint64_t entries = 0;
    for (uint32_t i = 0; i < scene->object_count; i++) {
        if (!within_height(c, scene->objects[i].bounds))
            continue;
        square_range s = squares_near(c, scene->objects[i].bounds);
        entries += (uint64_t)(s.c1 - s.c0 + 1) * (uint64_t)(s.r1 - s.r0 + 1);
    }
    return entries;
}

static void choose_squares(hw_clearance *c, hw_box bounds, double squares)
{
    double width = (double)bounds.max.x - bounds.min.x + 2 * c->reach;
    double depth = (double)bounds.max.y - bounds.min.y + 2 * c->reach;
    c->origin_x = bounds.min.x - c->reach;
    c->origin_y = bounds.min.y - c->reach;
    c->side = fmax(c->reach, fmax(sqrt(width * depth / squares), fmax(width, depth) / squares));
    c->columns = (int32_t)(width / c->side) + 1;
    c->rows = (int32_t)(depth / c->side) + 1;
}

// Counting sort of the boxes into the squares' lists.
static void fill_lists(hw_clearance *c, const hw_scene *scene)
{
    size_t count = (size_t)c->columns * (size_t)c->rows;
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t i = 0; i < scene->object_count; i++) {
            hw_box box = scene->objects[i].bounds;
            if (!within_height(c, box))
                continue;
            square_range s = squares_near(c, box);
            for (int64_t at = 0, n = (int64_t)(s.c1 - s.c0 + 1) * (s.r1 - s.r0 + 1); at < n; at++) {
                int64_t column = s.c0 + at % (s.c1 - s.c0 + 1), row = s.r0 + at / (s.c1 - s.c0 + 1);
                size_t square = (size_t)(row * c->columns + column);
                if (pass == 0)
                    c->start[square + 1]++;
                else
                    c->boxes[c->start[square]++] = box;
            }
        }
        for (size_t s = 0; pass == 0 && s < count; s++)
            c->start[s + 1] += c->start[s];
    }
    // The second pass has moved each start to its end, which is the next one's start.
    for (size_t s = count; s > 0; s--)
        c->start[s] = c->start[s - 1];
    c->start[0] = 0;
}

hw_status hw_clearance_create(hw_clearance **out, const hw_scene *scene, double eye_z, double reach)
{
    hw_status status = HW_OK;
    hw_clearance *c = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&c, 1));
    c->reach = reach;
    c->eye_z = eye_z;
    hw_box bounds = hw_scene_bounds(scene);
    // Coarser squares where many large boxes would fill the lists.
    uint64_t entries;
    double squares = SQUARES_MAX;
    do {
        choose_squares(c, bounds, squares);
        entries = count_entries(c, scene);
        squares /= 4;
    } while (entries > ENTRIES_MAX && squares >= 1);
    if (entries > UINT32_MAX) {
        status = hw_fail(HW_LIMIT, "too many objects for a tour");
        goto out;
    }
    HW_GO(HW_NEW(&c->start, (size_t)c->columns * (size_t)c->rows + 1));
    HW_GO(HW_NEW(&c->boxes, entries));
    fill_lists(c, scene);
    *out = c;
    c = NULL;
out:
    hw_clearance_destroy(c);
    return status;
}

void hw_clearance_destroy(hw_clearance *clearance)
{
    if (!clearance)
        return;
    hw_free(clearance->start);
    hw_free(clearance->boxes);
    hw_free(clearance);
}

static double outside(double value, double min, double max)
{
    return value < min ? value - min : value > max ? value - max : 0;
}

static double box_distance(const hw_box *box, double x, double y, double z)
{
    double dx = outside(x, box->min.x, box->max.x), dy = outside(y, box->min.y, box->max.y);
    double dz = outside(z, box->min.z, box->max.z);
    return sqrt(dx * dx + dy * dy + dz * dz);
}

// Away from the box's nearest point; over, under and inside the box towards its nearest side.
static void leave(const hw_box *box, double x, double y, double away[2])
{
    double dx = outside(x, box->min.x, box->max.x), dy = outside(y, box->min.y, box->max.y);
    double length = sqrt(dx * dx + dy * dy);
    if (length > 0) {
        away[0] = dx / length;
        away[1] = dy / length;
        return;
    }
    const double sides[4] = {x - box->min.x, box->max.x - x, y - box->min.y, box->max.y - y};
    int best = 0;
    for (int i = 1; i < 4; i++)
        if (sides[i] < sides[best])
            best = i;
    away[0] = best == 0 ? -1 : best == 1 ? 1 : 0;
    away[1] = best == 2 ? -1 : best == 3 ? 1 : 0;
}

double hw_clearance_at(const hw_clearance *c, double x, double y, double away[2])
{
    if (away)
        away[0] = away[1] = 0;
    double column = floor((x - c->origin_x) / c->side), row = floor((y - c->origin_y) / c->side);
    if (!(column >= 0 && row >= 0 && column < c->columns && row < c->rows))
        return c->reach;
    size_t square = (size_t)row * (size_t)c->columns + (size_t)column;
    double least = c->reach;
    const hw_box *nearest = NULL;
    for (uint32_t i = c->start[square]; i < c->start[square + 1]; i++) {
        double d = box_distance(&c->boxes[i], x, y, c->eye_z);
        if (d < least) {
            least = d;
            nearest = &c->boxes[i];
        }
    }
    if (nearest && away)
        leave(nearest, x, y, away);
    return least;
}
