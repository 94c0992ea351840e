#include "compare_view.h"
#include "alloc.h"
#include "compare.h"
#include "gpu.h"
#include "shaders.h"
#include "target.h"
#include <math.h>

struct hw_compare_view {
    uint32_t width, height, samples; // of what follows; 0: not made yet
    hw_target *target;               // one picture after the other
    GLuint textures[2];
    hw_image images[2];
    float *lumas[2];
    GLuint program, array;
    GLint errors_location, seam_location, scale_location;
};

hw_status hw_compare_view_create(hw_compare_view **out)
{
    hw_status status = HW_OK;
    hw_compare_view *v = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&v, 1));
    HW_GO(hw_gpu_program("compare", NULL, hw_shader_compare_vert, hw_shader_compare_frag,
                         &v->program));
    v->errors_location = glGetUniformLocation(v->program, "u_errors");
    v->seam_location = glGetUniformLocation(v->program, "u_seam");
    v->scale_location = glGetUniformLocation(v->program, "u_scale");
    glUseProgram(v->program);
    glUniform1i(glGetUniformLocation(v->program, "u_left"), 0);
    glUniform1i(glGetUniformLocation(v->program, "u_right"), 1);
    glUseProgram(0);
    glGenVertexArrays(1, &v->array);
    HW_GO(hw_gpu_check("comparing pictures"));
    *out = v;
    v = NULL;
out:
    hw_compare_view_destroy(v);
    return status;
}

static void free_pictures(hw_compare_view *v)
{
    hw_target_destroy(v->target);
    v->target = NULL;
    glDeleteTextures(2, v->textures);
    for (int i = 0; i < 2; i++) {
        v->textures[i] = 0;
        hw_image_free(&v->images[i]);
        hw_free(v->lumas[i]);
        v->lumas[i] = NULL;
    }
    v->width = v->height = 0;
}

void hw_compare_view_destroy(hw_compare_view *view)
{
    if (!view)
        return;
    free_pictures(view);
    if (view->array)
        glDeleteVertexArrays(1, &view->array);
    if (view->program)
        glDeleteProgram(view->program);
    hw_free(view);
}

static hw_status make_pictures(hw_compare_view *v, uint32_t width, uint32_t height,
                               uint32_t samples)
{
    if (v->width == width && v->height == height && v->samples == samples)
        return HW_OK;
    free_pictures(v);
    HW_TRY(hw_target_create(&v->target, width, height, samples));
    glGenTextures(2, v->textures);
    for (int i = 0; i < 2; i++) {
        glBindTexture(GL_TEXTURE_2D, v->textures[i]);
        glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, (GLsizei)width, (GLsizei)height, 0, GL_RGBA,
                     GL_UNSIGNED_BYTE, NULL);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
        HW_TRY(HW_NEW(&v->lumas[i], (size_t)width * height));
    }
    HW_TRY(hw_gpu_check("comparing pictures"));
    v->width = width;
    v->height = height;
    v->samples = samples;
    return HW_OK;
}

static hw_status draw_picture(hw_compare_view *v, int i, const hw_compare_desc *desc,
                              hw_frame_stats *stats)
{
    hw_renderer *renderer = i == 0 ? desc->left : desc->right;
    hw_target_bind(v->target);
    HW_TRY(hw_renderer_draw(renderer, desc->camera, stats));
    if (desc->measure) {
        HW_TRY(hw_target_read(v->target, &v->images[i]));
        hw_luma(&v->images[i], v->lumas[i]);
    }
    hw_target_copy(v->target, v->textures[i]);
    return HW_OK;
}

static void compose(hw_compare_view *v, const hw_compare_desc *desc)
{
    glDisable(GL_DEPTH_TEST);
    glDisable(GL_BLEND);
    glUseProgram(v->program);
    glUniform1i(v->errors_location, desc->mode == HW_COMPARE_ERRORS);
    glUniform1f(v->seam_location, (float)floor(desc->seam * v->width + 0.5));
    glUniform1f(v->scale_location, HW_COMPARE_SCALE / 255.0f);
    for (int i = 1; i >= 0; i--) {
        glActiveTexture(GL_TEXTURE0 + (GLenum)i);
        glBindTexture(GL_TEXTURE_2D, v->textures[i]);
    }
    glBindVertexArray(v->array);
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glBindVertexArray(0);
    glBindTexture(GL_TEXTURE_2D, 0);
    glUseProgram(0);
    glEnable(GL_DEPTH_TEST);
}

hw_status hw_compare_view_draw(hw_compare_view *v, const hw_compare_desc *desc,
                               hw_compare_result *out)
{
    GLint framebuffer = 0;
    hw_frame_stats truth;
    *out = (hw_compare_result){0};
    glGetIntegerv(GL_DRAW_FRAMEBUFFER_BINDING, &framebuffer);
    hw_status status = make_pictures(v, desc->camera->width, desc->camera->height, desc->samples);
    if (status == HW_OK)
        status = draw_picture(v, 0, desc, &out->stats);
    if (status == HW_OK)
        status = draw_picture(v, 1, desc, &truth);
    glBindFramebuffer(GL_FRAMEBUFFER, (GLuint)framebuffer);
    HW_TRY(status);
    compose(v, desc);
    if (desc->measure) {
        size_t count;
        double sum =
            hw_squared_error(v->lumas[0], v->lumas[1], NULL, (size_t)v->width * v->height, &count);
        out->psnr = hw_psnr(sum / (double)count);
    }
    return hw_gpu_check("comparing pictures");
}

static float within_unit(double value)
{
    return (float)fmin(fmax(value, 0), 1);
}

void hw_compare_error_color(double t, float rgb[3])
{
    rgb[0] = within_unit(2 * t - 0.5);
    rgb[1] = within_unit(1.75 - fabs(4 * t - 1.75));
    rgb[2] = within_unit(1.5 - 4 * t);
}
