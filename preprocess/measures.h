// What judges a simplified mesh against its original: the measures of Southern, Marais and Blake
// (Quality Control Tools for Interactive Rendering of 3D Triangle Meshes, 2001, section 4.2),
// together.
#pragma once
#include "surface_distance.h"
#include "views.h"

// K_sliver: the mean over triangles of (sum of edges / 3 times the shortest edge); 1 for
// equilateral triangles. Triangles with an edge of no length are counted apart and left out; NaN if
// no other.
typedef struct hw_sliver {
    double ratio;
    uint32_t degenerate;
} hw_sliver;
hw_sliver hw_mesh_sliver(const hw_mesh *mesh);

// Number of edges, between welded positions, that triangles do not pass equally often in both
// directions. 0: the mesh is closed and of consistent winding, and its volume well-defined.
HW_MUST_USE hw_status hw_mesh_open_edges(const hw_mesh *mesh, uint64_t *out);

typedef struct hw_measures_options {
    hw_distance_options distance; // its `threads` serve the pictures too
    bool no_images;
} hw_measures_options;

// a: the original; b: its simplification. Index 0 is a's, 1 is b's.
typedef struct hw_measures {
    hw_surface_distance forward, backward; // from a to b, from b to a; in the meshes' units
    double diagonal;                       // of a's box: distances are told in percent of it
    double volume[2];                      // hw_mesh_volume
    uint64_t open_edges[2];
    double volume_ratio; // K_vol: b's over a's; NaN if a has none. Of open meshes it depends on
                         // where the origin lies: see open_edges
    hw_sliver sliver[2];
    hw_view_errors views; // all NaN without images
    double pixel;         // size of a pixel of the views, in units; NaN without images
} hw_measures;

// All of them; options may be NULL. Both are hw_rays_create_mesh. For some of them, or one original
// against many meshes, call the parts: hw_surface_distance_measure; hw_views_create once and
// hw_views_compare for each. HW_USAGE for meshes without triangle or area.
HW_MUST_USE hw_status hw_measures_take(const hw_rays *a, const hw_rays *b,
                                       const hw_measures_options *options, hw_measures *out);
