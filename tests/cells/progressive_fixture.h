// Small made-up meshes and a naive edge collapser that records what hw_progressive_create takes.
// Also used by the generator of the fuzz corpus.
#pragma once
#include "fixtures.h"
#include "progressive_file.h"

typedef enum fixture_placement { PLACE_MIDPOINT, PLACE_END, PLACE_FREE } fixture_placement;

typedef struct fixture_options {
    uint32_t bits; // of the grid, 0: lossless
    bool batched;
    bool careless; // no link condition: fans break, sheets touch
    fixture_placement placement;
    float keep; // fraction of vertices to stop at
    uint32_t seed;
} fixture_options;

typedef struct fixture_recorder {
    hw_progressive_source source;
    hw_position_grid grid;
    float (*positions)[3];
    uint32_t (*faces)[3];
    uint32_t *origins, *numbers, *head, *next, *stamp;
    hw_progressive_collapse *collapses;
    uint32_t *corners, *batches;
    uint32_t (*loose)[3];
    size_t collapse_capacity, corner_capacity, batch_capacity, corner_count;
    hw_rng rng;
} fixture_recorder;

static UNUSED void fixture_recorder_free(fixture_recorder *r)
{
    void *const blocks[] = {r->positions, r->faces,   r->origins,   r->numbers, r->head, r->next,
                            r->stamp,     r->corners, r->collapses, r->batches, r->loose};
    for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++)
        hw_free(blocks[i]);
    *r = (fixture_recorder){0};
}

// A torus of a x b quads in triangles, or (open) a sheet with borders; bumps make it uneven.
static UNUSED void fixture_surface(hw_mesh *mesh, uint32_t a, uint32_t b, bool open, uint64_t seed)
{
    hw_rng rng = hw_rng_make(17, seed);
    uint32_t rows = open ? a - 1 : a, columns = open ? b - 1 : b, n = 0;
    *mesh = (hw_mesh){.vertex_count = a * b, .index_count = rows * columns * 6};
    must(HW_NEW(&mesh->positions, mesh->vertex_count));
    must(HW_NEW(&mesh->indices, mesh->index_count));
    for (uint32_t i = 0; i < a * b; i++) {
        double u = 2 * HW_PI * (i / b) / a, v = 2 * HW_PI * (i % b) / b;
        double h = 0.3 + 0.05 * sin(3 * u) * cos(2 * v) + 0.002 * (double)hw_rng_float(&rng);
        mesh->positions[i] = open ? hw_v3((float)u, (float)v, (float)h)
                                  : hw_v3((float)((1 + h * cos(v)) * cos(u)),
                                          (float)((1 + h * cos(v)) * sin(u)), (float)(h * sin(v)));
    }
    for (uint32_t i = 0; i < rows; i++) {
        for (uint32_t k = 0; k < columns; k++) {
            uint32_t i1 = (i + 1) % a, k1 = (k + 1) % b;
            const uint32_t six[6] = {i * b + k,   i1 * b + k, i1 * b + k1,
                                     i1 * b + k1, i * b + k1, i * b + k};
            memcpy(mesh->indices + n, six, sizeof six);
            n += 6;
        }
    }
}

// Puts b's vertices and faces behind a's.
static UNUSED void fixture_join(hw_mesh *a, const hw_mesh *b)
{
    must(HW_RESIZE(&a->positions, a->vertex_count + b->vertex_count));
    must(HW_RESIZE(&a->indices, a->index_count + b->index_count));
    for (uint32_t i = 0; i < b->vertex_count; i++)
        a->positions[a->vertex_count + i] = hw_v3_add(b->positions[i], hw_v3(3, 1, 2));
    for (uint32_t i = 0; i < b->index_count; i++)
        a->indices[a->index_count + i] = b->indices[i] + a->vertex_count;
    a->vertex_count += b->vertex_count;
    a->index_count += b->index_count;
}

static UNUSED void fixture_add_face(hw_mesh *mesh, uint32_t a, uint32_t b, uint32_t c)
{
    must(HW_RESIZE(&mesh->indices, mesh->index_count + 3));
    const uint32_t face[3] = {a, b, c};
    memcpy(mesh->indices + mesh->index_count, face, sizeof face);
    mesh->index_count += 3;
}

