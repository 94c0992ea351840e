// The table of keys, and gamepads.
#include "keys.h"
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

// Every key has one row, and no name or button stands for two.
static void test_table_is_complete(void **state)
{
    (void)state;
    int rows[HW_KEY_COUNT + 1] = {0};
    for (size_t i = 0; i < hw_key_row_count; i++) {
        const hw_key_row *row = &hw_key_rows[i];
        assert_in_range(row->key, 0, HW_KEY_COUNT);
        rows[row->key]++;
        assert_non_null(row->names[0]);
        assert_true(row->meaning[0] != '\0');
        for (size_t k = 0; k < i; k++) {
            const hw_key_row *other = &hw_key_rows[k];
            for (int a = 0; a < HW_KEY_NAMES_MAX; a++)
                for (int b = 0; b < HW_KEY_NAMES_MAX; b++)
                    if (row->names[a] && other->names[b])
                        assert_string_not_equal(row->names[a], other->names[b]);
            if (row->button && other->button)
                assert_string_not_equal(row->button, other->button);
        }
        bool known = !row->button;
        for (int k = 0; k < HW_GAMEPAD_BUTTONS; k++)
            known = known || strcmp(row->button, hw_gamepad_button_names[k]) == 0;
        assert_true(known);
    }
    for (int key = 0; key < HW_KEY_COUNT; key++)
        assert_int_equal(rows[key], 1);
}

// Names are of the kinds that keys.h promises, so that the window finds a key for each.
static void test_names(void **state)
{
    (void)state;
    static const char *const words[] = {"Up",    "Down",   "Left",  "Right", "Page Up", "Page Down",
                                        "Space", "Escape", "Shift", "Comma", "Period"};
    for (size_t i = 0; i < hw_key_row_count; i++) {
        for (int k = 0; k < HW_KEY_NAMES_MAX; k++) {
            const char *name = hw_key_rows[i].names[k];
            if (!name || hw_key_rows[i].key == HW_KEY_COUNT)
                continue;
            name += strncmp(name, "Ctrl+", 5) == 0 ? 5 : 0;
            bool known =
                strlen(name) == 1 && strchr("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789", name[0]);
            int number = 0, end = 0;
            if (sscanf(name, "F%d%n", &number, &end) == 1 && !name[end])
                known = number >= 1 && number <= 12;
            for (size_t w = 0; w < sizeof words / sizeof *words; w++)
                known = known || strcmp(name, words[w]) == 0;
            assert_true(known);
        }
    }
}

static void test_format(void **state)
{
    (void)state;
    char text[64];
    const hw_key_row row = {HW_KEY_HELP, {"F1", "H"}, "back", "help"};
    hw_key_format(&row, text, sizeof text);
    assert_string_equal(text, "F1, H, pad back");
    hw_key_format(&row, text, 5);
    assert_string_equal(text, "F1, ");
    const hw_key_row plain = {HW_KEY_RIGHT, {"D"}, NULL, "right"};
    hw_key_format(&plain, text, sizeof text);
    assert_string_equal(text, "D");
}

// ---- Gamepads

static const hw_gamepad at_rest = {
    .axes = {[HW_GAMEPAD_LEFT_TRIGGER] = -1, [HW_GAMEPAD_RIGHT_TRIGGER] = -1}};

static hw_input applied(const hw_gamepad *now, const hw_gamepad *before)
{
    hw_input input = {0};
    hw_gamepad_apply(now, before, &input);
    return input;
}

static void test_rest(void **state)
{
    (void)state;
    const hw_input nothing = {0};
    hw_input input = applied(&at_rest, &at_rest);
    assert_memory_equal(&input, &nothing, sizeof input);
    hw_gamepad drifting = at_rest;
    for (int i = 0; i < 4; i++)
        drifting.axes[i] = i % 2 ? 0.14f : -0.14f;
    drifting.axes[HW_GAMEPAD_LEFT_TRIGGER] = -0.8f;
    input = applied(&drifting, &at_rest);
    assert_true(input.ahead == 0 && input.right == 0 && input.turn == 0 && input.pitch == 0);
    assert_true(input.up == 0);
    drifting.axes[0] = NAN; // a driver's bad day
    input = applied(&drifting, &at_rest);
    assert_true(input.right == 0);
}

static void test_sticks(void **state)
{
    (void)state;
    hw_gamepad pad = at_rest;
    pad.axes[HW_GAMEPAD_LEFT_X] = 1;
    pad.axes[HW_GAMEPAD_LEFT_Y] = -1; // up
    pad.axes[HW_GAMEPAD_RIGHT_X] = -1;
    pad.axes[HW_GAMEPAD_RIGHT_Y] = 1.5f; // beyond its range
    pad.axes[HW_GAMEPAD_RIGHT_TRIGGER] = 1;
    hw_input input = applied(&pad, &at_rest);
    assert_true(input.right == 1 && input.ahead == 1 && input.turn == -1 && input.pitch == -1);
    assert_true(input.up == 1);
    pad.axes[HW_GAMEPAD_LEFT_TRIGGER] = 1;
    pad.axes[HW_GAMEPAD_LEFT_X] = 0.575f; // the middle of what is left
    input = applied(&pad, &at_rest);
    assert_true(input.up == 0 && fabs(input.right - 0.5) < 1e-6);
}

static void test_buttons(void **state)
{
    (void)state;
    hw_gamepad pad = at_rest;
    pad.buttons[2] = true; // X
    hw_input input = applied(&pad, &at_rest);
    assert_true(input.down[HW_KEY_SCREENSHOT] && input.pressed[HW_KEY_SCREENSHOT]);
    input = applied(&pad, &pad);
    assert_true(input.down[HW_KEY_SCREENSHOT] && !input.pressed[HW_KEY_SCREENSHOT]);
    pad.buttons[8] = true; // guide is left to the system
    hw_input both = applied(&pad, &pad);
    assert_memory_equal(&both, &input, sizeof both);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_table_is_complete),
        cmocka_unit_test(test_names),
        cmocka_unit_test(test_format),
        cmocka_unit_test(test_rest),
        cmocka_unit_test(test_sticks),
        cmocka_unit_test(test_buttons),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
