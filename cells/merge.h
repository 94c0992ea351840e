// Joins shards (shard.h) into a whole dataset, the same byte by byte as one build would have made
// but for build.json.
#pragma once
#include "status.h"
#include <stdatomic.h>
#include <stdint.h>

typedef struct hw_merge_report {
    uint32_t shards, cells, meshes;
    uint64_t bytes;
    double build_seconds; // of all shards together
} hw_merge_report;

// The folders hold one or more shards each (a whole dataset counts as shard 1 of 1); together
// exactly all shards of one scene and one set of options. Every file is read and checked before the
// first is written; on failure what was written is removed again. The manifest comes last.
// `dataset` must not be a finished dataset nor one of the folders. Errors (HW_FORMAT, HW_NOT_FOUND,
// HW_USAGE) name the folder at fault and the cause. threads: 0 = default; `stop` may be NULL.
HW_MUST_USE hw_status hw_merge_run(const char *const *folders, uint32_t folder_count,
                                   const char *dataset, uint32_t threads, const atomic_bool *stop,
                                   hw_merge_report *report);
