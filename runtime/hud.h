// Text over the picture of a window: a line of figures, a message, and the list of keys. GL thread
// only. Nothing is allocated per frame.
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// The figures of the line.
typedef struct hw_hud_info {
    const char *config;             // "C hybrid"
    double fps, frame_ms, worst_ms; // fps 0: not known yet
    int32_t cell_q, cell_r;         // the view cell of the eye
    uint64_t triangles;             // sent to GL for this frame
    uint32_t draws;                 // draw calls
    uint64_t gpu_bytes;             // of the configuration's buffers and textures
    double recorded_s;              // length of the recording; < 0: none
} hw_hud_info;

// The line as text, cut to capacity - 1 bytes (capacity > 0). Returns its length.
size_t hw_hud_format(const hw_hud_info *info, char *out, size_t capacity);

// What to show; NULL and false: nothing. Text is wrapped at the window's right edge, into a few
// rows at most; what is not printable ASCII becomes '?'.
typedef struct hw_hud_content {
    const char *line;    // top left
    const char *message; // bottom left
    bool help;           // the keys, in the middle
} hw_hud_content;

typedef struct hw_hud hw_hud;
HW_MUST_USE hw_status hw_hud_create(hw_hud **out);
void hw_hud_destroy(hw_hud *hud);
// Draws over the bound framebuffer of width x height pixels. Leaves the depth test, face culling
// and blending as they were; the bindings of program, vertex array and array buffer are left at 0.
void hw_hud_draw(hw_hud *hud, uint32_t width, uint32_t height, const hw_hud_content *content);
// Clears the bound framebuffer to a plain background, while there is no scene to draw.
void hw_hud_blank(hw_hud *hud);
