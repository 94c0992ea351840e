// Checks a dataset against its scene: from random view points of random cells, every object that
// covers some pixels of the picture must have a record in the cell. Exit 1 if one has not. Given a
// scene instead, asks the culling itself, and tells what it costs. With --broken, the culling looks
// from one eye only, or a dataset's cells lose a record in FORGOTTEN: the check must fail then.
// Datasets with clusters cannot be checked: a cell file names only one member of each.
#include "alloc.h"
#include "cell_file.h"
#include "hierarchy.h"
#include "import.h"
#include "manifest.h"
#include "occlusion.h"
#include "parallel.h"
#include "rng.h"
#include "visibility.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define EYES_MAX  1000 // tries to find a view point outside all objects
#define FORGOTTEN 20u

typedef struct check {
    const char *dataset; // NULL: the culling is asked
    const char *scene_path;
    hw_occlusion_options options;
    hw_occlusion *occlusion;
    uint64_t seed;
    uint32_t cells, views, pixels_min;
    bool broken;
    hw_manifest manifest;
    hw_hexgrid grid;
    hw_scene scene;
    hw_rays *rays;
    uint32_t *chosen; // cells
    atomic_uint misses, recorded, made;
    atomic_ullong lost_pixels, query_us;
} check;

// What one cell needs of memory.
typedef struct cell_check {
    bool *recorded; // per object
    uint32_t *pixels;
} cell_check;

static bool in_hexagon(const hw_hexgrid *grid, hw_cell_id id, double x, double y)
{
    hw_cell_id at = hw_hexgrid_locate(grid, x, y);
    return at.q == id.q && at.r == id.r;
}

// A random point of the cell outside all objects; false if there is hardly one. Every fourth point
// lies at the least or greatest height.
static bool random_eye(const check *c, hw_cell_id id, hw_rng *rng, hw_vec3 *eye)
{
    const hw_hexgrid *grid = &c->grid;
    hw_vec3 centre = hw_cell_centre(grid, id);
    for (int i = 0; i < EYES_MAX; i++) {
        double x = centre.x + grid->cell_size * (2 * (double)hw_rng_float(rng) - 1);
        double y = centre.y + grid->cell_size * (2 * (double)hw_rng_float(rng) - 1);
        double z = grid->z_min + (grid->z_max - grid->z_min) * (double)hw_rng_float(rng);
        uint32_t dice = hw_rng_below(rng, 8);
        z = dice == 0 ? grid->z_min : dice == 1 ? grid->z_max : z;
        *eye = hw_v3((float)x, (float)y, (float)z);
        if (in_hexagon(grid, id, x, y) && !hw_visibility_inside(&c->scene, c->rays, *eye))
            return true;
    }
    return false;
}

// Processor time of this thread.
static double thread_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

// Adds the records of one cell file.
static hw_status read_cell(const check *c, hw_cell_id id, bool *recorded)
{
    hw_cell cell = {0};
    char *path = NULL;
    HW_TRY(hw_cell_path(&path, c->dataset, id));
    hw_status status = hw_cell_read(path, &cell);
    hw_free(path);
    HW_TRY(status);
    for (uint32_t i = 0; i < cell.near_count; i++)
        recorded[cell.near[i].object_idx] = true;
    for (uint32_t i = 0; i < cell.far_count; i++)
        if (!c->broken || i % FORGOTTEN != 0)
            recorded[cell.far[i].object_idx] = true;
    hw_cell_free(&cell);
    return HW_OK;
}

// What is drawn from a cell: by its own file, and those of the groups that hold it.
static hw_status read_records(check *c, hw_cell_id id, cell_check *k)
{
    if (c->occlusion) {
        double start = thread_ms();
        HW_TRY(hw_occlusion_query(c->occlusion, id, k->recorded));
        atomic_fetch_add(&c->query_us, (unsigned long long)(1000 * (thread_ms() - start)));
        return HW_OK;
    }
    for (int32_t l = 0; l < c->grid.levels; l++)
        HW_TRY(read_cell(c, hw_cell_ancestor(id, l), k->recorded));
    return HW_OK;
}

static void report_misses(check *c, hw_cell_id id, const hw_camera *camera, const cell_check *k)
{
    for (uint32_t i = 0; i < c->scene.object_count; i++) {
        if (k->recorded[i] || k->pixels[i] < c->pixels_min)
            continue;
        atomic_fetch_add(&c->misses, 1);
        atomic_fetch_add(&c->lost_pixels, k->pixels[i]);
        printf("miss: object %u (%s) covers %u pixels at %.2f %.2f %.2f, cell %d_%d\n", i,
               c->scene.meshes[c->scene.objects[i].mesh_idx].name, k->pixels[i],
               (double)camera->eye.x, (double)camera->eye.y, (double)camera->eye.z, id.q, id.r);
    }
}

static hw_status check_view(check *c, hw_cell_id id, hw_rng *rng, cell_check *k)
{
    hw_camera camera = {.up = {0, 0, 1}, .fov_degrees = 60, .width = 1024, .height = 1024};
    if (!random_eye(c, id, rng, &camera.eye))
        return HW_OK;
    double azimuth = 2 * HW_PI * (double)hw_rng_float(rng);
    camera.forward = hw_v3((float)cos(azimuth), (float)sin(azimuth), 0);
    memset(k->pixels, 0, c->scene.object_count * sizeof *k->pixels);
    HW_TRY(hw_visibility_count(&c->scene, c->rays, &camera, k->recorded, k->pixels));
    report_misses(c, id, &camera, k);
    atomic_fetch_add(&c->made, 1);
    return HW_OK;
}

