#include "walk.h"
#include <math.h>

#define SEAM_PER_S 0.4 // of the window's width, while a key is held

static void set_debug(walk *w)
{
    for (int i = 0; i < 4; i++)
        if (w->renderers[i])
            hw_renderer_set_debug_view(w->renderers[i], &w->debug);
}

static void freeze(walk *w)
{
    if (w->input.width == 0)
        return; // minimised: there is no view
    w->debug.frozen = !w->debug.frozen;
    if (w->debug.frozen)
        w->debug.camera = hw_walker_camera(&w->walker, w->input.width, w->input.height);
    walk_say(w, WALK_MESSAGE_MS, "%s",
             w->debug.frozen ? "Cells and culling stay as they are; the map shows from where"
                             : "Cells and culling follow the viewer");
}

static void toggle_collision(walk *w)
{
    w->collides = !w->collides;
    bool made = !w->obstacles.task.running; // else they are another thread's
    w->walker.obstacles = w->collides && made ? w->obstacles.made : NULL;
    walk_say(w, WALK_MESSAGE_MS, "Collision %s", w->collides ? "on" : "off");
}

static void handle_views(walk *w, const bool *pressed)
{
    if (pressed[HW_KEY_TINT])
        w->debug.tint = !w->debug.tint;
    if (pressed[HW_KEY_WIREFRAME])
        w->debug.wireframe = !w->debug.wireframe;
    if (pressed[HW_KEY_FREEZE])
        freeze(w);
    if (pressed[HW_KEY_DISSOLVE])
        w->debug.hard = !w->debug.hard;
    if (pressed[HW_KEY_TINT] || pressed[HW_KEY_WIREFRAME] || pressed[HW_KEY_FREEZE] ||
        pressed[HW_KEY_DISSOLVE])
        set_debug(w);
    if (pressed[HW_KEY_MAP])
        w->show_map = !w->show_map;
    if (pressed[HW_KEY_SPLIT])
        walk_want_compare(w, w->wanted_compare == WALK_SPLIT ? WALK_PLAIN : WALK_SPLIT);
    if (pressed[HW_KEY_ERROR])
        walk_want_compare(w, w->wanted_compare == WALK_ERRORS ? WALK_PLAIN : WALK_ERRORS);
}

static void move_seam(walk *w)
{
    const bool *down = w->input.down;
    double step = fmin(w->pace.frame_ms / 1000, HW_WALKER_STEP_MAX_S) * SEAM_PER_S;
    w->seam += (down[HW_KEY_SEAM_RIGHT] - down[HW_KEY_SEAM_LEFT]) * step;
    w->seam = fmin(fmax(w->seam, 0), 1);
}

static hw_status take_screenshot(walk *w)
{
    char name[64];
    hw_camera camera = hw_walker_camera(&w->walker, w->input.width, w->input.height);
    HW_TRY(walk_screenshot(w, &camera, name, sizeof name));
    walk_say(w, WALK_MESSAGE_MS, "Saved %s", name);
    return HW_OK;
}

static void handle_files(walk *w, const bool *pressed)
{
    if (pressed[HW_KEY_RECORD] &&
        (w->walker.recording ? walk_write_recording(w) : walk_start_recording(w)) != HW_OK)
        walk_complain(w, "recording");
    if (pressed[HW_KEY_COPY])
        walk_copy_camera(w);
    if (pressed[HW_KEY_PASTE] && walk_paste_camera(w) != HW_OK)
        walk_complain(w, "paste");
    if (pressed[HW_KEY_SCREENSHOT] && w->shown && !w->arriving && w->input.width > 0 &&
        take_screenshot(w) != HW_OK)
        walk_complain(w, "screenshot");
}

static void handle_tour(walk *w)
{
    hw_walker_toggle_playing(&w->walker);
    walk_say(w, WALK_MESSAGE_MS, "%s",
             !w->walker.tour     ? "No tour: start with --tour TOUR.json"
             : w->walker.playing ? "The tour goes on"
                                 : "The tour rests: Space goes on");
}

void walk_handle_keys(walk *w)
{
    const bool *pressed = w->input.pressed;
    w->quit = w->quit || w->input.close || pressed[HW_KEY_QUIT];
    if (pressed[HW_KEY_HUD])
        w->show_line = !w->show_line;
    if (pressed[HW_KEY_HELP])
        w->show_help = !w->show_help;
    if (pressed[HW_KEY_FULLSCREEN])
        hw_context_toggle_fullscreen(w->context);
    for (int i = 0; i < 4; i++)
        if (pressed[HW_KEY_CONFIG_A + i])
            walk_want_config(w, (hw_config)i);
    if (!w->placed)
        return;
    handle_views(w, pressed);
    move_seam(w);
    if (pressed[HW_KEY_COLLISION])
        toggle_collision(w);
    if (pressed[HW_KEY_TOUR])
        handle_tour(w);
    handle_files(w, pressed);
}

void walk_list_views(const walk *w, char *out, size_t capacity)
{
    const struct {
        bool on;
        const char *name;
    } views[] = {
        {w->debug.tint, "colours of representations"},
        {w->debug.wireframe, "wireframe"},
        {w->debug.frozen, "culling frozen"},
        {w->debug.hard, "hard crossings"},
        {w->compare == WALK_SPLIT, "B on the right"},
        {w->compare == WALK_ERRORS, "differences from B"},
        {w->placed && !w->collides, "no collision"},
    };
    size_t length = 0;
    out[0] = '\0';
    for (size_t i = 0; i < sizeof views / sizeof *views && length < capacity; i++)
        if (views[i].on)
            length += (size_t)snprintf(out + length, capacity - length, "%s%s",
                                       length > 0 ? ", " : "", views[i].name);
}
