#include "region.h"
#include "hexgrid_internal.h"
#include <assert.h>

#define SQRT_3 1.7320508075688772
// The mean over a hexagon is taken at the centroids of 6 * SPLIT^2 triangles of equal area.
#define SPLIT 3

static double gap(double a_min, double a_max, double b_min, double b_max)
{
    return fmax(fmax(a_min - b_max, b_min - a_max), 0);
}

// Distance from a point to the rectangle [x0, x1] x [y0, y1].
static double point_to_rect(double x, double y, hw_box box)
{
    return hypot(gap(x, x, box.min.x, box.max.x), gap(y, y, box.min.y, box.max.y));
}

static double point_to_segment(const double p[2], const double a[2], const double b[2])
{
    double ux = b[0] - a[0], uy = b[1] - a[1];
    double t = ((p[0] - a[0]) * ux + (p[1] - a[1]) * uy) / (ux * ux + uy * uy);
    t = fmin(fmax(t, 0), 1);
    return hypot(p[0] - a[0] - t * ux, p[1] - a[1] - t * uy);
}

// Separating-axis test of the hexagon and the rectangle: the axes are x, y and the normals of the
// hexagon's sides. Exact for convex polygons; touching counts as meeting.
static bool hexagon_meets_rect(const double outline[6][2], hw_box box)
{
    static const double axes[4][2] = {{1, 0}, {0, 1}, {0.5 * SQRT_3, 0.5}, {-0.5 * SQRT_3, 0.5}};
    for (int k = 0; k < 4; k++) {
        double hex_min = INFINITY, hex_max = -INFINITY, rect_min = INFINITY, rect_max = -INFINITY;
        for (int i = 0; i < 6; i++) {
            double t = outline[i][0] * axes[k][0] + outline[i][1] * axes[k][1];
            hex_min = fmin(hex_min, t);
            hex_max = fmax(hex_max, t);
        }
        for (uint32_t i = 0; i < 4; i++) {
            hw_vec3 corner = hw_box_corner(box, i);
            double t = corner.x * axes[k][0] + corner.y * axes[k][1];
            rect_min = fmin(rect_min, t);
            rect_max = fmax(rect_max, t);
        }
        if (gap(hex_min, hex_max, rect_min, rect_max) > 0)
            return false;
    }
    return true;
}

// Convex polygons that do not meet are nearest to each other at a corner of one of them.
static double hexagon_to_rect(const double outline[6][2], hw_box box)
{
    if (hexagon_meets_rect(outline, box))
        return 0;
    double best = INFINITY;
    for (int i = 0; i < 6; i++)
        best = fmin(best, point_to_rect(outline[i][0], outline[i][1], box));
    for (uint32_t k = 0; k < 4; k++) {
        hw_vec3 corner = hw_box_corner(box, k);
        const double p[2] = {corner.x, corner.y};
        for (int i = 0; i < 6; i++)
            best = fmin(best, point_to_segment(p, outline[i], outline[(i + 1) % 6]));
    }
    return best;
}

// The sum of 1 / max(d, nearest)^2 over the centroids of one of the hexagon's six triangles
// (centre, a, b), split into SPLIT^2 equal ones.
static double sum_over_sector(const double centre[2], const double a[2], const double b[2],
                              const double target[3], double nearest)
{
    double sum = 0;
    // Small triangle (i, j) stands on lattice points i, j; `flip` picks the one that fills the
    // rhombus. Centroids lie at +1/3 and +2/3 of both steps.
    for (int i = 0; i < SPLIT; i++) {
        for (int j = 0; j < 2 * (SPLIT - i) - 1; j++) {
            int flip = j & 1;
            double s = (i + (flip ? 2.0 : 1.0) / 3) / SPLIT;
            double t = ((double)(j / 2) + (flip ? 2.0 : 1.0) / 3) / SPLIT;
            double x = centre[0] + s * (a[0] - centre[0]) + t * (b[0] - centre[0]);
            double y = centre[1] + s * (a[1] - centre[1]) + t * (b[1] - centre[1]);
            double d = fmax(hypot(hypot(x - target[0], y - target[1]), target[2]), nearest);
            sum += 1 / (d * d);
        }
    }
    return sum;
}

