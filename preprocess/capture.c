#include "capture.h"
#include "alloc.h"
#include "appearance.h"
#include "atlas.h"
#include "image_io.h"
#include "system.h"
#include <assert.h>

struct hw_capturer {
    const hw_scene *scene;
    const hw_rays *rays;
    const hw_details *details; // may be NULL
    hw_sampler **samplers;     // one per material, NULL if it has no texture
};

hw_status hw_capturer_create(const hw_scene *scene, const hw_rays *scene_rays,
                             const hw_details *details, hw_capturer **out)
{
    hw_status status = HW_OK;
    hw_capturer *capturer = NULL;
    *out = NULL;
    for (uint32_t i = 0; i < scene->mesh_count; i++)
        if (!scene->meshes[i].normals)
            return hw_fail(HW_USAGE, "%s: captures need normals",
                           scene->meshes[i].name ? scene->meshes[i].name : "a mesh");
    HW_GO(HW_NEW(&capturer, 1));
    capturer->scene = scene;
    capturer->rays = scene_rays;
    capturer->details = details;
    HW_GO(HW_NEW(&capturer->samplers, scene->material_count));
    for (uint32_t i = 0; i < scene->material_count; i++)
        if (scene->materials[i].texture.data)
            HW_GO(hw_sampler_create(&capturer->samplers[i], &scene->materials[i].texture));
    *out = capturer;
    capturer = NULL;
out:
    hw_capturer_destroy(capturer);
    return status;
}

void hw_capturer_destroy(hw_capturer *capturer)
{
    if (!capturer)
        return;
    for (uint32_t i = 0; capturer->samplers && i < capturer->scene->material_count; i++)
        hw_sampler_destroy(capturer->samplers[i]);
    hw_free(capturer->samplers);
    hw_free(capturer);
}

const hw_rays *hw_capturer_rays(const hw_capturer *capturer)
{
    return capturer->rays;
}

typedef struct rgb {
    float r, g, b;
} rgb;

// What shading one object takes; one per capture, so `lit` needs no lock.
typedef struct shader {
    const hw_mesh *mesh;
    const hw_sampler *sampler; // NULL without texture or uvs
    float base[3];
    hw_vec3 inverse[3];      // columns of world to mesh: their products with a normal turn it to
                             // the world, by the inverse transpose
    hw_vec3 axis, right, up; // the window's directions in mesh space
    float step_x, step_y;    // plane coordinates that a sample stands for
    // Light x vertex colour x base colour at the corners of the triangle met last: neighbouring
    // samples mostly meet the same one.
    uint32_t lit_triangle;
    rgb lit[3];
} shader;

// The way from the world to the object's own space.
static hw_mat4 to_mesh(const hw_capturer *capturer, uint32_t object_idx)
{
    hw_mat4 inverse; // the rays would not have taken a singular one
    (void)hw_mat4_inverse(capturer->scene->objects[object_idx].transform, &inverse);
    return inverse;
}

// `mesh` is the object's, or stands for it; `inverse` leads to its space. The directions are the
// window's, in the world.
static shader shader_make(const hw_capturer *capturer, uint32_t object_idx, const hw_mesh *mesh,
                          const hw_mat4 *inverse, hw_vec3 axis, hw_vec3 right, hw_vec3 up)
{
    const hw_object *object = &capturer->scene->objects[object_idx];
    shader s = {
        .mesh = mesh,
        .sampler = mesh->uvs ? capturer->samplers[object->material_idx] : NULL,
        .inverse = {hw_mat4_direction(inverse, hw_v3(1, 0, 0)),
                    hw_mat4_direction(inverse, hw_v3(0, 1, 0)),
                    hw_mat4_direction(inverse, hw_v3(0, 0, 1))},
        .axis = hw_mat4_direction(inverse, axis),
        .right = hw_mat4_direction(inverse, right),
        .up = hw_mat4_direction(inverse, up),
        .lit_triangle = UINT32_MAX,
    };
    for (int k = 0; k < 3; k++)
        s.base[k] = capturer->scene->materials[object->material_idx].base_color[k];
    return s;
}

