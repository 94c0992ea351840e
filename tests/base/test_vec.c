#include "rng.h"
#include "vec.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static void assert_near(double a, double b, double tolerance)
{
    if (!(fabs(a - b) <= tolerance))
        fail_msg("%.17g is not within %g of %.17g", a, tolerance, b);
}

static void assert_v3(hw_vec3 v, double x, double y, double z, double tolerance)
{
    assert_near((double)v.x, x, tolerance);
    assert_near((double)v.y, y, tolerance);
    assert_near((double)v.z, z, tolerance);
}

static hw_mat4 random_matrix(hw_rng *rng, double scale)
{
    hw_mat4 m;
    for (int i = 0; i < 16; i++)
        m.m[i] = ((double)hw_rng_float(rng) * 2 - 1) * scale;
    return m;
}

static void vectors(void **state)
{
    (void)state;
    hw_vec3 x = hw_v3(1, 0, 0), y = hw_v3(0, 1, 0);
    assert_v3(hw_v3_cross(x, y), 0, 0, 1, 0);
    assert_v3(hw_v3_normalize(hw_v3(3, 0, 4)), 0.6, 0, 0.8, 1e-7);
    assert_v3(hw_v3_normalize(hw_v3(0, 0, 0)), 0, 0, 0, 0);
    assert_v3(hw_v3_mad(x, y, 5), 1, 5, 0, 0);
    assert_near((double)hw_v3_dot(hw_v3(1, 2, 3), hw_v3(4, 5, 6)), 32, 0);
    assert_false(hw_v3_finite(hw_v3(0, NAN, 0)));
    assert_false(hw_v3_finite(hw_v3(0, 0, INFINITY)));
    assert_true(hw_v3_finite(hw_v3(0, 1, 2)));
}

static void boxes(void **state)
{
    (void)state;
    hw_box b = hw_box_empty();
    assert_true(hw_box_is_empty(b));
    hw_box_add(&b, hw_v3(1, 2, 3));
    assert_false(hw_box_is_empty(b));
    hw_box_add(&b, hw_v3(-1, 4, 0));
    assert_v3(b.min, -1, 2, 0, 0);
    assert_v3(b.max, 1, 4, 3, 0);
    assert_v3(hw_box_centre(b), 0, 3, 1.5, 0);
    assert_near((double)hw_box_diagonal(b), sqrt(17), 1e-6);
    assert_v3(hw_box_corner(b, 0), -1, 2, 0, 0);
    assert_v3(hw_box_corner(b, 5), 1, 2, 3, 0);
    hw_box u = hw_box_union(b, hw_box_empty());
    assert_v3(u.min, -1, 2, 0, 0);
    hw_mat4 m = hw_mat4_identity();
    assert_true(hw_box_is_empty(hw_mat4_box(&m, hw_box_empty())));
}

static void products_apply_right_to_left(void **state)
{
    (void)state;
    hw_mat4 t = hw_mat4_translation(10, 20, 30), s = hw_mat4_scale(2, 3, 4);
    hw_mat4 r = hw_mat4_rotation_z(HW_PI / 2);
    hw_mat4 ts = hw_mat4_mul(t, s), st = hw_mat4_mul(s, t);
    assert_v3(hw_mat4_point(&ts, hw_v3(1, 1, 1)), 12, 23, 34, 0);
    assert_v3(hw_mat4_point(&st, hw_v3(1, 1, 1)), 22, 63, 124, 0);
    assert_v3(hw_mat4_direction(&ts, hw_v3(1, 1, 1)), 2, 3, 4, 0);
    assert_v3(hw_mat4_point(&r, hw_v3(1, 0, 5)), 0, 1, 5, 1e-7); // counter-clockwise
    assert_near(t.m[12], 10, 0);                                 // column-major
    float f[16];
    hw_mat4_to_float(&t, f);
    assert_true(f[12] == 10 && f[13] == 20 && f[14] == 30 && f[15] == 1);
}

static void inverses(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(1, 1);
    for (int i = 0; i < 2000; i++) {
        // Scales from micrometres to megametres.
        hw_mat4 m = random_matrix(&rng, pow(10, (int)hw_rng_below(&rng, 13) - 6)), inverse;
        if (!hw_mat4_inverse(m, &inverse))
            fail_msg("matrix %d was found singular", i);
        hw_mat4 unit = hw_mat4_mul(m, inverse), expected = hw_mat4_identity();
        for (int k = 0; k < 16; k++)
            assert_near(unit.m[k], expected.m[k], 1e-8);
    }
}

static void badly_scaled_inverses(void **state)
{
    (void)state;
    hw_mat4 inverse;
    // Rows and columns twelve decades apart are no sign of singularity.
    hw_mat4 m = hw_mat4_mul(hw_mat4_translation(1e6, -1e6, 1e-6), hw_mat4_scale(1e-9, 1e3, 1e-12));
    assert_true(hw_mat4_inverse(m, &inverse));
    hw_mat4 unit = hw_mat4_mul(inverse, m);
    for (int k = 0; k < 16; k++)
        assert_near(unit.m[k], k % 5 == 0, 1e-9);
}

