// clang-format off
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h>
// clang-format on
#include "checks.h"
#include "progressive_checks.h"
#include "progressive_codec.h"

#define PATH "mesh.hxp"

static void assert_same_progressive(hw_progressive *a, hw_progressive *b)
{
    hw_progressive_info x = hw_progressive_get_info(a), y = hw_progressive_get_info(b);
    assert_int_equal(x.record_count, y.record_count);
    assert_int_equal(x.batch_count, y.batch_count);
    assert_true(x.complete == y.complete && x.keep_order == y.keep_order);
    uint64_t *p = all_hashes(a), *q = all_hashes(b);
    assert_memory_equal(p, q, (x.record_count + 1) * sizeof *p);
    for (uint32_t i = 0; i < x.batch_count; i++) {
        uint32_t range[2][2];
        hw_progressive_batch(a, i, &range[0][0], &range[0][1]);
        hw_progressive_batch(b, i, &range[1][0], &range[1][1]);
        assert_memory_equal(range[0], range[1], sizeof range[0]);
    }
    hw_free(p);
    hw_free(q);
}

static void test_round_trip(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(7, 7);
    for (uint32_t i = 0; i < CONFIGURATIONS; i++) {
        hw_mesh original, mesh;
        hw_progressive *p = make_progressive(i, i % 3 == 0, &original), *q = NULL;
        uint32_t n = hw_progressive_get_info(p).record_count;
        hw_progressive_go(p, hw_rng_below(&rng, n + 1));
        must(hw_progressive_write(p, UINT32_MAX, PATH, i));
        must(hw_progressive_read(&q, PATH));
        must(hw_progressive_extract(q, &mesh));
        assert_same_shape(&original, &mesh);
        if (i % 3 == 0)
            assert_same_arrays(&original, &mesh);
        assert_same_progressive(p, q);
        // What was read gives the same bytes, whatever its state.
        size_t a_size = 0, b_size = 0;
        hw_progressive_go(q, n / 3);
        must(hw_progressive_write(q, n, "again.hxp", i));
        uint8_t *a = read_bytes(PATH, &a_size), *b = read_bytes("again.hxp", &b_size);
        assert_int_equal(a_size, b_size);
        assert_memory_equal(a, b, a_size);
        hw_free(a);
        hw_free(b);
        hw_mesh_free(&mesh);
        hw_mesh_free(&original);
        hw_progressive_destroy(p);
        hw_progressive_destroy(q);
    }
}

// After reading, too, the records of a batch go in any order.
static void test_any_order_after_reading(void **state)
{
    (void)state;
    hw_rng rng = hw_rng_make(8, 8);
    for (uint32_t i = 2; i < CONFIGURATIONS; i += 8) {
        hw_mesh original;
        hw_progressive *p = make_progressive(i, false, &original), *q = NULL;
        must(hw_progressive_write(p, UINT32_MAX, PATH, i));
        must(hw_progressive_read(&q, PATH));
        for (uint32_t b = hw_progressive_get_info(p).batch_count; b-- > 0;) {
            uint32_t first, count;
            hw_progressive_batch(p, b, &first, &count);
            for (uint32_t k = 0; k < 3 * count; k++) {
                uint32_t record = first + hw_rng_below(&rng, count);
                hw_status x = hw_progressive_collapse_record(p, record);
                assert_int_equal(x, hw_progressive_collapse_record(q, record));
                if (k % 3 == 0) {
                    record = first + hw_rng_below(&rng, count);
                    x = hw_progressive_split(p, record);
                    assert_int_equal(x, hw_progressive_split(q, record));
                }
            }
            assert_true(state_hash(p) == state_hash(q));
            hw_progressive_go(p, first);
            hw_progressive_go(q, first);
        }
        hw_mesh_free(&original);
        hw_progressive_destroy(p);
        hw_progressive_destroy(q);
    }
}

static hw_progressive *make_large(const fixture_options *o, hw_mesh *original)
{
    fixture_recorder r;
    hw_progressive *p = NULL;
    fixture_surface(original, 120, 90, false, 1);
    fixture_prepare(&r, original, 0, o);
    fixture_run(&r, o);
    must(hw_progressive_create(&p, &r.grid, &r.source, false));
    fixture_recorder_free(&r);
    return p;
}

