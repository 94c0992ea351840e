// Makes one cell: sorts the objects into near and far, derives the SVMeshes, packs them.
#pragma once
#include "budget.h"
#include "groups.h"
#include "occlusion.h"
#include "svmesh.h"

// Seconds of work, added up over the threads.
typedef struct hw_cell_seconds {
    double classify, simplify, capture, pack; // near or far; the policy; rays; atlas and joining
} hw_cell_seconds;

// Everything cells are made from; read-only while they are made.
typedef struct hw_cell_inputs {
    const hw_scene *scene;
    const hw_chain *chains; // per mesh of the scene
    const hw_capturer *capturer;
    hw_occlusion *occlusion; // needed by what follows, else NULL
    bool cull_objects, cull_faces;
    bool clusters;
    double cluster_error_px; // largest self-occluding error of a cluster
    const hw_hexgrid *grid;
    hw_groups *groups; // of the calling thread; NULL: there is one level
    hw_far_options far;
    double near_error_px;
    uint64_t key;
    const uint32_t *order; // in which objects are taken; NULL: as they come. Changes no result
    bool backwards;        // takes them in the reverse order
    hw_budget *budget;     // NULL: no bound of memory
} hw_cell_inputs;

// Level of the mesh file to draw a near object with at a distance: the coarsest one whose error
// (hw_mesh_level_error) is at most error_px; mesh files hold every HW_NEAR_LEVEL_STRIDE-th level
// of the chain. Textured meshes have level 0 only.
uint32_t hw_near_level(const hw_chain *chain, double scale, double distance, double focal_px,
                       double error_px);

// Thread-safe. Free with hw_cell_free. Adds to *seconds.
HW_MUST_USE hw_status hw_build_cell(const hw_cell_inputs *inputs, hw_cell_id id, hw_cell *out,
                                    hw_cell_seconds *seconds);
