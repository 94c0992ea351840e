#include "store.h"
#include "alloc.h"
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ACTIVE_MAX   4096u // items that are not away
#define PATIENCE     4u // frames: what was drawn before the viewer came here is soon in use no more
#define WAIT_FIRST_S 0.5 // after a failure, doubled with each
#define WAIT_MOST_S  30.0

// What becomes of a file's bytes on the GPU, until some cells have shown it.
#define GPU_RATIO_BLOCKS  3.0
#define GPU_RATIO_DECODED 12.0
#define RAM_RATIO         3.0

// One upload at a time of what is small, one of a cell, and one of a cell that turned out to be
// more urgent; in this order.
enum { UPLOAD_SMALL, UPLOAD_URGENT, UPLOAD_CELL, UPLOADS };

typedef struct near_mesh {
    hw_item item; // its table's
    hw_mesh_table table;
} near_mesh;

struct hw_store {
    const hw_manifest *manifest;
    hw_gpu_account *account;
    hw_loader *loader;
    hw_loader_mode mode;
    uint64_t gpu_budget, ram_budget, frame_bytes;
    bool blocks;
    hw_item *cells;    // by the manifest's index
    near_mesh *meshes; // by mesh
    hw_item *textures; // by texture
    hw_item **active;  // neither away nor tables, in no order
    uint32_t active_count;
    hw_cell_gpu pool[HW_STORE_CELLS_MAX];
    bool pool_used[HW_STORE_CELLS_MAX];
    struct {
        hw_item *item;
        hw_upload upload;
    } uploads[UPLOADS];
    uint64_t frame, timestamp, gpu_bytes, uploaded_bytes;
    uint32_t patience; // frames for which something indispensable has found no room on the GPU
    double now_s;
    uint64_t seen_file_bytes, seen_gpu_bytes, seen_ram_bytes; // of cells that came
    uint32_t news, problem_count;
    char problem[HW_ERROR_CAPACITY];
};

// ---- items -----------------------------------------------------------------------------------

// NULL: a level of a mesh whose table is away, or has changed.
static hw_item *find_item(hw_store *s, hw_data_key key)
{
    switch (key.kind) {
    case HW_DATA_CELL:
        return &s->cells[key.index];
    case HW_DATA_MESH:
        return &s->meshes[key.index].item;
    case HW_DATA_TEXTURE:
        return &s->textures[key.index];
    default:
        return key.level < s->meshes[key.index].table.level_count
                   ? &s->meshes[key.index].table.items[key.level]
                   : NULL;
    }
}

static void activate(hw_store *s, hw_item *item, hw_loaded *loaded)
{
    item->loaded = loaded;
    item->state = HW_ITEM_IN_RAM;
    s->active[s->active_count++] = item;
}

// Frees whatever the item holds.
static void send_away(hw_store *s, hw_item *item)
{
    for (int i = 0; i < UPLOADS; i++)
        if (s->uploads[i].item == item)
            s->uploads[i].item = NULL;
    for (uint32_t i = 0; i < HW_STORE_CELLS_MAX; i++)
        if (item->cell == &s->pool[i])
            s->pool_used[i] = false;
    if (item->cell)
        hw_cell_gpu_free(s->account, item->cell);
    hw_near_level_free(s->account, &item->level);
    hw_gpu_texture_destroy(s->account, &item->texture);
    if (item->loaded)
        hw_loader_dispose(s->loader, item->loaded, true);
    s->gpu_bytes -= item->gpu_bytes;
    item->cell = NULL;
    item->loaded = NULL;
    item->gpu_bytes = 0;
    item->state = HW_ITEM_AWAY;
    for (uint32_t i = 0; i < s->active_count; i++) {
        if (s->active[i] != item)
            continue;
        s->active[i] = s->active[--s->active_count];
        return;
    }
}

// ---- budgets ---------------------------------------------------------------------------------

static uint64_t bytes_on_gpu(const hw_store *s, const hw_item *item)
{
    const hw_loaded *l = item->loaded;
    switch (item->key.kind) {
    case HW_DATA_CELL:
        return hw_cell_data_gpu_bytes(&l->cell, s->blocks);
    case HW_DATA_LEVEL:
        return l->ram_bytes;
    default:
        return (uint64_t)l->texture.width * l->texture.height * 4 * 4 / 3;
    }
}

