#include "import.h"
#include "file.h"
#include "image_io.h"
#include "import_check.h"
#include "log.h"
#include "triangulate.h"
#include <assert.h>
#include <assimp/cimport.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NONE      UINT32_MAX
#define DEPTH_MAX 1000 // nesting of nodes

static pthread_once_t assimp_once = PTHREAD_ONCE_INIT;

// What is called of Assimp. It is loaded when the first model is read: with the libraries that it
// needs it takes memory that a walk through a dataset is better without.
static struct {
    __typeof__(aiImportFile) *import_file;
    __typeof__(aiImportFileFromMemory) *import_memory;
    __typeof__(aiReleaseImport) *release;
    __typeof__(aiGetErrorString) *error;
    __typeof__(aiGetMaterialTexture) *texture;
    __typeof__(aiGetMaterialString) *string;
    __typeof__(aiGetMaterialColor) *color;
    char problem[256]; // empty: it is there
} assimp;

typedef struct importer {
    const char *path;
    hw_model_kind kind;
    bool positions_only; // for hw_mesh_import: no normals, no textures
    const struct aiScene *source;
    hw_scene *scene;
    bool *mesh_used, *material_used;   // by a node other than the ground
    uint32_t *mesh_map, *material_map; // source index to scene index; NONE
    uint32_t *mirror_map;              // scene mesh to its mirror image; 0 = not made yet
    uint32_t *slots;                   // hash table of scene meshes, index + 1
    uint64_t *hashes;                  // of scene meshes
    size_t slot_count;                 // a power of two
    size_t object_capacity;
} importer;

// ---- Meshes -------------------------------------------------------------------------------------

static uint8_t to_byte(float c)
{
    if (!(c > 0))
        return 0;
    return c < 1 ? (uint8_t)lroundf(c * 255) : 255;
}

static hw_status copy_colors(const struct aiMesh *source, hw_mesh *out)
{
    const struct aiColor4D *c = source->mColors[0];
    if (!c)
        return HW_OK;
    HW_TRY(HW_NEW(&out->colors, out->vertex_count));
    for (uint32_t i = 0; i < out->vertex_count; i++)
        out->colors[i] =
            (hw_color8){to_byte(c[i].r), to_byte(c[i].g), to_byte(c[i].b), to_byte(c[i].a)};
    return HW_OK;
}

// Assimp's v is 0 at the bottom, ours at the top. NaN and infinity become 0.
static hw_status copy_uvs(const struct aiMesh *source, uint32_t channel, hw_mesh *out)
{
    if (channel >= AI_MAX_NUMBER_OF_TEXTURECOORDS || !source->mTextureCoords[channel])
        channel = 0;
    const struct aiVector3D *t = source->mTextureCoords[channel];
    if (!t)
        return HW_OK;
    HW_TRY(HW_NEW(&out->uvs, out->vertex_count));
    for (uint32_t i = 0; i < out->vertex_count; i++) {
        out->uvs[i].u = isfinite(t[i].x) ? t[i].x : 0;
        out->uvs[i].v = isfinite(t[i].y) ? 1 - t[i].y : 0;
    }
    return HW_OK;
}

// Unit normals as they are; others are normalised. If any is unusable all are left out (and
// computed later).
static hw_status copy_normals(const struct aiMesh *source, hw_mesh *out)
{
    if (!source->mNormals)
        return HW_OK;
    HW_TRY(HW_NEW(&out->normals, out->vertex_count));
    for (uint32_t i = 0; i < out->vertex_count; i++) {
        const struct aiVector3D *s = &source->mNormals[i];
        hw_vec3 n = hw_v3(s->x, s->y, s->z);
        double squared = (double)n.x * n.x + (double)n.y * n.y + (double)n.z * n.z;
        if (!isfinite(squared) || squared < 1e-30) {
            hw_free(out->normals);
            out->normals = NULL;
            return HW_OK;
        }
        bool unit = fabs(squared - 1) < 1e-5;
        out->normals[i] = unit ? n : hw_v3_scale(n, (float)(1 / sqrt(squared)));
    }
    return HW_OK;
}

