// Image files and filtered texture look-ups: a C face on OpenImageIO
// (openimageio/image_io.cpp is the only file that includes it), loaded on first use.
#pragma once
#include "image.h"

// Reads any format OpenImageIO knows into 8 bits; gray stays 1 channel, others become 3 or 4 as
// stored. Errors name the path.
HW_MUST_USE hw_status hw_image_read(const char *path, hw_image *out);
// From memory (embedded GLB textures); `name` is for messages.
HW_MUST_USE hw_status hw_image_decode(const char *name, const void *bytes, size_t size,
                                      hw_image *out);
// Writes PNG, JPEG, ... by the extension; atomically (temporary name, rename).
HW_MUST_USE hw_status hw_image_write(const char *path, const hw_image *image);
// The colours alone of an image with alpha: in frames it marks objects, which a picture need not.
HW_MUST_USE hw_status hw_image_write_opaque(const char *path, const hw_image *rgba);
// Encodes as PNG into memory; *bytes freed with hw_free.
HW_MUST_USE hw_status hw_image_encode_png(const hw_image *image, uint8_t **bytes, size_t *size);
// The same as JPEG (alpha is left out; full chroma resolution). quality: 1 to 100.
HW_MUST_USE hw_status hw_image_encode_jpeg(const hw_image *image, int quality, uint8_t **bytes,
                                           size_t *size);

// Filtered look-ups (OpenImageIO's texture system: mip-mapped, anisotropic, wrap = repeat).
typedef struct hw_sampler hw_sampler;
// Copies the image into the texture system; thread-safe look-ups afterwards.
HW_MUST_USE hw_status hw_sampler_create(hw_sampler **out, const hw_image *image);
void hw_sampler_destroy(hw_sampler *sampler);
// Colour in [0, 1] at (u, v) (v = 0 is the top row, as in glTF) filtered over the parallelogram of
// the two derivatives of (u, v).
void hw_sampler_lookup(const hw_sampler *sampler, float u, float v, const float dx[2],
                       const float dy[2], float rgb[3]);
