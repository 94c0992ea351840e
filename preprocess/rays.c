#include "rays.h"
#include "alloc.h"
#include "parallel.h"
#include <assert.h>
#include <embree3/rtcore.h>
#include <pthread.h>
#include <string.h>

#ifdef __SANITIZE_THREAD__
// Embree guards the list of its threads' allocators by a lock of its own making, and TBB below it
// works with atomics: the thread sanitizer, which has compiled neither, sees no order in them.
const char *__tsan_default_suppressions(void);
const char *__tsan_default_suppressions(void)
{
    return "race:libembree3.so\nrace:libtbb.so\n";
}
#endif

// Where an object's own mesh lies: its scene, and the way from world to mesh space.
typedef struct object_place {
    uint32_t mesh_idx;
    hw_mat4 inverse;
} object_place;

typedef struct tree {
    uint32_t pins;
    bool building;
    uint64_t used; // by the clock of the pager
} tree;

// Of paged scenes: which trees stand (mesh_scenes) and which are needed.
typedef struct pager {
    hw_rays_memory memory;
    const hw_scene *scene;
    pthread_mutex_t mutex; // guards what follows, and mesh_scenes of what is not pinned
    pthread_cond_t built;
    tree *trees;
    uint64_t clock, builds;
    uint32_t pins;
} pager;

#define BUILD_BYTES 300u // of a tree and of its building, per triangle: measured, on the safe side

struct hw_rays {
    RTCDevice device;
    RTCScene *mesh_scenes; // one per mesh
    uint32_t mesh_count;
    RTCScene top; // instances of the mesh scenes; for a single mesh that mesh's scene (not owned)
    bool instanced;
    object_place *places; // one per object
    uint32_t object_count;
    const hw_mesh *mesh; // of hw_rays_create_mesh, else NULL
    pager *pager;        // of hw_rays_create_paged, else NULL
};

static hw_status check_device(RTCDevice device, const char *what)
{
    enum RTCError error = rtcGetDeviceError(device);
    if (error == RTC_ERROR_NONE)
        return HW_OK;
    if (error == RTC_ERROR_OUT_OF_MEMORY)
        return hw_fail(HW_MEMORY, "embree: out of memory while building %s", what);
    return hw_fail(HW_INTERNAL, "embree: error %d while building %s", (int)error, what);
}

static hw_status create_device(hw_rays *rays)
{
    // One thread per build: a parallel build may order a leaf's triangles differently from run to
    // run, and then rays through a shared edge would report either of its triangles. Meshes are
    // built beside each other instead.
    rays->device = rtcNewDevice("threads=1");
    if (!rays->device)
        return hw_fail(HW_INTERNAL, "embree: no device (error %d)", (int)rtcGetDeviceError(NULL));
    return HW_OK;
}

static hw_status create_mesh_scene(RTCDevice device, const hw_mesh *mesh, RTCScene *out)
{
    const char *name = mesh->name ? mesh->name : "a mesh";
    *out = rtcNewScene(device);
    if (!*out)
        return check_device(device, name);
    rtcSetSceneFlags(*out, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    if (!geometry)
        return check_device(device, name);
    // Vertices are copied: Embree reads 16 bytes at the last one, which a shared array need not
    // have.
    void *vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                             sizeof(hw_vec3), mesh->vertex_count);
    if (vertices)
        memcpy(vertices, mesh->positions, (size_t)mesh->vertex_count * sizeof(hw_vec3));
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh->indices,
                               0, 3 * sizeof(uint32_t), mesh->index_count / 3);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(*out, geometry, 0);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(*out);
    return check_device(device, name);
}

hw_status hw_rays_create_mesh(hw_rays **out, const hw_mesh *mesh)
{
    hw_status status = HW_OK;
    hw_rays *rays = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&rays, 1));
    HW_GO(create_device(rays));
    HW_GO(HW_NEW(&rays->mesh_scenes, 1));
    rays->mesh_count = 1;
    HW_GO(create_mesh_scene(rays->device, mesh, &rays->mesh_scenes[0]));
    HW_GO(HW_NEW(&rays->places, 1));
    rays->places[0] = (object_place){0, hw_mat4_identity()};
    rays->object_count = 1;
    rays->top = rays->mesh_scenes[0];
    rays->mesh = mesh;
    *out = rays;
    rays = NULL;
out:
    hw_rays_destroy(rays);
    return status;
}