static rgb light_vertex(const shader *s, uint32_t vertex)
{
    hw_vec3 n = s->mesh->normals[vertex];
    n = hw_v3(hw_v3_dot(s->inverse[0], n), hw_v3_dot(s->inverse[1], n),
              hw_v3_dot(s->inverse[2], n));
    float light = hw_light(hw_v3_normalize(n));
    rgb color = {s->base[0] * light, s->base[1] * light, s->base[2] * light};
    if (s->mesh->colors) {
        hw_color8 c = s->mesh->colors[vertex];
        color.r *= (float)c.r / 255;
        color.g *= (float)c.g / 255;
        color.b *= (float)c.b / 255;
    }
    return color;
}

// Derivatives of (u, v) by a sample's share of the window, by the plane of the triangle (Igehy,
// Tracing Ray Differentials, SIGGRAPH 1999).
static void footprint(const shader *s, const uint32_t *t, hw_vec3 direction, float distance,
                      float dx[2], float dy[2])
{
    const hw_vec3 *p = s->mesh->positions;
    const hw_uv *uv = s->mesh->uvs;
    hw_vec3 e1 = hw_v3_sub(p[t[1]], p[t[0]]), e2 = hw_v3_sub(p[t[2]], p[t[0]]);
    hw_vec3 normal = hw_v3_cross(e1, e2);
    float facing = hw_v3_dot(direction, normal), area2 = hw_v3_dot(normal, normal);
    float du1 = uv[t[1]].u - uv[t[0]].u, dv1 = uv[t[1]].v - uv[t[0]].v;
    float du2 = uv[t[2]].u - uv[t[0]].u, dv2 = uv[t[2]].v - uv[t[0]].v;
    hw_vec3 steps[2] = {hw_v3_scale(s->right, s->step_x), hw_v3_scale(s->up, s->step_y)};
    float *out[2] = {dx, dy};
    for (int k = 0; k < 2; k++) {
        // P = o + t d stays in the plane: dP = t (dd - d (dd . n) / (d . n)).
        float along = hw_v3_dot(steps[k], normal) / facing;
        hw_vec3 move = hw_v3_scale(hw_v3_mad(steps[k], direction, -along), distance);
        float b1 = hw_v3_dot(hw_v3_cross(move, e2), normal) / area2;
        float b2 = hw_v3_dot(hw_v3_cross(e1, move), normal) / area2;
        out[k][0] = b1 * du1 + b2 * du2;
        out[k][1] = b1 * dv1 + b2 * dv2;
        if (!isfinite(out[k][0]) || !isfinite(out[k][1])) // seen edge on
            out[k][0] = out[k][1] = 1;
    }
}

static rgb shade(shader *s, const hw_hit *hit, float x, float y)
{
    const uint32_t *t = s->mesh->indices + 3 * (size_t)hit->triangle_idx;
    if (s->lit_triangle != hit->triangle_idx) {
        s->lit_triangle = hit->triangle_idx;
        for (int k = 0; k < 3; k++)
            s->lit[k] = light_vertex(s, t[k]);
    }
    float u = hit->u, v = hit->v, w = 1 - u - v;
    rgb color = {w * s->lit[0].r + u * s->lit[1].r + v * s->lit[2].r,
                 w * s->lit[0].g + u * s->lit[1].g + v * s->lit[2].g,
                 w * s->lit[0].b + u * s->lit[1].b + v * s->lit[2].b};
    if (!s->sampler)
        return color;
    const hw_uv *uv = s->mesh->uvs;
    float dx[2], dy[2], texture[3];
    hw_vec3 direction = hw_v3_mad(hw_v3_mad(s->axis, s->right, x), s->up, y);
    footprint(s, t, direction, hit->t, dx, dy);
    hw_sampler_lookup(s->sampler, w * uv[t[0]].u + u * uv[t[1]].u + v * uv[t[2]].u,
                      w * uv[t[0]].v + u * uv[t[1]].v + v * uv[t[2]].v, dx, dy, texture);
    return (rgb){color.r * texture[0], color.g * texture[1], color.b * texture[2]};
}

static uint8_t to_byte(float value)
{
    return (uint8_t)(fminf(fmaxf(value, 0), 1) * 255 + 0.5f);
}

// What the rays of a texel have met so far.
typedef struct texel_sum {
    rgb color;
    uint16_t cast, covered;
    float nearest, depth; // of the ray next to the texel's centre that met something
} texel_sum;

