// Off-screen contexts: OSMesa renders into a block of memory and needs no display. Frames are drawn
// into framebuffer objects (target.c); the block is only the default framebuffer.
#include "alloc.h"
#include "context_internal.h"
#include "system.h"
#include <GL/osmesa.h>
#include <malloc.h>

#define KEPT_BYTES (8 << 20)

typedef struct osmesa_state {
    OSMesaContext context;
    uint8_t *pixels;
} osmesa_state;

static void osmesa_destroy(void *state)
{
    osmesa_state *s = state;
    OSMesaMakeCurrent(NULL, NULL, 0, 0, 0);
    if (s->context)
        OSMesaDestroyContext(s->context);
    hw_free(s->pixels);
    hw_free(s);
}

static hw_status osmesa_create(const hw_context_desc *desc, void **state)
{
    static const int attributes[] = {OSMESA_FORMAT,
                                     OSMESA_RGBA,
                                     OSMESA_DEPTH_BITS,
                                     24,
                                     OSMESA_STENCIL_BITS,
                                     0,
                                     OSMESA_PROFILE,
                                     OSMESA_CORE_PROFILE,
                                     OSMESA_CONTEXT_MAJOR_VERSION,
                                     3,
                                     OSMESA_CONTEXT_MINOR_VERSION,
                                     3,
                                     0};
    hw_status status = HW_OK;
    osmesa_state *s = NULL;
    // Software GL keeps textures and buffers in the process's heap. By default glibc raises the
    // size from which it maps blocks of their own with every large block freed, and a walk that
    // loads and drops cells would tear the heap to pieces: 40 MB after a minute. With textures and
    // buffers mapped one by one it stays whole, and what is freed is gone.
    hw_memory_map_blocks();
#ifdef __GLIBC__
    mallopt(M_TRIM_THRESHOLD, KEPT_BYTES);
#endif
    HW_GO(HW_NEW(&s, 1));
    HW_GO(hw_alloc((void **)&s->pixels, (size_t)desc->width * 4, desc->height));
    s->context = OSMesaCreateContextAttribs(attributes, NULL);
    if (!s->context) {
        status = hw_fail(HW_GRAPHICS, "osmesa: no OpenGL 3.3 core context");
        goto out;
    }
    if (!OSMesaMakeCurrent(s->context, s->pixels, GL_UNSIGNED_BYTE, (GLsizei)desc->width,
                           (GLsizei)desc->height)) {
        status = hw_fail(HW_GRAPHICS, "osmesa: cannot draw into %u x %u pixels", desc->width,
                         desc->height);
        goto out;
    }
    *state = s;
    s = NULL;
out:
    if (s)
        osmesa_destroy(s);
    return status;
}

static void (*osmesa_proc_address(const char *name))(void)
{
    return OSMesaGetProcAddress(name);
}

static void osmesa_present(void *state, hw_input *input)
{
    (void)state;
    (void)input;
}

static void osmesa_set_title(void *state, const char *title)
{
    (void)state;
    (void)title;
}

const hw_context_backend hw_context_osmesa = {
    .name = "osmesa",
    .create = osmesa_create,
    .destroy = osmesa_destroy,
    .proc_address = osmesa_proc_address,
    .present = osmesa_present,
    .set_title = osmesa_set_title,
};
