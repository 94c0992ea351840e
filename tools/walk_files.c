#include "alloc.h"
#include "file.h"
#include "image_io.h"
#include "json.h"
#include "target.h"
#include "walk.h"
#include <math.h>
#include <string.h>

#define CAMERA_TEXT_MAX 4096
#define FOV_MIN         1.0
#define FOV_MAX         170.0

// ---- Files made on the way

// The first free name of a numbered series in the current folder.
static hw_status free_name(const char *stem, const char *extension, char *out, size_t capacity)
{
    for (unsigned i = 1; i <= 9999; i++) {
        snprintf(out, capacity, "%s_%04u%s", stem, i, extension);
        if (!hw_path_exists(out))
            return HW_OK;
    }
    return hw_fail(HW_LIMIT, "%s_0001%s to %s_9999%s all exist", stem, extension, stem, extension);
}

// Alpha marks objects; a picture has none.
static hw_status write_opaque(const char *path, const hw_image *rgba)
{
    hw_image rgb = {0};
    HW_TRY(hw_image_make(&rgb, rgba->width, rgba->height, 3));
    size_t pixels = (size_t)rgba->width * rgba->height;
    for (size_t i = 0; i < pixels; i++)
        memcpy(rgb.data + 3 * i, rgba->data + 4 * i, 3);
    hw_status status = hw_image_write(path, &rgb);
    hw_image_free(&rgb);
    return status;
}

// Draws the view once more off screen: no HUD, and whole whatever covers the window.
hw_status walk_screenshot(walk *w, const hw_camera *camera, char *name, size_t capacity)
{
    hw_status status = HW_OK;
    hw_target *target = NULL;
    hw_image image = {0};
    HW_GO(free_name("hexwalk", ".png", name, capacity));
    HW_GO(hw_target_create(&target, camera->width, camera->height, walk_samples()));
    hw_target_bind(target);
    HW_GO(walk_draw_view(w, camera));
    HW_GO(hw_target_read(target, &image));
    HW_GO(write_opaque(name, &image));
out:
    hw_image_free(&image);
    hw_target_destroy(target);
    return status;
}

// ---- Recordings

hw_status walk_write_recording(walk *w)
{
    hw_tour tour;
    hw_walker_take_recorded(&w->walker, &tour);
    hw_status status = hw_tour_write(w->record_path, &tour);
    if (status == HW_OK)
        walk_say(w, WALK_MESSAGE_MS, "Saved %s: %u frames", w->record_path, tour.frame_count);
    hw_tour_free(&tour);
    return status;
}

hw_status walk_start_recording(walk *w)
{
    HW_TRY(free_name("hexwalk_tour", ".json", w->record_name, sizeof w->record_name));
    w->record_path = w->record_name;
    HW_TRY(hw_walker_record(&w->walker));
    walk_say(w, WALK_MESSAGE_MS, "Recording %s: R ends it", w->record_path);
    return HW_OK;
}

// ---- The clipboard

void walk_format_camera(const hw_walker *walker, char *out, size_t capacity)
{
    hw_tour_frame v = hw_walker_view(walker);
    // Nine digits bring the same floats back.
    snprintf(out, capacity,
             "{\"eye\":[%.9g,%.9g,%.9g],\"forward\":[%.9g,%.9g,%.9g],\"fov_degrees\":%.9g}",
             (double)v.eye.x, (double)v.eye.y, (double)v.eye.z, (double)v.forward.x,
             (double)v.forward.y, (double)v.forward.z, walker->fov_degrees);
}

static hw_status check_camera(const double eye[3], const double forward[3], double fov_degrees)
{
    for (int i = 0; i < 3; i++)
        if (fabs(eye[i]) > (double)HW_COORDINATE_MAX ||
            fabs(forward[i]) > (double)HW_COORDINATE_MAX)
            return hw_fail(HW_FORMAT, "clipboard: a coordinate is out of range");
    double length =
        sqrt(forward[0] * forward[0] + forward[1] * forward[1] + forward[2] * forward[2]);
    if (!(length > 1e-6))
        return hw_fail(HW_FORMAT, "clipboard: forward has no direction");
    if (!(fov_degrees >= FOV_MIN && fov_degrees <= FOV_MAX))
        return hw_fail(HW_FORMAT, "clipboard: fov_degrees is not within %g to %g", FOV_MIN,
                       FOV_MAX);
    return HW_OK;
}

hw_status walk_parse_camera(const char *text, hw_tour_frame *view, double *fov_degrees)
{
    hw_status status = HW_OK;
    cJSON *json = NULL;
    double eye[3], forward[3];
    size_t length = strnlen(text, CAMERA_TEXT_MAX + 1);
    if (length > CAMERA_TEXT_MAX)
        return hw_fail(HW_FORMAT, "clipboard: too long for a camera");
    HW_GO(hw_json_parse("clipboard", text, length, &json));
    HW_GO(hw_json_numbers("clipboard", json, "eye", eye, 3));
    HW_GO(hw_json_numbers("clipboard", json, "forward", forward, 3));
    HW_GO(hw_json_number("clipboard", json, "fov_degrees", fov_degrees));
    HW_GO(check_camera(eye, forward, *fov_degrees));
    *view =
        (hw_tour_frame){.eye = hw_v3((float)eye[0], (float)eye[1], (float)eye[2]),
                        .forward = hw_v3((float)forward[0], (float)forward[1], (float)forward[2]),
                        .up = hw_v3(0, 0, 1)};
out:
    cJSON_Delete(json);
    return status;
}

void walk_copy_camera(walk *w)
{
    char text[256];
    walk_format_camera(&w->walker, text, sizeof text);
    hw_context_set_clipboard(w->context, text);
    walk_say(w, WALK_MESSAGE_MS, "Copied %s", text);
}

hw_status walk_paste_camera(walk *w)
{
    hw_tour_frame view;
    double fov_degrees;
    const char *text = hw_context_clipboard(w->context);
    if (!text)
        return hw_fail(HW_NOT_FOUND, "the clipboard holds no text");
    HW_TRY(walk_parse_camera(text, &view, &fov_degrees));
    hw_walker_place(&w->walker, view.eye, view.forward);
    w->walker.fov_degrees = fov_degrees;
    hw_vec3 eye = hw_walker_view(&w->walker).eye;
    bool moved = hw_v3_length(hw_v3_sub(eye, view.eye)) > 1e-3f;
    walk_say(w, WALK_MESSAGE_MS, moved ? "Pasted, moved to where there are cells" : "Pasted");
    return HW_OK;
}
