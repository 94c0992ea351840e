#include "cull.h"
#include "alloc.h"
#include <string.h>

#define BLOCK 128u

hw_status hw_cull_set_create(hw_cull_set *out, uint32_t count)
{
    *out = (hw_cull_set){.count = count};
    hw_status status = hw_alloc((void **)&out->data, (size_t)count * 6, sizeof *out->data);
    if (status != HW_OK) {
        out->count = 0;
        return status;
    }
    for (uint32_t i = 0; i < count; i++)
        hw_cull_set_put(out, i, hw_box_empty());
    return HW_OK;
}

void hw_cull_set_free(hw_cull_set *set)
{
    if (!set)
        return;
    hw_free(set->data);
    *set = (hw_cull_set){0};
}

void hw_cull_set_put(hw_cull_set *set, uint32_t i, hw_box box)
{
    const float low[3] = {box.min.x, box.min.y, box.min.z};
    const float high[3] = {box.max.x, box.max.y, box.max.z};
    bool empty = hw_box_is_empty(box);
    for (uint32_t k = 0; k < 3; k++) {
        float centre = empty ? 0 : (float)(((double)low[k] + high[k]) * 0.5);
        float half = fmaxf(high[k] - centre, centre - low[k]);
        // A few units in the last place of the largest coordinate that takes part in the test.
        float slack = 4e-6f * (fabsf(centre) + half);
        set->data[(size_t)k * set->count + i] = centre;
        set->data[(size_t)(k + 3) * set->count + i] = empty ? -INFINITY : half + slack;
    }
}

// The plane as float with unit normal: a, b, c, d.
static void unit_plane(const double plane[4], float out[4])
{
    double length = sqrt(plane[0] * plane[0] + plane[1] * plane[1] + plane[2] * plane[2]);
    double scale = length > 0 ? 1 / length : 0;
    for (int k = 0; k < 4; k++)
        out[k] = (float)(plane[k] * scale);
    out[3] += 1e-6f * fabsf(out[3]); // d's own rounding
}

// outside[i] becomes 1 where box first + i lies wholly outside the plane.
static void test_block(const hw_cull_set *set, uint32_t first, uint32_t count, const float plane[4],
                       int32_t *restrict outside)
{
    size_t n = set->count;
    const float *restrict x = set->data + first, *restrict y = x + n, *restrict z = y + n;
    const float *restrict hx = z + n, *restrict hy = hx + n, *restrict hz = hy + n;
    const float a = plane[0], b = plane[1], c = plane[2], d = plane[3];
    const float aa = fabsf(a), ab = fabsf(b), ac = fabsf(c);
    for (uint32_t i = 0; i < count; i++) {
        float s = a * x[i] + b * y[i] + c * z[i] + d + (aa * hx[i] + ab * hy[i] + ac * hz[i]);
        outside[i] |= !(s >= 0);
    }
}

uint32_t hw_cull_visible(const hw_cull_set *set, const hw_frustum *frustum, uint32_t *visible)
{
    float planes[6][4];
    for (int p = 0; p < 6; p++)
        unit_plane(frustum->planes[p], planes[p]);
    uint32_t found = 0;
    for (uint32_t first = 0; first < set->count; first += BLOCK) {
        int32_t outside[BLOCK] = {0};
        uint32_t left = set->count - first, count = left < BLOCK ? left : BLOCK;
        for (int p = 0; p < 6; p++)
            test_block(set, first, count, planes[p], outside);
        for (uint32_t i = 0; i < count; i++) {
            visible[found] = first + i;
            found += !outside[i];
        }
    }
    return found;
}

// The order of non-negative floats is that of their bits.
static uint32_t key_bits(float key, uint32_t shift)
{
    uint32_t bits;
    memcpy(&bits, &key, sizeof bits);
    return bits >> shift & 255;
}

void hw_cull_sort(hw_cull_item *items, uint32_t count, hw_cull_item *scratch)
{
    // Two passes of a radix sort over the upper half of the bits: sign, exponent, seven of the
    // mantissa.
    for (uint32_t shift = 16; shift < 32; shift += 8) {
        uint32_t starts[257] = {0};
        for (uint32_t i = 0; i < count; i++)
            starts[key_bits(items[i].key, shift) + 1]++;
        for (uint32_t k = 0; k < 256; k++)
            starts[k + 1] += starts[k];
        for (uint32_t i = 0; i < count; i++)
            scratch[starts[key_bits(items[i].key, shift)]++] = items[i];
        memcpy(items, scratch, count * sizeof *items);
    }
}

float hw_box_distance(hw_box box, hw_vec3 point)
{
    hw_vec3 below = hw_v3_sub(box.min, point), above = hw_v3_sub(point, box.max);
    hw_vec3 d = hw_v3_max(hw_v3_max(below, above), hw_v3(0, 0, 0));
    return hw_v3_length(d);
}
