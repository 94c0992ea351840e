#include "gpu.h"
#include "alloc.h"
#include "appearance.h"
#include "block.h"
#include "shaders.h"
#include <stdio.h>
#include <string.h>

#define STRINGIZE(x) #x
#define VALUE(x)     STRINGIZE(x)
#define CONSTANT(x)  "#define " #x " " VALUE(x) "\n"

#define PACE_WAIT_NS 1000000000u // longer, and the memory is spent

// The constants exist once, in appearance.h. (In GLSL ES the first line would be
// "#version 300 es\nprecision highp float;".)
static const char version_line[] = "#version 330 core\n";
static const char constants[] = CONSTANT(HW_LIGHT_X) CONSTANT(HW_LIGHT_Y) CONSTANT(HW_LIGHT_Z)
    CONSTANT(HW_LIGHT_DIRECTIONAL) CONSTANT(HW_LIGHT_AMBIENT);

hw_status hw_gpu_check(const char *what)
{
    GLenum error = glGetError();
    if (error == GL_NO_ERROR)
        return HW_OK;
    // A lost context reports errors for ever: take a few, not all.
    for (int i = 0; i < 8 && glGetError() != GL_NO_ERROR; i++)
        ;
    return hw_fail(error == GL_OUT_OF_MEMORY ? HW_MEMORY : HW_GRAPHICS, "%s: OpenGL error 0x%04x",
                   what, error);
}

static hw_status compile(const char *name, GLenum stage, const char *defines, const char *source,
                         GLuint *out)
{
    bool is_vertex = stage == GL_VERTEX_SHADER;
    const char *parts[] = {version_line, defines ? defines : "", constants,
                           is_vertex ? hw_shader_shading_glsl : hw_shader_dissolve_glsl, source};
    GLuint shader = glCreateShader(stage);
    glShaderSource(shader, sizeof parts / sizeof *parts, parts, NULL);
    glCompileShader(shader);
    GLint compiled = GL_FALSE;
    glGetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
    if (!compiled) {
        char log[768] = "";
        glGetShaderInfoLog(shader, sizeof log, NULL, log);
        glDeleteShader(shader);
        return hw_fail(HW_GRAPHICS, "%s.%s: %s", name, is_vertex ? "vert" : "frag", log);
    }
    *out = shader;
    return HW_OK;
}

hw_status hw_gpu_program(const char *name, const char *defines, const char *vertex,
                         const char *fragment, GLuint *out)
{
    hw_status status = HW_OK;
    GLuint shaders[2] = {0, 0}, program = 0;
    *out = 0;
    HW_GO(compile(name, GL_VERTEX_SHADER, defines, vertex, &shaders[0]));
    HW_GO(compile(name, GL_FRAGMENT_SHADER, defines, fragment, &shaders[1]));
    program = glCreateProgram();
    glAttachShader(program, shaders[0]);
    glAttachShader(program, shaders[1]);
    glLinkProgram(program);
    GLint linked = GL_FALSE;
    glGetProgramiv(program, GL_LINK_STATUS, &linked);
    if (!linked) {
        char log[768] = "";
        glGetProgramInfoLog(program, sizeof log, NULL, log);
        status = hw_fail(HW_GRAPHICS, "%s: %s", name, log);
        goto out;
    }
    // A shader that stays attached lives as long as its program: megabytes of Mesa's.
    glDetachShader(program, shaders[0]);
    glDetachShader(program, shaders[1]);
    *out = program;
    program = 0;
out:
    // GL ignores the name 0.
    glDeleteShader(shaders[0]);
    glDeleteShader(shaders[1]);
    glDeleteProgram(program);
    return status;
}

void hw_gpu_release_compiler(void)
{
    if (GLAD_GL_ARB_ES2_compatibility)
        glReleaseShaderCompiler();
}

static void account_add(hw_gpu_account *account, uint64_t bytes)
{
    account->bytes += bytes;
    if (account->bytes > account->bytes_peak)
        account->bytes_peak = account->bytes;
}

