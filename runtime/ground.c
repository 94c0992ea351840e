#include "ground.h"
#include "appearance.h"
#include "camera.h"
#include "shaders.h"

// What stands on the ground may sink in by this part of the scene's size: rounding.
#define SINK 1e-6f

hw_status hw_ground_gl_create(hw_gpu_account *account, const hw_ground *ground, hw_box objects,
                              hw_ground_gl *out)
{
    *out = (hw_ground_gl){.present = ground->present};
    if (!ground->present)
        return HW_OK;
    hw_status status = HW_OK;
    float sink = SINK * hw_box_diagonal(objects);
    out->hides_nothing = hw_box_is_empty(objects) || objects.min.z >= ground->rect.min.z - sink;
    // Lit like any face that looks up.
    float light = hw_light(hw_v3(0, 0, 1));
    for (int i = 0; i < 3; i++)
        out->color[i] = ground->color[i] * light;
    // Drawn out to the horizon: the rectangle of the scene only says where things stand.
    hw_box r = ground->rect;
    float x0 = r.min.x - HW_CAMERA_FAR, x1 = r.max.x + HW_CAMERA_FAR;
    float y0 = r.min.y - HW_CAMERA_FAR, y1 = r.max.y + HW_CAMERA_FAR, z = r.min.z;
    const float corners[4][3] = {{x0, y0, z}, {x1, y0, z}, {x0, y1, z}, {x1, y1, z}};
    HW_GO(hw_gpu_program("ground", NULL, hw_shader_ground_vert, hw_shader_ground_frag,
                         &out->program));
    out->clip_location = glGetUniformLocation(out->program, "u_clip");
    out->color_location = glGetUniformLocation(out->program, "u_color");
    glGenVertexArrays(1, &out->array);
    glBindVertexArray(out->array);
    HW_GO(hw_gpu_buffer_create(account, GL_ARRAY_BUFFER, corners, sizeof corners, GL_STATIC_DRAW,
                               &out->vertices));
    glEnableVertexAttribArray(0);
    glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, 0, hw_gpu_offset(0));
out:
    if (status != HW_OK)
        hw_ground_gl_destroy(account, out);
    return status;
}

void hw_ground_gl_destroy(hw_gpu_account *account, hw_ground_gl *ground)
{
    hw_gpu_buffer_destroy(account, &ground->vertices);
    if (ground->array)
        glDeleteVertexArrays(1, &ground->array);
    if (ground->program)
        glDeleteProgram(ground->program);
    *ground = (hw_ground_gl){0};
}

void hw_ground_gl_begin(void)
{
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_LESS);
    glDepthMask(GL_TRUE);
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    glEnable(GL_CULL_FACE);
    glCullFace(GL_BACK);
    glFrontFace(GL_CCW);
    glDisable(GL_BLEND);
    glDisable(GL_SCISSOR_TEST);
    glDisable(GL_DITHER);
    glClearColor(HW_SKY_R, HW_SKY_G, HW_SKY_B, 0);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
}

void hw_ground_gl_draw(const hw_ground_gl *ground, const hw_mat4 *view_projection,
                       hw_frame_stats *stats)
{
    if (!ground->present)
        return;
    float clip[16];
    hw_mat4_to_float(view_projection, clip);
    glUseProgram(ground->program);
    glUniformMatrix4fv(ground->clip_location, 1, GL_FALSE, clip);
    glUniform3fv(ground->color_location, 1, ground->color);
    glBindVertexArray(ground->array);
    // Depth for half of the pixels costs software GL 5 % of a frame.
    if (ground->hides_nothing)
        glDisable(GL_DEPTH_TEST);
    glDrawArrays(GL_TRIANGLE_STRIP, 0, 4);
    glEnable(GL_DEPTH_TEST);
    stats->triangles += 2;
    stats->draws++;
}
