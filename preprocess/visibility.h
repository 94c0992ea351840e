// What a picture shows, by one ray a pixel: the ground truth that a dataset's lists of objects are
// judged by. Shares nothing with the occlusion culling but the rays.
#pragma once
#include "camera.h"
#include "rays.h"

// Adds to pixels[i] how many pixels of the camera's picture object i covers, for every object with
// skip[i] false (object_count of both; the others may count too low or not at all). Front faces
// alone are drawn, and the ground hides nothing. Thread-safe.
HW_MUST_USE hw_status hw_visibility_count(const hw_scene *scene, const hw_rays *rays,
                                          const hw_camera *camera, const bool *skip,
                                          uint32_t *pixels);
// Whether the eye is inside a closed object: what it sees from there is no picture.
bool hw_visibility_inside(const hw_scene *scene, const hw_rays *rays, hw_vec3 eye);
