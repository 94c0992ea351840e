// Chains of levels: errors of shading, where a surface carries some that its shape does not tell.
#include "build_cell.h"
#include "shapes.h"

#define SIDE  24u // quads along a side
#define LEVEL 20u // where the band shows

// A box of many quads a side, white, or with a dark band round its middle that no edge lies along.
static hw_mesh make_box(float size, bool band)
{
    const hw_vec3 x = {size, 0, 0}, y = {0, size, 0}, z = {0, 0, size};
    hw_mesh mesh = shape_plane(hw_v3(0, 0, 0), y, x, SIDE, SIDE);
    hw_mesh sides[] = {
        shape_plane(z, x, y, SIDE, SIDE), shape_plane(hw_v3(0, 0, 0), x, z, SIDE, SIDE),
        shape_plane(y, z, x, SIDE, SIDE), shape_plane(hw_v3(0, 0, 0), z, y, SIDE, SIDE),
        shape_plane(x, y, z, SIDE, SIDE)};
    for (int i = 0; i < 5; i++)
        shape_append(&mesh, &sides[i]);
    assert_int_equal(HW_NEW(&mesh.colors, mesh.vertex_count), HW_OK);
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        bool dark = band && fabsf(mesh.positions[v].z / size - 0.5f) < 0.1f;
        memset(&mesh.colors[v], dark ? 50 : 250, sizeof *mesh.colors);
    }
    return mesh;
}

static hw_chain make_chain(float size, bool band, uint32_t shade_step)
{
    const hw_chain_options options = {.pull_back = -1, .shade_step = shade_step};
    hw_mesh mesh = make_box(size, band);
    hw_chain chain;
    assert_int_equal(hw_chain_make(&mesh, &options, &chain), HW_OK);
    assert_true(chain.level_count > LEVEL);
    hw_mesh_free(&mesh);
    return chain;
}

// Collapses see the shape alone, so the surface is the same with and without the band; a picture is
// not.
static void a_band_is_an_error_of_shading(void **state)
{
    (void)state;
    hw_chain white = make_chain(1, false, 2), band = make_chain(1, true, 2);
    assert_int_equal(white.level_count, band.level_count);
    for (uint32_t l = 2; l < band.level_count; l++) {
        const hw_mesh_level_info *plain = &white.infos[l], *dark = &band.infos[l];
        assert_true(dark->error_p99 == plain->error_p99);
        // Edges, which levels share vertices over, are an error of shading too.
        assert_true(plain->error_shading > 0 && dark->error_shading > plain->error_shading);
        // A quarter of the surface over the outline is 0.375 of the side or less; nothing is off by
        // more than all of the light.
        assert_true(dark->error_shading < 0.375f);
        assert_true(dark->error_shading >= dark[-1].error_shading);
        assert_true(l % 2 == 0 || dark->error_shading == dark[-1].error_shading);
    }
    assert_true(band.infos[LEVEL].error_shading > 2 * white.infos[LEVEL].error_shading);
    // So it is drawn more finely.
    double bound = 1.001 * (double)hw_mesh_level_error(&white.infos[LEVEL]);
    assert_in_range(hw_near_level(&white, 1, bound, 1, 1), LEVEL / 2, LEVEL);
    assert_in_range(hw_near_level(&band, 1, bound, 1, 1), 1, LEVEL / 2 - 1);
    hw_chain_free(&white);
    hw_chain_free(&band);
}

static void it_is_a_length(void **state)
{
    (void)state;
    hw_chain one = make_chain(1, true, 2), eight = make_chain(8, true, 2);
    assert_int_equal(one.level_count, eight.level_count);
    for (uint32_t l = 0; l < one.level_count; l++)
        assert_float_equal(eight.infos[l].error_shading, 8 * one.infos[l].error_shading,
                           0.02f * eight.infos[l].error_shading);
    hw_chain_free(&one);
    hw_chain_free(&eight);
}

static void levels_that_are_not_drawn_have_none(void **state)
{
    (void)state;
    hw_chain chain = make_chain(1, true, 0);
    for (uint32_t l = 0; l < chain.level_count; l++)
        assert_true(chain.infos[l].error_shading == 0);
    hw_chain_free(&chain);
}

// A round sheet that lies flat, with a dark band: from aside it has no outline, but levels are off
// all the same.
static void a_flat_sheet_has_errors(void **state)
{
    (void)state;
    const hw_chain_options options = {.pull_back = -1, .shade_step = 2};
    hw_mesh mesh = shape_plane(hw_v3(-1, -1, 5), hw_v3(2, 0, 0), hw_v3(0, 2, 0), 40, 40);
    hw_chain chain;
    hw_free(mesh.uvs);
    mesh.uvs = NULL;
    assert_int_equal(HW_NEW(&mesh.colors, mesh.vertex_count), HW_OK);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        memset(&mesh.colors[v], fabsf(mesh.positions[v].x) < 0.2f ? 50 : 250, sizeof *mesh.colors);
    uint32_t kept = 0;
    for (uint32_t i = 0; i < mesh.index_count; i += 3) {
        hw_vec3 p = mesh.positions[mesh.indices[i]];
        if (hypotf(p.x, p.y) > 0.9f)
            continue;
        memmove(mesh.indices + kept, mesh.indices + i, 3 * sizeof *mesh.indices);
        kept += 3;
    }
    mesh.index_count = kept;
    assert_int_equal(hw_chain_make(&mesh, &options, &chain), HW_OK);
    const hw_mesh_level_info *last = &chain.infos[chain.level_count - 1];
    assert_true(chain.level_count > 4);
    assert_true(last->error_silhouette > 0.001f && last->error_silhouette < 1);
    assert_true(last->error_shading > 0.001f && last->error_shading < 1);
    assert_int_equal(hw_chain_level_by_silhouette(&chain, 0), 0);
    hw_chain_free(&chain);
    hw_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_band_is_an_error_of_shading),
        cmocka_unit_test(it_is_a_length),
        cmocka_unit_test(levels_that_are_not_drawn_have_none),
        cmocka_unit_test(a_flat_sheet_has_errors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
