// clang-format off
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h>
// clang-format on
#include "cell_chunks.h"
#include "checks.h"

#define PATH "cell.hxc"

static void write_sample(const char *path)
{
    hw_cell cell;
    fixture_cell(&cell, 3, 4, 4);
    must(hw_cell_write(&cell, path));
    hw_cell_free(&cell);
}

static hw_status read_cell(const char *path)
{
    hw_cell cell;
    hw_status status = hw_cell_read(path, &cell);
    const hw_cell zero = {0};
    if (status != HW_OK)
        assert_memory_equal(&cell, &zero, sizeof cell);
    hw_cell_free(&cell);
    return status;
}

static hw_status write_and_read(const char *path)
{
    hw_cell cell;
    HW_TRY(hw_cell_read(path, &cell));
    hw_status status = hw_cell_write(&cell, "cell-2.hxc");
    hw_cell_free(&cell);
    return status;
}

// The same triangles in the same order; each may be rotated.
static void assert_same_triangles(const uint32_t *a, const uint32_t *b, uint32_t count)
{
    for (uint32_t i = 0; i < count; i += 3) {
        bool found = false;
        for (uint32_t k = 0; k < 3; k++)
            found = found || (a[i] == b[i + k] && a[i + 1] == b[i + (k + 1) % 3] &&
                              a[i + 2] == b[i + (k + 2) % 3]);
        assert_true(found);
    }
}

static void assert_same_cell(const hw_cell *a, const hw_cell *b)
{
    assert_memory_equal(&a->id, &b->id, sizeof a->id);
    assert_memory_equal(&a->centre, &b->centre, sizeof a->centre);
    assert_true(a->key == b->key);
    assert_int_equal(a->near_count, b->near_count);
    assert_int_equal(a->far_count, b->far_count);
    assert_int_equal(a->vertex_count, b->vertex_count);
    assert_int_equal(a->index_count, b->index_count);
    assert_int_equal(a->view_count, b->view_count);
    assert_int_equal(a->range_count, b->range_count);
    assert_int_equal(a->color_count, b->color_count);
    assert_int_equal(a->atlas_width, b->atlas_width);
    assert_int_equal(a->atlas_height, b->atlas_height);
    if (a->near_count)
        assert_memory_equal(a->near, b->near, a->near_count * sizeof *a->near);
    if (a->far_count == 0)
        return;
    assert_memory_equal(a->far, b->far, a->far_count * sizeof *a->far);
    assert_memory_equal(a->vertices, b->vertices, a->vertex_count * sizeof *a->vertices);
    assert_memory_equal(a->views, b->views, a->view_count * sizeof *a->views);
    assert_memory_equal(a->ranges, b->ranges, a->range_count * sizeof *a->ranges);
    assert_memory_equal(a->colors, b->colors, a->color_count * sizeof *a->colors);
    assert_same_triangles(a->indices, b->indices, a->index_count);
    assert_memory_equal(a->atlas_bc1, b->atlas_bc1, (size_t)a->atlas_width * a->atlas_height / 2);
    assert_memory_equal(a->coverage_bc4, b->coverage_bc4,
                        (size_t)a->atlas_width * a->atlas_height / 2);
}

static void test_round_trip(void **state)
{
    (void)state;
    const uint32_t shapes[][3] = {{0, 0, 2}, {5, 0, 2}, {0, 1, 2}, {3, 4, 4}, {10, 300, 9}};
    for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++) {
        hw_cell cell, from_file, from_memory;
        size_t size = 0;
        fixture_cell(&cell, shapes[i][0], shapes[i][1], shapes[i][2]);
        must(hw_cell_write(&cell, PATH));
        must(hw_cell_read(PATH, &from_file));
        uint8_t *bytes = read_bytes(PATH, &size);
        must(hw_cell_decode("memory", bytes, size, &from_memory));
        assert_same_cell(&cell, &from_file);
        assert_same_cell(&cell, &from_memory);
        hw_free(bytes);
        hw_cell_free(&cell);
        hw_cell_free(&from_file);
        hw_cell_free(&from_memory);
    }
    hw_cell_free(NULL);
}

