#include "hash.h"
#include "mesh.h"
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#define NONE UINT32_MAX

// ---- Welding ------------------------------------------------------------------------------------

// What makes two vertices the same: the bits of their attributes, with -0 taken as +0.
typedef struct vertex_key {
    hw_vec3 position, normal;
    hw_uv uv;
    hw_color8 color;
} vertex_key;
_Static_assert(sizeof(vertex_key) == 36, "keys are hashed and compared as bytes: no padding");

static hw_vec3 plus_zero(hw_vec3 a)
{
    return hw_v3(a.x + 0.0f, a.y + 0.0f, a.z + 0.0f);
}

// `size` bytes of the key count: sizeof(hw_vec3) for the position alone, or the whole.
static void make_key(const hw_mesh *mesh, uint32_t i, size_t size, vertex_key *key)
{
    key->position = plus_zero(mesh->positions[i]);
    if (size == sizeof key->position)
        return;
    if (mesh->normals)
        key->normal = plus_zero(mesh->normals[i]);
    if (mesh->uvs)
        key->uv = (hw_uv){mesh->uvs[i].u + 0.0f, mesh->uvs[i].v + 0.0f};
    if (mesh->colors)
        key->color = mesh->colors[i];
}

// Smallest power of two that leaves a hash table of `count` entries at most half full.
static size_t table_capacity(size_t count)
{
    size_t capacity = 16;
    while (capacity < 2 * count)
        capacity *= 2;
    return capacity;
}

// remap[i] = the smallest index of a vertex with the same key. Open addressing; slots hold index
// plus one.
static hw_status key_map(const hw_mesh *mesh, size_t key_size, uint32_t *remap)
{
    size_t capacity = table_capacity(mesh->vertex_count);
    uint32_t *slots;
    HW_TRY(HW_NEW(&slots, capacity));
    vertex_key key = {0}, other = {0};
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        make_key(mesh, i, key_size, &key);
        size_t slot = hw_hash(0, &key, key_size) & (capacity - 1);
        remap[i] = i;
        for (; slots[slot]; slot = (slot + 1) & (capacity - 1)) {
            make_key(mesh, slots[slot] - 1, key_size, &other);
            if (memcmp(&key, &other, key_size) != 0)
                continue;
            remap[i] = slots[slot] - 1;
            break;
        }
        if (remap[i] == i)
            slots[slot] = i + 1;
    }
    hw_free(slots);
    return HW_OK;
}

hw_status hw_mesh_weld_map(const hw_mesh *mesh, uint32_t *remap)
{
    return key_map(mesh, sizeof(hw_vec3), remap);
}

// used[i] = 1 for vertices of triangles, else 0.
static void mark_used(const hw_mesh *mesh, uint32_t *used)
{
    memset(used, 0, mesh->vertex_count * sizeof *used);
    for (uint32_t i = 0; i < mesh->index_count; i++)
        used[mesh->indices[i]] = 1;
}

// Keeps the vertices with used[i] != 0, in order, and renumbers the indices.
static hw_status compact(hw_mesh *mesh, uint32_t *used)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        if (!used[i])
            continue;
        mesh->positions[kept] = mesh->positions[i];
        if (mesh->normals)
            mesh->normals[kept] = mesh->normals[i];
        if (mesh->colors)
            mesh->colors[kept] = mesh->colors[i];
        if (mesh->uvs)
            mesh->uvs[kept] = mesh->uvs[i];
        used[i] = kept++;
    }
    for (uint32_t i = 0; i < mesh->index_count; i++)
        mesh->indices[i] = used[mesh->indices[i]];
    mesh->vertex_count = kept;
    HW_TRY(HW_RESIZE(&mesh->positions, kept));
    if (mesh->normals)
        HW_TRY(HW_RESIZE(&mesh->normals, kept));
    if (mesh->colors)
        HW_TRY(HW_RESIZE(&mesh->colors, kept));
    if (mesh->uvs)
        HW_TRY(HW_RESIZE(&mesh->uvs, kept));
    return HW_RESIZE(&mesh->indices, mesh->index_count);
}

