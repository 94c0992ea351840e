#include "keys.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

#define DEAD_ZONE 0.15

const hw_key_row hw_key_rows[] = {
    {HW_KEY_FORWARD, {"W", "Up"}, NULL, "walk ahead"},
    {HW_KEY_BACK, {"S", "Down"}, NULL, "walk back"},
    {HW_KEY_LEFT, {"A"}, NULL, "walk to the left"},
    {HW_KEY_RIGHT, {"D"}, NULL, "walk to the right"},
    {HW_KEY_TURN_LEFT, {"Left"}, NULL, "turn left"},
    {HW_KEY_TURN_RIGHT, {"Right"}, NULL, "turn right"},
    {HW_KEY_LOOK_UP, {"Page Up"}, NULL, "look up"},
    {HW_KEY_LOOK_DOWN, {"Page Down"}, NULL, "look down"},
    {HW_KEY_UP, {"E"}, NULL, "rise"},
    {HW_KEY_DOWN, {"Q"}, NULL, "sink"},
    {HW_KEY_RUN, {"Shift"}, "LB", "run"},
    {HW_KEY_COUNT, {"Mouse"}, NULL, "look round, after a click"},
    {HW_KEY_COUNT, {"Sticks"}, NULL, "of a gamepad: walk, look round"},
    {HW_KEY_COUNT, {"Triggers"}, NULL, "of a gamepad: sink, rise"},
    {HW_KEY_CONFIG_A, {"1"}, NULL, "A: full geometry"},
    {HW_KEY_CONFIG_B, {"2"}, NULL, "B: geometry with culling"},
    {HW_KEY_CONFIG_L, {"3"}, NULL, "L: levels of detail"},
    {HW_KEY_CONFIG_C, {"4"}, NULL, "C: the hybrid"},
    {HW_KEY_TOUR, {"Space"}, "start", "rest the tour, or go on"},
    {HW_KEY_RECORD, {"R"}, NULL, "start or end recording a tour"},
    {HW_KEY_SCREENSHOT, {"F12"}, "X", "save a screenshot"},
    {HW_KEY_COPY, {"Ctrl+C"}, NULL, "copy the camera as text"},
    {HW_KEY_PASTE, {"Ctrl+V"}, NULL, "go to the copied camera"},
    {HW_KEY_HELP, {"F1", "H"}, "back", "show or hide this help"},
    {HW_KEY_HUD, {"F2"}, "Y", "show or hide the figures"},
    {HW_KEY_TINT, {"F3"}, NULL, "colour by representation"},
    {HW_KEY_WIREFRAME, {"F4"}, NULL, "wireframe"},
    {HW_KEY_MAP, {"F5"}, NULL, "map of the cells"},
    {HW_KEY_FREEZE, {"F6"}, NULL, "freeze culling and fly on"},
    {HW_KEY_SPLIT, {"F7"}, NULL, "split screen, B on the right"},
    {HW_KEY_SEAM_LEFT, {"Comma"}, "d-pad left", "seam to the left"},
    {HW_KEY_SEAM_RIGHT, {"Period"}, "d-pad right", "seam to the right"},
    {HW_KEY_ERROR, {"F8"}, NULL, "error map against B"},
    {HW_KEY_COLLISION, {"F9"}, NULL, "collision on or off"},
    {HW_KEY_DISSOLVE, {"F10"}, NULL, "dissolve at crossings or not"},
    {HW_KEY_FULLSCREEN, {"F11"}, NULL, "fullscreen on or off"},
    {HW_KEY_QUIT, {"Escape", "Ctrl+Q"}, NULL, "free the mouse, then quit"},
};
const size_t hw_key_row_count = sizeof hw_key_rows / sizeof *hw_key_rows;

const char *const hw_gamepad_button_names[HW_GAMEPAD_BUTTONS] = {
    "A",           "B",        "X",           "Y",          "LB",
    "RB",          "back",     "start",       "guide",      "left thumb",
    "right thumb", "d-pad up", "d-pad right", "d-pad down", "d-pad left"};

void hw_key_format(const hw_key_row *row, char *out, size_t capacity)
{
    snprintf(out, capacity, "%s%s%s%s%s", row->names[0], row->names[1] ? ", " : "",
             row->names[1] ? row->names[1] : "", row->button ? ", pad " : "",
             row->button ? row->button : "");
}

// ---- Gamepads

// The way of an axis beyond the dead zone, 0 to 1 either way.
static double beyond_rest(float value)
{
    double way = fabs((double)value);
    if (!(way > DEAD_ZONE))
        return 0;
    way = (fmin(way, 1) - DEAD_ZONE) / (1 - DEAD_ZONE);
    return value < 0 ? -way : way;
}

static const hw_key_row *row_of_button(int button)
{
    for (size_t i = 0; i < hw_key_row_count; i++) {
        const char *name = hw_key_rows[i].button;
        if (name && strcmp(name, hw_gamepad_button_names[button]) == 0)
            return &hw_key_rows[i];
    }
    return NULL;
}

void hw_gamepad_apply(const hw_gamepad *now, const hw_gamepad *before, hw_input *input)
{
    input->ahead -= beyond_rest(now->axes[HW_GAMEPAD_LEFT_Y]);
    input->right += beyond_rest(now->axes[HW_GAMEPAD_LEFT_X]);
    input->turn += beyond_rest(now->axes[HW_GAMEPAD_RIGHT_X]);
    input->pitch -= beyond_rest(now->axes[HW_GAMEPAD_RIGHT_Y]);
    input->up += beyond_rest((now->axes[HW_GAMEPAD_RIGHT_TRIGGER] + 1) / 2) -
                 beyond_rest((now->axes[HW_GAMEPAD_LEFT_TRIGGER] + 1) / 2);
    for (int i = 0; i < HW_GAMEPAD_BUTTONS; i++) {
        const hw_key_row *row = now->buttons[i] ? row_of_button(i) : NULL;
        if (!row)
            continue;
        input->down[row->key] = true;
        if (!before->buttons[i])
            input->pressed[row->key] = true;
    }
}
