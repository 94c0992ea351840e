#include "shapes.h"

#include "parallel.h"
#include "rays.h"
#include "rng.h"
#include <stdatomic.h>

static hw_vec3 hit_point(const hw_mesh *mesh, hw_hit hit)
{
    const uint32_t *t = mesh->indices + 3 * (size_t)hit.triangle_idx;
    hw_vec3 p = hw_v3_scale(mesh->positions[t[0]], 1 - hit.u - hit.v);
    return hw_v3_mad(hw_v3_mad(p, mesh->positions[t[1]], hit.u), mesh->positions[t[2]], hit.v);
}

static void test_plane_at_known_distance(void **state)
{
    (void)state;
    hw_mesh mesh = shape_plane(hw_v3(-5, -5, 2), hw_v3(10, 0, 0), hw_v3(0, 10, 0), 7, 7);
    hw_rays *rays = NULL;
    assert_int_equal(hw_rays_create_mesh(&rays, &mesh), HW_OK);
    // The direction is not of unit length: t counts in its lengths.
    hw_hit hit = hw_rays_cast(rays, hw_v3(0.3f, 0.7f, 10), hw_v3(0, 0, -2), 0, INFINITY);
    assert_float_equal(hit.t, 4, 1e-5);
    assert_int_equal(hit.object_idx, 0);
    hw_vec3 p = hit_point(&mesh, hit);
    assert_float_equal(p.x, 0.3, 1e-5);
    assert_float_equal(p.y, 0.7, 1e-5);
    assert_float_equal(p.z, 2, 1e-5);
    // Limits of t, both sides; misses.
    assert_true(hw_rays_cast(rays, hw_v3(0, 0, 10), hw_v3(0, 0, -2), 0, 3.9f).t == INFINITY);
    assert_true(hw_rays_cast(rays, hw_v3(0, 0, 10), hw_v3(0, 0, -2), 4.1f, 100).t == INFINITY);
    assert_true(hw_rays_cast(rays, hw_v3(0, 0, 10), hw_v3(0, 0, 1), 0, INFINITY).t == INFINITY);
    assert_true(hw_rays_cast(rays, hw_v3(6, 0, 10), hw_v3(0, 0, -1), 0, INFINITY).t == INFINITY);
    assert_true(hw_rays_occluded(rays, hw_v3(0, 0, 10), hw_v3(0, 0, -2), 0, INFINITY));
    assert_false(hw_rays_occluded(rays, hw_v3(0, 0, 10), hw_v3(0, 0, -2), 0, 3.9f));
    assert_false(hw_rays_occluded(rays, hw_v3(0, 0, 10), hw_v3(0, 0, -2), 4.1f, 100));
    hw_rays_destroy(rays);
    hw_mesh_free(&mesh);
}

// Parallel rays in packets find what single ones find, for counts that fill no packet too.
static void test_parallel_rays(void **state)
{
    (void)state;
    hw_mesh mesh = shape_sphere(hw_v3(0, 0, 0), 1, 40, 20);
    hw_rays *rays = NULL;
    assert_int_equal(hw_rays_create_mesh(&rays, &mesh), HW_OK);
    assert_ptr_equal(hw_rays_mesh(rays), &mesh);
    hw_vec3 origins[37], direction = hw_v3(0.1f, 0.2f, -1);
    hw_hit hits[38];
    uint32_t met = 0;
    hw_rng rng = hw_rng_make(3, 1);
    for (int i = 0; i < 37; i++)
        origins[i] = hw_v3(hw_rng_float(&rng) * 3 - 1.5f, hw_rng_float(&rng) * 3 - 1.5f, 4);
    for (uint32_t count = 0; count <= 37; count++) {
        hits[count].t = -7;
        hw_rays_cast_parallel(rays, origins, direction, count, hits);
        assert_float_equal(hits[count].t, -7, 0); // nothing beyond
        for (uint32_t i = 0; i < count; i++) {
            hw_hit single = hw_rays_cast(rays, origins[i], direction, 0, INFINITY);
            assert_int_equal(isinf(single.t), isinf(hits[i].t));
            assert_int_equal(hits[i].object_idx, 0);
            if (isinf(single.t))
                continue;
            met++;
            assert_float_equal(hits[i].t, single.t, 1e-5);
            hw_vec3 off = hw_v3_sub(hit_point(&mesh, hits[i]), hit_point(&mesh, single));
            assert_float_equal(hw_v3_length(off), 0, 1e-5);
        }
    }
    assert_true(met > 37);
    hw_rays_destroy(rays);
    hw_mesh_free(&mesh);
}

