// Which pixels are drawn while a cell dissolves into the next (crossing.h): those with a number in
// [u_kept.x, u_kept.y). The numbers, interleaved gradient noise (J. Jimenez, Next Generation
// Post-Processing in Call of Duty: Advanced Warfare, 2014), are spread evenly over any few
// neighbours.
#ifdef DISSOLVE
uniform vec2 u_kept;
void hw_dissolve()
{
    float n = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
    if (n < u_kept.x || n >= u_kept.y)
        discard;
}
#else
void hw_dissolve()
{
}
#endif
