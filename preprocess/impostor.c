#include "impostor.h"
#include "alloc.h"
#include <math.h>
#include <string.h>

// The level that tells where the object is, and how much further its original may reach: levels are
// chosen by the mean deviation of outlines, and tips deviate more.
#define OUTLINE_PX 0.5
#define MARGIN_PX  2.0

// Bounds in the image, and the mean parallax over the surface. False if the object reaches behind
// the plane of the cell's centre.
static bool measure(const hw_svmesh_job *job, const hw_mesh *level, double min[2], double max[2],
                    double *parallax)
{
    const hw_mat4 *transform = &job->scene->objects[job->object_idx].transform;
    double sum = 0, area = 0;
    min[0] = min[1] = (double)INFINITY;
    max[0] = max[1] = -(double)INFINITY;
    for (uint32_t i = 0; i < level->index_count; i += 3) {
        hw_vec3 p[3];
        double image[3], depth = 0;
        for (int k = 0; k < 3; k++) {
            p[k] = hw_mat4_point(transform, level->positions[level->indices[i + (uint32_t)k]]);
            if (!hw_svmesh_project(job, p[k], image))
                return false;
            for (int a = 0; a < 2; a++) {
                min[a] = fmin(min[a], image[a]);
                max[a] = fmax(max[a], image[a]);
            }
            depth += image[2] / 3;
        }
        double weight =
            (double)hw_v3_length(hw_v3_cross(hw_v3_sub(p[1], p[0]), hw_v3_sub(p[2], p[0])));
        sum += weight * depth;
        area += weight;
    }
    *parallax = sum / area;
    return area > 0;
}

hw_status hw_impostor_make(const hw_svmesh_job *job, hw_view_mesh *out)
{
    static const uint32_t corners[6] = {0, 1, 3, 0, 3, 2};
    double pixel = job->distance.effective / (job->view->focal_px * job->scale);
    const hw_mesh *level =
        &job->chain->levels[hw_chain_level_by_silhouette(job->chain, OUTLINE_PX * pixel)];
    double min[2], max[2], parallax;
    if (!measure(job, level, min, max, &parallax))
        return HW_OK; // nothing of it has an area
    HW_TRY(HW_NEW(&out->positions, 4));
    HW_TRY(HW_NEW(&out->indices, 6));
    for (int i = 0; i < 4; i++) {
        out->positions[i][0] = i & 1 ? max[0] + MARGIN_PX : min[0] - MARGIN_PX;
        out->positions[i][1] = i & 2 ? max[1] + MARGIN_PX : min[1] - MARGIN_PX;
        out->positions[i][2] = parallax;
    }
    memcpy(out->indices, corners, sizeof corners);
    out->vertex_count = 4;
    out->index_count = 6;
    return HW_OK;
}