static void test_edges_do_not_leak(void **state)
{
    (void)state;
    hw_mesh mesh = shape_plane(hw_v3(-1, -1, 0), hw_v3(2, 0, 0), hw_v3(0, 2, 0), 16, 16);
    hw_rays *rays = NULL;
    assert_int_equal(hw_rays_create_mesh(&rays, &mesh), HW_OK);
    for (int i = 1; i < 256; i++) { // through vertices, edges and diagonals
        float x = -1 + (float)i / 128;
        assert_true(hw_rays_occluded(rays, hw_v3(x, x, 3), hw_v3(0, 0, -1), 0, 10));
        assert_true(hw_rays_occluded(rays, hw_v3(x, 0, 3), hw_v3(0, 0, -1), 0, 10));
        assert_true(hw_rays_occluded(rays, hw_v3(0.1f, 0.2f, 3),
                                     hw_v3(x * 0.5f - 0.1f, x * 0.5f - 0.2f, -3), 0, 10));
    }
    hw_rays_destroy(rays);
    hw_mesh_free(&mesh);
}

// A unit sphere, placed twice: at x = 10 scaled by 2, and at x = 20 turned and squashed.
static hw_scene two_spheres(void)
{
    hw_mesh meshes[2] = {shape_sphere(hw_v3(0, 0, 0), 1, 64, 32),
                         shape_sphere(hw_v3(0, 0, 0), 1, 64, 32)};
    hw_mat4 turned = hw_mat4_mul(hw_mat4_rotation_z(0.7), hw_mat4_scale(1, 1, 0.5));
    hw_mat4 places[2] = {hw_mat4_mul(hw_mat4_translation(10, 0, 0), hw_mat4_scale(2, 2, 2)),
                         hw_mat4_mul(hw_mat4_translation(20, 0, 0), turned)};
    return shape_scene(meshes, places, 2);
}

static void test_scene_names_the_object(void **state)
{
    (void)state;
    hw_scene scene = two_spheres();
    hw_rays *rays = NULL;
    assert_int_equal(hw_rays_create_scene(&rays, &scene), HW_OK);
    hw_vec3 eye = hw_v3(0, 0, 0), out = hw_v3(1, 0, 0);
    hw_hit hit = hw_rays_cast(rays, eye, out, 0, INFINITY);
    assert_int_equal(hit.object_idx, 0);
    assert_float_equal(hit.t, 8, 0.02);
    hit = hw_rays_cast(rays, hw_v3(15, 0, 0), out, 0, INFINITY);
    assert_int_equal(hit.object_idx, 1);
    assert_float_equal(hit.t, 4, 0.02);
    // One object only, though the other stands before it; t in world units in spite of the scale.
    hit = hw_rays_cast_object(rays, 1, eye, out, 0, INFINITY);
    assert_int_equal(hit.object_idx, 1);
    assert_float_equal(hit.t, 19, 0.02);
    hit = hw_rays_cast_object(rays, 0, eye, hw_v3(2, 0, 0), 0, INFINITY);
    assert_float_equal(hit.t, 4, 0.01);
    hit = hw_rays_cast_object(rays, 1, hw_v3(20, 0, 9), hw_v3(0, 0, -1), 0, INFINITY);
    assert_float_equal(hit.t, 8.5, 0.01);
    assert_true(hw_rays_cast_object(rays, 0, eye, hw_v3(0, 1, 0), 0, INFINITY).t == INFINITY);
    hw_rays_destroy(rays);
    hw_scene_free(&scene);
}

