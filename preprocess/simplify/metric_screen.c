// Deviation in pixels as seen from one place: the memoryless quadric, each plane weighted by how
// far a shift along its normal moves on the screen. A face seen edge-on shows all of it, one seen
// from the front only what parallax leaves.
#include "alloc.h"
#include "metrics.h"
#include <math.h>

#define FRONT_SHARE 0.05 // of a shift towards the viewer: parallax when the eye moves a little
#define BACK_SHARE  0.25 // of faces that look away: they bound what is seen only at outlines

typedef struct screen {
    double eye[3], focal_px;
} screen;

static void prepare(void *context, hw_domain *domain)
{
    const screen *s = context;
    domain->scratch = (hw_quadric){0};
    double ray[3], distance2 = 0;
    for (int i = 0; i < 3; i++) {
        ray[i] = domain->origin[i] + domain->ends[1][i] / 2 - s->eye[i];
        distance2 += ray[i] * ray[i];
    }
    double px2 = s->focal_px * s->focal_px / (distance2 + 1e-300); // square pixels per square unit
    for (uint32_t i = 0; i < domain->count; i++) {
        const hw_domain_face *f = &domain->faces[i];
        double size2 = 0, along = 0;
        for (int k = 0; k < 3; k++) {
            size2 += f->n[k] * f->n[k];
            along += f->n[k] * ray[k];
        }
        if (!(size2 > 0) || !(distance2 > 0))
            continue;
        double across2 = 1 - along * along / (size2 * distance2);
        double share = fmax(across2, FRONT_SHARE) * (along > 0 ? BACK_SHARE : 1);
        double weight = 0.5 * sqrt(size2) * px2 * share;
        hw_quadric_add_plane(&domain->scratch, f->n, f->d, weight * px2 / size2, weight);
    }
}

hw_status hw_metric_screen(const hw_metric_setup *setup, hw_metric *out)
{
    screen *s = NULL;
    *out = (hw_metric){0};
    HW_TRY(HW_NEW(&s, 1));
    s->eye[0] = (double)setup->eye.x;
    s->eye[1] = (double)setup->eye.y;
    s->eye[2] = (double)setup->eye.z;
    s->focal_px = setup->focal_px;
    *out = (hw_metric){.name = "screen",
                       .context = s,
                       .placement = HW_PLACEMENT_OPTIMAL,
                       .prepare = prepare,
                       .error = hw_scratch_error,
                       .optimum = hw_scratch_optimum,
                       .destroy = hw_free};
    return HW_OK;
}
