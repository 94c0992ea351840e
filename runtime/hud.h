// Text over the picture of a window: a line of figures, a message, and the list of keys. GL thread
// only. Nothing is allocated per frame.
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// The figures of the line. A budget of 0 is not shown.
typedef struct hw_hud_info {
    const char *config;                           // "C hybrid"
    double fps, frame_ms, p99_ms;                 // fps 0: not known yet
    int32_t cell_q, cell_r;                       // the view cell of the eye
    uint64_t triangles;                           // sent to GL for this frame
    uint32_t draws;                               // draw calls
    uint32_t hidden;                              // objects left out, hidden; 0: not shown
    uint64_t ram_bytes;                           // resident memory of the process
    uint64_t waiting_bytes, waiting_budget_bytes; // data on their way to the GPU
    uint64_t gpu_bytes, gpu_budget_bytes;         // of the configuration's buffers and textures
    int64_t queue;         // pieces wished for and under way; < 0: nothing is ever queued
    double loaded_bytes_s; // loaded per second
    uint64_t stalls, late; // frames so far that waited for data, or did without
    double recorded_s;     // length of the recording; < 0: none
    const char *views;     // what is switched on: "wireframe, culling frozen"; NULL: nothing
} hw_hud_info;

// The line as text, cut to capacity - 1 bytes (capacity > 0). Returns its length.
size_t hw_hud_format(const hw_hud_info *info, char *out, size_t capacity);

// What a colour means.
typedef struct hw_hud_legend_row {
    float color[3];
    char text[24];
} hw_hud_legend_row;

#define HW_HUD_LEGEND_MAX 8u

typedef struct hw_minimap hw_minimap;

// What to show; NULL, 0 and false: nothing. Text is wrapped at the window's right edge, into a few
// rows at most; what is not printable ASCII becomes '?'.
typedef struct hw_hud_content {
    const char *line;                // top left
    const char *message;             // bottom left
    const hw_minimap *map;           // top right, below the line
    const hw_hud_legend_row *legend; // bottom right
    uint32_t legend_count;           // <= HW_HUD_LEGEND_MAX
    bool help;                       // the keys, in the middle
} hw_hud_content;

typedef struct hw_hud hw_hud;
HW_MUST_USE hw_status hw_hud_create(hw_hud **out);
void hw_hud_destroy(hw_hud *hud);
// Draws over the bound framebuffer of width x height pixels. Leaves the depth test, face culling
// and blending as they were; the bindings of program, vertex array and array buffer are left at 0.
void hw_hud_draw(hw_hud *hud, uint32_t width, uint32_t height, const hw_hud_content *content);
// Clears the bound framebuffer to a plain background, while there is no scene to draw.
void hw_hud_blank(hw_hud *hud);
