#include "solid.h"
#include "alloc.h"

// Samples of all triangles together; a mesh of many large ones gets coarser cubes. Even the
// smallest takes some, whatever the cubes: a mesh of very many may have twice those.
#define SAMPLES_MAX    2e7
#define SAMPLES_OF_ONE 4.5

static size_t cube_count(const hw_solid *s)
{
    return (size_t)s->count[0] * (size_t)s->count[1] * (size_t)s->count[2];
}

static void set_bit(uint64_t *bits, size_t i)
{
    bits[i / 64] |= UINT64_C(1) << i % 64;
}

static bool has_bit(const uint64_t *bits, size_t i)
{
    return bits[i / 64] >> i % 64 & 1;
}

static int32_t cube_of(double offset, double side, int32_t count)
{
    double i = floor(offset / side);
    return i < 0 ? 0 : i >= count ? count - 1 : (int32_t)i;
}

static void mark(hw_solid *s, double x, double y, double z)
{
    int32_t i = cube_of(x - s->origin.x, s->side, s->count[0]);
    int32_t j = cube_of(y - s->origin.y, s->side, s->count[1]);
    int32_t k = cube_of(z - s->origin.z, s->side, s->count[2]);
    set_bit(s->bits,
            ((size_t)k * (size_t)s->count[1] + (size_t)j) * (size_t)s->count[0] + (size_t)i);
}

// Steps along the triangle's longest edge that lie at most half a cube apart.
static uint32_t steps_of(const hw_vec3 *p, double side)
{
    double longest = 0;
    for (int i = 0; i < 3; i++)
        longest = fmax(longest, (double)hw_v3_length(hw_v3_sub(p[(i + 1) % 3], p[i])));
    return (uint32_t)fmin(ceil(2 * longest / side), 1e6) + 1;
}

static void corners_of(const hw_mesh *mesh, size_t triangle, hw_vec3 p[3])
{
    for (size_t i = 0; i < 3; i++)
        p[i] = mesh->positions[mesh->indices[3 * triangle + i]];
}

static double sample_count(const hw_mesh *mesh, double side)
{
    double sum = 0;
    for (size_t t = 0; t < mesh->index_count / 3; t++) {
        hw_vec3 p[3];
        corners_of(mesh, t, p);
        double n = steps_of(p, side) + 1;
        sum += n * n / 2;
    }
    return sum;
}

// A point for every step along two edges; between neighbouring points lies less than a cube.
static void mark_triangle(hw_solid *s, const hw_vec3 p[3])
{
    uint32_t n = steps_of(p, s->side);
    for (uint32_t i = 0; i <= n; i++) {
        for (uint32_t k = 0; k + i <= n; k++) {
            double u = (double)i / n, v = (double)k / n, w = 1 - u - v;
            mark(s, w * p[0].x + u * p[1].x + v * p[2].x, w * p[0].y + u * p[1].y + v * p[2].y,
                 w * p[0].z + u * p[1].z + v * p[2].z);
        }
    }
}

// ---- Inside

// Cubes still to be looked at by the flood.
typedef struct flood {
    uint64_t *outside;
    uint32_t *stack;
    size_t stack_count;
} flood;

static void visit(flood *f, const hw_solid *s, size_t i)
{
    if (has_bit(s->bits, i) || has_bit(f->outside, i))
        return;
    set_bit(f->outside, i);
    f->stack[f->stack_count++] = (uint32_t)i;
}

static void visit_neighbours(flood *f, const hw_solid *s, size_t i)
{
    const size_t steps[3] = {1, (size_t)s->count[0], (size_t)s->count[0] * (size_t)s->count[1]};
    const size_t at[3] = {i % steps[1], i / steps[1] % (size_t)s->count[1], i / steps[2]};
    for (int axis = 0; axis < 3; axis++) {
        if (at[axis] > 0)
            visit(f, s, i - steps[axis]);
        if (at[axis] + 1 < (size_t)s->count[axis])
            visit(f, s, i + steps[axis]);
    }
}

// Everything that cannot be reached from the border of the grid, which no surface touches, is in.
static hw_status fill_inside(hw_solid *s)
{
    hw_status status = HW_OK;
    flood f = {0};
    size_t count = cube_count(s), words = (count + 63) / 64;
    HW_GO(HW_NEW(&f.outside, words));
    HW_GO(HW_NEW(&f.stack, count));
    visit(&f, s, 0);
    while (f.stack_count > 0)
        visit_neighbours(&f, s, f.stack[--f.stack_count]);
    for (size_t i = 0; i < words; i++)
        s->bits[i] = ~f.outside[i];
out:
    hw_free(f.outside);
    hw_free(f.stack);
    return status;
}

hw_status hw_solid_make(hw_solid *out, const hw_mesh *mesh, double side)
{
    hw_status status = HW_OK;
    hw_solid s = {0};
    *out = s;
    hw_box box = hw_mesh_bounds(mesh);
    hw_vec3 size = hw_box_size(box);
    double extent = fmax(fmax((double)size.x, (double)size.y), (double)size.z);
    // One cube stays free on each side, and half of one for rounding.
    s.side = fmax(side, extent / (HW_SOLID_SIDE_MAX - 4));
    double most = fmax(SAMPLES_MAX, 2 * SAMPLES_OF_ONE * (mesh->index_count / 3));
    while (sample_count(mesh, s.side) > most && s.side < extent)
        s.side *= 2;
    float margin = (float)(1.5 * s.side);
    s.origin = hw_v3_sub(box.min, hw_v3(margin, margin, margin));
    const float sizes[3] = {size.x, size.y, size.z};
    for (int i = 0; i < 3; i++)
        s.count[i] = (int32_t)ceil(sizes[i] / s.side) + 3;
    HW_GO(HW_NEW(&s.bits, (cube_count(&s) + 63) / 64));
    for (size_t t = 0; t < mesh->index_count / 3; t++) {
        hw_vec3 p[3];
        corners_of(mesh, t, p);
        mark_triangle(&s, p);
    }
    HW_GO(fill_inside(&s));
    *out = s;
    s = (hw_solid){0};
out:
    hw_solid_free(&s);
    return status;
}

void hw_solid_free(hw_solid *solid)
{
    if (!solid)
        return;
    hw_free(solid->bits);
    *solid = (hw_solid){0};
}