// Where the item is wished for; what the present plan does not name is wished for no more.
static hw_store_place place_of(const hw_store *s, const hw_item *item)
{
    bool stale = item->stamp < (double)s->timestamp;
    return stale && item->place == HW_PLACE_NOW ? HW_PLACE_GPU : item->place;
}

// What was drawn in this frame or the last is not to be missed in the next.
static bool in_use(const hw_store *s, const hw_item *item)
{
    return item->used + (s->mode == HW_LOADER_WAITS ? 0 : 1) >= s->frame;
}

// Whether a mesh (texture_idx -1) or a texture is near to a cell that is in use, which then could
// not be drawn without it.
static bool is_near_in_use(const hw_store *s, uint32_t mesh_idx, int32_t texture_idx)
{
    for (uint32_t i = 0; i < s->active_count; i++) {
        const hw_item *item = s->active[i];
        if (item->key.kind != HW_DATA_CELL || item->state != HW_ITEM_READY || !in_use(s, item))
            continue;
        const hw_cell_records *records = &item->loaded->cell.records;
        for (uint32_t k = 0; k < records->near_count; k++) {
            const hw_manifest_object *o = &s->manifest->objects[records->near[k].object_idx];
            if (texture_idx >= 0 ? o->texture_idx == texture_idx : o->mesh_idx == mesh_idx)
                return true;
        }
    }
    return false;
}

// Textures, and the coarsest level of a mesh that is there.
static bool is_indispensable(const hw_store *s, const hw_item *item)
{
    if (item->key.kind == HW_DATA_TEXTURE)
        return is_near_in_use(s, 0, (int32_t)item->key.index);
    if (item->key.kind != HW_DATA_LEVEL || item->state != HW_ITEM_READY)
        return false;
    const hw_mesh_table *table = &s->meshes[item->key.index].table;
    for (uint32_t i = item->key.level + 1; i < table->level_count; i++)
        if (table->items[i].state == HW_ITEM_READY)
            return false;
    return is_near_in_use(s, item->key.index, -1);
}

// What may go for something as urgent as `stamp`.
static bool may_go(const hw_store *s, const hw_item *item, double stamp)
{
    return !in_use(s, item) && item->stamp < stamp && !is_indispensable(s, item);
}

// Whether `bytes` more fit on the GPU if all that may goes away.
static bool can_make_room(const hw_store *s, uint64_t bytes, double stamp)
{
    uint64_t least = s->gpu_bytes + bytes;
    for (uint32_t i = 0; i < s->active_count && least > s->gpu_budget; i++)
        if (s->active[i]->gpu_bytes > 0 && may_go(s, s->active[i], stamp))
            least -= s->active[i]->gpu_bytes;
    return least <= s->gpu_budget;
}

// Sends away what has been wanted longest ago, but nothing that is as urgent as `stamp`, until
// `bytes` more fit on the GPU. False: they do not, with all gone that may.
static bool make_gpu_room(hw_store *s, uint64_t bytes, double stamp)
{
    while (s->gpu_bytes + bytes > s->gpu_budget) {
        hw_item *oldest = NULL;
        for (uint32_t i = 0; i < s->active_count; i++) {
            hw_item *item = s->active[i];
            if (item->gpu_bytes > 0 && (!oldest || item->stamp < oldest->stamp) &&
                may_go(s, item, stamp))
                oldest = item;
        }
        if (!oldest)
            return false;
        send_away(s, oldest);
    }
    return true;
}

// Whether one more piece may come; what was wanted longest ago goes for it.
static bool make_place(hw_store *s)
{
    hw_item *oldest = NULL;
    if (s->active_count < ACTIVE_MAX)
        return true;
    for (uint32_t i = 0; i < s->active_count; i++)
        if ((!oldest || s->active[i]->stamp < oldest->stamp) &&
            may_go(s, s->active[i], (double)INFINITY))
            oldest = s->active[i];
    if (oldest)
        send_away(s, oldest);
    return oldest;
}

