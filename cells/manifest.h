// The manifest of a dataset (manifest.json): written last, read first. Everything the run time
// needs besides cells and meshes.
#pragma once
#include "hexgrid.h"
#include "scene.h"
#include "source.h"
#include "status.h"

#define HW_MANIFEST_VERSION 2
#define HW_SHARDS_MAX       1000000u
#define HW_MESH_FILES_MAX   (1u << 24) // of a dataset, and as many textures

typedef struct hw_manifest_object {
    uint32_t mesh_idx;
    hw_mat4 transform;
    hw_box bounds;
    float color[3];      // the material's base colour
    int32_t texture_idx; // "meshes/texture_<idx>.png", -1 if none
} hw_manifest_object;

typedef struct hw_manifest_cell {
    hw_cell_id id;
    uint64_t bytes;
} hw_manifest_cell;

typedef struct hw_manifest {
    char *scene_path; // absolute path of the scene it was built from
    uint64_t scene_hash, key;
    uint64_t scene_triangles;
    char *policy;
    double self_occlusion_px, edge_length_px, near_error_px;
    double build_seconds; // in build.json, the only file that differs between equal builds
    uint64_t mesh_bytes, texture_bytes; // sums over the cells, as stored
    uint64_t near_bytes;                // the meshes folder
    hw_hexgrid grid;
    hw_ground ground;
    uint32_t mesh_count, texture_count, object_count, cell_count;
    hw_manifest_object *objects;
    hw_manifest_cell *cells;
    bool clusters;                     // far records may stand for several objects
    bool multi_view;                   // far records may have further captures
    uint32_t shard_index, shard_count; // of a shard's manifest (shard.h); count 0: of the whole
} hw_manifest;

void hw_manifest_free(hw_manifest *manifest);
// Whether a manifest that was read (its cells are in order) has the cell; *index, which may be
// NULL, is then its place in cells.
bool hw_manifest_find_cell(const hw_manifest *manifest, hw_cell_id id, uint32_t *index);
HW_MUST_USE hw_status hw_manifest_write(const char *dataset, const hw_manifest *manifest);
// One file, validated, without the seconds of build.json: how shards keep their manifests.
HW_MUST_USE hw_status hw_manifest_write_file(const char *path, const hw_manifest *manifest);
HW_MUST_USE hw_status hw_manifest_read_file(const char *path, hw_manifest *out);
// Reads and validates "<dataset>/manifest.json": version, counts, indices, finite numbers.
// HW_NOT_FOUND tells that the folder is no (finished) dataset; HW_VERSION names both versions.
HW_MUST_USE hw_status hw_manifest_read(const char *dataset, hw_manifest *out);
// The same by way of a source, and of a dataset given as a folder or as the URL of one.
HW_MUST_USE hw_status hw_manifest_fetch(hw_source *source, hw_manifest *out);
HW_MUST_USE hw_status hw_manifest_open(const char *location, hw_manifest *out);
// Parses text (for the fuzzer).
HW_MUST_USE hw_status hw_manifest_parse(const char *name, const char *text, size_t size,
                                        hw_manifest *out);
