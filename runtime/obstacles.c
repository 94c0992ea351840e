#include "obstacles.h"
#include "alloc.h"
#include "box_grid.h"
#include "cull.h"
#include "mesh_file.h"
#include "solid.h"
#include "source.h"
#include <stdio.h>
#include <time.h>

// Cubes of this size, in the world, where meshes are small enough for it.
#define CUBE_SIDE 1.0

typedef struct obstacle {
    uint32_t mesh_idx;
    hw_mat4 transform, inverse;
    double cover; // radius of the ball, in the world, that stands for a cube
} obstacle;

struct hw_obstacles {
    uint32_t mesh_count, count;
    hw_solid *solids;    // per mesh; bits NULL: no obstacle
    obstacle *obstacles; // per object
    hw_box_grid *grid;   // of the objects' boxes
};

// ---- Making

static hw_status create(hw_obstacles **out, uint32_t mesh_count, uint32_t count)
{
    hw_status status = HW_OK;
    hw_obstacles *o = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&o, 1));
    HW_GO(HW_NEW(&o->solids, mesh_count));
    HW_GO(HW_NEW(&o->obstacles, count));
    o->mesh_count = mesh_count;
    o->count = count;
    *out = o;
    o = NULL;
out:
    hw_obstacles_destroy(o);
    return status;
}

void hw_obstacles_destroy(hw_obstacles *obstacles)
{
    if (!obstacles)
        return;
    for (uint32_t i = 0; i < obstacles->mesh_count; i++)
        hw_solid_free(&obstacles->solids[i]);
    hw_box_grid_destroy(obstacles->grid);
    hw_free(obstacles->solids);
    hw_free(obstacles->obstacles);
    hw_free(obstacles);
}

static void place(hw_obstacles *o, uint32_t i, uint32_t mesh_idx, const hw_mat4 *transform)
{
    o->obstacles[i].mesh_idx = mesh_idx;
    o->obstacles[i].transform = *transform;
    // A flat object (no inverse) gets the identity: it is in nobody's way.
    (void)hw_mat4_inverse(*transform, &o->obstacles[i].inverse);
}

// Per mesh the side of a cube that is CUBE_SIDE in the world for the largest object made of it; 0
// where no object is.
static hw_status choose_sides(const hw_obstacles *o, double **sides)
{
    HW_TRY(HW_NEW(sides, o->mesh_count));
    for (uint32_t i = 0; i < o->count; i++) {
        const obstacle *object = &o->obstacles[i];
        double side = CUBE_SIDE / fmax(hw_mat4_stretch(&object->transform), 1e-9);
        double *least = &(*sides)[object->mesh_idx];
        *least = *least > 0 ? fmin(*least, side) : side;
    }
    return HW_OK;
}

// With all solids made: their balls' sizes, and the grid.
static hw_status finish(hw_obstacles *o, const hw_box *boxes)
{
    hw_box bounds = hw_box_empty();
    double cover = 0;
    for (uint32_t i = 0; i < o->count; i++) {
        obstacle *object = &o->obstacles[i];
        const hw_solid *solid = &o->solids[object->mesh_idx];
        object->cover = solid->side / 2 * hw_mat4_stretch(&object->transform);
        cover = fmax(cover, solid->bits ? object->cover : 0);
        bounds = hw_box_union(bounds, boxes[i]);
    }
    // A cube's centre may lie half a cube beyond the box, and its ball reaches as far again.
    return hw_box_grid_create(&o->grid, boxes, o->count, bounds, HW_BODY_RADIUS_MAX + 3 * cover);
}

static bool is_stopped(const hw_obstacles_desc *desc)
{
    return desc->stop && atomic_load(desc->stop);
}

static hw_status read_block(hw_source *source, const hw_obstacles_desc *desc, const char *name,
                            uint64_t offset, uint64_t size, hw_block *out)
{
    const struct timespec pause = {0, 5000000};
    hw_request *request = NULL;
    HW_TRY(hw_source_start(source, name, offset, size, &request));
    while (!hw_request_done(request)) {
        if (is_stopped(desc)) {
            hw_request_cancel(request);
            return hw_fail(HW_INTERRUPTED, "%s: interrupted", name);
        }
        nanosleep(&pause, NULL);
    }
    return hw_request_finish(request, out);
}

// The coarsest level whose surface is within half a cube of the original's.
static hw_status read_level(hw_source *source, const hw_obstacles_desc *desc, uint32_t mesh_idx,
                            double side, hw_mesh *out)
{
    hw_status status = HW_OK;
    char name[HW_FILE_NAME_BYTES];
    hw_block block = {0};
    hw_mesh_file *file = NULL;
    uint64_t offset, size;
    hw_mesh_name(name, mesh_idx);
    HW_TRY(read_block(source, desc, name, 0, HW_MESH_FRONT_BYTES, &block));
    HW_GO(hw_mesh_file_open_front(&file, name, block.data, block.size, block.file_bytes));
    uint32_t level = 0, count = hw_mesh_file_level_count(file);
    while (level + 1 < count && hw_mesh_file_level(file, level + 1)->error_p99 <= side / 2)
        level++;
    hw_mesh_file_level_place(file, level, &offset, &size);
    hw_free(block.data);
    block = (hw_block){0};
    HW_GO(read_block(source, desc, name, offset, size, &block));
    HW_GO(hw_mesh_file_decode(file, level, block.data, block.size, out, NULL));
out:
    hw_free(block.data);
    hw_mesh_file_close(file);
    return status;
}

