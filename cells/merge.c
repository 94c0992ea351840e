#include "merge.h"
#include "alloc.h"
#include "cell_file.h"
#include "file.h"
#include "hierarchy.h"
#include "image_io.h"
#include "log.h"
#include "mesh_file.h"
#include "parallel.h"
#include "shard.h"
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

typedef struct part {
    const char *folder;
    hw_manifest manifest;
} part;

typedef struct merge {
    const char *dataset;
    part *parts;
    size_t capacity;
    uint32_t part_count;
    const part **shards; // by index
    uint32_t shard_count, cell_count;
    hw_cell_id *ids;         // of all cells of the grid
    hw_manifest_cell *cells; // in the same order
    hw_progress *progress;
    bool *copied;   // per item: a file that was not there before
    bool finishing; // manifest.json is ours from now on, and
    bool had_build; // build.json was there before
} merge;

// ---- what is there ---------------------------------------------------------------------------

static hw_status add_part(merge *m, const char *folder, hw_manifest *manifest)
{
    hw_status status = HW_RESERVE(&m->parts, &m->capacity, m->part_count + 1);
    if (status == HW_OK)
        m->parts[m->part_count++] = (part){folder, *manifest};
    else
        hw_manifest_free(manifest);
    return status;
}

static hw_status gather_folder(merge *m, const char *folder)
{
    hw_manifest *found = NULL, whole;
    uint32_t count = 0;
    hw_status status = HW_OK;
    HW_TRY(hw_shards_read(folder, &found, &count));
    if (count == 0) {
        status = hw_manifest_read(folder, &whole);
        if (status == HW_NOT_FOUND)
            status = hw_fail(HW_NOT_FOUND, "%s: holds no finished shard", folder);
        if (status == HW_OK) {
            whole.shard_count = 1;
            status = add_part(m, folder, &whole);
        }
    }
    for (uint32_t i = 0; i < count; i++) {
        if (status == HW_OK)
            status = add_part(m, folder, &found[i]);
        else
            hw_manifest_free(&found[i]);
    }
    hw_free(found);
    return status;
}

// ---- whether it fits together ----------------------------------------------------------------

static bool same_grid(const hw_hexgrid *a, const hw_hexgrid *b)
{
    return a->origin_x == b->origin_x && a->origin_y == b->origin_y &&
           a->cell_size == b->cell_size && a->z_min == b->z_min && a->z_max == b->z_max &&
           a->columns == b->columns && a->rows == b->rows && a->levels == b->levels;
}

static hw_status check_agreement(const part *a, const part *b)
{
    const hw_manifest *m = &a->manifest, *n = &b->manifest;
    if (m->scene_hash != n->scene_hash)
        return hw_fail(HW_FORMAT, "%s: is of another scene than %s", b->folder, a->folder);
    if (m->key != n->key)
        return hw_fail(HW_FORMAT, "%s: was made with other options or by another version than %s",
                       b->folder, a->folder);
    if (m->shard_count != n->shard_count)
        return hw_fail(HW_FORMAT, "%s: holds shard %u of %u, but %s one of %u", b->folder,
                       n->shard_index + 1, n->shard_count, a->folder, m->shard_count);
    if (!same_grid(&m->grid, &n->grid) || m->object_count != n->object_count ||
        m->mesh_count != n->mesh_count || m->texture_count != n->texture_count ||
        m->scene_triangles != n->scene_triangles || strcmp(m->policy, n->policy))
        return hw_fail(HW_FORMAT, "%s: its manifest contradicts that of %s", b->folder, a->folder);
    if (strcmp(m->scene_path, n->scene_path))
        hw_log_warning("%s: its scene is %s; the dataset will name %s", b->folder, n->scene_path,
                       m->scene_path);
    return HW_OK;
}

