#include "statues.h"
#include "file.h"
#include "import.h"
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#define NOT_ON_PATH UINT32_MAX

// Directions found by looking at each file from six sides; tilts such that feet and bases lie flat.
static const hw_statue table[] = {
    {"dragon", "dragon_vrip_res2.ply", {0, 1, 0}, {-1, 0, 0}},
    {"dragon-full", "dragon_vrip.ply", {0, 1, 0}, {-1, 0, 0}},
    {"bunny", "bunny.obj", {0, 1, 0}, {-1, 0, 0.4f}},
    {"man", "man.off", {0, 0, 1}, {0, -1, 0}},
    {"bull", "bull.off", {0, 1, 0.091f}, {-1, 0, 0}},
    {"horse", "horse.3ds", {0, 1, 0}, {0.85f, 0, -0.5f}},
    {"cow", "cow.off", {0, 1, 0}, {1, 0, 0}},
    {"homer", "homer.off", {0, 1, 0}, {0, 0, 1}},
    {"camel", "camel.off", {0, 1, 0}, {0, 0, 1}},
    {"head", "head.off", {0, 1, 0}, {-1, 0, 0}},
    {"elephant", "refined_elephant.off", {0, 1, 0}, {0.85f, 0, 0.5f}},
    {"armadillo", "armadillo.off", {0, 1, 0}, {0, 0, -1}},
    {"lion", "lion-head.off", {-0.2f, 0.4f, 0.92f}, {0, -0.92f, 0.4f}},
    {"devil", "mannequin-devil.off", {0, 0, 1}, {0, -1, 0}},
    {"guardian", "ChineseDragon-10kv.off", {0, 0.953f, 0.302f}, {0, 0, 1}},
    {"triceratops", "triceratops.off", {0, 1, 0}, {1, 0, 0}},
    {"diplodocus", "diplodocus.off", {0.117f, 1, 0.157f}, {1, 0, 0}},
    {"dinosaur", "dino.off", {0, 0, 1}, {0, -1, 0}},
    {"fist", "hand.off", {0, 0, 1}, {0, 1, 0}},
};

const hw_statue *hw_statue_table(uint32_t *count)
{
    *count = sizeof table / sizeof *table;
    return table;
}

const hw_statue *hw_statue_find(const char *name)
{
    for (size_t i = 0; i < sizeof table / sizeof *table; i++)
        if (!strcmp(table[i].name, name))
            return &table[i];
    return NULL;
}

bool hw_statue_available(const hw_statue *statue, const char *folder)
{
    char *path = NULL;
    if (hw_path_join(&path, folder, statue->file) != HW_OK)
        return false;
    bool exists = hw_path_exists(path);
    hw_free(path);
    return exists;
}

// A triangle by its vertices in rising order; `odd` tells which way round it runs.
typedef struct sorted_triangle {
    uint32_t v[3], triangle_idx;
    bool odd;
} sorted_triangle;

static int compare_triangles(const void *a, const void *b)
{
    const sorted_triangle *p = a, *q = b;
    for (int k = 0; k < 3; k++)
        if (p->v[k] != q->v[k])
            return p->v[k] < q->v[k] ? -1 : 1;
    return (p->triangle_idx > q->triangle_idx) - (p->triangle_idx < q->triangle_idx);
}

static sorted_triangle sort_corners(const uint32_t *t, uint32_t triangle_idx)
{
    sorted_triangle s = {{t[0], t[1], t[2]}, triangle_idx, false};
    for (int round = 0; round < 2; round++)
        for (int k = 0; k < 2; k++) {
            if (s.v[k] <= s.v[k + 1])
                continue;
            uint32_t swap = s.v[k];
            s.v[k] = s.v[k + 1];
            s.v[k + 1] = swap;
            s.odd = !s.odd;
        }
    return s;
}

hw_status hw_statue_drop_flaps(hw_mesh *mesh)
{
    uint32_t count = mesh->index_count / 3, kept = 0;
    sorted_triangle *sorted = NULL;
    HW_TRY(HW_NEW(&sorted, count));
    for (uint32_t i = 0; i < count; i++)
        sorted[i] = sort_corners(mesh->indices + 3 * (size_t)i, i);
    qsort(sorted, count, sizeof *sorted, compare_triangles);
    for (uint32_t i = 0; i + 1 < count; i++) {
        if (memcmp(sorted[i].v, sorted[i + 1].v, sizeof sorted[i].v) != 0 ||
            sorted[i].odd == sorted[i + 1].odd)
            continue;
        // Marked by an index that no triangle has.
        mesh->indices[3 * (size_t)sorted[i].triangle_idx] = UINT32_MAX;
        mesh->indices[3 * (size_t)sorted[i + 1].triangle_idx] = UINT32_MAX;
        i++;
    }
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t *t = mesh->indices + 3 * (size_t)i;
        if (t[0] != UINT32_MAX)
            memmove(mesh->indices + 3 * (size_t)kept++, t, 3 * sizeof *t);
    }
    mesh->index_count = 3 * kept;
    hw_free(sorted);
    return HW_OK;
}

