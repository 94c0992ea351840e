// Writes the seeds of the fuzzers below a folder: small valid inputs, and mutations of each. The
// same bytes on every run; run it again when a format changes.
#include "../cells/progressive_fixture.h"
#include "cell_chunks.h"
#include "mesh_level.h"

#define MUTANTS 6

static void save(const char *folder, const char *kind, uint32_t number, const void *bytes,
                 size_t size)
{
    char name[64], *path = NULL;
    snprintf(name, sizeof name, "%s_%u", kind, number);
    must(hw_path_join(&path, folder, name));
    write_bytes(path, bytes, size);
    hw_free(path);
}

// The valid input, and some with a few bytes changed, words made hostile, or the end cut off.
static void save_all(const char *folder, uint32_t number, const uint8_t *bytes, size_t size)
{
    static const uint8_t hostile[] = {0x00, 0xff, 0x7f, 0x80, 0x01};
    hw_rng rng = hw_rng_make(number, size);
    uint8_t *bad = NULL;
    must(HW_NEW(&bad, size));
    save(folder, "valid", number, bytes, size);
    for (uint32_t i = 0; i < MUTANTS; i++) {
        memcpy(bad, bytes, size);
        for (uint32_t k = 0; k <= i; k++) {
            size_t at = hw_rng_below(&rng, (uint32_t)size);
            size_t run = i % 2 && size - at >= 4 ? 4 : 1;
            memset(bad + at, hostile[hw_rng_below(&rng, sizeof hostile)], run);
        }
        size_t keep = i == 2 ? 1 + hw_rng_below(&rng, (uint32_t)size - 1) : size;
        save(folder, "mutant", number * MUTANTS + i, bad, keep);
    }
    hw_free(bad);
}

static void make_cells(const char *folder)
{
    static const uint32_t shapes[][3] = {{0, 0, 2}, {3, 0, 2}, {1, 1, 2}, {2, 3, 3}};
    for (uint32_t i = 0; i < sizeof shapes / sizeof *shapes; i++) {
        hw_cell cell;
        hw_cell_chunks chunks = {0};
        hw_bytes_writer w = {0};
        fixture_cell(&cell, shapes[i][0], shapes[i][1], shapes[i][2]);
        must(hw_cell_to_chunks(&cell, &chunks));
        hw_put_u8(&w, 1);
        for (int k = 0; k < HW_CELL_CHUNK_COUNT; k++) {
            hw_put_u32(&w, (uint32_t)chunks.size[k]);
            hw_put_bytes(&w, chunks.data[k], chunks.size[k]);
        }
        must(hw_bytes_writer_check(&w));
        save_all(folder, i, w.data, w.size);
        hw_bytes_writer_free(&w);
        hw_cell_chunks_free(&chunks);

        // The same cell as a file.
        size_t size = 0;
        must(hw_cell_write(&cell, "seed.hxc"));
        uint8_t *bytes = read_bytes("seed.hxc", &size);
        hw_put_u8(&w, 0);
        hw_put_bytes(&w, bytes, size);
        must(hw_bytes_writer_check(&w));
        save_all(folder, 10 + i, w.data, w.size);
        hw_free(bytes);
        hw_bytes_writer_free(&w);
        hw_cell_free(&cell);
    }
    remove("seed.hxc");
}

static void make_meshes(const char *folder)
{
    for (uint32_t i = 0; i < 4; i++) {
        hw_mesh mesh;
        hw_bytes_writer w = {0};
        uint8_t *table = NULL, *level = NULL;
        size_t table_size = 0, level_size = 0;
        fixture_mesh(&mesh, 2 + i, i % 2 == 0);
        const hw_mesh_level_info infos[2] = {{mesh.vertex_count, mesh.index_count, 0, 0, 0, 0},
                                             {3, 3, 1, 2, 1, 1}};
        must(hw_mesh_table_encode(infos, 1 + i % 2, &table, &table_size));
        hw_inner_boxes boxes;
        fixture_boxes(&boxes, &mesh, i);
        must(hw_mesh_level_encode(&mesh, &boxes, &level, &level_size));
        hw_put_u32(&w, (uint32_t)table_size);
        hw_put_bytes(&w, table, table_size);
        hw_put_bytes(&w, level, level_size);
        must(hw_bytes_writer_check(&w));
        save_all(folder, i, w.data, w.size);
        hw_free(table);
        hw_free(level);
        hw_bytes_writer_free(&w);
        hw_mesh_free(&mesh);
    }
}

