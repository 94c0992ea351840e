#include "walker.h"
#include "alloc.h"
#include <assert.h>
#include <string.h>

// A recording of this length needs no memory on a frame's path; a longer one doubles now and then.
#define RECORD_RESERVE_S 600.0

// Far shorter than the visitor is wide: nothing is stepped over.
#define COLLISION_STEP (HW_WALKER_RADIUS / 6)
#define PUSHES_MAX     8
#define PUSH_MARGIN    1e-6

static double clamp(double v, double low, double high)
{
    return v < low ? low : v > high ? high : v;
}

// ---- Where the eye may be

// The point of segment ab nearest to p.
static void nearest_on_segment(const double p[2], hw_vec3 a, hw_vec3 b, double out[2])
{
    double dx = (double)b.x - a.x, dy = (double)b.y - a.y;
    double length2 = dx * dx + dy * dy;
    double t = length2 > 0 ? ((p[0] - a.x) * dx + (p[1] - a.y) * dy) / length2 : 0;
    t = clamp(t, 0, 1);
    out[0] = a.x + t * dx;
    out[1] = a.y + t * dy;
}

// The point of the cell's hexagon nearest to p, and its squared distance (0 inside).
static double nearest_in_cell(const hw_hexgrid *grid, hw_cell_id id, const double p[2],
                              double out[2])
{
    hw_vec3 corners[HW_CELL_CORNERS];
    hw_cell_corners(grid, id, corners);
    double best = INFINITY;
    bool inside = true;
    for (int i = 0; i < 6; i++) {
        hw_vec3 a = corners[i], b = corners[(i + 1) % 6];
        double cross = ((double)b.x - a.x) * (p[1] - a.y) - ((double)b.y - a.y) * (p[0] - a.x);
        inside = inside && cross >= 0;
        double q[2];
        nearest_on_segment(p, a, b, q);
        double d2 = (q[0] - p[0]) * (q[0] - p[0]) + (q[1] - p[1]) * (q[1] - p[1]);
        if (d2 < best) {
            best = d2;
            out[0] = q[0];
            out[1] = q[1];
        }
    }
    if (!inside)
        return best;
    out[0] = p[0];
    out[1] = p[1];
    return 0;
}

// Moves the eye to the nearest point of the grid. The border is a zigzag, so the nearest cell may
// be a neighbour of the one that the grid names for a point outside; looking at the neighbours too
// lets a walker slide along the border.
static void keep_inside(hw_walker *w)
{
    const hw_hexgrid *grid = &w->grid;
    w->z = clamp(w->z, grid->z_min, grid->z_max);
    double p[2] = {w->x, w->y}, q[2];
    hw_cell_id id = hw_hexgrid_locate(grid, p[0], p[1]);
    double best = nearest_in_cell(grid, id, p, q);
    w->x = q[0];
    w->y = q[1];
    if (best == 0)
        return;
    hw_cell_id around[6];
    hw_cell_neighbours(id, around);
    for (int i = 0; i < 6; i++) {
        if (!hw_hexgrid_contains(grid, around[i]))
            continue;
        double d2 = nearest_in_cell(grid, around[i], p, q);
        if (d2 < best) {
            best = d2;
            w->x = q[0];
            w->y = q[1];
        }
    }
}

// ---- Placing

void hw_walker_init(hw_walker *walker, const hw_hexgrid *grid)
{
    assert(grid->cell_size > 0 && grid->columns > 0 && grid->rows > 0);
    *walker = (hw_walker){.grid = *grid, .fov_degrees = HW_WALKER_FOV_DEGREES};
    hw_vec3 low = hw_cell_centre(grid, (hw_cell_id){0, 0, 0});
    hw_vec3 high = hw_cell_centre(grid, (hw_cell_id){0, grid->columns - 1, grid->rows - 1});
    hw_walker_place(walker, hw_v3_scale(hw_v3_add(low, high), 0.5f), hw_v3(0, 1, 0));
}

void hw_walker_free(hw_walker *walker)
{
    if (!walker)
        return;
    hw_tour_free(&walker->recorded);
    *walker = (hw_walker){0};
}

