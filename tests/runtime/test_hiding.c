// What boxes hide in a picture, judged by rays: nothing that a ray of any pixel reaches may count
// as hidden, and what is plainly hidden must.
#include "hiding.h"
#include "models.h"
#include "rng.h"

static hw_box box(float x0, float y0, float z0, float x1, float y1, float z1)
{
    return (hw_box){{x0, y0, z0}, {x1, y1, z1}};
}

static hw_camera camera_at(hw_vec3 eye, hw_vec3 forward)
{
    return (hw_camera){.eye = eye,
                       .forward = forward,
                       .up = {0, 0, 1},
                       .fov_degrees = 60,
                       .width = 1000,
                       .height = 700};
}

// Where a ray enters a box that stands as its transform says; INFINITY if it misses.
static double entry(const hw_mat4 *transform, hw_box b, hw_vec3 eye, hw_vec3 direction)
{
    hw_mat4 inverse;
    assert_true(hw_mat4_inverse(*transform, &inverse));
    hw_vec3 o = hw_mat4_point(&inverse, eye), d = hw_mat4_direction(&inverse, direction);
    const double from[3] = {o.x, o.y, o.z}, to[3] = {d.x, d.y, d.z};
    const double low[3] = {b.min.x, b.min.y, b.min.z}, high[3] = {b.max.x, b.max.y, b.max.z};
    double first = 0, last = INFINITY;
    for (int k = 0; k < 3; k++) {
        double p = (low[k] - from[k]) / to[k], q = (high[k] - from[k]) / to[k];
        first = fmax(first, fmin(p, q));
        last = fmin(last, fmax(p, q));
    }
    return first <= last ? first : INFINITY;
}

// Each row: wall, what is behind, whether it is hidden. The eye is at the origin and looks along x.
static void walls_hide_what_is_behind(void **state)
{
    (void)state;
    const struct {
        hw_box walls[2], behind;
        bool hidden;
    } cases[] = {
        {{box(50, -30, -10, 53, 30, 20)}, box(100, -10, -5, 110, 10, 15), true},
        {{box(50, -30, -10, 53, 30, 20)}, box(100, -10, -5, 110, 10, 45), false}, // rises above
        {{box(50, -30, -10, 53, 30, 20)}, box(100, 55, -5, 110, 65, 15), false},  // beside its end
        {{box(50, -30, -10, 53, 30, 20)}, box(30, -10, -5, 40, 10, 5), false},    // before it
        {{box(50, -30, -10, 53, 30, 20)}, box(52, -10, -5, 80, 10, 5), true},     // stands in it
        {{box(50, -30, -10, 53, 0.5f, 20), box(50, -0.5f, -10, 53, 30, 20)},
         box(100, -10, -5, 110, 10, 15),
         true}, // two pieces that overlap
        {{box(50, -30, -10, 53, -0.2f, 20), box(50, 0.2f, -10, 53, 30, 20)},
         box(100, -10, -5, 110, 10, 15),
         false}, // a gap
        // Along the view, from behind the eye.
        {{box(-50, 5, -10, 200, 6, 40)}, box(100, 20, -5, 110, 30, 15), true},
        {{box(-50, -6, -10, 200, -5, 40)}, box(900, -30, -5, 1000, -20, 15), false},
    };
    const hw_mat4 identity = hw_mat4_identity();
    const hw_camera camera = camera_at(hw_v3(0, 0, 0), hw_v3(1, 0, 0));
    hw_hiding *h;
    assert_ok(hw_hiding_create(&h));
    assert_false(hw_hiding_hides(h, NULL, cases[0].behind)); // before the first picture
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        hw_hiding_begin(h, &camera);
        assert_false(hw_hiding_hides(h, NULL, cases[i].behind));
        for (int k = 0; k < 2; k++)
            if (cases[i].walls[k].max.x > cases[i].walls[k].min.x)
                hw_hiding_add(h, &identity, cases[i].walls[k]);
        if (hw_hiding_hides(h, NULL, cases[i].behind) != cases[i].hidden)
            fail_msg("case %zu", i);
    }
    hw_hiding_destroy(h);
}

static hw_mat4 random_transform(hw_rng *rng)
{
    double angle = 6.3 * (double)hw_rng_float(rng), c = cos(angle), s = sin(angle);
    hw_mat4 m = hw_mat4_translation(20 + 100 * (double)hw_rng_float(rng),
                                    80 * (double)hw_rng_float(rng) - 40,
                                    20 * (double)hw_rng_float(rng) - 10);
    hw_mat4 turn = hw_mat4_identity();
    double mirror = hw_rng_below(rng, 2) ? -1 : 1; // in x; and sheared along z
    turn.m[0] = c * mirror;
    turn.m[1] = s * mirror;
    turn.m[4] = -s;
    turn.m[5] = c;
    turn.m[8] = 0.3 * (double)hw_rng_float(rng);
    return hw_mat4_mul(m, turn);
}

