in vec3 v_color;
#ifdef TEXTURED
in vec2 v_uv;
uniform sampler2D u_texture;
#endif
out vec4 o_color;
void main()
{
    hw_dissolve();
#ifdef TEXTURED
    o_color = vec4(v_color * texture(u_texture, v_uv).rgb, 1.0);
#else
    o_color = vec4(v_color, 1.0);
#endif
}