// One side of an edge: `low` < `high` are its vertices, `forward` tells whether the triangle runs
// from low to high.
typedef struct half_edge {
    uint32_t low, high;
    bool forward;
} half_edge;

static int compare_half_edges(const void *a, const void *b)
{
    const half_edge *p = a, *q = b;
    if (p->low != q->low)
        return p->low < q->low ? -1 : 1;
    return (p->high > q->high) - (p->high < q->high);
}

// A step along the rim of a hole, in the direction in which the missing triangles run.
typedef struct rim_edge {
    uint32_t from, to;
    bool used;
} rim_edge;

static int compare_rim_edges(const void *a, const void *b)
{
    const rim_edge *p = a, *q = b;
    if (p->from != q->from)
        return p->from < q->from ? -1 : 1;
    return (p->to > q->to) - (p->to < q->to);
}

// The edges that more triangles run along one way than the other, sorted by start: the boundary of
// the surface, which always consists of closed loops. *out is freed with hw_free.
static hw_status find_rims(const hw_mesh *mesh, rim_edge **out, uint32_t *count)
{
    hw_status status = HW_OK;
    half_edge *edges = NULL;
    rim_edge *rims = NULL;
    uint32_t n = mesh->index_count, rim_count = 0;
    HW_GO(HW_NEW(&edges, n));
    HW_GO(HW_NEW(&rims, n));
    for (uint32_t i = 0; i < n; i++) {
        uint32_t a = mesh->indices[i], b = mesh->indices[i % 3 == 2 ? i - 2 : i + 1];
        edges[i] = (half_edge){a < b ? a : b, a < b ? b : a, a < b};
    }
    qsort(edges, n, sizeof *edges, compare_half_edges);
    for (uint32_t i = 0, next; i < n; i = next) {
        half_edge e = edges[i];
        int balance = 0;
        for (next = i; next < n && edges[next].low == e.low && edges[next].high == e.high; next++)
            balance += edges[next].forward ? 1 : -1;
        for (; balance > 0; balance--)
            rims[rim_count++] = (rim_edge){e.high, e.low, false};
        for (; balance < 0; balance++)
            rims[rim_count++] = (rim_edge){e.low, e.high, false};
    }
    qsort(rims, rim_count, sizeof *rims, compare_rim_edges);
    *out = rims;
    *count = rim_count;
    rims = NULL;
out:
    hw_free(rims);
    hw_free(edges);
    return status;
}

// The first unused step that starts at `vertex`, or NULL.
static rim_edge *step_from(rim_edge *rims, uint32_t count, uint32_t vertex)
{
    uint32_t low = 0, high = count;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        if (rims[middle].from < vertex)
            low = middle + 1;
        else
            high = middle;
    }
    for (; low < count && rims[low].from == vertex; low++)
        if (!rims[low].used)
            return &rims[low];
    return NULL;
}

// Appends the triangles of one hole; the arrays have room.
static void fill_loop(hw_mesh *mesh, const uint32_t *loop, uint32_t length)
{
    uint32_t *out = mesh->indices + mesh->index_count;
    if (length == 3) {
        memcpy(out, loop, 3 * sizeof *loop);
        mesh->index_count += 3;
        return;
    }
    hw_vec3 centre = {0, 0, 0};
    for (uint32_t i = 0; i < length; i++)
        centre = hw_v3_mad(centre, mesh->positions[loop[i]], 1.0f / (float)length);
    uint32_t middle = mesh->vertex_count++;
    mesh->positions[middle] = centre;
    for (uint32_t i = 0; i < length; i++) {
        *out++ = loop[i];
        *out++ = loop[(i + 1) % length];
        *out++ = middle;
    }
    mesh->index_count += 3 * length;
}

// Follows the rim from rims[start] and fills every loop that it closes on the way: holes that share
// a corner are holes of their own. `path` has room for every rim edge; place[v] is where vertex v
// stands on the path, NOT_ON_PATH for all before and after.
static void fill_from(hw_mesh *mesh, rim_edge *rims, uint32_t count, uint32_t start, uint32_t *path,
                      uint32_t *place)
{
    uint32_t length = 0;
    for (rim_edge *edge = &rims[start]; edge; edge = step_from(rims, count, edge->to)) {
        edge->used = true;
        place[edge->from] = length;
        path[length++] = edge->from;
        uint32_t first = place[edge->to];
        if (first == NOT_ON_PATH)
            continue;
        if (length - first >= 3)
            fill_loop(mesh, path + first, length - first);
        for (; length > first; length--)
            place[path[length - 1]] = NOT_ON_PATH;
    }
    for (; length > 0; length--)
        place[path[length - 1]] = NOT_ON_PATH;
}

