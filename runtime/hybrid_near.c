// Near objects of the hybrid: shaded geometry, at levels of detail under a budget of triangles.
#include "hybrid_internal.h"
#include "shaders.h"
#include <math.h>

// The tolerance of near objects rises by this factor until they fit their budget.
#define BUDGET_STEP         1.189207115002721 // 2^(1/4)
#define BUDGET_STEPS        64
#define BUDGET_ERROR_MIN_PX 0.01 // where a tolerance of 0 begins

static hw_status make_near_program(const char *defines, near_program *out)
{
    HW_TRY(hw_gpu_program("near", defines, hw_shader_near_vert, hw_shader_near_frag, &out->name));
    out->clip = glGetUniformLocation(out->name, "u_clip");
    out->normal = glGetUniformLocation(out->name, "u_world_normal");
    out->color = glGetUniformLocation(out->name, "u_base_color");
    out->kept = glGetUniformLocation(out->name, "u_kept");
    return HW_OK;
}

hw_status hw_hybrid_make_near(hybrid *h)
{
    static const char *const near_defines[2][HW_PHASES] = {
        {"", "#define DISSOLVE\n"}, {"#define TEXTURED\n", "#define TEXTURED\n#define DISSOLVE\n"}};
    int kinds = h->manifest.texture_count > 0 ? 2 : 1;
    for (int i = 0; i < kinds; i++)
        for (int phase = 0; phase < HW_PHASES; phase++)
            HW_TRY(make_near_program(near_defines[i][phase], &h->near_programs[i][phase]));
    return HW_OK;
}

static hw_data_key draw_key(const hybrid *h, const near_draw *draw, double error_px,
                            double focal_px)
{
    return hw_hybrid_level_key(h, draw->object_idx, error_px, focal_px, draw->distance);
}

// Of the objects whose boxes the viewer stands in (those are drawn as they are), or of the others.
static uint64_t count_triangles(const hybrid *h, uint32_t count, bool inside, double error_px,
                                double focal_px)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (inside != !(h->near[i].distance > 0))
            continue;
        hw_data_key key = draw_key(h, &h->near[i], error_px, focal_px);
        sum += hw_store_table(h->store, key.index)->triangles[key.level];
    }
    return sum;
}

// The dataset's tolerance, or the least larger one with which all near objects together stay within
// their budget of triangles: each gives up the same error on the screen. Those that the viewer
// stands in give up none, and leave the others half of the budget at least.
static double fit_error(const hybrid *h, uint32_t count, double focal_px)
{
    double error_px = h->manifest.near_error_px;
    uint64_t inside = count_triangles(h, count, true, error_px, focal_px), all = h->near_triangles;
    uint64_t budget = inside < all / 2 ? all - inside : all / 2;
    for (int i = 0; i < BUDGET_STEPS; i++) {
        if (count_triangles(h, count, false, error_px, focal_px) <= budget)
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

// Adds the near objects in view of cells[i] of the crossing, front to back, to the *count in
// h->near. An object that is near in the next cells too comes once, with the pixels of all.
static void list_near(hybrid *h, const frame_cells *cells, uint32_t i, hw_vec3 eye,
                      const hw_frustum *frustum, uint32_t *out_count)
{
    const hw_cell_records *cell = cells->chains[i][0]->records;
    uint32_t count = hw_cull_visible(&cell->near_bounds, frustum, h->visible);
    for (uint32_t k = 0; k < count; k++) {
        const hw_near_record *record = &cell->near[h->visible[k]];
        float distance = hw_box_distance(h->manifest.objects[record->object_idx].bounds, eye);
        h->order[k] = (hw_cull_item){distance, h->visible[k]};
    }
    hw_cull_sort(h->order, count, h->order_scratch);
    for (uint32_t k = 0; k < count; k++) {
        uint32_t object_idx = cell->near[h->order[k].index].object_idx, end = i + 1;
        if (i > 0 && is_near(cells->chains[i - 1][0]->records, object_idx))
            continue;
        while (end < cells->crossing.count && is_near(cells->chains[end][0]->records, object_idx))
            end++;
        hw_turn turn = hw_object_turn(object_idx, h->turns);
        hw_kept kept = hw_crossing_kept(&cells->crossing, i, end, turn);
        if (!hw_kept_none(kept))
            h->near[(*out_count)++] =
                (near_draw){.object_idx = object_idx, .distance = h->order[k].key, .kept = kept};
    }
}

// Near objects in view, of the frame's cells, and their levels, into h->near.
hw_status hw_hybrid_choose_near(hybrid *h, const frame_cells *cells, const hw_camera *camera,
                                const hw_frustum *frustum, hw_frame_stats *stats, uint32_t *count)
{
    double focal_px = hw_camera_focal_px(camera);
    *count = 0;
    for (uint32_t i = 0; i < cells->crossing.count; i++)
        list_near(h, cells, i, camera->eye, frustum, count);
    double error_px = fit_error(h, *count, focal_px);
    if (h->prefetch)
        hw_prefetch_set_error(h->prefetch, error_px);
    for (uint32_t i = 0; i < *count; i++)
        HW_TRY(get_level(h, draw_key(h, &h->near[i], error_px, focal_px), stats, &h->near[i]));
    return HW_OK;
}

void hw_hybrid_draw_near(hybrid *h, uint32_t count, const hw_mat4 *matrix, hw_frame_stats *stats)
{
    const near_program *bound = NULL;
    GLuint bound_texture = 0;
    for (uint32_t i = 0; i < count; i++) {
        const hw_manifest_object *object = &h->manifest.objects[h->near[i].object_idx];
        const near_object *extra = &h->objects[h->near[i].object_idx];
        const hw_near_level *level = h->near[i].level;
        GLuint texture = hw_store_texture(h->store, object->texture_idx);
        bool textured = texture && level->has_uvs;
        const near_program *program = &h->near_programs[textured][hw_kept_phase(h->near[i].kept)];
        if (program != bound)
            glUseProgram(program->name);
        bound = program;
        glUniform2f(program->kept, h->near[i].kept.first, h->near[i].kept.end);
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
