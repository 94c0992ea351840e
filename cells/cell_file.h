// One cell's content: what lies near it (by reference) and the textured meshes that stand for
// everything far. File type .hxc.
//
// Far vertices live in image space (thesis 5.2.2, projective-alike texture mapping): the capture of
// an object is a perspective view from the cell centre C through the plane of face f (axis a, right
// r, up u; hw_face_basis). With 16-bit x, y, z and
//   wx = x_min + x (x_max - x_min) / 65535,   wy likewise,   iz = iz_min + z (iz_max - iz_min) /
//   65535
// the world position is C + (a + wx r + wy u) / iz. That is a projective map, so texture
// coordinates are linear in (x, y):
//   atlas texel = rect.x + x rect.width / 65535,  rect.y + y rect.height / 65535  (texel row 0 is
//   the bottom of the image, y up).
// A cut-out record is larger than its object: it is drawn where the atlas's coverage is one half or
// more.
#pragma once
#include "atlas.h"
#include "container.h"
#include "hexgrid.h"
#include "mesh.h"
#include "status.h"

#define HW_CELL_MAGIC        HW_FOURCC('H', 'X', 'W', 'C')
#define HW_CELL_VERSION      3u
#define HW_CELL_RECORDS_MAX  65535u     // far records
#define HW_CELL_NEAR_MAX     (1u << 24) // near records
#define HW_CELL_VERTICES_MAX (1u << 26)
#define HW_CELL_INDICES_MAX  (1u << 28)
#define HW_CELL_ATLAS_MAX    8192u
#define HW_FAR_VIEWS_MAX     8u // captures of one far record, its own among them

typedef struct hw_near_record {
    uint32_t object_idx; // into the manifest's objects
    uint32_t
        level; // finest level of its mesh that any view point of the cell needs; 0 = the original
} hw_near_record;

typedef struct hw_far_record {
    uint32_t object_idx; // into the manifest's objects (of a cluster: its first)
    uint32_t face;       // 0..5
    bool cut_out;        // its outline is that of the atlas's coverage, not of its mesh
    float x_min, x_max, y_min, y_max, iz_min, iz_max;
    hw_box bounds; // world, for culling
    hw_rect rect;  // in the atlas, texels; without the padding
    uint32_t first_vertex, vertex_count;
    uint32_t first_index, index_count; // indices are absolute (into hw_cell.vertices) and stay
                                       // within the record's vertices
    uint32_t first_view, view_count;   // further captures; only of records with ranges
    uint32_t first_range, range_count; // of its triangles; none: its own capture serves all
} hw_far_record;

// A further capture of a far record: through a window of the plane at distance 1 from `eye` along
// the axis of `face`.
typedef struct hw_far_view {
    hw_vec3 eye; // world
    uint32_t face;
    float x_min, x_max, y_min, y_max; // of the rectangle
    hw_rect rect;                     // in the atlas, texels; without the padding
} hw_far_view;

// Triangles of a far record that the same captures see.
typedef struct hw_far_range {
    uint32_t views; // bit 0: the record's own capture, bit k: its k-th further one; 0: none, the
                    // triangles are drawn in the colours of their vertices
    uint32_t index_count;
} hw_far_range;

typedef struct hw_far_vertex {
    uint16_t x, y, z;
    uint16_t record; // which far record it belongs to
} hw_far_vertex;
_Static_assert(sizeof(hw_far_vertex) == 8, "a far vertex is eight bytes");

typedef struct hw_cell {
    hw_cell_id id;
    hw_vec3 centre;
    uint64_t key; // of the build that made it
    uint32_t near_count, far_count, vertex_count, index_count;
    uint32_t view_count, range_count, color_count;
    hw_near_record *near;
    hw_far_record *far; // records' vertices, indices, views and ranges tile the arrays in order
    hw_far_vertex *vertices;
    uint32_t *indices;
    hw_far_view *views;
    hw_far_range *ranges; // the indices of a record's ranges tile those of the record in order
    hw_color8 *colors;    // of the first color_count vertices, alpha 255 (where used)
    uint32_t atlas_width, atlas_height; // multiples of 4; 0 x 0 when there are no far objects
    uint8_t *atlas_bc1;                 // colours
    uint8_t *coverage_bc4;              // of the atlas's texels by the object, 255 = all
} hw_cell;

void hw_cell_free(hw_cell *cell);
// Checks every invariant stated above; HW_FORMAT names the first broken one. `name` is for
// messages.
HW_MUST_USE hw_status hw_cell_validate(const hw_cell *cell, const char *name);
// Atomic. Deterministic bytes (meshoptimizer's vertex and index codecs, then zstd).
HW_MUST_USE hw_status hw_cell_write(const hw_cell *cell, const char *path);
// Validated before it returns; on failure *out is zeroed.
HW_MUST_USE hw_status hw_cell_read(const char *path, hw_cell *out);
HW_MUST_USE hw_status hw_cell_decode(const char *name, const void *bytes, size_t size,
                                     hw_cell *out);
// The counts, id, centre and key alone; the arrays stay NULL. Reads a few bytes and checks no more
// than those.
HW_MUST_USE hw_status hw_cell_read_counts(const char *path, hw_cell *out);
// Whether `path` holds a complete cell with this key: opens and validates it. A missing or broken
// file gives false.
bool hw_cell_is_current(const char *path, uint64_t key);
// "cells/<level>/<q>_<r>.hxc": the name below a dataset, as a source takes it, and the path.
void hw_cell_name(char out[HW_FILE_NAME_BYTES], hw_cell_id id);
HW_MUST_USE hw_status hw_cell_path(char **out, const char *dataset, hw_cell_id id);
// World from image space of a record: maps (x, y, z, 1) with x, y, z as the 16-bit integers to
// homogeneous world coordinates.
hw_mat4 hw_far_record_matrix(const hw_far_record *record, hw_vec3 centre);
// Atlas texels of a capture from image space of the record: maps (x, y, z, 1) to (u w, v w, 0, w)
// where (u, v) are texels. `view` NULL: the record's own capture.
hw_mat4 hw_far_view_matrix(const hw_far_record *record, hw_vec3 centre, const hw_far_view *view);
