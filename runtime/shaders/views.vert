// MVMeshes: vertices in the image space of the record's own capture, textured by captures from
// several points (thesis 5.2.2), or, where none sees the surface, coloured by vertex.
layout(location = 0) in vec4 a_vertex; // x, y, z, record
uniform mat4 u_clip;                   // clip <- image space
#ifdef COLORED
layout(location = 1) in vec4 a_color;
out vec3 v_color;
#else
uniform mat4 u_first; // (u w, v w, 0, w) <- image space
out vec3 v_first;
#endif
#ifdef BLENDED
uniform mat4 u_second;
out vec3 v_second;
#endif
void main()
{
    vec4 position = vec4(a_vertex.xyz, 1.0);
    gl_Position = u_clip * position;
#ifdef COLORED
    v_color = a_color.rgb;
#else
    v_first = (u_first * position).xyw;
#endif
#ifdef BLENDED
    v_second = (u_second * position).xyw;
#endif
}
