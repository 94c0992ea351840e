// Shards: what one of several builds of the same dataset makes, and the file that tells of it,
// "shard_<K>_of_<N>.json": a manifest (manifest.h) of the shard's own cells, with sums over its own
// files. Shards may share a folder or have one each; cells/merge.h joins them.
#pragma once
#include "manifest.h"

// Whether the shard makes an item: a cell by its index in the grid, a mesh or a texture by its own.
// count 0 or 1: there is one shard, which makes everything.
bool hw_shard_owns(uint32_t shard_index, uint32_t shard_count, uint32_t item);
// "shard_<index + 1>_of_<count>.json" in the folder, by the manifest's shard.
HW_MUST_USE hw_status hw_shard_write(const char *folder, const hw_manifest *manifest);
// Reads all shards' manifests in a folder, in the order of their file names. Free each with
// hw_manifest_free and the array with hw_free. None is no error. HW_FORMAT names a file that tells
// of another shard than its name does.
HW_MUST_USE hw_status hw_shards_read(const char *folder, hw_manifest **out, uint32_t *count);
// Removes the manifests of shards from a folder: it is a whole dataset now.
HW_MUST_USE hw_status hw_shards_remove(const char *folder);
