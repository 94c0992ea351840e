#include "surface_distance.h"
#include "alloc.h"
#include "parallel.h"
#include "surface_sampler.h"

#define REPLICATES          HW_DISTANCE_REPLICATES
#define FIRST_ROUND         1024 // samples of a replicate
#define DEFAULT_TOLERANCE   0.005
#define DEFAULT_SAMPLES_MAX (4ull << 20)
#define FLOOR               4e-7
#define VERTEX_BLOCK        4096

typedef struct replicate {
    double sum, sum_squares, max;
} replicate;

typedef struct sampling {
    const hw_surface_sampler *sampler;
    const hw_rays *to;
    uint64_t seed, round, samples; // samples of a replicate in this round
    replicate replicates[REPLICATES];
} sampling;

static hw_status sample_replicate(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    sampling *s = context;
    replicate r = s->replicates[index];
    uint64_t stream = s->round * REPLICATES + index;
    // Seeds far apart, as generators that differ by their stream alone are related.
    hw_rng rng = hw_rng_make(s->seed + 0x9e3779b97f4a7c15ull * (stream + 1), stream);
    hw_surface_walk walk = hw_surface_walk_start(s->sampler, s->samples, rng);
    hw_vec3 point;
    while (hw_surface_walk_next(&walk, &point)) {
        double d = (double)hw_rays_closest(s->to, point, INFINITY).distance;
        r.sum += d;
        r.sum_squares += d * d;
        r.max = fmax(r.max, d);
    }
    s->replicates[index] = r;
    return HW_OK;
}

// What the replicates, of `samples` points each, say together.
static void summarise(const sampling *s, uint64_t samples, hw_surface_distance *out)
{
    double sum = 0, sum_squares = 0, spread = 0;
    for (int i = 0; i < REPLICATES; i++) {
        sum += s->replicates[i].sum;
        sum_squares += s->replicates[i].sum_squares;
        out->max = fmax(out->max, s->replicates[i].max);
    }
    out->samples = samples * REPLICATES;
    out->mean = sum / (double)out->samples;
    out->rms = sqrt(sum_squares / (double)out->samples);
    for (int i = 0; i < REPLICATES; i++) {
        double off = s->replicates[i].sum / (double)samples - out->mean;
        spread += off * off;
    }
    // The points of one stratified sample are not independent, its replicates are.
    out->standard_error = sqrt(spread / (REPLICATES - 1) / REPLICATES);
}

static double largest_coordinate(const hw_mesh *mesh)
{
    hw_box box = hw_mesh_bounds(mesh);
    hw_vec3 v = hw_v3_max(box.max, hw_v3_scale(box.min, -1));
    return (double)fmaxf(v.x, fmaxf(v.y, v.z));
}

static hw_status sample_rounds(sampling *s, const hw_distance_options *options,
                               hw_surface_distance *out)
{
    double tolerance = options->tolerance > 0 ? options->tolerance : DEFAULT_TOLERANCE;
    uint64_t cap = options->samples_max ? options->samples_max : DEFAULT_SAMPLES_MAX;
    cap = cap / REPLICATES + (cap % REPLICATES != 0);
    for (uint64_t done = 0; done < cap && !out->converged; s->round++) {
        uint64_t wanted = done ? done : FIRST_ROUND;
        s->samples = wanted < cap - done ? wanted : cap - done;
        HW_TRY(hw_parallel_for(REPLICATES, options->threads, sample_replicate, s, NULL));
        done += s->samples;
        summarise(s, done, out);
        out->converged = out->standard_error <= tolerance * out->mean || out->mean <= out->floor;
    }
    return HW_OK;
}

static hw_status largest_at_vertices(const hw_mesh *mesh, const hw_rays *to, uint32_t threads,
                                     double *out)
{
    hw_status status = HW_OK;
    float *distances = NULL;
    HW_GO(HW_NEW(&distances, mesh->vertex_count));
    HW_GO(hw_vertex_distances(mesh, to, threads, distances));
    for (uint32_t i = 0; i < mesh->index_count; i++) // only vertices in use
        *out = fmax(*out, (double)distances[mesh->indices[i]]);
out:
    hw_free(distances);
    return status;
}

hw_status hw_surface_distance_measure(const hw_rays *from, const hw_rays *to,
                                      const hw_distance_options *options, hw_surface_distance *out)
{
    hw_status status = HW_OK;
    hw_surface_sampler sampler = {0};
    const hw_distance_options defaults = {0};
    const hw_mesh *mesh = hw_rays_mesh(from), *other = hw_rays_mesh(to);
    options = options ? options : &defaults;
    *out = (hw_surface_distance){0};
    if (mesh->index_count == 0 || other->index_count == 0)
        return hw_fail(HW_USAGE, "%s: no triangle to measure", mesh->name ? mesh->name : "a mesh");
    HW_GO(hw_surface_sampler_make(mesh, &sampler));
    if (!(sampler.area > 0))
        HW_GO(hw_fail(HW_USAGE, "%s: no area to measure", mesh->name ? mesh->name : "a mesh"));
    out->floor = FLOOR * fmax(largest_coordinate(mesh), largest_coordinate(other));
    sampling s = {.sampler = &sampler, .to = to, .seed = options->seed};
    HW_GO(sample_rounds(&s, options, out));
    HW_GO(largest_at_vertices(mesh, to, options->threads, &out->max));
out:
    hw_surface_sampler_free(&sampler);
    return status;
}

typedef struct vertex_job {
    const hw_mesh *mesh;
    const hw_rays *to;
    float *out;
} vertex_job;

static hw_status measure_block(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    const vertex_job *job = context;
    uint64_t first = index * VERTEX_BLOCK, last = first + VERTEX_BLOCK;
    for (uint64_t i = first; i < last && i < job->mesh->vertex_count; i++)
        job->out[i] = hw_rays_closest(job->to, job->mesh->positions[i], INFINITY).distance;
    return HW_OK;
}

hw_status hw_vertex_distances(const hw_mesh *mesh, const hw_rays *to, uint32_t threads, float *out)
{
    vertex_job job = {mesh, to, out};
    uint64_t blocks = ((uint64_t)mesh->vertex_count + VERTEX_BLOCK - 1) / VERTEX_BLOCK;
    return hw_parallel_for(blocks, threads, measure_block, &job, NULL);
}
