// SVMesh: the single-view textured mesh that stands for one far object seen from one cell
// (thesis 5.2.1). Deriving one goes
//   chain level -> culled to the cell -> projected into the capture's image space -> simplified by
//   a policy -> captured -> quantised.
//
// Image space, in pixels: x and y are the projection from the cell centre on the plane of the
// window's face, at the focal length of the reference view (1024 x 1024, 60 degrees); the third
// axis is parallax, the shift in pixels that a step of one cell size across the line of sight
// gives: focal * cell_size / depth. Distances in it are what a viewer in the cell could see.
#pragma once
#include "capture.h"
#include "cell_file.h"
#include "chain.h"
#include "occlusion.h"
#include "region.h"

#define HW_REFERENCE_IMAGE_PX    1024.0 // ImageRes of the thesis; sides of the reference view
#define HW_REFERENCE_FOV_DEGREES 60.0   // vertical

typedef struct hw_svmesh_policy hw_svmesh_policy;

typedef struct hw_far_options {
    const hw_svmesh_policy *policy;
    double self_occlusion_px;  // T_s: objects with a larger self-occluding error are no SVMeshes
    double multi_view_px;      // T_mv: below this they are MVMeshes, else near; 0 = all near
    double multi_textured_px;  // T_mv of textured objects, which near by have no levels of detail
    uint32_t multi_view_count; // captures of an MVMesh: 1 to HW_FAR_VIEWS_MAX - 1
    bool multi_blend;          // their triangles keep all captures that see them, not the best only
    double multi_outline_px, multi_interior_px; // outline_px and interior_px of MVMeshes
    double edge_length_px;                      // T_l of the thesis policy
    double outline_px;         // outline deviation of the chain level at the effective distance
    double interior_px;        // tolerance for patches that face the whole cell (screen policy)
    double impostor_px;        // objects with a smaller self-occluding error are flat: reliefs
    double relief_px;          // so are those whose outline is then off by less; 0: none
    uint32_t capture_side_max; // larger captures make an object near
    uint32_t capture_samples;  // rays per texel and axis
} hw_far_options;

// The cell as the derivation sees it; made once per cell.
typedef struct hw_cell_view {
    const hw_hexgrid *grid;
    hw_cell_id id;
    hw_vec3 centre;
    hw_vec3 corners[HW_CELL_CORNERS];
    double size;     // side length of the cell
    double focal_px; // of the reference view
} hw_cell_view;
hw_cell_view hw_cell_view_make(const hw_hexgrid *grid, hw_cell_id id);

// A mesh in image space.
typedef struct hw_view_mesh {
    uint32_t vertex_count, index_count;
    double (*positions)[3];
    uint32_t *indices;
} hw_view_mesh;
void hw_view_mesh_free(hw_view_mesh *mesh);
// Drops vertices that no face uses any more, so that bounds and windows are those of what is drawn.
HW_MUST_USE hw_status hw_view_mesh_compact(hw_view_mesh *mesh);

// One derivation in progress.
typedef struct hw_svmesh_job {
    const hw_cell_view *view;
    const hw_far_options *options;
    const hw_scene *scene;
    const hw_capturer *capturer;
    const hw_occlusion *occlusion; // NULL: faces behind other objects stay
    const hw_chain *chain;         // of the object's mesh
    uint32_t object_idx;
    const uint32_t *members; // of a cluster, object_idx first; NULL: the object alone
    uint32_t member_count;
    hw_region_distance distance;
    double scale; // largest stretch of the object's transform: mesh units to world units
    int face;
    bool multi_view; // an MVMesh is to be made; set by hw_svmesh_derive
} hw_svmesh_job;

// The result. Vertices carry record 0; indices are relative to them.
typedef struct hw_svmesh {
    hw_far_record record; // all but rect's place and the first_* members
    hw_far_vertex *vertices;
    uint32_t *indices;
    hw_capture capture; // the record's rectangle with HW_CAPTURE_PADDING texels round it
    // Of an MVMesh, else NULL: record.view_count further views with their captures,
    // record.range_count ranges, and a colour for each vertex (or NULL: no range needs them).
    hw_far_view *views; // all but the rect's place
    hw_capture *view_captures;
    hw_far_range *ranges;
    hw_color8 *colors;
} hw_svmesh;
#define HW_CAPTURE_PADDING 2u
#define HW_CUT_OUT_SAMPLES 4u // rays per texel and axis where the coverage makes the outline
void hw_svmesh_free(hw_svmesh *svmesh);

// A policy fills the mesh to draw, in image space, and may capture early (else the result is
// captured afterwards).
struct hw_svmesh_policy {
    const char *name, *help;
    hw_status (*simplify)(const hw_svmesh_job *job, hw_view_mesh *out);
};
extern const hw_svmesh_policy hw_policy_screen, hw_policy_thesis;
// NULL if unknown.
const hw_svmesh_policy *hw_policy_find(const char *name);

