// Where a default tour goes: a closed curve on the ground plan that winds through a scene.
#pragma once
#include "clearance.h"

typedef struct hw_tour_path {
    uint32_t count;
    double (*points)[2]; // evenly spaced; the last one is followed by the first
    bool around;         // a circle round all that is there: look inwards
} hw_tour_path;

typedef struct hw_tour_path_options {
    double clearance;   // of every point of the curve
    double turn_radius; // curves are made about as wide as this where there is room
    double span;        // largest width + depth of the part of the scene that is visited
    double step;        // largest distance between points
    uint64_t seed;
} hw_tour_path_options;

// How far the clearance has to see (its `reach`).
double hw_tour_path_reach(const hw_scene *scene, const hw_tour_path_options *options);
void hw_tour_path_free(hw_tour_path *path);
// Waypoints on an ellipse, far out and far in by turns, drawn to statues close by; ways between
// them by A* on a grid, dearer near objects and where the path has been before; smoothed. A scene
// that allows no such course is circled. At least 16 points. Deterministic. HW_FORMAT if the scene
// has no objects.
HW_MUST_USE hw_status hw_tour_path_plan(const hw_scene *scene, const hw_clearance *clearance,
                                        const hw_tour_path_options *options, hw_tour_path *out);
