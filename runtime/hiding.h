// What boxes hide in one picture: a small depth buffer without GL, in the manner of J. Hasselgren,
// M. Andersson, T. Akenine-Moeller, Masked Software Occlusion Culling (HPG 2016). Conservative both
// ways: what hides counts where it covers a pixel wholly, at its farthest there; what may be hidden
// is taken for its box.
#pragma once
#include "camera.h"
#include "status.h"

typedef struct hw_hiding hw_hiding;

// About 300 KB, once; what follows allocates nothing.
HW_MUST_USE hw_status hw_hiding_create(hw_hiding **out);
void hw_hiding_destroy(hw_hiding *hiding);

// Nothing is hidden in the camera's picture (not smaller than 1 x 1).
void hw_hiding_begin(hw_hiding *hiding, const hw_camera *camera);
// Adds a box inside a solid that is drawn, `transform` (affine) to the world. Best front to back.
// The solid must lie beyond the near plane, hw_hiding_near_reach from the eye; a box that reaches
// beyond the far plane, or round the eye, hides nothing.
void hw_hiding_add(hw_hiding *hiding, const hw_mat4 *transform, hw_box box);
// How far from the eye the near plane's farthest corner is.
double hw_hiding_near_reach(const hw_hiding *hiding);
// Whether nothing that is drawn within a box (`transform` to the world; NULL: it is there) changes
// any sample of the picture, which lies wholly behind what was added.
bool hw_hiding_hides(const hw_hiding *hiding, const hw_mat4 *transform, hw_box box);
