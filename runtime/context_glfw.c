// Windows, through GLFW (the only file that includes it).
#include "alloc.h"
#include "context_internal.h"
#include "keys.h"
#include "system.h"
#include <glad/gl.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <assert.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define SMALLEST_SIDE 160

typedef struct key_binding {
    int code; // GLFW's
    bool control;
    hw_key key;
} key_binding;

#define BINDINGS_MAX 96

typedef struct glfw_window {
    GLFWwindow *window;
    bool captured;   // the mouse turns the view
    bool has_cursor; // cursor_x and cursor_y are of the present capture
    double cursor_x, cursor_y;
    double refresh_ms, shown_ms;
    int place[4];       // x, y, width, height before it filled the screen
    hw_gamepad gamepad; // as last polled
    uint32_t binding_count;
    key_binding bindings[BINDINGS_MAX];
    hw_input events; // collected by the callbacks since the last poll
} glfw_window;

// GLFW reports through a callback without a context argument, and has one instance per process.
static char last_error[256];

static void on_error(int code, const char *text)
{
    snprintf(last_error, sizeof last_error, "%s (0x%x)", text, (unsigned)code);
}

// ---- Keys by name

// GLFW's codes of the keys that keys.h names so; the second is the same key on the other side.
static const struct {
    const char *name;
    int codes[2];
} named_keys[] = {
    {"Up", {GLFW_KEY_UP}},
    {"Down", {GLFW_KEY_DOWN}},
    {"Left", {GLFW_KEY_LEFT}},
    {"Right", {GLFW_KEY_RIGHT}},
    {"Page Up", {GLFW_KEY_PAGE_UP}},
    {"Page Down", {GLFW_KEY_PAGE_DOWN}},
    {"Space", {GLFW_KEY_SPACE}},
    {"Escape", {GLFW_KEY_ESCAPE}},
    {"Comma", {GLFW_KEY_COMMA}},
    {"Period", {GLFW_KEY_PERIOD}},
    {"Shift", {GLFW_KEY_LEFT_SHIFT, GLFW_KEY_RIGHT_SHIFT}},
};

static void bind_code(glfw_window *w, int code, bool control, hw_key key)
{
    assert(code > 0 && w->binding_count < BINDINGS_MAX);
    w->bindings[w->binding_count++] = (key_binding){code, control, key};
}

static void bind_name(glfw_window *w, const char *name, hw_key key)
{
    bool control = strncmp(name, "Ctrl+", 5) == 0;
    name += control ? 5 : 0;
    if (!name[1]) { // printable keys have their character's code
        bind_code(w, (unsigned char)name[0], control, key);
        return;
    }
    if (name[0] == 'F' && name[1] >= '1' && name[1] <= '9') {
        int number = name[1] - '0';
        number = name[2] ? 10 * number + name[2] - '0' : number;
        bind_code(w, GLFW_KEY_F1 + number - 1, control, key);
        return;
    }
    for (size_t i = 0; i < sizeof named_keys / sizeof *named_keys; i++)
        for (int k = 0; k < 2 && strcmp(name, named_keys[i].name) == 0; k++)
            if (named_keys[i].codes[k])
                bind_code(w, named_keys[i].codes[k], control, key);
}

static void bind_keys(glfw_window *w)
{
    for (size_t i = 0; i < hw_key_row_count; i++) {
        const hw_key_row *row = &hw_key_rows[i];
        for (int k = 0; k < HW_KEY_NAMES_MAX && row->key != HW_KEY_COUNT; k++)
            if (row->names[k])
                bind_name(w, row->names[k], row->key);
    }
}

// ---- Input

static void capture_mouse(glfw_window *w, bool capture)
{
    w->captured = capture;
    w->has_cursor = false;
    glfwSetInputMode(w->window, GLFW_CURSOR, capture ? GLFW_CURSOR_DISABLED : GLFW_CURSOR_NORMAL);
    if (glfwRawMouseMotionSupported())
        glfwSetInputMode(w->window, GLFW_RAW_MOUSE_MOTION, capture ? GLFW_TRUE : GLFW_FALSE);
}

