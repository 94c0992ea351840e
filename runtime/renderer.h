// One renderer per configuration behind one table. A draws everything, B culls to the frustum, L
// picks discrete levels of detail by projected error, C is the hybrid. A renderer owns its GL
// objects; the context must be current and outlive it.
#pragma once
#include "camera.h"
#include "debug_view.h"
#include "scene.h"
#include "status.h"

typedef enum hw_config { HW_CONFIG_A, HW_CONFIG_B, HW_CONFIG_L, HW_CONFIG_C } hw_config;

// How the hybrid gets its data.
typedef enum hw_loading {
    HW_LOADING_WAITS,     // a frame that lacks data waits for them (or its prepare does)
    HW_LOADING_AHEAD,     // a thread prefetches; frames draw the best there is, and never wait
    HW_LOADING_SIMULATED, // the same by simulated time (hw_renderer_advance), without a thread
    HW_LOADING_SIMULATED_WAITS, // frames wait, with the limit of bandwidth by simulated time
} hw_loading;

// 0 = defaults.
typedef struct hw_streaming {
    hw_loading loading;
    uint64_t bytes_per_second; // limit of reading; 0 = none
    uint64_t gpu_budget,
        ram_budget;       // bytes of the dataset's data on the GPU, and waiting in memory
    uint64_t frame_bytes; // brought to the GPU per frame at most
} hw_streaming;

// Of the hybrid; zeros else.
typedef struct hw_stream_stats {
    uint32_t missing;    // objects drawn with other data than wanted, or not at all, in this frame
    uint32_t late_cells; // levels of the hierarchy drawn from another place's cell in this frame
    uint32_t queued;     // pieces wished for and under way
    uint64_t gpu_bytes, gpu_budget, ram_bytes, ram_budget;
    uint64_t ram_bytes_peak;             // since the start, also between frames
    uint64_t read_bytes, uploaded_bytes; // since the start
    double waited_ms;                    // simulated waiting in this frame
    uint32_t problem_count;              // pieces that could not be loaded, since the start
    const char *problem;                 // the last of them, "" if none; valid until the next frame
} hw_stream_stats;

typedef struct hw_frame_stats {
    uint64_t triangles; // sent to GL
    uint32_t draws;
    uint32_t near_triangles, far_triangles; // C only
    uint32_t hidden;       // C only: near and far objects in view left out, hidden by near ones
    uint32_t stalls;       // 1 if this frame waited for data
    uint64_t loaded_bytes; // read from disk by this frame
    double load_ms;
    int32_t cell_q, cell_r, cell_level; // C only
    hw_stream_stats stream;             // C only
} hw_frame_stats;

typedef struct hw_renderer_desc {
    hw_config config;
    const char *dataset;     // C: the dataset's folder, or its URL (http://...)
    const hw_scene *scene;   // A, B, L: the original scene, borrowed
    double lod_error_px;     // L: largest projected error; 0 = 1
    hw_streaming streaming;  // C
    uint32_t near_triangles; // C: of the near objects in a frame, at most; 0 = default
    bool hide;               // C: do not draw what near objects hide; changes no pixel
    double crossing_width;   // C: strips along borders in which cells dissolve into each other, in
                             // cell sizes (crossing.h); 0: hard crossings
} hw_renderer_desc;

#define HW_NEAR_TRIANGLES 100000u

// 13.5 units to each side of a border, in cells of 50: 27 frames of the default tour.
// Wider strips show cells from farther outside, which costs PSNR; narrower ones jump more.
#define HW_CROSSING_WIDTH 0.27

typedef struct hw_renderer hw_renderer;
HW_MUST_USE hw_status hw_renderer_create(const hw_renderer_desc *desc, hw_renderer **out);
void hw_renderer_destroy(hw_renderer *renderer);
// One step towards the first frame, for who must not wait for it: with prefetching, what is drawn
// before *ready waits until there is something to draw. Everything else is ready at once.
HW_MUST_USE hw_status hw_renderer_arrive(hw_renderer *renderer, const hw_camera *camera,
                                         bool *ready);
// Loads what the view needs (C: the cell and its near meshes), so that a following draw does not
// stall. Not timed by benchmarks that measure drawing; counted in the stats. With prefetching it
// waits only as long as there is nothing at all to draw.
HW_MUST_USE hw_status hw_renderer_prepare(hw_renderer *renderer, const hw_camera *camera,
                                          hw_frame_stats *stats);
// Clears and draws the frame into the bound framebuffer. Objects write alpha 1, sky and ground
// alpha 0.
HW_MUST_USE hw_status hw_renderer_draw(hw_renderer *renderer, const hw_camera *camera,
                                       hw_frame_stats *stats);
// How the following frames are drawn; a zeroed view, as at first, is the plain picture.
void hw_renderer_set_debug_view(hw_renderer *renderer, const hw_debug_view *view);
// Simulated time (HW_LOADING_SIMULATED...) goes on by dt_s seconds, during which the prefetcher
// works beside the frames.
void hw_renderer_advance(hw_renderer *renderer, double dt_s);
// Bytes of GL buffers and textures this renderer holds, now and at its peak.
uint64_t hw_renderer_gpu_bytes(const hw_renderer *renderer);
uint64_t hw_renderer_gpu_bytes_peak(const hw_renderer *renderer);
// "A", "B", "L", "C", and back (false if unknown).
const char *hw_config_name(hw_config config);
bool hw_config_parse(const char *text, hw_config *out);