// Low bits that are zero in all vertices of a record are not stored, and come back.
static void test_rounded_vertices(void **state)
{
    (void)state;
    size_t sizes[2];
    for (int rounded = 0; rounded < 2; rounded++) {
        hw_cell cell, back;
        hw_rng rng = hw_rng_make(4, 4);
        fixture_cell(&cell, 1, 30, 16);
        for (uint32_t i = 0; i < cell.vertex_count; i++) {
            hw_far_vertex *v = &cell.vertices[i];
            v->x = (uint16_t)hw_rng_u32(&rng);
            v->y = (uint16_t)hw_rng_u32(&rng);
            v->z = (uint16_t)hw_rng_u32(&rng);
            // Another precision in each record; all zeros in one of them.
            v->x &= (uint16_t)(rounded ? 0xffffu << (5 + v->record % 7) : 0xffffu);
            v->y &= (uint16_t)(rounded ? 0xffffu << (3 + v->record % 7) : 0xffffu);
            v->z &= (uint16_t)(rounded ? v->record == 9 ? 0 : 0xfff0u : 0xffffu);
        }
        must(hw_cell_write(&cell, PATH));
        must(hw_cell_read(PATH, &back));
        assert_same_cell(&cell, &back);
        hw_free(read_bytes(PATH, &sizes[rounded]));
        hw_cell_free(&cell);
        hw_cell_free(&back);
    }
    assert_true(sizes[1] < sizes[0] * 7 / 8);
}

// The same bytes every time, also from a cell that was read back: rotating triangles once settles
// them.
static void test_same_bytes(void **state)
{
    (void)state;
    uint8_t *bytes[3];
    size_t sizes[3] = {0};
    write_sample("cell-0.hxc");
    write_sample("cell-1.hxc");
    must(write_and_read("cell-1.hxc"));
    const char *const paths[3] = {"cell-0.hxc", "cell-1.hxc", "cell-2.hxc"};
    for (int i = 0; i < 3; i++) {
        bytes[i] = read_bytes(paths[i], &sizes[i]);
        assert_int_equal(sizes[i], sizes[0]);
        assert_memory_equal(bytes[i], bytes[0], sizes[0]);
    }
    for (int i = 0; i < 3; i++)
        hw_free(bytes[i]);
}

static void test_damage(void **state)
{
    (void)state;
    write_sample(PATH);
    check_damage(PATH, read_cell);
}

static void test_torture(void **state)
{
    (void)state;
    write_sample(PATH);
    assert_true(check_torture(PATH, read_cell) > 15);
    assert_true(check_torture(PATH, write_and_read) > 30);
}

static void test_is_current(void **state)
{
    (void)state;
    hw_cell cell;
    size_t size = 0;
    fixture_cell(&cell, 3, 4, 4);
    must(hw_cell_write(&cell, PATH));
    assert_true(hw_cell_is_current(PATH, cell.key));
    assert_false(hw_cell_is_current(PATH, cell.key + 1));
    assert_false(hw_cell_is_current("no-such-cell.hxc", cell.key));
    uint8_t *bytes = read_bytes(PATH, &size);
    write_bytes(PATH, bytes, size - 1);
    assert_false(hw_cell_is_current(PATH, cell.key));
    bytes[size - 20] ^= 1;
    write_bytes(PATH, bytes, size);
    assert_false(hw_cell_is_current(PATH, cell.key));
    hw_free(bytes);
    hw_cell_free(&cell);
}

static void test_path(void **state)
{
    (void)state;
    char *path = NULL;
    must(hw_cell_path(&path, "/data/set", (hw_cell_id){1, 12, -3}));
    assert_string_equal(path, "/data/set/cells/1/12_-3.hxc");
    hw_free(path);
    char name[HW_FILE_NAME_BYTES];
    hw_cell_name(name, (hw_cell_id){INT32_MIN, INT32_MIN, INT32_MIN});
    assert_string_equal(name, "cells/-2147483648/-2147483648_-2147483648.hxc");
}

