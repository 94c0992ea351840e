#include "scene_split.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

#define OVERLAP         0.02 // of a piece's width, on either side of a cut
#define PIECE_TRIANGLES 500u // with fewer a piece is not cut again
#define CUTS_MAX        64   // one after the other

// A triangle of a piece: one of its own, or a guest from beyond a cut.
typedef struct member {
    uint32_t triangle;
    bool own;
} member;

typedef struct splitter {
    const hw_mesh *mesh;
    double size;       // of a piece, in mesh units
    uint32_t *renamed; // per vertex of the mesh: its number in the piece, or UINT32_MAX
    hw_mesh *pieces;
    size_t count, capacity;
} splitter;

static double axis_of(hw_vec3 v, int axis)
{
    return (double)(axis == 0 ? v.x : axis == 1 ? v.y : v.z);
}

static void range_of(const hw_mesh *mesh, uint32_t triangle, int axis, double out[2])
{
    const uint32_t *t = mesh->indices + 3 * (size_t)triangle;
    double a = axis_of(mesh->positions[t[0]], axis), b = axis_of(mesh->positions[t[1]], axis),
           c = axis_of(mesh->positions[t[2]], axis);
    out[0] = fmin(a, fmin(b, c));
    out[1] = fmax(a, fmax(b, c));
}

static double middle_of(const hw_mesh *mesh, uint32_t triangle, int axis)
{
    double range[2];
    range_of(mesh, triangle, axis, range);
    return (range[0] + range[1]) / 2;
}

// The axis along which the middles of a piece's own triangles reach farthest.
static int longest_axis(const splitter *s, const member *members, uint32_t count, double range[2])
{
    int best = 0;
    range[0] = range[1] = 0;
    for (int axis = 0; axis < 3; axis++) {
        double low = (double)INFINITY, high = -(double)INFINITY;
        for (uint32_t i = 0; i < count; i++) {
            if (!members[i].own)
                continue;
            double middle = middle_of(s->mesh, members[i].triangle, axis);
            low = fmin(low, middle);
            high = fmax(high, middle);
        }
        if (high - low <= range[1] - range[0])
            continue;
        best = axis;
        range[0] = low;
        range[1] = high;
    }
    return best;
}

// The members that lie on one side of a cut, and guests from beyond: triangles that reach the strip
// along it, but for those that are larger than a piece.
static uint32_t take_side(const splitter *s, const member *members, uint32_t count, int axis,
                          double cut, bool above, member *out)
{
    uint32_t taken = 0;
    double strip = OVERLAP * s->size;
    for (uint32_t i = 0; i < count; i++) {
        double range[2];
        range_of(s->mesh, members[i].triangle, axis, range);
        bool inside = ((range[0] + range[1]) / 2 > cut) == above;
        bool reaches = above ? range[1] > cut - strip : range[0] < cut + strip;
        if (inside || (reaches && range[1] - range[0] <= s->size))
            out[taken++] = (member){members[i].triangle, members[i].own && inside};
    }
    return taken;
}

static void copy_vertex(const hw_mesh *from, uint32_t v, hw_mesh *to)
{
    uint32_t i = to->vertex_count++;
    to->positions[i] = from->positions[v];
    if (from->normals)
        to->normals[i] = from->normals[v];
    if (from->colors)
        to->colors[i] = from->colors[v];
    if (from->uvs)
        to->uvs[i] = from->uvs[v];
}

static hw_status make_piece(splitter *s, const member *members, uint32_t count, hw_mesh *out)
{
    hw_status status = HW_OK;
    const hw_mesh *mesh = s->mesh;
    uint32_t vertices = 0;
    HW_GO(HW_NEW(&out->indices, 3 * (size_t)count));
    for (uint32_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            uint32_t v = mesh->indices[3 * (size_t)members[i].triangle + k];
            if (s->renamed[v] == UINT32_MAX)
                s->renamed[v] = vertices++;
            out->indices[out->index_count++] = s->renamed[v];
        }
    HW_GO(HW_NEW(&out->positions, vertices));
    if (mesh->normals)
        HW_GO(HW_NEW(&out->normals, vertices));
    if (mesh->colors)
        HW_GO(HW_NEW(&out->colors, vertices));
    if (mesh->uvs)
        HW_GO(HW_NEW(&out->uvs, vertices));
    for (uint32_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            uint32_t v = mesh->indices[3 * (size_t)members[i].triangle + k];
            if (s->renamed[v] == out->vertex_count)
                copy_vertex(mesh, v, out);
        }
    for (uint32_t i = 0; i < 3 * count; i++)
        s->renamed[mesh->indices[3 * (size_t)members[i / 3].triangle + i % 3]] = UINT32_MAX;
    char name[128];
    snprintf(name, sizeof name, "%.80s, piece %zu", mesh->name ? mesh->name : "", s->count);
    HW_GO(hw_strdup(&out->name, name));
out:
    return status;
}

static hw_status add_piece(splitter *s, const member *members, uint32_t count)
{
    HW_TRY(HW_RESERVE(&s->pieces, &s->capacity, s->count + 1));
    s->pieces[s->count] = (hw_mesh){0};
    return make_piece(s, members, count, &s->pieces[s->count++]);
}

