// Captures of the far rectangles of hybrid_dataset.h: where their windows are, and their texels.
#pragma once
#include "hybrid_dataset.h"

// Where the plane of the window of a view shows a point of the quad.
static UNUSED void view_point(const hw_far_view *view, hw_vec3 point, double out[2])
{
    hw_vec3 a, r, u, d = hw_v3_sub(point, view->eye);
    hw_face_basis((int)view->face, &a, &r, &u);
    out[0] = (double)hw_v3_dot(d, r) / (double)hw_v3_dot(d, a);
    out[1] = (double)hw_v3_dot(d, u) / (double)hw_v3_dot(d, a);
}

// The plane's part that shows the quad.
static UNUSED void set_window(hw_far_view *v, const far_quad *quad, hw_vec3 centre)
{
    v->x_min = v->y_min = INFINITY;
    v->x_max = v->y_max = -INFINITY;
    for (int i = 0; i < 4; i++) {
        double at[2];
        view_point(v, quad_point(quad, centre, i % 2, i / 2), at);
        v->x_min = fminf(v->x_min, (float)at[0]);
        v->x_max = fmaxf(v->x_max, (float)at[0]);
        v->y_min = fminf(v->y_min, (float)at[1]);
        v->y_max = fmaxf(v->y_max, (float)at[1]);
    }
}

// Puts an image into the atlas round a rectangle, with a border of 4 texels, block by block.
static UNUSED void put_image(hw_cell *cell, const hw_image *image, hw_rect r)
{
    uint32_t columns = image->width / 4;
    uint8_t *blocks = NULL;
    assert_ok(HW_NEW(&blocks, hw_bc1_bytes(image->width, image->height)));
    hw_bc1_encode(image, blocks);
    for (uint32_t j = 0; j < image->height / 4; j++)
        memcpy(cell->atlas_bc1 + 8 * ((size_t)((r.y - 4) / 4 + j) * (ATLAS / 4) + (r.x - 4) / 4),
               blocks + 8 * (size_t)j * columns, 8 * (size_t)columns);
    hw_free(blocks);
}