#define FIXTURE_SHAPES 8
static UNUSED void fixture_shape(hw_mesh *mesh, uint32_t shape)
{
    hw_mesh other;
    switch (shape) {
    case 0: // closed
        fixture_surface(mesh, 14, 11, false, 1);
        return;
    case 1: // with borders
        fixture_surface(mesh, 12, 13, true, 2);
        return;
    case 2: // several components
        fixture_surface(mesh, 6, 7, false, 3);
        fixture_surface(&other, 4, 5, true, 4);
        fixture_join(mesh, &other);
        fixture_join(mesh, &other);
        hw_mesh_free(&other);
        return;
    case 3: // one triangle
        fixture_surface(mesh, 2, 2, true, 5);
        mesh->index_count = 3;
        mesh->vertex_count = 4; // and a vertex without any
        return;
    case 4: // sheets that touch at two vertices; loose faces and vertices
        fixture_surface(mesh, 6, 6, true, 6);
        fixture_surface(&other, 5, 7, true, 7);
        fixture_join(mesh, &other);
        hw_mesh_free(&other);
        for (uint32_t i = 0; i < mesh->index_count; i++)
            if (mesh->indices[i] == 40 || mesh->indices[i] == 41)
                mesh->indices[i] = mesh->indices[i] == 40 ? 8 : 0;
        fixture_add_face(mesh, 3, 3, 9);
        fixture_add_face(mesh, mesh->indices[1], mesh->indices[2], mesh->indices[0]);
        fixture_add_face(mesh, 40, 41, 40);
        memmove(mesh->indices + 12, mesh->indices, 12); // a copy of the first face in the middle
        return;
    case 5: // zeros of both signs, denormals, large and small
        fixture_surface(mesh, 7, 8, true, 8);
        for (uint32_t i = 0; i < mesh->vertex_count; i++) {
            const float odd[] = {-0.0f, 0.0f, 1e-42f, -1e-44f, 4e8f, -1e-7f, 1e-30f};
            mesh->positions[i].z = odd[i % 7];
            if (i % 5 == 0)
                mesh->positions[i].x = odd[i % 4];
        }
        return;
    case 6: // a hub
        fixture_surface(mesh, 2, 300, true, 9);
        for (uint32_t i = 0; i < mesh->index_count; i++)
            mesh->indices[i] = mesh->indices[i] < 300 ? 0 : mesh->indices[i];
        return;
    default: // nothing but scraps
        fixture_surface(mesh, 2, 3, true, 10);
        for (uint32_t i = 0; i < mesh->index_count; i += 3)
            mesh->indices[i] = mesh->indices[i + 1];
    }
}

// --- Preparation ---------------------------------------------------------------------------------

static UNUSED bool fixture_same_face(const uint32_t *a, const uint32_t *b)
{
    for (uint32_t i = 0; i < 3; i++)
        if (a[0] == b[i] && a[1] == b[(i + 1) % 3] && a[2] == b[(i + 2) % 3])
            return true;
    return false;
}

// Faces that take part keep their numbers; the others are loose. Small meshes only.
static UNUSED void fixture_sort_faces(fixture_recorder *r, const hw_mesh *mesh, bool numbered)
{
    uint32_t n = mesh->index_count / 3, kept = 0, loose = 0;
    bool large = n > 5000;
    must(HW_NEW(&r->faces, n));
    must(HW_NEW(&r->loose, n));
    must(HW_NEW(&r->numbers, n));
    for (uint32_t f = 0; f < n; f++) {
        const uint32_t *face = mesh->indices + 3 * f;
        bool fine = face[0] != face[1] && face[1] != face[2] && face[2] != face[0];
        for (uint32_t i = 0; !large && fine && i < f; i++)
            fine = !fixture_same_face(face, mesh->indices + 3 * i);
        if (!fine) {
            memcpy(r->loose[loose++], face, sizeof *r->loose);
            r->faces[f][0] = numbered ? UINT32_MAX : r->faces[f][0];
            continue;
        }
        uint32_t to = numbered ? f : kept;
        r->numbers[to] = f;
        memcpy(r->faces[to], face, sizeof *r->faces);
        kept++;
    }
    r->source.face_count = numbered ? n : kept;
    r->source.face_numbers = numbered ? NULL : r->numbers;
    r->source.loose_faces = (const uint32_t(*)[3])r->loose;
    r->source.loose_face_count = loose;
}

