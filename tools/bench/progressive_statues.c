// bench_progressive STATUE_FOLDER|MESH... [--faces N] [--threads N]
//
// Makes progressive meshes of statues (or of any mesh), down to 1 % of the faces or N, by two
// metrics, both hierarchies and all placements, lossless and at 16 bits. Says what a vertex costs,
// and verifies that what was written comes back: the finest level is the original, states depend on
// the records applied alone, the records of a batch commute. Exit code 1 if anything does not hold.
#include "alloc.h"
#include "file.h"
#include "hash.h"
#include "import.h"
#include "parallel.h"
#include "progressive_file.h"
#include "rng.h"
#include "simplify.h"
#include "statues.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define WALKS 50
#define BITS  16

static struct {
    uint32_t faces, threads;
    char folder[64]; // for the files
} settings = {.threads = 1};

static const char *const metrics[] = {"quadric", "volume"};
static const char *const hierarchies[] = {"linear", "batched"};
static const char *const placements[] = {"0", "1", "2", "optimal"};
#define ROWS 16

typedef struct row {
    double bytes[2];    // a vertex of the original: lossless, at BITS
    double batch_ratio; // faces after a batch over those before, on average; 0: no batches
    uint32_t base_faces;
    bool verified;
    char problem[256];
} row;

typedef struct job {
    const hw_mesh *mesh;
    row rows[ROWS];
} job;

// ---- verification ----------------------------------------------------------------------------

