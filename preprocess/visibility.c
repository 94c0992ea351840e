#include "visibility.h"
#include "alloc.h"

#define BLOCK      8u // rays are cast in blocks of 8 x 8 pixels that a wanted object's box touches
#define PASSES_MAX 64 // back faces that a ray passes

typedef struct picture {
    const hw_scene *scene;
    const hw_rays *rays;
    const hw_camera *camera;
    hw_vec3 forward, right, up; // unit length; right and up scaled to one pixel at distance 1
    hw_mat4 clip;
    uint32_t columns, rows; // of blocks
    bool *wanted;           // per block
} picture;

// The first front face along a ray.
static hw_hit first_front(const picture *p, hw_vec3 direction, hw_hit hit)
{
    for (int i = 0;
         i < PASSES_MAX && hit.t < INFINITY && !hw_hit_is_front(p->scene, &hit, direction); i++)
        hit = hw_rays_cast(p->rays, p->camera->eye, direction, hit.t + 1e-4f + 1e-5f * hit.t,
                           INFINITY);
    return hit;
}

static void want_all(picture *p)
{
    for (uint32_t i = 0; i < p->columns * p->rows; i++)
        p->wanted[i] = true;
}

// Marks the blocks that the projection of a box covers.
static void want_box(picture *p, hw_box box)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    const double size[2] = {p->camera->width, p->camera->height};
    uint32_t before = 0;
    for (uint32_t i = 0; i < 8; i++) {
        hw_vec3 c = hw_box_corner(box, i);
        const double *m = p->clip.m;
        double w = m[3] * c.x + m[7] * c.y + m[11] * c.z + m[15];
        before += w > 0.01;
        for (int k = 0; k < 2; k++) {
            double v = (m[k] * c.x + m[4 + k] * c.y + m[8 + k] * c.z + m[12 + k]) / w;
            double px = (k == 0 ? 0.5 + 0.5 * v : 0.5 - 0.5 * v) * size[k];
            low[k] = fmin(low[k], px);
            high[k] = fmax(high[k], px);
        }
    }
    if (before == 0)
        return;
    if (before < 8) {
        want_all(p);
        return;
    }
    if (high[0] < 0 || high[1] < 0 || low[0] >= size[0] || low[1] >= size[1])
        return;
    uint32_t x0 = (uint32_t)(fmax(low[0], 0) / BLOCK), y0 = (uint32_t)(fmax(low[1], 0) / BLOCK);
    uint32_t x1 = (uint32_t)(fmin(high[0], size[0] - 1) / BLOCK);
    uint32_t y1 = (uint32_t)(fmin(high[1], size[1] - 1) / BLOCK);
    for (uint32_t y = y0; y <= y1; y++)
        for (uint32_t x = x0; x <= x1; x++)
            p->wanted[y * p->columns + x] = true;
}

static void cast_block(const picture *p, uint32_t block, uint32_t *pixels)
{
    hw_vec3 directions[BLOCK * BLOCK];
    hw_hit hits[BLOCK * BLOCK];
    uint32_t n = 0, x0 = block % p->columns * BLOCK, y0 = block / p->columns * BLOCK;
    for (uint32_t i = 0; i < BLOCK * BLOCK; i++) {
        // Runs of 16 are 4 x 4 pixels.
        uint32_t x = x0 + (i / 16 % 2) * 4 + i % 4, y = y0 + (i / 32) * 4 + i % 16 / 4;
        if (x >= p->camera->width || y >= p->camera->height)
            continue;
        float dx = (float)x + 0.5f - 0.5f * (float)p->camera->width;
        float dy = 0.5f * (float)p->camera->height - (float)y - 0.5f;
        directions[n++] = hw_v3_mad(hw_v3_mad(p->forward, p->right, dx), p->up, dy);
    }
    hw_rays_cast_many(p->rays, p->camera->eye, directions, n, 0, hits);
    for (uint32_t i = 0; i < n; i++) {
        hw_hit hit = first_front(p, directions[i], hits[i]);
        if (hit.t < INFINITY)
            pixels[hit.object_idx]++;
    }
}

hw_status hw_visibility_count(const hw_scene *scene, const hw_rays *rays, const hw_camera *camera,
                              const bool *skip, uint32_t *pixels)
{
    picture p = {.scene = scene, .rays = rays, .camera = camera};
    float pixel = (float)(1 / hw_camera_focal_px(camera));
    p.forward = hw_v3_normalize(camera->forward);
    hw_vec3 right = hw_v3_normalize(hw_v3_cross(p.forward, camera->up));
    p.right = hw_v3_scale(right, pixel);
    p.up = hw_v3_scale(hw_v3_cross(right, p.forward), pixel);
    p.clip = hw_camera_view_projection(camera);
    p.columns = (camera->width + BLOCK - 1) / BLOCK;
    p.rows = (camera->height + BLOCK - 1) / BLOCK;
    HW_TRY(HW_NEW(&p.wanted, (size_t)p.columns * p.rows));
    for (uint32_t i = 0; i < scene->object_count; i++)
        if (!skip[i])
            want_box(&p, scene->objects[i].bounds);
    for (uint32_t block = 0; block < p.columns * p.rows; block++)
        if (p.wanted[block])
            cast_block(&p, block, pixels);
    hw_free(p.wanted);
    return HW_OK;
}

bool hw_visibility_inside(const hw_scene *scene, const hw_rays *rays, hw_vec3 eye)
{
    hw_vec3 up = hw_v3(0, 0, 1);
    int depth = 0; // surfaces left less those entered: an object may consist of several
    hw_hit hit = hw_rays_cast(rays, eye, up, 0, INFINITY);
    for (int i = 0; i < PASSES_MAX && hit.t < INFINITY; i++) {
        depth += hw_hit_is_front(scene, &hit, up) ? -1 : 1;
        hit = hw_rays_cast(rays, eye, up, hit.t + 1e-4f + 1e-5f * hit.t, INFINITY);
    }
    return depth > 0;
}