hw_status hw_mesh_weld(hw_mesh *mesh)
{
    hw_status status = HW_OK;
    uint32_t *remap = NULL;
    HW_GO(HW_NEW(&remap, mesh->vertex_count));
    HW_GO(key_map(mesh, sizeof(vertex_key), remap));
    for (uint32_t i = 0; i < mesh->index_count; i++)
        mesh->indices[i] = remap[mesh->indices[i]];
    mark_used(mesh, remap);
    HW_GO(compact(mesh, remap));
out:
    hw_free(remap);
    return status;
}

// ---- Cleaning -----------------------------------------------------------------------------------

// Twice the area vector, in double: differences of floats and their products keep enough bits that
// only truly collinear corners give zero.
static void area_vector(const hw_mesh *mesh, const uint32_t *t, double out[3])
{
    hw_vec3 a = mesh->positions[t[0]], b = mesh->positions[t[1]], c = mesh->positions[t[2]];
    double u[3] = {(double)b.x - a.x, (double)b.y - a.y, (double)b.z - a.z};
    double v[3] = {(double)c.x - a.x, (double)c.y - a.y, (double)c.z - a.z};
    hw_cross(u, v, out);
}

static bool is_degenerate(const hw_mesh *mesh, const uint32_t *t)
{
    double n[3];
    area_vector(mesh, t, n);
    return n[0] == 0 && n[1] == 0 && n[2] == 0;
}

// The welded corners, rotated so that the smallest comes first: the cyclic order stays.
static void canonical(const uint32_t *t, const uint32_t *weld, uint32_t out[3])
{
    uint32_t w[3] = {weld[t[0]], weld[t[1]], weld[t[2]]};
    int first = w[0] <= w[1] && w[0] <= w[2] ? 0 : w[1] <= w[2] ? 1 : 2;
    for (int k = 0; k < 3; k++)
        out[k] = w[(first + k) % 3];
}

// Adds triangle i of the kept ones to the set; false if an equal one is there.
static bool insert_triangle(uint32_t *slots, size_t capacity, const hw_mesh *mesh,
                            const uint32_t *weld, uint32_t i)
{
    uint32_t key[3], other[3];
    canonical(mesh->indices + 3 * (size_t)i, weld, key);
    size_t slot = hw_hash(0, key, sizeof key) & (capacity - 1);
    for (; slots[slot]; slot = (slot + 1) & (capacity - 1)) {
        canonical(mesh->indices + 3 * (size_t)(slots[slot] - 1), weld, other);
        if (memcmp(key, other, sizeof key) == 0)
            return false;
    }
    slots[slot] = i + 1;
    return true;
}

static hw_status drop_triangles(hw_mesh *mesh, const uint32_t *weld)
{
    size_t capacity = table_capacity(mesh->index_count / 3);
    uint32_t *slots;
    HW_TRY(HW_NEW(&slots, capacity));
    uint32_t kept = 0;
    for (uint32_t i = 0; i < mesh->index_count / 3; i++) {
        uint32_t *to = mesh->indices + 3 * (size_t)kept;
        memmove(to, mesh->indices + 3 * (size_t)i, 3 * sizeof *to);
        if (!is_degenerate(mesh, to) && insert_triangle(slots, capacity, mesh, weld, kept))
            kept++;
    }
    mesh->index_count = 3 * kept;
    hw_free(slots);
    return HW_OK;
}

hw_status hw_mesh_clean(hw_mesh *mesh)
{
    hw_status status = HW_OK;
    uint32_t *map = NULL;
    HW_GO(hw_mesh_weld(mesh));
    HW_GO(HW_NEW(&map, mesh->vertex_count));
    HW_GO(hw_mesh_weld_map(mesh, map));
    HW_GO(drop_triangles(mesh, map));
    mark_used(mesh, map);
    HW_GO(compact(mesh, map));
out:
    hw_free(map);
    return status;
}

// ---- Normals ------------------------------------------------------------------------------------

