#include "prefetch.h"
#include "alloc.h"
#include "cull.h"
#include "hierarchy.h"
#include <math.h>

#define PLAN_CELLS_MAX (19u * HW_CELL_LEVELS_MAX) // the viewer's, two rings; and what holds them
#define PLAN_NEAR_MAX  512u

// Weights of what makes a cell urgent; their sum stays below PRIORITY_HERE.
#define WEIGHT_CLOSE   0.55
#define WEIGHT_MOTION  0.15
#define WEIGHT_AIM     0.12
#define WEIGHT_FRUSTUM 0.08
#define CLOSE_CELLS    0.4  // the distance, in cell sizes, at which half of the first is left
#define PRIORITY_HERE  0.95 // the viewer's own cell
#define PRIORITY_MUST  0.96 // without which it cannot be drawn
#define PRIORITY_LACK  0.99 // what the present frame lacks

#define CELLS_GPU_SHARE 0.8  // of the GPU's budget
#define CELLS_RAM_SHARE 0.45 // of the memory budget; the store lets half of it lie
#define AHEAD_S         1.0  // for so long levels of near meshes are foreseen
#define AHEAD_LEAST     4.0  // units
#define AHEAD_MOST      60.0
#define SMOOTH_S        0.25 // over which motion is averaged
#define WAY_WEIGHT      0.5  // of what is walked before, against the distance from there
#define REPLAN_S        0.5  // plans are made again after that, for what failed or was lost
#define SECOND_RING_COS 0.7  // of the second ring only what lies ahead

typedef struct plan_entry {
    hw_data_key key;
    double priority;
    uint64_t gpu_bytes;
} plan_entry;

// A cell of level 0 that may be entered.
typedef struct candidate {
    hw_cell_id id;
    double priority;
    hw_vec3 entry;
} candidate;

struct hw_prefetch {
    hw_store *store;
    const hw_manifest *manifest;
    const float *stretch;
    double near_error_px;
    uint64_t timestamp;
    uint32_t news; // of the store, when the plan was made
    bool started;
    hw_vec3 last_eye, tick_eye, tick_aim;
    double last_s, plan_s;
    double velocity[2]; // smoothed
    hw_prefetch_view view;
    candidate candidates[19];
    uint32_t candidate_count;
    plan_entry cells[PLAN_CELLS_MAX], near[PLAN_NEAR_MAX];
    uint32_t cell_count, near_count;
};

// ---- priorities ------------------------------------------------------------------------------

static hw_vec3 horizontal(hw_vec3 v)
{
    hw_vec3 flat = hw_v3(v.x, v.y, 0);
    return hw_v3_length(flat) > 1e-6f ? hw_v3_normalize(flat) : hw_v3(0, 0, 0);
}

// 1 towards `to`, 0 away from it.
static double towards(hw_vec3 direction, hw_vec3 to)
{
    return 0.5 + 0.5 * (double)hw_v3_dot(direction, to);
}

double hw_prefetch_priority(const hw_prefetch_view *view, hw_vec3 centre, double distance,
                            double cell_size)
{
    hw_vec3 to = horizontal(hw_v3_sub(centre, view->eye));
    bool moves = hw_v3_length(view->motion) > 0;
    double aim = towards(view->aim, to), motion = moves ? towards(view->motion, to) : aim;
    bool inside = acos(fmin(fmax(2 * aim - 1, -1), 1)) <= view->half_fov_rad;
    return WEIGHT_CLOSE / (1 + distance / (CLOSE_CELLS * cell_size)) + WEIGHT_MOTION * motion +
           WEIGHT_AIM * aim + (inside ? WEIGHT_FRUSTUM : 0);
}

static hw_vec3 closest_on_edge(hw_vec3 a, hw_vec3 b, hw_vec3 p)
{
    hw_vec3 d = hw_v3_sub(b, a);
    float t = hw_v3_dot(hw_v3_sub(p, a), d) / hw_v3_dot(d, d);
    return hw_v3_mad(a, d, fminf(fmaxf(t, 0), 1));
}

hw_vec3 hw_prefetch_entry(const hw_hexgrid *grid, hw_cell_id id, hw_vec3 from)
{
    hw_vec3 corners[HW_CELL_CORNERS], best = from;
    hw_cell_id at = hw_hexgrid_locate(grid, (double)from.x, (double)from.y);
    float least = INFINITY;
    if (at.q == id.q && at.r == id.r)
        return from;
    hw_cell_corners(grid, id, corners);
    for (int i = 0; i < 6; i++) {
        hw_vec3 a = corners[i], b = corners[(i + 1) % 6];
        a.z = b.z = from.z;
        hw_vec3 p = closest_on_edge(a, b, from);
        float d = hw_v3_length(hw_v3_sub(p, from));
        if (d < least) {
            least = d;
            best = p;
        }
    }
    return best;
}