// The item in memory that was wanted longest ago, and before `stamp`. *bytes: of all of them.
static hw_item *find_oldest_in_ram(hw_store *s, double stamp, uint64_t *bytes)
{
    hw_item *oldest = NULL;
    *bytes = 0;
    for (uint32_t i = 0; i < s->active_count; i++) {
        hw_item *item = s->active[i];
        if (item->state != HW_ITEM_IN_RAM)
            continue;
        *bytes += item->loaded->ram_bytes;
        if (item->stamp < stamp && (!oldest || item->stamp < oldest->stamp))
            oldest = item;
    }
    return oldest;
}

// Plans leave half of the memory budget to what comes and goes: what they name no more goes when
// that is short. And what the loader could not begin for want of room pushes out what is less
// urgent.
static void make_ram_room(hw_store *s)
{
    double priority;
    uint64_t bytes;
    hw_item *oldest;
    for (uint32_t i = s->active_count; i-- > 0;) // what can never go to the GPU
        if (s->active[i]->state == HW_ITEM_IN_RAM && place_of(s, s->active[i]) == HW_PLACE_GPU &&
            bytes_on_gpu(s, s->active[i]) > s->gpu_budget)
            send_away(s, s->active[i]);
    while ((oldest = find_oldest_in_ram(s, (double)s->timestamp, &bytes)) &&
           bytes > s->ram_budget / 2)
        send_away(s, oldest);
    while (hw_loader_lacks(s->loader, &priority) > 0 &&
           (oldest = find_oldest_in_ram(s, priority, &bytes)))
        send_away(s, oldest);
}

// ---- uploads ---------------------------------------------------------------------------------

static hw_cell_gpu *find_free(hw_store *s)
{
    for (uint32_t i = 0; i < HW_STORE_CELLS_MAX; i++) {
        if (s->pool_used[i])
            continue;
        s->pool_used[i] = true;
        return &s->pool[i];
    }
    return NULL;
}

// A place for one more cell; if there is none, that of the cell wanted longest ago. NULL: all are
// in use.
static hw_cell_gpu *take_pool(hw_store *s)
{
    hw_cell_gpu *found = find_free(s);
    hw_item *oldest = NULL;
    for (uint32_t i = 0; i < s->active_count && !found; i++) {
        hw_item *item = s->active[i];
        if (item->cell && !in_use(s, item) && (!oldest || item->stamp < oldest->stamp))
            oldest = item;
    }
    if (found || !oldest)
        return found;
    send_away(s, oldest);
    return find_free(s);
}

static hw_status create_texture(hw_store *s, hw_item *item, hw_upload *upload)
{
    const hw_image *image = &item->loaded->texture;
    *upload = (hw_upload){0};
    HW_TRY(hw_gpu_texture_create_empty(s->account, image->width, image->height, &item->texture));
    hw_upload_add(upload, (hw_upload_part){.texture = item->texture.name,
                                           .data = image->data,
                                           .bytes = (uint64_t)image->width * image->height * 4,
                                           .width = image->width,
                                           .height = image->height,
                                           .format = HW_UPLOAD_RGBA});
    return HW_OK;
}

// Makes the GL objects of an item that is in memory.
static hw_status begin_upload(hw_store *s, hw_item *item, hw_upload *upload)
{
    uint64_t before = s->account->bytes;
    hw_status status = HW_OK;
    switch (item->key.kind) {
    case HW_DATA_CELL:
        item->cell = take_pool(s);
        if (!item->cell)
            return hw_fail(HW_LIMIT, "more than %u cells", HW_STORE_CELLS_MAX);
        status = hw_cell_gpu_create(s->account, &item->loaded->cell, s->blocks, item->cell, upload);
        break;
    case HW_DATA_LEVEL:
        status = hw_near_level_create(s->account, &item->loaded->level, &item->level, upload);
        break;
    default:
        status = create_texture(s, item, upload);
    }
    item->gpu_bytes = s->account->bytes - before;
    s->gpu_bytes += item->gpu_bytes;
    if (status == HW_OK)
        item->state = HW_ITEM_UPLOADING;
    else
        send_away(s, item);
    return status;
}

