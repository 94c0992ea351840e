// Two pictures side by side, or their difference in luma as a colour over a dark picture.
uniform sampler2D u_left, u_right;
uniform int u_errors; // 0: side by side
uniform float u_seam; // pixels from the left
uniform float u_scale; // luma difference (of 1) at the ramp's end
out vec4 o_color;
float luma(vec3 c)
{
    return dot(c, vec3(0.299, 0.587, 0.114));
}
// As hw_compare_error_color.
vec3 ramp(float t)
{
    return clamp(vec3(2.0 * t - 0.5, 1.75 - abs(4.0 * t - 1.75), 1.5 - 4.0 * t), 0.0, 1.0);
}
void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 left = texelFetch(u_left, at, 0), right = texelFetch(u_right, at, 0);
    if (u_errors == 0) {
        o_color = gl_FragCoord.x < u_seam ? left : right;
        if (abs(gl_FragCoord.x - u_seam) < 1.0)
            o_color.rgb = vec3(1.0);
        return;
    }
    float error = abs(luma(left.rgb) - luma(right.rgb)), t = min(error / u_scale, 1.0);
    vec3 dark = vec3(0.3 * luma(right.rgb));
    o_color = vec4(mix(dark, ramp(t), smoothstep(0.0, 0.06, t)), left.a);
}
