#include "classify.h"
#include <math.h>
#include <stddef.h>

double hw_classify_relative(double buffer_tolerance, double near, double far, double z)
{
    return buffer_tolerance * z * (far - near) / (far * near);
}

static uint8_t category_of(const float *depth, const float neighbours[4], float t_c0, float t_c1)
{
    // neighbours: left, right, below, above. Steps of 1 / z relative to that of the pixel: 1 - z /
    // n is positive towards a farther neighbour.
    float steps[4];
    for (int k = 0; k < 4; k++) {
        if (!(neighbours[k] < INFINITY))
            return HW_CATEGORY_EXTERIOR_SILHOUETTE;
        steps[k] = 1 - *depth / neighbours[k];
    }
    for (int k = 0; k < 4; k++)
        if (steps[k] > t_c0)
            return HW_CATEGORY_INTERIOR_SILHOUETTE;
    // (Z_{i-1} - Z_i) - (Z_i - Z_{i+1}) is the sum of both steps away from i.
    if (fabsf(steps[0] + steps[1]) > t_c1 || fabsf(steps[2] + steps[3]) > t_c1)
        return HW_CATEGORY_SHARP_EDGE;
    return HW_CATEGORY_INTERIOR;
}

hw_status hw_classify(const float *depths, uint32_t width, uint32_t height,
                      const hw_classify_options *options, uint8_t *categories)
{
    const double n = HW_THESIS_NEAR, f = HW_THESIS_FAR, z = HW_THESIS_Z;
    float t_c0 = options && options->t_c0 > 0
                     ? options->t_c0
                     : (float)hw_classify_relative(HW_THESIS_T_C0, n, f, z);
    float t_c1 = options && options->t_c1 > 0
                     ? options->t_c1
                     : (float)hw_classify_relative(HW_THESIS_T_C1, n, f, z);
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++) {
            const float *depth = depths + (size_t)y * width + x;
            uint8_t *category = categories + (size_t)y * width + x;
            *category = HW_CATEGORY_BACKGROUND;
            if (!(*depth < INFINITY))
                continue;
            const float neighbours[4] = {x > 0 ? depth[-1] : INFINITY,
                                         x + 1 < width ? depth[1] : INFINITY,
                                         y > 0 ? depth[-(ptrdiff_t)width] : INFINITY,
                                         y + 1 < height ? depth[width] : INFINITY};
            *category = category_of(depth, neighbours, t_c0, t_c1);
        }
    return HW_OK;
}

float hw_category_weight(uint8_t category)
{
    static const float weights[HW_CATEGORY_COUNT] = {
        [HW_CATEGORY_BACKGROUND] = 0,
        [HW_CATEGORY_INTERIOR] = 0.125f,
        [HW_CATEGORY_SHARP_EDGE] = 0.25f,
        [HW_CATEGORY_INTERIOR_SILHOUETTE] = 0.4f,
        [HW_CATEGORY_EXTERIOR_SILHOUETTE] = 0.5f,
    };
    return category < HW_CATEGORY_COUNT ? weights[category] : 0;
}
