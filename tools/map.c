#include "map.h"
#include "alloc.h"
#include "cell_file.h"
#include <math.h>
#include <string.h>

#define MARGIN_PX 12.0
#define SAMPLES   3 // per pixel and axis
#define SQRT3     1.7320508075688772

typedef struct rgb {
    double r, g, b;
} rgb;

static const rgb background = {255, 255, 255}, border = {28, 28, 36}, unknown = {150, 150, 150},
                 dot = {255, 255, 255}, dot_rim = {0, 0, 0};

typedef struct map {
    const hw_manifest *manifest;
    double *values; // per cell of the manifest; NAN if unknown
    double least, most;
    double x_min, y_max, scale; // pixels a unit
    hw_image *image;
} map;

// Dark blue over green to yellow, ever brighter, so that it reads in grey too (points of viridis).
static rgb ramp(double t)
{
    static const rgb stops[] = {{68, 1, 84},    {65, 68, 135},  {42, 120, 142},
                                {34, 168, 132}, {122, 209, 81}, {253, 231, 37}};
    const int last = sizeof stops / sizeof *stops - 1;
    double at = fmin(fmax(t, 0), 1) * last;
    int i = (int)fmin(floor(at), last - 1);
    double f = at - i;
    return (rgb){stops[i].r + f * (stops[i + 1].r - stops[i].r),
                 stops[i].g + f * (stops[i + 1].g - stops[i].g),
                 stops[i].b + f * (stops[i + 1].b - stops[i].b)};
}

static double value_of(const char *dataset, const hw_manifest_cell *listed, const char *quantity)
{
    hw_cell cell = {0};
    char *path = NULL;
    if (!strcmp(quantity, "bytes"))
        return (double)listed->bytes;
    bool good = hw_cell_path(&path, dataset, listed->id) == HW_OK &&
                hw_cell_read_counts(path, &cell) == HW_OK;
    hw_free(path);
    if (!good)
        return NAN;
    return !strcmp(quantity, "far")    ? cell.far_count
           : !strcmp(quantity, "near") ? cell.near_count
                                       : cell.index_count / 3;
}

static hw_status gather(const char *dataset, const char *quantity, map *m, hw_map_legend *legend)
{
    uint32_t count = hw_hexgrid_cell_count(&m->manifest->grid);
    double sum = 0;
    HW_TRY(HW_NEW(&m->values, m->manifest->cell_count));
    m->least = INFINITY;
    m->most = -INFINITY;
    for (uint32_t i = 0; i < m->manifest->cell_count; i++) {
        const hw_manifest_cell *cell = &m->manifest->cells[i];
        if (cell->id.level > 0) // the map shows the finest
            continue;
        double value = value_of(dataset, cell, quantity);
        m->values[i] = value;
        if (isnan(value))
            continue;
        legend->cells++;
        sum += value;
        m->least = fmin(m->least, value);
        m->most = fmax(m->most, value);
    }
    if (legend->cells == 0)
        return hw_fail(HW_NOT_FOUND, "%s: no cell can be read", dataset);
    legend->missing = count - legend->cells;
    legend->mean = sum / legend->cells;
    legend->least = m->least;
    legend->most = m->most;
    return HW_OK;
}

static hw_status lay_out(map *m, uint32_t side)
{
    const hw_hexgrid *g = &m->manifest->grid;
    double c = g->cell_size, x_min = g->origin_x - c,
           x_max = g->origin_x + (1.5 * g->columns - 0.5) * c;
    double y_min = g->origin_y - SQRT3 / 2 * c, y_max = g->origin_y + SQRT3 * g->rows * c;
    if (g->columns == 1)
        y_max -= SQRT3 / 2 * c; // no shifted column
    double width = x_max - x_min, depth = y_max - y_min;
    m->scale = (side - 2 * MARGIN_PX) / fmax(width, depth);
    m->x_min = x_min - MARGIN_PX / m->scale;
    m->y_max = y_max + MARGIN_PX / m->scale;
    return hw_image_make(m->image, (uint32_t)ceil(width * m->scale + 2 * MARGIN_PX),
                         (uint32_t)ceil(depth * m->scale + 2 * MARGIN_PX), 3);
}

