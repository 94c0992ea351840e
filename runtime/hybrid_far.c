// Far objects of the hybrid: the cells' textured meshes (projective-alike texture mapping, thesis
// 5.2.2).
#include "hybrid_internal.h"
#include "shaders.h"
#include <string.h>

#define RANGE_INDICES 30000u // of one draw call, whole triangles

#define STRINGIZE(x) #x
#define VALUE(x)     STRINGIZE(x)

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

hw_status hw_hybrid_make_far(hybrid *h)
{
    static const char *const far_defines[2][HW_PHASES] = {
        {FAR_DEFINES, FAR_DEFINES "#define DISSOLVE\n"},
        {FAR_DEFINES "#define CUT_OUT\n", FAR_DEFINES "#define CUT_OUT\n#define DISSOLVE\n"}};
    for (int i = 0; i < 2; i++)
        for (int phase = 0; phase < HW_PHASES; phase++)
            HW_TRY(make_far_program(far_defines[i][phase], &h->far_programs[i][phase]));
    return hw_far_views_gl_create(&h->far_views);
}

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
    list.count = hw_hybrid_hide_far(h, cell, visible, list.count);
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
static void draw_list(hybrid *h, const far_list *list, bool cut_out, const hw_crossing *crossing,
                      hw_frame_stats *stats)
{
    const uint32_t *visible = h->visible + list->first_visible;
    const far_program *program = &h->far_programs[cut_out][hw_fade_phase(list->fade)];
    uint32_t begin = cut_out ? list->opaque_count : list->multi_count;
    uint32_t end = cut_out ? list->count : list->opaque_count;
    if (begin == end)
        return;
    glUseProgram(program->name);
    hw_hybrid_set_kept(program->kept, list->fade, crossing);
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
    out->pages += (uint32_t)hw_hybrid_page_count(cell->records->far_count);
}

// MVMeshes, what else is opaque, then what is cut out, which software GL cannot test for depth
// early; each level by level, near to far. The uniforms of all go up before the first is drawn.
void hw_hybrid_draw_far(hybrid *h, const frame_cells *cells, hw_vec3 eye, const hw_mat4 *matrix,
                        const hw_frustum *frustum, hw_frame_stats *stats)
{
    far_lists far = {.count = 0};
    for (int32_t l = 0; l < h->manifest.grid.levels; l++) {
        bool differ = cells->crossing.share > 0 && cells->other[l] != cells->own[l];
        add_far(h, &far, cells->own[l], differ ? HW_FADE_OUT : HW_FADE_NONE, matrix, frustum);
        if (differ)
            add_far(h, &far, cells->other[l], HW_FADE_IN, matrix, frustum);
    }
    if (far.pages == 0)
        return;
    glBindBuffer(GL_UNIFORM_BUFFER, h->far_uniforms.name);
    glBufferSubData(GL_UNIFORM_BUFFER, 0, (GLsizeiptr)(far.pages * PAGE_BYTES), h->far);
    hw_far_views_frame frame = {matrix, eye, HW_FADE_NONE, &cells->crossing, &h->pace, stats};
    hw_debug_tint(h->debug, HW_REPRESENTATION_MVMESH);
    for (uint32_t i = 0; i < far.count; i++)
        draw_views(h, &far.lists[i], &frame);
    hw_debug_tint(h->debug, HW_REPRESENTATION_SVMESH);
    for (int cut_out = 0; cut_out < 2; cut_out++)
        for (uint32_t i = 0; i < far.count; i++)
            draw_list(h, &far.lists[i], cut_out, &cells->crossing, stats);
}
