// Far objects of the hybrid: the cells' textured meshes (projective-alike texture mapping, thesis
// 5.2.2).
#include "hybrid_internal.h"
#include "shaders.h"
#include <string.h>

#define BATCH_INDICES (3 * HW_GPU_PACE_TRIANGLES) // of one draw call

#define STRINGIZE(x) #x
#define VALUE(x)     STRINGIZE(x)

#define FAR_DEFINES "#define FAR_PAGE_RECORDS " VALUE(HW_FAR_PAGE_RECORDS) "\n"

static hw_status make_far_program(const char *defines, far_program *out)
{
    HW_TRY(hw_gpu_program("far", defines, hw_shader_far_vert, hw_shader_far_frag, &out->name));
    out->first_record = glGetUniformLocation(out->name, "u_first_record");
    GLuint block = glGetUniformBlockIndex(out->name, "FarRecords");
    glUniformBlockBinding(out->name, block, 0);
    return hw_gpu_check("far program");
}

hw_status hw_hybrid_make_far(hybrid *h)
{
    static const char *const far_defines[2][HW_PHASES] = {
        {FAR_DEFINES, FAR_DEFINES "#define DISSOLVE\n"},
        {FAR_DEFINES "#define CUT_OUT\n", FAR_DEFINES "#define CUT_OUT\n#define DISSOLVE\n"}};
    for (int i = 0; i < 2; i++)
        for (int phase = 0; phase < HW_PHASES; phase++)
            HW_TRY(make_far_program(far_defines[i][phase], &h->far_programs[i][phase]));
    // Programs take memory: megabytes of it in software GL.
    return h->manifest.multi_view ? hw_far_views_gl_create(&h->far_views) : HW_OK;
}

// Ranges of indices of one vertex array that go into one call.
#define BATCH_RANGES 256u
typedef struct batch {
    uint32_t count, indices, index_bytes;
    GLsizei counts[BATCH_RANGES];
    const void *offsets[BATCH_RANGES];
} batch;

static void flush(hybrid *h, batch *b, hw_frame_stats *stats)
{
    if (b->count == 0)
        return;
    glMultiDrawElements(GL_TRIANGLES, b->counts, hw_gpu_index_type(b->index_bytes), b->offsets,
                        (GLsizei)b->count);
    stats->draws++;
    stats->far_triangles += b->indices / 3;
    hw_gpu_pace_add(&h->pace, b->indices / 3);
    b->count = b->indices = 0;
}

// Contiguous records as one range of indices, in pieces that suit the pace.
static void add_range(hybrid *h, batch *b, const hw_far_draw *first, const hw_far_draw *last,
                      hw_frame_stats *stats)
{
    uint32_t index = first->first_index, index_end = last->first_index + last->index_count;
    while (index < index_end) {
        uint32_t left = index_end - index, room = BATCH_INDICES - b->indices;
        uint32_t count = left < room ? left : room;
        b->counts[b->count] = (GLsizei)count;
        b->offsets[b->count++] = hw_gpu_offset((size_t)index * b->index_bytes);
        b->indices += count;
        index += count;
        if (b->count == BATCH_RANGES || b->indices == BATCH_INDICES)
            flush(h, b, stats);
    }
}

// Visible records of one cell that are drawn by the same programs. The cell's uniforms start at a
// page of the frame's.
typedef struct far_list {
    const hw_cell_gpu *cell;
    uint32_t first_page;
    uint32_t *records;                         // rising
    uint32_t count, multi_count, opaque_count; // of them, as in hw_cell_records
} far_list;

// Draws the records [begin, end) of the list, all of one page.
static void draw_page(hybrid *h, const far_program *program, const far_list *list, uint32_t begin,
                      uint32_t end, hw_frame_stats *stats)
{
    const hw_far_draw *far = list->cell->records->far;
    const uint32_t *records = list->records;
    uint32_t page = records[begin] / HW_FAR_PAGE_RECORDS, start = begin;
    batch b;
    b.count = b.indices = 0;
    b.index_bytes = list->cell->index_bytes;
    glUniform1i(program->first_record, (GLint)(page * HW_FAR_PAGE_RECORDS));
    glBindBufferRange(GL_UNIFORM_BUFFER, 0, h->far_uniforms.name,
                      (GLintptr)((list->first_page + page) * PAGE_BYTES), PAGE_BYTES);
    for (uint32_t i = begin + 1; i <= end; i++) {
        if (i < end && records[i] == records[i - 1] + 1)
            continue;
        add_range(h, &b, &far[records[start]], &far[records[i - 1]], stats);
        start = i;
    }
    flush(h, &b, stats);
}

static void add_record(far_list *list, uint32_t record)
{
    list->records[list->count++] = record;
    list->multi_count += record < list->cell->records->multi_count;
    list->opaque_count += record < list->cell->records->opaque_count;
}

// The far objects of a frame.
typedef struct far_lists {
    const frame_cells *cells;
    const hw_mat4 *matrix;
    const hw_frustum *frustum;
    far_list lists[HW_CROSSING_CELLS * HW_CELL_LEVELS_MAX][HW_PHASES]; // of the first `count` cells
    uint32_t count, pages;
} far_lists;