const hw_mesh *hw_rays_mesh(const hw_rays *rays)
{
    return rays->mesh;
}

typedef struct mesh_job {
    hw_rays *rays;
    const hw_scene *scene;
} mesh_job;

static hw_status build_mesh(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    mesh_job *job = context;
    return create_mesh_scene(job->rays->device, &job->scene->meshes[index],
                             &job->rays->mesh_scenes[index]);
}

static hw_status place_object(hw_rays *rays, const hw_scene *scene, uint32_t object_idx)
{
    const hw_object *object = &scene->objects[object_idx];
    object_place *place = &rays->places[object_idx];
    place->mesh_idx = object->mesh_idx;
    if (!hw_mat4_inverse(object->transform, &place->inverse))
        return hw_fail(HW_FORMAT, "%s: object %u: its transform is singular",
                       scene->path ? scene->path : "scene", object_idx);
    return HW_OK;
}

static hw_status attach_object(hw_rays *rays, const hw_scene *scene, uint32_t object_idx)
{
    const hw_object *object = &scene->objects[object_idx];
    HW_TRY(place_object(rays, scene, object_idx));
    float columns[12];
    for (int column = 0; column < 4; column++)
        for (int row = 0; row < 3; row++)
            columns[column * 3 + row] = (float)object->transform.m[column * 4 + row];
    RTCGeometry geometry = rtcNewGeometry(rays->device, RTC_GEOMETRY_TYPE_INSTANCE);
    if (!geometry)
        return check_device(rays->device, "an instance");
    rtcSetGeometryInstancedScene(geometry, rays->mesh_scenes[object->mesh_idx]);
    rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(rays->top, geometry, object_idx);
    rtcReleaseGeometry(geometry);
    return check_device(rays->device, "an instance");
}

hw_status hw_rays_create_scene(hw_rays **out, const hw_scene *scene)
{
    hw_status status = HW_OK;
    hw_rays *rays = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&rays, 1));
    HW_GO(create_device(rays));
    HW_GO(HW_NEW(&rays->mesh_scenes, scene->mesh_count));
    rays->mesh_count = scene->mesh_count;
    mesh_job job = {rays, scene};
    HW_GO(hw_parallel_for(scene->mesh_count, 0, build_mesh, &job, NULL));

    HW_GO(HW_NEW(&rays->places, scene->object_count));
    rays->object_count = scene->object_count;
    rays->instanced = true;
    rays->top = rtcNewScene(rays->device);
    if (!rays->top)
        HW_GO(check_device(rays->device, "the scene"));
    rtcSetSceneFlags(rays->top, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION);
    for (uint32_t i = 0; i < scene->object_count; i++)
        HW_GO(attach_object(rays, scene, i));
    rtcCommitScene(rays->top);
    HW_GO(check_device(rays->device, "the scene"));
    *out = rays;
    rays = NULL;
out:
    hw_rays_destroy(rays);
    return status;
}

// ---- paged scenes ----

hw_status hw_rays_create_paged(hw_rays **out, const hw_scene *scene, const hw_rays_memory *memory)
{
    hw_status status = HW_OK;
    hw_rays *rays = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&rays, 1));
    HW_GO(HW_NEW(&rays->pager, 1));
    if (memory)
        rays->pager->memory = *memory;
    rays->pager->scene = scene;
    pthread_mutex_init(&rays->pager->mutex, NULL);
    pthread_cond_init(&rays->pager->built, NULL);
    HW_GO(create_device(rays));
    HW_GO(HW_NEW(&rays->pager->trees, scene->mesh_count));
    HW_GO(HW_NEW(&rays->mesh_scenes, scene->mesh_count));
    rays->mesh_count = scene->mesh_count;
    HW_GO(HW_NEW(&rays->places, scene->object_count));
    rays->object_count = scene->object_count;
    for (uint32_t i = 0; i < scene->object_count; i++)
        HW_GO(place_object(rays, scene, i));
    *out = rays;
    rays = NULL;
out:
    hw_rays_destroy(rays);
    return status;
}

uint64_t hw_rays_build_bytes(const hw_mesh *mesh)
{
    return (uint64_t)mesh->index_count / 3 * BUILD_BYTES;
}

