// Full geometry (configurations A, B, L): light per vertex, colour interpolated.
layout(location = 0) in vec3 a_position;
layout(location = 1) in vec3 a_normal;
layout(location = 2) in vec3 a_color;
uniform mat4 u_clip;   // clip <- mesh
uniform mat3 u_normal; // world <- mesh, for normals
uniform vec3 u_color;  // the material's
out vec3 v_color;
#ifdef TEXTURED
layout(location = 3) in vec2 a_uv;
out vec2 v_uv;
#endif
void main()
{
    gl_Position = u_clip * vec4(a_position, 1.0);
    v_color = a_color * u_color * hw_light(u_normal * a_normal);
#ifdef TEXTURED
    v_uv = a_uv;
#endif
}
