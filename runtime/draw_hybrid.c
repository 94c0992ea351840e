// Configuration C: near objects as shaded geometry, far ones as the cell's textured meshes
// (projective-alike texture mapping, thesis 5.2.2).
#include "alloc.h"
#include "cell_gpu.h"
#include "crossing.h"
#include "far_views.h"
#include "ground.h"
#include "hierarchy.h"
#include "prefetch.h"
#include "renderer_internal.h"
#include "shaders.h"
#include "store.h"
#include "system.h"
#include <math.h>
#include <string.h>
#include <time.h>

#define SCRATCH_RECORDS_MAX 65536u // far records that there is room for from the start, at most
#define FIRST_WAIT_S        0.002  // between looks, while there is nothing to draw
#define FIRST_NEAR_WAITS    250    // of these, for near objects that could be drawn coarser
#define FIRST_SIMULATED_S   0.02

// The tolerance of near objects rises by this factor until they fit their budget.
#define BUDGET_STEP         1.189207115002721 // 2^(1/4)
#define BUDGET_STEPS        64
#define BUDGET_ERROR_MIN_PX 0.01 // where a tolerance of 0 begins

#define RANGE_INDICES 30000u // of one draw call, whole triangles

#define STRINGIZE(x) #x
#define VALUE(x)     STRINGIZE(x)

// One record as the uniform block holds it (std140).
typedef struct far_uniform {
    float clip[16];
    float texture[4];
} far_uniform;
_Static_assert(sizeof(far_uniform) == 80, "a far record's uniforms are 80 bytes");
#define PAGE_BYTES (HW_FAR_PAGE_RECORDS * sizeof(far_uniform))

// What the frame needs of a near object beside its mesh; per object of the manifest.
typedef struct near_object {
    float normal[9]; // world <- mesh, for normals; column-major
    bool mirrored;
} near_object;

// A near object chosen for this frame.
typedef struct near_draw {
    uint32_t object_idx;
    float distance; // of its box to the eye
    hw_fade fade;
    const hw_near_level *level;
} near_draw;

typedef struct near_program {
    GLuint name;
    GLint clip, normal, color, kept;
} near_program;

typedef struct far_program {
    GLuint name;
    GLint first_record, kept;
} far_program;

typedef struct hybrid {
    hw_gpu_account *account;
    char *dataset;
    hw_manifest manifest;
    near_object *objects;
    float *stretch; // of each object
    hw_store *store;
    hw_prefetch *prefetch;    // NULL: frames wait for what they lack
    bool simulated, drawable; // drawable: a cell was ready once
    double simulated_s;
    hw_ground_gl ground;
    near_program near_programs[2][HW_PHASES]; // without and with a texture
    far_program far_programs[2][HW_PHASES];   // opaque, cut out
    hw_far_views_gl far_views;
    double crossing_width;
    uint32_t near_triangles; // budget
    hw_gpu_buffer far_uniforms;
    hw_gpu_pace pace;
    hw_debug_view debug;
    // Scratch for the near objects and far records of a frame's cells; capacities in items.
    size_t near_capacity, far_capacity;
    uint32_t *visible;
    hw_cull_item *order, *order_scratch;
    near_draw *near;
    far_uniform *far; // whole pages
} hybrid;

// ---- making and freeing ----------------------------------------------------------------------

static void hybrid_destroy(void *state)
{
    hybrid *h = state;
    hw_prefetch_destroy(h->prefetch);
    hw_store_destroy(h->store);
    hw_ground_gl_destroy(h->account, &h->ground);
    hw_gpu_buffer_destroy(h->account, &h->far_uniforms);
    hw_far_views_gl_destroy(&h->far_views);
    for (int i = 0; i < 2; i++)
        for (int phase = 0; phase < HW_PHASES; phase++) {
            glDeleteProgram(h->near_programs[i][phase].name);
            glDeleteProgram(h->far_programs[i][phase].name);
        }
    hw_free(h->visible);
    hw_free(h->order);
    hw_free(h->order_scratch);
    hw_free(h->near);
    hw_free(h->far);
    hw_free(h->objects);
    hw_free(h->stretch);
    hw_manifest_free(&h->manifest);
    hw_free(h->dataset);
    hw_free(h);
}

static hw_status make_near_program(const char *defines, near_program *out)
{
    HW_TRY(hw_gpu_program("near", defines, hw_shader_near_vert, hw_shader_near_frag, &out->name));
    out->clip = glGetUniformLocation(out->name, "u_clip");
    out->normal = glGetUniformLocation(out->name, "u_world_normal");
    out->color = glGetUniformLocation(out->name, "u_base_color");
    out->kept = glGetUniformLocation(out->name, "u_kept");
    return HW_OK;
}

#define FAR_DEFINES "#define FAR_PAGE_RECORDS " VALUE(HW_FAR_PAGE_RECORDS) "\n"

