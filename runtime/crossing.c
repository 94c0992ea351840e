#include "crossing.h"
#include <math.h>

hw_crossing hw_crossing_at(const hw_hexgrid *grid, hw_cell_id id, hw_vec3 eye, double width)
{
    hw_crossing c = {0};
    double strip = width * grid->cell_size;
    double distance = hw_cell_border(grid, id, (double)eye.x, (double)eye.y, &c.other);
    if (distance < strip)
        c.share = (float)(0.5 * (1 - distance / strip));
    return c;
}

int hw_fade_phase(hw_fade fade)
{
    return fade == HW_FADE_NONE ? HW_PHASE_WHOLE : HW_PHASE_DISSOLVING;
}

void hw_fade_range(hw_fade fade, float share, float out[2])
{
    out[0] = fade == HW_FADE_OUT ? share : 0;
    out[1] = fade == HW_FADE_IN ? share : 1;
}
