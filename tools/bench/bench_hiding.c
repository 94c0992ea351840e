// What it costs and gains to leave out what near objects hide: frames of a tour by two renderers of
// one dataset, with and without, in turns. The pictures must be the same byte for byte: exit 1 if
// they are not. Times are processor time of all threads, which other work on the machine does not
// change much.
#include "context.h"
#include "renderer.h"
#include "target.h"
#include "tour.h"
#include <glad/gl.h>
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

typedef struct bench {
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

static hw_status compare_frame(bench *b, uint32_t frame)
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
    return HW_OK;
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
    for (uint32_t i = 0; i < b->tour.frame_count; i += b->every)
        HW_TRY(compare_frame(b, i));
    for (int k = 0; k < 2; k++)
        printf("%s: %.2f ms, %.0f triangles, %.1f objects hidden\n", k ? "hidden left out" : "all",
               b->sides[k].ms / (b->frames * b->repeat),
               (double)b->sides[k].triangles / (b->frames * b->repeat),
               (double)b->sides[k].hidden / (b->frames * b->repeat));
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
    hw_target_destroy(b.target);
    hw_context_destroy(b.context);
    hw_tour_free(&b.tour);
    return status != HW_OK || b.different > 0;
}