static hw_status make_far_program(const char *defines, far_program *out)
{
    HW_TRY(hw_gpu_program("far", defines, hw_shader_far_vert, hw_shader_far_frag, &out->name));
    out->first_record = glGetUniformLocation(out->name, "u_first_record");
    out->kept = glGetUniformLocation(out->name, "u_kept");
    GLuint block = glGetUniformBlockIndex(out->name, "FarRecords");
    glUniformBlockBinding(out->name, block, 0);
    return hw_gpu_check("far program");
}

static hw_status make_programs(hybrid *h)
{
    static const char *const near_defines[2][HW_PHASES] = {
        {"", "#define DISSOLVE\n"}, {"#define TEXTURED\n", "#define TEXTURED\n#define DISSOLVE\n"}};
    static const char *const far_defines[2][HW_PHASES] = {
        {FAR_DEFINES, FAR_DEFINES "#define DISSOLVE\n"},
        {FAR_DEFINES "#define CUT_OUT\n", FAR_DEFINES "#define CUT_OUT\n#define DISSOLVE\n"}};
    for (int i = 0; i < 2; i++)
        for (int phase = 0; phase < HW_PHASES; phase++) {
            HW_TRY(make_near_program(near_defines[i][phase], &h->near_programs[i][phase]));
            HW_TRY(make_far_program(far_defines[i][phase], &h->far_programs[i][phase]));
        }
    return HW_OK;
}

static void make_near_object(const hw_manifest_object *object, near_object *out)
{
    hw_mat4 inverse;
    (void)hw_mat4_inverse(object->transform, &inverse); // identity if singular: a flat object
    for (int k = 0; k < 9; k++)
        out->normal[k] = (float)inverse.m[k % 3 * 4 + k / 3];
    out->mirrored = hw_mat4_mirrors(&object->transform);
}

static size_t page_count(size_t records)
{
    return (records + HW_FAR_PAGE_RECORDS - 1) / HW_FAR_PAGE_RECORDS;
}

// Scratch for so many near objects and far records. Cells have about as many as the first that
// come: from then on nothing is allocated.
static hw_status reserve_scratch(hybrid *h, size_t near, size_t far)
{
    far = page_count(far) * HW_FAR_PAGE_RECORDS;
    if (near <= h->near_capacity && far <= h->far_capacity)
        return HW_OK;
    if (near > h->near_capacity) {
        HW_TRY(HW_RESIZE(&h->order, near));
        HW_TRY(HW_RESIZE(&h->order_scratch, near));
        HW_TRY(HW_RESIZE(&h->near, near));
    }
    if (far > h->far_capacity) {
        HW_TRY(HW_RESIZE(&h->far, far));
        hw_gpu_buffer_destroy(h->account, &h->far_uniforms);
        HW_TRY(hw_gpu_buffer_create(h->account, GL_UNIFORM_BUFFER, NULL, far * sizeof *h->far,
                                    GL_STREAM_DRAW, &h->far_uniforms));
    }
    near = near > h->near_capacity ? near : h->near_capacity;
    far = far > h->far_capacity ? far : h->far_capacity;
    HW_TRY(HW_RESIZE(&h->visible, near > far ? near : far));
    h->near_capacity = near;
    h->far_capacity = far;
    return HW_OK;
}

static hw_status make_loading(hybrid *h, const hw_streaming *streaming)
{
    hw_loading loading = streaming->loading;
    h->simulated = loading == HW_LOADING_SIMULATED || loading == HW_LOADING_SIMULATED_WAITS;
    const hw_store_desc desc = {.location = h->dataset,
                                .manifest = &h->manifest,
                                .account = h->account,
                                .mode = h->simulated                  ? HW_LOADER_SIMULATED
                                        : loading == HW_LOADING_AHEAD ? HW_LOADER_THREAD
                                                                      : HW_LOADER_WAITS,
                                .gpu_budget = streaming->gpu_budget,
                                .ram_budget = streaming->ram_budget,
                                .frame_bytes = streaming->frame_bytes,
                                .bytes_per_second = streaming->bytes_per_second};
    HW_TRY(hw_store_create(&desc, &h->store));
    if (loading == HW_LOADING_AHEAD || loading == HW_LOADING_SIMULATED)
        HW_TRY(hw_prefetch_create(h->store, &h->manifest, h->stretch, &h->prefetch));
    // Of most datasets' cells none has more records than there are objects; two cells are drawn
    // while one dissolves into the other.
    size_t records = h->manifest.object_count;
    records = 2 * (records < SCRATCH_RECORDS_MAX ? records : SCRATCH_RECORDS_MAX);
    return reserve_scratch(h, records,
                           records + 2 * (size_t)h->manifest.grid.levels * HW_FAR_PAGE_RECORDS);
}