static hw_status build_tree(const hw_rays *rays, uint32_t mesh_idx, RTCScene *out)
{
    pager *p = rays->pager;
    const hw_mesh *mesh = &p->scene->meshes[mesh_idx];
    uint64_t bytes = hw_rays_build_bytes(mesh);
    *out = NULL;
    if (p->memory.reserve)
        HW_TRY(p->memory.reserve(p->memory.context, bytes));
    hw_status status = create_mesh_scene(rays->device, mesh, out);
    if (p->memory.release)
        p->memory.release(p->memory.context, bytes);
    if (status != HW_OK && *out) {
        rtcReleaseScene(*out);
        *out = NULL;
    }
    return status;
}

hw_status hw_rays_pin(const hw_rays *rays, uint32_t mesh_idx)
{
    pager *p = rays->pager;
    if (!p)
        return HW_OK;
    hw_status status = HW_OK;
    pthread_mutex_lock(&p->mutex);
    while (p->trees[mesh_idx].building)
        pthread_cond_wait(&p->built, &p->mutex);
    if (!rays->mesh_scenes[mesh_idx]) {
        RTCScene built;
        p->trees[mesh_idx].building = true;
        pthread_mutex_unlock(&p->mutex);
        status = build_tree(rays, mesh_idx, &built);
        pthread_mutex_lock(&p->mutex);
        rays->mesh_scenes[mesh_idx] = built;
        p->trees[mesh_idx].building = false;
        p->builds += status == HW_OK;
        pthread_cond_broadcast(&p->built);
    }
    if (status == HW_OK) {
        p->trees[mesh_idx].pins++;
        p->pins++;
        p->trees[mesh_idx].used = ++p->clock;
    }
    pthread_mutex_unlock(&p->mutex);
    return status;
}

void hw_rays_unpin(const hw_rays *rays, uint32_t mesh_idx)
{
    pager *p = rays->pager;
    if (!p)
        return;
    pthread_mutex_lock(&p->mutex);
    p->trees[mesh_idx].pins--;
    p->pins--;
    pthread_mutex_unlock(&p->mutex);
}

bool hw_rays_evict(hw_rays *rays)
{
    pager *p = rays->pager;
    uint32_t oldest = UINT32_MAX;
    pthread_mutex_lock(&p->mutex);
    for (uint32_t m = 0; m < rays->mesh_count; m++)
        if (rays->mesh_scenes[m] && p->trees[m].pins == 0 &&
            (oldest == UINT32_MAX || p->trees[m].used < p->trees[oldest].used))
            oldest = m;
    if (oldest != UINT32_MAX) {
        rtcReleaseScene(rays->mesh_scenes[oldest]);
        rays->mesh_scenes[oldest] = NULL;
    }
    pthread_mutex_unlock(&p->mutex);
    return oldest != UINT32_MAX;
}

uint32_t hw_rays_pins(const hw_rays *rays)
{
    if (!rays->pager)
        return 0;
    pthread_mutex_lock(&rays->pager->mutex);
    uint32_t pins = rays->pager->pins;
    pthread_mutex_unlock(&rays->pager->mutex);
    return pins;
}

uint64_t hw_rays_builds(const hw_rays *rays)
{
    if (!rays->pager)
        return rays->mesh_count;
    pthread_mutex_lock(&rays->pager->mutex);
    uint64_t builds = rays->pager->builds;
    pthread_mutex_unlock(&rays->pager->mutex);
    return builds;
}

void hw_rays_destroy(hw_rays *rays)
{
    if (!rays)
        return;
    if (rays->instanced && rays->top)
        rtcReleaseScene(rays->top);
    for (uint32_t i = 0; i < rays->mesh_count; i++)
        if (rays->mesh_scenes[i])
            rtcReleaseScene(rays->mesh_scenes[i]);
    if (rays->pager) {
        pthread_cond_destroy(&rays->pager->built);
        pthread_mutex_destroy(&rays->pager->mutex);
        hw_free(rays->pager->trees);
        hw_free(rays->pager);
    }
    if (rays->device)
        rtcReleaseDevice(rays->device);
    hw_free(rays->mesh_scenes);
    hw_free(rays->places);
    hw_free(rays);
}

static struct RTCRay make_ray(hw_vec3 origin, hw_vec3 direction, float t_min, float t_max)
{
    struct RTCRay ray = {0};
    ray.org_x = origin.x;
    ray.org_y = origin.y;
    ray.org_z = origin.z;
    ray.tnear = t_min > 0 ? t_min : 0; // Embree wants no negative start
    ray.dir_x = direction.x;
    ray.dir_y = direction.y;
    ray.dir_z = direction.z;
    ray.tfar = t_max;
    ray.mask = UINT32_MAX;
    return ray;
}