static void test_many_equals_one_by_one(void **state)
{
    (void)state;
    hw_scene scene = two_spheres();
    hw_rays *rays = NULL;
    assert_int_equal(hw_rays_create_scene(&rays, &scene), HW_OK);
    enum { COUNT = 37 };                     // not a multiple of any packet
    hw_vec3 directions[COUNT], local[COUNT]; // in the world, in the mesh's space
    hw_hit hits[COUNT];
    for (int i = 0; i < COUNT; i++)
        directions[i] = hw_v3(1, 0.012f * (float)(i - 11), 0.002f * (float)(i - 11));
    for (uint32_t object = 0; object < 2; object++) {
        int found = 0;
        hw_mat4 inverse;
        assert_true(hw_mat4_inverse(scene.objects[object].transform, &inverse));
        for (int i = 0; i < COUNT; i++)
            local[i] = hw_mat4_direction(&inverse, directions[i]);
        hw_rays_cast_mesh_many(rays, object, hw_mat4_point(&inverse, hw_v3(0, 0, 0)), local, COUNT,
                               object == 0, hits);
        for (int i = 0; i < COUNT; i++) {
            hw_hit one =
                hw_rays_cast_object(rays, object, hw_v3(0, 0, 0), directions[i], 0, INFINITY);
            assert_int_equal(isinf(one.t), isinf(hits[i].t));
            if (isinf(one.t))
                continue;
            found++;
            assert_float_equal(one.t, hits[i].t, 1e-4);
            const hw_mesh *mesh = &scene.meshes[object]; // rays on an edge may name either side
            hw_vec3 p = hit_point(mesh, one), q = hit_point(mesh, hits[i]);
            assert_float_equal(hw_v3_length(hw_v3_sub(p, q)), 0, 1e-4);
        }
        assert_in_range(found, 5, COUNT - 5);
    }
    hw_rays_destroy(rays);
    hw_scene_free(&scene);
}

static void test_singular_transform_fails(void **state)
{
    (void)state;
    hw_mesh mesh = shape_sphere(hw_v3(0, 0, 0), 1, 8, 4);
    hw_mat4 flat = hw_mat4_scale(1, 1, 0);
    hw_scene scene = shape_scene(&mesh, &flat, 1);
    hw_rays *rays = NULL;
    assert_int_equal(hw_rays_create_scene(&rays, &scene), HW_FORMAT);
    assert_null(rays);
    hw_scene_free(&scene);
}

static void test_allocation_failures(void **state)
{
    (void)state;
    hw_scene scene = two_spheres();
    hw_rays *rays = NULL;
    for (uint64_t n = 1;; n++) {
        hw_alloc_fail_after(n);
        hw_status status = hw_rays_create_scene(&rays, &scene);
        hw_alloc_fail_after(0);
        if (status == HW_OK)
            break;
        assert_int_equal(status, HW_MEMORY);
        assert_null(rays);
        assert_in_range(n, 1, 100);
    }
    hw_rays_destroy(rays);
    hw_scene_free(&scene);
    hw_rays_destroy(NULL);
}