// Some of the rays of some texels of a row. The rays of a texel lie side by side in `directions`
// and `hits`, so that a packet of rays covers a compact patch.
typedef struct row_job {
    const hw_capture_window *window;
    uint32_t samples;
    float step_x, step_y; // from one sample to the next, plane coordinates
    hw_detail detail;
    hw_vec3 origin; // in its space, as the directions
    bool coherent;
    float centre_distance[HW_CAPTURE_SAMPLES_MAX * HW_CAPTURE_SAMPLES_MAX];
    // The rays of a texel: those that all get, then those of outlines.
    uint32_t first_count, order[HW_CAPTURE_SAMPLES_MAX * HW_CAPTURE_SAMPLES_MAX];
    hw_vec3 *directions;
    hw_hit *hits;
    uint32_t *columns; // of the texels whose rays these are
    texel_sum *sums;   // of the whole window
    shader shader;
} row_job;

static float sample_x(const row_job *job, uint32_t i, uint32_t k)
{
    return job->window->x_min + ((float)(i * job->samples + k % job->samples) + 0.5f) * job->step_x;
}

static float sample_y(const row_job *job, uint32_t j, uint32_t k)
{
    return job->window->y_min + ((float)(j * job->samples + k / job->samples) + 0.5f) * job->step_y;
}

static void add_hit(row_job *job, uint32_t i, uint32_t j, uint32_t k, const hw_hit *hit,
                    texel_sum *sum)
{
    sum->cast++;
    if (hit->t == INFINITY)
        return;
    rgb color = shade(&job->shader, hit, sample_x(job, i, k), sample_y(job, j, k));
    sum->color = (rgb){sum->color.r + color.r, sum->color.g + color.g, sum->color.b + color.b};
    if (sum->covered++ == 0 || job->centre_distance[k] < sum->nearest) {
        sum->nearest = job->centre_distance[k];
        sum->depth = hit->t;
    }
}

// Casts the rays order[first] to order[end - 1] of the first `count` texels in columns.
static void cast_row(row_job *job, uint32_t j, uint32_t count, uint32_t first, uint32_t end)
{
    const shader *s = &job->shader;
    uint32_t n = 0;
    for (uint32_t c = 0; c < count; c++)
        for (uint32_t o = first; o < end; o++)
            job->directions[n++] = hw_v3_mad(
                hw_v3_mad(s->axis, s->right, sample_x(job, job->columns[c], job->order[o])), s->up,
                sample_y(job, j, job->order[o]));
    hw_rays_cast_mesh_many(job->detail.rays, job->detail.mesh_idx, job->origin, job->directions, n,
                           job->coherent, job->hits);
    texel_sum *row = job->sums + (size_t)j * job->window->width;
    const hw_hit *hit = job->hits;
    for (uint32_t c = 0; c < count; c++)
        for (uint32_t o = first; o < end; o++)
            add_hit(job, job->columns[c], j, job->order[o], hit++, &row[job->columns[c]]);
}

// Whether an outline passes through the texel or beside it, as far as the rays so far tell: they
// have not all met something, or all nothing, in it and the eight round it.
static bool is_at_outline(const row_job *job, uint32_t x, uint32_t y)
{
    uint32_t width = job->window->width, height = job->window->height, covered = 0, cast = 0;
    for (uint32_t j = y > 0 ? y - 1 : 0; j < height && j <= y + 1; j++)
        for (uint32_t i = x > 0 ? x - 1 : 0; i < width && i <= x + 1; i++) {
            const texel_sum *s = &job->sums[(size_t)j * width + i];
            covered += s->covered > 0;
            cast += s->covered < s->cast;
        }
    return covered > 0 && cast > 0;
}

static void cast_rays(row_job *job)
{
    uint32_t width = job->window->width, all = job->samples * job->samples;
    for (uint32_t i = 0; i < width; i++)
        job->columns[i] = i;
    for (uint32_t j = 0; j < job->window->height; j++)
        cast_row(job, j, width, 0, job->first_count);
    for (uint32_t j = 0; j < job->window->height && job->first_count < all; j++) {
        uint32_t count = 0;
        for (uint32_t i = 0; i < width; i++)
            if (is_at_outline(job, i, j))
                job->columns[count++] = i;
        cast_row(job, j, count, job->first_count, all);
    }
}