static void on_key(GLFWwindow *window, int key, int scancode, int action, int modifiers)
{
    (void)scancode;
    glfw_window *w = glfwGetWindowUserPointer(window);
    if (action != GLFW_PRESS)
        return;
    if (key == GLFW_KEY_ESCAPE && w->captured) {
        capture_mouse(w, false);
        return;
    }
    bool control = modifiers & GLFW_MOD_CONTROL;
    for (uint32_t i = 0; i < w->binding_count; i++)
        if (w->bindings[i].code == key && w->bindings[i].control == control)
            w->events.pressed[w->bindings[i].key] = true;
}

static void on_button(GLFWwindow *window, int button, int action, int modifiers)
{
    (void)modifiers;
    glfw_window *w = glfwGetWindowUserPointer(window);
    if (button == GLFW_MOUSE_BUTTON_LEFT && action == GLFW_PRESS && !w->captured)
        capture_mouse(w, true);
}

static void on_cursor(GLFWwindow *window, double x, double y)
{
    glfw_window *w = glfwGetWindowUserPointer(window);
    if (!w->captured)
        return;
    // The first position of a capture is where the cursor jumped to, not a motion.
    if (w->has_cursor) {
        w->events.mouse_dx += x - w->cursor_x;
        w->events.mouse_dy += y - w->cursor_y;
    }
    w->has_cursor = true;
    w->cursor_x = x;
    w->cursor_y = y;
}

static void on_focus(GLFWwindow *window, int focused)
{
    glfw_window *w = glfwGetWindowUserPointer(window);
    if (!focused && w->captured)
        capture_mouse(w, false);
}

static bool minimised(glfw_window *w, int *width, int *height)
{
    glfwGetFramebufferSize(w->window, width, height);
    return glfwGetWindowAttrib(w->window, GLFW_ICONIFIED) || *width <= 0 || *height <= 0;
}

_Static_assert(HW_GAMEPAD_AXES == GLFW_GAMEPAD_AXIS_LAST + 1 &&
                   HW_GAMEPAD_BUTTONS == GLFW_GAMEPAD_BUTTON_LAST + 1,
               "keys.h lays gamepads out as GLFW does");

// The first joystick that GLFW knows as a gamepad; only while the window has the focus.
static void poll_gamepad(glfw_window *w, hw_input *input)
{
    GLFWgamepadstate state;
    hw_gamepad now = {.axes = {[HW_GAMEPAD_LEFT_TRIGGER] = -1, [HW_GAMEPAD_RIGHT_TRIGGER] = -1}};
    bool found = false;
    for (int i = GLFW_JOYSTICK_1; i <= GLFW_JOYSTICK_LAST && !found; i++)
        found = glfwJoystickIsGamepad(i) && glfwGetGamepadState(i, &state);
    if (found && glfwGetWindowAttrib(w->window, GLFW_FOCUSED)) {
        memcpy(now.axes, state.axes, sizeof now.axes);
        for (int i = 0; i < HW_GAMEPAD_BUTTONS; i++)
            now.buttons[i] = state.buttons[i] == GLFW_PRESS;
    }
    hw_gamepad_apply(&now, &w->gamepad, input);
    w->gamepad = now;
}

static void fill_input(glfw_window *w, hw_input *input)
{
    int width, height;
    bool hidden = minimised(w, &width, &height);
    bool down[HW_KEY_COUNT] = {false};
    bool control = glfwGetKey(w->window, GLFW_KEY_LEFT_CONTROL) == GLFW_PRESS ||
                   glfwGetKey(w->window, GLFW_KEY_RIGHT_CONTROL) == GLFW_PRESS;
    for (uint32_t i = 0; i < w->binding_count; i++)
        if (w->bindings[i].control == control &&
            glfwGetKey(w->window, w->bindings[i].code) == GLFW_PRESS)
            down[w->bindings[i].key] = true;
    // What was pressed and let go between two frames was down for one.
    for (int i = 0; i < HW_KEY_COUNT; i++)
        down[i] = down[i] || w->events.pressed[i];
    *input = w->events;
    memcpy(input->down, down, sizeof down);
    poll_gamepad(w, input);
    input->width = hidden ? 0 : (uint32_t)width;
    input->height = hidden ? 0 : (uint32_t)height;
    input->close = glfwWindowShouldClose(w->window);
    w->events = (hw_input){0};
    if (!hidden) {
        glBindFramebuffer(GL_FRAMEBUFFER, 0);
        glViewport(0, 0, width, height);
    }
}

