#include "image.h"
#include "alloc.h"
#include <assert.h>
#include <string.h>

#define SIDE_MAX 32768u

hw_status hw_image_make(hw_image *out, uint32_t width, uint32_t height, uint32_t channels)
{
    assert(channels == 1 || channels == 3 || channels == 4);
    *out = (hw_image){0};
    if (width == 0 || height == 0 || width > SIDE_MAX || height > SIDE_MAX)
        return hw_fail(HW_LIMIT, "an image of %u x %u pixels: sides go from 1 to %u", width, height,
                       SIDE_MAX);
    HW_TRY(hw_alloc((void **)&out->data, (size_t)width * height, channels));
    out->width = width;
    out->height = height;
    out->channels = channels;
    return HW_OK;
}

void hw_image_free(hw_image *image)
{
    if (!image)
        return;
    hw_free(image->data);
    *image = (hw_image){0};
}

static void swap_bytes(uint8_t *a, uint8_t *b, size_t size)
{
    uint8_t buffer[1024];
    while (size > 0) {
        size_t part = size < sizeof buffer ? size : sizeof buffer;
        memcpy(buffer, a, part);
        memcpy(a, b, part);
        memcpy(b, buffer, part);
        a += part;
        b += part;
        size -= part;
    }
}

void hw_image_flip(hw_image *image)
{
    size_t row = (size_t)image->width * image->channels;
    for (uint32_t y = 0; y < image->height / 2; y++)
        swap_bytes(image->data + y * row, image->data + (image->height - 1 - y) * row, row);
}
