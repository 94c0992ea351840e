// The viewer as a state machine: input and time go in, a camera comes out. It walks freely inside a
// grid of view cells, plays tours, and records what it does as a tour. No GL and no window: what a
// key does is tested here. The caller owns the struct; one thread.
#pragma once
#include "camera.h"
#include "context.h"
#include "hexgrid.h"
#include "obstacles.h"
#include "status.h"
#include "tour.h"

#define HW_WALKER_SPEED       30.0 // units per second, the tours' speed
#define HW_WALKER_RUN_SPEED   90.0
#define HW_WALKER_EYE_HEIGHT  12.0        // above the ground, where the grid's heights allow it
#define HW_WALKER_TURN_RAD    (HW_PI / 2) // per second, by keys
#define HW_WALKER_MOUSE_RAD   (0.12 * HW_PI / 180) // per pixel
#define HW_WALKER_PITCH_RAD   (85 * HW_PI / 180)   // steepest look up or down
#define HW_WALKER_STEP_MAX_S  0.25 // a longer frame moves a walker no farther than this one would
#define HW_WALKER_RECORD_RATE 60.0 // frames per second of a recorded tour
#define HW_WALKER_FOV_DEGREES 60.0
// The visitor's body: a cylinder round the eye that leaves out what lies on the ground.
#define HW_WALKER_RADIUS     (HW_WALKER_EYE_HEIGHT / 4)
#define HW_WALKER_BODY_BELOW (HW_WALKER_EYE_HEIGHT * 5 / 6) // the eye
#define HW_WALKER_BODY_ABOVE (HW_WALKER_EYE_HEIGHT / 12)

typedef struct hw_walker {
    hw_hexgrid grid;               // where the eye is kept
    double x, y, z;                // the eye
    double heading_rad, pitch_rad; // heading 0 looks along +x, pi/2 along +y
    double fov_degrees;            // vertical
    // What stands in the way: borrowed, NULL if nothing does. A walker that is inside of something
    // all the same walks out freely.
    const hw_obstacles *obstacles;
    // Playback. The tour is borrowed; NULL if there is none.
    const hw_tour *tour;
    double tour_s; // on the tour's own clock
    bool playing, loops;
    // Recording. The walker owns the frames.
    hw_tour recorded;
    size_t recorded_capacity;
    double recorded_s;
    bool recording;
} hw_walker;

// At the grid's centre, looking along +y. Free with hw_walker_free.
void hw_walker_init(hw_walker *walker, const hw_hexgrid *grid);
// Frees the recorded frames and zeroes the struct; NULL is legal.
void hw_walker_free(hw_walker *walker);
// Stands at `eye` (moved into the grid if it is outside) and looks along `forward`, with z up.
void hw_walker_place(hw_walker *walker, hw_vec3 eye, hw_vec3 forward);
// Stands near the grid's centre, at eye height above ground_z, at a place clear of the boxes where
// there is one, and looks to where most of them are seen.
void hw_walker_place_default(hw_walker *walker, const hw_box *boxes, uint32_t count,
                             float ground_z);

// The vertical field of view; while a recording is made it stays, since tours have one only.
void hw_walker_set_fov(hw_walker *walker, double degrees);
// Plays the tour from its start by time: exact at the tour's frames, interpolated between them. A
// closed tour (its ends are no farther apart than its longest step) goes round for ever; at the end
// of another one the walker stands still and is free. Any key of motion, or the mouse, ends
// playback where the eye is.
void hw_walker_play(hw_walker *walker, const hw_tour *tour);
// Stops, or goes on from where the tour was left; does nothing without a tour.
void hw_walker_toggle_playing(hw_walker *walker);
// The camera of a tour at time t (seconds on the tour's clock, clamped to its ends).
hw_tour_frame hw_walker_tour_at(const hw_tour *tour, double t);

// Starts a new recording with the present view as frame 0; what was recorded before is dropped.
HW_MUST_USE hw_status hw_walker_record(hw_walker *walker);
// Ends it and hands over the frames, one every 1/60 second; *out is freed with hw_tour_free.
void hw_walker_take_recorded(hw_walker *walker, hw_tour *out);

// Advances by dt_s >= 0 seconds. Walking slides along obstacles and along the grid's border, and
// goes through neither at any speed. Fails only while recording, for want of memory; the recording
// so far is then still there.
HW_MUST_USE hw_status hw_walker_update(hw_walker *walker, const hw_input *input, double dt_s);
// The present view as a tour frame (t = 0), and as a camera.
hw_tour_frame hw_walker_view(const hw_walker *walker);
hw_camera hw_walker_camera(const hw_walker *walker, uint32_t width, uint32_t height);
// How deep the visitor is inside of an obstacle (hw_obstacles_touch): 0 is clear, also without any.
double hw_walker_overlap(const hw_walker *walker);
