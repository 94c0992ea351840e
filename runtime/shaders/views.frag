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
#ifdef DISSOLVE
uniform vec2 u_kept;
#endif
out vec4 o_color;
void main()
{
#ifdef DISSOLVE
    hw_dissolve(u_kept);
#endif
#if defined(COLORED)
    o_color = vec4(v_color, 1.0);
#elif defined(BLENDED)
    vec4 first = textureProj(u_atlas, v_first), second = textureProj(u_atlas, v_second);
    o_color = vec4(mix(first.rgb, second.rgb, u_blend), 1.0);
#else
    o_color = vec4(textureProj(u_atlas, v_first).rgb, 1.0);
#endif
}