// Vertices from `first` on become copies in the faces of the other sheet (shape 4 alone has any).
static UNUSED void fixture_split_sheets(fixture_recorder *r, uint32_t sheet_faces)
{
    for (uint32_t f = sheet_faces; f < r->source.face_count; f++)
        for (int i = 0; r->faces[f][0] != UINT32_MAX && i < 3; i++) {
            uint32_t v = r->faces[f][i];
            if (v != 0 && v != 8)
                continue;
            uint32_t copy = r->source.original_vertex_count + (v == 8);
            memcpy(r->positions[copy], r->positions[v], sizeof *r->positions);
            r->origins[copy] = v;
            r->faces[f][i] = copy;
        }
}

static UNUSED void fixture_prepare(fixture_recorder *r, hw_mesh *mesh, uint32_t shape,
                                   const fixture_options *o)
{
    uint32_t n = mesh->vertex_count, copies = shape == 4 ? 2 : 0;
    *r = (fixture_recorder){.rng = hw_rng_make(o->seed, 99)};
    r->grid = hw_position_grid_make(hw_mesh_bounds(mesh), o->bits);
    must(HW_NEW(&r->positions, n + copies));
    must(HW_NEW(&r->origins, n + copies));
    for (uint32_t i = 0; i < n; i++) {
        hw_vec3 *p = &mesh->positions[i];
        double q[3] = {(double)p->x, (double)p->y, (double)p->z};
        hw_position_grid_snap(&r->grid, q);
        *p = hw_v3((float)q[0], (float)q[1], (float)q[2]);
        memcpy(r->positions[i], p, sizeof *p);
        r->origins[i] = i;
    }
    r->source.vertex_count = n + copies;
    r->source.original_vertex_count = n;
    r->source.source = copies ? r->origins : NULL;
    fixture_sort_faces(r, mesh, o->seed % 2);
    if (copies)
        fixture_split_sheets(r, 50);
    must(HW_NEW(&r->head, n + copies));
    must(HW_NEW(&r->stamp, n + copies));
    must(HW_NEW(&r->next, 3 * (size_t)r->source.face_count));
    memset(r->head, 0xff, (n + copies) * sizeof *r->head);
    for (uint32_t c = 0; c < 3 * r->source.face_count; c++) {
        if (r->faces[c / 3][0] == UINT32_MAX)
            continue;
        r->next[c] = r->head[r->faces[c / 3][c % 3]];
        r->head[r->faces[c / 3][c % 3]] = c;
    }
}

// --- Collapses -----------------------------------------------------------------------------------

static UNUSED bool fixture_has(const uint32_t face[3], uint32_t v)
{
    return face[0] == v || face[1] == v || face[2] == v;
}

// Vertices next to both ends, and faces at the edge.
static UNUSED void fixture_link(const fixture_recorder *r, uint32_t k, uint32_t l, uint32_t *common,
                                uint32_t *shared)
{
    uint32_t seen[64], n = 0;
    *common = *shared = 0;
    for (uint32_t c = r->head[l]; c != UINT32_MAX; c = r->next[c]) {
        const uint32_t *face = r->faces[c / 3];
        if (face[0] == UINT32_MAX)
            continue;
        *shared += fixture_has(face, k);
        for (int i = 0; i < 3; i++) {
            bool found = face[i] == k || face[i] == l || n == 64;
            for (uint32_t j = 0; j < n && !found; j++)
                found = seen[j] == face[i];
            if (!found)
                seen[n++] = face[i];
        }
    }
    for (uint32_t j = 0; j < n; j++) {
        bool found = false;
        for (uint32_t c = r->head[k]; c != UINT32_MAX && !found; c = r->next[c])
            found = r->faces[c / 3][0] != UINT32_MAX && fixture_has(r->faces[c / 3], seen[j]);
        *common += found;
    }
}

static UNUSED void fixture_place(fixture_recorder *r, uint32_t k, uint32_t l,
                                 fixture_placement placement, float out[3])
{
    const float *a = r->positions[k], *b = r->positions[l];
    uint32_t end = hw_rng_below(&r->rng, 2);
    double p[3];
    for (int i = 0; i < 3; i++) {
        double t = placement == PLACE_END        ? (double)end
                   : placement == PLACE_MIDPOINT ? 0.5
                                                 : (double)hw_rng_float(&r->rng) * 1.4 - 0.2;
        p[i] = t == 0   ? (double)a[i]
               : t == 1 ? (double)b[i]
                        : (double)a[i] * (1 - t) + (double)b[i] * t;
    }
    hw_position_grid_snap(&r->grid, p);
    for (int i = 0; i < 3; i++)
        out[i] = placement == PLACE_END ? (end ? b[i] : a[i]) : (float)p[i];
}