#define HOLDS(condition)                                                                           \
    do {                                                                                           \
        if (!(condition))                                                                          \
            return hw_fail(HW_INTERNAL, "does not hold: %s", #condition);                          \
    } while (0)

// The same for meshes that have the same vertices and the same oriented faces, in any order.
static uint64_t shape_hash(const hw_mesh *mesh)
{
    uint64_t sum = 0;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        sum += hw_hash(1, &mesh->positions[v], sizeof *mesh->positions);
    for (uint32_t i = 0; i < mesh->index_count; i += 3) {
        hw_vec3 least[3];
        for (uint32_t turn = 0; turn < 3; turn++) {
            hw_vec3 face[3];
            for (uint32_t k = 0; k < 3; k++)
                face[k] = mesh->positions[mesh->indices[i + (k + turn) % 3]];
            if (turn == 0 || memcmp(face, least, sizeof face) < 0)
                memcpy(least, face, sizeof face);
        }
        sum += hw_hash(2, least, sizeof least);
    }
    return sum;
}

// What the finest level must be: the welded original on the grid, whose steps bound how far it
// moved.
static hw_status check_original(const hw_mesh *mesh, const hw_position_grid *grid,
                                const hw_progressive *p)
{
    hw_status status;
    hw_mesh welded = {0}, finest = {0};
    HW_GO(hw_mesh_weld_positions(mesh, &welded));
    for (uint32_t v = 0; v < welded.vertex_count; v++) {
        float *x = &welded.positions[v].x;
        double to[3] = {(double)x[0], (double)x[1], (double)x[2]};
        hw_position_grid_snap(grid, to);
        for (int i = 0; i < 3; i++) {
            double moved = fabs(to[i] - (double)x[i]), rounding = fabs(to[i]) * 0x1p-23;
            if (moved > grid->step / 2 + (grid->lossless ? 0 : rounding))
                HW_GO(hw_fail(HW_INTERNAL, "vertex %u moved by %g", v, moved));
            x[i] = (float)to[i];
        }
    }
    HW_GO(hw_progressive_extract(p, &finest));
    if (finest.vertex_count != welded.vertex_count || finest.index_count != welded.index_count ||
        shape_hash(&finest) != shape_hash(&welded))
        HW_GO(hw_fail(HW_INTERNAL, "the finest level is not the original"));
out:
    hw_mesh_free(&welded);
    hw_mesh_free(&finest);
    return status;
}

static hw_status state_hash(const hw_progressive *p, uint64_t *hash)
{
    hw_mesh mesh;
    HW_TRY(hw_progressive_extract(p, &mesh));
    *hash = hw_mesh_hash(&mesh);
    hw_mesh_free(&mesh);
    return HW_OK;
}

// Up through the original's states, then to and fro among them with the one that was read.
static hw_status check_walks(hw_progressive *p, hw_progressive *read, hw_rng *rng)
{
    uint32_t n = hw_progressive_get_info(p).record_count, at[WALKS];
    uint64_t hashes[WALKS], hash;
    for (uint32_t i = 0; i < WALKS; i++) {
        at[i] = i == 0 ? 0 : i == 1 ? n : hw_rng_below(rng, n + 1);
        hw_progressive_go(p, at[i]);
        HW_TRY(state_hash(p, &hashes[i]));
    }
    for (uint32_t walk = 0; walk < WALKS; walk++) {
        uint32_t i = hw_rng_below(rng, WALKS), steps = hw_rng_below(rng, 1000);
        hw_progressive_go(read, at[i]);
        HOLDS(hw_progressive_applied_count(read) == at[i]);
        HW_TRY(state_hash(read, &hash));
        HOLDS(hash == hashes[i]);
        for (uint32_t k = 0; k < steps; k++) // single steps, away and back
            (void)(walk % 2 ? hw_progressive_refine(read) : hw_progressive_coarsen(read));
        hw_progressive_go(read, at[i]);
        HW_TRY(state_hash(read, &hash));
        HOLDS(hash == hashes[i]);
    }
    return HW_OK;
}

static void shuffle(hw_rng *rng, uint32_t *order, uint32_t first, uint32_t count)
{
    for (uint32_t k = 0; k < count; k++) {
        uint32_t other = hw_rng_below(rng, k + 1);
        order[k] = order[other];
        order[other] = first + k;
    }
}

static hw_status check_batch(hw_progressive *p, hw_rng *rng, uint32_t batch, uint32_t *order)
{
    uint32_t first, count;
    uint64_t coarse, fine, hash;
    hw_progressive_batch(p, batch, &first, &count);
    hw_progressive_go(p, first);
    HW_TRY(state_hash(p, &coarse));
    hw_progressive_go(p, first + count);
    HW_TRY(state_hash(p, &fine));
    shuffle(rng, order, first, count);
    for (uint32_t k = 0; k < count; k++)
        HW_TRY(hw_progressive_collapse_record(p, order[k]));
    HW_TRY(state_hash(p, &hash));
    HOLDS(hash == coarse);
    shuffle(rng, order, first, count);
    for (uint32_t k = 0; k < count; k++)
        HW_TRY(hw_progressive_split(p, order[k]));
    HW_TRY(state_hash(p, &hash));
    HOLDS(hash == fine);
    return HW_OK;
}

static hw_status check_batches(hw_progressive *p, hw_rng *rng)
{
    hw_progressive_info info = hw_progressive_get_info(p);
    uint32_t *order = NULL;
    hw_status status = HW_NEW(&order, info.record_count);
    for (uint32_t b = 0; status == HW_OK && b < info.batch_count; b++)
        status = check_batch(p, rng, b, order);
    hw_free(order);
    return status;
}

// ---- one configuration -----------------------------------------------------------------------

// The last batch ends at the limit and does not count.
static double batch_ratio(const hw_progressive *p)
{
    uint32_t batches = hw_progressive_get_info(p).batch_count, first, count;
    double sum = 0;
    for (uint32_t b = 1; b < batches; b++) { // coarse to fine
        hw_progressive_batch(p, b, &first, &count);
        sum +=
            (double)hw_progressive_faces_at(p, first) / hw_progressive_faces_at(p, first + count);
    }
    return batches > 1 ? sum / (batches - 1) : 0;
}

static hw_status write_and_check(const hw_mesh *mesh, const hw_position_grid *grid,
                                 hw_simplified *s, uint32_t index, uint64_t *bytes)
{
    hw_status status;
    hw_progressive *read = NULL;
    hw_rng rng = hw_rng_make(index, 7);
    char name[32], *path = NULL;
    struct stat info;
    snprintf(name, sizeof name, "%u.hxp", index);
    HW_TRY(hw_path_join(&path, settings.folder, name));
    HW_GO(hw_progressive_write(s->progressive, UINT32_MAX, path, 0));
    HW_GO(hw_progressive_read(&read, path));
    if (stat(path, &info) == 0)
        *bytes = (uint64_t)info.st_size;
    HW_GO(check_original(mesh, grid, read));
    HW_GO(check_walks(s->progressive, read, &rng));
    HW_GO(check_batches(read, &rng));
    hw_progressive_go(read, UINT32_MAX);
    HW_GO(check_original(mesh, grid, read));
out:
    if (path)
        unlink(path);
    hw_free(path);
    hw_progressive_destroy(read);
    return status;
}

static hw_status run_row(const hw_mesh *mesh, uint32_t index, row *out)
{
    uint32_t faces = mesh->index_count / 3;
    for (int precision = 0; precision < 2; precision++) {
        hw_simplified s;
        const hw_position_grid grid =
            hw_position_grid_make(hw_mesh_bounds(mesh), precision ? BITS : 0);
        const hw_simplify_options options = {
            .stage_count = 1,
            .stages = {{.metric = hw_metric_find(metrics[index / 8])}},
            .batched = index / 4 % 2,
            .placement_set = true,
            .placement = (hw_placement)(index % 4),
            .faces = settings.faces ? settings.faces : (faces + 99) / 100,
            .threads = 1,
            .grid = &grid};
        uint64_t bytes = 0;
        HW_TRY(hw_simplify(mesh, &options, &s));
        hw_status status = write_and_check(mesh, &grid, &s, index, &bytes);
        out->bytes[precision] = (double)bytes / s.facts.vertices_before;
        if (precision == 0) {
            out->batch_ratio = batch_ratio(s.progressive);
            out->base_faces = s.mesh.index_count / 3;
        }
        hw_simplified_free(&s);
        HW_TRY(status);
    }
    return HW_OK;
}

static hw_status run_job(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    job *j = context;
    row *r = &j->rows[index];
    r->verified = run_row(j->mesh, (uint32_t)index, r) == HW_OK;
    if (!r->verified)
        snprintf(r->problem, sizeof r->problem, "%.255s", hw_error_text());
    return HW_OK;
}

// ---- the table -------------------------------------------------------------------------------

static bool bench(const char *name, const hw_mesh *mesh)
{
    static job j;
    bool fine = true;
    double raw = 12.0 + 12.0 * (mesh->index_count / 3) / mesh->vertex_count;
    memset(&j, 0, sizeof j);
    j.mesh = mesh;
    if (hw_parallel_for(ROWS, settings.threads, run_job, &j, NULL) != HW_OK)
        return false;
    for (uint32_t i = 0; i < ROWS; i++) {
        const row *r = &j.rows[i];
        char ratio[16] = "-";
        if (r->batch_ratio > 0)
            snprintf(ratio, sizeof ratio, "%.3f", r->batch_ratio);
        printf("%-12s %9u %-8s %-8s %-8s %7u %9.2f %8.2f %6.1f %6s  %s%s\n", name,
               mesh->index_count / 3, metrics[i / 8], hierarchies[i / 4 % 2], placements[i % 4],
               r->base_faces, r->bytes[0], r->bytes[1], raw, ratio,
               r->verified ? "yes" : "NO: ", r->problem);
        fine = fine && r->verified;
    }
    fflush(stdout);
    return fine;
}

static bool bench_statues(const char *folder)
{
    bool fine = true;
    uint32_t count;
    const hw_statue *statues = hw_statue_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        hw_mesh mesh;
        if (!hw_statue_available(&statues[i], folder))
            continue;
        if (hw_statue_load(&statues[i], folder, &mesh) != HW_OK) {
            fprintf(stderr, "%s: %s\n", statues[i].name, hw_error_text());
            fine = false;
            continue;
        }
        fine = bench(statues[i].name, &mesh) && fine;
        hw_mesh_free(&mesh);
    }
    return fine;
}