// Files of several blocks: each number of blocks is that many records of the whole.
static void check_prefixes(hw_progressive *p, const hw_progressive_file *file)
{
    const hw_progressive_file_info *info = hw_progressive_file_get_info(file);
    uint32_t records = 0, faces = info->mesh.base_face_count;
    for (uint32_t b = 0; b <= info->block_count; b++) {
        hw_progressive *q = NULL;
        must(hw_progressive_file_read(file, b, &q));
        assert_int_equal(hw_progressive_get_info(q).complete, b == info->block_count);
        assert_int_equal(hw_progressive_applied_count(q), records);
        hw_progressive_go(p, records);
        assert_true(state_hash(p) == state_hash(q));
        if (b % 4 == 1) { // written alone, the prefix is a file of its own
            hw_progressive *again = NULL;
            must(hw_progressive_write(p, records, "prefix.hxp", 1));
            must(hw_progressive_read(&again, "prefix.hxp"));
            hw_progressive_go(again, UINT32_MAX);
            assert_true(state_hash(p) == state_hash(again));
            hw_progressive_go(q, records / 2);
            hw_progressive_go(again, records / 2);
            assert_true(state_hash(q) == state_hash(again));
            hw_progressive_destroy(again);
        }
        hw_progressive_destroy(q);
        if (b == info->block_count)
            break;
        const hw_progressive_block *block = hw_progressive_file_block(file, b);
        assert_int_equal(block->first_record, records);
        records += block->record_count;
        faces += block->face_count;
    }
    assert_int_equal(records, info->mesh.record_count);
    assert_int_equal(faces + info->mesh.loose_face_count, info->face_count);
}

static void test_prefixes_and_bytes(void **state)
{
    (void)state;
    for (uint32_t i = 0; i < 12; i++) {
        fixture_options o = {.bits = i % 2 ? 14 : 0,
                             .batched = i / 2 % 2,
                             .placement = (fixture_placement)(i / 4),
                             .keep = 0.02f,
                             .seed = 3};
        hw_mesh original;
        hw_progressive_file *file = NULL;
        hw_progressive *p = make_large(&o, &original);
        must(hw_progressive_write(p, UINT32_MAX, "large.hxp", 9));
        must(hw_progressive_file_open(&file, "large.hxp"));
        const hw_progressive_file_info *info = hw_progressive_file_get_info(file);
        double n = original.vertex_count;
        printf("%s %s %s: %.2f bytes a vertex: connectivity %.2f, geometry %.2f; base %.3f, "
               "%u batches, %u blocks\n",
               o.bits ? "14 bits" : "lossless", o.batched ? "batched" : "strict",
               o.placement == PLACE_FREE  ? "free"
               : o.placement == PLACE_END ? "end"
                                          : "midpoint",
               (double)info->file_bytes / n, (double)info->connectivity_bytes / n,
               (double)info->geometry_bytes / n, (double)info->base_bytes / n,
               info->mesh.batch_count, info->block_count);
        assert_int_equal(info->key, 9);
        assert_int_equal(info->vertex_count, original.vertex_count);
        assert_int_equal(info->face_count, original.index_count / 3);
        uint64_t sum = info->head_bytes + info->base_bytes + info->connectivity_bytes +
                       info->geometry_bytes + info->loose_bytes + info->order_bytes;
        assert_true(sum < info->file_bytes && sum + 200 * 40 > info->file_bytes);
        // Raw, a vertex and its two faces are 36 bytes. Free places are random here: the worst
        // case.
        assert_true((double)info->file_bytes / n < (o.bits ? 11 : 22));
        check_prefixes(p, file);
        uint64_t before = 0, bytes = 0;
        for (uint32_t k = 0; k <= 4; k++) {
            must(hw_progressive_encoded_bytes(p, info->mesh.record_count / 4 * k, &bytes));
            assert_true(bytes > before);
            before = bytes;
        }
        must(hw_progressive_encoded_bytes(p, UINT32_MAX, &bytes));
        assert_true(bytes == info->file_bytes);
        hw_progressive_file_close(file);
        hw_progressive_destroy(p);
        hw_mesh_free(&original);
    }
}

// All ways to write a record occur in these tests.
static void test_every_kind(void **state)
{
    (void)state;
    uint32_t kinds[HW_SPLIT_KINDS] = {0}, places[HW_PLACES] = {0};
    for (uint32_t i = 0; i < CONFIGURATIONS; i++) {
        hw_mesh original;
        hw_container *file = NULL;
        uint8_t *bytes = NULL;
        size_t size = 0;
        hw_progressive *p = make_progressive(i, false, &original);
        must(hw_progressive_write(p, UINT32_MAX, PATH, i));
        must(hw_container_open(&file, PATH, HW_PROGRESSIVE_MAGIC));
        if (hw_progressive_get_info(p).record_count > 0)
            must(hw_container_chunk(file, HW_FOURCC('C', 'O', 'N', 'N'), 0, &bytes, &size));
        for (uint32_t r = 0; r < hw_progressive_get_info(p).record_count; r++) {
            kinds[bytes[r] & 3]++;
            // A closed surface stays one. (In a batch it may not on the way: the collapses were
            // checked in another order.)
            if (configuration_shape(i) == 0 && !configuration(i).careless &&
                !configuration(i).batched)
                assert_int_equal(bytes[r] & 3, HW_SPLIT_BOTH);
            places[bytes[r] >> 2]++;
        }
        hw_free(bytes);
        hw_container_close(file);
        hw_progressive_destroy(p);
        hw_mesh_free(&original);
    }
    for (int i = 0; i < 4; i++) {
        printf("kind %d: %u, place %d: %u\n", i, kinds[i], i, places[i]);
        assert_true(kinds[i] > 20 && places[i] > 20);
    }
    assert_true(kinds[HW_SPLIT_EXPLICIT] < kinds[HW_SPLIT_BOTH] / 2);
}

