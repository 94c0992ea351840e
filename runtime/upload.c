#include "upload.h"
#include "block.h"
#include <assert.h>

void hw_upload_add(hw_upload *upload, hw_upload_part part)
{
    assert(upload->part_count < HW_UPLOAD_PARTS);
    if (part.bytes > 0)
        upload->parts[upload->part_count++] = part;
}

// GL_COPY_WRITE_BUFFER: no binding that anything draws with.
static void send_bytes(const hw_upload_part *p, uint64_t offset, uint64_t bytes)
{
    glBindBuffer(GL_COPY_WRITE_BUFFER, p->buffer);
    glBufferSubData(GL_COPY_WRITE_BUFFER, (GLintptr)offset, (GLsizeiptr)bytes, p->data + offset);
    glBindBuffer(GL_COPY_WRITE_BUFFER, 0);
}

// Bytes of what is sent at least: a row of pixels, or of blocks.
static uint64_t row_bytes(const hw_upload_part *p)
{
    switch (p->format) {
    case HW_UPLOAD_BLOCKS:
        return hw_bc3_bytes(p->width, 4);
    case HW_UPLOAD_DECODED_BLOCKS:
        return (uint64_t)p->width * 16;
    default:
        return (uint64_t)p->width * 4;
    }
}

static void send_pixels(const hw_upload_part *p, uint64_t row, uint64_t rows, const uint8_t *rgba)
{
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, (GLint)row, (GLsizei)p->width, (GLsizei)rows, GL_RGBA,
                    GL_UNSIGNED_BYTE, rgba);
}

static void send_decoded(const hw_upload_part *p, uint64_t row)
{
    static uint8_t rgba[HW_UPLOAD_WIDTH_MAX * 16]; // of the GL thread
    hw_bc3_decode(p->data + row * hw_bc3_bytes(p->width, 4), p->width, 4, rgba);
    send_pixels(p, row * 4, 4, rgba);
}

static void send_rows(const hw_upload_part *p, uint64_t first, uint64_t rows)
{
    uint64_t row = row_bytes(p);
    glBindTexture(GL_TEXTURE_2D, p->texture);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    if (p->format == HW_UPLOAD_BLOCKS)
        glCompressedTexSubImage2D(GL_TEXTURE_2D, 0, 0, (GLint)first * 4, (GLsizei)p->width,
                                  (GLsizei)rows * 4, GL_COMPRESSED_RGBA_S3TC_DXT5_EXT,
                                  (GLsizei)(rows * row), p->data + first * row);
    else if (p->format == HW_UPLOAD_RGBA)
        send_pixels(p, first, rows, p->data + first * row);
    else
        for (uint64_t i = first; i < first + rows; i++)
            send_decoded(p, i);
    glBindTexture(GL_TEXTURE_2D, 0);
}

// Bytes sent of the part from `done` on; 0 if the budget is too small for the next.
static uint64_t send_piece(const hw_upload_part *p, uint64_t done, uint64_t budget)
{
    uint64_t left = p->bytes - done, bytes = left < budget ? left : budget;
    if (p->buffer) {
        send_bytes(p, done, bytes);
        return bytes;
    }
    uint64_t row = row_bytes(p), rows = bytes / row;
    if (rows > 0)
        send_rows(p, done / row, rows);
    return rows * row;
}

static void end_part(const hw_upload_part *p)
{
    if (!p->texture || p->format != HW_UPLOAD_RGBA)
        return;
    glBindTexture(GL_TEXTURE_2D, p->texture);
    glGenerateMipmap(GL_TEXTURE_2D);
    glBindTexture(GL_TEXTURE_2D, 0);
}

bool hw_upload_run(hw_upload *upload, uint64_t *budget_bytes)
{
    while (upload->part < upload->part_count) {
        const hw_upload_part *p = &upload->parts[upload->part];
        uint64_t sent = send_piece(p, upload->done, *budget_bytes);
        if (sent == 0)
            return false;
        *budget_bytes -= sent;
        upload->done += sent;
        if (upload->done < p->bytes)
            continue;
        end_part(p);
        upload->part++;
        upload->done = 0;
    }
    return true;
}