// ---- Showing

static void sleep_ms(double ms)
{
    struct timespec t = {.tv_sec = (time_t)(ms / 1000)};
    t.tv_nsec = (long)((ms - 1000.0 * (double)t.tv_sec) * 1e6);
    nanosleep(&t, NULL);
}

// Software GL and some compositors ignore the swap interval: then the pace is kept here, so that a
// window never draws faster than its display shows. With a working interval nothing is left to
// wait for.
static void keep_pace(glfw_window *w)
{
    double since = hw_clock_ms() - w->shown_ms;
    if (since < 0.9 * w->refresh_ms)
        sleep_ms(w->refresh_ms - since);
    w->shown_ms = hw_clock_ms();
}

static void glfw_present(void *state, hw_input *input)
{
    glfw_window *w = state;
    int width, height;
    if (minimised(w, &width, &height)) {
        glfwWaitEventsTimeout(0.1);
    } else {
        glfwSwapBuffers(w->window);
        keep_pace(w);
        glfwPollEvents();
    }
    fill_input(w, input);
}

static void glfw_set_title(void *state, const char *title)
{
    glfw_window *w = state;
    glfwSetWindowTitle(w->window, title);
}

// ---- Filling the screen

// The monitor that shows most of the window, NULL without any.
static GLFWmonitor *monitor_of(glfw_window *w)
{
    int x, y, width, height, count = 0, best = -1;
    GLFWmonitor **monitors = glfwGetMonitors(&count), *found = NULL;
    glfwGetWindowPos(w->window, &x, &y);
    glfwGetWindowSize(w->window, &width, &height);
    for (int i = 0; i < count; i++) {
        int mx, my;
        const GLFWvidmode *mode = glfwGetVideoMode(monitors[i]);
        glfwGetMonitorPos(monitors[i], &mx, &my);
        if (!mode)
            continue;
        int right = x + width < mx + mode->width ? x + width : mx + mode->width;
        int bottom = y + height < my + mode->height ? y + height : my + mode->height;
        int overlap_x = right - (x > mx ? x : mx), overlap_y = bottom - (y > my ? y : my);
        int area = overlap_x > 0 && overlap_y > 0 ? overlap_x * overlap_y : 0;
        if (area > best) {
            best = area;
            found = monitors[i];
        }
    }
    return found;
}

static void glfw_toggle_fullscreen(void *state)
{
    glfw_window *w = state;
    if (glfwGetWindowMonitor(w->window)) {
        glfwSetWindowMonitor(w->window, NULL, w->place[0], w->place[1], w->place[2], w->place[3],
                             GLFW_DONT_CARE);
        return;
    }
    GLFWmonitor *monitor = monitor_of(w);
    const GLFWvidmode *mode = monitor ? glfwGetVideoMode(monitor) : NULL;
    if (!mode)
        return;
    glfwGetWindowPos(w->window, &w->place[0], &w->place[1]);
    glfwGetWindowSize(w->window, &w->place[2], &w->place[3]);
    // The desktop's own mode: no display is ever switched to another one.
    glfwSetWindowMonitor(w->window, monitor, 0, 0, mode->width, mode->height, mode->refreshRate);
}

static const char *glfw_clipboard(void *state)
{
    glfw_window *w = state;
    return glfwGetClipboardString(w->window);
}

static void glfw_set_clipboard(void *state, const char *text)
{
    glfw_window *w = state;
    glfwSetClipboardString(w->window, text);
}

