// Bounded little-endian reader and growing writer: the only way bytes of a file become numbers and
// back.
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stdint.h>

// A reader never runs past its end: it then sets `failed`, returns zeros, and stays failed. Check
// once after a group of gets.
typedef struct hw_bytes_reader {
    const uint8_t *data;
    size_t size, position;
    bool failed;
} hw_bytes_reader;

hw_bytes_reader hw_bytes_reader_make(const void *data, size_t size);
uint8_t hw_get_u8(hw_bytes_reader *r);
uint16_t hw_get_u16(hw_bytes_reader *r);
uint32_t hw_get_u32(hw_bytes_reader *r);
uint64_t hw_get_u64(hw_bytes_reader *r);
int32_t hw_get_i32(hw_bytes_reader *r);
float hw_get_f32(hw_bytes_reader *r);
double hw_get_f64(hw_bytes_reader *r);
// Copies `size` bytes to out (zeros on failure).
void hw_get_bytes(hw_bytes_reader *r, void *out, size_t size);
// A pointer into the data, NULL on failure.
const uint8_t *hw_get_span(hw_bytes_reader *r, size_t size);
size_t hw_bytes_left(const hw_bytes_reader *r);

// A writer grows; on exhaustion it sets `failed` and ignores the rest. Zero-initialise; free with
// hw_bytes_writer_free.
typedef struct hw_bytes_writer {
    uint8_t *data;
    size_t size, capacity;
    bool failed;
} hw_bytes_writer;

void hw_put_u8(hw_bytes_writer *w, uint8_t v);
void hw_put_u16(hw_bytes_writer *w, uint16_t v);
void hw_put_u32(hw_bytes_writer *w, uint32_t v);
void hw_put_u64(hw_bytes_writer *w, uint64_t v);
void hw_put_i32(hw_bytes_writer *w, int32_t v);
void hw_put_f32(hw_bytes_writer *w, float v);
void hw_put_f64(hw_bytes_writer *w, double v);
void hw_put_bytes(hw_bytes_writer *w, const void *data, size_t size);
// Formatted text without the final 0; up to 1023 bytes a call, longer text sets `failed`.
void hw_put_format(hw_bytes_writer *w, const char *format, ...) HW_PRINTF(2, 3);
// HW_MEMORY if any put failed.
HW_MUST_USE hw_status hw_bytes_writer_check(const hw_bytes_writer *w);
void hw_bytes_writer_free(hw_bytes_writer *w);
