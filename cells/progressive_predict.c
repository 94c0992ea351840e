#include "progressive_predict.h"
#include "mesh.h"
#include <string.h>

static void values_of(const hw_position_grid *grid, const int32_t code[3], double out[3])
{
    float position[3];
    if (grid->lossless)
        hw_position_grid_decode(grid, code, position);
    for (int i = 0; i < 3; i++)
        out[i] = grid->lossless ? (double)position[i] : code[i];
}

static void code_of(const hw_position_grid *grid, const double values[3], int32_t code[3])
{
    float position[3];
    for (int i = 0; i < 3; i++) {
        position[i] = (float)values[i];
        if (!grid->lossless)
            code[i] = (int32_t)rint(values[i]);
    }
    if (grid->lossless)
        hw_position_grid_encode(grid, position, code);
}

typedef struct sum {
    double values[3];
    uint32_t count;
} sum;

static void add(sum *s, const hw_position_grid *grid, const int32_t code[3])
{
    double values[3];
    values_of(grid, code, values);
    for (int i = 0; i < 3; i++)
        s->values[i] += values[i];
    s->count++;
}

void hw_ring_means_find(const hw_position_grid *grid, const hw_fan *fan, const uint32_t *corners,
                        const int32_t (*codes)[3], const uint32_t *tips, uint32_t tip_count,
                        hw_ring_means *out)
{
    sum kept = {.count = 0}, removed = {.count = 0};
    for (uint32_t i = 0; i < fan->count; i++) {
        sum *s = fan->moved[i] ? &removed : &kept;
        uint32_t corner = fan->corners[i], face = corner - corner % 3;
        add(s, grid, codes[corners[face + (corner + 1) % 3]]);
        add(s, grid, codes[corners[face + (corner + 2) % 3]]);
    }
    for (uint32_t i = 0; i < tip_count; i++) {
        add(&kept, grid, codes[tips[i]]);
        add(&removed, grid, codes[tips[i]]);
    }
    for (int i = 0; i < 3; i++) {
        out->kept[i] = kept.values[i] / kept.count;
        out->removed[i] = removed.values[i] / removed.count;
    }
}

// Factors are those of a regular mesh, where all vertices have six neighbours and lie in the middle
// of them: the mean of the five others lies 1.2 times as far from the sixth as the vertex itself,
// and two such means 1.4 times as far from each other as the vertices. They are sums of powers of
// two, so that a compiler that fuses products and sums gives the same bits.
static double toward_mean(double from, double mean)
{
    double d = mean - from; // 0.8125, about 1 / 1.2
    return from + (d * 0.5 + d * 0.25 + d * 0.0625);
}

static double half_apart(double a, double b)
{
    double d = a - b; // 0.375, about 0.5 / 1.4
    return d * 0.25 + d * 0.125;
}

void hw_place_kept(const hw_position_grid *grid, hw_place place, const int32_t merged[3],
                   const hw_ring_means *means, int32_t kept[3])
{
    double m[3], k[3];
    memcpy(kept, merged, 3 * sizeof *kept);
    if (place == HW_PLACE_KEPT)
        return;
    values_of(grid, merged, m);
    for (int i = 0; i < 3; i++)
        k[i] = place == HW_PLACE_REMOVED ? toward_mean(m[i], means->kept[i])
                                         : m[i] + half_apart(means->kept[i], means->removed[i]);
    code_of(grid, k, kept);
}

void hw_place_removed(const hw_position_grid *grid, hw_place place, const int32_t merged[3],
                      const int32_t kept[3], const hw_ring_means *means, int32_t removed[3])
{
    double m[3], k[3], l[3];
    memcpy(removed, merged, 3 * sizeof *removed);
    if (place == HW_PLACE_REMOVED)
        return;
    values_of(grid, merged, m);
    values_of(grid, kept, k);
    for (int i = 0; i < 3; i++)
        l[i] = place == HW_PLACE_REFLECT ? 2 * m[i] - k[i] : toward_mean(k[i], means->removed[i]);
    code_of(grid, l, removed);
}
