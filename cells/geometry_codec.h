// Vertex and index streams of cells and meshes, packed by meshoptimizer's codecs
// (geometry_codec.c is the only file of this folder that includes it). Thread-safe, deterministic.
#pragma once
#include "status.h"
#include <stddef.h>
#include <stdint.h>

// Packs `count` elements of `stride` bytes (a multiple of 4, at most 256); *bytes is freed with
// hw_free. count 0 gives 0 bytes.
HW_MUST_USE hw_status hw_vertices_encode(const void *vertices, size_t count, size_t stride,
                                         uint8_t **bytes, size_t *size);
// Unpacks exactly `count` elements into a new block (hw_free). The count is checked against `size`
// before anything is allocated: the result is at most a few hundred times larger. HW_FORMAT (with
// no file name) for bytes that are not such a stream.
HW_MUST_USE hw_status hw_vertices_decode(const uint8_t *bytes, size_t size, size_t count,
                                         size_t stride, void **vertices);
// The same for a triangle list, index_count a multiple of 3, every index below vertex_count. A
// triangle may come back rotated, never mirrored.
HW_MUST_USE hw_status hw_indices_encode(const uint32_t *indices, size_t index_count,
                                        size_t vertex_count, uint8_t **bytes, size_t *size);
HW_MUST_USE hw_status hw_indices_decode(const uint8_t *bytes, size_t size, size_t index_count,
                                        size_t vertex_count, uint32_t **indices);