hw_status hw_gpu_buffer_create(hw_gpu_account *account, GLenum target, const void *data,
                               uint64_t bytes, GLenum usage, hw_gpu_buffer *out)
{
    *out = (hw_gpu_buffer){0};
    glGenBuffers(1, &out->name);
    glBindBuffer(target, out->name);
    glBufferData(target, (GLsizeiptr)bytes, data, usage);
    out->bytes = bytes;
    account_add(account, bytes);
    hw_status status = hw_gpu_check("buffer");
    if (status != HW_OK)
        hw_gpu_buffer_destroy(account, out);
    return status;
}

void hw_gpu_buffer_destroy(hw_gpu_account *account, hw_gpu_buffer *buffer)
{
    if (buffer->name) {
        glDeleteBuffers(1, &buffer->name);
        account->bytes -= buffer->bytes;
    }
    *buffer = (hw_gpu_buffer){0};
}

static void texture_begin(hw_gpu_texture *out, GLint wrap, GLint min_filter)
{
    glGenTextures(1, &out->name);
    glBindTexture(GL_TEXTURE_2D, out->name);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, wrap);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, wrap);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, min_filter);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
}

static hw_status texture_end(hw_gpu_account *account, uint64_t bytes, hw_gpu_texture *out)
{
    out->bytes = bytes;
    account_add(account, bytes);
    hw_status status = hw_gpu_check("texture");
    if (status != HW_OK)
        hw_gpu_texture_destroy(account, out);
    return status;
}

// Sides must be what the GL allows.
static hw_status check_size(uint32_t width, uint32_t height)
{
    GLint limit = 0;
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &limit);
    if (width == 0 || height == 0 || width > (uint32_t)limit || height > (uint32_t)limit) {
        return hw_fail(HW_GRAPHICS, "a texture of %u x %u pixels; this OpenGL takes up to %d",
                       width, height, limit);
    }
    return HW_OK;
}

// Swizzles are no part of WebGL: gray becomes RGBA.
void hw_gpu_expand_rgba(const hw_image *image, uint8_t *rgba)
{
    size_t pixels = (size_t)image->width * image->height;
    for (size_t i = 0; i < pixels; i++) {
        const uint8_t *p = image->data + i * image->channels;
        uint32_t step = image->channels >= 3;
        rgba[i * 4] = p[0];
        rgba[i * 4 + 1] = p[step];
        rgba[i * 4 + 2] = p[2 * step];
        rgba[i * 4 + 3] = 255;
    }
}

static hw_status create_repeating(hw_gpu_account *account, uint32_t width, uint32_t height,
                                  const uint8_t *rgba, hw_gpu_texture *out)
{
    *out = (hw_gpu_texture){0};
    HW_TRY(check_size(width, height));
    texture_begin(out, GL_REPEAT, GL_LINEAR_MIPMAP_LINEAR);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, (GLsizei)width, (GLsizei)height, 0, GL_RGBA,
                 GL_UNSIGNED_BYTE, rgba);
    if (rgba)
        glGenerateMipmap(GL_TEXTURE_2D);
    return texture_end(account, (uint64_t)width * height * 4 * 4 / 3, out);
}

hw_status hw_gpu_texture_create(hw_gpu_account *account, const hw_image *image, hw_gpu_texture *out)
{
    uint8_t *rgba = NULL;
    *out = (hw_gpu_texture){0};
    HW_TRY(hw_alloc((void **)&rgba, (size_t)image->width * image->height, 4));
    hw_gpu_expand_rgba(image, rgba);
    hw_status status = create_repeating(account, image->width, image->height, rgba, out);
    hw_free(rgba);
    return status;
}

hw_status hw_gpu_texture_create_empty(hw_gpu_account *account, uint32_t width, uint32_t height,
                                      hw_gpu_texture *out)
{
    return create_repeating(account, width, height, NULL, out);
}

