#include "geometry_codec.h"
#include "alloc.h"
#include <assert.h>
#include <meshoptimizer.h>
#include <pthread.h>

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
               "streams hold little-endian numbers as they stand in memory");

// The versions of the streams are process-wide in meshoptimizer; ours are part of the format.
static void set_versions(void)
{
    meshopt_encodeVertexVersion(0);
    meshopt_encodeIndexVersion(1);
}

static void set_versions_once(void)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, set_versions);
}

hw_status hw_vertices_encode(const void *vertices, size_t count, size_t stride, uint8_t **bytes,
                             size_t *size)
{
    assert(stride % 4 == 0 && stride > 0 && stride <= 256);
    set_versions_once();
    size_t bound = count ? meshopt_encodeVertexBufferBound(count, stride) : 0;
    *size = 0;
    HW_TRY(HW_NEW(bytes, bound));
    if (count == 0)
        return HW_OK;
    *size = meshopt_encodeVertexBuffer(*bytes, bound, vertices, count, stride);
    if (*size > 0)
        return HW_OK;
    hw_free(*bytes);
    *bytes = NULL;
    return hw_fail(HW_INTERNAL, "the vertex codec failed on %zu vertices", count);
}

// A block of at most 256 elements holds, for each byte of the stride, one header of 2 bits for 16
// elements: 4 bytes where the block is full.
static size_t vertex_count_bound(size_t size, size_t stride)
{
    return size / (4 * stride) * 256 + 256;
}

hw_status hw_vertices_decode(const uint8_t *bytes, size_t size, size_t count, size_t stride,
                             void **vertices)
{
    *vertices = NULL;
    if (count == 0 ? size != 0 : count > vertex_count_bound(size, stride))
        return hw_fail(HW_FORMAT, "%zu vertices cannot come from %zu bytes", count, size);
    HW_TRY(hw_alloc(vertices, count, stride));
    if (count == 0 || meshopt_decodeVertexBuffer(*vertices, count, stride, bytes, size) == 0)
        return HW_OK;
    hw_free(*vertices);
    *vertices = NULL;
    return hw_fail(HW_FORMAT, "the packed vertices are damaged");
}

hw_status hw_indices_encode(const uint32_t *indices, size_t index_count, size_t vertex_count,
                            uint8_t **bytes, size_t *size)
{
    assert(index_count % 3 == 0);
    set_versions_once();
    size_t bound = index_count ? meshopt_encodeIndexBufferBound(index_count, vertex_count) : 0;
    *size = 0;
    HW_TRY(HW_NEW(bytes, bound));
    if (index_count == 0)
        return HW_OK;
    *size = meshopt_encodeIndexBuffer(*bytes, bound, indices, index_count);
    if (*size > 0)
        return HW_OK;
    hw_free(*bytes);
    *bytes = NULL;
    return hw_fail(HW_INTERNAL, "the index codec failed on %zu indices", index_count);
}

hw_status hw_indices_decode(const uint8_t *bytes, size_t size, size_t index_count,
                            size_t vertex_count, uint32_t **indices)
{
    // Every triangle takes a byte at least.
    *indices = NULL;
    if (index_count % 3 || (index_count == 0 ? size != 0 : index_count / 3 > size))
        return hw_fail(HW_FORMAT, "%zu indices cannot come from %zu bytes", index_count, size);
    HW_TRY(HW_NEW(indices, index_count));
    if (index_count > 0 &&
        meshopt_decodeIndexBuffer(*indices, index_count, sizeof **indices, bytes, size) != 0) {
        hw_free(*indices);
        *indices = NULL;
        return hw_fail(HW_FORMAT, "the packed indices are damaged");
    }
    for (size_t i = 0; i < index_count; i++) {
        uint32_t index = (*indices)[i];
        if (index < vertex_count)
            continue;
        hw_free(*indices);
        *indices = NULL;
        return hw_fail(HW_FORMAT, "index %zu is %u, there are %zu vertices", i, index,
                       vertex_count);
    }
    return HW_OK;
}