static void resolve_texel(const texel_sum *sum, size_t texel, hw_capture *out)
{
    out->depths[texel] = sum->covered ? sum->depth : INFINITY;
    out->coverage[texel] = (uint8_t)((sum->covered * 255u + sum->cast / 2u) / sum->cast);
    if (sum->covered == 0)
        return;
    float n = (float)sum->covered;
    out->colors[texel] = (hw_color8){to_byte(sum->color.r / n), to_byte(sum->color.g / n),
                                     to_byte(sum->color.b / n), 255};
}

// Four rays tell the colour of a texel within an outline as well as more do; where an outline
// passes, more tell how much is covered. The first four of a grid of 4 x 4 lie in different rows
// and columns.
static void set_up_order(row_job *job)
{
    static const uint8_t four_by_four[16] = {1, 7, 8, 14, 0, 2, 3, 4, 5, 6, 9, 10, 11, 12, 13, 15};
    uint32_t all = job->samples * job->samples;
    job->first_count = job->samples == 4 ? 4 : all;
    for (uint32_t k = 0; k < all; k++)
        job->order[k] = job->samples == 4 ? four_by_four[k] : k;
}

// What the object is cast as.
static hw_detail choose_detail(const hw_capturer *capturer, uint32_t object_idx, double error)
{
    const hw_object *object = &capturer->scene->objects[object_idx];
    if (capturer->details)
        return hw_details_choose(capturer->details, object->mesh_idx,
                                 error / hw_mat4_stretch(&object->transform));
    return (hw_detail){&capturer->scene->meshes[object->mesh_idx], capturer->rays,
                       object->mesh_idx};
}

static hw_status set_up_job(row_job *job, const hw_capturer *capturer, uint32_t object_idx,
                            const hw_capture_window *window, uint32_t samples, double error)
{
    hw_mat4 inverse = to_mesh(capturer, object_idx);
    hw_vec3 axis, right, up;
    *job = (row_job){.window = window,
                     .samples = samples,
                     .detail = choose_detail(capturer, object_idx, error),
                     .origin = hw_mat4_point(&inverse, window->centre)};
    for (uint32_t k = 0; k < samples * samples; k++) {
        // Twice the offset from the centre, in whole steps: exact, so equal ones are equal.
        float x = (float)(2 * (k % samples) + 1) - (float)samples;
        float y = (float)(2 * (k / samples) + 1) - (float)samples;
        job->centre_distance[k] = x * x + y * y;
    }
    set_up_order(job);
    hw_face_basis(window->face, &axis, &right, &up);
    job->shader = shader_make(capturer, object_idx, job->detail.mesh, &inverse, axis, right, up);
    job->step_x = (window->x_max - window->x_min) / (float)(window->width * samples);
    job->step_y = (window->y_max - window->y_min) / (float)(window->height * samples);
    // The rays that a texel has at least fill it.
    float fill = (float)samples / sqrtf((float)job->first_count);
    job->shader.step_x = job->step_x * fill;
    job->shader.step_y = job->step_y * fill;
    size_t rays = (size_t)window->width * samples * samples;
    // Measured: coherent traversal wins as soon as there are a few rays per visible triangle.
    job->coherent = rays * window->height > job->shader.mesh->index_count / 3 / 4;
    HW_TRY(HW_NEW(&job->directions, rays));
    HW_TRY(HW_NEW(&job->hits, rays));
    HW_TRY(HW_NEW(&job->columns, window->width));
    return HW_NEW(&job->sums, (size_t)window->width * window->height);
}

bool hw_capture_point(const hw_capturer *capturer, uint32_t object_idx, hw_vec3 origin,
                      hw_vec3 direction, hw_color8 *out)
{
    hw_hit hit = hw_rays_cast_object(capturer->rays, object_idx, origin, direction, 0, 1);
    if (hit.t == INFINITY)
        return false;
    const hw_mesh *mesh = &capturer->scene->meshes[capturer->scene->objects[object_idx].mesh_idx];
    hw_mat4 inverse = to_mesh(capturer, object_idx);
    shader s = shader_make(capturer, object_idx, mesh, &inverse, direction, hw_v3(0, 0, 0),
                           hw_v3(0, 0, 0));
    rgb color = shade(&s, &hit, 0, 0);
    *out = (hw_color8){to_byte(color.r), to_byte(color.g), to_byte(color.b), 255};
    return true;
}

