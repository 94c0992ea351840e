in vec3 v_color;
#ifdef TEXTURED
in vec2 v_uv;
uniform sampler2D u_texture;
#endif
#ifdef DISSOLVE
uniform vec2 u_kept;
#endif
out vec4 o_color;
void main()
{
#ifdef DISSOLVE
    hw_dissolve(u_kept);
#endif
#ifdef TEXTURED
    o_color = vec4(v_color * texture(u_texture, v_uv).rgb, 1.0);
#else
    o_color = vec4(v_color, 1.0);
#endif
}
