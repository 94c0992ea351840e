#include "far_views.h"
#include "shaders.h"
#include <math.h>
#include <stdio.h>

// A capture with this share or more is drawn alone: the other would hardly show.
#define DOMINANT 0.85f

#define NONE UINT32_MAX
// Which captures to draw with: second NONE if the first does alone, both NONE if there is none.
typedef struct choice {
    uint32_t first, second;
    float blend; // share of the second
} choice;

static hw_status make_program(const char *defines, hw_far_views_program *out)
{
    HW_TRY(
        hw_gpu_program("views", defines, hw_shader_views_vert, hw_shader_views_frag, &out->name));
    out->clip = glGetUniformLocation(out->name, "u_clip");
    out->first = glGetUniformLocation(out->name, "u_first");
    out->second = glGetUniformLocation(out->name, "u_second");
    out->blend = glGetUniformLocation(out->name, "u_blend");
    out->kept = glGetUniformLocation(out->name, "u_kept");
    return HW_OK;
}

hw_status hw_far_views_gl_create(hw_far_views_gl *out)
{
    static const char *const phases[HW_PHASES] = {"", "#define DISSOLVE\n"};
    char defines[64];
    for (int p = 0; p < HW_PHASES; p++) {
        HW_TRY(make_program(phases[p], &out->single[p]));
        snprintf(defines, sizeof defines, "#define BLENDED\n%s", phases[p]);
        HW_TRY(make_program(defines, &out->blended[p]));
        snprintf(defines, sizeof defines, "#define COLORED\n%s", phases[p]);
        HW_TRY(make_program(defines, &out->colored[p]));
    }
    return HW_OK;
}

void hw_far_views_gl_destroy(hw_far_views_gl *gl)
{
    for (int p = 0; p < HW_PHASES; p++) { // GL ignores the name 0
        glDeleteProgram(gl->single[p].name);
        glDeleteProgram(gl->blended[p].name);
        glDeleteProgram(gl->colored[p].name);
    }
    *gl = (hw_far_views_gl){0};
}

// Angles at the object's middle between the viewer and the points of the captures.
static void find_angles(const hw_cell_gpu *cell, const hw_far_draw *far, hw_vec3 eye,
                        float angles[HW_FAR_VIEWS_MAX])
{
    hw_vec3 middle = hw_box_centre(far->bounds);
    hw_vec3 to_eye = hw_v3_normalize(hw_v3_sub(eye, middle));
    for (uint32_t k = 0; k < far->view_count; k++) {
        hw_vec3 to_view =
            hw_v3_normalize(hw_v3_sub(cell->records->views[far->first_view + k].eye, middle));
        angles[k] = acosf(fminf(fmaxf(hw_v3_dot(to_eye, to_view), -1), 1));
    }
}

// Of the views in the set, the two of the smallest angles a1 <= a2, with the weights
//   c' = c1 a2 / (a1 + a2) + c2 a1 / (a1 + a2).
static choice choose(uint32_t set, const float angles[HW_FAR_VIEWS_MAX])
{
    choice c = {NONE, NONE, 0};
    for (uint32_t k = 0; set >> k; k++) {
        if (!(set >> k & 1))
            continue;
        if (c.first == NONE || angles[k] < angles[c.first]) {
            c.second = c.first;
            c.first = k;
        } else if (c.second == NONE || angles[k] < angles[c.second]) {
            c.second = k;
        }
    }
    if (c.second == NONE)
        return c;
    float sum = angles[c.first] + angles[c.second];
    c.blend = sum > 0 ? angles[c.first] / sum : 0;
    if (c.blend <= 1 - DOMINANT)
        c.second = NONE;
    return c;
}

typedef struct drawing {
    const hw_far_views_gl *gl;
    const hw_far_views_frame *frame;
    const hw_far_view_draw *views;
    hw_kept kept;
    uint32_t index_bytes;
    float clip[16];
} drawing;

static void draw_indices(const drawing *d, choice c, uint32_t first, uint32_t count)
{
    bool colored = c.first == NONE;
    const hw_far_views_program *phases = colored            ? d->gl->colored
                                         : c.second == NONE ? d->gl->single
                                                            : d->gl->blended;
    const hw_far_views_program *program = &phases[hw_kept_phase(d->kept)];
    glUseProgram(program->name);
    glUniform2f(program->kept, d->kept.first, d->kept.end);
    glUniformMatrix4fv(program->clip, 1, GL_FALSE, d->clip);
    if (c.first != NONE)
        glUniformMatrix4fv(program->first, 1, GL_FALSE, d->views[c.first].texture);
    if (c.second != NONE) {
        glUniformMatrix4fv(program->second, 1, GL_FALSE, d->views[c.second].texture);
        glUniform1f(program->blend, c.blend);
    }
    if (colored) // the other draws of the array may read vertices that have no colour
        glEnableVertexAttribArray(1);
    glDrawElements(GL_TRIANGLES, (GLsizei)count, hw_gpu_index_type(d->index_bytes),
                   hw_gpu_offset((size_t)first * d->index_bytes));
    if (colored)
        glDisableVertexAttribArray(1);
    d->frame->stats->far_triangles += count / 3;
    d->frame->stats->draws++;
    hw_gpu_pace_add(d->frame->pace, count / 3);
}

void hw_far_views_gl_draw(const hw_far_views_gl *gl, const hw_far_views_frame *frame,
                          const hw_cell_gpu *cell, uint32_t index, hw_kept kept)
{
    const hw_far_draw *far = &cell->records->far[index];
    drawing d = {.gl = gl,
                 .frame = frame,
                 .views = cell->records->views + far->first_view,
                 .kept = kept,
                 .index_bytes = cell->index_bytes};
    float angles[HW_FAR_VIEWS_MAX];
    hw_mat4 product = hw_mat4_mul(*frame->matrix, far->matrix);
    hw_mat4_to_float(&product, d.clip);
    find_angles(cell, far, frame->eye, angles);
    // Range by range; neighbouring ones that come to the same choice in one call.
    uint32_t first = far->first_index, count = 0;
    choice last = {NONE, NONE, 0};
    for (uint32_t i = 0; i < far->range_count; i++) {
        const hw_far_range *range = &cell->records->ranges[far->first_range + i];
        choice c = choose(range->views, angles);
        if (count > 0 && (c.first != last.first || c.second != last.second)) {
            draw_indices(&d, last, first, count);
            first += count;
            count = 0;
        }
        last = c;
        count += range->index_count;
    }
    if (count > 0)
        draw_indices(&d, last, first, count);
}
