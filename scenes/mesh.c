#include "mesh.h"
#include "hash.h"
#include <assert.h>
#include <string.h>

void hw_mesh_free(hw_mesh *mesh)
{
    if (!mesh)
        return;
    hw_free(mesh->name);
    hw_free(mesh->positions);
    hw_free(mesh->normals);
    hw_free(mesh->colors);
    hw_free(mesh->uvs);
    hw_free(mesh->indices);
    *mesh = (hw_mesh){0};
}

// A copy of an optional array; NULL stays NULL.
static hw_status copy_array(void **out, const void *source, size_t count, size_t size)
{
    *out = NULL;
    if (!source)
        return HW_OK;
    HW_TRY(hw_alloc(out, count, size));
    if (count)
        memcpy(*out, source, count * size);
    return HW_OK;
}

hw_status hw_mesh_copy(const hw_mesh *mesh, hw_mesh *out)
{
    hw_status status = HW_OK;
    size_t n = mesh->vertex_count;
    hw_mesh copy = {.vertex_count = mesh->vertex_count, .index_count = mesh->index_count};
    if (mesh->name)
        HW_GO(hw_strdup(&copy.name, mesh->name));
    HW_GO(copy_array((void **)&copy.positions, mesh->positions, n, sizeof *mesh->positions));
    HW_GO(copy_array((void **)&copy.normals, mesh->normals, n, sizeof *mesh->normals));
    HW_GO(copy_array((void **)&copy.colors, mesh->colors, n, sizeof *mesh->colors));
    HW_GO(copy_array((void **)&copy.uvs, mesh->uvs, n, sizeof *mesh->uvs));
    HW_GO(copy_array((void **)&copy.indices, mesh->indices, mesh->index_count,
                     sizeof *mesh->indices));
out:
    if (status != HW_OK)
        hw_mesh_free(&copy);
    *out = copy;
    return status;
}

hw_box hw_mesh_bounds(const hw_mesh *mesh)
{
    hw_box box = hw_box_empty();
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        hw_box_add(&box, mesh->positions[i]);
    return box;
}

static uint64_t hash_array(uint64_t seed, const void *data, size_t count, size_t size)
{
    uint32_t present = data != NULL;
    seed = hw_hash(seed, &present, sizeof present);
    return data ? hw_hash(seed, data, count * size) : seed;
}

uint64_t hw_mesh_hash(const hw_mesh *mesh)
{
    size_t n = mesh->vertex_count;
    uint32_t counts[2] = {mesh->vertex_count, mesh->index_count};
    uint64_t h = hw_hash(0, counts, sizeof counts);
    h = hash_array(h, mesh->positions, n, sizeof *mesh->positions);
    h = hash_array(h, mesh->normals, n, sizeof *mesh->normals);
    h = hash_array(h, mesh->colors, n, sizeof *mesh->colors);
    h = hash_array(h, mesh->uvs, n, sizeof *mesh->uvs);
    return hash_array(h, mesh->indices, mesh->index_count, sizeof *mesh->indices);
}

static bool array_equal(const void *a, const void *b, size_t count, size_t size)
{
    if (!a || !b)
        return a == b;
    return count == 0 || memcmp(a, b, count * size) == 0;
}

bool hw_mesh_equal(const hw_mesh *a, const hw_mesh *b)
{
    size_t n = a->vertex_count;
    return a->vertex_count == b->vertex_count && a->index_count == b->index_count &&
           array_equal(a->indices, b->indices, a->index_count, sizeof *a->indices) &&
           array_equal(a->positions, b->positions, n, sizeof *a->positions) &&
           array_equal(a->normals, b->normals, n, sizeof *a->normals) &&
           array_equal(a->colors, b->colors, n, sizeof *a->colors) &&
           array_equal(a->uvs, b->uvs, n, sizeof *a->uvs);
}

static hw_status validate_vertex(const hw_mesh *mesh, const char *name, uint32_t i)
{
    hw_vec3 p = mesh->positions[i];
    if (!hw_v3_finite(p))
        return hw_fail(HW_FORMAT, "mesh %s: vertex %u has a NaN or infinite coordinate", name, i);
    if (fabsf(p.x) > HW_COORDINATE_MAX || fabsf(p.y) > HW_COORDINATE_MAX ||
        fabsf(p.z) > HW_COORDINATE_MAX)
        return hw_fail(HW_FORMAT, "mesh %s: vertex %u lies beyond %g", name, i,
                       (double)HW_COORDINATE_MAX);
    if (mesh->normals && !hw_v3_finite(mesh->normals[i]))
        return hw_fail(HW_FORMAT, "mesh %s: normal %u is NaN or infinite", name, i);
    if (mesh->uvs && !(isfinite(mesh->uvs[i].u) && isfinite(mesh->uvs[i].v)))
        return hw_fail(HW_FORMAT, "mesh %s: texture coordinate %u is NaN or infinite", name, i);
    return HW_OK;
}

