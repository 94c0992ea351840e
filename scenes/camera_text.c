#include "camera_text.h"
#include "json.h"
#include "mesh.h"
#include <stdio.h>
#include <string.h>

#define FOV_MIN 1.0
#define FOV_MAX 170.0

void hw_camera_format(const hw_camera *camera, char *out, size_t capacity)
{
    const hw_vec3 e = camera->eye, f = camera->forward, u = camera->up;
    // Nine digits bring the same floats back.
    snprintf(out, capacity,
             "{\"eye\":[%.9g,%.9g,%.9g],\"forward\":[%.9g,%.9g,%.9g],\"up\":[%.9g,%.9g,%.9g],"
             "\"fov_degrees\":%.9g}",
             (double)e.x, (double)e.y, (double)e.z, (double)f.x, (double)f.y, (double)f.z,
             (double)u.x, (double)u.y, (double)u.z, (double)camera->fov_degrees);
}

static hw_status read_vector(const char *name, const cJSON *json, const char *key, hw_vec3 *out)
{
    double v[3];
    HW_TRY(hw_json_numbers(name, json, key, v, 3));
    for (int i = 0; i < 3; i++)
        if (fabs(v[i]) > (double)HW_COORDINATE_MAX)
            return hw_fail(HW_FORMAT, "%s: %s is out of range", name, key);
    *out = hw_v3((float)v[0], (float)v[1], (float)v[2]);
    return HW_OK;
}

static hw_status read_camera(const char *name, const cJSON *json, hw_camera *out)
{
    hw_camera camera = {.up = {0, 0, 1}};
    double fov;
    HW_TRY(read_vector(name, json, "eye", &camera.eye));
    HW_TRY(read_vector(name, json, "forward", &camera.forward));
    if (cJSON_HasObjectItem(json, "up"))
        HW_TRY(read_vector(name, json, "up", &camera.up));
    hw_vec3 side = hw_v3_cross(hw_v3_normalize(camera.forward), hw_v3_normalize(camera.up));
    if (!(hw_v3_length(side) > 1e-6f))
        return hw_fail(HW_FORMAT, "%s: forward and up are zero or parallel", name);
    HW_TRY(hw_json_number(name, json, "fov_degrees", &fov));
    if (!(fov >= FOV_MIN && fov <= FOV_MAX))
        return hw_fail(HW_FORMAT, "%s: fov_degrees is not within %g to %g", name, FOV_MIN, FOV_MAX);
    camera.fov_degrees = (float)fov;
    *out = camera;
    return HW_OK;
}

hw_status hw_camera_parse(const char *name, const char *text, hw_camera *out)
{
    cJSON *json = NULL;
    size_t length = strnlen(text, HW_CAMERA_TEXT_MAX + 1);
    if (length > HW_CAMERA_TEXT_MAX)
        return hw_fail(HW_FORMAT, "%s: too long for a camera", name);
    HW_TRY(hw_json_parse(name, text, length, &json));
    hw_status status = read_camera(name, json, out);
    cJSON_Delete(json);
    return status;
}
