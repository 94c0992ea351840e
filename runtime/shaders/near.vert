// Near objects of the hybrid: a level of detail, lit per vertex.
layout(location = 0) in vec3 a_position;
layout(location = 1) in vec3 a_normal;
layout(location = 2) in vec3 a_color;
layout(location = 3) in vec2 a_uv;
uniform mat4 u_clip;        // clip <- mesh
uniform mat3 u_world_normal; // world <- mesh, for normals
uniform vec3 u_base_color;
out vec3 v_color;
#ifdef TEXTURED
out vec2 v_uv;
#endif
void main()
{
    gl_Position = u_clip * vec4(a_position, 1.0);
    v_color = u_base_color * a_color * hw_light(u_world_normal * a_normal);
#ifdef TEXTURED
    v_uv = a_uv;
#endif
}