// A shard lists its own cells, all of them and no others.
static hw_status take_cells(merge *m, const part *p)
{
    const hw_manifest *manifest = &p->manifest;
    uint32_t taken = 0, owned = 0;
    for (uint32_t i = 0; i < m->cell_count; i++)
        owned += hw_shard_owns(manifest->shard_index, m->shard_count, i);
    for (uint32_t i = 0; i < manifest->cell_count; i++) {
        const hw_manifest_cell *cell = &manifest->cells[i];
        uint32_t index = hw_hierarchy_find(m->ids, m->cell_count, cell->id);
        if (index == m->cell_count || !hw_shard_owns(manifest->shard_index, m->shard_count, index))
            return hw_fail(HW_FORMAT, "%s: lists cell %d/%d_%d, which is not of shard %u of %u",
                           p->folder, cell->id.level, cell->id.q, cell->id.r,
                           manifest->shard_index + 1, m->shard_count);
        m->cells[index] = *cell;
        taken++;
    }
    if (taken != owned)
        return hw_fail(HW_FORMAT, "%s: shard %u of %u lists %u cells instead of %u", p->folder,
                       manifest->shard_index + 1, m->shard_count, taken, owned);
    return HW_OK;
}

static hw_status arrange(merge *m)
{
    const part *first = &m->parts[0];
    for (uint32_t i = 1; i < m->part_count; i++)
        HW_TRY(check_agreement(first, &m->parts[i]));
    m->shard_count = first->manifest.shard_count;
    HW_TRY(hw_hierarchy_cells(&first->manifest.grid, &m->ids, &m->cell_count));
    HW_TRY(HW_NEW(&m->shards, m->shard_count));
    for (uint32_t i = 0; i < m->part_count; i++) {
        const part *p = &m->parts[i], **slot = &m->shards[p->manifest.shard_index];
        if (*slot)
            return hw_fail(HW_FORMAT, "%s: holds shard %u of %u, which %s holds too", p->folder,
                           p->manifest.shard_index + 1, m->shard_count, (*slot)->folder);
        *slot = p;
    }
    for (uint32_t i = 0; i < m->shard_count; i++)
        if (!m->shards[i])
            return hw_fail(HW_NOT_FOUND,
                           "shard %u of %u is missing: %s holds another, none of the "
                           "folders holds it",
                           i + 1, m->shard_count, first->folder);
    HW_TRY(HW_NEW(&m->cells, m->cell_count));
    for (uint32_t i = 0; i < m->shard_count; i++)
        HW_TRY(take_cells(m, m->shards[i]));
    return HW_OK;
}

static bool same_folder(const char *a, const char *b)
{
    struct stat x, y;
    return stat(a, &x) == 0 && stat(b, &y) == 0 && x.st_dev == y.st_dev && x.st_ino == y.st_ino;
}

static hw_status check_target(const merge *m)
{
    char *path = NULL;
    for (uint32_t i = 0; i < m->part_count; i++)
        if (same_folder(m->dataset, m->parts[i].folder))
            return hw_fail(HW_USAGE, "%s: is one of the shards; the dataset needs its own folder",
                           m->dataset);
    HW_TRY(hw_path_join(&path, m->dataset, "manifest.json"));
    bool finished = hw_path_exists(path);
    hw_free(path);
    if (finished)
        return hw_fail(HW_USAGE, "%s: is a finished dataset already", m->dataset);
    return HW_OK;
}

// ---- files -----------------------------------------------------------------------------------

// Items: the cells, then the meshes, then the textures.
static uint32_t item_count(const merge *m)
{
    const hw_manifest *manifest = &m->parts[0].manifest;
    return m->cell_count + manifest->mesh_count + manifest->texture_count;
}

// The path of an item below a folder, and the shard that made it.
static hw_status item_path(const merge *m, uint32_t item, const char *folder, char **out,
                           uint32_t *shard)
{
    const hw_manifest *manifest = &m->parts[0].manifest;
    uint32_t index = item;
    if (item < m->cell_count) {
        *shard = index % m->shard_count;
        return hw_cell_path(out, folder ? folder : m->shards[*shard]->folder, m->cells[index].id);
    }
    index -= m->cell_count;
    bool is_mesh = index < manifest->mesh_count;
    index -= is_mesh ? 0 : manifest->mesh_count;
    *shard = index % m->shard_count;
    folder = folder ? folder : m->shards[*shard]->folder;
    return is_mesh ? hw_mesh_path(out, folder, index) : hw_texture_path(out, folder, index);
}

static hw_status check_mesh(const char *path, uint64_t key)
{
    hw_mesh_file *file = NULL;
    HW_TRY(hw_mesh_file_open(&file, path));
    hw_status status =
        hw_mesh_file_key(file) == key ? HW_OK : hw_fail(HW_FORMAT, "%s: is of another build", path);
    for (uint32_t l = 0; status == HW_OK && l < hw_mesh_file_level_count(file); l++) {
        hw_mesh level = {0};
        status = hw_mesh_file_read(file, l, &level, NULL);
        hw_mesh_free(&level);
    }
    hw_mesh_file_close(file);
    return status;
}