// Halves the piece until it is small enough.
static hw_status split(splitter *s, const member *members, uint32_t count, int cuts)
{
    hw_status status = HW_OK;
    member *side = NULL;
    double range[2];
    uint32_t own = 0;
    for (uint32_t i = 0; i < count; i++)
        own += members[i].own;
    int axis = longest_axis(s, members, count, range);
    double cut = (range[0] + range[1]) / 2;
    if (own <= PIECE_TRIANGLES || range[1] - range[0] <= s->size || cuts == CUTS_MAX ||
        !(cut < range[1]))
        return add_piece(s, members, count);
    HW_GO(HW_NEW(&side, count));
    for (int above = 0; above < 2; above++) {
        uint32_t taken = take_side(s, members, count, axis, cut, above, side);
        HW_GO(split(s, side, taken, cuts + 1));
    }
out:
    hw_free(side);
    return status;
}

static hw_status split_mesh(splitter *s)
{
    hw_status status = HW_OK;
    member *members = NULL;
    uint32_t count = s->mesh->index_count / 3;
    HW_GO(HW_NEW(&members, count));
    HW_GO(HW_NEW(&s->renamed, s->mesh->vertex_count));
    memset(s->renamed, 0xff, s->mesh->vertex_count * sizeof *s->renamed);
    for (uint32_t i = 0; i < count; i++)
        members[i] = (member){i, true};
    HW_GO(split(s, members, count, 0));
out:
    hw_free(members);
    hw_free(s->renamed);
    s->renamed = NULL;
    return status;
}

// ---- the scene -------------------------------------------------------------------------------

// What becomes of a mesh: pieces, in the order of the scene's meshes.
typedef struct result {
    uint32_t first, count; // meshes of the new scene
    double size;           // of its pieces, in mesh units; 0: it is not cut
} result;

static void judge(const hw_scene *scene, double size, result *results)
{
    for (uint32_t i = 0; i < scene->object_count; i++) {
        const hw_object *object = &scene->objects[i];
        hw_vec3 extent = hw_v3_sub(object->bounds.max, object->bounds.min);
        double wide = fmax((double)extent.x, (double)extent.y);
        double stretch = hw_mat4_stretch(&object->transform);
        result *r = &results[object->mesh_idx];
        if (wide <= HW_SPLIT_WIDTH * size || !(stretch > 0) ||
            scene->meshes[object->mesh_idx].index_count / 3 <= HW_SPLIT_TRIANGLES)
            continue;
        r->size = r->size > 0 ? fmin(r->size, size / stretch) : size / stretch;
    }
}

// All meshes of the new scene; those that are not cut are empty yet.
static hw_status cut_meshes(const hw_scene *scene, result *results, splitter *s)
{
    for (uint32_t i = 0; i < scene->mesh_count; i++) {
        result *r = &results[i];
        r->first = (uint32_t)s->count;
        s->mesh = &scene->meshes[i];
        s->size = r->size;
        if (r->size > 0) {
            HW_TRY(split_mesh(s));
        } else {
            HW_TRY(HW_RESERVE(&s->pieces, &s->capacity, s->count + 1));
            s->pieces[s->count++] = (hw_mesh){0};
        }
        if (s->count >= UINT32_MAX)
            return hw_fail(HW_LIMIT, "more than %u pieces of meshes", UINT32_MAX);
        r->count = (uint32_t)s->count - r->first;
    }
    return HW_OK;
}

static hw_status place_pieces(const hw_scene *scene, const result *results, hw_object **objects,
                              uint32_t *object_count)
{
    uint64_t count = 0;
    for (uint32_t i = 0; i < scene->object_count; i++)
        count += results[scene->objects[i].mesh_idx].count;
    if (count >= UINT32_MAX)
        return hw_fail(HW_LIMIT, "more than %u pieces of objects", UINT32_MAX);
    HW_TRY(HW_NEW(objects, count));
    *object_count = 0;
    for (uint32_t i = 0; i < scene->object_count; i++) {
        const result *r = &results[scene->objects[i].mesh_idx];
        for (uint32_t k = 0; k < r->count; k++) {
            hw_object *object = &(*objects)[(*object_count)++];
            *object = scene->objects[i];
            object->mesh_idx = r->first + k;
        }
    }
    return HW_OK;
}

// Nothing can fail any more: the scene takes the pieces, and gives up the meshes they are of.
static void take_pieces(hw_scene *scene, const result *results, splitter *s, hw_object **objects,
                        uint32_t object_count)
{
    for (uint32_t i = 0; i < scene->mesh_count; i++) {
        if (results[i].size > 0)
            hw_mesh_free(&scene->meshes[i]);
        else
            s->pieces[results[i].first] = scene->meshes[i];
    }
    hw_free(scene->meshes);
    hw_free(scene->objects);
    scene->meshes = s->pieces;
    scene->mesh_count = (uint32_t)s->count;
    scene->objects = *objects;
    scene->object_count = object_count;
    s->pieces = NULL;
    s->count = 0;
    *objects = NULL;
    hw_scene_update_bounds(scene);
}

hw_status hw_scene_split(hw_scene *scene, double size, uint32_t *cut)
{
    hw_status status = HW_OK;
    splitter s = {0};
    result *results = NULL;
    hw_object *objects = NULL;
    uint32_t object_count = 0;
    *cut = 0;
    HW_GO(HW_NEW(&results, scene->mesh_count));
    judge(scene, size, results);
    for (uint32_t i = 0; i < scene->mesh_count; i++)
        *cut += results[i].size > 0;
    if (*cut == 0)
        goto out;
    HW_GO(cut_meshes(scene, results, &s));
    HW_GO(place_pieces(scene, results, &objects, &object_count));
    take_pieces(scene, results, &s, &objects, object_count);
out:
    for (size_t i = 0; i < s.count; i++)
        hw_mesh_free(&s.pieces[i]);
    hw_free(s.pieces);
    hw_free(results);
    hw_free(objects);
    return status;
}