// 0 in a hexagon's centre, 1 on its border.
static double hexagon_norm(double x, double y, double size)
{
    x = fabs(x) / size;
    y = fabs(y) / size;
    return fmax(y, y / 2 + x * SQRT3 / 2) / (SQRT3 / 2);
}

static rgb color_at(const map *m, double x, double y)
{
    const hw_hexgrid *g = &m->manifest->grid;
    hw_cell_id id = hw_hexgrid_locate(g, x, y); // outside the grid: the nearest
    hw_vec3 centre = hw_cell_centre(g, id);
    double norm = hexagon_norm(x - (double)centre.x, y - (double)centre.y, g->cell_size);
    if (norm > 1)
        return background;
    if ((1 - norm) * g->cell_size * m->scale < 0.6)
        return border;
    uint32_t index;
    double value = hw_manifest_find_cell(m->manifest, id, &index) ? m->values[index] : (double)NAN;
    return isnan(value) ? unknown : ramp((value - m->least) / fmax(m->most - m->least, 1e-300));
}

static void set_pixel(hw_image *image, uint32_t x, uint32_t y, rgb c)
{
    uint8_t *p = image->data + ((size_t)y * image->width + x) * 3;
    p[0] = (uint8_t)lround(c.r);
    p[1] = (uint8_t)lround(c.g);
    p[2] = (uint8_t)lround(c.b);
}

static void draw_cells(const map *m)
{
    for (uint32_t y = 0; y < m->image->height; y++)
        for (uint32_t x = 0; x < m->image->width; x++) {
            rgb sum = {0, 0, 0};
            for (int s = 0; s < SAMPLES * SAMPLES; s++) {
                double px = x + (s % SAMPLES + 0.5) / SAMPLES,
                       py = y + (s / SAMPLES + 0.5) / SAMPLES;
                rgb c = color_at(m, m->x_min + px / m->scale, m->y_max - py / m->scale);
                sum.r += c.r;
                sum.g += c.g;
                sum.b += c.b;
            }
            const double n = SAMPLES * SAMPLES;
            set_pixel(m->image, x, y, (rgb){sum.r / n, sum.g / n, sum.b / n});
        }
}

static void draw_dot(const map *m, double x, double y, double radius)
{
    double reach = radius + 1;
    if (!(x > -reach && y > -reach && x < m->image->width + reach && y < m->image->height + reach))
        return; // too far out for an int, perhaps
    for (int j = (int)floor(y - reach); j <= (int)ceil(y + reach); j++)
        for (int i = (int)floor(x - reach); i <= (int)ceil(x + reach); i++) {
            double distance = hypot(i + 0.5 - x, j + 0.5 - y);
            if (i < 0 || j < 0 || i >= (int)m->image->width || j >= (int)m->image->height ||
                distance > reach)
                continue;
            set_pixel(m->image, (uint32_t)i, (uint32_t)j, distance <= radius ? dot : dot_rim);
        }
}

static void draw_objects(const map *m)
{
    // Small enough that cells still show between them.
    double radius = fmin(fmax(m->manifest->grid.cell_size * m->scale / 12, 0.7), 2.5);
    for (uint32_t i = 0; i < m->manifest->object_count; i++) {
        hw_vec3 centre = hw_box_centre(m->manifest->objects[i].bounds);
        draw_dot(m, ((double)centre.x - m->x_min) * m->scale,
                 (m->y_max - (double)centre.y) * m->scale, radius);
    }
}

hw_status hw_map_draw(const char *dataset, const hw_manifest *manifest, const char *quantity,
                      uint32_t side, hw_image *out, hw_map_legend *legend)
{
    hw_status status = HW_OK;
    map m = {.manifest = manifest, .image = out};
    *out = (hw_image){0};
    *legend = (hw_map_legend){0};
    HW_GO(gather(dataset, quantity, &m, legend));
    HW_GO(lay_out(&m, side));
    draw_cells(&m);
    draw_objects(&m);
out:
    hw_free(m.values);
    return status;
}