static void stand(hw_walker *w, hw_vec3 eye, hw_vec3 forward)
{
    w->x = eye.x;
    w->y = eye.y;
    w->z = eye.z;
    double level = hypot(forward.x, forward.y);
    // Looking straight up or down has no heading: the old one stays.
    if (level > 0)
        w->heading_rad = atan2(forward.y, forward.x);
    w->pitch_rad = clamp(atan2(forward.z, level), -HW_WALKER_PITCH_RAD, HW_WALKER_PITCH_RAD);
}

void hw_walker_place(hw_walker *walker, hw_vec3 eye, hw_vec3 forward)
{
    walker->playing = false;
    stand(walker, eye, forward);
    keep_inside(walker);
}

static double distance_to_box(hw_box b, hw_vec3 p)
{
    double dx = fmax(fmax((double)b.min.x - p.x, (double)p.x - b.max.x), 0);
    double dy = fmax(fmax((double)b.min.y - p.y, (double)p.y - b.max.y), 0);
    double dz = fmax(fmax((double)b.min.z - p.z, (double)p.z - b.max.z), 0);
    return sqrt(dx * dx + dy * dy + dz * dz);
}

// True if the eye is inside the grid where it stands and farther than `clearance` from every box.
static bool is_clear(const hw_walker *w, hw_vec3 eye, const hw_box *boxes, uint32_t count,
                     double clearance)
{
    const double p[2] = {eye.x, eye.y};
    double q[2];
    if (nearest_in_cell(&w->grid, hw_hexgrid_locate(&w->grid, p[0], p[1]), p, q) > 0)
        return false;
    for (uint32_t i = 0; i < count; i++)
        if (distance_to_box(boxes[i], eye) <= clearance)
            return false;
    return true;
}

// Rings of places around the present one, the nearest first.
static bool find_clear(const hw_walker *w, const hw_box *boxes, uint32_t count, double clearance,
                       hw_vec3 *eye)
{
    double step = w->grid.cell_size / 8;
    double extent = w->grid.cell_size * (1.5 * w->grid.columns + 1.8 * w->grid.rows) / 2;
    uint32_t rings = (uint32_t)clamp(extent / step, 1, 256);
    for (uint32_t ring = 0; ring <= rings; ring++) {
        uint32_t places = ring ? 6 * ring : 1;
        for (uint32_t i = 0; i < places; i++) {
            double angle = 2 * HW_PI * i / places;
            *eye = hw_v3((float)(w->x + ring * step * cos(angle)),
                         (float)(w->y + ring * step * sin(angle)), (float)w->z);
            if (is_clear(w, *eye, boxes, count, clearance))
                return true;
        }
    }
    return false;
}

// The heading (of 36) whose 60 degrees hold the most to look at: the sum of the boxes' apparent
// sizes, near ones capped so that one of them does not outshine a view.
static hw_vec3 best_view(hw_vec3 eye, const hw_box *boxes, uint32_t count)
{
    hw_vec3 best = hw_v3(0, 1, 0);
    double best_score = 0;
    for (int i = 0; i < 36; i++) {
        hw_vec3 axis = hw_v3((float)cos(i * HW_PI / 18), (float)sin(i * HW_PI / 18), 0);
        double score = 0;
        for (uint32_t k = 0; k < count; k++) {
            hw_vec3 to = hw_v3_sub(hw_box_centre(boxes[k]), eye);
            to.z = 0;
            double d = hw_v3_length(to);
            if (hw_v3_dot(to, axis) > 0.87 * d)
                score += fmin(hw_box_diagonal(boxes[k]) / d, 0.5);
        }
        if (score > best_score) {
            best_score = score;
            best = axis;
        }
    }
    return best;
}

void hw_walker_place_default(hw_walker *walker, const hw_box *boxes, uint32_t count, float ground_z)
{
    hw_hexgrid grid = walker->grid;
    hw_vec3 low = hw_cell_centre(&grid, (hw_cell_id){0, 0, 0});
    hw_vec3 high = hw_cell_centre(&grid, (hw_cell_id){0, grid.columns - 1, grid.rows - 1});
    hw_vec3 eye = hw_v3_scale(hw_v3_add(low, high), 0.5f);
    eye.z = ground_z + (float)HW_WALKER_EYE_HEIGHT;
    hw_walker_place(walker, eye, hw_v3(0, 1, 0));
    // Rather close to something than inside it.
    const double clearances[] = {grid.cell_size / 3, grid.cell_size / 10, 0};
    hw_vec3 found;
    for (int i = 0; i < 3; i++) {
        if (find_clear(walker, boxes, count, clearances[i], &found)) {
            eye = found;
            break;
        }
    }
    hw_walker_place(walker, eye, best_view(eye, boxes, count));
}

