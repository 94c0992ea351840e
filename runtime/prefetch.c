#include "prefetch.h"
#include "alloc.h"
#include "crossing.h"
#include "cull.h"
#include "hierarchy.h"
#include <math.h>

#define CANDIDATES_MAX 19u  // the viewer's cell and two rings
#define PLAN_LEVELS    512u // levels of near meshes in a plan, beside what each cannot do without

// Weights of what makes a cell urgent; their sum stays below PRIORITY_HERE.
#define WEIGHT_CLOSE   0.55
#define WEIGHT_MOTION  0.15
#define WEIGHT_AIM     0.12
#define WEIGHT_FRUSTUM 0.08
#define CLOSE_CELLS    0.4   // the distance, in cell sizes, at which half of the first is left
#define PRIORITY_SHOWN 0.94  // what the frame shows of other cells
#define PRIORITY_HERE  0.95  // the viewer's own cell
#define PRIORITY_MUST  0.96  // without which it cannot be drawn
#define PRIORITY_LACK  0.99  // what the present frame lacks
#define BEFORE         0.005 // a cell's fall-backs come before it: it is not shown without them

#define CELLS_RAM_SHARE 0.45 // of the memory budget; the store lets half of it lie
#define AHEAD_S         1.0  // from where a cell is shown on, for so long levels are foreseen
#define AROUND          4.0  // units: levels this much nearer and farther are foreseen
#define AROUND_SHARE    0.9  // of the priority
#define SMOOTH_S        0.25 // over which motion is averaged
#define WAY_WEIGHT      0.5  // of what is walked before, against the distance from there
#define HELD            0.3  // of the way to PRIORITY_SHOWN, for what is there or will be shown
#define REPLAN_S        0.5  // plans are made again after that, for what failed or was lost
#define SECOND_RING_COS 0.7  // of the second ring only what lies ahead

// Points of the way of a viewer who goes on as he does.
#define WAY_POINTS 8u
static const double way_seconds[WAY_POINTS] = {0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3};

typedef struct plan_entry {
    hw_data_key key;
    double priority;
    uint64_t gpu_bytes;
    bool shown; // by frames on the way
} plan_entry;

// A cell of level 0 that may be shown.
typedef struct candidate {
    hw_cell_id id;
    double priority;
    hw_vec3 entry;
    uint32_t shown; // bit i: at point i of the way frames show it
} candidate;

