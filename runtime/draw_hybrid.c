// Configuration C: near objects as shaded geometry, far ones as the cell's textured meshes
// (projective-alike texture mapping, thesis 5.2.2).
#include "alloc.h"
#include "cell_gpu.h"
#include "far_views.h"
#include "ground.h"
#include "hierarchy.h"
#include "near_meshes.h"
#include "renderer_internal.h"
#include "shaders.h"
#include "system.h"
#include <string.h>

#define CELLS_MAX         12u
#define CELL_BYTES_BUDGET (UINT64_C(24) << 20) // of GPU memory, but the current cell always stays
#define NEAR_BYTES_BUDGET (UINT64_C(96) << 20)

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
    float stretch;
    bool mirrored;
} near_object;

// A near object chosen for this frame.
typedef struct near_draw {
    uint32_t object_idx;
    const hw_near_level *level;
} near_draw;

typedef struct near_program {
    GLuint name;
    GLint clip, normal, color;
} near_program;

typedef struct hybrid {
    hw_gpu_account *account;
    char *dataset;
    hw_manifest manifest;
    near_object *objects;
    hw_near_meshes *meshes;
    hw_cell_gpu cells[CELLS_MAX];
    uint64_t frame; // counts prepares and draws
    hw_ground_gl ground;
    near_program near_plain, near_textured;
    hw_far_views_gl far_views;
    GLuint far_program;
    GLint far_first_record;
    hw_gpu_buffer far_uniforms;
    hw_gpu_pace pace;
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
    for (uint32_t i = 0; i < CELLS_MAX; i++)
        hw_cell_gpu_free(h->account, &h->cells[i]);
    hw_near_meshes_destroy(h->meshes);
    hw_ground_gl_destroy(h->account, &h->ground);
    hw_gpu_buffer_destroy(h->account, &h->far_uniforms);
    hw_far_views_gl_destroy(&h->far_views);
    const GLuint programs[] = {h->near_plain.name, h->near_textured.name, h->far_program};
    for (size_t i = 0; i < sizeof programs / sizeof *programs; i++) {
        if (programs[i])
            glDeleteProgram(programs[i]);
    }
    hw_free(h->visible);
    hw_free(h->order);
    hw_free(h->order_scratch);
    hw_free(h->near);
    hw_free(h->far);
    hw_free(h->objects);
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
    return HW_OK;
}

static hw_status make_far_program(hybrid *h)
{
    HW_TRY(hw_gpu_program("far", "#define FAR_PAGE_RECORDS " VALUE(HW_FAR_PAGE_RECORDS) "\n",
                          hw_shader_far_vert, hw_shader_far_frag, &h->far_program));
    h->far_first_record = glGetUniformLocation(h->far_program, "u_first_record");
    GLuint block = glGetUniformBlockIndex(h->far_program, "FarRecords");
    glUniformBlockBinding(h->far_program, block, 0);
    return hw_gpu_check("far program");
}

static void make_near_object(const hw_manifest_object *object, near_object *out)
{
    hw_mat4 inverse;
    (void)hw_mat4_inverse(object->transform, &inverse); // identity if singular: a flat object
    for (int k = 0; k < 9; k++)
        out->normal[k] = (float)inverse.m[k % 3 * 4 + k / 3];
    out->stretch = (float)hw_mat4_stretch(&object->transform);
    out->mirrored = hw_mat4_mirrors(&object->transform);
}

static hw_status hybrid_create(const hw_renderer_desc *desc, hw_gpu_account *account, void **state)
{
    hw_status status = HW_OK;
    hybrid *h = NULL;
    HW_TRY(HW_NEW(&h, 1));
    h->account = account;
    HW_GO(hw_strdup(&h->dataset, desc->dataset));
    HW_GO(hw_manifest_read(h->dataset, &h->manifest));
    HW_GO(HW_NEW(&h->objects, h->manifest.object_count));
    hw_box bounds = hw_box_empty();
    for (uint32_t i = 0; i < h->manifest.object_count; i++) {
        make_near_object(&h->manifest.objects[i], &h->objects[i]);
        bounds = hw_box_union(bounds, h->manifest.objects[i].bounds);
    }
    HW_GO(hw_near_meshes_create(account, h->dataset, &h->manifest, NEAR_BYTES_BUDGET, &h->meshes));
    HW_GO(hw_ground_gl_create(account, &h->manifest.ground, bounds, &h->ground));
    HW_GO(make_near_program(NULL, &h->near_plain));
    HW_GO(make_near_program("#define TEXTURED\n", &h->near_textured));
    HW_GO(make_far_program(h));
    HW_GO(hw_far_views_gl_create(&h->far_views));
    *state = h;
    h = NULL;
out:
    if (h)
        hybrid_destroy(h);
    return status;
}

