// Camera paths with time (TOUR.json), and the default one.
#pragma once
#include "camera.h"
#include "scene.h"

typedef struct hw_tour_frame {
    double t; // seconds
    hw_vec3 eye, forward, up;
} hw_tour_frame;

typedef struct hw_tour {
    double fov_degrees; // vertical
    uint32_t frame_count;
    hw_tour_frame *frames;
} hw_tour;

#define HW_TOUR_FRAMES_MAX 5000000u

// Frees the frames and zeroes the struct.
void hw_tour_free(hw_tour *tour);
// {"fov_degrees":60,"frames":[{"t":0.0,"eye":[x,y,z],"forward":[x,y,z],"up":[0,0,1]},...]}.
// Checked: a field of view within (0, 180), at least one frame, times that do not fall, finite
// numbers, forward and up not zero and not parallel; HW_FORMAT names file, frame and member. On
// failure *out is zeroed.
HW_MUST_USE hw_status hw_tour_read(const char *path, hw_tour *out);
// The same from text; `name` is for messages.
HW_MUST_USE hw_status hw_tour_parse(const char *name, const char *text, size_t size, hw_tour *out);
// Atomic. Reading gives the same floats back.
HW_MUST_USE hw_status hw_tour_write(const char *path, const hw_tour *tour);
// frame < frame_count.
hw_camera hw_tour_camera(const hw_tour *tour, uint32_t frame, uint32_t width, uint32_t height);

// 0 anywhere but in the seed stands for the default.
typedef struct hw_tour_options {
    double eye_height;   // above the ground (else above the lowest object); 0 = 12
    double speed;        // units per second; 0 = 30
    double turn_degrees; // largest turn per second; 0 = 45
    double frame_rate;   // 0 = 60
    double clearance;    // least distance from the eye to any object's bounds; 0 = a quarter of the
                         // objects' median size (largest side of the bounds)
    uint64_t seed;
} hw_tour_options;

// A closed loop through the scene (the frame after the last one would be the first again) that
// stays clear of every object and looks along the path, at constant speed but for curves that need
// slowing down; it takes a few minutes at most, in a very large scene round its middle. Where there
// is no room for that it circles the scene, looking inwards. HW_FORMAT when the scene is empty,
// HW_USAGE for numbers that are negative or not finite. NULL options = defaults. Deterministic. The
// objects' bounds must be up to date.
HW_MUST_USE hw_status hw_tour_generate(const hw_scene *scene, const hw_tour_options *options,
                                       hw_tour *out);
