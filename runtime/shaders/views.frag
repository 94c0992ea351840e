#ifdef COLORED
in vec3 v_color;
#else
uniform sampler2D u_atlas;
in vec3 v_first;
#endif
#ifdef BLENDED
in vec3 v_second;
uniform float u_blend; // share of the second
#endif
out vec4 o_color;
void main()
{
    hw_dissolve();
#if defined(COLORED)
    o_color = vec4(v_color, 1.0);
#elif defined(BLENDED)
    o_color = vec4(mix(textureProj(u_atlas, v_first).rgb, textureProj(u_atlas, v_second).rgb, u_blend), 1.0);
#else
    o_color = vec4(textureProj(u_atlas, v_first).rgb, 1.0);
#endif
}