// One broken invariant each. `writes` tells the value that is broken.
typedef void (*break_fn)(hw_cell *cell);
static void nan_centre(hw_cell *c)
{
    c->centre.y = NAN;
}
static void negative_level(hw_cell *c)
{
    c->id.level = -1;
}
static void near_level(hw_cell *c)
{
    c->near[1].level = HW_MESH_LEVELS_MAX;
}
static void near_in_group(hw_cell *c)
{
    c->id.level = 1;
}
static void near_twice(hw_cell *c)
{
    c->near[1].object_idx = c->near[0].object_idx;
}
static void face_six(hw_cell *c)
{
    c->far[2].face = 6;
}
static void nan_range(hw_cell *c)
{
    c->far[0].x_max = NAN;
}
static void empty_range(hw_cell *c)
{
    c->far[0].y_max = c->far[0].y_min;
}
static void zero_iz(hw_cell *c)
{
    c->far[3].iz_min = 0;
}
static void infinite_iz(hw_cell *c)
{
    c->far[3].iz_max = INFINITY;
}
static void reversed_bounds(hw_cell *c)
{
    c->far[1].bounds.min.z = 31;
}
static void infinite_bounds(hw_cell *c)
{
    c->far[1].bounds.max.x = INFINITY;
}
static void wide_rect(hw_cell *c)
{
    c->far[3].rect.width = c->atlas_width - c->far[3].rect.x + 1;
}
static void wrapping_rect(hw_cell *c)
{
    c->far[3].rect.y = UINT32_MAX;
}
static void empty_rect(hw_cell *c)
{
    c->far[0].rect.height = 0;
}
static void gap_in_vertices(hw_cell *c)
{
    c->far[1].first_vertex++;
    c->far[1].vertex_count--;
}
static void wrapping_count(hw_cell *c)
{
    c->far[1].vertex_count = UINT32_MAX - 3;
}
static void lost_vertices(hw_cell *c)
{
    c->far[3].vertex_count--;
}
static void half_triangle(hw_cell *c)
{
    c->far[0].index_count--;
    c->far[1].first_index--;
    c->far[1].index_count++;
}
static void wrong_owner(hw_cell *c)
{
    c->vertices[20].record = 0;
}
static void foreign_index(hw_cell *c)
{
    c->indices[c->far[1].first_index] = 0;
}
static void wild_index(hw_cell *c)
{
    c->indices[5] = c->vertex_count;
}
static void odd_atlas(hw_cell *c)
{
    c->atlas_width += 2;
}
static void no_atlas(hw_cell *c)
{
    c->atlas_width = c->atlas_height = 0;
}
static void huge_atlas(hw_cell *c)
{
    c->atlas_height = HW_CELL_ATLAS_MAX + 4;
}
static void huge_count(hw_cell *c)
{
    c->near_count = HW_CELL_NEAR_MAX + 1;
}

static void view_from_nowhere(hw_cell *c)
{
    c->views[1].eye.x = INFINITY;
}
static void view_face(hw_cell *c)
{
    c->views[2].face = 6;
}
static void view_of_nothing(hw_cell *c)
{
    c->views[3].y_max = c->views[3].y_min;
}
static void view_outside(hw_cell *c)
{
    c->views[0].rect.y = c->atlas_height;
}
static void gap_in_views(hw_cell *c)
{
    c->far[2].first_view++;
    c->far[2].view_count--;
}
static void views_without_ranges(hw_cell *c)
{
    c->far[3].range_count = 0;
    c->range_count -= 2;
}
static void many_views(hw_cell *c)
{
    c->far[3].view_count = HW_FAR_VIEWS_MAX;
}
static void wrapping_ranges(hw_cell *c)
{
    c->far[2].range_count = UINT32_MAX;
}
static void lost_ranges(hw_cell *c)
{
    c->range_count++;
}
static void unknown_view(hw_cell *c)
{
    c->ranges[0].views = 8;
}
static void cut_out_multi_view(hw_cell *c)
{
    c->far[0].cut_out = true;
}
static void short_ranges(hw_cell *c)
{
    c->ranges[1].index_count = 0;
}
static void range_of_two_thirds(hw_cell *c)
{
    c->ranges[0].index_count--;
    c->ranges[1].index_count++;
}
static void missing_colors(hw_cell *c)
{
    c->color_count--;
}
static void more_colors_than_vertices(hw_cell *c)
{
    c->color_count = c->vertex_count + 1;
}

