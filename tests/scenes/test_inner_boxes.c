// Boxes inside closed meshes: wholly inside, and nearly as large as can be.
#include "../preprocess/shapes.h"
#include "inner_boxes.h"

static double volume(hw_box b)
{
    hw_vec3 s = hw_box_size(b);
    return (double)s.x * (double)s.y * (double)s.z;
}

static void a_box_holds_nearly_itself(void **state)
{
    (void)state;
    // Cubes, slabs and posts, with corners on and off the voxels.
    static const float sides[][3] = {{40, 40, 40}, {45, 3, 27}, {5, 5, 60}, {1000, 100, 333}};
    for (size_t i = 0; i < sizeof sides / sizeof *sides; i++) {
        hw_box outer = {{-7, 3, 11}, {sides[i][0] - 7, sides[i][1] + 3, sides[i][2] + 11}};
        hw_mesh mesh = shape_box(outer, false);
        hw_inner_boxes boxes;
        assert_int_equal(hw_inner_boxes_find(&mesh, &boxes), HW_OK);
        assert_int_equal(boxes.count, 1);
        assert_true(boxes.boxes[0].min.x > outer.min.x && boxes.boxes[0].max.x < outer.max.x);
        assert_true(boxes.boxes[0].min.y > outer.min.y && boxes.boxes[0].max.y < outer.max.y);
        assert_true(boxes.boxes[0].min.z > outer.min.z && boxes.boxes[0].max.z < outer.max.z);
        assert_true(volume(boxes.boxes[0]) > 0.2 * volume(outer));
        hw_mesh_free(&mesh);
    }
}

static void boxes_stay_within_a_sphere(void **state)
{
    (void)state;
    hw_mesh mesh = shape_sphere(hw_v3(100, -50, 7), 10, 64, 32);
    hw_inner_boxes boxes;
    assert_int_equal(hw_inner_boxes_find(&mesh, &boxes), HW_OK);
    assert_int_equal(boxes.count, HW_INNER_BOXES_MAX);
    for (uint32_t i = 0; i < boxes.count; i++) {
        assert_true(volume(boxes.boxes[i]) > 0);
        for (uint32_t k = 0; k < 8; k++) {
            hw_vec3 p = hw_v3_sub(hw_box_corner(boxes.boxes[i], k), hw_v3(100, -50, 7));
            assert_true(hw_v3_length(p) < 10);
        }
    }
    assert_true(volume(boxes.boxes[0]) >
                0.3 * 8 * 1000 / pow(3, 1.5)); // of the largest cube within
    hw_mesh_free(&mesh);
}

// A closed mesh whose inside is thinner than a voxel holds nothing, nor does an open sheet.
static void thin_things_hold_none(void **state)
{
    (void)state;
    hw_mesh meshes[] = {shape_box((hw_box){{0, 0, 0}, {100, 0.5f, 100}}, false),
                        shape_plane(hw_v3(0, 0, 0), hw_v3(9, 0, 1), hw_v3(0, 9, 2), 5, 5)};
    for (int i = 0; i < 2; i++) {
        hw_inner_boxes boxes = {.count = 9};
        assert_int_equal(hw_inner_boxes_find(&meshes[i], &boxes), HW_OK);
        assert_int_equal(boxes.count, 0);
        hw_mesh_free(&meshes[i]);
    }
}

// Where floats are as coarse as voxels there is no telling where a box would be.
static void far_from_the_origin_there_are_none(void **state)
{
    (void)state;
    static const float places[] = {1e3f, 1e6f};
    for (int i = 0; i < 2; i++) {
        float at = places[i];
        hw_mesh mesh = shape_box((hw_box){{at, -at, at}, {at + 1, 1 - at, at + 1}}, false);
        hw_inner_boxes boxes;
        assert_int_equal(hw_inner_boxes_find(&mesh, &boxes), HW_OK);
        assert_int_equal(boxes.count, i == 0);
        hw_mesh_free(&mesh);
    }
}

// The least distance of a surface to a box, by points on the surface; negative if one is inside.
static float clearance(const hw_mesh *mesh, hw_box box)
{
    float least = INFINITY;
    for (uint32_t i = 0; i < mesh->index_count; i += 3)
        for (int u = 0; u <= 20; u++)
            for (int v = 0; u + v <= 20; v++) {
                hw_vec3 p = hw_v3_scale(mesh->positions[mesh->indices[i]], (float)u / 20);
                p = hw_v3_mad(p, mesh->positions[mesh->indices[i + 1]], (float)v / 20);
                p = hw_v3_mad(p, mesh->positions[mesh->indices[i + 2]], (float)(20 - u - v) / 20);
                hw_vec3 below = hw_v3_sub(box.min, p), above = hw_v3_sub(p, box.max);
                hw_vec3 out = hw_v3_max(below, above);
                least = fminf(least, fmaxf(out.x, fmaxf(out.y, out.z)));
            }
    return least;
}

static void fitted_boxes_reach_the_surface(void **state)
{
    (void)state;
    hw_mesh meshes[] = {shape_box((hw_box){{0, 0, 0}, {46, 3, 27}}, false),
                        shape_sphere(hw_v3(100, -50, 7), 10, 24, 12)};
    for (int i = 0; i < 2; i++) {
        hw_inner_boxes boxes, fitted;
        assert_int_equal(hw_inner_boxes_find(&meshes[i], &boxes), HW_OK);
        fitted = boxes;
        hw_inner_boxes_fit(&meshes[i], &fitted);
        for (uint32_t k = 0; k < boxes.count; k++) {
            assert_true(volume(fitted.boxes[k]) >= volume(boxes.boxes[k]));
            assert_true(clearance(&meshes[i], fitted.boxes[k]) > 0);
        }
        if (i == 0)
            assert_true(volume(fitted.boxes[0]) > 0.98 * 46 * 3 * 27);
    }
    for (int i = 0; i < 2; i++)
        hw_mesh_free(&meshes[i]);
}

// A hole, or a face turned round, and nothing is enclosed.
static void only_closed_meshes_are_solid(void **state)
{
    (void)state;
    hw_mesh mesh = shape_box((hw_box){{0, 0, 0}, {4, 3, 2}}, false);
    bool solid;
    assert_int_equal(hw_mesh_is_solid(&mesh, &solid), HW_OK);
    assert_true(solid);
    uint32_t swap = mesh.indices[3];
    mesh.indices[3] = mesh.indices[4];
    mesh.indices[4] = swap;
    assert_int_equal(hw_mesh_is_solid(&mesh, &solid), HW_OK);
    assert_false(solid);
    mesh.indices[4] = mesh.indices[3];
    mesh.indices[3] = swap;
    mesh.index_count -= 3;
    assert_int_equal(hw_mesh_is_solid(&mesh, &solid), HW_OK);
    assert_false(solid);
    hw_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_box_holds_nearly_itself),
        cmocka_unit_test(boxes_stay_within_a_sphere),
        cmocka_unit_test(thin_things_hold_none),
        cmocka_unit_test(far_from_the_origin_there_are_none),
        cmocka_unit_test(fitted_boxes_reach_the_surface),
        cmocka_unit_test(only_closed_meshes_are_solid),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