double hw_prefetch_distance(const hw_prefetch_view *view, const hw_hexgrid *grid, hw_cell_id id)
{
    static const double seconds[] = {0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3};
    double least = (double)INFINITY;
    for (size_t i = 0; i < sizeof seconds / sizeof *seconds; i++) {
        double way = view->speed * seconds[i];
        hw_vec3 then = hw_v3_mad(view->eye, view->motion, (float)way);
        hw_vec3 entry = hw_prefetch_entry(grid, id, then);
        least = fmin(least, (double)hw_v3_length(hw_v3_sub(entry, then)) + WAY_WEIGHT * way);
    }
    return least;
}

// ---- following the viewer --------------------------------------------------------------------

static void follow(hw_prefetch *p, const hw_camera *camera, double now_s)
{
    hw_vec3 aim = horizontal(camera->forward);
    if (!p->started) {
        p->started = true;
        p->timestamp = 1;
        p->last_eye = p->tick_eye = camera->eye;
        p->tick_aim = aim;
        p->last_s = now_s;
    }
    double dt = now_s - p->last_s;
    if (dt > 0) {
        double mix = fmin(dt / SMOOTH_S, 1);
        hw_vec3 moved = hw_v3_sub(camera->eye, p->last_eye);
        p->velocity[0] += mix * ((double)moved.x / dt - p->velocity[0]);
        p->velocity[1] += mix * ((double)moved.y / dt - p->velocity[1]);
        p->last_s = now_s;
        p->last_eye = camera->eye;
    }
    hw_prefetch_view *v = &p->view;
    v->eye = camera->eye;
    v->aim = aim;
    v->speed = hypot(p->velocity[0], p->velocity[1]);
    v->motion = v->speed > 0.5 ? horizontal(hw_v3((float)p->velocity[0], (float)p->velocity[1], 0))
                               : hw_v3(0, 0, 0);
    double aspect = camera->height > 0 ? (double)camera->width / camera->height : 1;
    v->half_fov_rad = atan(tan((double)camera->fov_degrees * HW_PI / 360) * aspect);
}

// Whether the timestamp advances.
static bool tick(hw_prefetch *p)
{
    double moved = (double)hw_v3_length(hw_v3_sub(p->view.eye, p->tick_eye));
    double turned = acos(fmin(fmax((double)hw_v3_dot(p->view.aim, p->tick_aim), -1), 1));
    if (moved < HW_PREFETCH_MOVE * p->manifest->grid.cell_size && turned < HW_PREFETCH_TURN_RAD)
        return false;
    p->tick_eye = p->view.eye;
    p->tick_aim = p->view.aim;
    p->timestamp++;
    return true;
}

// ---- cells that may be entered ---------------------------------------------------------------

static void add_candidate(hw_prefetch *p, hw_cell_id id, bool ahead_only)
{
    const hw_hexgrid *grid = &p->manifest->grid;
    if (!hw_hexgrid_contains(grid, id))
        return;
    for (uint32_t i = 0; i < p->candidate_count; i++)
        if (p->candidates[i].id.q == id.q && p->candidates[i].id.r == id.r)
            return;
    hw_vec3 centre = hw_cell_centre(grid, id), to = horizontal(hw_v3_sub(centre, p->view.eye));
    if (ahead_only && (double)hw_v3_dot(p->view.motion, to) < SECOND_RING_COS)
        return;
    hw_vec3 entry = hw_prefetch_entry(grid, id, p->view.eye);
    double distance = hw_prefetch_distance(&p->view, grid, id);
    double priority = PRIORITY_HERE;
    if (p->candidate_count > 0)
        priority = hw_prefetch_priority(&p->view, centre, distance, grid->cell_size);
    p->candidates[p->candidate_count++] = (candidate){id, priority, entry};
}

static void find_candidates(hw_prefetch *p)
{
    const hw_hexgrid *grid = &p->manifest->grid;
    hw_cell_id ring[6], second[6];
    p->candidate_count = 0;
    hw_cell_id here = hw_hexgrid_locate(grid, (double)p->view.eye.x, (double)p->view.eye.y);
    add_candidate(p, here, false);
    hw_cell_neighbours(here, ring);
    for (int i = 0; i < 6; i++)
        add_candidate(p, ring[i], false);
    for (int i = 0; i < 6; i++) {
        hw_cell_neighbours(ring[i], second);
        for (int k = 0; k < 6; k++)
            add_candidate(p, second[k], true);
    }
}