static hw_status hybrid_create(const hw_renderer_desc *desc, hw_gpu_account *account, void **state)
{
    hw_status status = HW_OK;
    hybrid *h = NULL;
    HW_TRY(HW_NEW(&h, 1));
    h->account = account;
    h->crossing_width = desc->crossing_width;
    h->near_triangles = desc->near_triangles ? desc->near_triangles : HW_NEAR_TRIANGLES;
    HW_GO(hw_strdup(&h->dataset, desc->dataset));
    HW_GO(hw_manifest_open(h->dataset, &h->manifest));
    HW_GO(HW_NEW(&h->objects, h->manifest.object_count));
    HW_GO(HW_NEW(&h->stretch, h->manifest.object_count));
    hw_box bounds = hw_box_empty();
    for (uint32_t i = 0; i < h->manifest.object_count; i++) {
        make_near_object(&h->manifest.objects[i], &h->objects[i]);
        h->stretch[i] = (float)hw_mat4_stretch(&h->manifest.objects[i].transform);
        bounds = hw_box_union(bounds, h->manifest.objects[i].bounds);
    }
    HW_GO(make_loading(h, &desc->streaming));
    HW_GO(hw_ground_gl_create(account, &h->manifest.ground, bounds, &h->ground));
    HW_GO(make_programs(h));
    HW_GO(hw_far_views_gl_create(&h->far_views));
    *state = h;
    h = NULL;
out:
    if (h)
        hybrid_destroy(h);
    return status;
}

// ---- loading ---------------------------------------------------------------------------------

static hw_data_key cell_key(uint32_t index)
{
    return (hw_data_key){HW_DATA_CELL, index, 0};
}

// The viewer's cells, and while one dissolves into another, that one's; by level.
typedef struct frame_cells {
    hw_cell_gpu *own[HW_CELL_LEVELS_MAX];
    hw_cell_gpu *other[HW_CELL_LEVELS_MAX]; // with share > 0
    float share;                            // hw_crossing
} frame_cells;

static void use_cells(hybrid *h, hw_cell_gpu *const *cells)
{
    for (int32_t l = 0; l < h->manifest.grid.levels; l++)
        hw_store_use_cell(h->store, cells[l]);
}

// Everything the cell needs before frames can be drawn in it, but the levels of its near meshes.
static hw_status need_cell(hybrid *h, hw_cell_id id, hw_cell_gpu **out)
{
    uint32_t index;
    if (!hw_store_find_cell(h->store, id, &index))
        return hw_fail(HW_FORMAT, "%s: has no cell %d/%d_%d", h->dataset, id.level, id.q, id.r);
    HW_TRY(hw_store_need(h->store, cell_key(index)));
    const hw_cell_records *records = hw_store_records(h->store, index);
    for (uint32_t i = 0; i < records->near_count; i++) {
        const hw_manifest_object *object = &h->manifest.objects[records->near[i].object_idx];
        hw_data_key mesh = {HW_DATA_MESH, object->mesh_idx, 0};
        hw_data_key texture = {HW_DATA_TEXTURE, (uint32_t)object->texture_idx, 0};
        HW_TRY(hw_store_need(h->store, mesh));
        if (object->texture_idx >= 0)
            HW_TRY(hw_store_need(h->store, texture));
    }
    *out = hw_store_cell(h->store, index);
    return HW_OK;
}

// The cell and the groups that hold it, one of each level, if all can be drawn as they are.
static bool is_chain_ready(hybrid *h, hw_cell_id id, hw_cell_gpu *out[HW_CELL_LEVELS_MAX])
{
    uint32_t index;
    for (int32_t l = 0; l < h->manifest.grid.levels; l++, id = hw_cell_parent(id)) {
        out[l] = hw_store_find_cell(h->store, id, &index) ? hw_store_cell(h->store, index) : NULL;
        if (!out[l] || !hw_store_has_near(h->store, out[l]->records))
            return false;
    }
    return true;
}

// The chain of the closest cell that is ready. Chains are not mixed: an object that is missing in
// the cell of one is in those of its other levels.
static bool find_closest_chain(hybrid *h, hw_vec3 eye, hw_cell_gpu *out[HW_CELL_LEVELS_MAX])
{
    hw_cell_gpu *chain[HW_CELL_LEVELS_MAX];
    float least = INFINITY;
    for (uint32_t i = 0; i < HW_STORE_CELLS_MAX; i++) {
        const hw_cell_gpu *cell = hw_store_ready_cell(h->store, i);
        if (!cell || cell->id.level != 0)
            continue;
        hw_vec3 away = hw_v3_sub(hw_cell_centre(&h->manifest.grid, cell->id), eye);
        float distance = hypotf(away.x, away.y);
        if (distance >= least || !is_chain_ready(h, cell->id, chain))
            continue;
        least = distance;
        memcpy(out, chain, sizeof chain);
    }
    return least < INFINITY;
}

