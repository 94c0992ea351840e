// Statues: orientation, repairs, errors; on small made-up files.
#include "file.h"
#include "statues.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static char folder[64];

static int make_folder(void **state)
{
    (void)state;
    snprintf(folder, sizeof folder, "/tmp/hexwalk-statues-XXXXXX");
    return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state)
{
    (void)state;
    char path[128];
    snprintf(path, sizeof path, "%s/idol.off", folder);
    unlink(path);
    return rmdir(folder);
}

// A box 2 wide (right), 4 deep (front) and 8 high, with a nose in the middle of its front face:
// its tip is 2 ahead, at 3/4 of the height and shifted to the right, so that no symmetry hides a
// mistake. Corner i of the box as hw_box_corner: bit 0 right, bit 1 front, bit 2 up.
static const float idol_points[9][3] = {{-1, -2, 0}, {1, -2, 0},  {-1, 2, 0},
                                        {1, 2, 0},   {-1, -2, 8}, {1, -2, 8},
                                        {-1, 2, 8},  {1, 2, 8},   {0.5f, 4, 6}};
static const uint32_t idol_triangles[14][3] = {
    {0, 3, 1}, {0, 2, 3}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4}, {1, 3, 7},
    {1, 7, 5}, {0, 4, 6}, {0, 6, 2}, {2, 8, 3}, {3, 8, 7}, {7, 8, 6}, {6, 8, 2}};
// Box 2 x 4 x 8 and a pyramid on a 2 x 8 base, 2 high.
#define IDOL_VOLUME (64.0 + 2.0 * 8.0 * 2.0 / 3.0)

// Writes the idol with its right, front and up along the given directions, moved aside, without the
// triangles of `skip` (a bit set), wound inside out if `inverted`.
static void write_idol(const hw_vec3 axes[3], uint32_t skip, bool inverted)
{
    char path[128], text[4096];
    int length = 0, count = 0;
    for (int t = 0; t < 14; t++)
        count += !(skip >> t & 1);
    snprintf(path, sizeof path, "%s/idol.off", folder);
    length += snprintf(text, sizeof text, "OFF\n9 %d 0\n", count);
    for (int i = 0; i < 9; i++) {
        hw_vec3 p = hw_v3(5, -7, 11);
        for (int k = 0; k < 3; k++)
            p = hw_v3_mad(p, axes[k], idol_points[i][k]);
        length += snprintf(text + length, sizeof text - (size_t)length, "%.9g %.9g %.9g\n",
                           (double)p.x, (double)p.y, (double)p.z);
    }
    for (int t = 0; t < 14; t++)
        if (!(skip >> t & 1))
            length += snprintf(text + length, sizeof text - (size_t)length, "3 %u %u %u\n",
                               idol_triangles[t][0], idol_triangles[t][inverted ? 2 : 1],
                               idol_triangles[t][inverted ? 1 : 2]);
    assert_int_equal(hw_file_write(path, text, (size_t)length), HW_OK);
}

static hw_statue idol(const hw_vec3 axes[3])
{
    return (hw_statue){
        "idol", "idol.off", {axes[2].x, axes[2].y, axes[2].z}, {axes[1].x, axes[1].y, axes[1].z}};
}

static const hw_vec3 plain[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};

// Number of edges whose two directions do not occur equally often.
static uint32_t open_edges(const hw_mesh *mesh)
{
    uint32_t open = 0;
    for (uint32_t i = 0; i < mesh->index_count; i++) {
        uint32_t a = mesh->indices[i], b = mesh->indices[i % 3 == 2 ? i - 2 : i + 1];
        int balance = 0;
        for (uint32_t j = 0; j < mesh->index_count; j++) {
            uint32_t c = mesh->indices[j], d = mesh->indices[j % 3 == 2 ? j - 2 : j + 1];
            balance += (a == c && b == d) - (a == d && b == c);
        }
        open += balance != 0;
    }
    return open;
}

static void assert_upright(const hw_mesh *mesh)
{
    hw_box box = hw_mesh_bounds(mesh);
    assert_float_equal(box.min.x, -1, 1e-4);
    assert_float_equal(box.max.x, 1, 1e-4);
    assert_float_equal(box.min.y, -3, 1e-4);
    assert_float_equal(box.max.y, 3, 1e-4);
    assert_float_equal(box.min.z, 0, 1e-4);
    assert_float_equal(box.max.z, 8, 1e-4);
    // The nose: at the front, high up, to the right.
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        if (mesh->positions[i].y > 2.5f) {
            assert_float_equal(mesh->positions[i].x, 0.5, 1e-4);
            assert_float_equal(mesh->positions[i].z, 6, 1e-4);
        }
}

