#include "minimap.h"
#include "hierarchy.h"
#include <math.h>
#include <string.h>

#define CELLS_ACROSS 9.0 // cell diameters in the square
#define CELLS_AROUND 8   // columns and rows looked at, either way
#define BOXES_MAX    1500u

static const uint8_t panel_color[4] = {16, 20, 28, 190};
static const uint8_t box_color[4] = {150, 150, 140, 255};
static const uint8_t cell_color[4] = {110, 150, 190, 150};
static const uint8_t group_colors[2][4] = {{255, 214, 130, 230}, {255, 140, 90, 255}};
static const uint8_t here_color[4] = {80, 140, 220, 110};
static const uint8_t view_color[4] = {255, 255, 255, 70};
static const uint8_t frozen_color[4] = {255, 120, 120, 90};
static const uint8_t viewer_color[4] = {255, 255, 255, 255};

// Where the map is in the window.
typedef struct frame {
    hw_hud *hud;
    float x, y, side;
    double scale;     // pixels per unit
    double centre[2]; // the world's point in the middle
} frame;

typedef struct point {
    float x, y;
} point;

static point to_window(const frame *f, double x, double y)
{
    return (point){(float)(f->x + f->side / 2 + (x - f->centre[0]) * f->scale),
                   (float)(f->y + f->side / 2 - (y - f->centre[1]) * f->scale)};
}

// ---- Clipped shapes

// Keeps the part of a convex polygon where s * coordinate <= s * limit (Sutherland-Hodgman); out
// holds count + 1 points.
static int clip_side(const point *in, int count, int axis, float s, float limit, point *out)
{
    int n = 0;
    for (int i = 0; i < count; i++) {
        point a = in[i], b = in[(i + 1) % count];
        float da = s * ((axis ? a.y : a.x) - limit), db = s * ((axis ? b.y : b.x) - limit);
        if (da <= 0)
            out[n++] = a;
        if ((da < 0 && db > 0) || (da > 0 && db < 0)) {
            float t = da / (da - db);
            out[n++] = (point){a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)};
        }
    }
    return n;
}

// A convex polygon of at most 6 corners, cut to the square.
static void fill(const frame *f, const point *corners, int count, const uint8_t color[4])
{
    point a[12], b[12];
    memcpy(a, corners, (size_t)count * sizeof *a);
    count = clip_side(a, count, 0, 1, f->x + f->side, b);
    count = clip_side(b, count, 0, -1, f->x, a);
    count = clip_side(a, count, 1, 1, f->y + f->side, b);
    count = clip_side(b, count, 1, -1, f->y, a);
    for (int i = 1; i + 1 < count; i += 2) {
        const point last = a[i + 2 < count ? i + 2 : i + 1];
        const float quad[4][2] = {
            {a[0].x, a[0].y}, {a[i].x, a[i].y}, {a[i + 1].x, a[i + 1].y}, {last.x, last.y}};
        hw_hud_add_quad(f->hud, quad, color);
    }
}

static void line(const frame *f, point a, point b, float width, const uint8_t color[4])
{
    float dx = b.x - a.x, dy = b.y - a.y, length = hypotf(dx, dy);
    if (!(length > 0))
        return;
    float nx = -dy / length * width / 2, ny = dx / length * width / 2;
    const point corners[4] = {
        {a.x + nx, a.y + ny}, {b.x + nx, b.y + ny}, {b.x - nx, b.y - ny}, {a.x - nx, a.y - ny}};
    fill(f, corners, 4, color);
}

// ---- What is on the map

static void cell_outline(const frame *f, const hw_hexgrid *grid, hw_cell_id id, point out[6])
{
    hw_vec3 corners[HW_CELL_CORNERS];
    hw_cell_corners(grid, id, corners);
    for (int i = 0; i < 6; i++)
        out[i] = to_window(f, corners[i].x, corners[i].y);
}

// The highest level at which the neighbours belong to different groups; 0: only the cells differ.
static int32_t border_level(const hw_hexgrid *grid, hw_cell_id a, hw_cell_id b)
{
    int32_t level = 0;
    for (int32_t l = 1; l < grid->levels; l++) {
        a = hw_cell_parent(a);
        b = hw_cell_parent(b);
        if (a.q != b.q || a.r != b.r)
            level = l;
    }
    return level;
}

