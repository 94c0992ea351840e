#include "target.h"
#include "alloc.h"
#include "gpu.h"
#include <assert.h>

struct hw_target {
    uint32_t width, height, samples;
    GLuint draw_framebuffer, draw_color, depth;
    GLuint read_framebuffer, read_color; // the same as the draw ones with one sample
};

static GLuint make_storage(GLenum format, const hw_target *target, uint32_t samples)
{
    GLuint name = 0;
    glGenRenderbuffers(1, &name);
    glBindRenderbuffer(GL_RENDERBUFFER, name);
    if (samples > 1) {
        glRenderbufferStorageMultisample(GL_RENDERBUFFER, (GLsizei)samples, format,
                                         (GLsizei)target->width, (GLsizei)target->height);
    } else {
        glRenderbufferStorage(GL_RENDERBUFFER, format, (GLsizei)target->width,
                              (GLsizei)target->height);
    }
    return name;
}

static hw_status make_framebuffer(GLuint color, GLuint depth, GLuint *out)
{
    glGenFramebuffers(1, out);
    glBindFramebuffer(GL_FRAMEBUFFER, *out);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, color);
    if (depth) {
        glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth);
    }
    GLenum state = glCheckFramebufferStatus(GL_FRAMEBUFFER);
    if (state != GL_FRAMEBUFFER_COMPLETE)
        return hw_fail(HW_GRAPHICS, "render target: framebuffer is incomplete (0x%04x)", state);
    return HW_OK;
}

hw_status hw_target_create(hw_target **out, uint32_t width, uint32_t height, uint32_t samples)
{
    assert(samples == 1 || samples == 4);
    hw_status status = HW_OK;
    hw_target *target = NULL;
    GLint limit = 0;
    *out = NULL;
    glGetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &limit);
    if (width == 0 || height == 0 || width > (uint32_t)limit || height > (uint32_t)limit) {
        return hw_fail(HW_GRAPHICS, "a render target of %u x %u pixels; this OpenGL takes up to %d",
                       width, height, limit);
    }
    HW_GO(HW_NEW(&target, 1));
    target->width = width;
    target->height = height;
    target->samples = samples;
    target->draw_color = make_storage(GL_RGBA8, target, samples);
    target->depth = make_storage(GL_DEPTH_COMPONENT24, target, samples);
    HW_GO(hw_gpu_check("render target"));
    HW_GO(make_framebuffer(target->draw_color, target->depth, &target->draw_framebuffer));
    if (samples > 1) {
        target->read_color = make_storage(GL_RGBA8, target, 1);
        HW_GO(make_framebuffer(target->read_color, 0, &target->read_framebuffer));
    }
    HW_GO(hw_gpu_check("render target"));
    *out = target;
    target = NULL;
out:
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    hw_target_destroy(target);
    return status;
}

void hw_target_destroy(hw_target *target)
{
    if (!target)
        return;
    glDeleteFramebuffers(1, &target->draw_framebuffer);
    glDeleteFramebuffers(1, &target->read_framebuffer);
    glDeleteRenderbuffers(1, &target->draw_color);
    glDeleteRenderbuffers(1, &target->read_color);
    glDeleteRenderbuffers(1, &target->depth);
    hw_free(target);
}

void hw_target_bind(hw_target *target)
{
    glBindFramebuffer(GL_FRAMEBUFFER, target->draw_framebuffer);
    glViewport(0, 0, (GLsizei)target->width, (GLsizei)target->height);
}

void hw_target_resolve(hw_target *target)
{
    if (target->samples == 1)
        return;
    GLint width = (GLint)target->width, height = (GLint)target->height;
    glBindFramebuffer(GL_READ_FRAMEBUFFER, target->draw_framebuffer);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, target->read_framebuffer);
    glBlitFramebuffer(0, 0, width, height, 0, 0, width, height, GL_COLOR_BUFFER_BIT, GL_NEAREST);
    glBindFramebuffer(GL_FRAMEBUFFER, target->draw_framebuffer);
}

// For reading.
static void bind_resolved(hw_target *target)
{
    hw_target_resolve(target);
    bool resolved = target->samples > 1;
    glBindFramebuffer(GL_READ_FRAMEBUFFER,
                      resolved ? target->read_framebuffer : target->draw_framebuffer);
}

void hw_target_copy(hw_target *target, uint32_t texture)
{
    bind_resolved(target);
    glBindTexture(GL_TEXTURE_2D, texture);
    glCopyTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, 0, 0, (GLsizei)target->width,
                        (GLsizei)target->height);
    glBindTexture(GL_TEXTURE_2D, 0);
    glBindFramebuffer(GL_FRAMEBUFFER, target->draw_framebuffer);
}

hw_status hw_target_read(hw_target *target, hw_image *out)
{
    if (!out->data)
        HW_TRY(hw_image_make(out, target->width, target->height, 4));
    assert(out->width == target->width && out->height == target->height && out->channels == 4);
    bind_resolved(target);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glReadPixels(0, 0, (GLsizei)target->width, (GLsizei)target->height, GL_RGBA, GL_UNSIGNED_BYTE,
                 out->data);
    glBindFramebuffer(GL_FRAMEBUFFER, target->draw_framebuffer);
    hw_image_flip(out);
    return hw_gpu_check("reading a render target");
}