// What the chain's first frame waits for has failed to load.
static bool has_failed(hybrid *h, hw_cell_id id)
{
    uint32_t index;
    bool failed = false;
    for (int32_t l = 0; l < h->manifest.grid.levels; l++, id = hw_cell_parent(id)) {
        if (!hw_store_find_cell(h->store, id, &index))
            return true;
        const hw_cell_records *records = hw_store_records(h->store, index);
        failed = failed || hw_store_failed(h->store, cell_key(index));
        for (uint32_t i = 0; records && i < records->near_count; i++) {
            const hw_manifest_object *object = &h->manifest.objects[records->near[i].object_idx];
            hw_data_key mesh = {HW_DATA_MESH, object->mesh_idx, 0};
            hw_data_key texture = {HW_DATA_TEXTURE, (uint32_t)object->texture_idx, 0};
            failed = failed || hw_store_failed(h->store, mesh) ||
                     (object->texture_idx >= 0 && hw_store_failed(h->store, texture));
        }
    }
    return failed;
}

static double now_s(const hybrid *h)
{
    return h->simulated ? h->simulated_s : hw_clock_ms() / 1000;
}

static void begin_loading(hybrid *h, const hw_camera *camera)
{
    hw_store_begin_frame(h->store, now_s(h), !h->drawable);
    if (h->prefetch)
        hw_prefetch_update(h->prefetch, camera, now_s(h));
}

// Time in which the loader works, while there is nothing to draw.
static void wait_a_little(hybrid *h, const hw_camera *camera)
{
    const struct timespec pause = {0, (long)(FIRST_WAIT_S * 1e9)};
    if (h->simulated) {
        h->simulated_s += FIRST_SIMULATED_S;
        hw_store_simulate(h->store, h->simulated_s);
    } else {
        nanosleep(&pause, NULL);
    }
    begin_loading(h, camera);
}

static hw_status wait_for_chain(hybrid *h, const hw_camera *camera, hw_cell_id id,
                                hw_cell_gpu *out[HW_CELL_LEVELS_MAX])
{
    while (!is_chain_ready(h, id, out)) {
        if (has_failed(h, id))
            return hw_fail(HW_IO, "%s", hw_store_get_stats(h->store).problem);
        wait_a_little(h, camera);
    }
    return HW_OK;
}

// The level of detail of a near object that a tolerance asks for at this distance.
static hw_data_key level_key(const hybrid *h, uint32_t object_idx, double error_px, double focal_px,
                             float distance)
{
    hw_data_key key = {HW_DATA_LEVEL, h->manifest.objects[object_idx].mesh_idx, 0};
    key.level = hw_prefetch_level(hw_store_table(h->store, key.index), error_px, focal_px,
                                  (double)h->stretch[object_idx], (double)distance);
    return key;
}

// Whether all near objects of the cell are there as they should be; wishes for what is not.
static bool is_near_exact(hybrid *h, const hw_cell_records *cell, const hw_camera *camera)
{
    double focal_px = hw_camera_focal_px(camera);
    bool exact = true;
    for (uint32_t i = 0; i < cell->near_count; i++) {
        uint32_t object_idx = cell->near[i].object_idx;
        float distance = hw_box_distance(h->manifest.objects[object_idx].bounds, camera->eye);
        hw_data_key key = level_key(h, object_idx, h->manifest.near_error_px, focal_px, distance);
        if (hw_store_table(h->store, key.index)->items[key.level].state == HW_ITEM_READY)
            continue;
        exact = false;
        hw_prefetch_urge(h->prefetch, key);
    }
    return exact;
}

// The first picture is to be as it should be, if that does not take too long.
static hw_status wait_for_first(hybrid *h, const hw_camera *camera, hw_cell_id id,
                                hw_cell_gpu *out[HW_CELL_LEVELS_MAX])
{
    HW_TRY(wait_for_chain(h, camera, id, out));
    for (int i = 0; i < FIRST_NEAR_WAITS && !is_near_exact(h, out[0]->records, camera); i++)
        wait_a_little(h, camera);
    return wait_for_chain(h, camera, id, out);
}

static hw_status need_chain(hybrid *h, hw_cell_id id, hw_cell_gpu *out[HW_CELL_LEVELS_MAX])
{
    for (int32_t l = 0; l < h->manifest.grid.levels; l++, id = hw_cell_parent(id))
        HW_TRY(need_cell(h, id, &out[l]));
    return HW_OK;
}

// The viewer's cell of each level; with prefetching, the best there is.
static hw_status find_own_cells(hybrid *h, const hw_camera *camera, hw_cell_id id,
                                hw_frame_stats *stats, hw_cell_gpu *out[HW_CELL_LEVELS_MAX])
{
    stats->cell_q = id.q;
    stats->cell_r = id.r;
    stats->cell_level = id.level;
    if (!h->prefetch) {
        HW_TRY(need_chain(h, id, out));
    } else if (!is_chain_ready(h, id, out)) {
        if (h->drawable && find_closest_chain(h, camera->eye, out))
            stats->stream.late_cells = (uint32_t)h->manifest.grid.levels;
        else
            HW_TRY(wait_for_first(h, camera, id, out));
    }
    h->drawable = true;
    use_cells(h, out);
    for (int32_t l = 0; l < h->manifest.grid.levels && stats->stream.late_cells; l++)
        stats->stream.missing += out[l]->records->far_count;
    return HW_OK;
}