// Polygons are cut here: Assimp's own step aborts the program over some of the odder ones. Points
// and lines are skipped, and polygons with an index out of range refused.
static hw_status copy_indices(const struct aiMesh *source, hw_mesh *out)
{
    size_t triangles = 0;
    for (uint32_t i = 0; i < source->mNumFaces; i++) {
        const struct aiFace *face = &source->mFaces[i];
        triangles += face->mNumIndices >= 3 ? face->mNumIndices - 2 : 0;
        for (uint32_t k = 0; k < face->mNumIndices; k++)
            if (face->mIndices[k] >= source->mNumVertices)
                return hw_fail(HW_FORMAT, "mesh %s: index %u out of range (%u vertices)", out->name,
                               face->mIndices[k], source->mNumVertices);
    }
    if (triangles > UINT32_MAX / 3)
        return hw_fail(HW_LIMIT, "mesh %s: %zu triangles are too many", out->name, triangles);
    HW_TRY(HW_NEW(&out->indices, 3 * triangles));
    for (uint32_t i = 0; i < source->mNumFaces; i++) {
        const struct aiFace *face = &source->mFaces[i];
        if (face->mNumIndices < 3)
            continue;
        hw_triangulate(out->positions, face->mIndices, face->mNumIndices,
                       out->indices + out->index_count);
        out->index_count += 3 * (face->mNumIndices - 2);
    }
    return HW_OK;
}

static bool has_unused_vertex(const hw_mesh *mesh, bool *used)
{
    for (uint32_t i = 0; i < mesh->index_count; i++)
        used[mesh->indices[i]] = true;
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        if (!used[i])
            return true;
    return false;
}

// Formats without shared vertices (STL has none, Assimp gives OBJ and 3DS none) are welded. A glTF
// file is indexed already: only vertices of other primitives have to go.
static hw_status tidy_mesh(const importer *in, hw_mesh *mesh)
{
    bool weld = in->kind != HW_MODEL_GLTF;
    if (!weld) {
        bool *used;
        HW_TRY(HW_NEW(&used, mesh->vertex_count));
        weld = has_unused_vertex(mesh, used);
        hw_free(used);
    }
    if (weld)
        HW_TRY(hw_mesh_weld(mesh));
    if (!mesh->normals && !in->positions_only)
        HW_TRY(hw_mesh_compute_normals(mesh));
    return HW_OK;
}

static uint32_t uv_channel(const struct aiMaterial *material);

// One Assimp mesh as ours, validated; *out stays without indices if it holds no triangle.
static hw_status convert_mesh(const importer *in, const struct aiMesh *source, hw_mesh *out)
{
    // An STL's normals are those of its facets: of no use once corners are shared.
    bool normals = !in->positions_only && in->kind != HW_MODEL_STL;
    HW_TRY(hw_strdup(&out->name, source->mName.data));
    if (!source->mVertices)
        return HW_OK;
    out->vertex_count = source->mNumVertices;
    HW_TRY(HW_NEW(&out->positions, out->vertex_count));
    for (uint32_t i = 0; i < out->vertex_count; i++) {
        const struct aiVector3D *p = &source->mVertices[i];
        out->positions[i] = hw_v3(p->x, p->y, p->z);
    }
    HW_TRY(copy_indices(source, out));
    if (out->index_count == 0)
        return HW_OK;
    HW_TRY(copy_colors(source, out));
    if (normals)
        HW_TRY(copy_normals(source, out));
    if (!in->positions_only)
        HW_TRY(copy_uvs(source, uv_channel(in->source->mMaterials[source->mMaterialIndex]), out));
    HW_TRY(hw_mesh_validate(out));
    return tidy_mesh(in, out);
}

// Appends the mesh unless an equal one is there; takes it over (or frees it) in any case.
static hw_status store_mesh(importer *in, hw_mesh *mesh, uint32_t *index)
{
    hw_scene *scene = in->scene;
    uint64_t hash = hw_mesh_hash(mesh);
    size_t slot = hash & (in->slot_count - 1);
    for (; in->slots[slot]; slot = (slot + 1) & (in->slot_count - 1)) {
        *index = in->slots[slot] - 1;
        if (in->hashes[*index] != hash || !hw_mesh_equal(mesh, &scene->meshes[*index]))
            continue;
        hw_mesh_free(mesh);
        return HW_OK;
    }
    *index = scene->mesh_count++;
    in->slots[slot] = *index + 1;
    in->hashes[*index] = hash;
    scene->meshes[*index] = *mesh;
    *mesh = (hw_mesh){0};
    return HW_OK;
}

