#include "scene.h"
#include "hash.h"
#include <stddef.h>

void hw_scene_free(hw_scene *scene)
{
    if (!scene)
        return;
    for (uint32_t i = 0; i < scene->mesh_count; i++)
        hw_mesh_free(&scene->meshes[i]);
    for (uint32_t i = 0; i < scene->material_count; i++) {
        hw_free(scene->materials[i].name);
        hw_image_free(&scene->materials[i].texture);
    }
    hw_free(scene->path);
    hw_free(scene->meshes);
    hw_free(scene->materials);
    hw_free(scene->objects);
    *scene = (hw_scene){0};
}

static hw_box transformed_bounds(const hw_mesh *mesh, const hw_mat4 *transform)
{
    hw_box box = hw_box_empty();
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        hw_box_add(&box, hw_mat4_point(transform, mesh->positions[i]));
    return box;
}

void hw_scene_update_bounds(hw_scene *scene)
{
    for (uint32_t i = 0; i < scene->object_count; i++) {
        hw_object *object = &scene->objects[i];
        object->bounds = transformed_bounds(&scene->meshes[object->mesh_idx], &object->transform);
    }
}

hw_box hw_scene_bounds(const hw_scene *scene)
{
    hw_box box = hw_box_empty();
    for (uint32_t i = 0; i < scene->object_count; i++)
        box = hw_box_union(box, scene->objects[i].bounds);
    return box;
}

uint64_t hw_scene_triangle_count(const hw_scene *scene)
{
    uint64_t count = 0;
    for (uint32_t i = 0; i < scene->object_count; i++)
        count += scene->meshes[scene->objects[i].mesh_idx].index_count / 3;
    return count;
}

static uint64_t hash_image(uint64_t h, const hw_image *image)
{
    uint32_t shape[3] = {image->width, image->height, image->channels};
    if (!image->data)
        return hw_hash(h, "none", 4);
    h = hw_hash(h, shape, sizeof shape);
    return hw_hash(h, image->data, (size_t)image->width * image->height * image->channels);
}

// Fields one by one: the bytes between them are nobody's.
uint64_t hw_scene_hash(const hw_scene *scene)
{
    uint32_t counts[3] = {scene->mesh_count, scene->material_count, scene->object_count};
    uint64_t h = hw_hash(0, counts, sizeof counts);
    for (uint32_t i = 0; i < scene->mesh_count; i++) {
        uint64_t mesh = hw_mesh_hash(&scene->meshes[i]);
        h = hw_hash(h, &mesh, sizeof mesh);
    }
    for (uint32_t i = 0; i < scene->material_count; i++) {
        h = hw_hash(h, scene->materials[i].base_color, sizeof scene->materials[i].base_color);
        h = hash_image(h, &scene->materials[i].texture);
    }
    for (uint32_t i = 0; i < scene->object_count; i++) {
        const hw_object *object = &scene->objects[i];
        uint32_t indices[2] = {object->mesh_idx, object->material_idx};
        h = hw_hash(h, indices, sizeof indices);
        h = hw_hash(h, object->transform.m, sizeof object->transform.m);
    }
    const hw_ground *ground = &scene->ground;
    if (!ground->present)
        return hw_hash(h, "no ground", 9);
    h = hw_hash(h, &ground->rect, sizeof ground->rect);
    return hw_hash(h, ground->color, sizeof ground->color);
}

static hw_status validate_material(const hw_scene *scene, uint32_t i)
{
    const hw_material *material = &scene->materials[i];
    const hw_image *t = &material->texture;
    for (int k = 0; k < 3; k++)
        if (!isfinite(material->base_color[k]) || material->base_color[k] < 0)
            return hw_fail(HW_FORMAT, "material %u: the base colour is no colour", i);
    if (t->data && (t->width == 0 || t->height == 0 ||
                    !(t->channels == 1 || t->channels == 3 || t->channels == 4)))
        return hw_fail(HW_FORMAT, "material %u: a texture of %u x %u with %u channels", i, t->width,
                       t->height, t->channels);
    return HW_OK;
}

static bool box_within_limits(hw_box b)
{
    const float c[6] = {b.min.x, b.min.y, b.min.z, b.max.x, b.max.y, b.max.z};
    for (int k = 0; k < 6; k++)
        if (!(fabsf(c[k]) <= HW_COORDINATE_MAX))
            return false;
    return true;
}

static hw_status validate_object(const hw_scene *scene, uint32_t i)
{
    const hw_object *object = &scene->objects[i];
    const double *m = object->transform.m;
    if (object->mesh_idx >= scene->mesh_count)
        return hw_fail(HW_FORMAT, "object %u: mesh %u out of range (%u meshes)", i,
                       object->mesh_idx, scene->mesh_count);
    if (object->material_idx >= scene->material_count)
        return hw_fail(HW_FORMAT, "object %u: material %u out of range (%u materials)", i,
                       object->material_idx, scene->material_count);
    for (int k = 0; k < 16; k++)
        if (!isfinite(m[k]))
            return hw_fail(HW_FORMAT, "object %u: the transform is not finite", i);
    if (m[3] != 0 || m[7] != 0 || m[11] != 0 || m[15] != 1)
        return hw_fail(HW_FORMAT, "object %u: the transform is not affine", i);
    if (!box_within_limits(object->bounds))
        return hw_fail(HW_FORMAT, "object %u: its bounds lie beyond %g", i,
                       (double)HW_COORDINATE_MAX);
    return HW_OK;
}

static hw_status validate(const hw_scene *scene)
{
    if (scene->object_count == 0)
        return hw_fail(HW_FORMAT, "no object");
    for (uint32_t i = 0; i < scene->mesh_count; i++)
        HW_TRY(hw_mesh_validate(&scene->meshes[i]));
    for (uint32_t i = 0; i < scene->material_count; i++)
        HW_TRY(validate_material(scene, i));
    for (uint32_t i = 0; i < scene->object_count; i++)
        HW_TRY(validate_object(scene, i));
    const hw_ground *ground = &scene->ground;
    if (ground->present &&
        !(box_within_limits(ground->rect) && ground->rect.min.x < ground->rect.max.x &&
          ground->rect.min.y < ground->rect.max.y))
        return hw_fail(HW_FORMAT, "the ground is no rectangle");
    return HW_OK;
}

hw_status hw_scene_validate(const hw_scene *scene)
{
    hw_status status = validate(scene);
    return status == HW_OK ? HW_OK : hw_fail_prefix(status, scene->path ? scene->path : "(scene)");
}