struct hw_prefetch {
    hw_store *store;
    const hw_manifest *manifest;
    const float *stretch;
    double crossing_width, near_error_px, focal_px;
    uint64_t timestamp;
    uint32_t news; // of the store, when the plan was made
    bool started;
    hw_vec3 last_eye, tick_eye, tick_aim;
    double last_s, plan_s;
    double velocity[2]; // smoothed
    hw_prefetch_view view;
    hw_vec3 way[WAY_POINTS];
    hw_crossing crossings[WAY_POINTS]; // there
    candidate candidates[CANDIDATES_MAX];
    uint32_t candidate_count;
    plan_entry *plan;
    uint32_t plan_count, plan_capacity;
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
    double least = (double)INFINITY;
    for (uint32_t i = 0; i < WAY_POINTS; i++) {
        double way = view->speed * way_seconds[i];
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

// ---- cells that may be shown -----------------------------------------------------------------

static bool is_same(hw_cell_id a, hw_cell_id b)
{
    return hw_cell_compare(a, b) == 0;
}

// Where the viewer will be, and what frames will show there.
static void find_way(hw_prefetch *p)
{
    const hw_hexgrid *grid = &p->manifest->grid;
    for (uint32_t i = 0; i < WAY_POINTS; i++) {
        hw_vec3 at =
            hw_v3_mad(p->view.eye, p->view.motion, (float)(p->view.speed * way_seconds[i]));
        hw_cell_id id = hw_hexgrid_locate(grid, (double)at.x, (double)at.y);
        p->way[i] = at;
        p->crossings[i] = hw_crossing_at(grid, id, at, p->crossing_width);
    }
}

static uint32_t find_shown(const hw_prefetch *p, hw_cell_id id)
{
    uint32_t shown = 0;
    for (uint32_t i = 0; i < WAY_POINTS; i++)
        for (uint32_t k = 0; k < p->crossings[i].count; k++)
            if (is_same(p->crossings[i].cells[k], id))
                shown |= 1u << i;
    return shown;
}

// Way to the last point before the first at which the cell is shown, of which there is one.
static double way_to(const hw_prefetch *p, uint32_t shown)
{
    uint32_t i = 0;
    while (!(shown >> i & 1))
        i++;
    return p->view.speed * way_seconds[i > 0 ? i - 1 : 0];
}

// What is needed after so much way, as a share of the priority of what is needed now.
static double share_after(const hw_prefetch *p, double way)
{
    return 1 / (1 + WAY_WEIGHT * way / (CLOSE_CELLS * p->manifest->grid.cell_size));
}

static void add_candidate(hw_prefetch *p, hw_cell_id id, bool ahead_only)
{
    const hw_hexgrid *grid = &p->manifest->grid;
    if (!hw_hexgrid_contains(grid, id))
        return;
    for (uint32_t i = 0; i < p->candidate_count; i++)
        if (is_same(p->candidates[i].id, id))
            return;
    hw_vec3 centre = hw_cell_centre(grid, id), to = horizontal(hw_v3_sub(centre, p->view.eye));
    uint32_t shown = find_shown(p, id);
    if (ahead_only && !shown && (double)hw_v3_dot(p->view.motion, to) < SECOND_RING_COS)
        return;
    hw_vec3 entry = hw_prefetch_entry(grid, id, p->view.eye);
    double distance = hw_prefetch_distance(&p->view, grid, id);
    double priority = hw_prefetch_priority(&p->view, centre, distance, grid->cell_size);
    if (p->candidate_count == 0)
        priority = PRIORITY_HERE;
    else if (shown)
        priority =
            fmin(fmax(priority, PRIORITY_SHOWN * share_after(p, way_to(p, shown))), PRIORITY_SHOWN);
    p->candidates[p->candidate_count++] = (candidate){id, priority, entry, shown};
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
static void plan(hw_prefetch *p, const plan_entry *add)
{
    for (uint32_t i = 0; i < p->plan_count; i++) {
        if (!hw_data_key_equal(p->plan[i].key, add->key))
            continue;
        p->plan[i].priority = fmax(p->plan[i].priority, add->priority);
        p->plan[i].shown |= add->shown;
        return;
    }
    if (p->plan_count < p->plan_capacity)
        p->plan[p->plan_count++] = *add;
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

// The candidates and the groups that hold them.
static void plan_cells(hw_prefetch *p)
{
    for (uint32_t i = 0; i < p->candidate_count; i++) {
        hw_cell_id id = p->candidates[i].id;
        for (int32_t l = 0; l < p->manifest->grid.levels; l++, id = hw_cell_parent(id)) {
            plan_entry e = {.key = {.kind = HW_DATA_CELL},
                            .priority = p->candidates[i].priority,
                            .shown = p->candidates[i].shown};
            if (!hw_manifest_find_cell(p->manifest, id, &e.key.index))
                continue;
            e.gpu_bytes = hw_store_cell_gpu_bytes(p->store, e.key.index);
            plan(p, &e);
        }
    }
}

uint32_t hw_prefetch_level(const hw_mesh_table *table, double near_error_px, double focal_px,
                           double stretch, double distance)
{
    if (!(distance > 0))
        return 0;
    return hw_mesh_table_choose(table, near_error_px * distance / focal_px / stretch);
}

// An object that is near in a candidate.
typedef struct near_object {
    const hw_manifest_object *object;
    const hw_mesh_table *table;
    double stretch;
    bool shown; // the candidate is, on the way
} near_object;

static uint32_t level_at(const hw_prefetch *p, const near_object *n, double distance)
{
    return hw_prefetch_level(n->table, p->near_error_px, p->focal_px, n->stretch, distance);
}

static void plan_level(hw_prefetch *p, const near_object *n, uint32_t level, double priority)
{
    const plan_entry e = {.key = {HW_DATA_LEVEL, n->object->mesh_idx, level},
                          .priority = priority,
                          .gpu_bytes = n->table->gpu_bytes[level],
                          .shown = n->shown};
    plan(p, &e);
}

// The levels from one distance to another.
static void plan_range(hw_prefetch *p, const near_object *n, double from, double to,
                       double priority)
{
    uint32_t end = level_at(p, n, fmax(from, to));
    for (uint32_t l = level_at(p, n, fmin(from, to)); l <= end; l++)
        plan_level(p, n, l, priority);
}

static double distance_from(const near_object *n, hw_vec3 eye)
{
    return (double)hw_box_distance(n->object->bounds, eye);
}

// Where frames begin to show a cell with this entry.
static hw_vec3 find_strip(const hw_prefetch *p, hw_vec3 entry)
{
    double strip = p->crossing_width * p->manifest->grid.cell_size;
    hw_vec3 back = hw_v3_sub(p->view.eye, entry);
    double away = (double)hw_v3_length(back);
    return away > strip ? hw_v3_mad(entry, back, (float)(strip / away)) : p->view.eye;
}

// The levels that frames will choose: round the present one, and on the way. Elsewhere those for
// the shortest way in.
static void plan_levels(hw_prefetch *p, const candidate *c, const near_object *n)
{
    double here = distance_from(n, p->view.eye);
    if (!c->shown) {
        plan_range(p, n, distance_from(n, find_strip(p, c->entry)), distance_from(n, c->entry),
                   c->priority);
        return;
    }
    double start = way_to(p, c->shown), last = here;
    if (c->shown & 1) {
        plan_level(p, n, level_at(p, n, here), c->priority);
        plan_range(p, n, fmax(here - AROUND, fmin(here, 1)), here + AROUND,
                   c->priority * AROUND_SHARE);
    }
    for (uint32_t i = 1; i < WAY_POINTS; i++) {
        // No one walks through it.
        double distance = fmax(distance_from(n, p->way[i]), fmin(here, AROUND));
        double way = fmax(p->view.speed * way_seconds[i - 1] - start, 0);
        if (way > p->view.speed * AHEAD_S)
            return;
        if (c->shown >> i & 1) // somewhere between the points it began to be
            plan_range(p, n, last, distance, c->priority * share_after(p, way));
        last = distance;
    }
}

// What the candidate cannot be shown without of an object that is near in it.
static void plan_object(hw_prefetch *p, const candidate *c, const near_object *n)
{
    double first = c->priority < PRIORITY_HERE ? c->priority + BEFORE : PRIORITY_MUST;
    plan_entry e = {
        .key = {HW_DATA_MESH, n->object->mesh_idx, 0}, .priority = first, .shown = n->shown};
    if (n->table)
        plan_level(p, n, n->table->level_count - 1, first); // to fall back on
    else
        plan(p, &e);
    if (n->object->texture_idx < 0)
        return;
    e.key = (hw_data_key){HW_DATA_TEXTURE, (uint32_t)n->object->texture_idx, 0};
    e.gpu_bytes = hw_store_texture_gpu_bytes(p->store, e.key.index);
    plan(p, &e);
}

// Of all candidates first what they cannot do without, then levels, as far as there is place.
static void plan_near(hw_prefetch *p, bool levels)
{
    uint32_t index;
    for (uint32_t i = 0; i < p->candidate_count; i++) {
        const candidate *c = &p->candidates[i];
        if (!hw_manifest_find_cell(p->manifest, c->id, &index))
            continue;
        const hw_cell_records *records = hw_store_records(p->store, index);
        for (uint32_t k = 0; records && k < records->near_count; k++) {
            uint32_t object_idx = records->near[k].object_idx;
            const hw_manifest_object *object = &p->manifest->objects[object_idx];
            const near_object n = {.object = object,
                                   .table = hw_store_table(p->store, object->mesh_idx),
                                   .stretch = (double)p->stretch[object_idx],
                                   .shown = c->shown};
            if (!levels)
                plan_object(p, c, &n);
            else if (n.table)
                plan_levels(p, c, &n);
        }
    }
}

// ---- wishes ----------------------------------------------------------------------------------

static void want(hw_prefetch *p, const plan_entry *e, hw_store_place place)
{
    hw_store_want(p->store, e->key, (double)p->timestamp + e->priority, place);
}

static bool is_cell(const plan_entry *e)
{
    return e->key.kind == HW_DATA_CELL;
}

static bool is_indispensable(const plan_entry *e)
{
    return e->priority >= (is_cell(e) ? PRIORITY_HERE : PRIORITY_MUST);
}

// Where the budget ends in the middle of the plan, what may never be shown does not push out what
// is there for being a little more urgent: else pieces would come and go with every turn.
static void hold(hw_prefetch *p)
{
    for (uint32_t i = 0; i < p->plan_count; i++) {
        plan_entry *e = &p->plan[i];
        if (e->priority < PRIORITY_SHOWN && (e->shown || hw_store_is_here(p->store, e->key)))
            e->priority += HELD * (PRIORITY_SHOWN - e->priority);
    }
}

// As much as the GPU's budget holds, in order; of the cells that it does not, as many as there is
// memory for.
static void want_plan(hw_prefetch *p)
{
    uint64_t gpu_budget = hw_store_gpu_budget(p->store), gpu = 0, ram = 0;
    uint64_t ram_limit = (uint64_t)(CELLS_RAM_SHARE * (double)hw_store_ram_budget(p->store));
    for (uint32_t i = 0; i < p->plan_count; i++) {
        const plan_entry *e = &p->plan[i];
        bool must = is_indispensable(e), later = is_cell(e) && ram > 0;
        if (must || (!later && gpu + e->gpu_bytes <= gpu_budget)) {
            gpu += e->gpu_bytes;
            want(p, e, must ? HW_PLACE_NOW : HW_PLACE_GPU);
        } else if (is_cell(e) && ram <= ram_limit) {
            ram += hw_store_cell_ram_bytes(p->store, e->key.index);
            if (ram <= ram_limit)
                want(p, e, HW_PLACE_RAM);
        }
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
    p->plan_count = 0;
    p->focal_px = hw_camera_focal_px(camera);
    find_way(p);
    find_candidates(p);
    plan_cells(p);
    plan_near(p, false);
    plan_near(p, true);
    hold(p);
    sort_plan(p->plan, p->plan_count);
    want_plan(p);
}

void hw_prefetch_set_error(hw_prefetch *prefetch, double error_px)
{
    prefetch->near_error_px = error_px;
}

void hw_prefetch_urge(hw_prefetch *prefetch, hw_data_key key)
{
    const hw_mesh_table *table = hw_store_table(prefetch->store, key.index);
    uint64_t room = hw_store_gpu_room(prefetch->store);
    while (key.level < table->level_count && table->gpu_bytes[key.level] > room)
        key.level++;
    for (uint32_t l = 0; l <= key.level && l < table->level_count; l++)
        if (table->items[l].state == HW_ITEM_READY)
            return; // what is drawn is as fine
    if (key.level == table->level_count)
        return;
    hw_store_want(prefetch->store, key, (double)prefetch->timestamp + PRIORITY_LACK, HW_PLACE_GPU);
}

// ---- making and freeing ----------------------------------------------------------------------

hw_status hw_prefetch_create(hw_store *store, const hw_manifest *manifest, const float *stretch,
                             double crossing_width, hw_prefetch **out)
{
    hw_prefetch *p = NULL;
    *out = NULL;
    HW_TRY(HW_NEW(&p, 1));
    p->store = store;
    p->manifest = manifest;
    p->stretch = stretch;
    p->crossing_width = crossing_width;
    p->near_error_px = manifest->near_error_px;
    p->plan_capacity = CANDIDATES_MAX * (uint32_t)manifest->grid.levels + manifest->mesh_count +
                       manifest->texture_count + PLAN_LEVELS;
    hw_status status = HW_NEW(&p->plan, p->plan_capacity);
    if (status != HW_OK) {
        hw_prefetch_destroy(p);
        return status;
    }
    *out = p;
    return HW_OK;
}

void hw_prefetch_destroy(hw_prefetch *prefetch)
{
    if (!prefetch)
        return;
    hw_free(prefetch->plan);
    hw_free(prefetch);
}