static void test_closest_point(void **state)
{
    (void)state;
    hw_mesh sphere = shape_sphere(hw_v3(1, 2, 3), 2, 128, 64);
    hw_rays *rays = NULL;
    assert_int_equal(hw_rays_create_mesh(&rays, &sphere), HW_OK);
    hw_rng rng = hw_rng_make(1, 2);
    for (int i = 0; i < 200; i++) {
        hw_vec3 d =
            hw_v3(hw_rng_float(&rng) - 0.5f, hw_rng_float(&rng) - 0.5f, hw_rng_float(&rng) - 0.5f);
        d = hw_v3_normalize(d);
        float distance = 0.5f + 4 * hw_rng_float(&rng);
        hw_vec3 p = hw_v3_mad(hw_v3(1, 2, 3), d, distance);
        hw_closest closest = hw_rays_closest(rays, p, INFINITY);
        assert_float_equal(closest.distance, fabsf(distance - 2), 4e-3); // facets lie inside
        assert_float_equal(hw_v3_length(hw_v3_sub(closest.point, p)), closest.distance, 1e-5);
        const uint32_t *t = sphere.indices + 3 * (size_t)closest.triangle_idx;
        hw_vec3 q = hw_v3_scale(sphere.positions[t[0]], 1 - closest.u - closest.v);
        q = hw_v3_mad(q, sphere.positions[t[1]], closest.u);
        q = hw_v3_mad(q, sphere.positions[t[2]], closest.v);
        assert_float_equal(hw_v3_length(hw_v3_sub(q, closest.point)), 0, 1e-5);
    }
    assert_true(hw_rays_closest(rays, hw_v3(1, 2, 6), 0.9f).distance == INFINITY);
    assert_float_equal(hw_rays_closest(rays, hw_v3(1, 2, 6), 1.1f).distance, 1, 1e-5);
    hw_rays_destroy(rays);
    hw_mesh_free(&sphere);
}

// Every region of a triangle (face, edges, corners), against a dense scan; degenerate ones too.
static void check_triangle(hw_vec3 a, hw_vec3 b, hw_vec3 c)
{
    hw_vec3 positions[3] = {a, b, c};
    uint32_t indices[3] = {0, 1, 2};
    hw_mesh mesh = {
        .vertex_count = 3, .index_count = 3, .positions = positions, .indices = indices};
    hw_rays *rays = NULL;
    assert_int_equal(hw_rays_create_mesh(&rays, &mesh), HW_OK);
    hw_rng rng = hw_rng_make(7, 7);
    for (int k = 0; k < 60; k++) {
        hw_vec3 p = hw_v3(4 * hw_rng_float(&rng) - 2, 4 * hw_rng_float(&rng) - 2,
                          hw_rng_float(&rng) - 0.5f);
        float best = INFINITY;
        for (int i = 0; i <= 100; i++)
            for (int j = 0; i + j <= 100; j++) {
                hw_vec3 q = hw_v3_mad(a, hw_v3_sub(b, a), (float)i / 100);
                q = hw_v3_mad(q, hw_v3_sub(c, a), (float)j / 100);
                best = fminf(best, hw_v3_length(hw_v3_sub(p, q)));
            }
        float found = hw_rays_closest(rays, p, INFINITY).distance;
        assert_true(found <= best + 1e-5f);
        assert_true(found >= best - 0.02f);
    }
    hw_rays_destroy(rays);
}

static void test_closest_in_every_region(void **state)
{
    (void)state;
    check_triangle(hw_v3(0, 0, 0), hw_v3(1, 0.2f, 0), hw_v3(-0.3f, 1, 0.1f));
    check_triangle(hw_v3(-1, 0, 0), hw_v3(1, 0, 0), hw_v3(0, 0.1f, 0)); // obtuse
    check_triangle(hw_v3(-1, 0, 0), hw_v3(1, 0, 0), hw_v3(0, 0, 0));    // a segment
}

#define PAGED_OBJECTS 6u
#define PAGED_RAYS    40u

typedef struct paged {
    hw_rays *whole, *rays;
    _Atomic int64_t reserved;
    _Atomic uint32_t refusals; // this many reservations are refused
} paged;

static hw_status reserve(void *context, uint64_t bytes)
{
    paged *p = context;
    if (atomic_load(&p->refusals) > 0) {
        atomic_fetch_sub(&p->refusals, 1);
        return hw_fail(HW_LIMIT, "no room");
    }
    atomic_fetch_add(&p->reserved, (int64_t)bytes);
    return HW_OK;
}