// ---- Views and tours

hw_tour_frame hw_walker_view(const hw_walker *walker)
{
    if (walker->playing) {
        hw_tour_frame frame = hw_walker_tour_at(walker->tour, walker->tour_s);
        frame.t = 0;
        return frame;
    }
    double level = cos(walker->pitch_rad);
    return (hw_tour_frame){.eye = hw_v3((float)walker->x, (float)walker->y, (float)walker->z),
                           .forward = hw_v3((float)(level * cos(walker->heading_rad)),
                                            (float)(level * sin(walker->heading_rad)),
                                            (float)sin(walker->pitch_rad)),
                           .up = hw_v3(0, 0, 1)};
}

hw_camera hw_walker_camera(const hw_walker *walker, uint32_t width, uint32_t height)
{
    hw_tour_frame view = hw_walker_view(walker);
    return (hw_camera){.eye = view.eye,
                       .forward = view.forward,
                       .up = view.up,
                       .fov_degrees = (float)walker->fov_degrees,
                       .width = width,
                       .height = height};
}

static hw_vec3 mix_direction(hw_vec3 a, hw_vec3 b, float f)
{
    hw_vec3 mixed =
        hw_v3_add(hw_v3_scale(hw_v3_normalize(a), 1 - f), hw_v3_scale(hw_v3_normalize(b), f));
    // Opposite directions have no middle.
    return hw_v3_length(mixed) > 1e-3f ? hw_v3_normalize(mixed) : f < 0.5f ? a : b;
}

// Exactly a at f = 0 and exactly b at f = 1.
static hw_tour_frame mix(const hw_tour_frame *a, const hw_tour_frame *b, double f)
{
    if (f <= 0)
        return *a;
    if (f >= 1)
        return *b;
    float g = (float)f;
    return (hw_tour_frame){.t = a->t + (b->t - a->t) * f,
                           .eye = hw_v3_mad(hw_v3_scale(a->eye, 1 - g), b->eye, g),
                           .forward = mix_direction(a->forward, b->forward, g),
                           .up = mix_direction(a->up, b->up, g)};
}

hw_tour_frame hw_walker_tour_at(const hw_tour *tour, double t)
{
    assert(tour->frame_count > 0);
    const hw_tour_frame *frames = tour->frames;
    uint32_t low = 0, high = tour->frame_count - 1;
    if (t <= frames[low].t)
        return frames[low];
    if (t >= frames[high].t)
        return frames[high];
    while (high - low > 1) { // frames[low].t <= t < frames[high].t
        uint32_t middle = low + (high - low) / 2;
        if (frames[middle].t <= t)
            low = middle;
        else
            high = middle;
    }
    double span = frames[high].t - frames[low].t;
    return mix(&frames[low], &frames[high], span > 0 ? (t - frames[low].t) / span : 0);
}

static bool tour_is_closed(const hw_tour *tour)
{
    float longest = 0;
    for (uint32_t i = 1; i < tour->frame_count; i++)
        longest =
            fmaxf(longest, hw_v3_length(hw_v3_sub(tour->frames[i].eye, tour->frames[i - 1].eye)));
    hw_vec3 gap = hw_v3_sub(tour->frames[0].eye, tour->frames[tour->frame_count - 1].eye);
    return tour->frame_count > 2 && hw_v3_length(gap) <= longest * 1.01f;
}

void hw_walker_set_fov(hw_walker *walker, double degrees)
{
    if (!walker->recording)
        walker->fov_degrees = degrees;
}

void hw_walker_play(hw_walker *walker, const hw_tour *tour)
{
    assert(tour->frame_count > 0);
    walker->tour = tour;
    walker->tour_s = tour->frames[0].t;
    walker->fov_degrees = tour->fov_degrees;
    walker->loops = tour_is_closed(tour);
    walker->playing = true;
}

// The walker becomes free where the tour has brought it.
static void leave_tour(hw_walker *w)
{
    hw_tour_frame view = hw_walker_view(w);
    w->playing = false;
    stand(w, view.eye, view.forward);
}