static bool bench_argument(const char *path)
{
    struct stat info;
    hw_mesh mesh;
    if (stat(path, &info) == 0 && S_ISDIR(info.st_mode))
        return bench_statues(path);
    if (hw_mesh_import(path, &mesh) != HW_OK) {
        fprintf(stderr, "%s\n", hw_error_text());
        return false;
    }
    const char *slash = strrchr(path, '/');
    bool fine = bench(slash ? slash + 1 : path, &mesh);
    hw_mesh_free(&mesh);
    return fine;
}

// Takes a number after the option; false at the end of the arguments.
static bool take_number(int argc, char **argv, int *i, uint32_t *out)
{
    char *end;
    if (++*i >= argc)
        return false;
    unsigned long value = strtoul(argv[*i], &end, 10);
    *out = (uint32_t)value;
    return *end == 0 && end != argv[*i] && value > 0 && value <= UINT32_MAX;
}

int main(int argc, char **argv)
{
    bool fine = true, usage = false;
    int inputs = 0;
    for (int i = 1; i < argc && !usage; i++) {
        if (strcmp(argv[i], "--faces") == 0)
            usage = !take_number(argc, argv, &i, &settings.faces);
        else if (strcmp(argv[i], "--threads") == 0)
            usage = !take_number(argc, argv, &i, &settings.threads);
        else if (argv[i][0] == '-')
            usage = true;
        else
            argv[inputs++] = argv[i];
    }
    if (usage || inputs == 0) {
        fprintf(stderr, "bench_progressive STATUE_FOLDER|MESH... [--faces N] [--threads N]\n");
        return 2;
    }
    snprintf(settings.folder, sizeof settings.folder, "/tmp/bench_progressive.XXXXXX");
    if (!mkdtemp(settings.folder)) {
        perror(settings.folder);
        return 1;
    }
    printf("%-12s %9s %-8s %-8s %-8s %7s %9s %8s %6s %6s  %s\n", "mesh", "triangles", "metric",
           "order", "place", "base", "B/vertex", "16 bits", "raw", "batch", "verified");
    for (int i = 0; i < inputs; i++)
        fine = bench_argument(argv[i]) && fine;
    rmdir(settings.folder);
    return fine ? 0 : 1;
}