static void release(void *context, uint64_t bytes)
{
    paged *p = context;
    atomic_fetch_sub(&p->reserved, (int64_t)bytes);
}

// Casts against one object while other threads take trees away.
static hw_status cast_paged(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    paged *p = context;
    uint32_t object = (uint32_t)(index * 7 % PAGED_OBJECTS);
    hw_rng rng = hw_rng_make(index, 2);
    HW_TRY(hw_rays_pin(p->rays, object));
    assert_true(hw_rays_pins(p->rays) > 0);
    hw_rays_evict(p->rays);
    for (uint32_t i = 0; i < PAGED_RAYS; i++) {
        hw_vec3 d = hw_v3(hw_rng_float(&rng) - 0.5f + (float)object, hw_rng_float(&rng) - 0.5f, -2);
        hw_vec3 origin = hw_v3(0, 0, 6);
        hw_hit a = hw_rays_cast_object(p->whole, object, origin, d, 0, INFINITY);
        hw_hit b = hw_rays_cast_object(p->rays, object, origin, d, 0, INFINITY);
        if (memcmp(&a, &b, sizeof a))
            return hw_fail(HW_INTERNAL, "object %u: another hit", object);
    }
    hw_rays_unpin(p->rays, object);
    return HW_OK;
}

// The hits are the same to the bit, however often trees go and come back.
static void test_paged_scene(void **state)
{
    (void)state;
    hw_mesh meshes[PAGED_OBJECTS];
    hw_mat4 transforms[PAGED_OBJECTS];
    for (uint32_t i = 0; i < PAGED_OBJECTS; i++) {
        meshes[i] = shape_sphere(hw_v3(0, 0, 0), 1, 20 + i, 12);
        transforms[i] = hw_mat4_translation(3.0 * i, 0, 0);
    }
    hw_scene scene = shape_scene(meshes, transforms, PAGED_OBJECTS);
    paged p = {0};
    const hw_rays_memory memory = {&p, reserve, release};
    assert_int_equal(hw_rays_create_scene(&p.whole, &scene), HW_OK);
    assert_int_equal(hw_rays_create_paged(&p.rays, &scene, &memory), HW_OK);
    assert_false(hw_rays_evict(p.rays)); // nothing stands yet
    assert_int_equal(hw_rays_builds(p.rays), 0);
    assert_int_equal(hw_parallel_for(600, 4, cast_paged, &p, NULL), HW_OK);
    assert_true(hw_rays_builds(p.rays) > PAGED_OBJECTS);
    assert_int_equal(hw_rays_pins(p.rays), 0);
    while (hw_rays_evict(p.rays))
        ;
    // A refused build is an error, and can be tried again.
    p.refusals = 1;
    assert_int_equal(hw_rays_pin(p.rays, 0), HW_LIMIT);
    assert_int_equal(hw_rays_pin(p.rays, 0), HW_OK);
    assert_false(hw_rays_evict(p.rays)); // what is pinned stays
    hw_rays_unpin(p.rays, 0);
    assert_true(hw_rays_evict(p.rays));
    assert_int_equal(p.reserved, 0);
    assert_int_equal(hw_rays_pin(p.whole, 0), HW_OK); // nothing to do
    hw_rays_unpin(p.whole, 0);
    hw_rays_destroy(p.rays);
    hw_rays_destroy(p.whole);
    hw_scene_free(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_plane_at_known_distance),
        cmocka_unit_test(test_parallel_rays),
        cmocka_unit_test(test_edges_do_not_leak),
        cmocka_unit_test(test_scene_names_the_object),
        cmocka_unit_test(test_many_equals_one_by_one),
        cmocka_unit_test(test_singular_transform_fails),
        cmocka_unit_test(test_allocation_failures),
        cmocka_unit_test(test_closest_point),
        cmocka_unit_test(test_closest_in_every_region),
        cmocka_unit_test(test_paged_scene),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
