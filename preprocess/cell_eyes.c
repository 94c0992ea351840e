#include "cell_eyes.h"
#include "alloc.h"
#include "hierarchy.h"
#include <math.h>

// Of sixteen eyes so many lie on the upper rim, on the sides, ...
#define CYCLE 16u
enum { RIM = 5, SIDES = RIM + 5, LOWER_RIM = SIDES + 3, TOP = LOWER_RIM + 2 }; // the rest: bottom

// Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018; the steps are powers of
// the root of x^7 = x + 1.
double hw_spread(uint32_t i, int k, double shift)
{
    static const double steps[6] = {0.8992177, 0.8085613, 0.7270259,
                                    0.6537417, 0.5878071, 0.5286337};
    double v = shift + (i + 1.0) * steps[k];
    return v - floor(v);
}

static hw_vec3 on_edge(const hw_vec3 corners[HW_CELL_CORNERS], double along)
{
    double w = 6 * along;
    int side = (int)fmin(w, 5);
    hw_vec3 a = corners[side], b = corners[(side + 1) % 6];
    return hw_v3_mad(a, hw_v3_sub(b, a), (float)(w - side));
}

static hw_vec3 eye_at(const hw_vec3 corners[HW_CELL_CORNERS], hw_vec3 centre, uint32_t i)
{
    if (i < HW_CELL_CORNERS)
        return corners[HW_CELL_CORNERS - 1 - i];
    i -= HW_CELL_CORNERS;
    uint32_t kind = i * 7 % CYCLE; // kinds take turns
    float low = corners[0].z, high = corners[6].z;
    hw_vec3 eye = on_edge(corners, hw_spread(i, 5, 0));
    if (kind < SIDES) {
        eye.z = kind < RIM ? high : low + (high - low) * (float)hw_spread(i, 1, 0);
    } else if (kind < LOWER_RIM) {
        eye.z = low;
    } else {
        // sqrt: as many eyes on equal areas of a triangle of the centre and an edge.
        eye = hw_v3_mad(centre, hw_v3_sub(eye, centre), (float)sqrt(hw_spread(i, 1, 0)));
        eye.z = kind < TOP ? high : low;
    }
    return eye;
}

void hw_cell_eyes(const hw_hexgrid *grid, hw_cell_id id, uint32_t count, hw_vec3 *eyes)
{
    hw_vec3 corners[HW_CELL_CORNERS], centre = hw_cell_centre(grid, id);
    hw_cell_corners(grid, id, corners);
    for (uint32_t i = 0; i < count; i++)
        eyes[i] = eye_at(corners, centre, i);
}

hw_status hw_cell_leaves(const hw_hexgrid *grid, hw_cell_id id, hw_cell_id **out, uint32_t *count)
{
    uint32_t most = 1, n = 1;
    for (int32_t l = 0; l < id.level; l++)
        most *= HW_CELL_CHILDREN;
    HW_TRY(HW_NEW(out, most));
    (*out)[0] = id;
    for (int32_t l = id.level; l > 0; l--) {
        // From the last one on, so that children never overwrite what is still to be split.
        for (uint32_t i = n; i-- > 0;)
            hw_cell_children((*out)[i], *out + (size_t)i * HW_CELL_CHILDREN);
        n *= HW_CELL_CHILDREN;
    }
    *count = 0;
    for (uint32_t i = 0; i < n; i++)
        if (hw_hexgrid_contains(grid, (*out)[i]))
            (*out)[(*count)++] = (*out)[i];
    return HW_OK;
}