hw_status hw_mesh_compute_normals(hw_mesh *mesh)
{
    hw_status status = HW_OK;
    uint32_t *weld = NULL;
    double(*sums)[3] = NULL;
    HW_GO(HW_NEW(&weld, mesh->vertex_count));
    HW_GO(HW_NEW(&sums, mesh->vertex_count));
    HW_GO(hw_mesh_weld_map(mesh, weld));
    if (!mesh->normals)
        HW_GO(HW_NEW(&mesh->normals, mesh->vertex_count));
    for (uint32_t i = 0; i + 2 < mesh->index_count; i += 3) {
        double n[3];
        area_vector(mesh, mesh->indices + i, n);
        for (int k = 0; k < 9; k++)
            sums[weld[mesh->indices[i + k / 3]]][k % 3] += n[k % 3];
    }
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        const double *n = sums[weld[i]];
        double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        mesh->normals[i] = length > 0 ? hw_v3((float)(n[0] / length), (float)(n[1] / length),
                                              (float)(n[2] / length))
                                      : hw_v3(0, 0, 1);
    }
out:
    hw_free(weld);
    hw_free(sums);
    return status;
}

// ---- Orientation --------------------------------------------------------------------------------

// A half-edge h = 3 triangle + corner runs from that corner to the next. `weld` gives positions.
typedef struct topology {
    uint32_t *weld, *twin; // twin: the one other half-edge of a manifold edge, else NONE
    uint32_t *queue;       // triangles in the order of the flood: components are contiguous
    bool *seen, *turned;
} topology;

typedef struct edge_end {
    uint32_t high, half_edge;
} edge_end;

static uint32_t half_edge_next(uint32_t h)
{
    return h % 3 == 2 ? h - 2 : h + 1;
}

static void half_edge_ends(const hw_mesh *mesh, const uint32_t *weld, uint32_t h, uint32_t *from,
                           uint32_t *to)
{
    *from = weld[mesh->indices[h]];
    *to = weld[mesh->indices[half_edge_next(h)]];
}

static int compare_ends(const void *a, const void *b)
{
    const edge_end *x = a, *y = b;
    if (x->high != y->high)
        return x->high < y->high ? -1 : 1;
    return x->half_edge < y->half_edge ? -1 : x->half_edge > y->half_edge;
}

// Links the half-edges of one vertex's edges to higher vertices: pairs are twins, anything else is
// a border or non-manifold.
static void link_bucket(edge_end *ends, size_t count, uint32_t *twin)
{
    qsort(ends, count, sizeof *ends, compare_ends);
    for (size_t i = 0, j; i < count; i = j) {
        for (j = i + 1; j < count && ends[j].high == ends[i].high; j++)
            ;
        if (j - i != 2)
            continue;
        twin[ends[i].half_edge] = ends[i + 1].half_edge;
        twin[ends[i + 1].half_edge] = ends[i].half_edge;
    }
}

// Half-edges by the lower of their two vertices (a counting sort), then each bucket by the higher.
static hw_status find_twins(const hw_mesh *mesh, const uint32_t *weld, uint32_t *twin)
{
    hw_status status = HW_OK;
    size_t *starts = NULL;
    edge_end *ends = NULL;
    uint32_t from, to;
    HW_GO(HW_NEW(&starts, (size_t)mesh->vertex_count + 2));
    HW_GO(HW_NEW(&ends, mesh->index_count));
    for (uint32_t h = 0; h < mesh->index_count; h++) {
        twin[h] = NONE;
        half_edge_ends(mesh, weld, h, &from, &to);
        if (from != to)
            starts[(size_t)(from < to ? from : to) + 2]++;
    }
    for (size_t i = 2; i < (size_t)mesh->vertex_count + 2; i++)
        starts[i] += starts[i - 1];
    for (uint32_t h = 0; h < mesh->index_count; h++) {
        half_edge_ends(mesh, weld, h, &from, &to);
        if (from != to)
            ends[starts[(size_t)(from < to ? from : to) + 1]++] =
                (edge_end){from < to ? to : from, h};
    }
    for (size_t i = 0; i < mesh->vertex_count; i++)
        link_bucket(ends + starts[i], starts[i + 1] - starts[i], twin);
out:
    hw_free(starts);
    hw_free(ends);
    return status;
}

