// Camera paths with time (TOUR.json), and the default one.
#pragma once
#include "camera.h"
#include "scene.h"

typedef struct hw_tour_frame {
    double t; // seconds
    hw_vec3 eye, forward, up;
} hw_tour_frame;

typedef struct hw_tour {
    double fov_degrees;
    uint32_t frame_count;
    hw_tour_frame *frames;
} hw_tour;

void hw_tour_free(hw_tour *tour);
// {"fov_degrees":60,"frames":[{"t":0.0,"eye":[x,y,z],"forward":[x,y,z],"up":[0,0,1]},...]}; errors
// name file and place.
HW_MUST_USE hw_status hw_tour_read(const char *path, hw_tour *out);
HW_MUST_USE hw_status hw_tour_write(const char *path, const hw_tour *tour);
hw_camera hw_tour_camera(const hw_tour *tour, uint32_t frame, uint32_t width, uint32_t height);

typedef struct hw_tour_options {
    double eye_height;   // above the ground; 0 = 12
    double speed;        // units per second; 0 = 30
    double turn_degrees; // largest turn per second; 0 = 45
    double frame_rate;   // 0 = 60
    double clearance; // least distance from the eye to any object's surface; 0 = a quarter of the
                      // objects' median size
    uint64_t seed;
} hw_tour_options;

// A closed loop through the scene that stays clear of every object, at constant speed but for
// curves that need slowing down. HW_FORMAT when no such loop exists. NULL options = defaults.
// Deterministic.
HW_MUST_USE hw_status hw_tour_generate(const hw_scene *scene, const hw_tour_options *options,
                                       hw_tour *out);