void hw_walker_toggle_playing(hw_walker *walker)
{
    if (!walker->tour)
        return;
    if (walker->playing) {
        leave_tour(walker);
        return;
    }
    double end = walker->tour->frames[walker->tour->frame_count - 1].t;
    if (walker->tour_s >= end)
        walker->tour_s = walker->tour->frames[0].t;
    hw_walker_set_fov(walker, walker->tour->fov_degrees);
    walker->playing = true;
}

static void play(hw_walker *w, double dt_s)
{
    double start = w->tour->frames[0].t;
    double end = w->tour->frames[w->tour->frame_count - 1].t;
    w->tour_s += dt_s;
    if (w->tour_s < end)
        return;
    if (w->loops && end > start) {
        w->tour_s = start + fmod(w->tour_s - start, end - start);
        return;
    }
    w->tour_s = end;
    leave_tour(w);
}

// ---- Recording

// Appends `frame` as the next one of the recording, on its fixed clock.
static hw_status append(hw_walker *w, hw_tour_frame frame)
{
    hw_tour *tour = &w->recorded;
    HW_TRY(HW_RESERVE(&tour->frames, &w->recorded_capacity, (size_t)tour->frame_count + 1));
    frame.t = tour->frame_count / HW_WALKER_RECORD_RATE;
    tour->frames[tour->frame_count++] = frame;
    return HW_OK;
}

hw_status hw_walker_record(hw_walker *walker)
{
    hw_tour_free(&walker->recorded);
    walker->recorded = (hw_tour){.fov_degrees = walker->fov_degrees};
    walker->recorded_capacity = 0;
    walker->recorded_s = 0;
    walker->recording = false;
    HW_TRY(HW_RESERVE(&walker->recorded.frames, &walker->recorded_capacity,
                      (size_t)(RECORD_RESERVE_S * HW_WALKER_RECORD_RATE)));
    HW_TRY(append(walker, hw_walker_view(walker)));
    walker->recording = true;
    return HW_OK;
}

void hw_walker_take_recorded(hw_walker *walker, hw_tour *out)
{
    *out = walker->recorded;
    walker->recorded = (hw_tour){0};
    walker->recorded_capacity = 0;
    walker->recording = false;
}

// Frames fall due at multiples of 1/60 s, whatever the display's own rate: the ones between two
// updates are interpolated.
static hw_status record(hw_walker *w, const hw_tour_frame *before, double dt_s)
{
    hw_tour_frame after = hw_walker_view(w);
    double start = w->recorded_s;
    w->recorded_s += dt_s;
    for (;;) {
        double due = w->recorded.frame_count / HW_WALKER_RECORD_RATE;
        // A step of 1/60 s summed up in doubles may fall short of the clock by a few ulps.
        if (due > w->recorded_s + 1e-9)
            return HW_OK;
        HW_TRY(append(w, mix(before, &after, dt_s > 0 ? (due - start) / dt_s : 1)));
    }
}

// ---- Motion

// How deep the visitor is in an obstacle; see hw_obstacles_touch.
static double touch(const hw_walker *w, double away[2])
{
    const hw_body body = {w->x, w->y, w->z - HW_WALKER_BODY_BELOW, w->z + HW_WALKER_BODY_ABOVE,
                          HW_WALKER_RADIUS};
    return hw_obstacles_touch(w->obstacles, &body, away);
}

double hw_walker_overlap(const hw_walker *walker)
{
    return walker->obstacles ? touch(walker, NULL) : 0;
}

// One short level step, pushed out of what it runs into: so it slides. Where there is no way out
// the walker stays where it was, unless it was inside of something already.
static void step_level(hw_walker *w, double dx, double dy)
{
    const double x = w->x, y = w->y;
    double away[2], before = touch(w, NULL), depth = 0;
    w->x += dx;
    w->y += dy;
    keep_inside(w);
    if (before >= HW_WALKER_RADIUS)
        return;
    for (int i = 0; i < PUSHES_MAX && (depth = touch(w, away)) > 0; i++) {
        w->x += away[0] * (depth + PUSH_MARGIN);
        w->y += away[1] * (depth + PUSH_MARGIN);
        keep_inside(w);
    }
    // Round a pillar the way gets a little longer; what jumps has been squeezed out somewhere.
    double moved = hypot(w->x - x, w->y - y), allowed = 1.25 * hypot(dx, dy) + before;
    if ((depth > 0 && touch(w, NULL) > 0) || moved > allowed) {
        w->x = before > 0 ? x + dx : x;
        w->y = before > 0 ? y + dy : y;
        keep_inside(w);
    }
}