static double effective_distance(const double outline[6][2], const double centre[3], hw_box box,
                                 double nearest)
{
    hw_vec3 middle = hw_box_centre(box);
    const double target[3] = {middle.x, middle.y, middle.z - centre[2]};
    double sum = 0;
    for (int i = 0; i < 6; i++)
        sum += sum_over_sector(centre, outline[i], outline[(i + 1) % 6], target, nearest);
    // Never below `nearest` by rounding either; a sample on the target itself gives 0.
    return fmax(sqrt(6.0 * SPLIT * SPLIT / sum), nearest);
}

// Prism and box are both products of a polygon in x-y and an interval in z, so that the least
// distance is made of the least distances of the factors.
static double nearest_distance(const hw_hexgrid *grid, const double outline[6][2], hw_box box)
{
    return hypot(hexagon_to_rect(outline, box),
                 gap(grid->z_min, grid->z_max, box.min.z, box.max.z));
}

double hw_region_nearest(const hw_hexgrid *grid, hw_cell_id id, hw_box box)
{
    double outline[6][2];
    hw_cell_outline(grid, id, outline);
    return nearest_distance(grid, (const double(*)[2])outline, box);
}

hw_region_distance hw_region_distance_to(const hw_hexgrid *grid, hw_cell_id id, hw_box box)
{
    assert(!hw_box_is_empty(box));
    double outline[6][2];
    double centre[3] = {0, 0, 0.5 * (grid->z_min + grid->z_max)};
    hw_cell_outline(grid, id, outline);
    hw_cell_centre_2d(grid, id, centre);
    hw_region_distance out = {0};
    out.nearest = nearest_distance(grid, (const double(*)[2])outline, box);

    // The distance to a convex set is a convex function: over the prism it is largest at a corner.
    for (int i = 0; i < HW_CELL_CORNERS; i++) {
        double z = i < 6 ? grid->z_min : grid->z_max;
        double d = hypot(point_to_rect(outline[i % 6][0], outline[i % 6][1], box),
                         gap(z, z, box.min.z, box.max.z));
        out.farthest = fmax(out.farthest, d);
    }
    out.centre = hypot(point_to_rect(centre[0], centre[1], box),
                       gap(centre[2], centre[2], box.min.z, box.max.z));
    out.effective = effective_distance((const double(*)[2])outline, centre, box, out.nearest);
    return out;
}

bool hw_cell_meets_box(const hw_hexgrid *grid, hw_cell_id id, hw_box box)
{
    double outline[6][2];
    hw_cell_outline(grid, id, outline);
    return gap(grid->z_min, grid->z_max, box.min.z, box.max.z) == 0 &&
           hexagon_meets_rect((const double(*)[2])outline, box);
}

hw_facing hw_triangle_facing(hw_vec3 a, hw_vec3 b, hw_vec3 c, const hw_vec3 *corners,
                             uint32_t corner_count)
{
    // Side of the triangle's plane by a 3 x 3 determinant in double precision, with a forward error
    // bound from the sum of its products' magnitudes (as in Shewchuk 1997, orient3d's filter): what
    // rounding could have decided counts as mixed.
    const double bound = 16 * 0x1p-53;
    double ux = (double)b.x - a.x, uy = (double)b.y - a.y, uz = (double)b.z - a.z;
    double vx = (double)c.x - a.x, vy = (double)c.y - a.y, vz = (double)c.z - a.z;
    double nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    double mx = fabs(uy * vz) + fabs(uz * vy);
    double my = fabs(uz * vx) + fabs(ux * vz);
    double mz = fabs(ux * vy) + fabs(uy * vx);
    uint32_t front = 0, back = 0;
    for (uint32_t i = 0; i < corner_count; i++) {
        double dx = (double)corners[i].x - a.x;
        double dy = (double)corners[i].y - a.y;
        double dz = (double)corners[i].z - a.z;
        double side = nx * dx + ny * dy + nz * dz;
        double error = bound * (mx * fabs(dx) + my * fabs(dy) + mz * fabs(dz));
        front += side > error;
        back += side < -error;
        if ((front && back) || front + back <= i)
            return HW_FACING_MIXED;
    }
    if (front == 0 && back == 0)
        return HW_FACING_MIXED;
    return front ? HW_FACING_FRONT : HW_FACING_BACK;
}

double hw_self_occluding_error(double cell_size, double distance, double depth, double image_res)
{
    if (!(distance > 0))
        return INFINITY;
    return SQRT_3 * cell_size * depth / (2 * distance * (distance + depth)) * image_res;
}