static void put_chunk(hw_bytes_writer *w, const hw_container *file, const char tag[4],
                      uint32_t number)
{
    uint8_t *bytes = NULL;
    size_t size = 0;
    must(
        hw_container_chunk(file, HW_FOURCC(tag[0], tag[1], tag[2], tag[3]), number, &bytes, &size));
    hw_put_u32(w, (uint32_t)size);
    hw_put_bytes(w, bytes, size);
    hw_free(bytes);
}

static void save_progressive(const char *folder, uint32_t number, const hw_progressive *p)
{
    hw_bytes_writer w = {0};
    hw_container *file = NULL;
    must(hw_progressive_write(p, UINT32_MAX, "seed.hxp", 1));
    must(hw_container_open(&file, "seed.hxp", HW_PROGRESSIVE_MAGIC));
    put_chunk(&w, file, "HEAD", 0);
    put_chunk(&w, file, "BASE", 0);
    for (uint32_t b = 0; b < (hw_container_chunk_count(file) - 4) / 2; b++) {
        put_chunk(&w, file, "CONN", b);
        put_chunk(&w, file, "DELT", b);
    }
    put_chunk(&w, file, "LOOS", 0);
    put_chunk(&w, file, "ORDR", 0);
    must(hw_bytes_writer_check(&w));
    save_all(folder, number, w.data, w.size);
    hw_bytes_writer_free(&w);
    hw_container_close(file);
    remove("seed.hxp");
}

static void make_progressives(const char *folder)
{
    static const uint32_t shapes[] = {3, 4, 5, 6, 7, 2};
    for (uint32_t i = 0; i < sizeof shapes / sizeof *shapes; i++) {
        const fixture_options o = {.bits = i % 2 ? 12 : 0,
                                   .batched = i % 3 != 2,
                                   .careless = i % 4 == 1,
                                   .placement = (fixture_placement)(i % 3),
                                   .keep = 0.2f,
                                   .seed = i};
        fixture_recorder r;
        hw_mesh mesh;
        hw_progressive *p = NULL;
        fixture_record(&r, &mesh, shapes[i], &o);
        must(hw_progressive_create(&p, &r.grid, &r.source, i % 2));
        save_progressive(folder, i, p);
        hw_progressive_destroy(p);
        fixture_recorder_free(&r);
        hw_mesh_free(&mesh);
    }
}

static void make_manifests(const char *folder)
{
    for (uint32_t i = 0; i < 3; i++) {
        hw_manifest manifest;
        size_t size = 0;
        fixture_manifest(&manifest, i, 2 * i);
        manifest.ground.present = i > 0;
        must(hw_manifest_write(folder, &manifest));
        char *path = NULL;
        must(hw_path_join(&path, folder, "manifest.json"));
        uint8_t *bytes = read_bytes(path, &size);
        save_all(folder, i, bytes, size);
        remove(path);
        hw_free(path);
        must(hw_path_join(&path, folder, "build.json"));
        remove(path);
        hw_free(path);
        hw_free(bytes);
        hw_manifest_free(&manifest);
    }
}

int main(int argc, char **argv)
{
    static void (*const makers[])(const char *) = {make_cells, make_meshes, make_progressives,
                                                   make_manifests};
    static const char *const names[] = {"cell", "mesh", "progressive", "manifest"};
    if (argc != 2) {
        fprintf(stderr, "usage: %s FOLDER\n", argv[0]);
        return 2;
    }
    for (int i = 0; i < 4; i++) {
        char *folder = NULL;
        must(hw_path_join(&folder, argv[1], names[i]));
        must(hw_dir_make(folder));
        makers[i](folder);
        hw_free(folder);
    }
    return 0;
}