static void end_upload(hw_store *s, hw_item *item)
{
    item->state = HW_ITEM_READY;
    item->wait_s = 0;
    // A cell's records are needed as long as it is drawn.
    bool all = item->key.kind != HW_DATA_CELL;
    hw_loader_dispose(s->loader, item->loaded, all);
    if (all)
        item->loaded = NULL;
    s->news++;
}

// The most urgent item of a sort that waits in memory for the GPU, of those that find room there or
// must be there now.
static hw_item *next_upload(hw_store *s, int sort)
{
    hw_item *best = NULL;
    for (uint32_t i = 0; i < s->active_count; i++) {
        hw_item *item = s->active[i];
        bool fits = (item->key.kind == HW_DATA_CELL) == (sort != UPLOAD_SMALL);
        if (item->state == HW_ITEM_IN_RAM && place_of(s, item) != HW_PLACE_RAM && fits &&
            (!best || item->stamp > best->stamp) &&
            (place_of(s, item) == HW_PLACE_NOW ||
             can_make_room(s, bytes_on_gpu(s, item), item->stamp)))
            best = item;
    }
    return best;
}

static void fail_item(hw_store *s, hw_item *item, const char *problem)
{
    item->wait_s = item->wait_s > 0 ? fmin(2 * item->wait_s, WAIT_MOST_S) : WAIT_FIRST_S;
    item->retry_s = s->now_s + item->wait_s;
    item->failed = true;
    s->problem_count++;
    memcpy(s->problem, problem, strlen(problem) + 1);
}

// False: nothing of the sort waits or may go to the GPU.
static bool start_upload(hw_store *s, int sort)
{
    hw_item *item = next_upload(s, sort);
    const hw_item *running = s->uploads[UPLOAD_CELL].item;
    if (sort == UPLOAD_URGENT && (!item || !running || running->stamp >= item->stamp))
        return false;
    if (!item)
        return false;
    if (!can_make_room(s, bytes_on_gpu(s, item), item->stamp) && s->patience++ < PATIENCE)
        return false;
    if (make_gpu_room(s, bytes_on_gpu(s, item), item->stamp))
        s->patience = 0;
    if (begin_upload(s, item, &s->uploads[sort].upload) == HW_OK)
        s->uploads[sort].item = item;
    else
        fail_item(s, item, hw_error_text());
    return true;
}

static void run_uploads(hw_store *s, bool hurry)
{
    uint64_t whole = hurry ? UINT64_MAX : s->frame_bytes, budget = whole;
    for (int sort = 0; sort < UPLOADS; sort++) {
        while (budget > 0) {
            if (!s->uploads[sort].item && !start_upload(s, sort))
                break;
            if (!s->uploads[sort].item)
                continue; // that one failed
            if (!hw_upload_run(&s->uploads[sort].upload, &budget))
                break;
            hw_item *item = s->uploads[sort].item;
            s->uploads[sort].item = NULL;
            end_upload(s, item);
        }
    }
    s->uploaded_bytes += whole - budget;
}

// ---- what the loader sends -------------------------------------------------------------------

static void adopt_table(hw_store *s, hw_loaded *loaded)
{
    near_mesh *mesh = &s->meshes[loaded->key.index];
    mesh->table = loaded->table;
    loaded->table = (hw_mesh_table){0};
    mesh->item.state = HW_ITEM_READY;
    mesh->item.wait_s = 0;
    hw_loader_dispose(s->loader, loaded, true);
    s->news++;
}

// Sizes are kept: an estimate that changes whenever a cell comes or goes would make plans do so
// too.
static void count_cell(hw_store *s, hw_item *item)
{
    if (item->known_ram == 0) {
        s->seen_file_bytes += item->loaded->stored_bytes;
        s->seen_ram_bytes += item->loaded->ram_bytes;
        s->seen_gpu_bytes += bytes_on_gpu(s, item);
    }
    item->known_ram = item->loaded->ram_bytes;
    item->known_gpu = bytes_on_gpu(s, item);
}

