// Windows, through GLFW (the only file that includes it).
#include "alloc.h"
#include "context_internal.h"
#include "system.h"
#include <glad/gl.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define SMALLEST_SIDE 160

typedef struct glfw_window {
    GLFWwindow *window;
    bool captured;   // the mouse turns the view
    bool has_cursor; // cursor_x and cursor_y are of the present capture
    double cursor_x, cursor_y;
    double refresh_ms, shown_ms;
    hw_input events; // collected by the callbacks since the last poll
} glfw_window;

typedef struct key_binding {
    int glfw_key;
    hw_key key;
} key_binding;

static const key_binding bindings[] = {
    {GLFW_KEY_W, HW_KEY_FORWARD},      {GLFW_KEY_UP, HW_KEY_FORWARD},
    {GLFW_KEY_S, HW_KEY_BACK},         {GLFW_KEY_DOWN, HW_KEY_BACK},
    {GLFW_KEY_A, HW_KEY_LEFT},         {GLFW_KEY_D, HW_KEY_RIGHT},
    {GLFW_KEY_E, HW_KEY_UP},           {GLFW_KEY_Q, HW_KEY_DOWN},
    {GLFW_KEY_LEFT_SHIFT, HW_KEY_RUN}, {GLFW_KEY_RIGHT_SHIFT, HW_KEY_RUN},
    {GLFW_KEY_LEFT, HW_KEY_TURN_LEFT}, {GLFW_KEY_RIGHT, HW_KEY_TURN_RIGHT},
    {GLFW_KEY_1, HW_KEY_CONFIG_A},     {GLFW_KEY_2, HW_KEY_CONFIG_B},
    {GLFW_KEY_3, HW_KEY_CONFIG_L},     {GLFW_KEY_4, HW_KEY_CONFIG_C},
    {GLFW_KEY_H, HW_KEY_HUD},          {GLFW_KEY_F12, HW_KEY_SCREENSHOT},
    {GLFW_KEY_R, HW_KEY_RECORD},       {GLFW_KEY_SPACE, HW_KEY_TOUR},
    {GLFW_KEY_F1, HW_KEY_HELP},
};
#define BINDING_COUNT (sizeof bindings / sizeof *bindings)

// GLFW reports through a callback without a context argument, and has one instance per process.
static char last_error[256];

static void on_error(int code, const char *text)
{
    snprintf(last_error, sizeof last_error, "%s (0x%x)", text, (unsigned)code);
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
    if (key == GLFW_KEY_ESCAPE || (control && key == GLFW_KEY_Q)) {
        w->events.pressed[HW_KEY_QUIT] = true;
        return;
    }
    for (size_t i = 0; i < BINDING_COUNT && !control; i++)
        if (bindings[i].glfw_key == key)
            w->events.pressed[bindings[i].key] = true;
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

static void fill_input(glfw_window *w, hw_input *input)
{
    int width, height;
    bool hidden = minimised(w, &width, &height);
    bool down[HW_KEY_COUNT] = {false};
    bool control = glfwGetKey(w->window, GLFW_KEY_LEFT_CONTROL) == GLFW_PRESS ||
                   glfwGetKey(w->window, GLFW_KEY_RIGHT_CONTROL) == GLFW_PRESS;
    for (size_t i = 0; i < BINDING_COUNT && !control; i++)
        if (glfwGetKey(w->window, bindings[i].glfw_key) == GLFW_PRESS)
            down[bindings[i].key] = true;
    *input = w->events;
    memcpy(input->down, down, sizeof down);
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
    w->refresh_ms = 1000.0 / (mode && mode->refreshRate > 0 ? mode->refreshRate : 60);
    glfwSetWindowUserPointer(w->window, w);
    glfwSetWindowSizeLimits(w->window, SMALLEST_SIDE, SMALLEST_SIDE, GLFW_DONT_CARE,
                            GLFW_DONT_CARE);
    glfwSetKeyCallback(w->window, on_key);
    glfwSetMouseButtonCallback(w->window, on_button);
    glfwSetCursorPosCallback(w->window, on_cursor);
    glfwSetWindowFocusCallback(w->window, on_focus);
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
                                            .set_title = glfw_set_title};
