#include "views.h"
#include "alloc.h"
#include "appearance.h"
#include "parallel.h"

#define SIZE    HW_VIEW_SIZE
#define TILE    4 // a packet of rays is a tile of 4 x 4 pixels
#define MARGIN  (1.0f / 32)
#define PIXELS  ((size_t)SIZE * SIZE)
#define NOTHING (-1.0f) // the intensity of a pixel that is not covered

typedef struct camera {
    hw_vec3 right, up, back; // back points to the viewer
} camera;

struct hw_views {
    hw_view_frame frame;
    camera cameras[HW_VIEW_COUNT];
    float *pictures; // HW_VIEW_COUNT * PIXELS
};

void hw_view_directions(hw_vec3 out[HW_VIEW_COUNT])
{
    const float golden = 1.6180340f;
    const float edge2 = 4; // squared edge length of this icosahedron; other pairs are farther apart
    uint32_t count = 0;
    hw_vec3 corners[12];
    for (int axis = 0; axis < 3; axis++)
        for (int sign = 0; sign < 4; sign++) {
            float a = sign & 1 ? -1 : 1, b = sign & 2 ? -golden : golden;
            corners[count++] = axis == 0   ? hw_v3(0, a, b)
                               : axis == 1 ? hw_v3(b, 0, a)
                                           : hw_v3(a, b, 0);
        }
    for (uint32_t i = 0; i < 12; i++)
        out[i] = hw_v3_normalize(corners[i]);
    for (uint32_t i = 0; i < 12; i++)
        for (uint32_t j = i + 1; j < 12; j++) {
            hw_vec3 between = hw_v3_sub(corners[i], corners[j]);
            if (hw_v3_dot(between, between) < edge2 * 1.5f)
                out[count++] = hw_v3_normalize(hw_v3_add(corners[i], corners[j]));
        }
}

static float farthest_vertex(const hw_mesh *mesh, hw_vec3 centre)
{
    float farthest = 0;
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        farthest = fmaxf(farthest, hw_v3_length(hw_v3_sub(mesh->positions[i], centre)));
    return farthest;
}

hw_view_frame hw_view_frame_fit(const hw_mesh *original, const hw_mesh *other)
{
    hw_view_frame frame = {hw_box_centre(hw_mesh_bounds(original)), 0};
    frame.half_side = farthest_vertex(original, frame.centre) * (1 + MARGIN);
    if (other)
        frame.half_side = fmaxf(frame.half_side, farthest_vertex(other, frame.centre));
    return frame;
}

static camera look_along(hw_vec3 back)
{
    // World up is up in the picture; for a view from straight above or below it is y.
    hw_vec3 world_up = fabsf(back.z) > 0.999f ? hw_v3(0, 1, 0) : hw_v3(0, 0, 1);
    camera c = {.back = back};
    c.right = hw_v3_normalize(hw_v3_cross(world_up, back));
    c.up = hw_v3_cross(back, c.right);
    return c;
}

// --- Rendering -----------------------------------------------------------------------------------

// A mesh on its way to pictures.
typedef struct subject {
    const hw_rays *rays;
    const hw_mesh *mesh;
    hw_mesh shaded; // the mesh's positions and indices, borrowed, with normals of its own
} subject;

static hw_status make_subject(const hw_rays *rays, subject *out)
{
    const hw_mesh *mesh = hw_rays_mesh(rays);
    *out = (subject){.rays = rays, .mesh = mesh};
    if (mesh->index_count == 0)
        return hw_fail(HW_USAGE, "%s: no triangle to look at", mesh->name ? mesh->name : "a mesh");
    out->shaded = (hw_mesh){.vertex_count = mesh->vertex_count,
                            .index_count = mesh->index_count,
                            .positions = mesh->positions,
                            .indices = mesh->indices};
    return hw_mesh_compute_normals(&out->shaded);
}

static void free_subject(subject *s)
{
    hw_free(s->shaded.normals);
}

// Tiles [x0, x1) x [y0, y1) of a picture.
typedef struct tile_range {
    int x0, x1, y0, y1;
} tile_range;

