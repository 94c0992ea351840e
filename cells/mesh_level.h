// One level of a mesh file as the bytes of a chunk, and the level table; open to tests and fuzzers,
// which come here past the checksums.
#pragma once
#include "mesh_file.h"

// mesh and boxes (NULL: none) must be valid. *bytes freed with hw_free.
HW_MUST_USE hw_status hw_mesh_level_encode(const hw_mesh *mesh, const hw_inner_boxes *boxes,
                                           uint8_t **bytes, size_t *size);
// Checks everything, also that the mesh is as large as `info` says. `name` is for messages. boxes
// may be NULL: not wanted. On failure *out and *boxes are zeroed.
HW_MUST_USE hw_status hw_mesh_level_decode(const char *name, const hw_mesh_level_info *info,
                                           const uint8_t *bytes, size_t size, hw_mesh *out,
                                           hw_inner_boxes *boxes);
// HW_FORMAT unless there are at most HW_INNER_BOXES_MAX, each with finite corners, min <= max, and
// within the mesh's bounds.
HW_MUST_USE hw_status hw_mesh_boxes_validate(const hw_mesh *mesh, const hw_inner_boxes *boxes);

HW_MUST_USE hw_status hw_mesh_table_encode(const hw_mesh_level_info *infos, uint32_t count,
                                           uint8_t **bytes, size_t *size);
// Fills infos and *count; HW_FORMAT or HW_VERSION for a bad table.
HW_MUST_USE hw_status hw_mesh_table_decode(const char *name, const uint8_t *bytes, size_t size,
                                           hw_mesh_level_info infos[HW_MESH_LEVELS_MAX],
                                           uint32_t *count);
// Errors finite, 0 at level 0 and never falling; counts within the limits.
HW_MUST_USE hw_status hw_mesh_table_validate(const char *name, const hw_mesh_level_info *infos,
                                             uint32_t count);

// Unit vectors as two 16-bit numbers (octahedral map, Meyer et al. 2010); the zero vector becomes
// +z. Off by less than 1e-4 rad.
void hw_octahedral_encode(hw_vec3 n, int16_t out[2]);
hw_vec3 hw_octahedral_decode(const int16_t in[2]);