static void any_axes_stand_upright(void **state)
{
    (void)state;
    // All 24 turns of the axes and one oblique one.
    for (int up = 0; up < 6; up++)
        for (int front = 0; front < 6; front++) {
            if (up / 2 == front / 2)
                continue;
            float a[2][3] = {{0}};
            a[0][up / 2] = up % 2 ? -1 : 1;
            a[1][front / 2] = front % 2 ? -1 : 1;
            hw_vec3 u = {a[0][0], a[0][1], a[0][2]}, f = {a[1][0], a[1][1], a[1][2]};
            const hw_vec3 axes[3] = {hw_v3_cross(f, u), f, u};
            hw_statue statue = idol(axes);
            hw_mesh mesh;
            write_idol(axes, 0, false);
            assert_int_equal(hw_statue_load(&statue, folder, &mesh), HW_OK);
            assert_upright(&mesh);
            assert_float_equal(hw_mesh_volume(&mesh), IDOL_VOLUME, 1e-3);
            hw_mesh_free(&mesh);
        }
}

static void front_need_not_be_orthogonal(void **state)
{
    (void)state;
    hw_mesh mesh;
    hw_statue statue = {"idol", "idol.off", {0, 0, 3}, {0, 2, 1.5f}};
    write_idol(plain, 0, false);
    assert_int_equal(hw_statue_load(&statue, folder, &mesh), HW_OK);
    assert_upright(&mesh);
    assert_string_equal(mesh.name, "idol");
    assert_non_null(mesh.normals);
    assert_null(mesh.colors);
    hw_mesh_free(&mesh);
}

static void inside_out_is_turned(void **state)
{
    (void)state;
    hw_mesh mesh;
    hw_statue statue = idol(plain);
    write_idol(plain, 0, true);
    assert_int_equal(hw_statue_load(&statue, folder, &mesh), HW_OK);
    assert_float_equal(hw_mesh_volume(&mesh), IDOL_VOLUME, 1e-3);
    for (uint32_t i = 0; i < mesh.vertex_count; i++) {
        hw_vec3 outward = hw_v3_sub(mesh.positions[i], hw_v3(0, -1, 4));
        assert_true(hw_v3_dot(outward, mesh.normals[i]) > 0);
    }
    hw_mesh_free(&mesh);
}

static void holes_are_closed(void **state)
{
    (void)state;
    // One triangle, a flat quad, two holes, two holes that share a corner, the whole nose.
    static const uint32_t skips[] = {1u << 12, 3u << 2, 3u << 2 | 3u, 1u << 2 | 1u << 8, 15u << 10};
    static const double volumes[] = {IDOL_VOLUME, IDOL_VOLUME, IDOL_VOLUME, IDOL_VOLUME, 64};
    for (size_t i = 0; i < sizeof skips / sizeof *skips; i++) {
        hw_mesh mesh;
        hw_statue statue = idol(plain);
        write_idol(plain, skips[i], i % 2);
        assert_int_equal(hw_statue_load(&statue, folder, &mesh), HW_OK);
        assert_int_equal(open_edges(&mesh), 0);
        assert_float_equal(hw_mesh_volume(&mesh), volumes[i], 1e-3);
        assert_int_equal(hw_mesh_validate(&mesh), HW_OK);
        hw_mesh_free(&mesh);
    }
}

static void make_mesh(hw_mesh *mesh, const uint32_t *indices, uint32_t count)
{
    *mesh = (hw_mesh){.vertex_count = 8, .index_count = count};
    assert_int_equal(HW_NEW(&mesh->positions, 8), HW_OK);
    assert_int_equal(HW_NEW(&mesh->indices, count), HW_OK);
    for (uint32_t i = 0; i < 8; i++)
        mesh->positions[i] = hw_v3(i & 1, i >> 1 & 1, (float)(i >> 2 & 1));
    memcpy(mesh->indices, indices, count * sizeof *indices);
}

static void closed_meshes_stay(void **state)
{
    (void)state;
    static const uint32_t tetrahedron[12] = {0, 2, 1, 0, 1, 4, 1, 2, 4, 2, 0, 4};
    hw_mesh mesh;
    make_mesh(&mesh, tetrahedron, 12);
    assert_int_equal(hw_statue_close_holes(&mesh), HW_OK);
    assert_int_equal(mesh.index_count, 12);
    assert_int_equal(mesh.vertex_count, 8);
    assert_int_equal(hw_statue_drop_flaps(&mesh), HW_OK);
    assert_int_equal(mesh.index_count, 12);
    assert_memory_equal(mesh.indices, tetrahedron, sizeof tetrahedron);
    hw_mesh_free(&mesh);
}