#define SIDE_MAX 32768

static _Thread_local double thread_ms;

double hw_capture_thread_seconds(void)
{
    return thread_ms / 1000;
}

hw_status hw_capture_object(const hw_capturer *capturer, uint32_t object_idx,
                            const hw_capture_window *window, uint32_t samples, double error,
                            hw_capture *out)
{
    hw_status status = HW_OK;
    row_job job = {0};
    bool pinned = false;
    double start = hw_clock_ms();
    *out = (hw_capture){0};
    assert(object_idx < capturer->scene->object_count);
    assert(samples >= 1 && samples <= HW_CAPTURE_SAMPLES_MAX);
    if (window->width == 0 || window->height == 0 || window->width > SIDE_MAX ||
        window->height > SIDE_MAX || !(window->x_max > window->x_min) ||
        !(window->y_max > window->y_min))
        return hw_fail(HW_USAGE, "object %u: an empty or oversized capture window of %u x %u",
                       object_idx, window->width, window->height);
    HW_GO(set_up_job(&job, capturer, object_idx, window, samples, error));
    out->width = window->width;
    out->height = window->height;
    HW_GO(HW_NEW(&out->colors, (size_t)out->width * out->height));
    HW_GO(HW_NEW(&out->coverage, (size_t)out->width * out->height));
    HW_GO(HW_NEW(&out->depths, (size_t)out->width * out->height));
    HW_GO(hw_rays_pin(job.detail.rays, job.detail.mesh_idx));
    pinned = true;
    cast_rays(&job);
    for (size_t texel = 0; texel < (size_t)out->width * out->height; texel++)
        resolve_texel(&job.sums[texel], texel, out);
out:
    if (pinned)
        hw_rays_unpin(job.detail.rays, job.detail.mesh_idx);
    hw_free(job.directions);
    hw_free(job.hits);
    hw_free(job.columns);
    hw_free(job.sums);
    if (status != HW_OK)
        hw_capture_free(out);
    thread_ms += hw_clock_ms() - start;
    return status;
}

// The texels of a window that an object's box covers, with one more on each side; all if it
// reaches behind the window's eye.
static hw_rect covered_texels(const hw_capture_window *w, hw_box box)
{
    hw_vec3 axis, right, up;
    hw_face_basis(w->face, &axis, &right, &up);
    float low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (uint32_t i = 0; i < 8; i++) {
        hw_vec3 rel = hw_v3_sub(hw_box_corner(box, i), w->centre);
        float depth = hw_v3_dot(rel, axis);
        if (!(depth > 1e-3f))
            return (hw_rect){0, 0, w->width, w->height};
        float x = (hw_v3_dot(rel, right) / depth - w->x_min) / (w->x_max - w->x_min);
        float y = (hw_v3_dot(rel, up) / depth - w->y_min) / (w->y_max - w->y_min);
        const float p[2] = {x * (float)w->width, y * (float)w->height};
        for (int k = 0; k < 2; k++) {
            low[k] = fminf(low[k], p[k]);
            high[k] = fmaxf(high[k], p[k]);
        }
    }
    uint32_t x0 = (uint32_t)fminf(fmaxf(low[0] - 1, 0), (float)w->width);
    uint32_t y0 = (uint32_t)fminf(fmaxf(low[1] - 1, 0), (float)w->height);
    uint32_t x1 = (uint32_t)fminf(fmaxf(high[0] + 2, 0), (float)w->width);
    uint32_t y1 = (uint32_t)fminf(fmaxf(high[1] + 2, 0), (float)w->height);
    return (hw_rect){x0, y0, x1 > x0 ? x1 - x0 : 0, y1 > y0 ? y1 - y0 : 0};
}

static hw_capture_window part_of(const hw_capture_window *w, const hw_rect *r)
{
    float step_x = (w->x_max - w->x_min) / (float)w->width;
    float step_y = (w->y_max - w->y_min) / (float)w->height;
    hw_capture_window part = *w;
    part.x_min = w->x_min + (float)r->x * step_x;
    part.x_max = w->x_min + (float)(r->x + r->width) * step_x;
    part.y_min = w->y_min + (float)r->y * step_y;
    part.y_max = w->y_min + (float)(r->y + r->height) * step_y;
    part.width = r->width;
    part.height = r->height;
    return part;
}