// The cells beyond a border that the viewer is close to, if the dataset has them; with prefetching,
// if they are there already.
static hw_status find_other_cells(hybrid *h, const hw_camera *camera, hw_cell_id id,
                                  hw_frame_stats *stats, frame_cells *out)
{
    uint32_t index;
    out->share = 0;
    if (h->debug.hard || h->debug.frozen)
        return HW_OK;
    hw_crossing c = hw_crossing_at(&h->manifest.grid, id, camera->eye, h->crossing_width);
    if (c.share == 0 || !hw_store_find_cell(h->store, c.other, &index))
        return HW_OK;
    if (h->prefetch && !is_chain_ready(h, c.other, out->other)) {
        stats->stream.missing++;
        return HW_OK;
    }
    if (!h->prefetch)
        HW_TRY(need_chain(h, c.other, out->other));
    use_cells(h, out->other);
    out->share = c.share;
    return HW_OK;
}

static hw_status find_cells(hybrid *h, const hw_camera *camera, hw_frame_stats *stats,
                            frame_cells *out)
{
    hw_cell_id id = hw_hexgrid_locate(&h->manifest.grid, camera->eye.x, camera->eye.y);
    HW_TRY(find_own_cells(h, camera, id, stats, out->own));
    out->share = 0;
    if (!stats->stream.late_cells)
        HW_TRY(find_other_cells(h, camera, id, stats, out));
    size_t near = 0, far = 0;
    hw_cell_gpu *const *chains[2] = {out->own, out->share > 0 ? out->other : NULL};
    for (int i = 0; i < 2 && chains[i]; i++) {
        near += chains[i][0]->records->near_count;
        for (int32_t l = 0; l < h->manifest.grid.levels; l++)
            far += page_count(chains[i][l]->records->far_count) * HW_FAR_PAGE_RECORDS;
    }
    return reserve_scratch(h, near, far);
}

// ---- near objects ----------------------------------------------------------------------------

static hw_data_key draw_key(const hybrid *h, const near_draw *draw, double error_px,
                            double focal_px)
{
    return level_key(h, draw->object_idx, error_px, focal_px, draw->distance);
}

static uint64_t count_triangles(const hybrid *h, uint32_t count, double error_px, double focal_px)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < count; i++) {
        hw_data_key key = draw_key(h, &h->near[i], error_px, focal_px);
        sum += hw_store_table(h->store, key.index)->triangles[key.level];
    }
    return sum;
}

// The dataset's tolerance, or the least larger one with which all near objects together stay within
// their budget of triangles: each gives up the same error on the screen.
static double fit_error(const hybrid *h, uint32_t count, double focal_px)
{
    double error_px = h->manifest.near_error_px;
    for (int i = 0; i < BUDGET_STEPS; i++) {
        if (count_triangles(h, count, error_px, focal_px) <= h->near_triangles)
            break;
        error_px = fmax(error_px, BUDGET_ERROR_MIN_PX) * BUDGET_STEP;
    }
    return error_px;
}

// Waits for the level, or takes the best there is.
static hw_status get_level(hybrid *h, hw_data_key key, hw_frame_stats *stats, near_draw *draw)
{
    const hw_mesh_table *table = hw_store_table(h->store, key.index);
    if (!h->prefetch)
        HW_TRY(hw_store_need(h->store, key));
    draw->level = hw_store_level(h->store, key.index, key.level);
    if (!h->prefetch || draw->level == &table->items[key.level].level)
        return HW_OK;
    stats->stream.missing++;
    hw_prefetch_urge(h->prefetch, key);
    return HW_OK;
}

// Whether the object is near in the cell. Near records are in the order of objects.
static bool is_near(const hw_cell_records *cell, uint32_t object_idx)
{
    uint32_t low = 0, high = cell->near_count;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        if (cell->near[middle].object_idx < object_idx)
            low = middle + 1;
        else
            high = middle;
    }
    return low < cell->near_count && cell->near[low].object_idx == object_idx;
}

