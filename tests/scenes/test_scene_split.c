// Oversized meshes in pieces.
#include "scene_split.h"
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#define SIDE 120u // quads of a terrain, each of 5 x 5 units

static hw_mesh terrain(bool with_all)
{
    uint32_t row = SIDE + 1;
    hw_mesh m = {.vertex_count = row * row};
    assert_int_equal(hw_strdup(&m.name, "terrain"), HW_OK);
    assert_int_equal(HW_NEW(&m.positions, m.vertex_count), HW_OK);
    assert_int_equal(HW_NEW(&m.indices, 6 * SIDE * SIDE), HW_OK);
    if (with_all) {
        assert_int_equal(HW_NEW(&m.normals, m.vertex_count), HW_OK);
        assert_int_equal(HW_NEW(&m.colors, m.vertex_count), HW_OK);
        assert_int_equal(HW_NEW(&m.uvs, m.vertex_count), HW_OK);
    }
    for (uint32_t v = 0; v < m.vertex_count; v++) {
        m.positions[v] = hw_v3(5.0f * (float)(v % row), 5.0f * (float)(v / row), (float)(v % 7));
        if (!with_all)
            continue;
        m.normals[v] = hw_v3_normalize(hw_v3((float)(v % 5), (float)(v % 3), 9));
        m.colors[v] = (hw_color8){(uint8_t)v, (uint8_t)(v >> 8), 7, 255};
        m.uvs[v] = (hw_uv){(float)v, -(float)v};
    }
    for (uint32_t q = 0; q < SIDE * SIDE; q++) {
        uint32_t a = q / SIDE * row + q % SIDE;
        const uint32_t t[6] = {a, a + 1, a + row + 1, a, a + row + 1, a + row};
        memcpy(m.indices + m.index_count, t, sizeof t);
        m.index_count += 6;
    }
    return m;
}

static hw_mesh speck(void)
{
    hw_mesh m = {.vertex_count = 3, .index_count = 3};
    assert_int_equal(HW_NEW(&m.positions, 3), HW_OK);
    assert_int_equal(HW_NEW(&m.indices, 3), HW_OK);
    m.positions[1].x = m.positions[2].y = 900;
    m.indices[1] = 1;
    m.indices[2] = 2;
    return m;
}

// A speck of three vertices, wide but simple, before and behind two terrains, the second twice as
// large as the first.
static hw_scene make_scene(bool with_all)
{
    hw_scene s = {.mesh_count = 2, .material_count = 1, .object_count = 4};
    assert_int_equal(HW_NEW(&s.meshes, 2), HW_OK);
    assert_int_equal(HW_NEW(&s.materials, 1), HW_OK);
    assert_int_equal(HW_NEW(&s.objects, 4), HW_OK);
    s.meshes[0] = speck();
    s.meshes[1] = terrain(with_all);
    for (uint32_t i = 0; i < 4; i++)
        s.objects[i] = (hw_object){.mesh_idx = i % 3 > 0, .transform = hw_mat4_identity()};
    s.objects[2].transform.m[0] = s.objects[2].transform.m[5] = s.objects[2].transform.m[10] = 2;
    s.objects[2].transform.m[12] = 1000;
    hw_scene_update_bounds(&s);
    return s;
}

// The quad's number and which half of it, from the positions of a triangle of the terrain.
static uint32_t number_of(const hw_mesh *m, uint32_t triangle)
{
    const uint32_t *t = m->indices + 3 * (size_t)triangle;
    hw_vec3 a = m->positions[t[0]], b = m->positions[t[1]];
    uint32_t q = (uint32_t)(a.y / 5) * SIDE + (uint32_t)(a.x / 5);
    return 2 * q + (b.y > a.y);
}

// Which pieces hold each triangle of the terrain, as bits.
static uint64_t *find_holders(const hw_scene *s, uint32_t first, uint32_t end)
{
    uint64_t *holders;
    assert_true(end - first <= 64);
    assert_int_equal(HW_NEW(&holders, 2 * SIDE * SIDE), HW_OK);
    for (uint32_t m = first; m < end; m++)
        for (uint32_t t = 0; t < s->meshes[m].index_count / 3; t++) {
            uint64_t *h = &holders[number_of(&s->meshes[m], t)];
            assert_false(*h >> (m - first) & 1); // each once
            *h |= UINT64_C(1) << (m - first);
        }
    return holders;
}

// Pieces are small, hold every triangle, and both sides of each edge together somewhere: two
// pieces that are simplified apart still overlap.
static void test_pieces_cover(void **state)
{
    (void)state;
    hw_scene s = make_scene(false);
    uint32_t cut;
    assert_int_equal(hw_scene_split(&s, 100, &cut), HW_OK);
    assert_int_equal(cut, 1);
    assert_int_equal(hw_scene_validate(&s), HW_OK);
    uint32_t pieces = s.mesh_count - 1;
    assert_true(pieces >= 16 && pieces <= 64);
    // The larger instance's are not wider than 100 units and two triangles on either side, or are
    // simple.
    uint32_t small = 0;
    for (uint32_t i = 0; i < s.object_count; i++) {
        hw_box b = s.objects[i].bounds;
        float wide = fmaxf(b.max.x - b.min.x, b.max.y - b.min.y);
        if (s.objects[i].mesh_idx == 0)
            continue;
        small += wide <= 180;
        assert_true(wide <= 180 || s.meshes[s.objects[i].mesh_idx].index_count / 3 <= 700);
    }
    assert_true(small > 0);
    uint64_t *holders = find_holders(&s, 1, s.mesh_count);
    uint64_t held = 0;
    for (uint32_t q = 0; q < SIDE * SIDE; q++) {
        uint64_t low = holders[2 * q], high = holders[2 * q + 1];
        assert_true(low && high && (low & high)); // they share the diagonal
        if (q % SIDE + 1 < SIDE)                  // the quad to the right
            assert_true(low & holders[2 * q + 3]);
        if (q / SIDE + 1 < SIDE) // the one above
            assert_true(high & holders[2 * (q + SIDE)]);
        held += (uint64_t)__builtin_popcountll(low) + (uint64_t)__builtin_popcountll(high);
    }
    assert_true(held > 2 * SIDE * SIDE && held < 4 * SIDE * SIDE);
    hw_free(holders);
    hw_scene_free(&s);
}