hw_status hw_statue_close_holes(hw_mesh *mesh)
{
    assert(!mesh->normals && !mesh->colors && !mesh->uvs);
    hw_status status = HW_OK;
    rim_edge *rims = NULL;
    uint32_t *path = NULL, *place = NULL, count = 0;
    HW_GO(find_rims(mesh, &rims, &count));
    if (count == 0)
        goto out;
    HW_GO(HW_NEW(&path, count));
    HW_GO(HW_NEW(&place, mesh->vertex_count));
    memset(place, 0xff, mesh->vertex_count * sizeof *place);
    // Every rim edge makes one triangle at most, every three of them one vertex at most.
    HW_GO(HW_RESIZE(&mesh->indices, (size_t)mesh->index_count + 3 * (size_t)count));
    HW_GO(HW_RESIZE(&mesh->positions, (size_t)mesh->vertex_count + count / 3));
    for (uint32_t i = 0; i < count; i++)
        if (!rims[i].used)
            fill_from(mesh, rims, count, i, path, place);
out:
    hw_free(place);
    hw_free(path);
    hw_free(rims);
    return status;
}

static hw_vec3 vector(const float v[3])
{
    return hw_v3(v[0], v[1], v[2]);
}

// The rotation that takes `up` to +z and `front` (as far as it is orthogonal to up) to +y.
static hw_mat4 upright(const hw_statue *statue)
{
    hw_vec3 up = hw_v3_normalize(vector(statue->up));
    hw_vec3 right = hw_v3_normalize(hw_v3_cross(vector(statue->front), up));
    hw_vec3 front = hw_v3_cross(up, right);
    const hw_vec3 rows[3] = {right, front, up};
    hw_mat4 m = hw_mat4_identity();
    for (int r = 0; r < 3; r++) {
        m.m[0 + r] = rows[r].x;
        m.m[4 + r] = rows[r].y;
        m.m[8 + r] = rows[r].z;
    }
    return m;
}

static void drop_attributes(hw_mesh *mesh)
{
    hw_free(mesh->normals);
    hw_free(mesh->colors);
    hw_free(mesh->uvs);
    mesh->normals = NULL;
    mesh->colors = NULL;
    mesh->uvs = NULL;
}

static void stand_on_ground(hw_mesh *mesh, const hw_statue *statue)
{
    hw_mat4 rotation = upright(statue);
    hw_mesh_transform(mesh, &rotation);
    hw_box box = hw_mesh_bounds(mesh);
    hw_vec3 centre = hw_box_centre(box);
    hw_mat4 shift = hw_mat4_translation(-centre.x, -centre.y, -box.min.z);
    hw_mesh_transform(mesh, &shift);
}

hw_status hw_statue_load(const hw_statue *statue, const char *folder, hw_mesh *out)
{
    hw_status status = HW_OK;
    char *path = NULL;
    hw_mesh mesh = {0};
    *out = (hw_mesh){0};
    HW_GO(hw_path_join(&path, folder, statue->file));
    if (!hw_path_exists(path)) {
        const char *option = strncmp(statue->name, "dragon", 6) ? "" : " --dragon";
        status = hw_fail(HW_NOT_FOUND, "%s: not there; fetch it with tools/fetch-statues %s%s",
                         path, folder, option);
        goto out;
    }
    HW_GO(hw_mesh_import(path, &mesh));
    // Positions alone decide what is one vertex: seams of attributes would be cracks here.
    drop_attributes(&mesh);
    HW_GO(hw_mesh_clean(&mesh));
    // Flaps first: in the file they still run opposite ways, and without them the flood gets round.
    HW_GO(hw_statue_drop_flaps(&mesh));
    HW_GO(hw_mesh_orient(&mesh));
    HW_GO(hw_statue_close_holes(&mesh));
    // Closing a triangle that hung alone makes a flap; the vertices of flaps are left over.
    HW_GO(hw_statue_drop_flaps(&mesh));
    HW_GO(hw_mesh_clean(&mesh));
    if (mesh.index_count == 0) {
        status = hw_fail(HW_FORMAT, "%s: nothing is left of it", path);
        goto out;
    }
    stand_on_ground(&mesh, statue);
    HW_GO(hw_mesh_compute_normals(&mesh));
    hw_free(mesh.name);
    mesh.name = NULL;
    HW_GO(hw_strdup(&mesh.name, statue->name));
    *out = mesh;
    mesh = (hw_mesh){0};
out:
    hw_mesh_free(&mesh);
    hw_free(path);
    return status;
}
