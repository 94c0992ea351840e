#include "bytes.h"
#include "alloc.h"
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

hw_bytes_reader hw_bytes_reader_make(const void *data, size_t size)
{
    return (hw_bytes_reader){.data = data, .size = size};
}

size_t hw_bytes_left(const hw_bytes_reader *r)
{
    return r->failed ? 0 : r->size - r->position;
}

const uint8_t *hw_get_span(hw_bytes_reader *r, size_t size)
{
    if (r->failed || size > r->size - r->position) {
        r->failed = true;
        return NULL;
    }
    // An empty span of an empty reader is still a valid pointer: NULL means failure.
    static const uint8_t nothing[1];
    const uint8_t *span = r->data ? r->data + r->position : nothing;
    r->position += size;
    return span;
}

void hw_get_bytes(hw_bytes_reader *r, void *out, size_t size)
{
    if (size == 0)
        return;
    const uint8_t *span = hw_get_span(r, size);
    if (span)
        memcpy(out, span, size);
    else
        memset(out, 0, size);
}

static uint64_t get_little_endian(hw_bytes_reader *r, size_t size)
{
    const uint8_t *p = hw_get_span(r, size);
    uint64_t v = 0;
    for (size_t i = 0; p && i < size; i++)
        v |= (uint64_t)p[i] << (8 * i);
    return v;
}

uint8_t hw_get_u8(hw_bytes_reader *r)
{
    return (uint8_t)get_little_endian(r, 1);
}

uint16_t hw_get_u16(hw_bytes_reader *r)
{
    return (uint16_t)get_little_endian(r, 2);
}

uint32_t hw_get_u32(hw_bytes_reader *r)
{
    return (uint32_t)get_little_endian(r, 4);
}

uint64_t hw_get_u64(hw_bytes_reader *r)
{
    return get_little_endian(r, 8);
}

int32_t hw_get_i32(hw_bytes_reader *r)
{
    return (int32_t)hw_get_u32(r);
}

float hw_get_f32(hw_bytes_reader *r)
{
    uint32_t bits = hw_get_u32(r);
    float v;
    memcpy(&v, &bits, sizeof v);
    return v;
}

double hw_get_f64(hw_bytes_reader *r)
{
    uint64_t bits = hw_get_u64(r);
    double v;
    memcpy(&v, &bits, sizeof v);
    return v;
}

void hw_put_bytes(hw_bytes_writer *w, const void *data, size_t size)
{
    if (w->failed || size == 0)
        return;
    size_t needed;
    if (__builtin_add_overflow(w->size, size, &needed) ||
        HW_RESERVE(&w->data, &w->capacity, needed) != HW_OK) {
        w->failed = true;
        return;
    }
    memcpy(w->data + w->size, data, size);
    w->size = needed;
}

static void put_little_endian(hw_bytes_writer *w, uint64_t v, size_t size)
{
    uint8_t bytes[8];
    for (size_t i = 0; i < size; i++)
        bytes[i] = (uint8_t)(v >> (8 * i));
    hw_put_bytes(w, bytes, size);
}

void hw_put_u8(hw_bytes_writer *w, uint8_t v)
{
    put_little_endian(w, v, 1);
}

void hw_put_u16(hw_bytes_writer *w, uint16_t v)
{
    put_little_endian(w, v, 2);
}

void hw_put_u32(hw_bytes_writer *w, uint32_t v)
{
    put_little_endian(w, v, 4);
}

void hw_put_u64(hw_bytes_writer *w, uint64_t v)
{
    put_little_endian(w, v, 8);
}

void hw_put_i32(hw_bytes_writer *w, int32_t v)
{
    put_little_endian(w, (uint32_t)v, 4);
}

void hw_put_f32(hw_bytes_writer *w, float v)
{
    uint32_t bits;
    memcpy(&bits, &v, sizeof bits);
    put_little_endian(w, bits, 4);
}

void hw_put_f64(hw_bytes_writer *w, double v)
{
    uint64_t bits;
    memcpy(&bits, &v, sizeof bits);
    put_little_endian(w, bits, 8);
}

void hw_put_format(hw_bytes_writer *w, const char *format, ...)
{
    char text[1024];
    va_list arguments;
    va_start(arguments, format);
    int n = vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (n < 0 || (size_t)n >= sizeof text)
        w->failed = true;
    else
        hw_put_bytes(w, text, (size_t)n);
}

hw_status hw_bytes_writer_check(const hw_bytes_writer *w)
{
    return w->failed ? hw_fail(HW_MEMORY, "out of memory after %zu bytes of output", w->size)
                     : HW_OK;
}

void hw_bytes_writer_free(hw_bytes_writer *w)
{
    hw_free(w->data);
    *w = (hw_bytes_writer){0};
}