// Assimp repeats a mesh for each material that it comes with: equal ones become one again.
static hw_status convert_meshes(importer *in)
{
    const struct aiScene *source = in->source;
    hw_status status = HW_OK;
    hw_mesh mesh = {0};
    in->slot_count = 16;
    while (in->slot_count < 2 * (size_t)source->mNumMeshes)
        in->slot_count *= 2;
    // Twice: every mesh may get a mirror image.
    HW_GO(HW_NEW(&in->scene->meshes, 2 * (size_t)source->mNumMeshes));
    HW_GO(HW_NEW(&in->mirror_map, 2 * (size_t)source->mNumMeshes));
    HW_GO(HW_NEW(&in->hashes, source->mNumMeshes));
    HW_GO(HW_NEW(&in->slots, in->slot_count));
    for (uint32_t i = 0; i < source->mNumMeshes; i++) {
        in->mesh_map[i] = NONE;
        if (!in->mesh_used[i])
            continue;
        HW_GO(convert_mesh(in, source->mMeshes[i], &mesh));
        if (mesh.index_count == 0) {
            hw_mesh_free(&mesh);
            continue;
        }
        HW_GO(store_mesh(in, &mesh, &in->mesh_map[i]));
        in->material_used[source->mMeshes[i]->mMaterialIndex] = true;
    }
out:
    hw_mesh_free(&mesh);
    return status;
}

// The mesh reflected at the y-z plane, for objects whose transform mirrors.
static hw_status mirror_mesh(importer *in, uint32_t mesh_idx, uint32_t *mirrored)
{
    if (in->mirror_map[mesh_idx] == 0) {
        hw_mesh *out = &in->scene->meshes[in->scene->mesh_count];
        hw_mat4 mirror = hw_mat4_scale(-1, 1, 1);
        HW_TRY(hw_mesh_copy(&in->scene->meshes[mesh_idx], out));
        hw_mesh_transform(out, &mirror);
        in->mirror_map[mesh_idx] = in->scene->mesh_count++;
    }
    *mirrored = in->mirror_map[mesh_idx];
    return HW_OK;
}

// ---- Materials ----------------------------------------------------------------------------------

// The texture that gives the base colour; false if there is none.
static bool base_texture(const struct aiMaterial *material, struct aiString *path,
                         uint32_t *channel)
{
    static const enum aiTextureType types[] = {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE};
    for (int i = 0; i < 2; i++) {
        unsigned uv = 0;
        if (assimp.texture(material, types[i], 0, path, NULL, &uv, NULL, NULL, NULL, NULL) ==
            aiReturn_SUCCESS) {
            *channel = uv;
            return path->length > 0;
        }
    }
    return false;
}

static uint32_t uv_channel(const struct aiMaterial *material)
{
    struct aiString path = {0};
    uint32_t channel = 0;
    return base_texture(material, &path, &channel) ? channel : 0;
}

// "*3" is the fourth texture inside the file; else textures go by the name they had outside.
static const struct aiTexture *embedded_texture(const struct aiScene *source, const char *path)
{
    if (path[0] == '*') {
        char *end;
        unsigned long i = strtoul(path + 1, &end, 10);
        return end != path + 1 && i < source->mNumTextures ? source->mTextures[i] : NULL;
    }
    for (uint32_t i = 0; i < source->mNumTextures; i++)
        if (source->mTextures[i]->mFilename.length > 0 &&
            strcmp(source->mTextures[i]->mFilename.data, path) == 0)
            return source->mTextures[i];
    return NULL;
}

