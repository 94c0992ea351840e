#include "clearance.h"
#include "alloc.h"
#include "box_grid.h"

struct hw_clearance {
    double reach, eye_z;
    hw_box *boxes; // of the objects that reach the eye's height
    hw_box_grid *grid;
};

static bool within_height(const hw_clearance *c, hw_box box)
{
    return box.min.z - c->eye_z < c->reach && c->eye_z - box.max.z < c->reach;
}

hw_status hw_clearance_create(hw_clearance **out, const hw_scene *scene, double eye_z, double reach)
{
    hw_status status = HW_OK;
    hw_clearance *c = NULL;
    uint32_t count = 0;
    *out = NULL;
    HW_GO(HW_NEW(&c, 1));
    c->reach = reach;
    c->eye_z = eye_z;
    HW_GO(HW_NEW(&c->boxes, scene->object_count));
    for (uint32_t i = 0; i < scene->object_count; i++)
        if (within_height(c, scene->objects[i].bounds))
            c->boxes[count++] = scene->objects[i].bounds;
    HW_GO(hw_box_grid_create(&c->grid, c->boxes, count, hw_scene_bounds(scene), reach));
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
    hw_box_grid_destroy(clearance->grid);
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
    const uint32_t *near;
    uint32_t count = hw_box_grid_at(c->grid, x, y, &near);
    double least = c->reach;
    const hw_box *nearest = NULL;
    for (uint32_t i = 0; i < count; i++) {
        double d = box_distance(&c->boxes[near[i]], x, y, c->eye_z);
        if (d < least) {
            least = d;
            nearest = &c->boxes[near[i]];
        }
    }
    if (nearest && away)
        leave(nearest, x, y, away);
    return least;
}