// Floods from `seed`, appending to the queue from `begin`; returns the queue's new end.
static uint32_t flood(const hw_mesh *mesh, topology *t, uint32_t seed, uint32_t begin)
{
    uint32_t end = begin;
    t->queue[end++] = seed;
    t->seen[seed] = true;
    for (uint32_t head = begin; head < end; head++) {
        uint32_t triangle = t->queue[head];
        for (uint32_t h = 3 * triangle; h < 3 * triangle + 3; h++) {
            uint32_t g = t->twin[h];
            if (g == NONE || t->seen[g / 3])
                continue;
            // Neighbours that agree run along their common edge in opposite directions.
            bool same = t->weld[mesh->indices[h]] == t->weld[mesh->indices[g]];
            t->turned[g / 3] = t->turned[triangle] != same;
            t->seen[g / 3] = true;
            t->queue[end++] = g / 3;
        }
    }
    return end;
}

// Six times the signed volume of the triangles queue[begin..end) about their centroid, as turned.
static double component_volume(const hw_mesh *mesh, const topology *t, uint32_t begin, uint32_t end)
{
    double o[3] = {0, 0, 0}, area = 0, volume = 0, n[3];
    for (uint32_t i = begin; i < end; i++) {
        const uint32_t *corners = mesh->indices + 3 * (size_t)t->queue[i];
        area_vector(mesh, corners, n);
        double w = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (int k = 0; k < 3; k++) {
            hw_vec3 p = mesh->positions[corners[k]];
            o[0] += w * p.x / 3;
            o[1] += w * p.y / 3;
            o[2] += w * p.z / 3;
        }
        area += w;
    }
    if (!(area > 0))
        return 0;
    for (uint32_t i = begin; i < end; i++) {
        const uint32_t *corners = mesh->indices + 3 * (size_t)t->queue[i];
        hw_vec3 p = mesh->positions[corners[0]];
        area_vector(mesh, corners, n);
        double v =
            n[0] * (p.x - o[0] / area) + n[1] * (p.y - o[1] / area) + n[2] * (p.z - o[2] / area);
        volume += t->turned[t->queue[i]] ? -v : v;
    }
    return volume;
}

static bool turn_triangles(hw_mesh *mesh, const bool *turned)
{
    bool any = false;
    for (uint32_t i = 0; i < mesh->index_count / 3; i++) {
        if (!turned[i])
            continue;
        uint32_t *corners = mesh->indices + 3 * (size_t)i, second = corners[1];
        corners[1] = corners[2];
        corners[2] = second;
        any = true;
    }
    return any;
}

hw_status hw_mesh_orient(hw_mesh *mesh)
{
    hw_status status = HW_OK;
    uint32_t count = mesh->index_count / 3, end = 0;
    topology t = {0};
    HW_GO(HW_NEW(&t.weld, mesh->vertex_count));
    HW_GO(HW_NEW(&t.twin, mesh->index_count));
    HW_GO(HW_NEW(&t.queue, count));
    HW_GO(HW_NEW(&t.seen, count));
    HW_GO(HW_NEW(&t.turned, count));
    HW_GO(hw_mesh_weld_map(mesh, t.weld));
    HW_GO(find_twins(mesh, t.weld, t.twin));
    for (uint32_t seed = 0; seed < count; seed++) {
        if (t.seen[seed])
            continue;
        uint32_t begin = end;
        end = flood(mesh, &t, seed, begin);
        if (component_volume(mesh, &t, begin, end) >= 0)
            continue;
        for (uint32_t i = begin; i < end; i++)
            t.turned[t.queue[i]] = !t.turned[t.queue[i]];
    }
    if (turn_triangles(mesh, t.turned) && mesh->normals)
        HW_GO(hw_mesh_compute_normals(mesh));
out:
    hw_free(t.weld);
    hw_free(t.twin);
    hw_free(t.queue);
    hw_free(t.seen);
    hw_free(t.turned);
    return status;
}