static void take_loaded(hw_store *s, hw_loaded *loaded)
{
    hw_item *item = find_item(s, loaded->key);
    if (item && loaded->status != HW_OK)
        fail_item(s, item, loaded->error);
    bool wanted = item && loaded->status == HW_OK && item->state == HW_ITEM_AWAY;
    if (!wanted || (loaded->key.kind != HW_DATA_MESH && !make_place(s))) {
        hw_loader_dispose(s->loader, loaded, true);
        return;
    }
    item->key = loaded->key;
    item->failed = false;
    if (loaded->key.kind == HW_DATA_MESH) {
        adopt_table(s, loaded);
        return;
    }
    activate(s, item, loaded);
    if (loaded->key.kind == HW_DATA_TEXTURE)
        item->known_gpu = bytes_on_gpu(s, item);
    if (loaded->key.kind == HW_DATA_CELL) {
        count_cell(s, item);
        s->news++;
    }
}

void hw_store_begin_frame(hw_store *store, double now_s, bool hurry)
{
    hw_loaded *loaded;
    store->frame++;
    store->now_s = now_s;
    if (store->mode == HW_LOADER_WAITS)
        return;
    while ((loaded = hw_loader_take(store->loader)))
        take_loaded(store, loaded);
    run_uploads(store, hurry);
    make_ram_room(store);
}

void hw_store_simulate(hw_store *store, double now_s)
{
    hw_loader_run(store->loader, now_s);
}

// ---- wishes and needs ------------------------------------------------------------------------

void hw_store_set_timestamp(hw_store *store, uint64_t timestamp)
{
    store->timestamp = timestamp;
    hw_loader_set_timestamp(store->loader, timestamp);
}

void hw_store_want(hw_store *store, hw_data_key key, double t_priority, hw_store_place place)
{
    hw_item *item = find_item(store, key);
    if (!item)
        return;
    item->key = key;
    item->stamp = fmax(item->stamp, t_priority);
    item->place = place;
    hw_wish wish = {key, t_priority};
    if (item->state == HW_ITEM_AWAY && store->now_s >= item->retry_s)
        (void)hw_loader_wish(store->loader, &wish); // too many: it will be wished for again
}

bool hw_store_failed(hw_store *store, hw_data_key key)
{
    const hw_item *item = find_item(store, key);
    return item && item->state == HW_ITEM_AWAY && item->failed;
}

// Takes a piece that was loaded now to the GPU, over the budget if everything there is in use.
static hw_status finish_now(hw_store *s, hw_item *item, hw_loaded *loaded)
{
    hw_upload upload;
    uint64_t budget = UINT64_MAX;
    if (item->key.kind == HW_DATA_MESH) {
        adopt_table(s, loaded);
        return HW_OK;
    }
    if (!make_place(s)) {
        hw_loader_dispose(s->loader, loaded, true);
        return hw_fail(HW_LIMIT, "more than %u pieces of a dataset in use", ACTIVE_MAX);
    }
    activate(s, item, loaded);
    (void)make_gpu_room(s, bytes_on_gpu(s, item), (double)INFINITY);
    HW_TRY(begin_upload(s, item, &upload));
    (void)hw_upload_run(&upload, &budget);
    end_upload(s, item);
    return HW_OK;
}

bool hw_store_is_here(hw_store *store, hw_data_key key)
{
    const hw_item *item = find_item(store, key);
    return item && item->state != HW_ITEM_AWAY;
}

hw_status hw_store_need(hw_store *store, hw_data_key key)
{
    hw_item *item = find_item(store, key);
    assert(item && store->mode != HW_LOADER_THREAD);
    item->used = store->frame;
    item->stamp = (double)store->frame;
    if (item->state == HW_ITEM_READY)
        return HW_OK;
    item->key = key;
    hw_loaded *loaded = hw_loader_load(store->loader, key);
    if (!loaded)
        return HW_MEMORY;
    if (loaded->status == HW_OK)
        return finish_now(store, item, loaded);
    hw_status status = loaded->status;
    hw_error_restore(loaded->error);
    hw_loader_dispose(store->loader, loaded, true);
    return status;
}

