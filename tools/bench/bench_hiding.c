// What it costs and gains to leave out what near objects hide: frames of a tour by two renderers of
// one dataset, with and without, in turns. The pictures must be the same byte for byte: exit 1 if
// they are not. Times are processor time of all threads, which other work on the machine does not
// change much.
//
// And what GL's own occlusion queries would cost: the boxes of the near objects in view, each with
// a query, after a frame that draws all.
#include "alloc.h"
#include "cell_file.h"
#include "context.h"
#include "cull.h"
#include "gpu.h"
#include "manifest.h"
#include "renderer.h"
#include "target.h"
#include "tour.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct side {
    hw_renderer *renderer;
    hw_image image;
    double ms;
    uint64_t triangles, hidden;
} side;

#define QUERIES_MAX 256u

// One box for all objects, moved by its matrix.
typedef struct queries {
    hw_manifest manifest;
    hw_gpu_account account;
    hw_gpu_buffer corners, indices;
    GLuint program, array, names[QUERIES_MAX];
    GLint clip;
    double ms;
    uint64_t boxes, hidden;
} queries;

typedef struct bench {
    queries queries;
    hw_tour tour;
    hw_context *context;
    hw_target *target;
    side sides[2]; // drawn all, and without what is hidden
    uint32_t every, repeat, frames, different;
} bench;

static double cpu_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

static hw_status draw(bench *b, side *s, const hw_camera *camera)
{
    hw_frame_stats stats;
    glFinish();
    double start = cpu_ms();
    HW_TRY(hw_renderer_draw(s->renderer, camera, &stats));
    hw_target_resolve(b->target);
    glFinish();
    s->ms += cpu_ms() - start;
    s->triangles += stats.triangles;
    s->hidden += stats.hidden;
    return HW_OK;
}

// ---- queries ---------------------------------------------------------------------------------

static const char box_vertex[] = "layout(location = 0) in vec3 a_corner;\n"
                                 "uniform mat4 u_clip;\n"
                                 "void main() { gl_Position = u_clip * vec4(a_corner, 1.0); }\n";
static const char box_fragment[] = "out vec4 o_color;\n"
                                   "void main() { o_color = vec4(1.0); }\n";

static hw_status make_queries(queries *q, const char *dataset)
{
    static const uint8_t faces[36] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                      2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    float corners[8][3];
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < 3; k++)
            corners[i][k] = (float)(i >> k & 1);
    HW_TRY(hw_manifest_read(dataset, &q->manifest));
    HW_TRY(hw_gpu_program("boxes", NULL, box_vertex, box_fragment, &q->program));
    q->clip = glGetUniformLocation(q->program, "u_clip");
    glGenVertexArrays(1, &q->array);
    glBindVertexArray(q->array);
    HW_TRY(hw_gpu_buffer_create(&q->account, GL_ARRAY_BUFFER, corners, sizeof corners,
                                GL_STATIC_DRAW, &q->corners));
    HW_TRY(hw_gpu_buffer_create(&q->account, GL_ELEMENT_ARRAY_BUFFER, faces, sizeof faces,
                                GL_STATIC_DRAW, &q->indices));
    glEnableVertexAttribArray(0);
    glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, 0, NULL);
    glGenQueries(QUERIES_MAX, q->names);
    return hw_gpu_check("queries");
}

static void free_queries(queries *q)
{
    if (q->program) {
        glDeleteQueries(QUERIES_MAX, q->names);
        glDeleteProgram(q->program);
        glDeleteVertexArrays(1, &q->array);
    }
    hw_gpu_buffer_destroy(&q->account, &q->corners);
    hw_gpu_buffer_destroy(&q->account, &q->indices);
    hw_manifest_free(&q->manifest);
}

static void draw_box(const queries *q, const hw_mat4 *view_projection, hw_box box)
{
    hw_vec3 size = hw_v3_sub(box.max, box.min);
    hw_mat4 place = hw_mat4_mul(hw_mat4_translation(box.min.x, box.min.y, box.min.z),
                                hw_mat4_scale(size.x, size.y, size.z));
    hw_mat4 product = hw_mat4_mul(*view_projection, place);
    float clip[16];
    hw_mat4_to_float(&product, clip);
    glUniformMatrix4fv(q->clip, 1, GL_FALSE, clip);
    glDrawElements(GL_TRIANGLES, 36, GL_UNSIGNED_BYTE, NULL);
}

// The near objects of the viewer's cell whose boxes are in view and not round the viewer.
static void query_boxes(queries *q, const hw_cell *cell, const hw_camera *camera)
{
    hw_mat4 matrix = hw_camera_view_projection(camera);
    hw_frustum frustum = hw_frustum_make(&matrix);
    uint32_t count = 0;
    glFinish();
    double start = cpu_ms();
    glUseProgram(q->program);
    glBindVertexArray(q->array);
    glColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    glDepthMask(GL_FALSE);
    for (uint32_t i = 0; i < cell->near_count && count < QUERIES_MAX; i++) {
        hw_box box = q->manifest.objects[cell->near[i].object_idx].bounds;
        if (!hw_frustum_meets_box(&frustum, box) || !(hw_box_distance(box, camera->eye) > 1))
            continue;
        glBeginQuery(GL_ANY_SAMPLES_PASSED, q->names[count]);
        draw_box(q, &matrix, box);
        glEndQuery(GL_ANY_SAMPLES_PASSED);
        count++;
    }
    glFinish();
    for (uint32_t i = 0; i < count; i++) {
        GLuint seen;
        glGetQueryObjectuiv(q->names[i], GL_QUERY_RESULT, &seen);
        q->hidden += !seen;
    }
    q->ms += cpu_ms() - start;
    q->boxes += count;
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    glDepthMask(GL_TRUE);
}