hw_status hw_mesh_validate(const hw_mesh *mesh)
{
    const char *name = mesh->name ? mesh->name : "(unnamed)";
    if (mesh->index_count == 0 || !mesh->indices)
        return hw_fail(HW_FORMAT, "mesh %s: no triangle", name);
    if (mesh->index_count % 3 != 0)
        return hw_fail(HW_FORMAT, "mesh %s: %u indices are no whole number of triangles", name,
                       mesh->index_count);
    if (mesh->vertex_count == 0 || !mesh->positions)
        return hw_fail(HW_FORMAT, "mesh %s: no vertex", name);
    for (uint32_t i = 0; i < mesh->index_count; i++)
        if (mesh->indices[i] >= mesh->vertex_count)
            return hw_fail(HW_FORMAT, "mesh %s: triangle %u: index %u out of range (%u vertices)",
                           name, i / 3, mesh->indices[i], mesh->vertex_count);
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        HW_TRY(validate_vertex(mesh, name, i));
    return HW_OK;
}

double hw_mesh_area(const hw_mesh *mesh)
{
    double area = 0;
    for (uint32_t i = 0; i < mesh->index_count; i += 3) {
        const uint32_t *t = mesh->indices + i;
        hw_vec3 a = mesh->positions[t[0]];
        hw_vec3 n = hw_v3_cross(hw_v3_sub(mesh->positions[t[1]], a), hw_v3_sub(mesh->positions[t[2]], a));
        area += (double)hw_v3_length(n) / 2;
    }
    return area;
}

double hw_mesh_volume(const hw_mesh *mesh)
{
    // Tetrahedra from the box's centre: far from the origin, less is lost to cancellation.
    hw_vec3 o = hw_box_centre(hw_mesh_bounds(mesh));
    double sum = 0;
    for (uint32_t i = 0; i + 2 < mesh->index_count; i += 3) {
        double v[3][3];
        for (int k = 0; k < 3; k++) {
            hw_vec3 p = mesh->positions[mesh->indices[i + k]];
            v[k][0] = (double)p.x - o.x;
            v[k][1] = (double)p.y - o.y;
            v[k][2] = (double)p.z - o.z;
        }
        sum += v[0][0] * (v[1][1] * v[2][2] - v[1][2] * v[2][1]) +
               v[0][1] * (v[1][2] * v[2][0] - v[1][0] * v[2][2]) +
               v[0][2] * (v[1][0] * v[2][1] - v[1][1] * v[2][0]);
    }
    return sum / 6;
}

// Cofactors of the upper 3x3 (row-major) and its determinant: the inverse transpose is cofactors /
// determinant.
static double cofactors(const hw_mat4 *matrix, double c[3][3])
{
    const double *m = matrix->m;
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++) {
            int r1 = (r + 1) % 3, r2 = (r + 2) % 3, k1 = (k + 1) % 3, k2 = (k + 2) % 3;
            c[r][k] = m[k1 * 4 + r1] * m[k2 * 4 + r2] - m[k2 * 4 + r1] * m[k1 * 4 + r2];
        }
    return m[0] * c[0][0] + m[4] * c[0][1] + m[8] * c[0][2];
}

void hw_mesh_transform(hw_mesh *mesh, const hw_mat4 *matrix)
{
    double c[3][3];
    double sign = cofactors(matrix, c) < 0 ? -1 : 1;
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        mesh->positions[i] = hw_mat4_point(matrix, mesh->positions[i]);
    for (uint32_t i = 0; mesh->normals && i < mesh->vertex_count; i++) {
        hw_vec3 n = mesh->normals[i];
        double v[3], squared = 0;
        for (int r = 0; r < 3; r++) {
            v[r] = sign * (c[r][0] * n.x + c[r][1] * n.y + c[r][2] * n.z);
            squared += v[r] * v[r];
        }
        double scale = squared > 0 ? 1 / sqrt(squared) : 0;
        mesh->normals[i] =
            hw_v3((float)(v[0] * scale), (float)(v[1] * scale), (float)(v[2] * scale));
    }
    if (sign > 0)
        return;
    for (uint32_t i = 0; i + 2 < mesh->index_count; i += 3) {
        uint32_t t = mesh->indices[i + 1];
        mesh->indices[i + 1] = mesh->indices[i + 2];
        mesh->indices[i + 2] = t;
    }
}