// A wheel whose n rim vertices were all merged into the hub, from one end of the rim on: the first
// of them meet few faces, the last ones n.
static hw_status write_wheel(uint32_t n)
{
    hw_progressive_source s = {.vertex_count = n + 1,
                               .face_count = n - 1,
                               .original_vertex_count = n + 1,
                               .collapse_count = n - 1};
    float(*positions)[3] = NULL;
    uint32_t(*faces)[3] = NULL;
    hw_progressive_collapse *collapses = NULL;
    hw_progressive *p = NULL;
    hw_position_grid grid = hw_position_grid_make(hw_box_empty(), 0);
    must(HW_NEW(&positions, n + 1));
    must(HW_NEW(&faces, n));
    must(HW_NEW(&collapses, n));
    for (uint32_t i = 0; i + 1 < n; i++) {
        faces[i][0] = UINT32_MAX;
        collapses[i] = (hw_progressive_collapse){.kept = 0,
                                                 .removed = i + 1,
                                                 .faces = {i, UINT32_MAX},
                                                 .face_corners = {{0, i + 1, i + 2}}};
        collapses[i].removed_before[0] = 1;
    }
    s.positions = (const float(*)[3])positions;
    s.faces = (const uint32_t(*)[3])faces;
    s.collapses = collapses;
    must(hw_progressive_create(&p, &grid, &s, true));
    hw_status status = hw_progressive_write(p, UINT32_MAX, "wheel.hxp", 1);
    if (status == HW_OK) {
        hw_progressive *q = NULL;
        must(hw_progressive_read(&q, "wheel.hxp"));
        assert_true(state_hash(p) == state_hash(q));
        hw_progressive_destroy(q);
    }
    hw_progressive_destroy(p);
    hw_free(positions);
    hw_free(faces);
    hw_free(collapses);
    return status;
}

static void test_hubs(void **state)
{
    (void)state;
    assert_int_equal(write_wheel(3000), HW_OK);
    assert_int_equal(write_wheel(7000), HW_LIMIT);
    assert_non_null(strstr(hw_error_text(), "wheel.hxp"));
}

// --- Damage --------------------------------------------------------------------------------------

static hw_status read_only(const char *path)
{
    hw_progressive *p = NULL;
    hw_status status = hw_progressive_read(&p, path);
    if (status != HW_OK)
        assert_null(p);
    hw_progressive_destroy(p);
    return status;
}

static hw_status write_only(const char *path)
{
    hw_progressive *p = NULL;
    HW_TRY(hw_progressive_read(&p, path));
    hw_status status = hw_progressive_write(p, UINT32_MAX, "written.hxp", 1);
    hw_progressive_destroy(p);
    return status;
}

static void write_sample(uint32_t shape, bool batched, bool keep_order)
{
    fixture_options o = {.batched = batched, .placement = PLACE_FREE, .keep = 0.3f, .seed = 1};
    fixture_recorder r;
    hw_mesh original;
    hw_progressive *p = NULL;
    fixture_record(&r, &original, shape, &o);
    must(hw_progressive_create(&p, &r.grid, &r.source, keep_order));
    must(hw_progressive_write(p, UINT32_MAX, PATH, 5));
    hw_progressive_destroy(p);
    fixture_recorder_free(&r);
    hw_mesh_free(&original);
}

static void test_damage(void **state)
{
    (void)state;
    write_sample(4, true, true);
    check_damage(PATH, read_only);
}

static void test_torture(void **state)
{
    (void)state;
    write_sample(4, true, true);
    assert_true(check_torture(PATH, read_only) > 30);
    assert_true(check_torture(PATH, write_only) > 60);
    write_sample(1, false, false);
    assert_true(check_torture(PATH, write_only) > 60);
}

static void test_wrong_files(void **state)
{
    (void)state;
    assert_int_equal(read_only("no-such.hxp"), HW_NOT_FOUND);
    const hw_chunk chunk = {HW_FOURCC('B', 'A', 'S', 'E'), 0, "?", 1};
    must(hw_container_write("bad.hxp", HW_PROGRESSIVE_MAGIC, 0, &chunk, 1));
    assert_int_equal(read_only("bad.hxp"), HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), "bad.hxp"));
    must(hw_container_write("bad.hxp", HW_MESH_MAGIC, 0, &chunk, 1));
    assert_int_equal(read_only("bad.hxp"), HW_FORMAT);
}