static hw_status read_embedded(const importer *in, const struct aiTexture *t, hw_image *out)
{
    if (t->mHeight == 0) // a whole image file of mWidth bytes
        return hw_image_decode(in->path, t->pcData, t->mWidth, out);
    HW_TRY(hw_image_make(out, t->mWidth, t->mHeight, 4));
    for (size_t i = 0; i < (size_t)t->mWidth * t->mHeight; i++) {
        const struct aiTexel *p = &t->pcData[i];
        uint8_t rgba[4] = {p->r, p->g, p->b, p->a};
        memcpy(out->data + 4 * i, rgba, 4);
    }
    return HW_OK;
}

// Relative to the model's folder; failing that, the bare file name there.
static hw_status read_external(const importer *in, const char *name, hw_image *out)
{
    hw_status status = HW_OK;
    char *dir = NULL, *local = NULL, *full = NULL;
    HW_GO(hw_path_dir(&dir, in->path));
    HW_GO(hw_strdup(&local, name));
    hw_model_decode_path(local, in->kind == HW_MODEL_GLTF);
    HW_GO(hw_path_join(&full, dir, local));
    const char *slash = strrchr(local, '/');
    if (!hw_path_exists(full) && slash && slash[1]) {
        hw_free(full);
        full = NULL;
        HW_GO(hw_path_join(&full, dir, slash + 1));
    }
    if (!hw_path_exists(full)) {
        status = hw_fail(HW_NOT_FOUND, "%s: texture %s not found", in->path, local);
        goto out;
    }
    HW_GO(hw_image_read(full, out));
out:
    hw_free(dir);
    hw_free(local);
    hw_free(full);
    return status;
}

// A texture that cannot be read is a warning; the material then has none.
static hw_status read_texture(const importer *in, const struct aiMaterial *source, hw_image *out)
{
    struct aiString path = {0};
    uint32_t channel;
    if (in->positions_only || !base_texture(source, &path, &channel))
        return HW_OK;
    const struct aiTexture *embedded = embedded_texture(in->source, path.data);
    hw_status status =
        embedded ? read_embedded(in, embedded, out) : read_external(in, path.data, out);
    if (status == HW_OK)
        return HW_OK;
    hw_image_free(out);
    if (status == HW_MEMORY)
        return status;
    hw_log_warning("%s; going on without it", hw_error_text());
    return HW_OK;
}

static void base_color(const importer *in, const struct aiMaterial *source, float out[3])
{
    struct aiString name = {0};
    struct aiColor4D c = {1, 1, 1, 1};
    (void)assimp.string(source, AI_MATKEY_NAME, &name);
    // Assimp's own gray, for models without materials, is no colour of theirs.
    bool bare = in->kind == HW_MODEL_PLY || in->kind == HW_MODEL_OFF || in->kind == HW_MODEL_STL;
    bool invented =
        bare || (in->kind != HW_MODEL_GLTF && (strcmp(name.data, AI_DEFAULT_MATERIAL_NAME) == 0 ||
                                               strcmp(name.data, "%%%DEFAULT") == 0));
    if (!invented && assimp.color(source, AI_MATKEY_BASE_COLOR, &c) != aiReturn_SUCCESS &&
        assimp.color(source, AI_MATKEY_COLOR_DIFFUSE, &c) != aiReturn_SUCCESS)
        c = (struct aiColor4D){1, 1, 1, 1};
    const float rgb[3] = {c.r, c.g, c.b};
    for (int k = 0; k < 3; k++)
        out[k] = rgb[k] > 0 ? fminf(rgb[k], 1) : 0;
}

static hw_status convert_materials(importer *in)
{
    const struct aiScene *source = in->source;
    HW_TRY(HW_NEW(&in->scene->materials, source->mNumMaterials));
    for (uint32_t i = 0; i < source->mNumMaterials; i++) {
        in->material_map[i] = NONE;
        if (!in->material_used[i])
            continue;
        in->material_map[i] = in->scene->material_count;
        hw_material *out = &in->scene->materials[in->scene->material_count++];
        struct aiString name = {0};
        (void)assimp.string(source->mMaterials[i], AI_MATKEY_NAME, &name);
        HW_TRY(hw_strdup(&out->name, name.data));
        base_color(in, source->mMaterials[i], out->base_color);
        HW_TRY(read_texture(in, source->mMaterials[i], &out->texture));
    }
    return HW_OK;
}

// ---- Nodes --------------------------------------------------------------------------------------

