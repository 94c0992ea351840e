// Off-screen render targets: a framebuffer object, optionally multisampled, read back as an image.
#pragma once
#include "image.h"

typedef struct hw_target hw_target;
// samples: 1 or 4. RGBA8 colour, 24-bit depth.
HW_MUST_USE hw_status hw_target_create(hw_target **out, uint32_t width, uint32_t height,
                                       uint32_t samples);
void hw_target_destroy(hw_target *target);
// Binds it for drawing and sets the viewport.
void hw_target_bind(hw_target *target);
// Resolves the samples (part of a frame's cost; does nothing with one sample).
void hw_target_resolve(hw_target *target);
// Reads the resolved pixels, RGBA, top row first; *out is allocated if its data is NULL, else it
// has the target's size. Alpha 255 = object.
HW_MUST_USE hw_status hw_target_read(hw_target *target, hw_image *out);
// Copies the resolved pixels into a GL texture (its name; RGBA8, of the target's size).
void hw_target_copy(hw_target *target, uint32_t texture);