static void test_validation(void **state)
{
    (void)state;
    const break_fn breakers[] = {nan_centre,
                                 negative_level,
                                 near_level,
                                 near_twice,
                                 near_in_group,
                                 face_six,
                                 nan_range,
                                 empty_range,
                                 zero_iz,
                                 infinite_iz,
                                 wide_rect,
                                 reversed_bounds,
                                 wrapping_rect,
                                 infinite_bounds,
                                 empty_rect,
                                 lost_vertices,
                                 gap_in_vertices,
                                 half_triangle,
                                 wrong_owner,
                                 wrapping_count,
                                 foreign_index,
                                 wild_index,
                                 odd_atlas,
                                 no_atlas,
                                 huge_atlas,
                                 huge_count,
                                 view_face,
                                 view_outside,
                                 view_of_nothing,
                                 gap_in_views,
                                 many_views,
                                 lost_ranges,
                                 wrapping_ranges,
                                 unknown_view,
                                 short_ranges,
                                 missing_colors,
                                 range_of_two_thirds,
                                 cut_out_multi_view,
                                 view_from_nowhere,
                                 views_without_ranges,
                                 more_colors_than_vertices};
    for (size_t i = 0; i < sizeof breakers / sizeof *breakers; i++) {
        hw_cell cell;
        fixture_cell(&cell, 3, 4, 4);
        assert_int_equal(hw_cell_validate(&cell, "cell"), HW_OK);
        breakers[i](&cell);
        assert_int_equal(hw_cell_validate(&cell, "the cell"), HW_FORMAT);
        assert_non_null(strstr(hw_error_text(), "the cell: "));
        assert_int_equal(hw_cell_write(&cell, "broken.hxc"), HW_FORMAT);
        assert_false(hw_path_exists("broken.hxc"));
        hw_cell_free(&cell);
    }
    // An atlas but nothing to show in it.
    hw_cell cell;
    fixture_cell(&cell, 1, 0, 2);
    cell.atlas_width = 4;
    assert_int_equal(hw_cell_validate(&cell, "cell"), HW_FORMAT);
    hw_cell_free(&cell);
}

// The reader finds the same, past the checksums: every 32-bit word of the small chunks becomes each
// of some hostile values. Most give an error; what is accepted must be valid.
static void test_hostile_words(void **state)
{
    (void)state;
    const uint32_t values[] = {0,          1,          3,          6,          0xffff,
                               0x10000,    0x7fffffff, 0x80000000, 0xffffffff, 0x7fc00000,
                               0x7f800000, 0x04000000, 0x10000000, 0x00002000};
    hw_cell cell;
    hw_cell_chunks chunks = {0};
    uint32_t refused = 0, tried = 0;
    fixture_cell(&cell, 3, 4, 4);
    must(hw_cell_to_chunks(&cell, &chunks));
    hw_cell_free(&cell);
    for (int k = 0; k < HW_CELL_CHUNK_ATLS; k++) {
        for (size_t at = 0; at + 4 <= chunks.size[k]; at += k < HW_CELL_CHUNK_VERT ? 4 : 1) {
            for (size_t v = 0; v < sizeof values / sizeof *values; v++) {
                uint8_t saved[4];
                memcpy(saved, chunks.data[k] + at, 4);
                memcpy(chunks.data[k] + at, &values[v], 4);
                hw_status status = hw_cell_from_chunks("hostile", 1, &chunks, &cell);
                if (status == HW_OK)
                    assert_int_equal(hw_cell_validate(&cell, "accepted"), HW_OK);
                else
                    assert_non_null(strstr(hw_error_text(), "hostile: "));
                refused += status != HW_OK;
                tried++;
                hw_cell_free(&cell);
                memcpy(chunks.data[k] + at, saved, 4);
            }
        }
    }
    assert_true(refused > tried / 4);
    hw_cell_chunks_free(&chunks);
}

static void test_unknown_flags(void **state)
{
    (void)state;
    hw_cell cell;
    hw_cell_chunks chunks = {0};
    fixture_cell(&cell, 3, 4, 4);
    must(hw_cell_to_chunks(&cell, &chunks));
    hw_cell_free(&cell);
    chunks.data[HW_CELL_CHUNK_FARS][92 + 6] = 2;
    assert_int_equal(hw_cell_from_chunks("flags", 1, &chunks, &cell), HW_FORMAT);
    assert_string_equal(hw_error_text(), "flags: far object 1: unknown flags 2");
    hw_cell_chunks_free(&chunks);
}

// Every chunk cut at every byte, past the checksums.
static void test_truncated_chunks(void **state)
{
    (void)state;
    hw_cell cell;
    hw_cell_chunks chunks = {0};
    fixture_cell(&cell, 3, 4, 4);
    must(hw_cell_to_chunks(&cell, &chunks));
    hw_cell_free(&cell);
    for (int k = 0; k < HW_CELL_CHUNK_COUNT; k++) {
        uint8_t *whole = chunks.data[k];
        size_t size = chunks.size[k];
        for (size_t cut = 0; cut < size; cut++) {
            chunks.data[k] = malloc(cut + !cut);
            assert_non_null(chunks.data[k]);
            memcpy(chunks.data[k], whole, cut);
            chunks.size[k] = cut;
            assert_int_equal(hw_cell_from_chunks("cut", 1, &chunks, &cell), HW_FORMAT);
            free(chunks.data[k]);
        }
        chunks.data[k] = whole;
        chunks.size[k] = size;
    }
    hw_cell_chunks_free(&chunks);
}