bool hw_gpu_has_blocks(void)
{
    return GLAD_GL_EXT_texture_compression_s3tc != 0;
}

bool hw_gpu_has_fast_blocks(void)
{
    return hw_gpu_has_blocks() && !hw_gpu_is_software();
}

uint64_t hw_gpu_atlas_bytes(uint32_t width, uint32_t height, bool blocks)
{
    return blocks ? hw_bc3_bytes(width, height) : (uint64_t)width * height * 4;
}

hw_status hw_gpu_atlas_create(hw_gpu_account *account, uint32_t width, uint32_t height, bool blocks,
                              hw_gpu_texture *out)
{
    *out = (hw_gpu_texture){0};
    HW_TRY(check_size(width, height));
    uint64_t bytes = hw_gpu_atlas_bytes(width, height, blocks);
    texture_begin(out, GL_CLAMP_TO_EDGE, GL_LINEAR);
    if (blocks)
        glCompressedTexImage2D(GL_TEXTURE_2D, 0, GL_COMPRESSED_RGBA_S3TC_DXT5_EXT, (GLsizei)width,
                               (GLsizei)height, 0, (GLsizei)bytes, NULL);
    else
        glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, (GLsizei)width, (GLsizei)height, 0, GL_RGBA,
                     GL_UNSIGNED_BYTE, NULL);
    return texture_end(account, bytes, out);
}

void hw_gpu_texture_destroy(hw_gpu_account *account, hw_gpu_texture *texture)
{
    if (texture->name) {
        glDeleteTextures(1, &texture->name);
        account->bytes -= texture->bytes;
    }
    *texture = (hw_gpu_texture){0};
}

bool hw_gpu_is_software(void)
{
    const char *renderer = (const char *)glGetString(GL_RENDERER);
    return renderer && (strstr(renderer, "llvmpipe") || strstr(renderer, "softpipe") ||
                        strstr(renderer, "swrast") || strstr(renderer, "SwiftShader"));
}

void hw_gpu_pace_add(hw_gpu_pace *pace, uint32_t triangles)
{
    pace->triangles += triangles;
    if (pace->triangles >= HW_GPU_PACE_TRIANGLES)
        hw_gpu_pace_flush(pace);
}

void hw_gpu_pace_flush(hw_gpu_pace *pace)
{
    pace->triangles = 0;
    if (!hw_gpu_is_software())
        return;
    GLsync *oldest = &pace->flushed[pace->flush_count++ % HW_GPU_PACE_PIECES];
    if (*oldest) {
        (void)glClientWaitSync(*oldest, 0, PACE_WAIT_NS);
        glDeleteSync(*oldest);
    }
    *oldest = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    glFlush();
}

void hw_gpu_pace_end(hw_gpu_pace *pace)
{
    for (uint32_t i = 0; i < HW_GPU_PACE_PIECES; i++)
        if (pace->flushed[i])
            glDeleteSync(pace->flushed[i]);
    *pace = (hw_gpu_pace){0};
}

uint32_t hw_gpu_index_bytes(uint32_t vertex_count)
{
    return vertex_count <= UINT16_MAX ? 2 : 4;
}

void hw_gpu_pack_indices(const uint32_t *indices, uint32_t count, uint32_t index_bytes,
                         uint8_t *out)
{
    if (index_bytes == 4) {
        memcpy(out, indices, (size_t)count * 4);
        return;
    }
    for (uint32_t i = 0; i < count; i++) {
        uint16_t small = (uint16_t)indices[i];
        memcpy(out + (size_t)i * 2, &small, 2);
    }
}

GLenum hw_gpu_index_type(uint32_t index_bytes)
{
    return index_bytes == 2 ? GL_UNSIGNED_SHORT : GL_UNSIGNED_INT;
}

const void *hw_gpu_offset(size_t bytes)
{
    return (const char *)0 + bytes;
}
