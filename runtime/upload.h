// Data on its way into GL objects, in pieces of a few KiB to a few hundred, so that a frame spends
// on it no more than it has to spare. GL thread only; never allocates.
#pragma once
#include "gpu.h"
#include <stdbool.h>

// What a texture's data are.
typedef enum hw_upload_format {
    HW_UPLOAD_RGBA,           // mipmaps are made at the end
    HW_UPLOAD_BLOCKS,         // BC3, for a texture of BC3
    HW_UPLOAD_DECODED_BLOCKS, // BC3, for a texture of RGBA
} hw_upload_format;

typedef struct hw_upload_part {
    GLuint buffer, texture; // one of them is not 0
    const uint8_t *data;    // of the buffer from its start, or of the texture from its first row
    uint64_t bytes;         // on the GPU
    uint32_t width, height; // of a texture
    hw_upload_format format;
} hw_upload_part;

#define HW_UPLOAD_PARTS     4u
#define HW_UPLOAD_WIDTH_MAX 8192u // of decoded blocks

// Zero-initialise.
typedef struct hw_upload {
    hw_upload_part parts[HW_UPLOAD_PARTS];
    uint32_t part_count, part;
    uint64_t done; // of the current part, bytes
} hw_upload;

// Parts of 0 bytes are left out.
void hw_upload_add(hw_upload *upload, hw_upload_part part);
// Sends at most *budget_bytes and takes them off it. The smallest piece of a texture is a row of
// pixels or blocks: HW_UPLOAD_BUDGET_MIN suffices for any atlas. True once all is there.
#define HW_UPLOAD_BUDGET_MIN (HW_UPLOAD_WIDTH_MAX * 16u)
bool hw_upload_run(hw_upload *upload, uint64_t *budget_bytes);
