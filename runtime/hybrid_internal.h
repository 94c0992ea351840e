// The parts of the hybrid (draw_hybrid.c): which cells a frame shows (hybrid_cells.c), near objects
// (hybrid_near.c), far ones (hybrid_far.c). For those files alone.
#pragma once
#include "cell_gpu.h"
#include "crossing.h"
#include "far_views.h"
#include "ground.h"
#include "hiding.h"
#include "prefetch.h"
#include "renderer.h"
#include "store.h"

// One record as the uniform block holds it (std140).
typedef struct far_uniform {
    float clip[16];
    float texture[4];
    hw_kept kept;
    float unused[2];
} far_uniform;
_Static_assert(sizeof(far_uniform) == 96, "a far record's uniforms are 96 bytes");
#define PAGE_BYTES (HW_FAR_PAGE_RECORDS * sizeof(far_uniform))
_Static_assert(PAGE_BYTES <= 16384 && PAGE_BYTES % 256 == 0, "a page fits into a uniform block");

// What the frame needs of a near object beside its mesh; per object of the manifest.
typedef struct near_object {
    float normal[9]; // world <- mesh, for normals; column-major
    bool mirrored;
} near_object;

// A near object chosen for this frame.
typedef struct near_draw {
    uint32_t object_idx;
    float distance; // of its box to the eye
    hw_kept kept;
    const hw_near_level *level;
} near_draw;

typedef struct near_program {
    GLuint name;
    GLint clip, normal, color, kept;
} near_program;

typedef struct far_program {
    GLuint name;
    GLint first_record;
} far_program;

typedef struct hybrid {
    hw_gpu_account *account;
    char *dataset;
    hw_manifest manifest;
    near_object *objects;
    float *stretch; // of each object
    hw_store *store;
    hw_prefetch *prefetch;    // NULL: frames wait for what they lack
    bool simulated, drawable; // drawable: a cell was ready once
    double simulated_s;
    double first_s; // when the first frame could have been drawn, coarser than wished; < 0: not yet
    hw_ground_gl ground;
    near_program near_programs[2][HW_PHASES]; // without and with a texture
    far_program far_programs[2][HW_PHASES];   // opaque, cut out
    hw_far_views_gl far_views;                // if there may be MVMeshes
    double crossing_width;
    uint32_t turns;          // in which objects dissolve
    uint32_t near_triangles; // budget
    hw_gpu_buffer far_uniforms;
    hw_gpu_pace pace;
    const hw_debug_view *debug; // the renderer's
    hw_hiding *hiding;          // NULL: what near objects hide is drawn all the same
    bool hides;                 // in this frame
    uint32_t hidden_count;      // near objects and far records left out of this frame
    // Scratch for the near objects and far records of a frame's cells; capacities in items.
    size_t near_capacity, far_capacity;
    uint32_t *visible, *dissolving;
    hw_cull_item *order, *order_scratch;
    near_draw *near;
    far_uniform *far; // whole pages
} hybrid;

// The cells that a frame shows: those of the crossing, each with the groups that hold it, by level.
typedef struct frame_cells {
    hw_crossing crossing;
    hw_cell_gpu *chains[HW_CROSSING_CELLS][HW_CELL_LEVELS_MAX];
} frame_cells;

static inline size_t hw_hybrid_page_count(size_t records)
{
    return (records + HW_FAR_PAGE_RECORDS - 1) / HW_FAR_PAGE_RECORDS;
}

// Scratch for so many near objects and far records. Cells have about as many as the first that
// come: from then on nothing is allocated.
HW_MUST_USE hw_status hw_hybrid_reserve_scratch(hybrid *h, size_t near, size_t far);
// Takes what has come, and wishes for what is to come.
void hw_hybrid_begin_loading(hybrid *h, const hw_camera *camera);
// With prefetching, one step towards the first frame; *ready: it can be drawn without waiting.
HW_MUST_USE hw_status hw_hybrid_arrive(hybrid *h, const hw_camera *camera, bool *ready);
// The cells of the frame, and scratch for their records; with prefetching, the best there are.
HW_MUST_USE hw_status hw_hybrid_find_cells(hybrid *h, const hw_camera *camera,
                                           hw_frame_stats *stats, frame_cells *out);
// The level of detail of a near object that a tolerance asks for at this distance.
hw_data_key hw_hybrid_level_key(const hybrid *h, uint32_t object_idx, double error_px,
                                double focal_px, float distance);

HW_MUST_USE hw_status hw_hybrid_make_near(hybrid *h);
// Near objects in view, of the frame's cells, and their levels, into h->near.
HW_MUST_USE hw_status hw_hybrid_choose_near(hybrid *h, const frame_cells *cells,
                                            const hw_camera *camera, const hw_frustum *frustum,
                                            hw_frame_stats *stats, uint32_t *count);
void hw_hybrid_draw_near(hybrid *h, uint32_t count, const hw_mat4 *matrix, hw_frame_stats *stats);

// Leaves the near objects out of h->near that others hide, and remembers for hw_hybrid_hide_far
// what all of them hide in the camera's picture: no pixel changes.
void hw_hybrid_hide_near(hybrid *h, const hw_camera *camera, uint32_t *count);
// Leaves the records out of `visible` that near objects hide; returns how many are left.
uint32_t hw_hybrid_hide_far(hybrid *h, const hw_cell_gpu *cell, uint32_t *visible, uint32_t count);

HW_MUST_USE hw_status hw_hybrid_make_far(hybrid *h);
void hw_hybrid_draw_far(hybrid *h, const frame_cells *cells, hw_vec3 eye, const hw_mat4 *matrix,
                        const hw_frustum *frustum, hw_frame_stats *stats);