static void test_version_and_kind(void **state)
{
    (void)state;
    hw_cell cell;
    hw_cell_chunks chunks = {0};
    fixture_cell(&cell, 3, 4, 4);
    must(hw_cell_to_chunks(&cell, &chunks));
    hw_cell_free(&cell);
    chunks.data[HW_CELL_CHUNK_INFO][0]++;
    assert_int_equal(hw_cell_from_chunks("newer", 1, &chunks, &cell), HW_VERSION);
    char message[96];
    snprintf(message, sizeof message, "newer: cell version %u, this program reads %u",
             HW_CELL_VERSION + 1, HW_CELL_VERSION);
    assert_non_null(strstr(hw_error_text(), message));
    hw_cell_chunks_free(&chunks);

    const hw_chunk chunk = {HW_FOURCC('I', 'N', 'F', 'O'), 0, "?", 1};
    must(hw_container_write("few.hxc", HW_CELL_MAGIC, 0, &chunk, 1));
    assert_int_equal(read_cell("few.hxc"), HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), "few.hxc: chunk NEAR 0 is missing"));
    // Another version is told before the chunks that it lacks.
    const uint8_t first[4] = {1, 0, 0, 0};
    const hw_chunk old = {HW_FOURCC('I', 'N', 'F', 'O'), 0, first, sizeof first};
    must(hw_container_write("old.hxc", HW_CELL_MAGIC, 0, &old, 1));
    assert_int_equal(read_cell("old.hxc"), HW_VERSION);
    must(hw_container_write("mesh.hxm", HW_MESH_MAGIC, 0, &chunk, 1));
    assert_int_equal(read_cell("mesh.hxm"), HW_FORMAT);
    assert_int_equal(read_cell("no-such-cell.hxc"), HW_NOT_FOUND);
}

