// The light of scenes/appearance.h, whose constants come in as macros. n: world normal of any
// length; a zero one gets the ambient light alone.
float hw_light(vec3 n)
{
    vec3 l = normalize(vec3(HW_LIGHT_X, HW_LIGHT_Y, HW_LIGHT_Z));
    float d = dot(n, l) * inversesqrt(max(dot(n, n), 1e-20));
    return HW_LIGHT_AMBIENT + HW_LIGHT_DIRECTIONAL * max(d, 0.0);
}
