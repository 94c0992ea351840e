#include "camera_text.h"
#include "file.h"
#include "image_io.h"
#include "log.h"
#include "target.h"
#include "walk.h"
#include <string.h>

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
    HW_GO(hw_image_write_opaque(name, &image));
out:
    hw_image_free(&image);
    hw_target_destroy(target);
    return status;
}

// ---- Recordings

hw_status walk_write_recording(walk *w)
{
    hw_tour tour;
    HW_TRY(hw_tour_write(w->record_path, &w->walker.recorded)); // else it goes on
    hw_walker_take_recorded(&w->walker, &tour);
    walk_say(w, WALK_MESSAGE_MS, "Saved %s: %u frames", w->record_path, tour.frame_count);
    hw_tour_free(&tour);
    return HW_OK;
}

hw_status walk_keep_recording(walk *w)
{
    char error[HW_ERROR_CAPACITY];
    hw_status status = walk_write_recording(w);
    if (status == HW_OK)
        return HW_OK;
    hw_error_save(error);
    w->record_path = w->record_name;
    if (free_name("hexwalk_tour", ".json", w->record_name, sizeof w->record_name) == HW_OK &&
        walk_write_recording(w) == HW_OK)
        hw_log_warning("the recording is in %s", w->record_path);
    hw_error_restore(error);
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

void walk_copy_camera(walk *w)
{
    char text[256];
    hw_camera camera = hw_walker_camera(&w->walker, 1, 1);
    hw_camera_format(&camera, text, sizeof text);
    hw_context_set_clipboard(w->context, text);
    walk_say(w, WALK_MESSAGE_MS, "Copied %s", text);
}

hw_status walk_paste_camera(walk *w)
{
    hw_camera camera;
    const char *text = hw_context_clipboard(w->context);
    if (!text)
        return hw_fail(HW_NOT_FOUND, "the clipboard holds no text");
    HW_TRY(hw_camera_parse("clipboard", text, &camera));
    hw_walker_place(&w->walker, camera.eye, camera.forward);
    hw_walker_set_fov(&w->walker, camera.fov_degrees);
    bool moved = hw_v3_length(hw_v3_sub(hw_walker_view(&w->walker).eye, camera.eye)) > 1e-3f;
    walk_say(w, WALK_MESSAGE_MS, moved ? "Pasted, moved to where there are cells" : "Pasted");
    return HW_OK;
}