static int tile_of(float pixel)
{
    return pixel <= 0 ? 0 : pixel >= SIZE - 1 ? SIZE / TILE - 1 : (int)pixel / TILE;
}

// The tiles that the mesh can be in: no ray needs to be cast elsewhere.
static tile_range covered_tiles(const subject *s, const camera *c, hw_view_frame frame)
{
    float x_min = INFINITY, x_max = -INFINITY, y_min = INFINITY, y_max = -INFINITY;
    for (uint32_t i = 0; i < s->mesh->vertex_count; i++) {
        hw_vec3 p = hw_v3_sub(s->mesh->positions[i], frame.centre);
        float x = hw_v3_dot(p, c->right), y = -hw_v3_dot(p, c->up);
        x_min = fminf(x_min, x);
        x_max = fmaxf(x_max, x);
        y_min = fminf(y_min, y);
        y_max = fmaxf(y_max, y);
    }
    float scale = SIZE / (2 * frame.half_side), middle = SIZE / 2;
    // A pixel more on each side, against rounding.
    return (tile_range){
        tile_of(x_min * scale + middle - 1), tile_of(x_max * scale + middle + 1) + 1,
        tile_of(y_min * scale + middle - 1), tile_of(y_max * scale + middle + 1) + 1};
}

static float shade(const subject *s, const hw_hit *hit, hw_vec3 back)
{
    const uint32_t *t = s->mesh->indices + 3 * (size_t)hit->triangle_idx;
    const hw_vec3 *normals = s->shaded.normals;
    hw_vec3 n = hw_v3_scale(normals[t[0]], 1 - hit->u - hit->v);
    n = hw_v3_normalize(hw_v3_mad(hw_v3_mad(n, normals[t[1]], hit->u), normals[t[2]], hit->v));
    float facing = fminf(fabsf(hw_v3_dot(n, back)), 1);
    return HW_LIGHT_AMBIENT + HW_LIGHT_DIRECTIONAL * facing;
}

static void render_tile(const subject *s, const camera *c, hw_view_frame frame, int tile_x,
                        int tile_y, float out[TILE * TILE])
{
    hw_vec3 origins[TILE * TILE];
    hw_hit hits[TILE * TILE];
    hw_vec3 start = hw_v3_mad(frame.centre, c->back, 1.01f * frame.half_side);
    float pixel = 2 * frame.half_side / SIZE;
    for (int i = 0; i < TILE * TILE; i++) {
        float x = (float)(tile_x * TILE + i % TILE) + 0.5f - SIZE / 2;
        float y = (float)(tile_y * TILE + i / TILE) + 0.5f - SIZE / 2;
        origins[i] = hw_v3_mad(hw_v3_mad(start, c->right, x * pixel), c->up, -y * pixel);
    }
    hw_rays_cast_parallel(s->rays, origins, hw_v3_scale(c->back, -1), TILE * TILE, hits);
    for (int i = 0; i < TILE * TILE; i++)
        out[i] = isinf(hits[i].t) ? NOTHING : shade(s, &hits[i], c->back);
}

typedef struct render_job {
    hw_views *views;
    const subject *subject;
} render_job;

static hw_status render_view(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    const render_job *job = context;
    hw_views *views = job->views;
    const camera *c = &views->cameras[index];
    float *picture = views->pictures + index * PIXELS, tile[TILE * TILE];
    tile_range range = covered_tiles(job->subject, c, views->frame);
    for (size_t i = 0; i < PIXELS; i++)
        picture[i] = NOTHING;
    for (int y = range.y0; y < range.y1; y++)
        for (int x = range.x0; x < range.x1; x++) {
            render_tile(job->subject, c, views->frame, x, y, tile);
            for (int i = 0; i < TILE * TILE; i++)
                picture[(y * TILE + i / TILE) * SIZE + x * TILE + i % TILE] = tile[i];
        }
    return HW_OK;
}