// ---- cells -----------------------------------------------------------------------------------

hw_cell_gpu *hw_store_cell(hw_store *store, uint32_t index)
{
    hw_item *item = &store->cells[index];
    return item->state == HW_ITEM_READY ? item->cell : NULL;
}

hw_cell_gpu *hw_store_ready_cell(hw_store *store, uint32_t number)
{
    uint32_t index;
    if (number >= HW_STORE_CELLS_MAX || !store->pool_used[number] ||
        !hw_manifest_find_cell(store->manifest, store->pool[number].id, &index))
        return NULL;
    return hw_store_cell(store, index);
}

const hw_cell_records *hw_store_records(const hw_store *store, uint32_t index)
{
    const hw_item *item = &store->cells[index];
    return item->loaded ? &item->loaded->cell.records : NULL;
}

static uint64_t estimate(const hw_store *s, uint32_t index, uint64_t seen, double ratio)
{
    if (s->seen_file_bytes > 0)
        ratio = (double)seen / (double)s->seen_file_bytes;
    return (uint64_t)(ratio * (double)s->manifest->cells[index].bytes);
}

uint64_t hw_store_cell_gpu_bytes(const hw_store *store, uint32_t index)
{
    uint64_t known = store->cells[index].known_gpu;
    double ratio = store->blocks ? GPU_RATIO_BLOCKS : GPU_RATIO_DECODED;
    return known ? known : estimate(store, index, store->seen_gpu_bytes, ratio);
}

uint64_t hw_store_cell_ram_bytes(const hw_store *store, uint32_t index)
{
    uint64_t known = store->cells[index].known_ram;
    return known ? known : estimate(store, index, store->seen_ram_bytes, RAM_RATIO);
}

uint64_t hw_store_texture_gpu_bytes(const hw_store *store, uint32_t texture)
{
    return store->textures[texture].known_gpu;
}

void hw_store_use_cell(hw_store *store, hw_cell_gpu *cell)
{
    uint32_t index;
    if (hw_manifest_find_cell(store->manifest, cell->id, &index))
        store->cells[index].used = store->frame;
}

// ---- near meshes -----------------------------------------------------------------------------

const hw_mesh_table *hw_store_table(const hw_store *store, uint32_t mesh)
{
    const near_mesh *m = &store->meshes[mesh];
    return m->item.state == HW_ITEM_READY ? &m->table : NULL;
}

uint32_t hw_mesh_table_choose(const hw_mesh_table *table, double error)
{
    uint32_t level = 0;
    while (level + 1 < table->level_count && table->errors[level + 1] <= error)
        level++;
    return level;
}

// The best level that is ready; NULL: none is.
static hw_item *best_level(const hw_mesh_table *table, uint32_t level)
{
    for (uint32_t i = level; i < table->level_count; i++)
        if (table->items[i].state == HW_ITEM_READY)
            return &table->items[i];
    for (uint32_t i = level < table->level_count ? level : table->level_count; i-- > 0;)
        if (table->items[i].state == HW_ITEM_READY)
            return &table->items[i];
    return NULL;
}

const hw_near_level *hw_store_level(hw_store *store, uint32_t mesh, uint32_t level)
{
    const hw_mesh_table *table = hw_store_table(store, mesh);
    hw_item *item = table ? best_level(table, level) : NULL;
    if (!item)
        return NULL;
    item->used = store->frame;
    return &item->level;
}

bool hw_store_has_near(const hw_store *store, const hw_cell_records *records)
{
    for (uint32_t i = 0; i < records->near_count; i++) {
        const hw_manifest_object *object = &store->manifest->objects[records->near[i].object_idx];
        const hw_mesh_table *table = hw_store_table(store, object->mesh_idx);
        if (!table || !best_level(table, 0))
            return false;
        if (object->texture_idx >= 0 && store->textures[object->texture_idx].state != HW_ITEM_READY)
            return false;
    }
    return true;
}

GLuint hw_store_texture(hw_store *store, int32_t texture_idx)
{
    if (texture_idx < 0 || store->textures[texture_idx].state != HW_ITEM_READY)
        return 0;
    store->textures[texture_idx].used = store->frame;
    return store->textures[texture_idx].texture.name;
}