// Culls the records of the cell of a level that the chains first to end - 1 have in common, and
// fills the uniforms of those that show.
static void list_far(hybrid *h, far_lists *out, int32_t level, uint32_t first, uint32_t end)
{
    const hw_cell_gpu *cell = out->cells->chains[first][level];
    const hw_cell_records *records = cell->records;
    size_t place = (size_t)out->pages * HW_FAR_PAGE_RECORDS;
    uint32_t *visible = h->visible + place;
    far_list *lists = out->lists[out->count++];
    for (int phase = 0; phase < HW_PHASES; phase++)
        lists[phase] = (far_list){.cell = cell, .first_page = out->pages};
    lists[HW_PHASE_WHOLE].records = visible; // written no faster than they are read
    lists[HW_PHASE_DISSOLVING].records = h->dissolving + place;
    uint32_t count = hw_cull_visible(&records->far_bounds, out->frustum, visible);
    count = hw_hybrid_hide_far(h, cell, visible, count);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t record = visible[i];
        const hw_far_draw *far = &records->far[record];
        hw_turn turn = hw_object_turn(far->object_idx, h->turns);
        hw_kept kept = hw_crossing_kept(&out->cells->crossing, first, end, turn);
        if (hw_kept_none(kept))
            continue;
        add_record(&lists[hw_kept_phase(kept)], record);
        far_uniform *uniform = &h->far[place + record];
        hw_mat4 product = hw_mat4_mul(*out->matrix, far->matrix);
        hw_mat4_to_float(&product, uniform->clip);
        memcpy(uniform->texture, far->texture, sizeof uniform->texture);
        uniform->kept = kept;
    }
    out->pages += (uint32_t)hw_hybrid_page_count(records->far_count);
}

// Level by level; a group that several chains have is listed once: they are neighbours.
static void list_all(hybrid *h, far_lists *out)
{
    const frame_cells *cells = out->cells;
    for (int32_t l = 0; l < h->manifest.grid.levels; l++) {
        for (uint32_t first = 0, end; first < cells->crossing.count; first = end) {
            for (end = first + 1; end < cells->crossing.count; end++)
                if (cells->chains[end][l] != cells->chains[first][l])
                    break;
            list_far(h, out, l, first, end);
        }
    }
}

static void draw_views(hybrid *h, const far_list *list, const hw_far_views_frame *frame)
{
    if (list->multi_count == 0)
        return;
    glBindTexture(GL_TEXTURE_2D, list->cell->atlas.name);
    glBindVertexArray(list->cell->array);
    const far_uniform *uniforms = h->far + (size_t)list->first_page * HW_FAR_PAGE_RECORDS;
    for (uint32_t i = 0; i < list->multi_count; i++)
        hw_far_views_gl_draw(&h->far_views, frame, list->cell, list->records[i],
                             uniforms[list->records[i]].kept);
}

// Draws the SVMeshes of the list that are cut out, or those that are not, page by page.
static void draw_list(hybrid *h, const far_list *list, const far_program *program, bool cut_out,
                      hw_frame_stats *stats)
{
    uint32_t begin = cut_out ? list->opaque_count : list->multi_count;
    uint32_t end = cut_out ? list->count : list->opaque_count;
    if (begin == end)
        return;
    glUseProgram(program->name);
    glBindTexture(GL_TEXTURE_2D, list->cell->atlas.name);
    glBindVertexArray(list->cell->array);
    for (uint32_t i = begin + 1; i <= end; i++) {
        if (i < end &&
            list->records[i] / HW_FAR_PAGE_RECORDS == list->records[begin] / HW_FAR_PAGE_RECORDS)
            continue;
        draw_page(h, program, list, begin, i, stats);
        begin = i;
    }
}

// MVMeshes, what else is opaque, then what is cut out, which software GL cannot test for depth
// early, nor what dissolves; each level by level, near to far. The uniforms of all go up before the
// first is drawn.
void hw_hybrid_draw_far(hybrid *h, const frame_cells *cells, hw_vec3 eye, const hw_mat4 *matrix,
                        const hw_frustum *frustum, hw_frame_stats *stats)
{
    far_lists far = {.cells = cells, .matrix = matrix, .frustum = frustum};
    list_all(h, &far);
    if (far.pages == 0)
        return;
    glBindBuffer(GL_UNIFORM_BUFFER, h->far_uniforms.name);
    glBufferSubData(GL_UNIFORM_BUFFER, 0, (GLsizeiptr)(far.pages * PAGE_BYTES), h->far);
    const hw_far_views_frame frame = {matrix, eye, &h->pace, stats};
    hw_debug_tint(h->debug, HW_REPRESENTATION_MVMESH);
    for (int phase = 0; phase < HW_PHASES; phase++)
        for (uint32_t i = 0; i < far.count; i++)
            draw_views(h, &far.lists[i][phase], &frame);
    hw_debug_tint(h->debug, HW_REPRESENTATION_SVMESH);
    for (int cut_out = 0; cut_out < 2; cut_out++)
        for (int phase = 0; phase < HW_PHASES; phase++)
            for (uint32_t i = 0; i < far.count; i++)
                draw_list(h, &far.lists[i][phase], &h->far_programs[cut_out][phase], cut_out,
                          stats);
}