static hw_status check_cell(const char *path, uint64_t key, const hw_manifest_cell *listed)
{
    hw_cell cell = {0};
    struct stat info;
    HW_TRY(hw_cell_read(path, &cell));
    bool right = cell.key == key && cell.id.level == listed->id.level &&
                 cell.id.q == listed->id.q && cell.id.r == listed->id.r;
    hw_cell_free(&cell);
    if (!right)
        return hw_fail(HW_FORMAT, "%s: is of another build or another cell", path);
    if (stat(path, &info) != 0 || (uint64_t)info.st_size != listed->bytes)
        return hw_fail(HW_FORMAT, "%s: does not have the bytes that its shard tells", path);
    return HW_OK;
}

static hw_status check_texture(const char *path)
{
    hw_image image = {0};
    HW_TRY(hw_image_read(path, &image));
    hw_image_free(&image);
    return HW_OK;
}

static hw_status check_item(void *context, uint64_t item, uint32_t thread)
{
    (void)thread;
    merge *m = context;
    hw_status status = HW_OK;
    char *path = NULL;
    uint32_t shard;
    uint64_t key = m->parts[0].manifest.key;
    HW_TRY(item_path(m, (uint32_t)item, NULL, &path, &shard));
    if (item < m->cell_count)
        status = check_cell(path, key, &m->cells[item]);
    else if (item < m->cell_count + m->parts[0].manifest.mesh_count)
        status = check_mesh(path, key);
    else
        status = check_texture(path);
    hw_progress_add(m->progress, 1);
    hw_free(path);
    return status;
}

static hw_status copy_file(const char *from, const char *to)
{
    enum { BLOCK = 1 << 20 };
    hw_status status = HW_OK;
    hw_reader *reader = NULL;
    hw_writer *writer = NULL;
    uint8_t *block = NULL;
    HW_GO(hw_reader_open(&reader, from));
    HW_GO(hw_writer_open(&writer, to));
    HW_GO(HW_NEW(&block, BLOCK));
    uint64_t size = hw_reader_size(reader);
    for (uint64_t at = 0; at < size; at += BLOCK) {
        size_t n = size - at < BLOCK ? (size_t)(size - at) : BLOCK;
        HW_GO(hw_reader_at(reader, at, block, n));
        HW_GO(hw_writer_put(writer, block, n));
    }
    status = hw_writer_commit(writer);
    writer = NULL;
out:
    hw_free(block);
    hw_writer_abort(writer);
    hw_reader_close(reader);
    return status;
}

static hw_status copy_item(void *context, uint64_t item, uint32_t thread)
{
    (void)thread;
    merge *m = context;
    hw_status status = HW_OK;
    char *from = NULL, *to = NULL;
    uint32_t shard;
    HW_GO(item_path(m, (uint32_t)item, NULL, &from, &shard));
    HW_GO(item_path(m, (uint32_t)item, m->dataset, &to, &shard));
    m->copied[item] = !hw_path_exists(to); // also when only the last step of writing fails
    HW_GO(copy_file(from, to));
    hw_progress_add(m->progress, 1);
out:
    hw_free(from);
    hw_free(to);
    return status;
}

// The last ones as the grid has levels.
static const char *const folders_made[] = {"",        "cells",   "meshes",  "cells/0",
                                           "cells/1", "cells/2", "cells/3", "cells/4"};
_Static_assert(HW_CELL_LEVELS_MAX == 5, "a folder for each level");
#define FOLDERS_MADE (sizeof folders_made / sizeof *folders_made)

static hw_status make_folders(const merge *m, bool made[FOLDERS_MADE])
{
    for (size_t i = 0; i < 3 + (size_t)m->parts[0].manifest.grid.levels; i++) {
        char *path = NULL;
        HW_TRY(hw_path_join(&path, m->dataset, folders_made[i]));
        bool was_there = hw_path_exists(path);
        hw_status status = hw_dir_make(path);
        made[i] = status == HW_OK && !was_there;
        if (status == HW_OK)
            status = hw_dir_clean_temporary(path);
        hw_free(path);
        HW_TRY(status);
    }
    return HW_OK;
}

