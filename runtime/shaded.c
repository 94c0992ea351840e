#include "shaded.h"
#include "alloc.h"
#include "shaders.h"
#include <math.h>

typedef struct vertex {
    float position[3];
    int16_t normal[4]; // the fourth is padding
    uint8_t color[4];
} vertex;
_Static_assert(sizeof(vertex) == 24, "a shaded vertex is 24 bytes");

static int16_t pack_snorm(float v)
{
    return (int16_t)lrintf(fminf(fmaxf(v, -1), 1) * 32767);
}

static void pack_vertex(const hw_mesh *mesh, uint32_t i, vertex *out)
{
    hw_vec3 p = mesh->positions[i], n = mesh->normals[i];
    hw_color8 c = mesh->colors ? mesh->colors[i] : (hw_color8){255, 255, 255, 255};
    *out = (vertex){{p.x, p.y, p.z},
                    {pack_snorm(n.x), pack_snorm(n.y), pack_snorm(n.z), 0},
                    {c.r, c.g, c.b, c.a}};
}

// Vertices, then the uvs of all vertices behind them.
static hw_status upload_vertices(hw_gpu_account *account, const hw_mesh *mesh, hw_gpu_buffer *out)
{
    size_t count = mesh->vertex_count, uv_bytes = mesh->uvs ? count * sizeof(hw_uv) : 0;
    vertex *packed = NULL;
    HW_TRY(HW_NEW(&packed, count));
    for (uint32_t i = 0; i < count; i++)
        pack_vertex(mesh, i, &packed[i]);
    size_t bytes = count * sizeof *packed;
    hw_status status =
        hw_gpu_buffer_create(account, GL_ARRAY_BUFFER, NULL, bytes + uv_bytes, GL_STATIC_DRAW, out);
    if (status == HW_OK) {
        glBufferSubData(GL_ARRAY_BUFFER, 0, (GLsizeiptr)bytes, packed);
        if (uv_bytes)
            glBufferSubData(GL_ARRAY_BUFFER, (GLintptr)bytes, (GLsizeiptr)uv_bytes, mesh->uvs);
    }
    hw_free(packed);
    return status;
}

// 16-bit indices where they suffice.
static hw_status upload_indices(hw_gpu_account *account, const hw_mesh *mesh, hw_shaded_mesh *out)
{
    out->index_count = mesh->index_count;
    out->index_type = GL_UNSIGNED_INT;
    if (mesh->vertex_count > 65535) {
        return hw_gpu_buffer_create(account, GL_ELEMENT_ARRAY_BUFFER, mesh->indices,
                                    (uint64_t)mesh->index_count * 4, GL_STATIC_DRAW, &out->indices);
    }
    uint16_t *narrow = NULL;
    HW_TRY(HW_NEW(&narrow, mesh->index_count));
    for (uint32_t i = 0; i < mesh->index_count; i++)
        narrow[i] = (uint16_t)mesh->indices[i];
    out->index_type = GL_UNSIGNED_SHORT;
    hw_status status =
        hw_gpu_buffer_create(account, GL_ELEMENT_ARRAY_BUFFER, narrow,
                             (uint64_t)mesh->index_count * 2, GL_STATIC_DRAW, &out->indices);
    hw_free(narrow);
    return status;
}

hw_status hw_shaded_mesh_create(hw_gpu_account *account, const hw_mesh *mesh, hw_shaded_mesh *out)
{
    hw_status status = HW_OK;
    *out = (hw_shaded_mesh){.has_uvs = mesh->uvs != NULL};
    glGenVertexArrays(1, &out->array);
    glBindVertexArray(out->array);
    HW_GO(upload_vertices(account, mesh, &out->vertices));
    const GLsizei stride = sizeof(vertex);
    glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, stride,
                          hw_gpu_offset(offsetof(vertex, position)));
    glVertexAttribPointer(1, 4, GL_SHORT, GL_TRUE, stride, hw_gpu_offset(offsetof(vertex, normal)));
    glVertexAttribPointer(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, stride,
                          hw_gpu_offset(offsetof(vertex, color)));
    for (GLuint i = 0; i < 3; i++)
        glEnableVertexAttribArray(i);
    if (mesh->uvs) {
        glVertexAttribPointer(3, 2, GL_FLOAT, GL_FALSE, sizeof(hw_uv),
                              hw_gpu_offset((size_t)mesh->vertex_count * sizeof(vertex)));
        glEnableVertexAttribArray(3);
    }
    HW_GO(upload_indices(account, mesh, out));
    HW_GO(hw_gpu_check("uploading a mesh"));
out:
    glBindVertexArray(0);
    if (status != HW_OK)
        hw_shaded_mesh_destroy(account, out);
    return status;
}

void hw_shaded_mesh_destroy(hw_gpu_account *account, hw_shaded_mesh *mesh)
{
    hw_gpu_buffer_destroy(account, &mesh->vertices);
    hw_gpu_buffer_destroy(account, &mesh->indices);
    if (mesh->array)
        glDeleteVertexArrays(1, &mesh->array);
    *mesh = (hw_shaded_mesh){0};
}

static hw_status make_program(const char *defines, hw_shaded_program *out)
{
    HW_TRY(hw_gpu_program("geometry", defines, hw_shader_geometry_vert, hw_shader_geometry_frag,
                          &out->name));
    out->clip = glGetUniformLocation(out->name, "u_clip");
    out->normal = glGetUniformLocation(out->name, "u_normal");
    out->color = glGetUniformLocation(out->name, "u_color");
    return HW_OK;
}