static hw_mat4 to_mat4(const struct aiMatrix4x4 *a) // Assimp's is row-major
{
    return (hw_mat4){{a->a1, a->b1, a->c1, a->d1, a->a2, a->b2, a->c2, a->d2, a->a3, a->b3, a->c3,
                      a->d3, a->a4, a->b4, a->c4, a->d4}};
}

static double determinant(const hw_mat4 *t)
{
    const double *m = t->m;
    return m[0] * (m[5] * m[10] - m[9] * m[6]) - m[4] * (m[1] * m[10] - m[9] * m[2]) +
           m[8] * (m[1] * m[6] - m[5] * m[2]);
}

static hw_status add_object(importer *in, uint32_t mesh_idx, uint32_t material_idx,
                            hw_mat4 transform)
{
    hw_scene *scene = in->scene;
    double d = determinant(&transform);
    hw_mat4 inverse;
    if (d == 0 || !hw_mat4_inverse(transform, &inverse)) { // rounding may leave a little of 0
        hw_log_warning("%s: an object of mesh %s is scaled to nothing; it is left out", in->path,
                       scene->meshes[mesh_idx].name);
        return HW_OK;
    }
    if (d < 0) {
        HW_TRY(mirror_mesh(in, mesh_idx, &mesh_idx));
        transform = hw_mat4_mul(transform, hw_mat4_scale(-1, 1, 1));
    }
    if (scene->object_count == UINT32_MAX)
        return hw_fail(HW_LIMIT, "too many objects");
    HW_TRY(HW_RESERVE(&scene->objects, &in->object_capacity, (size_t)scene->object_count + 1));
    scene->objects[scene->object_count++] =
        (hw_object){mesh_idx, material_idx, transform, hw_box_empty()};
    return HW_OK;
}

static bool is_ground(const struct aiNode *node)
{
    return node->mNumMeshes > 0 && strcmp(node->mName.data, HW_GROUND_NAME) == 0;
}

static void set_ground(importer *in, const struct aiNode *node, const hw_mat4 *transform)
{
    hw_ground *ground = &in->scene->ground;
    hw_box box = hw_box_empty();
    for (uint32_t i = 0; i < node->mNumMeshes; i++) {
        const struct aiMesh *mesh = in->source->mMeshes[node->mMeshes[i]];
        for (uint32_t k = 0; k < mesh->mNumVertices; k++) {
            hw_vec3 p = hw_v3(mesh->mVertices[k].x, mesh->mVertices[k].y, mesh->mVertices[k].z);
            hw_box_add(&box, hw_mat4_point(transform, p));
        }
        base_color(in, in->source->mMaterials[mesh->mMaterialIndex], ground->color);
    }
    ground->present = !hw_box_is_empty(box);
    ground->rect = box;
    ground->rect.max.z = box.min.z;
}

// Walks the tree twice: first to mark what objects use, then (objects) to make them.
static hw_status walk_node(importer *in, const struct aiNode *node, const hw_mat4 *parent,
                           uint32_t depth, bool objects)
{
    if (depth > DEPTH_MAX)
        return hw_fail(HW_LIMIT, "nodes are nested deeper than %d", DEPTH_MAX);
    hw_mat4 local = to_mat4(&node->mTransformation);
    hw_mat4 transform = hw_mat4_mul(*parent, local);
    bool ground = is_ground(node);
    if (ground && objects)
        set_ground(in, node, &transform);
    for (uint32_t i = 0; !ground && i < node->mNumMeshes; i++) {
        uint32_t m = node->mMeshes[i];
        if (!objects)
            in->mesh_used[m] = true;
        else if (in->mesh_map[m] != NONE)
            HW_TRY(add_object(in, in->mesh_map[m],
                              in->material_map[in->source->mMeshes[m]->mMaterialIndex], transform));
    }
    for (uint32_t i = 0; i < node->mNumChildren; i++)
        HW_TRY(walk_node(in, node->mChildren[i], &transform, depth + 1, objects));
    return HW_OK;
}

