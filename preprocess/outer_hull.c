#include "outer_hull.h"
#include "alloc.h"
#include "planar.h"
#include <math.h>
#include <string.h>

#define CORNERS_MAX   12   // where the mask leaves room for it
#define CORNER_SHARE  0.01 // of the polygon that a corner may cost
#define CORNER_PIXELS 4.0

typedef double corner[2];

static void remove_corner(corner *hull, uint32_t *count, uint32_t i)
{
    memmove(hull + i, hull + i + 1, (--*count - i) * sizeof *hull);
}

// Andrew's monotone chain over the ends of the rows: the right side upwards, then the left side
// downwards. hull has room for 4 * height corners.
static uint32_t convex_hull(const bool *mask, uint32_t width, uint32_t height, corner *hull)
{
    uint32_t count = 0;
    for (int side = 0; side < 2; side++) {
        uint32_t base = count;
        for (uint32_t i = 0; i < 2 * height; i++) { // each row of pixels has two borders
            uint32_t border = side ? 2 * height - 1 - i : i;
            const bool *row = mask + (size_t)(border / 2) * width;
            uint32_t x = 0;
            while (x < width && !row[side ? x : width - 1 - x])
                x++;
            if (x == width)
                continue;
            const corner p = {side ? x : width - x, border / 2 + border % 2};
            while (count >= base + 2 && hw_turn(hull[count - 2], hull[count - 1], p) <= 0)
                count--;
            memcpy(hull[count++], p, sizeof p);
        }
    }
    for (uint32_t i = 0; i < count && count > 3;) { // where the sides meet
        if (hw_turn(hull[(i + count - 1) % count], hull[i], hull[(i + 1) % count]) > 0) {
            i++;
        } else {
            remove_corner(hull, &count, i);
            i = 0;
        }
    }
    return count;
}

// Where the sides beside the side from corner i to the next one meet beyond it, and the area that
// the polygon gains so. False if they do not, or outside of the mask.
static bool meet_beyond(corner *hull, uint32_t count, uint32_t i, const corner limits, corner out,
                        double *area)
{
    const double *a = hull[(i + count - 1) % count], *b = hull[i], *c = hull[(i + 1) % count],
                 *d = hull[(i + 2) % count];
    const corner u = {b[0] - a[0], b[1] - a[1]}, v = {c[0] - d[0], c[1] - d[1]};
    double det = u[0] * v[1] - u[1] * v[0];
    if (fabs(det) < 1e-9)
        return false;
    double s = ((d[0] - b[0]) * v[1] - (d[1] - b[1]) * v[0]) / det;
    out[0] = b[0] + s * u[0];
    out[1] = b[1] + s * u[1];
    *area = hw_turn(b, out, c) / 2;
    return s > 0 && *area > 0 && out[0] >= 0 && out[1] >= 0 && out[0] <= limits[0] &&
           out[1] <= limits[1];
}

static uint32_t drop_corners(corner *hull, uint32_t count, const corner limits)
{
    double whole = 0;
    for (uint32_t i = 2; i < count; i++)
        whole += hw_turn(hull[0], hull[i - 1], hull[i]) / 2;
    while (count > 3) {
        uint32_t best = count;
        double area,
            least = count > CORNERS_MAX ? (double)INFINITY : CORNER_SHARE * whole + CORNER_PIXELS;
        corner p, best_p = {0, 0};
        for (uint32_t i = 0; i < count; i++)
            if (meet_beyond(hull, count, i, limits, p, &area) && area < least) {
                least = area;
                best = i;
                memcpy(best_p, p, sizeof p);
            }
        if (best == count)
            break;
        memcpy(hull[best], best_p, sizeof best_p);
        remove_corner(hull, &count, (best + 1) % count);
    }
    return count;
}

hw_status hw_outer_hull(const bool *mask, uint32_t width, uint32_t height, double (**out)[2],
                        uint32_t *corner_count)
{
    const corner limits = {width, height};
    corner *hull = NULL;
    *out = NULL;
    *corner_count = 0;
    HW_TRY(HW_NEW(&hull, 4 * (size_t)height));
    uint32_t count = convex_hull(mask, width, height, hull);
    if (count == 0) {
        hw_free(hull);
        return HW_OK;
    }
    *corner_count = drop_corners(hull, count, limits);
    *out = hull;
    return HW_OK;
}