// Each border once: from the cell of the lower index, or from the one inside the grid.
static void draw_borders(const frame *f, const hw_hexgrid *grid, hw_cell_id id)
{
    point corners[6];
    hw_cell_id around[6];
    cell_outline(f, grid, id, corners);
    hw_cell_neighbours(id, around);
    for (int i = 0; i < 6; i++) {
        bool inside = hw_hexgrid_contains(grid, around[i]);
        if (inside && hw_hexgrid_index(grid, around[i]) < hw_hexgrid_index(grid, id))
            continue;
        int32_t level = inside ? border_level(grid, id, around[i]) : 1;
        const uint8_t *color = level == 0 ? cell_color : group_colors[level > 1];
        line(f, corners[i], corners[(i + 1) % 6], level == 0 ? 1 : 2, color);
    }
}

static void draw_cells(const frame *f, const hw_hexgrid *grid, hw_cell_id here)
{
    for (int32_t q = here.q - CELLS_AROUND; q <= here.q + CELLS_AROUND; q++)
        for (int32_t r = here.r - CELLS_AROUND; r <= here.r + CELLS_AROUND; r++) {
            hw_cell_id id = {0, q, r};
            if (hw_hexgrid_contains(grid, id))
                draw_borders(f, grid, id);
        }
}

static void draw_boxes(const frame *f, const hw_minimap *map)
{
    double reach = f->side / 2 / f->scale;
    uint32_t drawn = 0;
    for (uint32_t i = 0; i < map->box_count && drawn < BOXES_MAX; i++) {
        hw_box b = map->boxes[i];
        if (b.max.x < f->centre[0] - reach || b.min.x > f->centre[0] + reach ||
            b.max.y < f->centre[1] - reach || b.min.y > f->centre[1] + reach)
            continue;
        point low = to_window(f, b.min.x, b.min.y), high = to_window(f, b.max.x, b.max.y);
        const point corners[4] = {low, {high.x, low.y}, high, {low.x, high.y}};
        fill(f, corners, 4, box_color);
        drawn++;
    }
}

// The wedge that a camera sees of the horizon, and the eye.
static void draw_viewer(const frame *f, const hw_camera *camera, const uint8_t color[4])
{
    double heading = atan2(camera->forward.y, camera->forward.x);
    double aspect = (double)camera->width / camera->height;
    double half = atan(tan(camera->fov_degrees * HW_PI / 360) * aspect);
    double reach = f->side / f->scale / 3 / fmax(cos(half), 0.3);
    const double x = camera->eye.x, y = camera->eye.y;
    const point wedge[3] = {
        to_window(f, x, y),
        to_window(f, x + reach * cos(heading - half), y + reach * sin(heading - half)),
        to_window(f, x + reach * cos(heading + half), y + reach * sin(heading + half))};
    fill(f, wedge, 3, color);
    const float r = fmaxf(f->side / 60, 2);
    const point eye[4] = {{wedge[0].x - r, wedge[0].y},
                          {wedge[0].x, wedge[0].y - r},
                          {wedge[0].x + r, wedge[0].y},
                          {wedge[0].x, wedge[0].y + r}};
    fill(f, eye, 4, viewer_color);
}

void hw_minimap_draw(hw_hud *hud, const hw_minimap *map, float x, float y, float side)
{
    const hw_hexgrid *grid = map->grid;
    frame f = {.hud = hud,
               .x = x,
               .y = y,
               .side = side,
               .scale = side / (CELLS_ACROSS * 1.75 * grid->cell_size),
               .centre = {map->camera->eye.x, map->camera->eye.y}};
    const point square[4] = {{x, y}, {x + side, y}, {x + side, y + side}, {x, y + side}};
    fill(&f, square, 4, panel_color);
    draw_boxes(&f, map);
    hw_cell_id here = hw_hexgrid_locate(grid, f.centre[0], f.centre[1]);
    const hw_camera *source = map->frozen ? map->frozen : map->camera;
    point corners[6];
    cell_outline(&f, grid, hw_hexgrid_locate(grid, source->eye.x, source->eye.y), corners);
    fill(&f, corners, 6, here_color);
    draw_cells(&f, grid, here);
    if (map->frozen)
        draw_viewer(&f, map->frozen, frozen_color);
    draw_viewer(&f, map->camera, view_color);
}