// ---- figures ---------------------------------------------------------------------------------

hw_store_stats hw_store_get_stats(const hw_store *store)
{
    hw_loader_stats loader = hw_loader_get_stats(store->loader);
    return (hw_store_stats){.gpu_bytes = store->gpu_bytes,
                            .gpu_budget = store->gpu_budget,
                            .ram_bytes = loader.ram_bytes,
                            .ram_bytes_peak = loader.ram_peak,
                            .ram_budget = store->ram_budget,
                            .read_bytes = loader.bytes,
                            .uploaded_bytes = store->uploaded_bytes,
                            .queued = loader.queued,
                            .news = store->news,
                            .problem_count = store->problem_count,
                            .slept_s = hw_loader_slept(store->loader),
                            .problem = store->problem};
}

uint64_t hw_store_gpu_budget(const hw_store *store)
{
    return store->gpu_budget;
}

uint64_t hw_store_gpu_room(const hw_store *store)
{
    uint64_t used = 0;
    for (uint32_t i = 0; i < store->active_count; i++)
        if (!may_go(store, store->active[i], (double)INFINITY))
            used += store->active[i]->gpu_bytes;
    return used < store->gpu_budget ? store->gpu_budget - used : 0;
}

uint64_t hw_store_ram_budget(const hw_store *store)
{
    return store->ram_budget;
}

// ---- making and freeing ----------------------------------------------------------------------

hw_status hw_store_create(const hw_store_desc *desc, hw_store **out)
{
    hw_status status = HW_OK;
    hw_store *s = NULL;
    *out = NULL;
    HW_TRY(HW_NEW(&s, 1));
    s->manifest = desc->manifest;
    s->account = desc->account;
    s->mode = desc->mode;
    uint64_t usual = desc->mode == HW_LOADER_WAITS ? HW_STORE_GPU_WAITING : HW_STORE_GPU_BUDGET;
    s->gpu_budget = desc->gpu_budget ? desc->gpu_budget : usual * desc->manifest->grid.levels;
    s->ram_budget = desc->ram_budget ? desc->ram_budget : HW_STORE_RAM_BUDGET;
    s->frame_bytes = desc->frame_bytes ? desc->frame_bytes : HW_STORE_FRAME_BYTES;
    if (s->frame_bytes < HW_UPLOAD_BUDGET_MIN)
        s->frame_bytes = HW_UPLOAD_BUDGET_MIN;
    // Who streams would rather have more cells at hand than the last bit of speed.
    s->blocks = hw_gpu_has_fast_blocks() || (hw_gpu_has_blocks() && desc->mode != HW_LOADER_WAITS);
    HW_GO(HW_NEW(&s->cells, desc->manifest->cell_count));
    HW_GO(HW_NEW(&s->meshes, desc->manifest->mesh_count));
    HW_GO(HW_NEW(&s->textures, desc->manifest->texture_count));
    HW_GO(HW_NEW(&s->active, ACTIVE_MAX));
    const hw_loader_desc loader = {.location = desc->location,
                                   .manifest = desc->manifest,
                                   .bytes_per_second = desc->bytes_per_second,
                                   .ram_budget = s->ram_budget,
                                   .mode = desc->mode};
    HW_GO(hw_loader_create(&loader, &s->loader));
    *out = s;
    return HW_OK;
out:
    hw_store_destroy(s);
    return status;
}

void hw_store_destroy(hw_store *store)
{
    if (!store)
        return;
    while (store->active_count > 0)
        send_away(store, store->active[store->active_count - 1]);
    for (uint32_t i = 0; store->meshes && i < store->manifest->mesh_count; i++) {
        hw_free(store->meshes[i].table.errors);
        hw_free(store->meshes[i].table.gpu_bytes);
        hw_free(store->meshes[i].table.triangles);
        hw_free(store->meshes[i].table.items);
    }
    hw_loader_destroy(store->loader);
    hw_free(store->cells);
    hw_free(store->meshes);
    hw_free(store->textures);
    hw_free(store->active);
    hw_free(store);
}