// The display that the window is on sets the pace.
static void learn_pace(glfw_window *w)
{
    GLFWmonitor *monitor = monitor_of(w);
    const GLFWvidmode *mode = monitor ? glfwGetVideoMode(monitor) : NULL;
    w->refresh_ms = 1000.0 / (mode && mode->refreshRate > 0 ? mode->refreshRate : 60);
}

static void on_move(GLFWwindow *window, int x, int y)
{
    (void)x;
    (void)y;
    learn_pace(glfwGetWindowUserPointer(window));
}

// ---- Creating

static GLFWwindow *open_window(const hw_context_desc *desc, GLFWmonitor *monitor,
                               const GLFWvidmode *mode)
{
    glfwWindowHint(GLFW_CLIENT_API, GLFW_OPENGL_API);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
    glfwWindowHint(GLFW_DEPTH_BITS, 24);
    glfwWindowHint(GLFW_STENCIL_BITS, 0);
    glfwWindowHint(GLFW_SAMPLES, desc->samples > 1 ? (int)desc->samples : 0);
    if (!desc->fullscreen || !mode)
        return glfwCreateWindow((int)desc->width, (int)desc->height, desc->title, NULL, NULL);
    // The desktop's own mode: no display is ever switched to another one.
    glfwWindowHint(GLFW_REFRESH_RATE, mode->refreshRate);
    return glfwCreateWindow(mode->width, mode->height, desc->title, monitor, NULL);
}

static void glfw_destroy(void *state)
{
    glfw_window *w = state;
    glfwDestroyWindow(w->window);
    glfwTerminate();
    hw_free(w);
}

static hw_status no_window(void)
{
    return hw_fail(HW_GRAPHICS,
                   "no window: %s; on a machine without a display use `hexwalk render`",
                   last_error[0] ? last_error : "unknown reason");
}

static hw_status glfw_create(const hw_context_desc *desc, void **state)
{
    last_error[0] = '\0';
    glfwSetErrorCallback(on_error);
    if (!glfwInit())
        return no_window();
    hw_status status = HW_OK;
    glfw_window *w = NULL;
    HW_GO(HW_NEW(&w, 1));
    GLFWmonitor *monitor = glfwGetPrimaryMonitor();
    const GLFWvidmode *mode = monitor ? glfwGetVideoMode(monitor) : NULL;
    w->window = open_window(desc, monitor, mode);
    if (!w->window) {
        status = no_window();
        goto out;
    }
    w->place[2] = (int)desc->width; // where one that starts full goes back to
    w->place[3] = (int)desc->height;
    w->gamepad.axes[HW_GAMEPAD_LEFT_TRIGGER] = w->gamepad.axes[HW_GAMEPAD_RIGHT_TRIGGER] = -1;
    bind_keys(w);
    glfwSetWindowUserPointer(w->window, w);
    glfwSetWindowSizeLimits(w->window, SMALLEST_SIDE, SMALLEST_SIDE, GLFW_DONT_CARE,
                            GLFW_DONT_CARE);
    glfwSetKeyCallback(w->window, on_key);
    glfwSetMouseButtonCallback(w->window, on_button);
    glfwSetCursorPosCallback(w->window, on_cursor);
    glfwSetWindowFocusCallback(w->window, on_focus);
    glfwSetWindowPosCallback(w->window, on_move);
    learn_pace(w);
    glfwMakeContextCurrent(w->window);
    glfwSwapInterval(1);
    *state = w;
    return HW_OK;
out:
    hw_free(w);
    glfwTerminate();
    return status;
}

static void (*glfw_proc_address(const char *name))(void)
{
    return glfwGetProcAddress(name);
}

const hw_context_backend hw_context_glfw = {.name = "glfw",
                                            .create = glfw_create,
                                            .destroy = glfw_destroy,
                                            .proc_address = glfw_proc_address,
                                            .present = glfw_present,
                                            .set_title = glfw_set_title,
                                            .toggle_fullscreen = glfw_toggle_fullscreen,
                                            .clipboard = glfw_clipboard,
                                            .set_clipboard = glfw_set_clipboard};