static void remove_file(const char *folder, const char *name)
{
    char *path = NULL;
    if (hw_path_join(&path, folder, name) != HW_OK)
        return;
    unlink(path);
    hw_free(path);
}

// After a failure: takes away what this run has written.
static void undo(const merge *m, const bool made[FOLDERS_MADE])
{
    uint32_t shard, count = m->copied ? item_count(m) : 0;
    char *path = NULL;
    if (m->finishing) // the manifest first: it makes the folder a dataset
        remove_file(m->dataset, "manifest.json");
    if (m->finishing && !m->had_build)
        remove_file(m->dataset, "build.json");
    for (uint32_t i = 0; i < count; i++)
        if (m->copied[i] && item_path(m, i, m->dataset, &path, &shard) == HW_OK) {
            unlink(path);
            hw_free(path);
        }
    for (size_t i = FOLDERS_MADE; i-- > 0;)
        if (made[i] && hw_path_join(&path, m->dataset, folders_made[i]) == HW_OK) {
            rmdir(path);
            hw_free(path);
        }
}

// ---- the whole -------------------------------------------------------------------------------

static hw_status write_manifest(merge *m, hw_merge_report *report)
{
    char *build = NULL;
    HW_TRY(hw_path_join(&build, m->dataset, "build.json"));
    m->had_build = hw_path_exists(build);
    m->finishing = true;
    hw_free(build);
    hw_manifest whole = m->shards[0]->manifest; // borrows
    whole.cells = m->cells;
    whole.cell_count = m->cell_count;
    whole.mesh_bytes = whole.texture_bytes = whole.near_bytes = 0;
    whole.build_seconds = 0;
    for (uint32_t i = 0; i < m->shard_count; i++) {
        const hw_manifest *shard = &m->shards[i]->manifest;
        whole.mesh_bytes += shard->mesh_bytes;
        whole.texture_bytes += shard->texture_bytes;
        whole.near_bytes += shard->near_bytes;
        whole.build_seconds += shard->build_seconds;
    }
    report->bytes = whole.near_bytes;
    for (uint32_t i = 0; i < m->cell_count; i++)
        report->bytes += m->cells[i].bytes;
    report->shards = m->shard_count;
    report->cells = m->cell_count;
    report->meshes = whole.mesh_count;
    report->build_seconds = whole.build_seconds;
    return hw_manifest_write(m->dataset, &whole);
}

static hw_status for_all_items(merge *m, const char *label, uint32_t threads, hw_parallel_fn fn,
                               const atomic_bool *stop)
{
    m->progress = NULL;
    HW_TRY(hw_progress_create(&m->progress, label, item_count(m)));
    hw_status status = hw_parallel_for(item_count(m), threads, fn, m, stop);
    hw_progress_destroy(m->progress);
    return status;
}

hw_status hw_merge_run(const char *const *folders, uint32_t folder_count, const char *dataset,
                       uint32_t threads, const atomic_bool *stop, hw_merge_report *report)
{
    hw_status status = HW_OK;
    merge m = {.dataset = dataset};
    bool made[FOLDERS_MADE] = {false};
    char error[HW_ERROR_CAPACITY];
    memset(report, 0, sizeof *report);
    if (folder_count == 0)
        return hw_fail(HW_USAGE, "no shards to merge");
    for (uint32_t i = 0; i < folder_count; i++)
        HW_GO(gather_folder(&m, folders[i]));
    HW_GO(check_target(&m));
    HW_GO(arrange(&m));
    HW_GO(for_all_items(&m, "checking", threads, check_item, stop));
    HW_GO(HW_NEW(&m.copied, item_count(&m)));
    HW_GO(make_folders(&m, made));
    HW_GO(for_all_items(&m, "copying", threads, copy_item, stop));
    HW_GO(write_manifest(&m, report));
out:
    if (status != HW_OK) {
        hw_error_save(error);
        undo(&m, made);
        hw_error_restore(error);
    }
    for (uint32_t i = 0; i < m.part_count; i++)
        hw_manifest_free(&m.parts[i].manifest);
    hw_free(m.parts);
    hw_free(m.shards);
    hw_free(m.ids);
    hw_free(m.cells);
    hw_free(m.copied);
    return status;
}