static UNUSED void fixture_collapse(fixture_recorder *r, uint32_t k, uint32_t l,
                                    fixture_placement placement)
{
    hw_progressive_collapse c = {.kept = k, .removed = l, .faces = {UINT32_MAX, UINT32_MAX}};
    uint32_t n = 0, corner, next;
    memcpy(c.kept_before, r->positions[k], sizeof c.merged);
    memcpy(c.removed_before, r->positions[l], sizeof c.merged);
    fixture_place(r, k, l, placement, c.merged);
    c.first_corner = (uint32_t)r->corner_count;
    for (corner = r->head[l]; corner != UINT32_MAX; corner = next) {
        uint32_t *face = r->faces[corner / 3];
        next = r->next[corner];
        if (face[0] == UINT32_MAX)
            continue;
        if (fixture_has(face, k)) {
            memcpy(c.face_corners[n], face, sizeof c.face_corners[n]);
            c.faces[n++] = corner / 3;
            face[0] = UINT32_MAX;
            continue;
        }
        must(HW_RESERVE(&r->corners, &r->corner_capacity, r->corner_count + 1));
        r->corners[r->corner_count++] = corner;
        face[corner % 3] = k;
        r->next[corner] = r->head[k];
        r->head[k] = corner;
    }
    c.corner_count = (uint32_t)r->corner_count - c.first_corner;
    memcpy(r->positions[k], c.merged, sizeof c.merged);
    must(HW_RESERVE(&r->collapses, &r->collapse_capacity, (size_t)r->source.collapse_count + 1));
    r->collapses[r->source.collapse_count++] = c;
}

// One edge of one face, if it may go.
static UNUSED bool fixture_try(fixture_recorder *r, const fixture_options *o, uint32_t corner,
                               uint32_t batch)
{
    const uint32_t *face = r->faces[corner / 3];
    uint32_t common, shared;
    if (face[0] == UINT32_MAX)
        return false;
    uint32_t turn = hw_rng_below(&r->rng, 2); // either end may stay
    uint32_t k = face[(corner + turn) % 3], l = face[(corner + 1 - turn) % 3];
    if (o->batched && (r->stamp[k] == batch || r->stamp[l] == batch))
        return false;
    fixture_link(r, k, l, &common, &shared);
    if (shared < 1 || shared > 2 || (!o->careless && common != shared))
        return false;
    r->stamp[k] = r->stamp[l] = batch;
    fixture_collapse(r, k, l, o->placement);
    return true;
}

static UNUSED void fixture_run(fixture_recorder *r, const fixture_options *o)
{
    uint32_t target = (uint32_t)((float)r->source.vertex_count * (1 - o->keep)), batch = 0;
    uint32_t corners = 3 * r->source.face_count, misses = 0;
    uint32_t start = 0;
    while (corners && r->source.collapse_count < target && misses < 40) {
        bool any = false;
        batch++;
        for (uint32_t i = 0; i < corners && r->source.collapse_count < target; i++)
            any = fixture_try(r, o, hw_rng_below(&r->rng, corners), batch) || any;
        misses = any ? 0 : misses + 1;
        if (any) {
            must(HW_RESERVE(&r->batches, &r->batch_capacity, (size_t)r->source.batch_count + 1));
            r->batches[r->source.batch_count++] = r->source.collapse_count - start;
            start = r->source.collapse_count;
        }
    }
    r->source.positions = (const float(*)[3])r->positions;
    r->source.faces = (const uint32_t(*)[3])r->faces;
    r->source.collapses = r->collapses;
    r->source.corners = r->corners;
    r->source.batches = r->batches;
    if (!o->batched)
        r->source.batch_count = 0;
}

// The mesh of a shape (as snapped) and what the collapser did to it.
static UNUSED void fixture_record(fixture_recorder *r, hw_mesh *mesh, uint32_t shape,
                                  const fixture_options *o)
{
    fixture_shape(mesh, shape);
    fixture_prepare(r, mesh, shape, o);
    fixture_run(r, o);
}