// Adds the cell's near objects in view, front to back, to the *count in h->near. What is near in
// the other cell too (NULL: there is none) does not dissolve, and comes once.
static void list_near(hybrid *h, const hw_cell_records *cell, const hw_cell_records *other,
                      hw_fade fade, hw_vec3 eye, const hw_frustum *frustum, uint32_t *out_count)
{
    uint32_t count = hw_cull_visible(&cell->near_bounds, frustum, h->visible);
    for (uint32_t i = 0; i < count; i++) {
        const hw_near_record *record = &cell->near[h->visible[i]];
        float distance = hw_box_distance(h->manifest.objects[record->object_idx].bounds, eye);
        h->order[i] = (hw_cull_item){distance, h->visible[i]};
    }
    hw_cull_sort(h->order, count, h->order_scratch);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t object_idx = cell->near[h->order[i].index].object_idx;
        bool shared = !other || is_near(other, object_idx);
        if (!shared || fade != HW_FADE_IN)
            h->near[(*out_count)++] = (near_draw){.object_idx = object_idx,
                                                  .distance = h->order[i].key,
                                                  .fade = shared ? HW_FADE_NONE : fade};
    }
}

// Near objects in view, of the viewer's cell and of the one beyond the border, and their levels,
// into h->near.
static hw_status choose_near(hybrid *h, const frame_cells *cells, const hw_camera *camera,
                             const hw_frustum *frustum, hw_frame_stats *stats, uint32_t *count)
{
    const hw_cell_records *own = cells->own[0]->records;
    const hw_cell_records *other = cells->share > 0 ? cells->other[0]->records : NULL;
    double focal_px = hw_camera_focal_px(camera);
    *count = 0;
    list_near(h, own, other, HW_FADE_OUT, camera->eye, frustum, count);
    if (other)
        list_near(h, other, own, HW_FADE_IN, camera->eye, frustum, count);
    double error_px = fit_error(h, *count, focal_px);
    for (uint32_t i = 0; i < *count; i++)
        HW_TRY(get_level(h, draw_key(h, &h->near[i], error_px, focal_px), stats, &h->near[i]));
    return HW_OK;
}

static void set_kept(GLint location, hw_fade fade, float share)
{
    float range[2];
    hw_fade_range(fade, share, range);
    glUniform2fv(location, 1, range);
}

static void draw_near(hybrid *h, uint32_t count, float share, const hw_mat4 *matrix,
                      hw_frame_stats *stats)
{
    const near_program *bound = NULL;
    GLuint bound_texture = 0;
    for (uint32_t i = 0; i < count; i++) {
        const hw_manifest_object *object = &h->manifest.objects[h->near[i].object_idx];
        const near_object *extra = &h->objects[h->near[i].object_idx];
        const hw_near_level *level = h->near[i].level;
        GLuint texture = hw_store_texture(h->store, object->texture_idx);
        bool textured = texture && level->has_uvs;
        const near_program *program = &h->near_programs[textured][hw_fade_phase(h->near[i].fade)];
        if (program != bound)
            glUseProgram(program->name);
        bound = program;
        set_kept(program->kept, h->near[i].fade, share);
        if (textured && texture != bound_texture) {
            glBindTexture(GL_TEXTURE_2D, texture);
            bound_texture = texture;
        }
        float clip[16];
        hw_mat4 product = hw_mat4_mul(*matrix, object->transform);
        hw_mat4_to_float(&product, clip);
        glUniformMatrix4fv(program->clip, 1, GL_FALSE, clip);
        glUniformMatrix3fv(program->normal, 1, GL_FALSE, extra->normal);
        glUniform3fv(program->color, 1, object->color);
        glFrontFace(extra->mirrored ? GL_CW : GL_CCW);
        glBindVertexArray(level->array);
        glDrawElements(GL_TRIANGLES, (GLsizei)level->index_count, level->index_type,
                       hw_gpu_offset(0));
        stats->near_triangles += level->index_count / 3;
        stats->draws++;
        hw_gpu_pace_add(&h->pace, level->index_count / 3);
    }
    glFrontFace(GL_CCW);
}

// ---- far objects -----------------------------------------------------------------------------

// Contiguous visible records as one range of indices, in pieces that suit the pace.
static void draw_range(hybrid *h, const hw_cell_gpu *cell, uint32_t first, uint32_t end,
                       hw_frame_stats *stats)
{
    const hw_far_draw *far = cell->records->far;
    uint32_t index = far[first].first_index;
    uint32_t index_end = far[end - 1].first_index + far[end - 1].index_count;
    stats->far_triangles += (index_end - index) / 3;
    while (index < index_end) {
        uint32_t left = index_end - index, count = left < RANGE_INDICES ? left : RANGE_INDICES;
        glDrawElements(GL_TRIANGLES, (GLsizei)count, GL_UNSIGNED_INT,
                       hw_gpu_offset((size_t)index * sizeof(uint32_t)));
        stats->draws++;
        hw_gpu_pace_add(&h->pace, count / 3);
        index += count;
    }
}

// Visible records of one cell. Its uniforms start at a page of the frame's, its entries of
// h->visible, rising, at first_visible.
typedef struct far_list {
    const hw_cell_gpu *cell;
    uint32_t first_page, first_visible, count;
    uint32_t multi_count, opaque_count; // of the visible ones, as in hw_cell_records
    hw_fade fade;
} far_list;

