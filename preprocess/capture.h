// Captures: the colours and depths of one object, cast from a cell's centre through a window on one
// of the cell's faces (thesis 5.2.1, SVMesh derivation, step 1).
#pragma once
#include "details.h"
#include "hexgrid.h"

// A rectangle of the plane at distance 1 from `centre` along the axis of `face` (hw_face_basis):
// the ray of plane point (x, y) is axis + x right + y up. Row 0 is the lowest (y_min); texel (i, j)
// has its centre at x_min + (i + 0.5) / width * (x_max - x_min), and alike in y.
typedef struct hw_capture_window {
    hw_vec3 centre; // of projection, world space
    int face;       // 0..5
    float x_min, x_max, y_min, y_max;
    uint32_t width, height; // texels
} hw_capture_window;
// Where in the window a point of the plane lies: texels from its corner (x_min, y_min).
void hw_capture_window_texel(const hw_capture_window *window, const double plane[2],
                             double texel[2]);

// Texel (i, j) is element j * width + i. Zero-initialise; free with hw_capture_free.
typedef struct hw_capture {
    uint32_t width, height;
    hw_color8 *colors; // a = 255 where any sample met the object, 0 elsewhere
    uint8_t *coverage; // share of the samples that met the object, rounded: 255 = all
    float *depths; // along the face's axis (not along the ray), world units; INFINITY where a = 0
} hw_capture;

#define HW_CAPTURE_SAMPLES_MAX 8

typedef struct hw_capturer hw_capturer;
// Borrows the scene, its rays (hw_rays_create_scene) and its details (NULL: originals only); owns
// samplers of the materials' textures. HW_USAGE names a mesh without normals.
HW_MUST_USE hw_status hw_capturer_create(const hw_scene *scene, const hw_rays *scene_rays,
                                         const hw_details *details, hw_capturer **out);
void hw_capturer_destroy(hw_capturer *capturer);
const hw_rays *hw_capturer_rays(const hw_capturer *capturer);

// Captures one object alone (others neither show nor occlude) with samples x samples rays a texel,
// on a regular grid; samples in 1..HW_CAPTURE_SAMPLES_MAX. With 4 x 4, four of the rays go first,
// the rest only where these tell of an outline: in a texel that some met something in or beside,
// but not all. Only what lies in front of the centre shows; both faces of triangles do.
//
// A sample's colour is texture (filtered over the sample's footprint; none without uvs) x base
// colour x the interpolation over the triangle of vertex colour x hw_light(world normal): per
// vertex, as the vertex shader has it. A texel's colour is the mean of its covered samples,
// rounded; its depth that of the covered sample nearest to its centre (of equally near ones the
// first that is cast: with 2 x 2 samples a quarter texel down and left; with 4 x 4, where the first
// four meet something, an eighth left and three down).
//
// The object may be off by `error`, world units, where that makes it cheaper (hw_details_choose);
// 0: it is the original.
//
// Thread-safe; the result depends on the arguments alone. HW_USAGE for an empty window.
HW_MUST_USE hw_status hw_capture_object(const hw_capturer *capturer, uint32_t object_idx,
                                        const hw_capture_window *window, uint32_t samples,
                                        double error, hw_capture *out);

// The same of several objects, at most one of which shows in a texel: the one whose depth there is
// least. All must lie in front of the plane through the window's centre.
HW_MUST_USE hw_status hw_capture_objects(const hw_capturer *capturer, const uint32_t *objects,
                                         uint32_t count, const hw_capture_window *window,
                                         uint32_t samples, double error, hw_capture *out);

// The colour of an object where the ray origin + t direction, t in [0, 1], first meets it; false if
// it does not. The caller has pinned the object's rays. Textures are not filtered. Thread-safe.
bool hw_capture_point(const hw_capturer *capturer, uint32_t object_idx, hw_vec3 origin,
                      hw_vec3 direction, hw_color8 *out);

// How long the calling thread has spent in hw_capture_object so far.
double hw_capture_thread_seconds(void);

// Spreads colours `texels` (at most 254) steps outwards into uncovered texels, each the mean of its
// filled neighbours (of eight), so that neither bilinear filtering nor a mesh that exceeds the
// original's outline meets the background. Their a stays 0 and their depth INFINITY.
void hw_capture_dilate(hw_capture *capture, uint32_t texels);

void hw_capture_free(hw_capture *capture);
