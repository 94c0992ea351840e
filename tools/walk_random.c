#include "alloc.h"
#include "log.h"
#include "rng.h"
#include "system.h"
#include "target.h"
#include "walk.h"
#include <glad/gl.h>
#include <math.h>
#include <time.h>

#define STEP_S (1.0 / 30)

// What the walk has met so far.
typedef struct findings {
    uint64_t frames, crossings, bumps;
    uint64_t half_rss_bytes; // resident memory half way
    double way, slowest_ms;
    int32_t cell_q, cell_r;
    bool was_clear;
} findings;

// What a visitor does for a while.
typedef struct intent {
    hw_input input;
    uint32_t steps; // left
} intent;

// Mostly ahead, sometimes back or aside, turning now and then, rarely up and down.
static void decide(intent *in, hw_rng *rng)
{
    static const hw_key ways[8] = {HW_KEY_FORWARD, HW_KEY_FORWARD, HW_KEY_FORWARD, HW_KEY_FORWARD,
                                   HW_KEY_FORWARD, HW_KEY_LEFT,    HW_KEY_RIGHT,   HW_KEY_BACK};
    *in = (intent){.steps = 10 + hw_rng_below(rng, 80)};
    in->input.down[ways[hw_rng_below(rng, 8)]] = true;
    in->input.down[HW_KEY_RUN] = hw_rng_below(rng, 3) == 0;
    in->input.down[HW_KEY_UP] = hw_rng_below(rng, 12) == 0;
    in->input.down[HW_KEY_DOWN] = hw_rng_below(rng, 8) == 0;
    in->input.turn = hw_rng_below(rng, 2) ? 2.0 * hw_rng_float(rng) - 1.0 : 0;
    in->input.pitch = 0.1 * (2.0 * hw_rng_float(rng) - 1.0);
}

// The configuration to walk in and its first frame, waiting for them.
static hw_status reach_config(walk *w)
{
    const struct timespec pause = {0, 2000000};
    while (w->waiting && !walk_interrupted()) {
        HW_TRY(walk_pursue_config(w));
        nanosleep(&pause, NULL);
    }
    do {
        HW_TRY(walk_draw_frame(w));
        nanosleep(&pause, NULL);
    } while (w->arriving && !walk_interrupted());
    return HW_OK;
}

// Whoever has once been outside of all objects never gets into one.
static hw_status check_place(const walk *w, findings *f)
{
    double depth = hw_walker_overlap(&w->walker);
    if (depth > 0 && f->was_clear)
        return hw_fail(HW_FORMAT,
                       "random walk: frame %llu is %.3g inside an object at %.9g, %.9g, %.9g",
                       (unsigned long long)f->frames, depth, w->walker.x, w->walker.y, w->walker.z);
    f->was_clear = f->was_clear || depth == 0;
    return HW_OK;
}

static hw_status step(walk *w, const hw_input *input, findings *f)
{
    double x = w->walker.x, y = w->walker.y;
    HW_TRY(hw_walker_update(&w->walker, input, STEP_S));
    HW_TRY(check_place(w, f));
    double moved = hypot(w->walker.x - x, w->walker.y - y);
    double wanted = (input->down[HW_KEY_RUN] ? HW_WALKER_RUN_SPEED : HW_WALKER_SPEED) * STEP_S;
    f->way += moved;
    f->bumps += moved < wanted / 2;
    double start_ms = hw_clock_ms();
    HW_TRY(walk_draw_frame(w));
    glFinish(); // as a window's swap does: nothing piles up
    f->slowest_ms = fmax(f->slowest_ms, hw_clock_ms() - start_ms);
    hw_cell_id cell = hw_hexgrid_locate(&w->walker.grid, w->walker.x, w->walker.y);
    f->crossings += f->frames > 0 && (cell.q != f->cell_q || cell.r != f->cell_r);
    f->cell_q = cell.q;
    f->cell_r = cell.r;
    f->frames++;
    return HW_OK;
}

static hw_status walk_steps(walk *w, hw_target *target, findings *f)
{
    hw_status status = HW_OK;
    hw_rng rng = hw_rng_make(walk_opt.seed, 0);
    intent now = {0};
    hw_progress *progress = NULL;
    uint64_t count = (uint64_t)ceil(walk_opt.random_walk / STEP_S);
    HW_GO(hw_progress_create(&progress, "walking", count));
    for (uint64_t i = 0; i < count && !walk_interrupted(); i++) {
        if (now.steps == 0)
            decide(&now, &rng);
        now.steps--;
        hw_target_bind(target);
        HW_GO(step(w, &now.input, f));
        if (i == count / 2)
            f->half_rss_bytes = hw_rss_bytes();
        hw_progress_add(progress, 1);
    }
out:
    hw_progress_destroy(progress);
    return status;
}

hw_status walk_at_random(walk *w)
{
    hw_status status = HW_OK;
    hw_target *target = NULL;
    findings f = {0};
    w->input.width = walk_opt.size[0];
    w->input.height = walk_opt.size[1];
    HW_GO(hw_target_create(&target, walk_opt.size[0], walk_opt.size[1], walk_samples()));
    hw_target_bind(target);
    HW_GO(reach_config(w));
    walk_take_obstacles(w, true);
    HW_GO(walk_steps(w, target, &f));
    printf("random walk: %llu frames, %.0f units, %llu crossings, %llu bumps\n",
           (unsigned long long)f.frames, f.way, (unsigned long long)f.crossings,
           (unsigned long long)f.bumps);
    printf("loading      %llu stalls, %llu frames lacked data, slowest frame %.1f ms\n",
           (unsigned long long)w->stalls, (unsigned long long)w->missing_count, f.slowest_ms);
    printf("memory       %.1f MB half way, %.1f MB at the end, %.1f MB at the peak\n",
           (double)f.half_rss_bytes / 1e6, (double)hw_rss_bytes() / 1e6,
           (double)hw_rss_peak_bytes() / 1e6);
out:
    hw_target_destroy(target);
    return status;
}
