// A camera as a line of text, to be copied and pasted.
#pragma once
#include "camera.h"
#include "status.h"
#include <stddef.h>

#define HW_CAMERA_TEXT_MAX 4096 // bytes of what is parsed

// {"eye":[x,y,z],"forward":[x,y,z],"up":[x,y,z],"fov_degrees":60}, cut to capacity - 1 bytes.
// Parsing gives the same floats back.
void hw_camera_format(const hw_camera *camera, char *out, size_t capacity);
// "up" may be missing: z. Checked: finite numbers within +-1e9, forward and up neither zero nor
// parallel, a field of view from 1 to 170 degrees; HW_FORMAT tells what is wrong, with `name` in
// front. *out gets a size of 0 x 0 pixels; it is untouched on failure.
HW_MUST_USE hw_status hw_camera_parse(const char *name, const char *text, hw_camera *out);