static hw_hit cast(RTCScene scene, hw_vec3 origin, hw_vec3 direction, float t_min, float t_max)
{
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    struct RTCRayHit hit;
    hit.ray = make_ray(origin, direction, t_min, t_max);
    hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    hit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene, &context, &hit);
    if (hit.hit.geomID == RTC_INVALID_GEOMETRY_ID)
        return (hw_hit){.t = INFINITY};
    uint32_t object_idx = hit.hit.instID[0];
    return (hw_hit){hit.ray.tfar, object_idx == RTC_INVALID_GEOMETRY_ID ? 0 : object_idx,
                    hit.hit.primID, hit.hit.u, hit.hit.v};
}

bool hw_hit_is_front(const hw_scene *scene, const hw_hit *hit, hw_vec3 direction)
{
    const hw_object *object = &scene->objects[hit->object_idx];
    const hw_mesh *mesh = &scene->meshes[object->mesh_idx];
    const uint32_t *t = mesh->indices + 3 * (size_t)hit->triangle_idx;
    hw_vec3 w[3];
    for (int k = 0; k < 3; k++)
        w[k] = hw_mat4_point(&object->transform, mesh->positions[t[k]]);
    hw_vec3 n = hw_v3_cross(hw_v3_sub(w[1], w[0]), hw_v3_sub(w[2], w[0]));
    return (hw_v3_dot(n, direction) < 0) != hw_mat4_mirrors(&object->transform);
}

hw_hit hw_rays_cast(const hw_rays *rays, hw_vec3 origin, hw_vec3 direction, float t_min,
                    float t_max)
{
    assert(rays->top);
    return cast(rays->top, origin, direction, t_min, t_max);
}

hw_hit hw_rays_cast_object(const hw_rays *rays, uint32_t object_idx, hw_vec3 origin,
                           hw_vec3 direction, float t_min, float t_max)
{
    assert(object_idx < rays->object_count);
    const object_place *place = &rays->places[object_idx];
    // The direction keeps its length in the sense of the map, so t is the same in both spaces.
    hw_hit hit = cast(rays->mesh_scenes[place->mesh_idx], hw_mat4_point(&place->inverse, origin),
                      hw_mat4_direction(&place->inverse, direction), t_min, t_max);
    hit.object_idx = object_idx;
    return hit;
}

#define PACKET HW_RAYS_PACKET

static void set_packet_ray(struct RTCRayHit16 *packet, uint32_t i, hw_vec3 origin,
                           hw_vec3 direction, float t_max)
{
    packet->ray.org_x[i] = origin.x;
    packet->ray.org_y[i] = origin.y;
    packet->ray.org_z[i] = origin.z;
    packet->ray.tnear[i] = 0;
    packet->ray.dir_x[i] = direction.x;
    packet->ray.dir_y[i] = direction.y;
    packet->ray.dir_z[i] = direction.z;
    packet->ray.time[i] = 0;
    packet->ray.tfar[i] = t_max;
    packet->ray.mask[i] = UINT32_MAX;
    packet->ray.id[i] = 0;
    packet->ray.flags[i] = 0;
    packet->hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    packet->hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
}

// Casts the first `count` rays of a packet, all PACKET of which are set.
static void cast_packet(RTCScene scene, struct RTCIntersectContext *context,
                        struct RTCRayHit16 *packet, uint32_t count, hw_hit *hits)
{
    _Alignas(64) int valid[PACKET];
    for (uint32_t i = 0; i < PACKET; i++)
        valid[i] = i < count ? -1 : 0;
    rtcIntersect16(valid, scene, context, packet);
    for (uint32_t i = 0; i < count; i++) {
        bool hit = packet->hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
        uint32_t object_idx = packet->hit.instID[0][i];
        hits[i].t = hit ? packet->ray.tfar[i] : INFINITY;
        hits[i].object_idx = hit && object_idx != RTC_INVALID_GEOMETRY_ID ? object_idx : 0;
        hits[i].triangle_idx = hit ? packet->hit.primID[i] : 0;
        hits[i].u = hit ? packet->hit.u[i] : 0;
        hits[i].v = hit ? packet->hit.v[i] : 0;
    }
}

static struct RTCIntersectContext packet_context(bool coherent)
{
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags =
        coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    return context;
}