static void make_object(const hw_shaded_scene *shaded, const hw_scene *scene, uint32_t i,
                        hw_shaded_object *out)
{
    const hw_object *object = &scene->objects[i];
    const hw_material *material = &scene->materials[object->material_idx];
    *out = (hw_shaded_object){.transform = object->transform,
                              .bounds = object->bounds,
                              .stretch = (float)hw_mat4_stretch(&object->transform),
                              .mesh_idx = object->mesh_idx,
                              .texture = shaded->textures[object->material_idx].name,
                              .mirrored = hw_mat4_mirrors(&object->transform)};
    hw_mat4 inverse;
    // A singular transform flattens the object; its light does not matter.
    (void)hw_mat4_inverse(object->transform, &inverse);
    for (int column = 0; column < 3; column++) {
        for (int row = 0; row < 3; row++)
            out->normal[column * 3 + row] = (float)inverse.m[row * 4 + column];
        out->color[column] = material->base_color[column];
    }
}

hw_status hw_shaded_scene_create(hw_gpu_account *account, const hw_scene *scene,
                                 hw_shaded_scene *out)
{
    hw_status status = HW_OK;
    uint32_t count = scene->object_count;
    *out = (hw_shaded_scene){0};
    HW_GO(HW_NEW(&out->objects, count));
    HW_GO(HW_NEW(&out->visible, count));
    HW_GO(HW_NEW(&out->order, count));
    HW_GO(HW_NEW(&out->order_scratch, count));
    HW_GO(HW_NEW(&out->textures, scene->material_count));
    HW_GO(hw_cull_set_create(&out->cull, count));
    HW_GO(make_program(NULL, &out->plain));
    HW_GO(make_program("#define TEXTURED\n", &out->textured));
    HW_GO(hw_ground_gl_create(account, &scene->ground, hw_scene_bounds(scene), &out->ground));
    out->texture_count = scene->material_count;
    for (uint32_t i = 0; i < scene->material_count; i++) {
        const hw_image *image = &scene->materials[i].texture;
        if (image->data)
            HW_GO(hw_gpu_texture_create(account, image, &out->textures[i]));
    }
    out->object_count = count;
    for (uint32_t i = 0; i < count; i++) {
        make_object(out, scene, i, &out->objects[i]);
        hw_cull_set_put(&out->cull, i, out->objects[i].bounds);
    }
out:
    if (status != HW_OK)
        hw_shaded_scene_destroy(account, out);
    return status;
}

void hw_shaded_scene_destroy(hw_gpu_account *account, hw_shaded_scene *scene)
{
    for (uint32_t i = 0; i < scene->texture_count; i++)
        hw_gpu_texture_destroy(account, &scene->textures[i]);
    hw_ground_gl_destroy(account, &scene->ground);
    if (scene->plain.name)
        glDeleteProgram(scene->plain.name);
    if (scene->textured.name)
        glDeleteProgram(scene->textured.name);
    hw_cull_set_free(&scene->cull);
    hw_free(scene->textures);
    hw_free(scene->objects);
    hw_free(scene->visible);
    hw_free(scene->order);
    hw_free(scene->order_scratch);
    *scene = (hw_shaded_scene){0};
}

uint32_t hw_shaded_scene_visible(hw_shaded_scene *scene, const hw_camera *camera,
                                 const hw_frustum *frustum)
{
    uint32_t count = hw_cull_visible(&scene->cull, frustum, scene->visible);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t object = scene->visible[i];
        float distance = hw_box_distance(scene->objects[object].bounds, camera->eye);
        scene->order[i] = (hw_cull_item){distance, object};
    }
    hw_cull_sort(scene->order, count, scene->order_scratch);
    return count;
}

void hw_shaded_draw(hw_shaded_pass *pass, const hw_shaded_scene *scene,
                    const hw_shaded_object *object, const hw_shaded_mesh *mesh,
                    const hw_mat4 *view_projection, hw_frame_stats *stats)
{
    bool textured = object->texture && mesh->has_uvs;
    const hw_shaded_program *program = textured ? &scene->textured : &scene->plain;
    if (program != pass->program) {
        glUseProgram(program->name);
        pass->program = program;
    }
    if (textured && object->texture != pass->texture) {
        glBindTexture(GL_TEXTURE_2D, object->texture);
        pass->texture = object->texture;
    }
    if (object->mirrored != pass->mirrored) {
        glFrontFace(object->mirrored ? GL_CW : GL_CCW);
        pass->mirrored = object->mirrored;
    }
    float clip[16];
    hw_mat4 product = hw_mat4_mul(*view_projection, object->transform);
    hw_mat4_to_float(&product, clip);
    glUniformMatrix4fv(program->clip, 1, GL_FALSE, clip);
    glUniformMatrix3fv(program->normal, 1, GL_FALSE, object->normal);
    glUniform3fv(program->color, 1, object->color);
    glBindVertexArray(mesh->array);
    glDrawElements(GL_TRIANGLES, (GLsizei)mesh->index_count, mesh->index_type, hw_gpu_offset(0));
    stats->triangles += mesh->index_count / 3;
    stats->draws++;
    hw_gpu_pace_add(&pass->pace, mesh->index_count / 3);
}

void hw_shaded_end(hw_shaded_pass *pass)
{
    if (pass->mirrored)
        glFrontFace(GL_CCW);
    pass->mirrored = false;
    glBindVertexArray(0);
    hw_gpu_pace_end(&pass->pace);
}
