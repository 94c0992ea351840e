// Comparisons of progressive meshes. Include cmocka.h before.
#pragma once
#include "progressive_fixture.h"

#define CONFIGURATIONS 96
// Every mixture of grid, order, carefulness and placement, on some shape.
static UNUSED fixture_options configuration(uint32_t i)
{
    return (fixture_options){.bits = i % 2 ? 14 : 0,
                             .batched = i / 2 % 2,
                             .careless = i / 4 % 2,
                             .placement = (fixture_placement)(i / 8 % 3),
                             .keep = i / 24 % 2 ? 0 : 0.2f,
                             .seed = i / 3};
}

static UNUSED uint32_t configuration_shape(uint32_t i)
{
    return (i * 7 + i / 8) % FIXTURE_SHAPES;
}

// Everything of a record's life in one: free with hw_progressive_destroy and hw_mesh_free.
static UNUSED hw_progressive *make_progressive(uint32_t i, bool keep_order, hw_mesh *original)
{
    fixture_recorder r;
    fixture_options o = configuration(i);
    hw_progressive *p = NULL;
    fixture_record(&r, original, configuration_shape(i), &o);
    must(hw_progressive_create(&p, &r.grid, &r.source, keep_order));
    fixture_recorder_free(&r);
    return p;
}

static UNUSED int compare_places(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(hw_vec3));
}

typedef struct place_face {
    hw_vec3 corners[3];
} place_face;

static UNUSED int compare_faces(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(place_face));
}

static UNUSED place_face *sorted_faces(const hw_mesh *mesh)
{
    place_face *faces = NULL;
    must(HW_NEW(&faces, mesh->index_count / 3));
    for (uint32_t f = 0; f < mesh->index_count / 3; f++) {
        const uint32_t *v = mesh->indices + 3 * f;
        for (uint32_t turn = 0; turn < 3; turn++) {
            place_face turned;
            for (uint32_t k = 0; k < 3; k++)
                turned.corners[k] = mesh->positions[v[(k + turn) % 3]];
            if (turn == 0 || compare_faces(&turned, &faces[f]) < 0)
                faces[f] = turned;
        }
    }
    qsort(faces, mesh->index_count / 3, sizeof *faces, compare_faces);
    return faces;
}

// The same vertices and the same faces with the same winding, bit by bit, in any order.
static UNUSED void assert_same_shape(const hw_mesh *a, const hw_mesh *b)
{
    assert_int_equal(a->vertex_count, b->vertex_count);
    assert_int_equal(a->index_count, b->index_count);
    hw_vec3 *places[2] = {NULL, NULL};
    const hw_mesh *meshes[2] = {a, b};
    for (int i = 0; i < 2; i++) {
        must(HW_NEW(&places[i], a->vertex_count));
        memcpy(places[i], meshes[i]->positions, a->vertex_count * sizeof *places[i]);
        qsort(places[i], a->vertex_count, sizeof *places[i], compare_places);
    }
    assert_memory_equal(places[0], places[1], a->vertex_count * sizeof *places[0]);
    place_face *x = sorted_faces(a), *y = sorted_faces(b);
    assert_memory_equal(x, y, a->index_count / 3 * sizeof *x);
    hw_free(places[0]);
    hw_free(places[1]);
    hw_free(x);
    hw_free(y);
}

static UNUSED void assert_same_arrays(const hw_mesh *a, const hw_mesh *b)
{
    assert_int_equal(a->vertex_count, b->vertex_count);
    assert_int_equal(a->index_count, b->index_count);
    assert_memory_equal(a->positions, b->positions, a->vertex_count * sizeof *a->positions);
    assert_memory_equal(a->indices, b->indices, a->index_count * sizeof *a->indices);
}

// A hash of the state's mesh; its counts are what the state says, its faces are triangles.
static UNUSED uint64_t state_hash(const hw_progressive *p)
{
    hw_mesh mesh;
    must(hw_progressive_extract(p, &mesh));
    assert_int_equal(mesh.vertex_count, hw_progressive_vertex_count(p));
    assert_int_equal(mesh.index_count, 3 * hw_progressive_face_count(p));
    bool finest = hw_progressive_applied_count(p) == hw_progressive_get_info(p).record_count;
    for (uint32_t i = 0; i < mesh.index_count; i++) {
        assert_true(mesh.indices[i] < mesh.vertex_count);
        if (!finest)
            assert_int_not_equal(mesh.indices[i], mesh.indices[i % 3 == 2 ? i - 2 : i + 1]);
    }
    uint64_t hash = hw_mesh_hash(&mesh);
    hw_mesh_free(&mesh);
    return hash;
}

// Hashes of the first n records applied, for all n; free with hw_free. Leaves p at the finest.
static UNUSED uint64_t *all_hashes(hw_progressive *p)
{
    uint64_t *hashes = NULL;
    uint32_t n = hw_progressive_get_info(p).record_count;
    must(HW_NEW(&hashes, n + 1));
    for (uint32_t i = 0; i <= n; i++) {
        hw_progressive_go(p, i);
        assert_int_equal(hw_progressive_applied_count(p), i);
        assert_int_equal(hw_progressive_face_count(p), hw_progressive_faces_at(p, i));
        assert_int_equal(hw_progressive_vertex_count(p), hw_progressive_vertices_at(p, i));
        hashes[i] = state_hash(p);
    }
    return hashes;
}