// ---- plans -----------------------------------------------------------------------------------

// Adds an entry, or raises the priority of one with its key.
static void plan(plan_entry *entries, uint32_t *count, uint32_t capacity, const plan_entry *add)
{
    for (uint32_t i = 0; i < *count; i++) {
        if (!hw_data_key_equal(entries[i].key, add->key))
            continue;
        entries[i].priority = fmax(entries[i].priority, add->priority);
        return;
    }
    if (*count < capacity)
        entries[(*count)++] = *add;
}

// Heap sort, most urgent first: qsort may allocate.
static void sift(plan_entry *entries, uint32_t root, uint32_t count)
{
    while (2 * root + 1 < count) {
        uint32_t child = 2 * root + 1;
        if (child + 1 < count && entries[child + 1].priority < entries[child].priority)
            child++;
        if (entries[root].priority <= entries[child].priority)
            return;
        plan_entry swap = entries[root];
        entries[root] = entries[child];
        entries[child] = swap;
        root = child;
    }
}

static void sort_plan(plan_entry *entries, uint32_t count)
{
    for (uint32_t i = count / 2; i-- > 0;)
        sift(entries, i, count);
    for (uint32_t end = count; end-- > 1;) {
        plan_entry swap = entries[0];
        entries[0] = entries[end];
        entries[end] = swap;
        sift(entries, 0, end);
    }
}

static void want(hw_prefetch *p, const plan_entry *e, hw_store_place place)
{
    hw_store_want(p->store, e->key, (double)p->timestamp + e->priority, place);
}

// The candidates and the groups that hold them.
static void plan_cells(hw_prefetch *p)
{
    p->cell_count = 0;
    for (uint32_t i = 0; i < p->candidate_count; i++) {
        hw_cell_id id = p->candidates[i].id;
        for (int32_t l = 0; l < p->manifest->grid.levels; l++, id = hw_cell_parent(id)) {
            plan_entry e = {.key = {.kind = HW_DATA_CELL}, .priority = p->candidates[i].priority};
            if (!hw_manifest_find_cell(p->manifest, id, &e.key.index))
                continue;
            e.gpu_bytes = hw_store_cell_gpu_bytes(p->store, e.key.index);
            plan(p->cells, &p->cell_count, PLAN_CELLS_MAX, &e);
        }
    }
    sort_plan(p->cells, p->cell_count);
}

// As many as the budgets hold, in order: first for the GPU, then for memory. Returns the bytes on
// the GPU.
static uint64_t want_cells(hw_prefetch *p)
{
    uint64_t gpu_limit = (uint64_t)(CELLS_GPU_SHARE * (double)hw_store_gpu_budget(p->store));
    uint64_t ram_limit = (uint64_t)(CELLS_RAM_SHARE * (double)hw_store_ram_budget(p->store));
    uint64_t gpu = 0, ram = 0;
    for (uint32_t i = 0; i < p->cell_count; i++) {
        const plan_entry *e = &p->cells[i];
        bool here = e->priority >= PRIORITY_HERE;
        if (here || (ram == 0 && gpu + e->gpu_bytes <= gpu_limit)) {
            gpu += e->gpu_bytes;
            want(p, e, here ? HW_PLACE_NOW : HW_PLACE_GPU);
            continue;
        }
        ram += hw_store_cell_ram_bytes(p->store, e->key.index);
        if (ram > ram_limit)
            break;
        want(p, e, HW_PLACE_RAM);
    }
    return gpu;
}

uint32_t hw_prefetch_level(const hw_mesh_table *table, double near_error_px, double focal_px,
                           double stretch, double distance)
{
    if (!(distance > 0))
        return 0;
    return hw_mesh_table_choose(table, near_error_px * distance / focal_px / stretch);
}