static void step_upright(hw_walker *w, double dz)
{
    const double z = w->z, before = touch(w, NULL);
    w->z += dz;
    keep_inside(w);
    if (touch(w, NULL) > before)
        w->z = z;
}

static void move(hw_walker *w, const double way[3])
{
    if (!w->obstacles) {
        w->x += way[0];
        w->y += way[1];
        w->z += way[2];
        keep_inside(w);
        return;
    }
    double length = fmax(hypot(way[0], way[1]), fabs(way[2]));
    int steps = (int)ceil(length / COLLISION_STEP);
    for (int i = 0; i < steps; i++) {
        step_level(w, way[0] / steps, way[1] / steps);
        if (way[2] != 0)
            step_upright(w, way[2] / steps);
    }
}

static bool wants_to_move(const hw_input *in)
{
    static const hw_key keys[] = {
        HW_KEY_FORWARD, HW_KEY_BACK,      HW_KEY_LEFT,    HW_KEY_RIGHT,     HW_KEY_UP,
        HW_KEY_DOWN,    HW_KEY_TURN_LEFT, HW_KEY_LOOK_UP, HW_KEY_LOOK_DOWN, HW_KEY_TURN_RIGHT};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        if (in->down[keys[i]])
            return true;
    return in->mouse_dx != 0 || in->mouse_dy != 0 || in->ahead != 0 || in->right != 0 ||
           in->up != 0 || in->turn != 0 || in->pitch != 0;
}

// Two keys that go against each other, and a stick that adds to them.
static double axis(const hw_input *in, hw_key more, hw_key less, double stick)
{
    return clamp(in->down[more] - in->down[less] + stick, -1, 1);
}

// Turns, and returns the middle heading of the turn: walking along it makes a curve independent of
// the frame rate, but for the square of the step.
static double look(hw_walker *w, const hw_input *in, double dt_s)
{
    double rate = HW_WALKER_TURN_RAD * dt_s;
    double turn = axis(in, HW_KEY_TURN_LEFT, HW_KEY_TURN_RIGHT, -in->turn) * rate -
                  in->mouse_dx * HW_WALKER_MOUSE_RAD;
    double tilt = axis(in, HW_KEY_LOOK_UP, HW_KEY_LOOK_DOWN, in->pitch) * rate -
                  in->mouse_dy * HW_WALKER_MOUSE_RAD;
    double middle = w->heading_rad + turn / 2;
    w->heading_rad = remainder(w->heading_rad + turn, 2 * HW_PI);
    w->pitch_rad = clamp(w->pitch_rad + tilt, -HW_WALKER_PITCH_RAD, HW_WALKER_PITCH_RAD);
    return middle;
}

static void walk(hw_walker *w, const hw_input *in, double dt_s)
{
    double middle = look(w, in, dt_s);
    double ahead = axis(in, HW_KEY_FORWARD, HW_KEY_BACK, in->ahead);
    double right = axis(in, HW_KEY_RIGHT, HW_KEY_LEFT, in->right);
    double up = axis(in, HW_KEY_UP, HW_KEY_DOWN, in->up);
    double length = sqrt(ahead * ahead + right * right + up * up);
    if (length == 0)
        return;
    double speed = in->down[HW_KEY_RUN] ? HW_WALKER_RUN_SPEED : HW_WALKER_SPEED;
    double step = speed * dt_s / fmax(length, 1);
    const double way[3] = {step * (ahead * cos(middle) + right * sin(middle)),
                           step * (ahead * sin(middle) - right * cos(middle)), step * up};
    move(w, way);
}

hw_status hw_walker_update(hw_walker *walker, const hw_input *input, double dt_s)
{
    assert(dt_s >= 0);
    hw_tour_frame before = hw_walker_view(walker);
    if (walker->playing && wants_to_move(input))
        leave_tour(walker);
    if (walker->playing) {
        play(walker, dt_s);
    } else {
        dt_s = fmin(dt_s, HW_WALKER_STEP_MAX_S);
        walk(walker, input, dt_s);
    }
    return walker->recording ? record(walker, &before, dt_s) : HW_OK;
}