static void flaps_go(void **state)
{
    (void)state;
    // A tetrahedron with a flap (1, 2, 3) on one of its edges, written with any corner first.
    static const uint32_t flapped[18] = {0, 2, 1, 3, 1, 2, 0, 1, 4, 1, 2, 4, 2, 1, 3, 2, 0, 4};
    static const uint32_t plain_one[12] = {0, 2, 1, 0, 1, 4, 1, 2, 4, 2, 0, 4};
    hw_mesh mesh;
    make_mesh(&mesh, flapped, 18);
    assert_int_equal(hw_statue_drop_flaps(&mesh), HW_OK);
    assert_int_equal(mesh.index_count, 12);
    assert_memory_equal(mesh.indices, plain_one, sizeof plain_one);
    hw_mesh_free(&mesh);
    // The same triangle twice the same way round is no flap.
    static const uint32_t doubled[6] = {0, 1, 2, 1, 2, 0};
    make_mesh(&mesh, doubled, 6);
    assert_int_equal(hw_statue_drop_flaps(&mesh), HW_OK);
    assert_int_equal(mesh.index_count, 6);
    hw_mesh_free(&mesh);
}

static void missing_files_name_the_cure(void **state)
{
    (void)state;
    hw_mesh mesh;
    const hw_statue *dragon = hw_statue_find("dragon"), *cow = hw_statue_find("cow");
    assert_non_null(dragon);
    assert_non_null(cow);
    assert_false(hw_statue_available(dragon, folder));
    assert_int_equal(hw_statue_load(dragon, folder, &mesh), HW_NOT_FOUND);
    assert_non_null(strstr(hw_error_text(), dragon->file));
    assert_non_null(strstr(hw_error_text(), "fetch-statues"));
    assert_non_null(strstr(hw_error_text(), "--dragon"));
    assert_null(mesh.positions);
    assert_int_equal(hw_statue_load(cow, folder, &mesh), HW_NOT_FOUND);
    assert_null(strstr(hw_error_text(), "--dragon"));
}

static void bad_files_are_errors(void **state)
{
    (void)state;
    static const char *const texts[] = {"", "OFF\n", "OFF\n3 1 0\n0 0 0\n1 0 0\n",
                                        "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n",
                                        "OFF\n3 1 0\n0 0 0\n1 0 0\n0 nan 0\n3 0 1 2\n",
                                        "OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n",
                                        // One triangle, both ways round or alone: a flap.
                                        "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 2 1\n",
                                        "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"};
    char path[128];
    hw_statue statue = idol(plain);
    snprintf(path, sizeof path, "%s/idol.off", folder);
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        hw_mesh mesh;
        assert_int_equal(hw_file_write(path, texts[i], strlen(texts[i])), HW_OK);
        assert_int_not_equal(hw_statue_load(&statue, folder, &mesh), HW_OK);
        assert_non_null(strstr(hw_error_text(), "idol.off"));
        assert_null(mesh.positions);
    }
}

static void table_is_sound(void **state)
{
    (void)state;
    uint32_t count;
    const hw_statue *table = hw_statue_table(&count);
    assert_true(count >= 16);
    for (uint32_t i = 0; i < count; i++) {
        hw_vec3 up = {table[i].up[0], table[i].up[1], table[i].up[2]};
        hw_vec3 front = {table[i].front[0], table[i].front[1], table[i].front[2]};
        assert_true(hw_v3_length(hw_v3_cross(front, up)) > 0.5f);
        assert_null(strchr(table[i].file, '/'));
        assert_ptr_equal(hw_statue_find(table[i].name), &table[i]);
    }
    assert_null(hw_statue_find("gnome"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_axes_stand_upright),
        cmocka_unit_test(front_need_not_be_orthogonal),
        cmocka_unit_test(inside_out_is_turned),
        cmocka_unit_test(holes_are_closed),
        cmocka_unit_test(closed_meshes_stay),
        cmocka_unit_test(flaps_go),
        cmocka_unit_test(missing_files_name_the_cure),
        cmocka_unit_test(bad_files_are_errors),
        cmocka_unit_test(table_is_sound),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