static void cast_many(RTCScene scene, hw_vec3 origin, const hw_vec3 *directions, uint32_t count,
                      float t_min, bool coherent, hw_hit *hits)
{
    struct RTCIntersectContext context = packet_context(coherent);
    for (uint32_t first = 0; first < count; first += PACKET) {
        uint32_t n = count - first < PACKET ? count - first : PACKET;
        struct RTCRayHit16 packet;
        for (uint32_t i = 0; i < PACKET; i++) {
            set_packet_ray(&packet, i, origin, directions[first + (i < n ? i : 0)], INFINITY);
            packet.ray.tnear[i] = t_min > 0 ? t_min : 0;
        }
        cast_packet(scene, &context, &packet, n, hits + first);
    }
}

void hw_rays_cast_many(const hw_rays *rays, hw_vec3 origin, const hw_vec3 *directions,
                       uint32_t count, float t_min, hw_hit *hits)
{
    cast_many(rays->top, origin, directions, count, t_min, true, hits);
}

void hw_rays_cast_mesh_many(const hw_rays *rays, uint32_t mesh_idx, hw_vec3 origin,
                            const hw_vec3 *directions, uint32_t count, bool coherent, hw_hit *hits)
{
    assert(mesh_idx < rays->mesh_count);
    cast_many(rays->mesh_scenes[mesh_idx], origin, directions, count, 0, coherent, hits);
}

void hw_rays_cast_parallel(const hw_rays *rays, const hw_vec3 *origins, hw_vec3 direction,
                           uint32_t count, hw_hit *hits)
{
    assert(rays->mesh);
    struct RTCIntersectContext context = packet_context(true);
    for (uint32_t first = 0; first < count; first += PACKET) {
        uint32_t n = count - first < PACKET ? count - first : PACKET;
        struct RTCRayHit16 packet;
        for (uint32_t i = 0; i < PACKET; i++)
            set_packet_ray(&packet, i, origins[first + (i < n ? i : 0)], direction, INFINITY);
        cast_packet(rays->top, &context, &packet, n, hits + first);
    }
}

bool hw_rays_occluded(const hw_rays *rays, hw_vec3 origin, hw_vec3 direction, float t_min,
                      float t_max)
{
    assert(rays->top);
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    struct RTCRay ray = make_ray(origin, direction, t_min, t_max);
    rtcOccluded1(rays->top, &context, &ray);
    return ray.tfar < 0; // Embree marks a hit by -inf
}

// What a filter needs to know of the scene; the context comes first, as Embree hands it over.
typedef struct sided_context {
    struct RTCIntersectContext base;
    const object_place *places;
    const hw_rays_hiders *hiders;
} hiding_context;

// Where Embree keeps an array of a packet of N rays or hits: the accessors are for C++ alone.
enum { RAY_DIRECTION = 4, HIT_NORMAL = 0, HIT_INSTANCE = 7 };

// Lets rays pass through what does not hide, and through the backs of what is not solid.
static void pass_through(const struct RTCFilterFunctionNArguments *a)
{
    const hiding_context *context = (const hiding_context *)a->context;
    const bool *solid = context->hiders->solid, *objects = context->hiders->objects;
    const float *direction = (const float *)a->ray + (size_t)RAY_DIRECTION * a->N;
    const float *normal = (const float *)a->hit + (size_t)HIT_NORMAL * a->N;
    const uint32_t *instance = (const uint32_t *)a->hit + (size_t)HIT_INSTANCE * a->N;
    for (uint32_t i = 0; i < a->N; i++) {
        if (a->valid[i] != -1)
            continue;
        if (objects && !objects[instance[i]])
            a->valid[i] = 0;
        if (!solid || solid[context->places[instance[i]].mesh_idx])
            continue;
        float facing = 0; // ray and normal are both in the mesh's own space here
        for (uint32_t k = 0; k < 3; k++)
            facing += normal[k * a->N + i] * direction[k * a->N + i];
        if (!(facing < 0))
            a->valid[i] = 0;
    }
}