// Draws the visible records [begin, end) of the list, all of one page.
static void draw_page(hybrid *h, const far_program *program, const far_list *list, uint32_t begin,
                      uint32_t end, hw_frame_stats *stats)
{
    const uint32_t *visible = h->visible + list->first_visible;
    uint32_t page = visible[begin] / HW_FAR_PAGE_RECORDS;
    glUniform1i(program->first_record, (GLint)(page * HW_FAR_PAGE_RECORDS));
    glBindBufferRange(GL_UNIFORM_BUFFER, 0, h->far_uniforms.name,
                      (GLintptr)((list->first_page + page) * PAGE_BYTES), PAGE_BYTES);
    uint32_t start = begin;
    for (uint32_t i = begin + 1; i <= end; i++) {
        if (i < end && visible[i] == visible[i - 1] + 1)
            continue;
        draw_range(h, list->cell, visible[start], visible[i - 1] + 1, stats);
        start = i;
    }
}

// Culls the cell's records and fills the uniforms of those that are left.
static far_list list_far(hybrid *h, const hw_cell_gpu *cell, hw_fade fade, const hw_mat4 *matrix,
                         const hw_frustum *frustum, uint32_t first_page)
{
    far_list list = {.cell = cell,
                     .first_page = first_page,
                     .first_visible = first_page * HW_FAR_PAGE_RECORDS,
                     .fade = fade};
    uint32_t *visible = h->visible + list.first_visible;
    list.count = hw_cull_visible(&cell->records->far_bounds, frustum, visible);
    for (uint32_t i = 0; i < list.count; i++) {
        const hw_far_draw *far = &cell->records->far[visible[i]];
        list.multi_count += visible[i] < cell->records->multi_count;
        list.opaque_count += visible[i] < cell->records->opaque_count;
        far_uniform *uniform = &h->far[list.first_visible + visible[i]];
        hw_mat4 product = hw_mat4_mul(*matrix, far->matrix);
        hw_mat4_to_float(&product, uniform->clip);
        memcpy(uniform->texture, far->texture, sizeof uniform->texture);
    }
    return list;
}

static void draw_views(hybrid *h, const far_list *list, hw_far_views_frame *frame)
{
    if (list->multi_count == 0)
        return;
    frame->fade = list->fade;
    glBindTexture(GL_TEXTURE_2D, list->cell->atlas.name);
    glBindVertexArray(list->cell->array);
    for (uint32_t i = 0; i < list->multi_count; i++)
        hw_far_views_gl_draw(&h->far_views, frame, list->cell, h->visible[list->first_visible + i]);
}

// Draws the visible SVMeshes of the list that are cut out, or those that are not, page by page.
static void draw_list(hybrid *h, const far_list *list, bool cut_out, float share,
                      hw_frame_stats *stats)
{
    const uint32_t *visible = h->visible + list->first_visible;
    const far_program *program = &h->far_programs[cut_out][hw_fade_phase(list->fade)];
    uint32_t begin = cut_out ? list->opaque_count : list->multi_count;
    uint32_t end = cut_out ? list->count : list->opaque_count;
    if (begin == end)
        return;
    glUseProgram(program->name);
    set_kept(program->kept, list->fade, share);
    glBindTexture(GL_TEXTURE_2D, list->cell->atlas.name);
    glBindVertexArray(list->cell->array);
    for (uint32_t i = begin + 1; i <= end; i++) {
        if (i < end && visible[i] / HW_FAR_PAGE_RECORDS == visible[begin] / HW_FAR_PAGE_RECORDS)
            continue;
        draw_page(h, program, list, begin, i, stats);
        begin = i;
    }
}

// The far objects of a frame: those of the viewer's cells, and those of other cells that dissolve.
typedef struct far_lists {
    far_list lists[2 * HW_CELL_LEVELS_MAX];
    uint32_t count, pages;
} far_lists;

static void add_far(hybrid *h, far_lists *out, const hw_cell_gpu *cell, hw_fade fade,
                    const hw_mat4 *matrix, const hw_frustum *frustum)
{
    out->lists[out->count++] = list_far(h, cell, fade, matrix, frustum, out->pages);
    out->pages += (uint32_t)page_count(cell->records->far_count);
}