// (x, y, z) -> (x, -z, y), a quarter turn about x: y up becomes z up. glTF files are y-up; 3DS
// files are z-up, but Assimp turns them, so this turns them back. A Collada file says which way is
// up (y if it does not), and Assimp turns it y-up.
static hw_mat4 upright(hw_model_kind kind)
{
    if (kind != HW_MODEL_GLTF && kind != HW_MODEL_3DS && kind != HW_MODEL_COLLADA)
        return hw_mat4_identity();
    return (hw_mat4){{1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1}};
}

// ---- Reading ------------------------------------------------------------------------------------

// ISO C has no conversion between pointers to objects and to functions; POSIX has.
static bool find(void *library, const char *name, void *function)
{
    void *symbol = dlsym(library, name);
    memcpy(function, &symbol, sizeof symbol);
    return symbol != NULL;
}

static void load_assimp(void)
{
    void *library = dlopen(HW_ASSIMP, RTLD_NOW | RTLD_LOCAL);
    bool loaded = library && find(library, "aiImportFile", &assimp.import_file) &&
                  find(library, "aiImportFileFromMemory", &assimp.import_memory) &&
                  find(library, "aiReleaseImport", &assimp.release) &&
                  find(library, "aiGetErrorString", &assimp.error) &&
                  find(library, "aiGetMaterialTexture", &assimp.texture) &&
                  find(library, "aiGetMaterialString", &assimp.string) &&
                  find(library, "aiGetMaterialColor", &assimp.color);
    const char *problem = loaded ? "" : dlerror();
    snprintf(assimp.problem, sizeof assimp.problem, "%s", problem ? problem : HW_ASSIMP);
}

static hw_status assimp_error(const char *path)
{
    char text[256];
    const char *source = assimp.error();
    size_t n = 0;
    for (; source && source[n] && n + 1 < sizeof text; n++)
        text[n] = (unsigned char)source[n] < ' ' ? ' ' : source[n];
    text[n] = 0;
    return hw_fail(HW_FORMAT, "%s: not readable as a model: %s", path, n ? text : "unknown reason");
}

// Refuses polygons too large to triangulate, and files of which Assimp has read only a part.
static hw_status check_polygons(const char *path, const struct aiScene *source, uint64_t expected)
{
    uint64_t faces = 0;
    for (uint32_t m = 0; m < source->mNumMeshes; m++) {
        faces += source->mMeshes[m]->mNumFaces;
        for (uint32_t i = 0; i < source->mMeshes[m]->mNumFaces; i++)
            if (source->mMeshes[m]->mFaces[i].mNumIndices > HW_POLYGON_MAX)
                return hw_fail(HW_LIMIT, "%s: polygon %u has %u corners (at most %u)", path, i,
                               source->mMeshes[m]->mFaces[i].mNumIndices, HW_POLYGON_MAX);
    }
    if (faces < expected)
        return hw_fail(HW_FORMAT, "%s: only %llu of %llu faces could be read", path,
                       (unsigned long long)faces, (unsigned long long)expected);
    return HW_OK;
}

// Reads, with Assimp's own check of its data structure, but none of its other steps.
static hw_status read_source(const char *path, const struct aiScene **out)
{
    const unsigned flags = aiProcess_ValidateDataStructure;
    hw_model_facts facts;
    HW_TRY(hw_import_check(path, &facts));
    pthread_once(&assimp_once, load_assimp);
    if (assimp.problem[0]) {
        hw_free(facts.text);
        return hw_fail(HW_IO, "%s: models need Assimp: %s", path, assimp.problem);
    }
    if (facts.text)
        *out = assimp.import_memory(facts.text, (unsigned)facts.text_bytes, flags,
                                    hw_model_kind_of(path) == HW_MODEL_OFF ? "off" : "gltf");
    else
        *out = assimp.import_file(path, flags);
    hw_free(facts.text);
    if (!*out)
        return assimp_error(path);
    if (!(*out)->mRootNode || (*out)->mNumMeshes == 0)
        return hw_fail(HW_FORMAT, "%s: no triangle", path);
    return check_polygons(path, *out, facts.faces);
}

