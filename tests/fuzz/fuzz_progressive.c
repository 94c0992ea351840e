// Progressive meshes behind their container: the chunks HEAD, BASE, two for each block, LOOS, ORDR;
// for each its size (u32) and its bytes.
#include "bytes.h"
#include "fuzz_target.h"
#include "hash.h"
#include "progressive_codec.h"
#include <stdlib.h>
#include <string.h>

bool fuzz_accepted;

typedef struct chunk {
    uint8_t *data;
    size_t size;
} chunk;

// A block of its own, so that a sanitizer sees a read beyond the end of the chunk.
static chunk take(hw_bytes_reader *r)
{
    chunk c = {NULL, hw_get_u32(r)};
    if (c.size > hw_bytes_left(r))
        c.size = hw_bytes_left(r);
    c.data = malloc(c.size ? c.size : 1);
    if (!c.data)
        abort();
    hw_get_bytes(r, c.data, c.size);
    return c;
}

static hw_status get_block(hw_progressive_reader *reader, uint32_t block, hw_bytes_reader *r)
{
    chunk a = take(r), b = take(r);
    const uint8_t *const bytes[2] = {a.data, b.data};
    const size_t size[2] = {a.size, b.size};
    hw_status status = hw_progressive_get_block(reader, block, bytes, size);
    free(a.data);
    free(b.data);
    return status;
}

static hw_status get_all(hw_bytes_reader *r, const hw_progressive_head *head,
                         hw_progressive_reader *reader, hw_progressive **out)
{
    chunk base = take(r);
    hw_status status = hw_progressive_reader_start(reader, head);
    if (status == HW_OK)
        status = hw_progressive_get_base(reader, base.data, base.size);
    free(base.data);
    for (uint32_t b = 0; status == HW_OK && b < head->block_count; b++)
        status = get_block(reader, b, r);
    if (status == HW_OK && head->info.complete) {
        chunk loose = take(r), order = take(r);
        status = hw_progressive_get_finest(reader, loose.data, loose.size, order.data, order.size);
        free(loose.data);
        free(order.data);
    }
    return status == HW_OK ? hw_progressive_reader_finish(reader, out) : status;
}

static uint64_t hash_of(const hw_progressive *p)
{
    hw_mesh mesh;
    if (hw_progressive_extract(p, &mesh) != HW_OK)
        abort();
    for (uint32_t i = 0; i < mesh.index_count; i++)
        if (mesh.indices[i] >= mesh.vertex_count)
            abort();
    uint64_t hash = hw_mesh_hash(&mesh);
    hw_mesh_free(&mesh);
    return hash;
}

// Down and up again is the same, and so are the records of the coarsest batch in reverse order.
static void walk(hw_progressive *p)
{
    uint64_t finest = hash_of(p), coarse;
    uint32_t first, count;
    hw_progressive_go(p, 0);
    (void)hash_of(p);
    if (hw_progressive_get_info(p).record_count > 0) {
        hw_progressive_batch(p, 0, &first, &count);
        hw_progressive_go(p, count);
        coarse = hash_of(p);
        hw_progressive_go(p, 0);
        for (uint32_t r = count; r-- > 0;)
            if (hw_progressive_split(p, r) != HW_OK)
                abort();
        if (hash_of(p) != coarse)
            abort();
    }
    hw_progressive_go(p, UINT32_MAX);
    if (hash_of(p) != finest)
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    hw_bytes_reader r = hw_bytes_reader_make(data, size);
    hw_progressive_head head = {0};
    hw_progressive_reader reader = {0};
    hw_progressive *p = NULL;
    uint64_t bytes = 0;
    chunk first = take(&r);
    fuzz_accepted = hw_progressive_head_decode(first.data, first.size, &head) == HW_OK &&
                    get_all(&r, &head, &reader, &p) == HW_OK;
    free(first.data);
    if (fuzz_accepted) {
        walk(p);
        if (hw_progressive_encoded_bytes(p, UINT32_MAX, &bytes) != HW_OK)
            abort();
    }
    hw_progressive_destroy(p);
    hw_progressive_reader_free(&reader);
    hw_progressive_head_free(&head);
    return 0;
}