hw_status hw_views_create(hw_views **out, const hw_rays *original, hw_view_frame frame,
                          uint32_t threads)
{
    hw_status status = HW_OK;
    hw_views *views = NULL;
    subject model = {0};
    hw_vec3 directions[HW_VIEW_COUNT];
    *out = NULL;
    HW_GO(make_subject(original, &model));
    if (!(frame.half_side > 0) || !isfinite(frame.half_side))
        HW_GO(hw_fail(HW_USAGE, "%s: no extent to look at",
                      model.mesh->name ? model.mesh->name : "a mesh"));
    HW_GO(HW_NEW(&views, 1));
    HW_GO(HW_NEW(&views->pictures, HW_VIEW_COUNT * PIXELS));
    views->frame = frame;
    hw_view_directions(directions);
    for (int i = 0; i < HW_VIEW_COUNT; i++)
        views->cameras[i] = look_along(directions[i]);
    render_job job = {views, &model};
    HW_GO(hw_parallel_for(HW_VIEW_COUNT, threads, render_view, &job, NULL));
    *out = views;
    views = NULL;
out:
    free_subject(&model);
    hw_views_destroy(views);
    return status;
}

void hw_views_destroy(hw_views *views)
{
    if (!views)
        return;
    hw_free(views->pictures);
    hw_free(views);
}

const float *hw_views_picture(const hw_views *views, uint32_t view)
{
    return views->pictures + view * PIXELS;
}

// --- Comparing -----------------------------------------------------------------------------------

typedef struct view_sums {
    double absolute, squares;
    uint64_t model, either; // pixels that the original covers, that only one covers
} view_sums;

typedef struct compare_job {
    const hw_views *views;
    const subject *subject;
    view_sums sums[HW_VIEW_COUNT];
} compare_job;

static void add_pixel(view_sums *sums, float original, float other)
{
    double difference = (double)fmaxf(original, 0) - (double)fmaxf(other, 0); // black background
    sums->absolute += fabs(difference);
    sums->squares += difference * difference;
    sums->model += original >= 0;
    sums->either += (original >= 0) != (other >= 0);
}

static hw_status compare_view(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    compare_job *job = context;
    const hw_views *views = job->views;
    const camera *c = &views->cameras[index];
    const float *picture = hw_views_picture(views, (uint32_t)index);
    tile_range range = covered_tiles(job->subject, c, views->frame);
    view_sums sums = {0};
    for (int y = 0; y < SIZE / TILE; y++)
        for (int x = 0; x < SIZE / TILE; x++) {
            bool inside = x >= range.x0 && x < range.x1 && y >= range.y0 && y < range.y1;
            float tile[TILE * TILE];
            if (inside)
                render_tile(job->subject, c, views->frame, x, y, tile);
            for (int i = 0; i < TILE * TILE; i++)
                add_pixel(&sums, picture[(y * TILE + i / TILE) * SIZE + x * TILE + i % TILE],
                          inside ? tile[i] : NOTHING);
        }
    job->sums[index] = sums;
    return HW_OK;
}

static void average(const view_sums *sums, hw_view_errors *out)
{
    double views_used = 0, model = 0, either = 0;
    for (int i = 0; i < HW_VIEW_COUNT; i++) {
        double pixels = (double)sums[i].model;
        model += pixels;
        either += (double)sums[i].either;
        if (sums[i].model == 0)
            continue;
        views_used++;
        out->l1 += sums[i].absolute / pixels;
        out->l2 += sqrt(sums[i].squares / pixels);
    }
    out->l1 /= views_used;
    out->l2 /= views_used;
    out->silhouette = either / HW_VIEW_COUNT;
    out->silhouette_share = either / model;
    out->model_pixels = model / HW_VIEW_COUNT;
}

hw_status hw_views_compare(const hw_views *views, const hw_rays *other, uint32_t threads,
                           hw_view_errors *out)
{
    hw_status status = HW_OK;
    compare_job job = {.views = views};
    subject model = {0};
    *out = (hw_view_errors){0};
    HW_GO(make_subject(other, &model));
    if (!(farthest_vertex(model.mesh, views->frame.centre) <= views->frame.half_side))
        HW_GO(hw_fail(HW_USAGE, "%s: does not fit into the pictures",
                      model.mesh->name ? model.mesh->name : "a mesh"));
    job.subject = &model;
    HW_GO(hw_parallel_for(HW_VIEW_COUNT, threads, compare_view, &job, NULL));
    average(job.sums, out);
out:
    free_subject(&model);
    return status;
}
