#include "scene_upright.h"
#include <math.h>

#define TILT_MIN 1e-6 // the sine of what counts as no rounding

// The normal, in the mesh, of planes that are level in the world; false if that is z, or there is
// none.
static bool find_up(const hw_mat4 *transform, double up[3])
{
    const double *m = transform->m;
    double length = sqrt(m[2] * m[2] + m[6] * m[6] + m[10] * m[10]);
    if (!(length > 0) || !isfinite(length))
        return false;
    for (int k = 0; k < 3; k++)
        up[k] = m[2 + 4 * k] / length;
    return up[2] <= 0 || hypot(up[0], up[1]) > TILT_MIN;
}

// Rotations: *turn takes up to z, *back is its inverse. A quarter turn is exact.
static void make_turn(const double up[3], hw_mat4 *turn, hw_mat4 *back)
{
    const double x[3] = {1, 0, 0}, y[3] = {0, 1, 0}, *start = fabs(up[0]) < 0.9 ? x : y;
    double axes[3][3], along = 0, length = 0;
    for (int k = 0; k < 3; k++)
        along += start[k] * up[k];
    for (int k = 0; k < 3; k++) {
        axes[0][k] = start[k] - along * up[k];
        length += axes[0][k] * axes[0][k];
        axes[2][k] = up[k];
    }
    for (int k = 0; k < 3; k++)
        axes[0][k] /= sqrt(length);
    hw_cross(axes[2], axes[0], axes[1]);
    *turn = *back = hw_mat4_identity();
    for (int row = 0; row < 3; row++)
        for (int k = 0; k < 3; k++)
            turn->m[row + 4 * k] = back->m[k + 4 * row] = axes[row][k];
}

// What becomes of a mesh.
typedef struct turned_mesh {
    bool placed, turned; // has an object
    hw_mat4 back;
} turned_mesh;

hw_status hw_scene_stand_upright(hw_scene *scene)
{
    turned_mesh *meshes = NULL;
    HW_TRY(HW_NEW(&meshes, scene->mesh_count));
    bool any = false;
    for (uint32_t i = 0; i < scene->object_count; i++) {
        hw_object *object = &scene->objects[i];
        turned_mesh *mesh = &meshes[object->mesh_idx];
        double up[3];
        hw_mat4 turn;
        if (!mesh->placed && find_up(&object->transform, up)) {
            make_turn(up, &turn, &mesh->back);
            hw_mesh_transform(&scene->meshes[object->mesh_idx], &turn);
            mesh->turned = any = true;
        }
        mesh->placed = true;
        if (mesh->turned)
            object->transform = hw_mat4_mul(object->transform, mesh->back);
    }
    hw_free(meshes);
    if (any)
        hw_scene_update_bounds(scene);
    return HW_OK;
}