static hw_status check_cell(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    check *c = context;
    hw_status status = HW_OK;
    cell_check k = {0};
    hw_cell_id id = hw_hexgrid_cell(&c->grid, c->chosen[index]);
    hw_rng rng = hw_rng_make(c->seed, 100 + index);
    HW_GO(HW_NEW(&k.recorded, c->scene.object_count));
    HW_GO(HW_NEW(&k.pixels, c->scene.object_count));
    HW_GO(read_records(c, id, &k));
    for (uint32_t i = 0; i < c->scene.object_count; i++)
        atomic_fetch_add(&c->recorded, k.recorded[i]);
    for (uint32_t v = 0; v < c->views; v++)
        HW_GO(check_view(c, id, &rng, &k));
out:
    hw_free(k.recorded);
    hw_free(k.pixels);
    return status;
}

// Distinct cells at random, of those that the dataset has.
static hw_status choose_cells(check *c)
{
    uint32_t n = 0, all = hw_hexgrid_cell_count(&c->grid);
    hw_rng rng = hw_rng_make(c->seed, 1);
    HW_TRY(HW_NEW(&c->chosen, all));
    for (uint32_t i = 0; i < all; i++)
        if (!c->dataset || hw_manifest_find_cell(&c->manifest, hw_hexgrid_cell(&c->grid, i), NULL))
            c->chosen[n++] = i;
    c->cells = c->cells < n ? c->cells : n;
    for (uint32_t i = 0; i < c->cells; i++) {
        uint32_t k = i + hw_rng_below(&rng, n - i), swap = c->chosen[i];
        c->chosen[i] = c->chosen[k];
        c->chosen[k] = swap;
    }
    return HW_OK;
}

static hw_status open_dataset(check *c)
{
    HW_TRY(hw_manifest_read(c->dataset, &c->manifest));
    HW_TRY(hw_scene_import(c->manifest.scene_path, &c->scene));
    if (hw_scene_hash(&c->scene) != c->manifest.scene_hash)
        return hw_fail(HW_FORMAT, "%s: not the scene that %s was built from",
                       c->manifest.scene_path, c->dataset);
    c->grid = c->manifest.grid;
    return hw_rays_create_scene(&c->rays, &c->scene);
}

// With the default cells of a build.
static hw_status open_scene(check *c)
{
    HW_TRY(hw_scene_import(c->scene_path, &c->scene));
    hw_box box = hw_scene_bounds(&c->scene);
    double ground = c->scene.ground.present ? c->scene.ground.rect.min.z : box.min.z;
    c->grid =
        hw_hexgrid_cover(box.min.x, box.min.y, box.max.x, box.max.y, 50, ground + 8, ground + 16);
    HW_TRY(hw_rays_create_scene(&c->rays, &c->scene));
    return hw_occlusion_create(&c->occlusion, &c->scene, c->rays, &c->grid, &c->options);
}

static hw_status run(check *c)
{
    HW_TRY(c->dataset ? open_dataset(c) : open_scene(c));
    HW_TRY(choose_cells(c));
    c->views = (uint32_t)ceil((double)c->views / c->cells);
    HW_TRY(hw_parallel_for(c->cells, 0, check_cell, c, NULL));
    printf("%u views in %u cells with %.1f of %u objects: %u misses (%u pixels or more), %llu "
           "pixels in all\n",
           atomic_load(&c->made), c->cells, (double)atomic_load(&c->recorded) / c->cells,
           c->scene.object_count, atomic_load(&c->misses), c->pixels_min,
           (unsigned long long)atomic_load(&c->lost_pixels));
    if (c->occlusion)
        printf("%.1f ms of a thread for a cell\n",
               (double)atomic_load(&c->query_us) / 1000 / c->cells);
    return HW_OK;
}

static double argument(int argc, char **argv, int i, double fallback)
{
    return i < argc ? strtod(argv[i], NULL) : fallback;
}

int main(int argc, char **argv)
{
    bool broken = argc > 1 && strcmp(argv[argc - 1], "--broken") == 0;
    argc -= broken;
    if (argc < 2 || argc > 7) {
        fprintf(stderr, "Usage: check_occlusion DATASET [VIEWS [CELLS [SEED]]] [--broken]\n"
                        "       check_occlusion SCENE.glb [VIEWS [CELLS [SEED [EYES [MARGIN]]]]] "
                        "[--broken]\n");
        return 2;
    }
    const char *dot = strrchr(argv[1], '.');
    bool is_scene = dot && strcmp(dot, ".glb") == 0;
    hw_occlusion_options o = hw_occlusion_defaults();
    o.eyes = (uint32_t)argument(argc, argv, 5, broken ? 1 : o.eyes);
    o.margin = argument(argc, argv, 6, broken ? 0 : o.margin);
    o.more = broken ? 0 : o.more;
    check c = {.dataset = is_scene ? NULL : argv[1],
               .scene_path = argv[1],
               .options = o,
               .seed = (uint64_t)argument(argc, argv, 4, 1),
               .cells = (uint32_t)fmax(argument(argc, argv, 3, 100), 1),
               .pixels_min = 2,
               .broken = broken};
    c.views = (uint32_t)fmax(argument(argc, argv, 2, 10000), 1); // in all, here
    hw_status status = run(&c);
    if (status != HW_OK)
        fprintf(stderr, "check_occlusion: %s\n", hw_error_text());
    hw_occlusion_destroy(c.occlusion);
    hw_rays_destroy(c.rays);
    hw_free(c.chosen);
    hw_scene_free(&c.scene);
    hw_manifest_free(&c.manifest);
    return status != HW_OK || atomic_load(&c.misses) > 0;
}