// MVMeshes, what else is opaque, then what is cut out, which software GL cannot test for depth
// early; each level by level, near to far. The uniforms of all go up before the first is drawn.
static void draw_far(hybrid *h, const frame_cells *cells, hw_vec3 eye, const hw_mat4 *matrix,
                     const hw_frustum *frustum, hw_frame_stats *stats)
{
    far_lists far = {.count = 0};
    for (int32_t l = 0; l < h->manifest.grid.levels; l++) {
        bool differ = cells->share > 0 && cells->other[l] != cells->own[l];
        add_far(h, &far, cells->own[l], differ ? HW_FADE_OUT : HW_FADE_NONE, matrix, frustum);
        if (differ)
            add_far(h, &far, cells->other[l], HW_FADE_IN, matrix, frustum);
    }
    if (far.pages == 0)
        return;
    glBindBuffer(GL_UNIFORM_BUFFER, h->far_uniforms.name);
    glBufferSubData(GL_UNIFORM_BUFFER, 0, (GLsizeiptr)(far.pages * PAGE_BYTES), h->far);
    hw_far_views_frame frame = {matrix, eye, HW_FADE_NONE, cells->share, &h->pace, stats};
    hw_debug_tint(&h->debug, HW_REPRESENTATION_MVMESH);
    for (uint32_t i = 0; i < far.count; i++)
        draw_views(h, &far.lists[i], &frame);
    hw_debug_tint(&h->debug, HW_REPRESENTATION_SVMESH);
    for (int cut_out = 0; cut_out < 2; cut_out++)
        for (uint32_t i = 0; i < far.count; i++)
            draw_list(h, &far.lists[i], cut_out, cells->share, stats);
}

// ---- frames ----------------------------------------------------------------------------------

typedef struct frame_view {
    hw_mat4 matrix;
    hw_frustum frustum;
    frame_cells cells;
    uint32_t near_count;
} frame_view;

static void put_stream_stats(const hybrid *h, const hw_store_stats *before, hw_frame_stats *stats)
{
    hw_store_stats s = hw_store_get_stats(h->store);
    hw_stream_stats *to = &stats->stream;
    to->queued = s.queued;
    to->gpu_bytes = s.gpu_bytes;
    to->gpu_budget = s.gpu_budget;
    to->ram_bytes = s.ram_bytes;
    to->ram_budget = s.ram_budget;
    to->read_bytes = s.read_bytes;
    to->uploaded_bytes = s.uploaded_bytes;
    to->waited_ms = (s.slept_s - before->slept_s) * 1000;
    to->problem_count = s.problem_count;
    to->problem = s.problem;
    if (!h->prefetch) {
        stats->loaded_bytes = s.read_bytes - before->read_bytes;
        stats->stalls = s.news != before->news;
    }
}

// Loads what is missing, and chooses the near objects.
static hw_status begin_frame(hybrid *h, const hw_camera *camera, hw_frame_stats *stats,
                             frame_view *view)
{
    double start = hw_clock_ms();
    hw_store_stats before = hw_store_get_stats(h->store);
    const hw_camera *culling = hw_debug_culling_camera(&h->debug, camera);
    hw_mat4 culling_matrix = hw_camera_view_projection(culling);
    view->matrix = hw_camera_view_projection(camera);
    view->frustum = hw_frustum_make(&culling_matrix);
    begin_loading(h, culling);
    hw_status status = find_cells(h, culling, stats, &view->cells);
    if (status == HW_OK)
        status = choose_near(h, &view->cells, culling, &view->frustum, stats, &view->near_count);
    put_stream_stats(h, &before, stats);
    if (stats->stalls)
        stats->load_ms = hw_clock_ms() - start + stats->stream.waited_ms;
    return status;
}

static hw_status hybrid_prepare(void *state, const hw_camera *camera, hw_frame_stats *stats)
{
    hybrid *h = state;
    frame_view view;
    return h->prefetch && h->drawable ? HW_OK : begin_frame(h, camera, stats, &view);
}

static void hybrid_advance(void *state, double dt_s)
{
    hybrid *h = state;
    h->simulated_s += dt_s;
    if (h->simulated)
        hw_store_simulate(h->store, h->simulated_s);
}

static hw_status hybrid_draw(void *state, const hw_camera *camera, hw_frame_stats *stats)
{
    hybrid *h = state;
    frame_view view;
    HW_TRY(begin_frame(h, camera, stats, &view));
    hw_ground_gl_begin();
    hw_ground_gl_draw(&h->ground, &view.matrix, stats);
    hw_gpu_pace_flush(&h->pace);
    hw_debug_tint(&h->debug, HW_REPRESENTATION_NEAR);
    draw_near(h, view.near_count, view.cells.share, &view.matrix, stats);
    draw_far(h, &view.cells, camera->eye, &view.matrix, &view.frustum, stats);
    glBindVertexArray(0);
    stats->triangles += stats->near_triangles + stats->far_triangles;
    return HW_OK;
}

static void hybrid_set_debug_view(void *state, const hw_debug_view *view)
{
    hybrid *h = state;
    h->debug = *view;
}

const hw_renderer_backend hw_draw_hybrid = {.create = hybrid_create,
                                            .destroy = hybrid_destroy,
                                            .prepare = hybrid_prepare,
                                            .draw = hybrid_draw,
                                            .set_debug_view = hybrid_set_debug_view,
                                            .advance = hybrid_advance};
