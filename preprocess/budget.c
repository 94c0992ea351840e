#include "budget.h"
#include "alloc.h"
#include "system.h"
#include <assert.h>
#include <malloc.h>
#include <pthread.h>
#include <string.h>
#include <unistd.h>

#define NO_REGION   UINT32_MAX
#define WAIT_US     2000
#define BLOCK_COUNT 5u  // arrays of a mesh
#define SLACK_SHARE 16u // of the bound is left free for pages that come in meanwhile
#define WORK_BYTES  (UINT64_C(8) << 20) // for one object of a cell
#define RAYS_MAX    2u
#define MAP_BYTES   (1 << 18) // blocks of this size and more go back to the system when freed

struct hw_budget {
    uint64_t bytes;
    hw_spill *spill;
    hw_rays *rays[RAYS_MAX]; // borrowed
    uint32_t rays_count;
    pthread_mutex_t mutex;
    uint64_t reserved; // guarded by mutex
    hw_mesh **taken;   // guarded by mutex
    size_t taken_count, taken_capacity;
    uint32_t mesh_count;
    const hw_scene *scene;
    uint32_t (*regions)[2]; // per mesh: its own, its chain's
};

hw_status hw_budget_create(hw_budget **out, uint64_t bytes, const char *folder)
{
    hw_status status = HW_OK;
    hw_budget *budget = NULL;
    *out = NULL;
    HW_TRY(HW_NEW(&budget, 1));
    budget->bytes = bytes;
    pthread_mutex_init(&budget->mutex, NULL);
    HW_GO(hw_spill_create(&budget->spill, folder));
    mallopt(M_MMAP_THRESHOLD, MAP_BYTES);
    malloc_trim(0);
    *out = budget;
    budget = NULL;
out:
    hw_budget_destroy(budget);
    return status;
}

static void forget_arrays(hw_mesh *mesh)
{
    mesh->positions = NULL;
    mesh->normals = NULL;
    mesh->colors = NULL;
    mesh->uvs = NULL;
    mesh->indices = NULL;
}

void hw_budget_destroy(hw_budget *budget)
{
    if (!budget)
        return;
    for (size_t i = 0; i < budget->taken_count; i++)
        forget_arrays(budget->taken[i]);
    hw_spill_destroy(budget->spill);
    pthread_mutex_destroy(&budget->mutex);
    hw_free(budget->taken);
    hw_free(budget->regions);
    hw_free(budget);
}

static unsigned long long megabytes(uint64_t bytes)
{
    return (bytes + 999999) / 1000000;
}

hw_status hw_budget_check_peak(const hw_budget *budget, const char *what)
{
    uint64_t peak = hw_rss_peak_bytes();
    if (peak <= budget->bytes)
        return HW_OK;
    return hw_fail(HW_LIMIT, "%lluM of memory are not enough: %s alone takes %lluM",
                   megabytes(budget->bytes), what, megabytes(peak));
}

// ---- meshes ----------------------------------------------------------------------------------

static void list_arrays(const hw_mesh *m, hw_spill_block out[BLOCK_COUNT])
{
    size_t n = m->vertex_count;
    out[0] = (hw_spill_block){m->positions, n * sizeof *m->positions, NULL};
    out[1] = (hw_spill_block){m->normals, n * sizeof *m->normals, NULL};
    out[2] = (hw_spill_block){m->colors, n * sizeof *m->colors, NULL};
    out[3] = (hw_spill_block){m->uvs, n * sizeof *m->uvs, NULL};
    out[4] = (hw_spill_block){m->indices, m->index_count * sizeof *m->indices, NULL};
}

static void free_arrays(const hw_mesh *m)
{
    hw_free(m->positions);
    hw_free(m->normals);
    hw_free(m->colors);
    hw_free(m->uvs);
    hw_free(m->indices);
}

static void set_arrays(hw_mesh *m, const hw_spill_block blocks[BLOCK_COUNT])
{
    m->positions = blocks[0].mapped;
    m->normals = blocks[1].mapped;
    m->colors = blocks[2].mapped;
    m->uvs = blocks[3].mapped;
    m->indices = blocks[4].mapped;
}

// From here on the arrays of `mesh` are not its own.
static hw_status note_taken(hw_budget *b, hw_mesh *meshes, uint32_t count)
{
    pthread_mutex_lock(&b->mutex);
    hw_status status = HW_RESERVE(&b->taken, &b->taken_capacity, b->taken_count + count);
    for (uint32_t i = 0; status == HW_OK && i < count; i++)
        b->taken[b->taken_count++] = &meshes[i];
    pthread_mutex_unlock(&b->mutex);
    return status;
}

static hw_status take_meshes(hw_budget *b, hw_mesh *meshes, uint32_t count, uint32_t *region)
{
    hw_status status = HW_OK;
    hw_spill_block *blocks = NULL;
    HW_GO(HW_NEW(&blocks, (size_t)count * BLOCK_COUNT));
    for (uint32_t i = 0; i < count; i++)
        list_arrays(&meshes[i], blocks + (size_t)i * BLOCK_COUNT);
    HW_GO(hw_spill_put(b->spill, blocks, count * BLOCK_COUNT, region));
    HW_GO(note_taken(b, meshes, count));
    for (uint32_t i = 0; i < count; i++) {
        free_arrays(&meshes[i]);
        set_arrays(&meshes[i], blocks + (size_t)i * BLOCK_COUNT);
    }
out:
    hw_free(blocks);
    return status;
}