// Objects keep their order, transforms and materials; what is not cut stays what it was.
static void test_objects(void **state)
{
    (void)state;
    hw_scene s = make_scene(false);
    const hw_vec3 *speck_positions = s.meshes[0].positions;
    hw_box first = s.objects[1].bounds, second = s.objects[2].bounds;
    uint32_t cut;
    assert_int_equal(hw_scene_split(&s, 100, &cut), HW_OK);
    uint32_t pieces = s.mesh_count - 1;
    assert_int_equal(s.object_count, 2 + 2 * pieces);
    assert_ptr_equal(s.meshes[0].positions, speck_positions);
    assert_int_equal(s.objects[0].mesh_idx, 0);
    assert_int_equal(s.objects[s.object_count - 1].mesh_idx, 0);
    hw_box a = hw_box_empty(), b = hw_box_empty();
    for (uint32_t i = 0; i < pieces; i++) {
        assert_int_equal(s.objects[1 + i].mesh_idx, 1 + i);
        assert_int_equal(s.objects[1 + pieces + i].mesh_idx, 1 + i);
        assert_true(s.objects[1 + pieces + i].transform.m[12] == 1000);
        a = hw_box_union(a, s.objects[1 + i].bounds);
        b = hw_box_union(b, s.objects[1 + pieces + i].bounds);
    }
    assert_memory_equal(&a, &first, sizeof a);
    assert_memory_equal(&b, &second, sizeof b);
    hw_scene_free(&s);
}

static void test_attributes(void **state)
{
    (void)state;
    hw_scene s = make_scene(true);
    hw_mesh whole = terrain(true);
    uint32_t cut;
    assert_int_equal(hw_scene_split(&s, 100, &cut), HW_OK);
    for (uint32_t m = 1; m < s.mesh_count; m++) {
        const hw_mesh *piece = &s.meshes[m];
        for (uint32_t i = 0; i < piece->vertex_count; i++) {
            hw_vec3 p = piece->positions[i];
            uint32_t v = (uint32_t)(p.y / 5) * (SIDE + 1) + (uint32_t)(p.x / 5);
            assert_memory_equal(&p, &whole.positions[v], sizeof p);
            assert_memory_equal(&piece->normals[i], &whole.normals[v], sizeof(hw_vec3));
            assert_memory_equal(&piece->colors[i], &whole.colors[v], sizeof(hw_color8));
            assert_memory_equal(&piece->uvs[i], &whole.uvs[v], sizeof(hw_uv));
        }
    }
    hw_mesh_free(&whole);
    hw_scene_free(&s);
}

static void test_nothing_to_cut(void **state)
{
    (void)state;
    hw_scene s = make_scene(false);
    uint64_t hash = hw_scene_hash(&s);
    uint32_t cut = 9;
    assert_int_equal(hw_scene_split(&s, 400, &cut), HW_OK);
    assert_int_equal(cut, 0);
    assert_true(hw_scene_hash(&s) == hash);
    hw_scene_free(&s);
}

// One triangle as wide as all, among many small ones, is in one piece only; and triangles that all
// lie at one place end.
static void test_odd_triangles(void **state)
{
    (void)state;
    hw_scene s = make_scene(false);
    hw_mesh *m = &s.meshes[1];
    m->indices[0] = 0;
    m->indices[1] = SIDE;
    m->indices[2] = SIDE * (SIDE + 1);
    uint32_t cut, wide = 0;
    assert_int_equal(hw_scene_split(&s, 100, &cut), HW_OK);
    for (uint32_t k = 1; k < s.mesh_count; k++) {
        hw_box b = hw_mesh_bounds(&s.meshes[k]);
        wide += b.max.x - b.min.x > 500;
    }
    assert_int_equal(wide, 1);
    hw_scene_free(&s);
    s = make_scene(false);
    m = &s.meshes[1];
    for (uint32_t i = 3; i < m->index_count; i++)
        m->indices[i] = m->indices[i % 3];
    m->indices[2] = SIDE * (SIDE + 1) + SIDE;
    assert_int_equal(hw_scene_split(&s, 100, &cut), HW_OK);
    assert_true(s.mesh_count <= 3);
    hw_scene_free(&s);
}

static void test_no_memory(void **state)
{
    (void)state;
    hw_scene s = make_scene(true);
    uint64_t hash = hw_scene_hash(&s);
    uint32_t cut;
    hw_status status = HW_MEMORY;
    for (uint64_t n = 1; status == HW_MEMORY; n += 1 + n / 8) {
        hw_alloc_fail_after(n);
        status = hw_scene_split(&s, 100, &cut);
        hw_alloc_fail_after(0);
        if (status != HW_OK)
            assert_true(hw_scene_hash(&s) == hash);
    }
    assert_int_equal(status, HW_OK);
    assert_true(hw_scene_hash(&s) != hash);
    hw_scene_free(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pieces_cover),  cmocka_unit_test(test_objects),
        cmocka_unit_test(test_attributes),    cmocka_unit_test(test_nothing_to_cut),
        cmocka_unit_test(test_odd_triangles), cmocka_unit_test(test_no_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