static hw_box random_box(hw_rng *rng, float size)
{
    float x = size * (0.1f + hw_rng_float(rng)), y = size * (0.1f + hw_rng_float(rng)),
          z = size * (0.1f + hw_rng_float(rng));
    return box(-x, -y, -z, x, y, z);
}

#define WALLS 6

// Whether the eye sees a point of the box before all walls, in the picture.
static bool shows(const hw_camera *c, const hw_mat4 *walls, const hw_box *boxes,
                  const hw_mat4 *transform, hw_box b, hw_vec3 point)
{
    hw_vec3 d = hw_v3_sub(hw_mat4_point(transform, point), c->eye);
    hw_vec3 right = hw_v3_normalize(hw_v3_cross(c->forward, c->up));
    hw_vec3 down = hw_v3_cross(c->forward, right);
    double w = (double)hw_v3_dot(d, c->forward), focal = hw_camera_focal_px(c);
    double x = (double)hw_v3_dot(d, right) / w * focal + (double)c->jitter_x;
    double y = (double)hw_v3_dot(d, down) / w * focal - (double)c->jitter_y;
    if (w <= 0 || fabs(x) >= c->width / 2.0 || fabs(y) >= c->height / 2.0)
        return false;
    double t = entry(transform, b, c->eye, d) * 0.999999;
    for (int i = 0; i < WALLS; i++)
        if (entry(&walls[i], boxes[i], c->eye, d) < t)
            return false;
    return t < INFINITY;
}

// A coordinate of a point of a box, most often at one of its ends: what shows first is at the rim.
static float pick(float low, float high, hw_rng *rng)
{
    uint32_t dice = hw_rng_below(rng, 5);
    return dice < 2 ? low : dice < 4 ? high : low + (high - low) * hw_rng_float(rng);
}

// A box behind the walls, or one in a wall that may look out of it a little.
static hw_box hidden_box(const hw_mat4 *walls, const hw_box *boxes, hw_mat4 *at, hw_rng *rng)
{
    uint32_t k = hw_rng_below(rng, 2 * WALLS);
    if (k >= WALLS) {
        *at = random_transform(rng);
        at->m[12] += 60;
        return random_box(rng, 6);
    }
    *at = walls[k];
    float shrink = 0.5f + 0.5f * hw_rng_float(rng);
    hw_vec3 move = hw_v3_scale(boxes[k].max, 0.2f * (hw_rng_float(rng) - 0.5f));
    return (hw_box){hw_v3_add(hw_v3_scale(boxes[k].min, shrink), move),
                    hw_v3_add(hw_v3_scale(boxes[k].max, shrink), move)};
}

// Random boxes: none of which the eye sees a point is hidden, and many of the others are.
static void what_shows_is_not_hidden(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(3, 9);
    uint32_t hidden = 0;
    hw_hiding *h;
    assert_ok(hw_hiding_create(&h));
    for (int round = 0; round < 1000; round++) {
        hw_mat4 walls[WALLS], at;
        hw_box boxes[WALLS];
        hw_camera camera = camera_at(hw_v3(0, 0, 0), hw_v3(1, 0.2f * hw_rng_float(&rng), 0));
        camera.forward = hw_v3_normalize(camera.forward);
        camera.jitter_x = hw_rng_float(&rng) - 0.5f;
        camera.jitter_y = hw_rng_float(&rng) - 0.5f;
        camera.height = 100 + hw_rng_below(&rng, 100) * (round % 20 == 0 ? 20 : 1);
        camera.width = camera.height + hw_rng_below(&rng, 100);
        hw_hiding_begin(h, &camera);
        for (int i = 0; i < WALLS; i++) {
            walls[i] = random_transform(&rng);
            boxes[i] = random_box(&rng, 15);
            hw_hiding_add(h, &walls[i], boxes[i]);
        }
        for (int i = 0; i < 50; i++) {
            hw_box b = hidden_box(walls, boxes, &at, &rng);
            if (!hw_hiding_hides(h, &at, b))
                continue;
            hidden++;
            for (int k = 0; k < 50; k++) {
                hw_vec3 p = hw_v3(pick(b.min.x, b.max.x, &rng), pick(b.min.y, b.max.y, &rng),
                                  pick(b.min.z, b.max.z, &rng));
                if (shows(&camera, walls, boxes, &at, b, p))
                    fail_msg("round %d, box %d shows", round, i);
            }
        }
    }
    print_message("%u of 50000 hidden\n", hidden);
    assert_true(hidden > 5000);
    hw_hiding_destroy(h);
}

static void exhausted_memory_is_an_error(void **state)
{
    (void)state;
    hw_hiding *h;
    hw_alloc_fail_after(1);
    assert_int_equal(hw_hiding_create(&h), HW_MEMORY);
    hw_alloc_fail_after(0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(walls_hide_what_is_behind),
        cmocka_unit_test(what_shows_is_not_hidden),
        cmocka_unit_test(exhausted_memory_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
