#include "shard.h"
#include "alloc.h"
#include "file.h"
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

bool hw_shard_owns(uint32_t shard_index, uint32_t shard_count, uint32_t item)
{
    return shard_count <= 1 || item % shard_count == shard_index;
}

static hw_status shard_path(char **out, const char *folder, uint32_t index, uint32_t count)
{
    char name[64];
    snprintf(name, sizeof name, "shard_%u_of_%u.json", index + 1, count);
    return hw_path_join(out, folder, name);
}

hw_status hw_shard_write(const char *folder, const hw_manifest *manifest)
{
    char *path = NULL;
    HW_TRY(shard_path(&path, folder, manifest->shard_index, manifest->shard_count));
    hw_status status = hw_manifest_write_file(path, manifest);
    hw_free(path);
    return status;
}

// Whether a file's name is exactly that of a shard.
static bool parse_name(const char *name, uint32_t *index, uint32_t *count)
{
    char expected[64];
    unsigned k, n;
    if (sscanf(name, "shard_%7u_of_%7u.json", &k, &n) != 2 || k < 1 || k > n || n > HW_SHARDS_MAX)
        return false;
    snprintf(expected, sizeof expected, "shard_%u_of_%u.json", k, n);
    *index = k - 1;
    *count = n;
    return !strcmp(name, expected);
}

typedef struct listing {
    uint32_t (*shards)[2]; // index, count
    size_t capacity;
    uint32_t count;
} listing;

static int compare_shards(const void *a, const void *b)
{
    const uint32_t *x = a, *y = b;
    if (x[1] != y[1])
        return x[1] < y[1] ? -1 : 1;
    return (x[0] > y[0]) - (x[0] < y[0]);
}

static hw_status list_shards(const char *folder, listing *out)
{
    hw_status status = HW_OK;
    uint32_t shard[2];
    DIR *dir = opendir(folder);
    if (!dir)
        return hw_fail(errno == ENOENT ? HW_NOT_FOUND : HW_IO, "%s: %s", folder, strerror(errno));
    for (const struct dirent *entry; status == HW_OK && (entry = readdir(dir));) {
        if (!parse_name(entry->d_name, &shard[0], &shard[1]))
            continue;
        status = HW_RESERVE(&out->shards, &out->capacity, out->count + 1);
        if (status == HW_OK)
            memcpy(out->shards[out->count++], shard, sizeof shard);
    }
    closedir(dir);
    if (out->count > 0)
        qsort(out->shards, out->count, sizeof *out->shards, compare_shards);
    return status;
}

static hw_status read_one(const char *folder, const uint32_t shard[2], hw_manifest *out)
{
    hw_status status = HW_OK;
    char *path = NULL;
    HW_TRY(shard_path(&path, folder, shard[0], shard[1]));
    HW_GO(hw_manifest_read_file(path, out));
    if (out->shard_index != shard[0] || out->shard_count != shard[1]) {
        hw_manifest_free(out);
        status = hw_fail(HW_FORMAT, "%s: does not tell of the shard in its name", path);
    }
out:
    hw_free(path);
    return status;
}

hw_status hw_shards_read(const char *folder, hw_manifest **out, uint32_t *count)
{
    hw_status status = HW_OK;
    listing all = {0};
    *out = NULL;
    *count = 0;
    HW_GO(list_shards(folder, &all));
    HW_GO(HW_NEW(out, all.count));
    for (; *count < all.count; ++*count)
        HW_GO(read_one(folder, all.shards[*count], &(*out)[*count]));
out:
    hw_free(all.shards);
    for (uint32_t i = 0; status != HW_OK && i < *count; i++)
        hw_manifest_free(&(*out)[i]);
    if (status != HW_OK) {
        hw_free(*out);
        *out = NULL;
        *count = 0;
    }
    return status;
}

hw_status hw_shards_remove(const char *folder)
{
    hw_status status = HW_OK;
    listing all = {0};
    HW_GO(list_shards(folder, &all));
    for (uint32_t i = 0; i < all.count; i++) {
        char *path = NULL;
        HW_GO(shard_path(&path, folder, all.shards[i][0], all.shards[i][1]));
        // Another build that finishes at the same time may have been faster.
        if (unlink(path) != 0 && errno != ENOENT)
            status = hw_fail(HW_IO, "%s: cannot remove: %s", path, strerror(errno));
        hw_free(path);
        HW_GO(status);
    }
out:
    hw_free(all.shards);
    return status;
}
