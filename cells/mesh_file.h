// A near mesh and its levels of detail, stored once per mesh of the scene. File type .hxm; each
// level is a chunk of its own, so that the run time reads only the levels it draws.
#pragma once
#include "container.h"
#include "inner_boxes.h"
#include "mesh.h"
#include "status.h"

#define HW_MESH_MAGIC        HW_FOURCC('H', 'X', 'W', 'M')
#define HW_MESH_VERSION      2u
#define HW_MESH_LEVELS_MAX   64u
#define HW_MESH_VERTICES_MAX (1u << 28) // of a level
#define HW_MESH_INDICES_MAX  (3u << 28)

typedef struct hw_mesh_level_info {
    uint32_t vertex_count, index_count;
    // Measured distance to the original in mesh units, root mean square and what 99 in 100 surface
    // points stay within (a scan's inner scraps, which no level keeps, would rule a maximum); 0 at
    // level 0, never falling with the level.
    float error_rms, error_p99;
    float error_silhouette; // measured mean outline deviation, mesh units
    // What normals and colours are off by, in mesh units too: the deviation of the outline at full
    // contrast that adds as much to a picture's squared error. 0 at level 0, never falling.
    float error_shading;
} hw_mesh_level_info;

// What levels to be drawn are chosen by: the larger of surface error (of 99 in 100 points) and
// weighted shading error, mesh units. The weight is measured (preprocess/README.md): up to 15 a
// decibel costs few triangles, beyond that many.
#define HW_MESH_SHADING_WEIGHT 15.0f
float hw_mesh_level_error(const hw_mesh_level_info *info);

typedef struct hw_mesh_file hw_mesh_file;

// levels[0] is the original. boxes: of each level those that lie inside of it, in its own space;
// NULL: none. HW_FORMAT if a level, its entry or a box is not valid (mesh_level.h). Atomic,
// deterministic.
HW_MUST_USE hw_status hw_mesh_file_write(const char *path, uint64_t key, const hw_mesh *levels,
                                         const hw_mesh_level_info *infos,
                                         const hw_inner_boxes *boxes, uint32_t count);
// Opens and checks the header and the level table.
HW_MUST_USE hw_status hw_mesh_file_open(hw_mesh_file **out, const char *path);
// The same from the first HW_MESH_FRONT_BYTES of a file (all of it where it is shorter), which hold
// header and level table. Keeps no pointer to them; levels are then had with hw_mesh_file_decode.
#define HW_MESH_FRONT_BYTES 5120u
HW_MUST_USE hw_status hw_mesh_file_open_front(hw_mesh_file **out, const char *name,
                                              const void *bytes, size_t size, uint64_t file_bytes);
void hw_mesh_file_close(hw_mesh_file *file);
uint64_t hw_mesh_file_key(const hw_mesh_file *file);
uint32_t hw_mesh_file_level_count(const hw_mesh_file *file);
const hw_mesh_level_info *hw_mesh_file_level(const hw_mesh_file *file, uint32_t level);
// Reads one level (positions, normals, colours and uvs if there) and the boxes inside of it (NULL:
// not wanted), validated. On failure both are zeroed. Thread-safe.
HW_MUST_USE hw_status hw_mesh_file_read(const hw_mesh_file *file, uint32_t level, hw_mesh *out,
                                        hw_inner_boxes *boxes);
// Where a level lies in the file; and the level from its `size` bytes there, fetched by the caller.
// Thread-safe.
void hw_mesh_file_level_place(const hw_mesh_file *file, uint32_t level, uint64_t *offset,
                              uint64_t *size);
HW_MUST_USE hw_status hw_mesh_file_decode(const hw_mesh_file *file, uint32_t level,
                                          const void *bytes, size_t size, hw_mesh *out,
                                          hw_inner_boxes *boxes);
// "meshes/<index>.hxm": the name below a dataset, as a source takes it, and the path.
void hw_mesh_name(char out[HW_FILE_NAME_BYTES], uint32_t mesh_idx);
HW_MUST_USE hw_status hw_mesh_path(char **out, const char *dataset, uint32_t mesh_idx);
// "meshes/texture_<index>.png", a texture of near meshes.
void hw_texture_name(char out[HW_FILE_NAME_BYTES], uint32_t texture_idx);
HW_MUST_USE hw_status hw_texture_path(char **out, const char *dataset, uint32_t texture_idx);