// The projective map of image space, against the capture's own view: a perspective from the centre
// through the plane of the face.
static void test_record_matrix(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(8, 8);
    for (uint32_t t = 0; t < 600; t++) {
        hw_vec3 axis, right, up, centre = {1000, -2000, 12};
        hw_far_record f = {.face = t % 6, .rect = {40, 60, 200, 300}};
        hw_face_basis((int)f.face, &axis, &right, &up);
        f.x_min = hw_rng_float(&rng) - 0.7f;
        f.x_max = f.x_min + 0.05f + 0.2f * hw_rng_float(&rng);
        f.y_min = hw_rng_float(&rng) - 0.5f;
        f.y_max = f.y_min + 0.05f + 0.2f * hw_rng_float(&rng);
        f.iz_min = 1 / (200 + 800 * hw_rng_float(&rng));
        f.iz_max = f.iz_min * 1.2f;
        hw_mat4 m = hw_far_record_matrix(&f, centre);
        double world[2][3], image[2][3];
        for (int k = 0; k < 2; k++) {
            // A point of the view volume, by distance along the axis and slopes.
            double s[3], q[3], wx, wy, z;
            for (int i = 0; i < 3; i++)
                s[i] = (double)hw_rng_float(&rng);
            wx = (double)f.x_min + s[0] * ((double)f.x_max - (double)f.x_min);
            wy = (double)f.y_min + s[1] * ((double)f.y_max - (double)f.y_min);
            z = 1 / ((double)f.iz_min + s[2] * ((double)f.iz_max - (double)f.iz_min));
            double p[3] = {(double)centre.x + z * ((double)axis.x + wx * (double)right.x),
                           (double)centre.y + z * ((double)axis.y + wx * (double)right.y),
                           (double)centre.z + z * wy};
            // As 16-bit integers, and back: off by half a step each, where a step in x or y is
            // (x_max - x_min) / 65535 at distance z, and one in 1 / z is z^2 times as long.
            for (int i = 0; i < 3; i++)
                q[i] = image[k][i] = round(s[i] * 65535);
            double w = m.m[3] * q[0] + m.m[7] * q[1] + m.m[11] * q[2] + m.m[15];
            for (int i = 0; i < 3; i++)
                world[k][i] =
                    (m.m[i] * q[0] + m.m[4 + i] * q[1] + m.m[8 + i] * q[2] + m.m[12 + i]) / w;
            double error = hypot(hypot(world[k][0] - p[0], world[k][1] - p[1]), world[k][2] - p[2]);
            double slope = sqrt(1 + wx * wx + wy * wy);
            double step =
                hypot((double)f.x_max - (double)f.x_min, (double)f.y_max - (double)f.y_min) * z /
                    65535 +
                ((double)f.iz_max - (double)f.iz_min) / 65535 * z * z * slope;
            assert_true(error <= 0.51 * step + 1e-9);
            assert_true(fabs(w * z - 1) < 1e-4);

            // The texel that the vertex names is where the capture shows the point: the slopes of
            // the ray from the centre, mapped to the record's rectangle.
            double d[3] = {world[k][0] - (double)centre.x, world[k][1] - (double)centre.y,
                           world[k][2] - (double)centre.z};
            double depth = d[0] * (double)axis.x + d[1] * (double)axis.y;
            double seen_x = (d[0] * (double)right.x + d[1] * (double)right.y) / depth;
            double texel = f.rect.x + q[0] * f.rect.width / 65535;
            double shown = f.rect.x + f.rect.width * (seen_x - (double)f.x_min) /
                                          ((double)f.x_max - (double)f.x_min);
            assert_true(fabs(texel - shown) < 1e-3);
            double texel_y = f.rect.y + q[1] * f.rect.height / 65535;
            double shown_y = f.rect.y + f.rect.height * (d[2] / depth - (double)f.y_min) /
                                            ((double)f.y_max - (double)f.y_min);
            assert_true(fabs(texel_y - shown_y) < 1e-3);
        }
        // Lines stay lines, so that a triangle interpolated in image space (and with it its texture
        // coordinates, linear in x and y) is the triangle of the world: the middle of two points of
        // image space lies on the line through their world positions.
        double middle[4] = {0}, q[4] = {0, 0, 0, 1}, u[3], v[3];
        for (int i = 0; i < 3; i++)
            q[i] = 0.5 * (image[0][i] + image[1][i]);
        for (int i = 0; i < 4; i++)
            for (int c = 0; c < 4; c++)
                middle[i] += m.m[c * 4 + i] * q[c];
        for (int i = 0; i < 3; i++) {
            u[i] = world[1][i] - world[0][i];
            v[i] = middle[i] / middle[3] - world[0][i];
        }
        double cross = hypot(hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2]),
                             u[0] * v[1] - u[1] * v[0]);
        double length = hypot(hypot(u[0], u[1]), u[2]);
        assert_true(cross <= 1e-9 * length * length + 1e-7 * length);
    }
}

// The head alone: the same counts, no arrays, and errors for what is no cell.
static void test_counts(void **state)
{
    (void)state;
    hw_cell cell, counts;
    fixture_cell(&cell, 3, 4, 4);
    must(hw_cell_write(&cell, "counts.hxc"));
    must(hw_cell_read_counts("counts.hxc", &counts));
    assert_memory_equal(&cell.id, &counts.id, sizeof cell.id);
    assert_true(cell.key == counts.key);
    assert_int_equal(cell.near_count, counts.near_count);
    assert_int_equal(cell.far_count, counts.far_count);
    assert_int_equal(cell.vertex_count, counts.vertex_count);
    assert_int_equal(cell.index_count, counts.index_count);
    assert_null(counts.near);
    assert_null(counts.vertices);
    hw_cell_free(&cell);
    must(hw_file_write("counts.hxc", "HXWC", 4));
    assert_int_equal(hw_cell_read_counts("counts.hxc", &counts), HW_FORMAT);
    assert_int_equal(counts.far_count, 0);
    assert_int_equal(hw_cell_read_counts("no-such.hxc", &counts), HW_NOT_FOUND);
    remove("counts.hxc");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_rounded_vertices),
        cmocka_unit_test(test_damage),
        cmocka_unit_test(test_torture),
        cmocka_unit_test(test_is_current),
        cmocka_unit_test(test_path),
        cmocka_unit_test(test_validation),
        cmocka_unit_test(test_hostile_words),
        cmocka_unit_test(test_unknown_flags),
        cmocka_unit_test(test_truncated_chunks),
        cmocka_unit_test(test_version_and_kind),
        cmocka_unit_test(test_record_matrix),
        cmocka_unit_test(test_counts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
