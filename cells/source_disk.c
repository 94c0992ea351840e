// Files of a folder.
#include "alloc.h"
#include "file.h"
#include "source_internal.h"

#define PIECE_BYTES ((size_t)64 << 10) // between looks at the limit of bandwidth

static hw_status read_pieces(hw_fetch *f, const hw_reader *reader)
{
    hw_block *b = &f->block;
    for (size_t done = 0; done < b->size;) {
        size_t left = b->size - done, piece = left < PIECE_BYTES ? left : PIECE_BYTES;
        HW_TRY(hw_reader_at(reader, f->offset + done, b->data + done, piece));
        done += piece;
        if (!hw_fetch_pace(f, piece))
            return hw_fail(HW_INTERRUPTED, "%s: cancelled", f->path);
    }
    return HW_OK;
}

static hw_status read_file(void *connection, hw_fetch *f)
{
    hw_status status = HW_OK;
    hw_reader *reader = NULL;
    (void)connection;
    HW_TRY(hw_reader_open(&reader, f->path));
    uint64_t all = hw_reader_size(reader);
    if (f->offset > all) {
        status = hw_fail(HW_FORMAT, "%s: truncated: %llu bytes", f->path, (unsigned long long)all);
        goto out;
    }
    uint64_t size = f->size && f->size < all - f->offset ? f->size : all - f->offset;
    if (size > HW_SOURCE_FILE_MAX) {
        status =
            hw_fail(HW_LIMIT, "%s: %llu bytes are too many", f->path, (unsigned long long)size);
        goto out;
    }
    HW_GO(HW_NEW(&f->block.data, (size_t)size + 1));
    f->block.size = (size_t)size;
    f->block.file_bytes = all;
    HW_GO(read_pieces(f, reader));
out:
    hw_reader_close(reader);
    return status;
}

const hw_source_backend hw_source_disk = {.read = read_file};