// Puts what lies nearer of a part into the whole.
static void put_nearer(const hw_capture *part, const hw_rect *r, hw_capture *whole)
{
    for (uint32_t y = 0; y < r->height; y++)
        for (uint32_t x = 0; x < r->width; x++) {
            size_t from = (size_t)y * r->width + x;
            size_t to = (size_t)(r->y + y) * whole->width + r->x + x;
            if (part->colors[from].a == 0 ||
                (whole->colors[to].a != 0 && whole->depths[to] <= part->depths[from]))
                continue;
            whole->colors[to] = part->colors[from];
            whole->depths[to] = part->depths[from];
        }
}

hw_status hw_capture_objects(const hw_capturer *capturer, const uint32_t *objects, uint32_t count,
                             const hw_capture_window *window, uint32_t samples, double error,
                             hw_capture *out)
{
    hw_status status = HW_OK;
    hw_capture part = {0};
    *out = (hw_capture){.width = window->width, .height = window->height};
    HW_GO(HW_NEW(&out->colors, (size_t)out->width * out->height));
    HW_GO(HW_NEW(&out->depths, (size_t)out->width * out->height));
    for (size_t i = 0; i < (size_t)out->width * out->height; i++)
        out->depths[i] = INFINITY;
    for (uint32_t i = 0; i < count; i++) {
        hw_rect r = covered_texels(window, capturer->scene->objects[objects[i]].bounds);
        if (r.width == 0 || r.height == 0)
            continue;
        hw_capture_window w = part_of(window, &r);
        HW_GO(hw_capture_object(capturer, objects[i], &w, samples, error, &part));
        put_nearer(&part, &r, out);
        hw_capture_free(&part);
    }
out:
    hw_capture_free(&part);
    if (status != HW_OK)
        hw_capture_free(out);
    return status;
}

// A texel filled by step k of the dilation carries a = k meanwhile; before `step` these are filled.
static bool is_filled(hw_color8 color, uint32_t step)
{
    return color.a == 255 || (color.a > 0 && color.a < step);
}

static void fill_texel(hw_capture *capture, uint32_t x, uint32_t y, uint32_t step)
{
    uint32_t r = 0, g = 0, b = 0, n = 0;
    uint32_t x_last = x + 1 < capture->width ? x + 1 : x;
    uint32_t y_last = y + 1 < capture->height ? y + 1 : y;
    for (uint32_t j = y > 0 ? y - 1 : 0; j <= y_last; j++)
        for (uint32_t i = x > 0 ? x - 1 : 0; i <= x_last; i++) {
            hw_color8 c = capture->colors[(size_t)j * capture->width + i];
            if (!is_filled(c, step))
                continue;
            r += c.r;
            g += c.g;
            b += c.b;
            n++;
        }
    if (n > 0)
        capture->colors[(size_t)y * capture->width + x] =
            (hw_color8){(uint8_t)((r + n / 2) / n), (uint8_t)((g + n / 2) / n),
                        (uint8_t)((b + n / 2) / n), (uint8_t)step};
}

void hw_capture_dilate(hw_capture *capture, uint32_t texels)
{
    uint32_t steps = texels < 254 ? texels : 254;
    size_t count = (size_t)capture->width * capture->height;
    for (uint32_t step = 1; step <= steps; step++)
        for (uint32_t y = 0; y < capture->height; y++)
            for (uint32_t x = 0; x < capture->width; x++)
                if (capture->colors[(size_t)y * capture->width + x].a == 0)
                    fill_texel(capture, x, y, step);
    for (size_t i = 0; i < count; i++)
        if (capture->colors[i].a != 255)
            capture->colors[i].a = 0;
}

void hw_capture_window_texel(const hw_capture_window *w, const double plane[2], double texel[2])
{
    double low[2] = {(double)w->x_min, (double)w->y_min};
    double step[2] = {((double)w->x_max - low[0]) / w->width,
                      ((double)w->y_max - low[1]) / w->height};
    for (int k = 0; k < 2; k++)
        texel[k] = (plane[k] - low[k]) / step[k];
}

void hw_capture_free(hw_capture *capture)
{
    if (!capture)
        return;
    hw_free(capture->colors);
    hw_free(capture->coverage);
    hw_free(capture->depths);
    *capture = (hw_capture){0};
}
