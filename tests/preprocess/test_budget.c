// The bound of memory: what is taken out of the heap reads the same, trees go when there is no room
// for all, and an impossible bound is refused.
#include "shapes.h"

#include "budget.h"
#include "parallel.h"
#include "system.h"
#include <string.h>

#define MESHES 8u
#define ROUNDS 3u

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SANITIZED 1 // freed memory is kept for a while: the process cannot be held to a bound
#else
#define SANITIZED 0
#endif

static hw_scene make_scene(uint32_t sides)
{
    hw_mesh meshes[MESHES];
    hw_mat4 transforms[MESHES];
    for (uint32_t i = 0; i < MESHES; i++) {
        meshes[i] = shape_sphere(hw_v3(0, 0, 0), 1 + 0.1f * (float)i, sides, sides / 2);
        transforms[i] = hw_mat4_translation(3.0 * i, 0, 0);
    }
    return shape_scene(meshes, transforms, MESHES);
}

static void taken_meshes_read_the_same(void **state)
{
    (void)state;
    hw_scene scene = make_scene(40), copy = make_scene(40);
    hw_chain chain = {0};
    hw_budget *budget = NULL;
    assert_int_equal(hw_chain_make(&scene.meshes[2], NULL, &chain), HW_OK);
    hw_mesh kept = {0};
    assert_int_equal(hw_mesh_copy(&chain.levels[1], &kept), HW_OK);
    assert_int_equal(hw_budget_create(&budget, UINT64_C(1) << 40, "."), HW_OK);
    assert_int_equal(hw_budget_take_scene(budget, &scene), HW_OK);
    assert_int_equal(hw_budget_take_chain(budget, 2, &chain), HW_OK);
    for (uint32_t i = 0; i < MESHES; i++)
        assert_true(hw_mesh_equal(&scene.meshes[i], &copy.meshes[i]));
    assert_true(hw_mesh_equal(&chain.levels[0], &copy.meshes[2]));
    assert_true(hw_mesh_equal(&chain.levels[1], &kept));
    assert_true(hw_budget_scratch_bytes(budget) > 0);
    assert_int_equal(hw_budget_use(budget, 2), HW_OK);
    assert_int_equal(hw_budget_use(NULL, 2), HW_OK);
    hw_budget_destroy(budget);
    assert_null(scene.meshes[0].positions);
    hw_mesh_free(&kept);
    hw_chain_free(&chain);
    hw_scene_free(&scene);
    hw_scene_free(&copy);
    hw_budget_destroy(NULL);
}

typedef struct walk {
    hw_budget *budget;
    hw_rays *rays;
    _Atomic uint64_t most;
} walk;

static hw_status visit(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    walk *w = context;
    uint32_t object = (uint32_t)(index % MESHES);
    HW_TRY(hw_budget_use(w->budget, object));
    HW_TRY(hw_rays_pin(w->rays, object));
    float radius = 1 + 0.1f * (float)object;
    hw_hit hit = hw_rays_cast_object(w->rays, object, hw_v3(3.0f * (float)object, 0.01f, 9),
                                     hw_v3(0, 0, -1), 0, INFINITY);
    hw_rays_unpin(w->rays, object);
    uint64_t rss = hw_rss_bytes(), most = atomic_load(&w->most);
    while (rss > most && !atomic_compare_exchange_weak(&w->most, &most, rss))
        ;
    return fabsf(hit.t - (9 - radius)) < 1e-2f ? HW_OK : hw_fail(HW_INTERNAL, "a wrong hit");
}

// Room for about half of the trees: they go and come back, and memory stays within the bound.
static void trees_go_when_memory_is_short(void **state)
{
    (void)state;
    if (SANITIZED)
        skip();
    hw_scene scene = make_scene(400);
    walk w = {0};
    uint64_t triangles = scene.meshes[0].index_count / 3, bound = 0;
    assert_int_equal(hw_budget_create(&w.budget, UINT64_C(1) << 40, "."), HW_OK);
    assert_int_equal(hw_budget_take_scene(w.budget, &scene), HW_OK);
    hw_budget_destroy(w.budget); // its arrays are gone: what the process needs without a scene
    hw_scene_free(&scene);
    scene = make_scene(400);
    bound = hw_rss_bytes() + 300 * triangles + (16 << 20);
    assert_int_equal(hw_budget_create(&w.budget, bound, "."), HW_OK);
    assert_int_equal(hw_budget_take_scene(w.budget, &scene), HW_OK);
    assert_int_equal(hw_budget_create_rays(w.budget, &scene, &w.rays), HW_OK);
    assert_int_equal(hw_parallel_for(ROUNDS * MESHES, 2, visit, &w, NULL), HW_OK);
    assert_true(w.most <= bound);
    assert_true(hw_rays_builds(w.rays) > MESHES);
    // What can never fit is refused at once, with the bound that would do.
    assert_int_equal(hw_budget_reserve(w.budget, bound), HW_LIMIT);
    assert_non_null(strstr(hw_error_text(), "at least"));
    assert_int_equal(hw_budget_reserve(w.budget, 1000), HW_OK);
    hw_budget_release(w.budget, 1000);
    hw_rays_destroy(w.rays);
    hw_budget_destroy(w.budget);
    hw_scene_free(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(taken_meshes_read_the_same),
        cmocka_unit_test(trees_go_when_memory_is_short),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