static hw_status convert(importer *in)
{
    const struct aiScene *source = in->source;
    hw_mat4 up = upright(in->kind);
    HW_TRY(HW_NEW(&in->mesh_used, source->mNumMeshes));
    HW_TRY(HW_NEW(&in->mesh_map, source->mNumMeshes));
    HW_TRY(HW_NEW(&in->material_used, source->mNumMaterials));
    HW_TRY(HW_NEW(&in->material_map, source->mNumMaterials));
    HW_TRY(walk_node(in, source->mRootNode, &up, 0, false));
    HW_TRY(convert_meshes(in));
    HW_TRY(convert_materials(in));
    HW_TRY(walk_node(in, source->mRootNode, &up, 0, true));
    if (in->scene->object_count == 0)
        return hw_fail(HW_FORMAT, "no triangle");
    return HW_OK;
}

static void importer_free(importer *in)
{
    if (in->source)
        assimp.release(in->source);
    hw_free(in->mesh_used);
    hw_free(in->material_used);
    hw_free(in->mesh_map);
    hw_free(in->material_map);
    hw_free(in->mirror_map);
    hw_free(in->slots);
    hw_free(in->hashes);
}

static hw_status import_scene(const char *path, bool positions_only, hw_scene *out)
{
    hw_status status = HW_OK;
    hw_scene scene = {0};
    importer in = {.path = path,
                   .kind = hw_model_kind_of(path),
                   .positions_only = positions_only,
                   .scene = &scene};
    *out = (hw_scene){0};
    HW_GO(read_source(path, &in.source));
    HW_GO(hw_strdup(&scene.path, path));
    status = convert(&in);
    if (status != HW_OK) {
        status = hw_fail_prefix(status, path);
        goto out;
    }
    hw_scene_update_bounds(&scene);
    HW_GO(hw_scene_validate(&scene));
    *out = scene;
    scene = (hw_scene){0};
out:
    importer_free(&in);
    hw_scene_free(&scene);
    return status;
}

hw_status hw_scene_import(const char *path, hw_scene *out)
{
    return import_scene(path, false, out);
}

// ---- Merging ------------------------------------------------------------------------------------

static void append_object(const hw_scene *scene, const hw_object *object, hw_mesh *out)
{
    const hw_mesh *mesh = &scene->meshes[object->mesh_idx];
    for (uint32_t i = 0; i < mesh->index_count; i++)
        out->indices[out->index_count++] = out->vertex_count + mesh->indices[i];
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        uint32_t to = out->vertex_count++;
        out->positions[to] = hw_mat4_point(&object->transform, mesh->positions[i]);
        if (out->colors)
            out->colors[to] = mesh->colors ? mesh->colors[i] : (hw_color8){255, 255, 255, 255};
    }
}

static hw_status merge(const hw_scene *scene, hw_mesh *out)
{
    uint64_t vertices = 0, indices = 0;
    bool colors = false;
    for (uint32_t i = 0; i < scene->object_count; i++) {
        const hw_mesh *mesh = &scene->meshes[scene->objects[i].mesh_idx];
        vertices += mesh->vertex_count;
        indices += mesh->index_count;
        colors |= mesh->colors != NULL;
    }
    if (vertices >= UINT32_MAX || indices >= UINT32_MAX)
        return hw_fail(HW_LIMIT, "%s: too large for one mesh", scene->path);
    HW_TRY(HW_NEW(&out->positions, vertices));
    HW_TRY(HW_NEW(&out->indices, indices));
    if (colors)
        HW_TRY(HW_NEW(&out->colors, vertices));
    for (uint32_t i = 0; i < scene->object_count; i++)
        append_object(scene, &scene->objects[i], out);
    return HW_OK;
}

hw_status hw_mesh_import(const char *path, hw_mesh *out)
{
    hw_status status = HW_OK;
    hw_scene scene = {0};
    *out = (hw_mesh){0};
    HW_GO(import_scene(path, true, &scene));
    const char *slash = strrchr(path, '/');
    HW_GO(hw_strdup(&out->name, slash ? slash + 1 : path));
    HW_GO(merge(&scene, out));
    HW_GO(hw_mesh_clean(out));
    if (out->index_count == 0)
        status = hw_fail(HW_FORMAT, "%s: every triangle has zero area", path);
out:
    hw_scene_free(&scene);
    if (status != HW_OK)
        hw_mesh_free(out);
    return status;
}
