in vec2 v_uv;
uniform sampler2D u_atlas; // alpha: how much of a cut-out texel the object covers
#ifdef DISSOLVE
flat in vec2 v_kept;
#endif
out vec4 o_color;
void main()
{
#ifdef DISSOLVE
    hw_dissolve(v_kept);
#endif
#ifdef CUT_OUT
    vec4 texel = texture(u_atlas, v_uv);
    if (texel.a < 0.5)
        discard;
    o_color = vec4(texel.rgb, 1.0);
#else
    o_color = vec4(texture(u_atlas, v_uv).rgb, 1.0);
#endif
}
