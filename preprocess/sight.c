#include "sight.h"
#include "alloc.h"
#include "inner_boxes.h"
#include "parallel.h"

struct hw_sights {
    const hw_scene *scene;
    const hw_rays *rays;
    bool *solid; // per mesh: closed and turned outward
    bool all_solid;
    hw_mesh inside;  // boxes inside solid objects, world space
    hw_rays *blocks; // of `inside`; NULL if there is none
};

// ---- the scene -------------------------------------------------------------------------------

typedef struct study {
    hw_sights *sights;
    hw_inner_boxes *insides; // per mesh
} study;

static hw_status study_mesh(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    study *s = context;
    const hw_mesh *mesh = &s->sights->scene->meshes[index];
    bool *solid = &s->sights->solid[index];
    HW_TRY(hw_mesh_is_solid(mesh, solid));
    if (!*solid)
        return HW_OK;
    return hw_inner_boxes_find(mesh, &s->insides[index]);
}

static void add_box(hw_mesh *mesh, const hw_mat4 *transform, hw_box box)
{
    // Corner i has bit k for the upper end along axis k.
    static const uint8_t faces[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6},
                                         {0, 1, 4}, {1, 5, 4}, {2, 6, 3}, {3, 6, 7},
                                         {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    for (uint32_t i = 0; i < 36; i++)
        mesh->indices[mesh->index_count++] = mesh->vertex_count + faces[i / 3][i % 3];
    for (uint32_t i = 0; i < 8; i++)
        mesh->positions[mesh->vertex_count++] = hw_mat4_point(transform, hw_box_corner(box, i));
}

static hw_status make_blocks(hw_sights *o, const hw_inner_boxes *insides)
{
    size_t count = 0;
    for (uint32_t i = 0; i < o->scene->object_count; i++)
        count += insides[o->scene->objects[i].mesh_idx].count;
    if (count == 0)
        return HW_OK;
    HW_TRY(HW_NEW(&o->inside.positions, 8 * count));
    HW_TRY(HW_NEW(&o->inside.indices, 36 * count));
    for (uint32_t i = 0; i < o->scene->object_count; i++) {
        const hw_object *object = &o->scene->objects[i];
        for (uint32_t k = 0; k < insides[object->mesh_idx].count; k++)
            add_box(&o->inside, &object->transform, insides[object->mesh_idx].boxes[k]);
    }
    return hw_rays_create_mesh(&o->blocks, &o->inside);
}

static hw_status study_scene(hw_sights *o)
{
    hw_status status = HW_OK;
    study s = {o, NULL};
    HW_GO(HW_NEW(&o->solid, o->scene->mesh_count));
    HW_GO(HW_NEW(&s.insides, o->scene->mesh_count));
    HW_GO(hw_parallel_for(o->scene->mesh_count, 0, study_mesh, &s, NULL));
    o->all_solid = true;
    for (uint32_t i = 0; i < o->scene->mesh_count; i++)
        o->all_solid &= o->solid[i];
    HW_GO(make_blocks(o, s.insides));
out:
    hw_free(s.insides);
    return status;
}

hw_status hw_sights_create(hw_sights **out, const hw_scene *scene, const hw_rays *rays)
{
    hw_status status = HW_OK;
    hw_sights *o = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&o, 1));
    o->scene = scene;
    o->rays = rays;
    HW_GO(study_scene(o));
    *out = o;
    o = NULL;
out:
    hw_sights_destroy(o);
    return status;
}

void hw_sights_destroy(hw_sights *sights)
{
    if (!sights)
        return;
    hw_free(sights->solid);
    hw_rays_destroy(sights->blocks);
    hw_mesh_free(&sights->inside);
    hw_free(sights);
}

// ---- rays ------------------------------------------------------------------------------------

float hw_box_entry(hw_vec3 origin, hw_vec3 direction, hw_box box)
{
    const float o[3] = {origin.x, origin.y, origin.z};
    const float d[3] = {direction.x, direction.y, direction.z};
    const float low[3] = {box.min.x, box.min.y, box.min.z};
    const float high[3] = {box.max.x, box.max.y, box.max.z};
    float from = 0, to = INFINITY;
    for (int k = 0; k < 3; k++) {
        float inverse = 1 / (fabsf(d[k]) > 1e-12f ? d[k] : 1e-12f);
        float a = (low[k] - o[k]) * inverse, b = (high[k] - o[k]) * inverse;
        from = fmaxf(from, fminf(a, b));
        to = fminf(to, fmaxf(a, b));
    }
    return from <= to ? from : INFINITY;
}

void hw_sights_look(const hw_sights *o, hw_vec3 eye, hw_box box, const bool *hiders,
                    const hw_vec3 *points, uint32_t count, hw_sight *sights)
{
    hw_vec3 directions[HW_RAYS_PACKET];
    float t_max[HW_RAYS_PACKET];
    uint32_t place[HW_RAYS_PACKET], left = 0;
    bool blocked[HW_RAYS_PACKET] = {false};
    for (uint32_t i = 0; i < count; i++) {
        directions[i] = hw_v3_sub(points[i], eye);
        t_max[i] = fminf(hw_box_entry(eye, directions[i], box) * 0.9999f, 1);
    }
    if (o->blocks && !hiders)
        hw_rays_occluded_many(o->blocks, eye, directions, t_max, count, NULL, blocked);
    for (uint32_t i = 0; i < count; i++) {
        sights[i] = HW_SIGHT_HIDDEN;
        directions[left] = directions[i];
        t_max[left] = t_max[i];
        place[left] = i;
        left += !blocked[i];
    }
    if (left == 0)
        return;
    const hw_rays_hiders what = {o->all_solid ? NULL : o->solid, hiders};
    hw_rays_occluded_many(o->rays, eye, directions, t_max, left, &what, blocked);
    for (uint32_t i = 0; i < left; i++)
        sights[place[i]] = blocked[i] ? HW_SIGHT_WEAK : HW_SIGHT_FREE;
}