static hw_status make_solid(hw_obstacles *o, const hw_obstacles_desc *desc, hw_source *source,
                            uint32_t mesh_idx, double side, uint32_t *missing)
{
    if (desc->scene)
        return hw_solid_make(&o->solids[mesh_idx], &desc->scene->meshes[mesh_idx], side);
    hw_mesh mesh = {0};
    hw_status status = read_level(source, desc, mesh_idx, side, &mesh);
    if (status == HW_OK)
        status = hw_solid_make(&o->solids[mesh_idx], &mesh, side);
    hw_mesh_free(&mesh);
    if (status == HW_OK || status == HW_MEMORY || status == HW_INTERRUPTED)
        return status;
    ++*missing;
    return HW_OK;
}

static hw_status make_solids(hw_obstacles *o, const hw_obstacles_desc *desc, uint32_t *missing)
{
    hw_status status = HW_OK;
    double *sides = NULL;
    hw_source *source = NULL;
    HW_GO(choose_sides(o, &sides));
    if (!desc->scene)
        HW_GO(
            hw_source_open(&source, &(hw_source_desc){.location = desc->dataset,
                                                      .bytes_per_second = desc->bytes_per_second}));
    for (uint32_t i = 0; i < o->mesh_count; i++) {
        if (is_stopped(desc)) {
            status = hw_fail(HW_INTERRUPTED, "obstacles: interrupted");
            goto out;
        }
        if (sides[i] > 0)
            HW_GO(make_solid(o, desc, source, i, sides[i], missing));
    }
out:
    hw_source_close(source);
    hw_free(sides);
    return status;
}

static hw_box place_object(hw_obstacles *o, const hw_obstacles_desc *desc, uint32_t i)
{
    if (desc->scene) {
        const hw_object *object = &desc->scene->objects[i];
        place(o, i, object->mesh_idx, &object->transform);
        return object->bounds;
    }
    const hw_manifest_object *object = &desc->manifest->objects[i];
    place(o, i, object->mesh_idx, &object->transform);
    return object->bounds;
}

hw_status hw_obstacles_create(const hw_obstacles_desc *desc, uint32_t *missing, hw_obstacles **out)
{
    hw_status status = HW_OK;
    hw_obstacles *o = NULL;
    hw_box *boxes = NULL;
    uint32_t count = desc->scene ? desc->scene->object_count : desc->manifest->object_count;
    *missing = 0;
    *out = NULL;
    HW_GO(create(&o, desc->scene ? desc->scene->mesh_count : desc->manifest->mesh_count, count));
    HW_GO(HW_NEW(&boxes, count));
    for (uint32_t i = 0; i < count; i++)
        boxes[i] = place_object(o, desc, i);
    HW_GO(make_solids(o, desc, missing));
    HW_GO(finish(o, boxes));
    *out = o;
    o = NULL;
out:
    hw_free(boxes);
    hw_obstacles_destroy(o);
    return status;
}

// ---- Touching

// The cubes [low, high] along each axis that a box of the mesh's space may meet; false if none.
static bool cubes_of(const hw_solid *s, hw_box box, int32_t low[3], int32_t high[3])
{
    const double from[3] = {(double)box.min.x - s->origin.x, (double)box.min.y - s->origin.y,
                            (double)box.min.z - s->origin.z};
    const double to[3] = {(double)box.max.x - s->origin.x, (double)box.max.y - s->origin.y,
                          (double)box.max.z - s->origin.z};
    for (int i = 0; i < 3; i++) {
        double a = floor(from[i] / s->side), b = floor(to[i] / s->side);
        if (!(b >= 0 && a < s->count[i]))
            return false;
        low[i] = a < 0 ? 0 : (int32_t)a;
        high[i] = b >= s->count[i] ? s->count[i] - 1 : (int32_t)b;
    }
    return true;
}

typedef struct contact {
    double depth, away[2];
} contact;

static void touch_cube(const obstacle *object, const hw_body *body, hw_vec3 centre,
                       contact *deepest)
{
    hw_vec3 p = hw_mat4_point(&object->transform, centre);
    if (p.z < body->z_min - object->cover || p.z > body->z_max + object->cover)
        return;
    double dx = body->x - p.x, dy = body->y - p.y, distance = sqrt(dx * dx + dy * dy);
    double depth = body->radius + object->cover - distance;
    if (depth <= deepest->depth)
        return;
    bool along_axis = distance < 1e-9;
    *deepest = (contact){depth, {along_axis ? 1 : dx / distance, along_axis ? 0 : dy / distance}};
}

static void touch_object(const hw_obstacles *o, const obstacle *object, const hw_body *body,
                         contact *deepest)
{
    const hw_solid *s = &o->solids[object->mesh_idx];
    if (!s->bits)
        return;
    float r = (float)(body->radius + object->cover), c = (float)object->cover;
    float x = (float)body->x, y = (float)body->y;
    hw_box reach = {{x - r, y - r, (float)body->z_min - c}, {x + r, y + r, (float)body->z_max + c}};
    int32_t low[3], high[3];
    if (!cubes_of(s, hw_mat4_box(&object->inverse, reach), low, high))
        return;
    for (int32_t k = low[2]; k <= high[2]; k++)
        for (int32_t j = low[1]; j <= high[1]; j++)
            for (int32_t i = low[0]; i <= high[0]; i++)
                if (hw_solid_has(s, i, j, k))
                    touch_cube(object, body, hw_solid_centre(s, i, j, k), deepest);
}

double hw_obstacles_touch(const hw_obstacles *o, const hw_body *body, double away[2])
{
    contact deepest = {0};
    const uint32_t *near;
    uint32_t count = hw_box_grid_at(o->grid, body->x, body->y, &near);
    for (uint32_t i = 0; i < count; i++)
        touch_object(o, &o->obstacles[near[i]], body, &deepest);
    if (away) {
        away[0] = deepest.away[0];
        away[1] = deepest.away[1];
    }
    return deepest.depth;
}