hw_status hw_budget_take_scene(hw_budget *b, hw_scene *scene)
{
    HW_TRY(HW_NEW(&b->regions, scene->mesh_count));
    b->mesh_count = scene->mesh_count;
    b->scene = scene;
    for (uint32_t i = 0; i < scene->mesh_count; i++) {
        b->regions[i][1] = NO_REGION;
        HW_TRY(take_meshes(b, &scene->meshes[i], 1, &b->regions[i][0]));
    }
    malloc_trim(0);
    return HW_OK;
}

hw_status hw_budget_take_chain(hw_budget *b, uint32_t mesh_idx, hw_chain *chain)
{
    hw_mesh *original = &chain->levels[0];
    const hw_mesh *shared = &b->scene->meshes[mesh_idx];
    HW_TRY(note_taken(b, original, 1));
    free_arrays(original);
    original->positions = shared->positions;
    original->normals = shared->normals;
    original->colors = shared->colors;
    original->uvs = shared->uvs;
    original->indices = shared->indices;
    if (chain->level_count > 1)
        HW_TRY(take_meshes(b, chain->levels + 1, chain->level_count - 1, &b->regions[mesh_idx][1]));
    return HW_OK;
}

uint64_t hw_budget_scratch_bytes(hw_budget *b)
{
    return b ? hw_spill_bytes(b->spill) : 0;
}

// ---- room ------------------------------------------------------------------------------------

// Called with the mutex held.
static bool fits(const hw_budget *b, uint64_t bytes)
{
    return hw_rss_bytes() + b->reserved + bytes <= b->bytes;
}

static bool evict_tree(hw_budget *b)
{
    for (uint32_t i = b->rays_count; i-- > 0;)
        if (hw_rays_evict(b->rays[i]))
            return true;
    return false;
}

static bool any_pinned(const hw_budget *b)
{
    for (uint32_t i = 0; i < b->rays_count; i++)
        if (hw_rays_pins(b->rays[i]) > 0)
            return true;
    return false;
}

// Called with the mutex held. Gives back what can be had again: pages of the scratch file first,
// which cost little to bring in, then trees of rays. Some more than asked for goes, or the next
// page that comes in would start all over.
static bool make_room(hw_budget *b, uint64_t bytes)
{
    if (fits(b, bytes))
        return true;
    uint64_t wanted = bytes + b->bytes / SLACK_SHARE;
    hw_spill_drop(b->spill, false);
    if (fits(b, wanted))
        return true;
    hw_spill_drop(b->spill, true);
    malloc_trim(0);
    while (!fits(b, wanted))
        if (!evict_tree(b))
            return fits(b, bytes);
    return true;
}

hw_status hw_budget_reserve(hw_budget *b, uint64_t bytes)
{
    if (!b)
        return HW_OK;
    for (;;) {
        pthread_mutex_lock(&b->mutex);
        // Others that work will give something back; if none did before, waiting is of no use.
        bool others = b->reserved > 0 || any_pinned(b);
        bool room = make_room(b, bytes);
        uint64_t needed = hw_rss_bytes() + bytes;
        if (room)
            b->reserved += bytes;
        pthread_mutex_unlock(&b->mutex);
        if (room)
            return HW_OK;
        if (!others)
            return hw_fail(HW_LIMIT, "%lluM of memory are not enough: at least %lluM are needed",
                           megabytes(b->bytes), megabytes(needed + needed / SLACK_SHARE));
        usleep(WAIT_US);
    }
}

void hw_budget_release(hw_budget *b, uint64_t bytes)
{
    if (!b)
        return;
    pthread_mutex_lock(&b->mutex);
    b->reserved -= bytes;
    pthread_mutex_unlock(&b->mutex);
}

hw_status hw_budget_use(hw_budget *b, uint32_t mesh_idx)
{
    if (!b)
        return HW_OK;
    for (int k = 0; k < 2; k++)
        if (b->regions[mesh_idx][k] != NO_REGION)
            hw_spill_touch(b->spill, b->regions[mesh_idx][k]);
    HW_TRY(hw_budget_reserve(b, WORK_BYTES));
    hw_budget_release(b, WORK_BYTES);
    return HW_OK;
}

static hw_status reserve(void *context, uint64_t bytes)
{
    return hw_budget_reserve(context, bytes);
}

static void release(void *context, uint64_t bytes)
{
    hw_budget_release(context, bytes);
}

hw_status hw_budget_create_rays(hw_budget *b, const hw_scene *scene, hw_rays **out)
{
    const hw_rays_memory memory = {b, reserve, release};
    assert(b->rays_count < RAYS_MAX);
    HW_TRY(hw_rays_create_paged(out, scene, &memory));
    b->rays[b->rays_count++] = *out;
    return HW_OK;
}
