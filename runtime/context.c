#include "context.h"
#include "alloc.h"
#include "context_internal.h"
#include <dlfcn.h>
#include <glad/gl.h>

#ifdef __SANITIZE_ADDRESS__
// OSMesa keeps some hundred bytes of every context for good. Drivers of windows keep theirs where
// they can be reached, as long as they stay loaded.
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void)
{
    return "leak:libOSMesa\n";
}

int dlclose(void *library)
{
    (void)library;
    return 0;
}
#endif

struct hw_context {
    const hw_context_backend *backend;
    void *state;
    char *renderer;
    hw_input input; // the last poll: backends keep `down` up to date in it
};

// glad's function pointers are process-wide, so a second context would silently take them over.
static bool context_exists;

static hw_status load_gl(hw_context *context)
{
    int version = gladLoadGL(context->backend->proc_address);
    if (version < GLAD_MAKE_VERSION(3, 3)) {
        return hw_fail(HW_GRAPHICS, "%s: OpenGL 3.3 is needed, the driver offers %d.%d",
                       context->backend->name, GLAD_VERSION_MAJOR(version),
                       GLAD_VERSION_MINOR(version));
    }
    const char *renderer = (const char *)glGetString(GL_RENDERER);
    return hw_strdup(&context->renderer, renderer ? renderer : "unknown");
}

hw_status hw_context_create(const hw_context_desc *desc, hw_context **out)
{
    hw_status status = HW_OK;
    hw_context *context = NULL;
    *out = NULL;
    if (context_exists)
        return hw_fail(HW_GRAPHICS, "this process has an OpenGL context already");
    hw_context_desc full = *desc;
    full.width = full.width ? full.width : 1;
    full.height = full.height ? full.height : 1;
    full.samples = full.samples ? full.samples : 1;
    full.title = full.title ? full.title : "Hexwalk";
    HW_GO(HW_NEW(&context, 1));
    context->backend = full.kind == HW_CONTEXT_WINDOW ? &hw_context_glfw : &hw_context_osmesa;
    context->input.width = full.width;
    context->input.height = full.height;
    HW_GO(context->backend->create(&full, &context->state));
    HW_GO(load_gl(context));
    context_exists = true;
    *out = context;
    context = NULL;
out:
    if (context && context->state)
        context->backend->destroy(context->state);
    if (context)
        hw_free(context->renderer);
    hw_free(context);
    return status;
}

void hw_context_destroy(hw_context *context)
{
    if (!context)
        return;
    context->backend->destroy(context->state);
    hw_free(context->renderer);
    hw_free(context);
    context_exists = false;
}

void hw_context_present(hw_context *context, hw_input *input)
{
    hw_input *last = &context->input;
    for (int i = 0; i < HW_KEY_COUNT; i++)
        last->pressed[i] = false;
    last->mouse_dx = last->mouse_dy = 0;
    last->ahead = last->right = last->up = last->turn = last->pitch = 0;
    context->backend->present(context->state, last);
    if (input)
        *input = *last;
}

void hw_context_set_title(hw_context *context, const char *title)
{
    context->backend->set_title(context->state, title);
}

void hw_context_toggle_fullscreen(hw_context *context)
{
    if (context->backend->toggle_fullscreen)
        context->backend->toggle_fullscreen(context->state);
}

const char *hw_context_clipboard(hw_context *context)
{
    return context->backend->clipboard ? context->backend->clipboard(context->state) : NULL;
}

void hw_context_set_clipboard(hw_context *context, const char *text)
{
    if (context->backend->set_clipboard)
        context->backend->set_clipboard(context->state, text);
}

const char *hw_context_renderer(const hw_context *context)
{
    return context->renderer;
}
