// What a context backend provides: one table per windowing library, so that each library's headers
// stay in one source file (context_osmesa.c, context_glfw.c).
#pragma once
#include "context.h"

typedef struct hw_context_backend {
    const char *name; // "osmesa", "glfw"; for messages
    // Creates a current OpenGL 3.3 core context of desc's size (width and height are at least 1,
    // samples at least 1, title never NULL) and puts the backend's own state into *state. On
    // failure HW_GRAPHICS with the library's words, nothing left behind and *state untouched.
    hw_status (*create)(const hw_context_desc *desc, void **state);
    // Frees what create made; state is never NULL.
    void (*destroy)(void *state);
    // For gladLoadGL, with the context current; NULL for unknown names.
    void (*(*proc_address)(const char *name))(void);
    // Shows the frame and fills *input, which comes zeroed (but for `down`, which holds the keys of
    // the last call, and width and height). Off screen: does nothing.
    void (*present)(void *state, hw_input *input);
    void (*set_title)(void *state, const char *title);
    // As in context.h; NULL where there is no window.
    void (*toggle_fullscreen)(void *state);
    const char *(*clipboard)(void *state);
    void (*set_clipboard)(void *state, const char *text);
} hw_context_backend;

extern const hw_context_backend hw_context_osmesa, hw_context_glfw;