// ---- loading ---------------------------------------------------------------------------------

static size_t page_count(size_t records)
{
    return (records + HW_FAR_PAGE_RECORDS - 1) / HW_FAR_PAGE_RECORDS;
}

// Scratch that suffices for the cells of a frame, one of each level.
static hw_status reserve_scratch(hybrid *h, hw_cell_gpu *const *cells)
{
    size_t near = cells[0]->near_count, far = 0;
    for (int32_t l = 0; l < h->manifest.grid.levels; l++)
        far += page_count(cells[l]->far_count) * HW_FAR_PAGE_RECORDS;
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

// A slot for one more cell: empty ones first, else the cells drawn longest ago go until count and
// bytes are within their limits. Those of this frame stay.
static hw_cell_gpu *make_room(hybrid *h)
{
    while (true) {
        hw_cell_gpu *empty = NULL, *oldest = NULL;
        uint64_t bytes = 0;
        for (uint32_t i = 0; i < CELLS_MAX; i++) {
            hw_cell_gpu *cell = &h->cells[i];
            bytes += cell->gpu_bytes;
            if (!cell->loaded)
                empty = cell;
            else if (cell->used < h->frame && (!oldest || cell->used < oldest->used))
                oldest = cell;
        }
        if (empty && (bytes <= CELL_BYTES_BUDGET || !oldest))
            return empty;
        hw_cell_gpu_free(h->account, oldest);
    }
}

// Everything the cell needs before frames can be drawn in it, but the levels of its near meshes.
static hw_status load_cell(hybrid *h, hw_cell_id id, hw_frame_stats *stats, hw_cell_gpu **out)
{
    hw_cell_gpu *cell = make_room(h);
    stats->stalls = 1;
    HW_TRY(hw_cell_gpu_load(h->account, h->dataset, &h->manifest, id, cell));
    stats->loaded_bytes += cell->file_bytes;
    hw_status status = HW_OK;
    for (uint32_t i = 0; status == HW_OK && i < cell->near_count; i++) {
        const hw_manifest_object *object = &h->manifest.objects[cell->near[i].object_idx];
        status = hw_near_meshes_open(h->meshes, object->mesh_idx, object->texture_idx, stats);
    }
    if (status != HW_OK)
        hw_cell_gpu_free(h->account, cell);
    *out = cell;
    return status;
}

static hw_status find_cell(hybrid *h, hw_cell_id id, hw_frame_stats *stats, hw_cell_gpu **out)
{
    *out = NULL;
    for (uint32_t i = 0; i < CELLS_MAX && !*out; i++) {
        hw_cell_gpu *cell = &h->cells[i];
        if (cell->loaded && cell->id.level == id.level && cell->id.q == id.q && cell->id.r == id.r)
            *out = cell;
    }
    if (!*out)
        HW_TRY(load_cell(h, id, stats, out));
    (*out)->used = h->frame;
    return HW_OK;
}

// The viewer's cell of each level.
static hw_status find_cells(hybrid *h, const hw_camera *camera, hw_frame_stats *stats,
                            hw_cell_gpu *out[HW_CELL_LEVELS_MAX])
{
    hw_cell_id id = hw_hexgrid_locate(&h->manifest.grid, camera->eye.x, camera->eye.y);
    stats->cell_q = id.q;
    stats->cell_r = id.r;
    stats->cell_level = id.level;
    for (int32_t l = 0; l < h->manifest.grid.levels; l++) {
        HW_TRY(find_cell(h, id, stats, &out[l]));
        id = hw_cell_parent(id);
    }
    return reserve_scratch(h, out);
}

// ---- near objects ----------------------------------------------------------------------------

// The coarsest level whose surface error stays below the dataset's tolerance at this distance.
static uint32_t choose_level(const hybrid *h, const hw_near_record *record, double focal_px,
                             float distance)
{
    const hw_manifest_object *object = &h->manifest.objects[record->object_idx];
    if (!(distance > 0))
        return 0;
    double error = h->manifest.near_error_px * distance / focal_px;
    return hw_near_meshes_choose(h->meshes, object->mesh_idx,
                                 error / h->objects[record->object_idx].stretch);
}

// Near objects in view, front to back, with their levels, into h->near.
static hw_status choose_near(hybrid *h, const hw_cell_gpu *cell, const hw_camera *camera,
                             const hw_frustum *frustum, hw_frame_stats *stats, uint32_t *out_count)
{
    double focal_px = hw_camera_focal_px(camera);
    uint32_t count = hw_cull_visible(&cell->near_bounds, frustum, h->visible);
    for (uint32_t i = 0; i < count; i++) {
        const hw_near_record *record = &cell->near[h->visible[i]];
        float distance =
            hw_box_distance(h->manifest.objects[record->object_idx].bounds, camera->eye);
        h->order[i] = (hw_cull_item){distance, h->visible[i]};
    }
    hw_cull_sort(h->order, count, h->order_scratch);
    for (uint32_t i = 0; i < count; i++) {
        const hw_near_record *record = &cell->near[h->order[i].index];
        uint32_t level = choose_level(h, record, focal_px, h->order[i].key);
        h->near[i].object_idx = record->object_idx;
        HW_TRY(hw_near_meshes_get(h->meshes, h->manifest.objects[record->object_idx].mesh_idx,
                                  level, h->frame, stats, &h->near[i].level));
    }
    *out_count = count;
    return HW_OK;
}

static void draw_near(hybrid *h, uint32_t count, const hw_mat4 *matrix, hw_frame_stats *stats)
{
    const near_program *bound = NULL;
    GLuint bound_texture = 0;
    for (uint32_t i = 0; i < count; i++) {
        const hw_manifest_object *object = &h->manifest.objects[h->near[i].object_idx];
        const near_object *extra = &h->objects[h->near[i].object_idx];
        const hw_near_level *level = h->near[i].level;
        GLuint texture = hw_near_meshes_texture(h->meshes, object->texture_idx);
        bool textured = texture && level->has_uvs;
        const near_program *program = textured ? &h->near_textured : &h->near_plain;
        if (program != bound)
            glUseProgram(program->name);
        bound = program;
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
    uint32_t index = cell->far[first].first_index;
    uint32_t index_end = cell->far[end - 1].first_index + cell->far[end - 1].index_count;
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
    uint32_t multi_count; // the first of them are MVMeshes
} far_list;

// Draws the visible records [begin, end) of the list, all of one page.
static void draw_page(hybrid *h, const far_list *list, uint32_t begin, uint32_t end,
                      hw_frame_stats *stats)
{
    const uint32_t *visible = h->visible + list->first_visible;
    uint32_t page = visible[begin] / HW_FAR_PAGE_RECORDS;
    glUniform1i(h->far_first_record, (GLint)(page * HW_FAR_PAGE_RECORDS));
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
static far_list list_far(hybrid *h, const hw_cell_gpu *cell, const hw_mat4 *matrix,
                         const hw_frustum *frustum, uint32_t first_page)
{
    far_list list = {cell, first_page, first_page * HW_FAR_PAGE_RECORDS, 0, 0};
    uint32_t *visible = h->visible + list.first_visible;
    list.count = hw_cull_visible(&cell->far_bounds, frustum, visible);
    while (list.multi_count < list.count && visible[list.multi_count] < cell->multi_count)
        list.multi_count++;
    for (uint32_t i = list.multi_count; i < list.count; i++) {
        const hw_far_draw *far = &cell->far[visible[i]];
        far_uniform *uniform = &h->far[list.first_visible + visible[i]];
        hw_mat4 product = hw_mat4_mul(*matrix, far->matrix);
        hw_mat4_to_float(&product, uniform->clip);
        memcpy(uniform->texture, far->texture, sizeof uniform->texture);
    }
    return list;
}

static void draw_list(hybrid *h, const far_list *list, const hw_far_views_frame *views,
                      hw_frame_stats *stats)
{
    const uint32_t *visible = h->visible + list->first_visible;
    if (list->count == 0)
        return;
    glBindTexture(GL_TEXTURE_2D, list->cell->atlas.name);
    glBindVertexArray(list->cell->array);
    for (uint32_t i = 0; i < list->multi_count; i++)
        hw_far_views_gl_draw(&h->far_views, views, list->cell, visible[i]);
    if (list->count == list->multi_count)
        return;
    glUseProgram(h->far_program);
    uint32_t begin = list->multi_count;
    for (uint32_t i = begin + 1; i <= list->count; i++) {
        if (i < list->count &&
            visible[i] / HW_FAR_PAGE_RECORDS == visible[begin] / HW_FAR_PAGE_RECORDS)
            continue;
        draw_page(h, list, begin, i, stats);
        begin = i;
    }
}

// Level by level, near to far; the uniforms of all go up before the first is drawn.
static void draw_far(hybrid *h, hw_cell_gpu *const *cells, const hw_camera *camera,
                     const hw_mat4 *matrix, const hw_frustum *frustum, hw_frame_stats *stats)
{
    hw_far_views_frame views = {matrix, camera->eye, &h->pace, stats};
    far_list lists[HW_CELL_LEVELS_MAX];
    uint32_t pages = 0, count = 0;
    for (int32_t l = 0; l < h->manifest.grid.levels; l++) {
        lists[l] = list_far(h, cells[l], matrix, frustum, pages);
        pages += (uint32_t)page_count(cells[l]->far_count);
        count += lists[l].count;
    }
    if (count == 0)
        return;
    glBindBuffer(GL_UNIFORM_BUFFER, h->far_uniforms.name);
    glBufferSubData(GL_UNIFORM_BUFFER, 0, (GLsizeiptr)(pages * PAGE_BYTES), h->far);
    for (int32_t l = 0; l < h->manifest.grid.levels; l++)
        draw_list(h, &lists[l], &views, stats);
}

// ---- frames ----------------------------------------------------------------------------------

typedef struct frame_view {
    hw_mat4 matrix;
    hw_frustum frustum;
    hw_cell_gpu *cells[HW_CELL_LEVELS_MAX];
    uint32_t near_count;
} frame_view;

// Loads what is missing, and chooses the near objects.
static hw_status begin_frame(hybrid *h, const hw_camera *camera, hw_frame_stats *stats,
                             frame_view *view)
{
    double start = hw_clock_ms();
    h->frame++;
    view->matrix = hw_camera_view_projection(camera);
    view->frustum = hw_frustum_make(&view->matrix);
    hw_status status = find_cells(h, camera, stats, view->cells);
    if (status == HW_OK)
        status = choose_near(h, view->cells[0], camera, &view->frustum, stats, &view->near_count);
    if (stats->stalls)
        stats->load_ms = hw_clock_ms() - start;
    return status;
}

static hw_status hybrid_prepare(void *state, const hw_camera *camera, hw_frame_stats *stats)
{
    frame_view view;
    return begin_frame(state, camera, stats, &view);
}

static hw_status hybrid_draw(void *state, const hw_camera *camera, hw_frame_stats *stats)
{
    hybrid *h = state;
    frame_view view;
    HW_TRY(begin_frame(h, camera, stats, &view));
    hw_ground_gl_begin();
    hw_ground_gl_draw(&h->ground, &view.matrix, stats);
    hw_gpu_pace_flush(&h->pace);
    draw_near(h, view.near_count, &view.matrix, stats);
    draw_far(h, view.cells, camera, &view.matrix, &view.frustum, stats);
    glBindVertexArray(0);
    stats->triangles += stats->near_triangles + stats->far_triangles;
    return HW_OK;
}

const hw_renderer_backend hw_draw_hybrid = {.create = hybrid_create,
                                            .destroy = hybrid_destroy,
                                            .prepare = hybrid_prepare,
                                            .draw = hybrid_draw};