static void singular_matrices_are_told(void **state)
{
    (void)state;
    hw_mat4 m = hw_mat4_scale(1, 0, 1), inverse;
    assert_false(hw_mat4_inverse(m, &inverse));
    assert_true(inverse.m[0] == 1 && inverse.m[5] == 1 && inverse.m[1] == 0);
    for (int i = 0; i < 16; i++) // rank 2, and no zero in it
        m.m[i] = i + 1;
    assert_false(hw_mat4_inverse(m, &inverse));
    m = hw_mat4_identity();
    m.m[3] = NAN;
    assert_false(hw_mat4_inverse(m, &inverse));
    assert_true(inverse.m[3] == 0);
    m.m[3] = INFINITY;
    assert_false(hw_mat4_inverse(m, &inverse));
}

// Normals stay perpendicular to the surface and on its outer side under any affine map.
static void normals_follow_the_surface(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(5, 5);
    for (int i = 0; i < 1000; i++) {
        hw_mat4 m = random_matrix(&rng, 3);
        m.m[3] = m.m[7] = m.m[11] = 0;
        m.m[15] = 1;
        hw_vec3 a = hw_v3(hw_rng_float(&rng), hw_rng_float(&rng), 0.25f);
        hw_vec3 b = hw_v3(-0.5f, hw_rng_float(&rng), hw_rng_float(&rng));
        hw_vec3 n = hw_v3_normalize(hw_v3_cross(a, b));
        hw_vec3 moved = hw_mat4_normal(&m, n);
        assert_near((double)hw_v3_length(moved), 1, 1e-5);
        hw_vec3 ma = hw_v3_normalize(hw_mat4_direction(&m, a));
        hw_vec3 mb = hw_v3_normalize(hw_mat4_direction(&m, b));
        assert_near((double)hw_v3_dot(moved, ma), 0, 1e-4);
        assert_near((double)hw_v3_dot(moved, mb), 0, 1e-4);
        // n points to the outer side: so must what it is mapped to, mirrors included.
        assert_true(hw_v3_dot(moved, hw_mat4_direction(&m, n)) > 0);
    }
}

static void boxes_hold_what_they_bound(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(8, 8);
    hw_mat4 m = hw_mat4_mul(hw_mat4_translation(100, -50, 3), hw_mat4_rotation_z(0.7));
    hw_box b = {{-1, -2, -3}, {1, 2, 3}}, moved = hw_mat4_box(&m, b);
    for (int i = 0; i < 1000; i++) {
        hw_vec3 p = hw_mat4_point(&m, hw_v3(hw_rng_float(&rng) * 2 - 1, hw_rng_float(&rng) * 4 - 2,
                                            hw_rng_float(&rng) * 6 - 3));
        assert_true(p.x >= moved.min.x && p.y >= moved.min.y && p.z >= moved.min.z);
        assert_true(p.x <= moved.max.x && p.y <= moved.max.y && p.z <= moved.max.z);
    }
    double half = cos(0.7) + 2 * sin(0.7);
    assert_near((double)moved.max.x, 100 + half, 1e-4); // and no looser than needed
    assert_near((double)moved.min.x, 100 - half, 1e-4);
}

static void test_stretch_and_mirrors(void **state)
{
    (void)state;
    hw_mat4 turn = hw_mat4_mul(hw_mat4_rotation_z(0.7), hw_mat4_scale(3, 3, 3));
    assert_true(fabs(hw_mat4_stretch(&turn) - 3) < 1e-12);
    hw_mat4 uneven = hw_mat4_mul(hw_mat4_rotation_z(0.7), hw_mat4_scale(1, 5, 2));
    assert_true(fabs(hw_mat4_stretch(&uneven) - 5) < 1e-12);
    hw_mat4 shear = hw_mat4_mul(uneven, hw_mat4_rotation_z(1.1));
    double stretch = hw_mat4_stretch(&shear);
    assert_true(stretch >= 5 - 1e-9 && stretch < 8);
    assert_false(hw_mat4_mirrors(&turn));
    hw_mat4 mirror = hw_mat4_mul(turn, hw_mat4_scale(1, 1, -1));
    assert_true(hw_mat4_mirrors(&mirror));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_stretch_and_mirrors),
        cmocka_unit_test(vectors),
        cmocka_unit_test(boxes),
        cmocka_unit_test(products_apply_right_to_left),
        cmocka_unit_test(inverses),
        cmocka_unit_test(badly_scaled_inverses),
        cmocka_unit_test(singular_matrices_are_told),
        cmocka_unit_test(normals_follow_the_surface),
        cmocka_unit_test(boxes_hold_what_they_bound),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
