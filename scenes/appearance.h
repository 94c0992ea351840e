// How a surface gets its colour (design: base-colour texture x vertex colour x static light). The
// same few lines stand in runtime/shaders/shading.glsl, so that a captured texel equals the drawn
// pixel; a test compares the two.
#pragma once
#include "vec.h"

// Direction towards the light, not normalised; one directional and one ambient term.
#define HW_LIGHT_X           0.45f
#define HW_LIGHT_Y           0.30f
#define HW_LIGHT_Z           0.84f
#define HW_LIGHT_DIRECTIONAL 0.55f
#define HW_LIGHT_AMBIENT     0.45f
// Sky: the clear colour.
#define HW_SKY_R 0.62f
#define HW_SKY_G 0.73f
#define HW_SKY_B 0.86f

// Light factor at a vertex with unit world normal n. Lighting is per vertex and interpolated
// linearly, everywhere.
static inline float hw_light(hw_vec3 n)
{
    hw_vec3 l = hw_v3_normalize(hw_v3(HW_LIGHT_X, HW_LIGHT_Y, HW_LIGHT_Z));
    float d = hw_v3_dot(n, l);
    return HW_LIGHT_AMBIENT + HW_LIGHT_DIRECTIONAL * (d > 0 ? d : 0);
}
