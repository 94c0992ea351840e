// Culling against brute force: nothing visible is lost, and next to nothing invisible is kept.
#include "cull.h"
#include "models.h"
#include "rng.h"
#include <stdlib.h>

#define COUNT 5000u

static hw_vec3 random_point(hw_rng *rng, float size)
{
    float x = hw_rng_float(rng), y = hw_rng_float(rng), z = hw_rng_float(rng);
    return hw_v3((x * 2 - 1) * size, (y * 2 - 1) * size, (z * 2 - 1) * size);
}

// Smallest signed distance of the box's foremost corner over the planes; < 0: outside one.
static double margin(const hw_frustum *frustum, hw_box box)
{
    double least = INFINITY;
    for (int p = 0; p < 6; p++) {
        const double *plane = frustum->planes[p];
        double best = -INFINITY;
        for (uint32_t i = 0; i < 8; i++) {
            hw_vec3 c = hw_box_corner(box, i);
            best = fmax(best, plane[0] * c.x + plane[1] * c.y + plane[2] * c.z + plane[3]);
        }
        least = fmin(least,
                     best / sqrt(plane[0] * plane[0] + plane[1] * plane[1] + plane[2] * plane[2]));
    }
    return least;
}

static void check_view(const hw_cull_set *set, const hw_box *boxes, hw_rng *rng, float size)
{
    uint32_t visible[COUNT];
    hw_camera camera = model_camera(random_point(rng, size), random_point(rng, 1), 1024);
    hw_mat4 matrix = hw_camera_view_projection(&camera);
    hw_frustum frustum = hw_frustum_make(&matrix);
    uint32_t count = hw_cull_visible(set, &frustum, visible), at = 0;
    for (uint32_t i = 0; i < COUNT; i++) {
        bool kept = at < count && visible[at] == i;
        at += kept;
        if (hw_frustum_meets_box(&frustum, boxes[i]) && !hw_box_is_empty(boxes[i]))
            assert_true(kept);
        if (kept)
            assert_true(margin(&frustum, boxes[i]) > -1e-4 * size - 0.03);
    }
    assert_int_equal(at, count); // rising, without others
}

static void test_against_brute_force(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(7, 1);
    for (float size = 10; size < 20000; size *= 10) {
        hw_box *boxes = NULL;
        hw_cull_set set;
        assert_ok(HW_NEW(&boxes, COUNT));
        assert_ok(hw_cull_set_create(&set, COUNT));
        for (uint32_t i = 0; i < COUNT; i++) {
            hw_vec3 p = random_point(&rng, size);
            boxes[i] = hw_box_empty();
            if (i % 10) {
                hw_box_add(&boxes[i], p);
                hw_box_add(&boxes[i], hw_v3_add(p, random_point(&rng, size / 20)));
                hw_cull_set_put(&set, i, boxes[i]);
            }
        }
        for (int view = 0; view < 40; view++)
            check_view(&set, boxes, &rng, size);
        hw_cull_set_free(&set);
        hw_free(boxes);
    }
}

static void test_empty_sets(void **state)
{
    (void)state;
    hw_cull_set set;
    uint32_t visible[3];
    hw_camera camera = model_camera(hw_v3(0, 0, 0), hw_v3(0, 1, 0), 64);
    hw_mat4 matrix = hw_camera_view_projection(&camera);
    hw_frustum frustum = hw_frustum_make(&matrix);
    assert_ok(hw_cull_set_create(&set, 0));
    assert_int_equal(hw_cull_visible(&set, &frustum, visible), 0);
    hw_cull_set_free(&set);
    assert_ok(hw_cull_set_create(&set, 3));
    assert_int_equal(hw_cull_visible(&set, &frustum, visible), 0);
    hw_cull_set_put(&set, 1, (hw_box){hw_v3(-1, 5, -1), hw_v3(1, 6, 1)});
    assert_int_equal(hw_cull_visible(&set, &frustum, visible), 1);
    assert_int_equal(visible[0], 1);
    hw_cull_set_free(&set);
    hw_cull_set_free(NULL);
    hw_alloc_fail_after(1);
    assert_int_equal(hw_cull_set_create(&set, 3), HW_MEMORY);
    hw_alloc_fail_after(0);
    assert_null(set.data);
}

static void test_sort(void **state)
{
    (void)state;
    static hw_cull_item items[COUNT], scratch[COUNT];
    hw_rng rng = hw_rng_make(3, 1);
    double sum = 0;
    for (uint32_t count = 0; count <= COUNT; count = count * 3 + 1) {
        uint64_t seen = 0;
        for (uint32_t i = 0; i < count; i++) {
            float u = hw_rng_float(&rng);
            items[i] = (hw_cull_item){i % 7 ? u * u * 20000 : 0, i};
        }
        hw_cull_sort(items, count, scratch);
        for (uint32_t i = 0; i < count; i++) {
            seen += items[i].index;
            sum += items[i].key;
            if (i > 0) {
                assert_true(items[i].key >= items[i - 1].key * (1 - 1 / 64.0f));
                if (items[i].key == items[i - 1].key) // stable
                    assert_true(items[i].index > items[i - 1].index);
            }
        }
        assert_int_equal(seen, (uint64_t)count * (count ? count - 1 : 0) / 2);
    }
    assert_true(sum > 0);
}

static void test_box_distance(void **state)
{
    (void)state;
    hw_box box = {hw_v3(-1, -2, -3), hw_v3(1, 2, 3)};
    assert_true(hw_box_distance(box, hw_v3(0.5f, -1.5f, 2)) == 0);
    assert_true(hw_box_distance(box, hw_v3(4, 6, 3)) == 5);
    assert_true(hw_box_distance(box, hw_v3(0, 0, -10)) == 7);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_against_brute_force),
        cmocka_unit_test(test_empty_sets),
        cmocka_unit_test(test_sort),
        cmocka_unit_test(test_box_distance),
    };
    return cmocka_run_group_tests_name("cull", tests, NULL, NULL);
}
