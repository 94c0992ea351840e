#include "measures.h"
#include "alloc.h"
#include <stdlib.h>

// Southern et al. 2001, 4.2.1, K_sliver.
hw_sliver hw_mesh_sliver(const hw_mesh *mesh)
{
    hw_sliver sliver = {0};
    double sum = 0;
    uint32_t count = 0;
    for (uint32_t i = 0; i + 2 < mesh->index_count; i += 3) {
        double total = 0, shortest = INFINITY;
        for (uint32_t k = 0; k < 3; k++) {
            hw_vec3 p = mesh->positions[mesh->indices[i + k]];
            hw_vec3 q = mesh->positions[mesh->indices[i + (k + 1) % 3]];
            double x = (double)p.x - q.x, y = (double)p.y - q.y, z = (double)p.z - q.z;
            double length = sqrt(x * x + y * y + z * z);
            total += length;
            shortest = fmin(shortest, length);
        }
        if (shortest > 0) {
            sum += total / (3 * shortest);
            count++;
        } else {
            sliver.degenerate++;
        }
    }
    sliver.ratio = sum / count;
    return sliver;
}

// An edge's ends, the smaller index first; how triangles pass it: +1 from it, -1 towards it.
typedef struct passage {
    uint32_t low, high;
    int32_t direction;
} passage;

static int by_edge(const void *x, const void *y)
{
    const passage *a = x, *b = y;
    if (a->low != b->low)
        return a->low < b->low ? -1 : 1;
    return a->high < b->high ? -1 : a->high > b->high;
}

static uint64_t count_unbalanced(passage *passages, size_t count)
{
    uint64_t open = 0;
    qsort(passages, count, sizeof *passages, by_edge);
    for (size_t i = 0; i < count;) {
        size_t first = i;
        int64_t balance = 0;
        for (; i < count && by_edge(&passages[first], &passages[i]) == 0; i++)
            balance += passages[i].direction;
        open += balance != 0;
    }
    return open;
}

hw_status hw_mesh_open_edges(const hw_mesh *mesh, uint64_t *out)
{
    hw_status status = HW_OK;
    uint32_t *welded = NULL;
    passage *passages = NULL;
    size_t count = 0;
    *out = 0;
    HW_GO(HW_NEW(&welded, mesh->vertex_count));
    HW_GO(HW_NEW(&passages, mesh->index_count));
    HW_GO(hw_mesh_weld_map(mesh, welded));
    for (uint32_t i = 0; i < mesh->index_count; i++) {
        uint32_t p = welded[mesh->indices[i]];
        uint32_t q = welded[mesh->indices[i % 3 == 2 ? i - 2 : i + 1]];
        if (p != q)
            passages[count++] = p < q ? (passage){p, q, 1} : (passage){q, p, -1};
    }
    *out = count_unbalanced(passages, count);
out:
    hw_free(welded);
    hw_free(passages);
    return status;
}

// Southern et al. 2001, 4.2.1, K_vol.
static hw_status measure_volumes(const hw_mesh *a, const hw_mesh *b, hw_measures *out)
{
    HW_TRY(hw_mesh_open_edges(a, &out->open_edges[0]));
    HW_TRY(hw_mesh_open_edges(b, &out->open_edges[1]));
    out->volume[0] = hw_mesh_volume(a);
    out->volume[1] = hw_mesh_volume(b);
    // A sheet with two sides has but the volume of its rounding.
    bool solid = fabs(out->volume[0]) > 1e-12 * pow(out->diagonal, 3);
    out->volume_ratio = solid ? out->volume[1] / out->volume[0] : NAN;
    return HW_OK;
}

static hw_status measure_views(const hw_rays *a, const hw_rays *b, uint32_t threads,
                               hw_measures *out)
{
    hw_views *views = NULL;
    hw_view_frame frame = hw_view_frame_fit(hw_rays_mesh(a), hw_rays_mesh(b));
    HW_TRY(hw_views_create(&views, a, frame, threads));
    hw_status status = hw_views_compare(views, b, threads, &out->views);
    out->pixel = 2 * (double)frame.half_side / HW_VIEW_SIZE;
    hw_views_destroy(views);
    return status;
}

hw_status hw_measures_take(const hw_rays *a, const hw_rays *b, const hw_measures_options *options,
                           hw_measures *out)
{
    const hw_measures_options defaults = {0};
    options = options ? options : &defaults;
    const hw_mesh *original = hw_rays_mesh(a), *other = hw_rays_mesh(b);
    *out = (hw_measures){.diagonal = (double)hw_box_diagonal(hw_mesh_bounds(original)),
                         .views = {NAN, NAN, NAN, NAN, NAN},
                         .pixel = NAN};
    hw_distance_options back = options->distance;
    back.seed = ~back.seed; // equal meshes are not sampled at the same points
    HW_TRY(hw_surface_distance_measure(a, b, &options->distance, &out->forward));
    HW_TRY(hw_surface_distance_measure(b, a, &back, &out->backward));
    HW_TRY(measure_volumes(original, other, out));
    out->sliver[0] = hw_mesh_sliver(original);
    out->sliver[1] = hw_mesh_sliver(other);
    return options->no_images ? HW_OK : measure_views(a, b, options->distance.threads, out);
}