// --- Past the checksums --------------------------------------------------------------------------

#define HOSTILE_CHUNKS 6 // head, base, one block, loose, order
typedef struct hostile {
    uint8_t *bytes[HOSTILE_CHUNKS];
    size_t size[HOSTILE_CHUNKS];
} hostile;

static void load_chunks(hostile *h)
{
    static const char tags[][5] = {"HEAD", "BASE", "CONN", "DELT", "LOOS", "ORDR"};
    hw_container *container = NULL;
    must(hw_container_open(&container, PATH, HW_PROGRESSIVE_MAGIC));
    assert_int_equal(hw_container_chunk_count(container), HOSTILE_CHUNKS);
    for (int i = 0; i < HOSTILE_CHUNKS; i++)
        must(hw_container_chunk(container,
                                HW_FOURCC(tags[i][0], tags[i][1], tags[i][2], tags[i][3]), 0,
                                &h->bytes[i], &h->size[i]));
    hw_container_close(container);
}

static hw_status decode_chunks(const hostile *h, hw_progressive **out)
{
    hw_status status = HW_OK;
    hw_progressive_head head = {0};
    hw_progressive_reader r = {0};
    *out = NULL;
    HW_GO(hw_progressive_head_decode(h->bytes[0], h->size[0], &head));
    HW_GO(hw_progressive_reader_start(&r, &head));
    HW_GO(hw_progressive_get_base(&r, h->bytes[1], h->size[1]));
    if (head.block_count != 1) {
        status = HW_FORMAT;
        goto out;
    }
    HW_GO(hw_progressive_get_block(&r, 0, (const uint8_t *const *)&h->bytes[2], &h->size[2]));
    if (head.info.complete)
        HW_GO(hw_progressive_get_finest(&r, h->bytes[4], h->size[4], h->bytes[5], h->size[5]));
    HW_GO(hw_progressive_reader_finish(&r, out));
out:
    hw_progressive_reader_free(&r);
    hw_progressive_head_free(&head);
    return status;
}

// Whatever is accepted can be walked and written, and is the same again.
static void check_accepted(hw_progressive *p)
{
    hw_progressive *q = NULL;
    uint64_t finest = state_hash(p);
    hw_progressive_go(p, 0);
    (void)state_hash(p);
    must(hw_progressive_write(p, UINT32_MAX, "accepted.hxp", 0));
    must(hw_progressive_read(&q, "accepted.hxp"));
    assert_true(state_hash(q) == finest);
    hw_progressive_destroy(q);
}

static void test_hostile_chunks(void **state)
{
    (void)state;
    uint32_t accepted = 0, rejected = 0;
    for (uint32_t i = 0; i < 2; i++) {
        hostile h;
        write_sample(4, i, true);
        load_chunks(&h);
        for (int c = 0; c < HOSTILE_CHUNKS; c++) {
            uint8_t *bytes = h.bytes[c];
            size_t size = h.size[c];
            hw_progressive *p = NULL;
            for (size_t cut = 0; cut < size; cut++) {
                h.bytes[c] = malloc(cut + !cut);
                assert_non_null(h.bytes[c]);
                memcpy(h.bytes[c], bytes, cut);
                h.size[c] = cut;
                assert_int_equal(decode_chunks(&h, &p), HW_FORMAT);
                free(h.bytes[c]);
            }
            h.bytes[c] = bytes;
            h.size[c] = size;
            const uint8_t values[] = {0, 1, 2, 3, 4, 127, 128, 254, 255};
            for (size_t at = 0; at < size * sizeof values; at++) {
                uint8_t saved = bytes[at / sizeof values];
                bytes[at / sizeof values] = values[at % sizeof values];
                hw_status status = decode_chunks(&h, &p);
                bytes[at / sizeof values] = saved;
                assert_true(status == HW_OK || status == HW_FORMAT || status == HW_VERSION);
                rejected += status != HW_OK;
                if (status == HW_OK && accepted++ % 16 == 0)
                    check_accepted(p);
                hw_progressive_destroy(p);
            }
        }
        for (int c = 0; c < HOSTILE_CHUNKS; c++)
            hw_free(h.bytes[c]);
    }
    assert_true(accepted > 100 && rejected > 1000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_any_order_after_reading),
        cmocka_unit_test(test_prefixes_and_bytes),
        cmocka_unit_test(test_every_kind),
        cmocka_unit_test(test_hubs),
        cmocka_unit_test(test_damage),
        cmocka_unit_test(test_torture),
        cmocka_unit_test(test_wrong_files),
        cmocka_unit_test(test_hostile_chunks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
