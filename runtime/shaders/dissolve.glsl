// Leaves out the pixels that an object shows from other cells (crossing.h): keeps those with a number
// in [kept.x, kept.y). The numbers, interleaved gradient noise (J. Jimenez, Next Generation
// Post-Processing in Call of Duty: Advanced Warfare, 2014), are spread evenly over any few
// neighbours.
void hw_dissolve(vec2 kept)
{
    float n = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
    if (n < kept.x || n >= kept.y)
        discard;
}
