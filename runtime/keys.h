// What the visitor can do, and by which keys: one table for the window that reads them, the help
// overlay and the text of `hexwalk help walk`. No GL and no window.
#pragma once
#include "context.h"
#include <stddef.h>

#define HW_KEY_NAMES_MAX 2

// A key is named as it is shown: one letter or digit, or "Up", "Down", "Left", "Right", "Page Up",
// "Page Down", "Space", "Comma", "Period", "Escape", "Shift", "F1" to "F12"; "Ctrl+" before it asks
// for Control, and a key without it is not pressed while Control is.
typedef struct hw_key_row {
    hw_key key; // HW_KEY_COUNT: only told of (mouse and sticks)
    const char *names[HW_KEY_NAMES_MAX];
    const char *button; // of a gamepad, one of hw_gamepad_button_names; NULL: none
    const char *meaning;
} hw_key_row;

extern const hw_key_row hw_key_rows[];
extern const size_t hw_key_row_count;

// "F12, pad X", cut to capacity - 1 bytes.
void hw_key_format(const hw_key_row *row, char *out, size_t capacity);

// ---- Gamepads, as GLFW (and SDL) lay them out

enum {
    HW_GAMEPAD_LEFT_X, // axes in [-1, 1]: right and down are positive
    HW_GAMEPAD_LEFT_Y,
    HW_GAMEPAD_RIGHT_X,
    HW_GAMEPAD_RIGHT_Y,
    HW_GAMEPAD_LEFT_TRIGGER, // -1 released, 1 pressed
    HW_GAMEPAD_RIGHT_TRIGGER,
    HW_GAMEPAD_AXES
};
#define HW_GAMEPAD_BUTTONS 15
// "A", "B", "X", "Y", "LB", ...
extern const char *const hw_gamepad_button_names[HW_GAMEPAD_BUTTONS];

typedef struct hw_gamepad {
    float axes[HW_GAMEPAD_AXES];
    bool buttons[HW_GAMEPAD_BUTTONS];
} hw_gamepad;

// Adds to *input what the sticks, triggers and buttons ask for; `before` is the state of the last
// poll (a button is pressed once). Sticks rest within a tenth and a half of their way.
void hw_gamepad_apply(const hw_gamepad *now, const hw_gamepad *before, hw_input *input);
