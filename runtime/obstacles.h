// What a visitor bumps into: the objects of a dataset or a scene as coarse solids, and a query for
// the upright cylinder that a visitor is. No GL.
#pragma once
#include "manifest.h"
#include "scene.h"
#include "status.h"
#include <stdatomic.h>

typedef struct hw_obstacles hw_obstacles;

// The visitor. radius <= HW_BODY_RADIUS_MAX.
typedef struct hw_body {
    double x, y, z_min, z_max, radius;
} hw_body;
#define HW_BODY_RADIUS_MAX 4.0

// From a dataset (a folder or URL) or, with scene not NULL, from a scene.
typedef struct hw_obstacles_desc {
    const char *dataset;
    const hw_manifest *manifest;
    const hw_scene *scene;
    uint64_t bytes_per_second; // limit of reading a dataset; 0: none
    const atomic_bool *stop;   // once true, making ends with HW_INTERRUPTED; NULL: never
} hw_obstacles_desc;

// Keeps nothing of its arguments. Each mesh is made solid once, a dataset's from the coarsest level
// that is fine enough; one whose file is missing or broken is no obstacle, and is counted in
// *missing. The time it takes is mostly that of reading: meant for a thread of its own.
HW_MUST_USE hw_status hw_obstacles_create(const hw_obstacles_desc *desc, uint32_t *missing,
                                          hw_obstacles **out);
void hw_obstacles_destroy(hw_obstacles *obstacles);

// How deep the body is in what it touches: 0 if it is clear, `radius` or more if its axis is inside
// something. A non-null `away` gets the horizontal unit direction out of the deepest contact (zeros
// if clear). Thread-safe.
double hw_obstacles_touch(const hw_obstacles *obstacles, const hw_body *body, double away[2]);
