// OpenGL 3.3 core contexts behind one table: a window (GLFW) or off-screen memory (OSMesa). One
// context per process at a time; all GL calls on the thread that created it.
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stdint.h>

typedef enum hw_context_kind { HW_CONTEXT_OFFSCREEN, HW_CONTEXT_WINDOW } hw_context_kind;

typedef struct hw_context_desc {
    hw_context_kind kind;
    uint32_t width, height;
    const char *title;
    uint32_t samples; // of a window's default framebuffer; 0 or 1 = none
    bool fullscreen;
} hw_context_desc;

// Input of a window since the last poll; zeros off screen. keys.h tells what each key is for.
typedef enum hw_key {
    HW_KEY_FORWARD,
    HW_KEY_BACK,
    HW_KEY_LEFT,
    HW_KEY_RIGHT,
    HW_KEY_UP,
    HW_KEY_DOWN,
    HW_KEY_RUN,
    HW_KEY_TURN_LEFT,
    HW_KEY_TURN_RIGHT,
    HW_KEY_LOOK_UP,
    HW_KEY_LOOK_DOWN,
    HW_KEY_CONFIG_A,
    HW_KEY_CONFIG_B,
    HW_KEY_CONFIG_L,
    HW_KEY_CONFIG_C,
    HW_KEY_TOUR,
    HW_KEY_RECORD,
    HW_KEY_SCREENSHOT,
    HW_KEY_COPY,
    HW_KEY_PASTE,
    HW_KEY_HELP,
    HW_KEY_HUD,
    HW_KEY_TINT,
    HW_KEY_WIREFRAME,
    HW_KEY_MAP,
    HW_KEY_FREEZE,
    HW_KEY_SPLIT,
    HW_KEY_SEAM_LEFT,
    HW_KEY_SEAM_RIGHT,
    HW_KEY_ERROR,
    HW_KEY_COLLISION,
    HW_KEY_DISSOLVE,
    HW_KEY_FULLSCREEN,
    HW_KEY_QUIT,
    HW_KEY_COUNT
} hw_key;
typedef struct hw_input {
    bool down[HW_KEY_COUNT], pressed[HW_KEY_COUNT];
    double mouse_dx, mouse_dy; // pixels, while captured; x to the right, y down
    double ahead, right, up;   // sticks, -1 to 1: walk; added to the keys
    double turn, pitch;        // sticks, -1 to 1: look; right and up are positive
    uint32_t width, height;    // framebuffer; 0 x 0 while minimised: draw nothing then
    bool close;                // the window's own close button
} hw_input;

typedef struct hw_context hw_context;
// HW_GRAPHICS with the driver's words (no display, no GL 3.3).
HW_MUST_USE hw_status hw_context_create(const hw_context_desc *desc, hw_context **out);
void hw_context_destroy(hw_context *context);
// Shows what was drawn (windows only) and polls input. A window's framebuffer is bound afterwards,
// with the viewport on the whole of it. Waits for the display's next refresh.
void hw_context_present(hw_context *context, hw_input *input);
void hw_context_set_title(hw_context *context, const char *title);
// A window fills the screen it is on, or goes back to its size and place; nothing off screen.
void hw_context_toggle_fullscreen(hw_context *context);
// The clipboard's text, NULL where there is none; valid until the next call. Windows only.
const char *hw_context_clipboard(hw_context *context);
void hw_context_set_clipboard(hw_context *context, const char *text);
// GL_RENDERER, for reports.
const char *hw_context_renderer(const hw_context *context);