// Derives the SVMesh (a relief where that serves, relief.h; else by the policy), or, of an object
// whose self-occluding error is T_s or more but below T_mv, the MVMesh (mvmesh.h; cells of level 0
// only). *is_near is set, and *out left empty, when the object must be drawn as geometry from this
// cell: it meets the cell, its self-occluding error is too large, or its capture would be larger
// than capture_side_max. *out is also empty when nothing of the object faces the cell.
HW_MUST_USE hw_status hw_svmesh_derive(hw_svmesh_job *job, bool *is_near, hw_svmesh *out);

// The self-occluding error of whatever is inside the box, at most, for a cell of this side round
// the view's centre, pixels.
double hw_svmesh_self_occlusion_bound(const hw_cell_view *view, double side, hw_box box);
// The self-occluding error of the object, from its distance to the cell's centre and the depth of
// what of it faces the cell, pixels; 0 if nothing does. The bound above instead where that is below
// `enough`. Of the job, view, scene, chain and object_idx count.
double hw_svmesh_self_occlusion(const hw_svmesh_job *job, double enough);

// The rest of a derivation: window, quantised vertices, record and capture of a mesh in image
// space. *fits tells whether the capture is not too large; *out is left empty if it is, or if
// nothing is left of the mesh.
HW_MUST_USE hw_status hw_svmesh_finish(const hw_svmesh_job *job, const hw_view_mesh *mesh,
                                       bool *fits, hw_svmesh *out);

// ---- for policies ----------------------------------------------------------------------------

// World position to image space; false if it lies on or behind the plane through the centre.
bool hw_svmesh_project(const hw_svmesh_job *job, hw_vec3 world, double image[3]);
// And back.
hw_vec3 hw_svmesh_unproject(const hw_svmesh_job *job, const double image[3]);
// The cell's corners (or, with centre_only, its centre alone) in the mesh's own space, where facing
// is the same. Returns how many.
uint32_t hw_svmesh_eyes(const hw_svmesh_job *job, bool centre_only, hw_vec3 eyes[HW_CELL_CORNERS]);
// Where a vertex is in the world; the matrix is hw_far_record_matrix.
hw_vec3 hw_far_vertex_world(const hw_mat4 *matrix, const hw_far_vertex *vertex);
// interior_px of the mesh to be made.
double hw_svmesh_interior_px(const hw_svmesh_job *job);
// The capture window round a mesh in image space, grown by HW_CAPTURE_PADDING texels on each side.
// False if a side would be too large.
bool hw_svmesh_window(const hw_svmesh_job *job, const hw_view_mesh *mesh, hw_capture_window *out);

// ---- for MVMeshes ----------------------------------------------------------------------------

// World position to the plane at distance 1 from `eye` along the axis of `face`, and its depth;
// false if it lies on or behind the plane through the eye.
bool hw_plane_project(hw_vec3 eye, int face, hw_vec3 world, double plane[3]);
// A rectangle of the plane at distance 1 from a point of view, and the least depth of what lies in
// it.
typedef struct hw_plane_bounds {
    double min[2], max[2], depth_min;
} hw_plane_bounds;
void hw_plane_bounds_add(hw_plane_bounds *bounds, const double plane[3]);
// All of `points`, and the bounds of them; false if one cannot be projected.
bool hw_plane_project_all(hw_vec3 eye, int face, const hw_vec3 *points, uint32_t count,
                          double (*planes)[3], hw_plane_bounds *bounds);
// Texels of a capture (of an SVMesh or a relief) per pixel of the nearest viewer in the cell: more
// than one, as filtering then blurs less and outlines of reliefs are told finer (0.13 dB for a
// sixth more bytes of textures).
#define HW_TEXELS_PER_PX 1.1
// The capture window of a rectangle seen from `eye`: HW_TEXELS_PER_PX (less of MVMeshes) where the
// nearest part is, grown by HW_CAPTURE_PADDING texels on each side. False if a side would be too
// large.
bool hw_capture_window_fit(const hw_svmesh_job *job, hw_vec3 eye, int face,
                           const hw_plane_bounds *bounds, hw_capture_window *out);
// The window without its padding: x_min, x_max, y_min, y_max into range, width and height into the
// rectangle.
void hw_capture_window_inner(const hw_capture_window *window, float range[4], hw_rect *rect);
// Captures the object through the window and dilates the colours.
HW_MUST_USE hw_status hw_svmesh_capture(const hw_svmesh_job *job, const hw_capture_window *window,
                                        uint32_t samples, hw_capture *out);