void hw_rays_occluded_many(const hw_rays *rays, hw_vec3 origin, const hw_vec3 *directions,
                           const float *t_max, uint32_t count, const hw_rays_hiders *hiders,
                           bool *hidden)
{
    assert(rays->top && (rays->instanced || !hiders) && count <= HW_RAYS_PACKET);
    // Not as coherent: Embree 3.13 then may never come back from an occlusion query on instances.
    hiding_context context = {packet_context(false), rays->places, hiders};
    if (hiders && (hiders->solid || hiders->objects))
        context.base.filter = pass_through;
    _Alignas(64) int valid[PACKET];
    _Alignas(64) struct RTCRay16 packet;
    for (uint32_t i = 0; i < PACKET; i++) {
        uint32_t k = i < count ? i : 0;
        valid[i] = i < count ? -1 : 0;
        packet.org_x[i] = origin.x;
        packet.org_y[i] = origin.y;
        packet.org_z[i] = origin.z;
        packet.tnear[i] = 0;
        packet.dir_x[i] = directions[k].x;
        packet.dir_y[i] = directions[k].y;
        packet.dir_z[i] = directions[k].z;
        packet.time[i] = 0;
        packet.tfar[i] = t_max[k];
        packet.mask[i] = UINT32_MAX;
        packet.id[i] = i;
        packet.flags[i] = 0;
    }
    rtcOccluded16(valid, rays->top, &context.base, &packet);
    for (uint32_t i = 0; i < count; i++)
        hidden[i] = packet.tfar[i] < 0; // Embree marks a hit by -inf
}

// Barycentric coordinates (u, v) of the point of triangle abc closest to p
// (Ericson, Real-Time Collision Detection, 5.1.5).
static void closest_on_triangle(hw_vec3 p, hw_vec3 a, hw_vec3 b, hw_vec3 c, float *u, float *v)
{
    hw_vec3 ab = hw_v3_sub(b, a), ac = hw_v3_sub(c, a), ap = hw_v3_sub(p, a);
    float d1 = hw_v3_dot(ab, ap), d2 = hw_v3_dot(ac, ap);
    *u = *v = 0;
    if (d1 <= 0 && d2 <= 0)
        return;
    hw_vec3 bp = hw_v3_sub(p, b);
    float d3 = hw_v3_dot(ab, bp), d4 = hw_v3_dot(ac, bp);
    if (d3 >= 0 && d4 <= d3) {
        *u = 1;
        return;
    }
    float vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) {
        *u = d1 - d3 > 0 ? d1 / (d1 - d3) : 0;
        return;
    }
    hw_vec3 cp = hw_v3_sub(p, c);
    float d5 = hw_v3_dot(ab, cp), d6 = hw_v3_dot(ac, cp);
    if (d6 >= 0 && d5 <= d6) {
        *v = 1;
        return;
    }
    float vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) {
        *v = d2 - d6 > 0 ? d2 / (d2 - d6) : 0;
        return;
    }
    float va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        float length = (d4 - d3) + (d5 - d6);
        *v = length > 0 ? (d4 - d3) / length : 0;
        *u = 1 - *v;
        return;
    }
    float sum = va + vb + vc;
    *u = sum > 0 ? vb / sum : 0;
    *v = sum > 0 ? vc / sum : 0;
}

typedef struct closest_query {
    const hw_mesh *mesh;
    hw_closest best;
} closest_query;

static bool closest_callback(struct RTCPointQueryFunctionArguments *arguments)
{
    closest_query *query = arguments->userPtr;
    const hw_mesh *mesh = query->mesh;
    const uint32_t *triangle = mesh->indices + 3 * (size_t)arguments->primID;
    hw_vec3 p = {arguments->query->x, arguments->query->y, arguments->query->z};
    hw_vec3 a = mesh->positions[triangle[0]];
    hw_vec3 b = mesh->positions[triangle[1]];
    hw_vec3 c = mesh->positions[triangle[2]];
    float u, v;
    closest_on_triangle(p, a, b, c, &u, &v);
    hw_vec3 point = hw_v3_mad(hw_v3_mad(a, hw_v3_sub(b, a), u), hw_v3_sub(c, a), v);
    float distance = hw_v3_length(hw_v3_sub(point, p));
    if (!(distance <= arguments->query->radius && distance < query->best.distance))
        return false;
    query->best = (hw_closest){distance, arguments->primID, u, v, point};
    arguments->query->radius = distance;
    return true;
}

hw_closest hw_rays_closest(const hw_rays *rays, hw_vec3 point, float radius)
{
    assert(rays->mesh);
    closest_query query = {rays->mesh, {.distance = INFINITY}};
    struct RTCPointQuery embree_query = {point.x, point.y, point.z, 0, radius};
    struct RTCPointQueryContext context;
    rtcInitPointQueryContext(&context);
    rtcPointQuery(rays->top, &embree_query, &context, closest_callback, &query);
    return query.best;
}