// The levels that an object may need from its cell's entry on.
static void plan_levels(hw_prefetch *p, const candidate *c, uint32_t object_idx, double focal_px)
{
    const hw_manifest_object *object = &p->manifest->objects[object_idx];
    const hw_mesh_table *table = hw_store_table(p->store, object->mesh_idx);
    plan_entry e = {.key = {HW_DATA_MESH, object->mesh_idx, 0}, .priority = c->priority};
    if (!table) {
        want(p, &e, HW_PLACE_GPU);
        return;
    }
    double error_px = p->near_error_px, stretch = (double)p->stretch[object_idx];
    double distance = (double)hw_box_distance(object->bounds, c->entry);
    double ahead = fmin(fmax(p->view.speed * AHEAD_S, AHEAD_LEAST), AHEAD_MOST);
    uint32_t now = hw_prefetch_level(table, error_px, focal_px, stretch, distance);
    uint32_t first = hw_prefetch_level(table, error_px, focal_px, stretch, distance - ahead);
    uint32_t last = hw_prefetch_level(table, error_px, focal_px, stretch, distance + ahead);
    for (uint32_t l = first; l <= last; l++) {
        uint32_t away = l < now ? now - l : l - now;
        e.key = (hw_data_key){HW_DATA_LEVEL, object->mesh_idx, l};
        e.priority = c->priority * (1 - 0.1 * fmin(away, 5));
        e.gpu_bytes = table->gpu_bytes[l];
        plan(p->near, &p->near_count, PLAN_NEAR_MAX, &e);
    }
    // The coarsest, to fall back on.
    e.key.level = table->level_count - 1;
    e.priority = c->priority < PRIORITY_HERE ? c->priority : PRIORITY_MUST;
    e.gpu_bytes = table->gpu_bytes[e.key.level];
    plan(p->near, &p->near_count, PLAN_NEAR_MAX, &e);
}

static void plan_near(hw_prefetch *p, double focal_px)
{
    uint32_t index;
    p->near_count = 0;
    for (uint32_t i = 0; i < p->candidate_count; i++) {
        const candidate *c = &p->candidates[i];
        if (!hw_manifest_find_cell(p->manifest, c->id, &index))
            continue;
        const hw_cell_records *records = hw_store_records(p->store, index);
        for (uint32_t k = 0; records && k < records->near_count; k++) {
            uint32_t object_idx = records->near[k].object_idx;
            int32_t texture = p->manifest->objects[object_idx].texture_idx;
            plan_entry e = {.key = {HW_DATA_TEXTURE, (uint32_t)texture, 0},
                            .priority = c->priority < PRIORITY_HERE ? c->priority : PRIORITY_MUST};
            plan_levels(p, c, object_idx, focal_px);
            if (texture >= 0)
                plan(p->near, &p->near_count, PLAN_NEAR_MAX, &e);
        }
    }
    sort_plan(p->near, p->near_count);
}

static void want_near(hw_prefetch *p, uint64_t cell_bytes)
{
    uint64_t bytes = cell_bytes, budget = hw_store_gpu_budget(p->store);
    for (uint32_t i = 0; i < p->near_count; i++) {
        bool must = p->near[i].priority >= PRIORITY_MUST;
        bytes += p->near[i].gpu_bytes;
        if (bytes > budget && !must)
            return;
        want(p, &p->near[i], must ? HW_PLACE_NOW : HW_PLACE_GPU);
    }
}

void hw_prefetch_update(hw_prefetch *prefetch, const hw_camera *camera, double now_s)
{
    hw_prefetch *p = prefetch;
    bool first = !p->started;
    follow(p, camera, now_s);
    uint32_t news = hw_store_get_stats(p->store).news;
    bool ticked = tick(p);
    if (!ticked && !first && news == p->news && now_s < p->plan_s + REPLAN_S)
        return;
    p->plan_s = now_s;
    p->news = news;
    hw_store_set_timestamp(p->store, p->timestamp);
    find_candidates(p);
    plan_cells(p);
    uint64_t cell_bytes = want_cells(p);
    plan_near(p, hw_camera_focal_px(camera));
    want_near(p, cell_bytes);
}

void hw_prefetch_set_error(hw_prefetch *prefetch, double error_px)
{
    prefetch->near_error_px = error_px;
}

void hw_prefetch_urge(hw_prefetch *prefetch, hw_data_key key)
{
    hw_store_want(prefetch->store, key, (double)prefetch->timestamp + PRIORITY_LACK, HW_PLACE_GPU);
}

// ---- making and freeing ----------------------------------------------------------------------

hw_status hw_prefetch_create(hw_store *store, const hw_manifest *manifest, const float *stretch,
                             hw_prefetch **out)
{
    hw_prefetch *p = NULL;
    *out = NULL;
    HW_TRY(HW_NEW(&p, 1));
    p->store = store;
    p->manifest = manifest;
    p->stretch = stretch;
    p->near_error_px = manifest->near_error_px;
    *out = p;
    return HW_OK;
}

void hw_prefetch_destroy(hw_prefetch *prefetch)
{
    hw_free(prefetch);
}
