// The default policy: errors in pixels as a viewer anywhere in the cell could see them.
//
// Silhouettes make most of the error of a stand-in, and they can only arise where a face turns away
// from some point of the cell. So the chain level is chosen by its outline deviation; faces that no
// point of the cell sees are dropped (afterwards: culling first leaves torn borders that cannot be
// simplified); and the patches that every point of the cell sees from the front, whose relief shows
// only as parallax under the texture, are simplified again to a larger tolerance with their borders
// held.
#include "alloc.h"
#include "collapse.h"
#include "metric.h"
#include "svmesh.h"
#include <math.h>
#include <string.h>

typedef struct selection {
    const hw_mesh *level;
    uint8_t *facing; // per face, hw_facing
    uint32_t *local; // level vertex -> view mesh vertex
    bool *locked;    // per view mesh vertex
} selection;

static void classify_faces(const hw_svmesh_job *job, selection *s)
{
    hw_vec3 eyes[HW_CELL_CORNERS];
    uint32_t eye_count = hw_svmesh_eyes(job, false, eyes);
    for (uint32_t f = 0; f < s->level->index_count / 3; f++) {
        const uint32_t *t = s->level->indices + 3 * (size_t)f;
        s->facing[f] =
            (uint8_t)hw_triangle_facing(s->level->positions[t[0]], s->level->positions[t[1]],
                                        s->level->positions[t[2]], eyes, eye_count);
    }
}

// Copies the faces that some point of the cell may see; those seen by every point come first.
// Vertices of other faces are locked.
static hw_status project_faces(const hw_svmesh_job *job, selection *s, hw_view_mesh *out,
                               uint32_t *front_indices)
{
    const hw_object *object = &job->scene->objects[job->object_idx];
    const hw_mesh *level = s->level;
    memset(s->local, 0xff, level->vertex_count * sizeof *s->local);
    for (int pass = 0; pass < 2; pass++) {
        hw_facing wanted = pass == 0 ? HW_FACING_FRONT : HW_FACING_MIXED;
        for (uint32_t f = 0; f < level->index_count / 3; f++) {
            if (s->facing[f] != wanted)
                continue;
            for (int k = 0; k < 3; k++) {
                uint32_t v = level->indices[3 * (size_t)f + k];
                if (s->local[v] == UINT32_MAX) {
                    hw_vec3 world = hw_mat4_point(&object->transform, level->positions[v]);
                    if (!hw_svmesh_project(job, world, out->positions[out->vertex_count]))
                        return hw_fail(HW_INTERNAL,
                                       "a far object reaches behind the centre of its cell");
                    s->local[v] = out->vertex_count++;
                }
                out->indices[out->index_count++] = s->local[v];
            }
        }
        if (pass == 0)
            *front_indices = out->index_count;
    }
    for (uint32_t i = 0; i < level->index_count; i++)
        if (s->facing[i / 3] != HW_FACING_FRONT && s->local[level->indices[i]] != UINT32_MAX)
            s->locked[s->local[level->indices[i]]] = true;
    return HW_OK;
}

// Simplifies the first `front_indices` indices of the mesh in place; the rest keep their vertices,
// which are locked.
static hw_status simplify_interior(const hw_svmesh_job *job, const bool *locked,
                                   uint32_t front_indices, hw_view_mesh *mesh)
{
    hw_status status;
    hw_collapser *c = NULL;
    hw_metric metric = {0};
    HW_GO(hw_collapser_create((const double(*)[3])mesh->positions, mesh->vertex_count,
                              mesh->indices, front_indices / 3, locked, HW_COMPLEX_LOCK, &c));
    c->upright = true;
    for (uint32_t v = 0; v < c->vertex_count; v++)
        c->locked[v] |= c->border[v]; // open borders of the mesh itself
    HW_GO(hw_metric_qem(c, &metric));
    double interior_px = hw_svmesh_interior_px(job);
    hw_collapse_limits limits = {.cost = interior_px * interior_px};
    HW_GO(hw_collapser_run(c, &metric, &limits));
    memcpy(mesh->positions, c->positions, mesh->vertex_count * sizeof *mesh->positions);
    uint32_t n = 0;
    for (uint32_t f = 0; f < c->face_count; f++)
        for (int k = 0; c->faces[f][0] != HW_NO_VERTEX && k < 3; k++)
            mesh->indices[n++] = c->faces[f][k];
    memmove(mesh->indices + n, mesh->indices + front_indices,
            (mesh->index_count - front_indices) * sizeof *mesh->indices);
    mesh->index_count -= front_indices - n;
out:
    hw_metric_destroy(&metric);
    hw_collapser_destroy(c);
    return status;
}

static hw_status simplify(const hw_svmesh_job *job, hw_view_mesh *out)
{
    hw_status status;
    selection s = {0};
    double pixel = job->distance.effective /
                   (job->view->focal_px * job->scale); // of the effective distance, mesh units
    double outline_px =
        job->multi_view ? job->options->multi_outline_px : job->options->outline_px;
    uint32_t by_outline = hw_chain_level_by_silhouette(job->chain, outline_px * pixel);
    uint32_t by_surface = hw_chain_level_by_error(job->chain, hw_svmesh_interior_px(job) * pixel);
    s.level = &job->chain->levels[by_outline < by_surface ? by_outline : by_surface];
    uint32_t front_indices = 0;
    HW_GO(HW_NEW(&s.facing, s.level->index_count / 3));
    HW_GO(HW_NEW(&s.local, s.level->vertex_count));
    HW_GO(HW_NEW(&s.locked, s.level->vertex_count));
    HW_GO(HW_NEW(&out->positions, s.level->vertex_count));
    HW_GO(HW_NEW(&out->indices, s.level->index_count));
    classify_faces(job, &s);
    HW_GO(project_faces(job, &s, out, &front_indices));
    if (front_indices > 0 && hw_svmesh_interior_px(job) > 0)
        HW_GO(simplify_interior(job, s.locked, front_indices, out));
    HW_GO(hw_view_mesh_compact(out));
out:
    hw_free(s.facing);
    hw_free(s.local);
    hw_free(s.locked);
    if (status != HW_OK)
        hw_view_mesh_free(out);
    return status;
}

const hw_svmesh_policy hw_policy_screen = {
    "screen",
    "errors in pixels as seen from the cell: outline-preserving levels, interiors simplified by "
    "parallax",
    simplify};
