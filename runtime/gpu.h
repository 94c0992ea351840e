// Thin helpers over GL objects: programs from embedded shaders, buffers, textures, and the count of
// the bytes they hold. GL thread only. Renderers include this; nobody outside runtime does.
#pragma once
#include "image.h"
#include "status.h"
#include <glad/gl.h>
#include <stdbool.h>
#include <stdint.h>

// Bytes of GL objects that one renderer holds.
typedef struct hw_gpu_account {
    uint64_t bytes, bytes_peak;
} hw_gpu_account;

// HW_GRAPHICS with GL's error code if a GL call has failed since the last check; `what` says what
// was being done.
HW_MUST_USE hw_status hw_gpu_check(const char *what);

// Compiles and links. Both stages get the common prefix: the #version line, `defines` (NULL or
// lines "#define X\n"), the constants of appearance.h, and, for vertex shaders, shading.glsl.
// HW_GRAPHICS holds the driver's log; `name` is for messages. Delete with glDeleteProgram.
HW_MUST_USE hw_status hw_gpu_program(const char *name, const char *defines, const char *vertex,
                                     const char *fragment, GLuint *out);
// To be called when programs have been made and no more are expected soon: a hint to free what
// compiling needs, which in Mesa is megabytes. They can be made all the same.
void hw_gpu_release_compiler(void);

typedef struct hw_gpu_buffer {
    GLuint name; // 0 = none
    uint64_t bytes;
} hw_gpu_buffer;

// A buffer with `bytes` bytes (data NULL: undefined contents), left bound to `target`. usage:
// GL_STATIC_DRAW, ... Bind the vertex array first when target is GL_ELEMENT_ARRAY_BUFFER.
HW_MUST_USE hw_status hw_gpu_buffer_create(hw_gpu_account *account, GLenum target, const void *data,
                                           uint64_t bytes, GLenum usage, hw_gpu_buffer *out);
void hw_gpu_buffer_destroy(hw_gpu_account *account, hw_gpu_buffer *buffer);

typedef struct hw_gpu_texture {
    GLuint name; // 0 = none
    uint64_t bytes;
} hw_gpu_texture;

// Repeating, mip-mapped, trilinear, from an image of 1, 3 or 4 channels; image row 0 becomes v = 0.
HW_MUST_USE hw_status hw_gpu_texture_create(hw_gpu_account *account, const hw_image *image,
                                            hw_gpu_texture *out);
// The same with contents to come, level 0 first, then the mipmaps.
HW_MUST_USE hw_status hw_gpu_texture_create_empty(hw_gpu_account *account, uint32_t width,
                                                  uint32_t height, hw_gpu_texture *out);
// Bilinear, clamped, without mipmaps, of BC3 blocks or RGBA (sides multiples of 4), with contents
// to come; row 0 is v = 0.
HW_MUST_USE hw_status hw_gpu_atlas_create(hw_gpu_account *account, uint32_t width, uint32_t height,
                                          bool blocks, hw_gpu_texture *out);
// Bytes of an atlas on the GPU.
uint64_t hw_gpu_atlas_bytes(uint32_t width, uint32_t height, bool blocks);
// Whether the GL has textures of BC3 blocks, and whether they are as fast as RGBA: software GL
// loses 5 % of a frame to decoding them, but needs a quarter of the memory.
bool hw_gpu_has_blocks(void);
bool hw_gpu_has_fast_blocks(void);
void hw_gpu_texture_destroy(hw_gpu_account *account, hw_gpu_texture *texture);

// Whether GL runs on the processor (llvmpipe, softpipe, swrast).
bool hw_gpu_is_software(void);
// Software GL collects a frame's triangles on the calling thread and rasterises them on others once
// it is flushed. Flushing now and then lets both go on at the same time: a fifth to a quarter off a
// frame on two processors. What is collected takes some 400 bytes a triangle until it is
// rasterised, so that no more than a few pieces may wait for it, where a whole frame would: a flush
// waits for the one HW_GPU_PACE_PIECES before. Zero-initialise and end per frame; does nothing on
// hardware.
#define HW_GPU_PACE_TRIANGLES 5000u // of a piece
#define HW_GPU_PACE_PIECES    3u
typedef struct hw_gpu_pace {
    uint32_t triangles, flush_count;    // triangles since the last flush
    GLsync flushed[HW_GPU_PACE_PIECES]; // signalled when what a flush handed over is rasterised
} hw_gpu_pace;
void hw_gpu_pace_add(hw_gpu_pace *pace, uint32_t triangles);
// At once (after the clear, which fills the whole target).
void hw_gpu_pace_flush(hw_gpu_pace *pace);
// Flushes nothing, waits for nothing.
void hw_gpu_pace_end(hw_gpu_pace *pace);

// Image of 1, 3 or 4 channels into RGBA (alpha 255) of 4 bytes a pixel. No GL.
void hw_gpu_expand_rgba(const hw_image *image, uint8_t *rgba);

// Indices take 2 bytes each where the number of vertices allows it, else 4. No GL.
uint32_t hw_gpu_index_bytes(uint32_t vertex_count);
void hw_gpu_pack_indices(const uint32_t *indices, uint32_t count, uint32_t index_bytes,
                         uint8_t *out);
GLenum hw_gpu_index_type(uint32_t index_bytes);

// A byte offset as GL wants it.
const void *hw_gpu_offset(size_t bytes);