static hw_status time_queries(bench *b, const char *dataset, const hw_camera *camera)
{
    hw_status status = HW_OK;
    hw_cell cell = {0};
    char *path = NULL;
    hw_frame_stats stats;
    hw_cell_id id =
        hw_hexgrid_locate(&b->queries.manifest.grid, (double)camera->eye.x, (double)camera->eye.y);
    HW_GO(hw_cell_path(&path, dataset, id));
    HW_GO(hw_cell_read(path, &cell));
    HW_GO(hw_renderer_draw(b->sides[0].renderer, camera, &stats)); // what hides
    for (uint32_t i = 0; i < b->repeat; i++)
        query_boxes(&b->queries, &cell, camera);
out:
    hw_free(path);
    hw_cell_free(&cell);
    return status;
}

// ---- frames ----------------------------------------------------------------------------------

static hw_status compare_frame(bench *b, const char *dataset, uint32_t frame)
{
    hw_camera camera = hw_tour_camera(&b->tour, frame, 1024, 1024);
    hw_target_bind(b->target);
    for (int k = 0; k < 2; k++) { // loads, and warms up
        hw_frame_stats stats;
        HW_TRY(hw_renderer_draw(b->sides[k].renderer, &camera, &stats));
        HW_TRY(hw_target_read(b->target, &b->sides[k].image));
        hw_target_bind(b->target);
    }
    const hw_image *image = &b->sides[0].image;
    size_t bytes = (size_t)image->width * image->height * image->channels;
    if (memcmp(image->data, b->sides[1].image.data, bytes) != 0) {
        printf("frame %u differs\n", frame);
        b->different++;
    }
    for (uint32_t i = 0; i < 2 * b->repeat; i++)
        HW_TRY(draw(b, &b->sides[i % 2], &camera));
    b->frames++;
    return time_queries(b, dataset, &camera);
}

static hw_status run(bench *b, const char *dataset, const char *tour, uint32_t samples)
{
    const hw_context_desc context = {.kind = HW_CONTEXT_OFFSCREEN, .width = 16, .height = 16};
    HW_TRY(hw_tour_read(tour, &b->tour));
    HW_TRY(hw_context_create(&context, &b->context));
    HW_TRY(hw_target_create(&b->target, 1024, 1024, samples));
    for (int k = 0; k < 2; k++) {
        const hw_renderer_desc desc = {.config = HW_CONFIG_C,
                                       .dataset = dataset,
                                       .hide = k == 1,
                                       .crossing_width = HW_CROSSING_WIDTH};
        HW_TRY(hw_renderer_create(&desc, &b->sides[k].renderer));
    }
    HW_TRY(make_queries(&b->queries, dataset));
    for (uint32_t i = 0; i < b->tour.frame_count; i += b->every)
        HW_TRY(compare_frame(b, dataset, i));
    for (int k = 0; k < 2; k++)
        printf("%s: %.2f ms, %.0f triangles, %.1f objects hidden\n", k ? "hidden left out" : "all",
               b->sides[k].ms / (b->frames * b->repeat),
               (double)b->sides[k].triangles / (b->frames * b->repeat),
               (double)b->sides[k].hidden / (b->frames * b->repeat));
    double frames = b->frames * b->repeat;
    printf("queries: %.2f ms more, %.1f boxes, %.1f of them hidden\n", b->queries.ms / frames,
           (double)b->queries.boxes / frames, (double)b->queries.hidden / frames);
    printf("%u frames, %u of them differ\n", b->frames, b->different);
    return HW_OK;
}

int main(int argc, char **argv)
{
    if (argc < 4 || argc > 6) {
        fprintf(stderr, "Usage: bench_hiding DATASET TOUR.json EVERY [REPEAT [SAMPLES]]\n");
        return 2;
    }
    bench b = {.every = (uint32_t)fmax(strtod(argv[3], NULL), 1),
               .repeat = argc > 4 ? (uint32_t)fmax(strtod(argv[4], NULL), 1) : 5};
    hw_status status =
        run(&b, argv[1], argv[2], argc > 5 ? (uint32_t)strtoul(argv[5], NULL, 10) : 1);
    if (status != HW_OK)
        fprintf(stderr, "bench_hiding: %s\n", hw_error_text());
    for (int k = 0; k < 2; k++) {
        hw_renderer_destroy(b.sides[k].renderer);
        hw_image_free(&b.sides[k].image);
    }
    free_queries(&b.queries);
    hw_target_destroy(b.target);
    hw_context_destroy(b.context);
    hw_tour_free(&b.tour);
    return status != HW_OK || b.different > 0;
}
