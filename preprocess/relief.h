// Reliefs: a few triangles stand for a far object, as deep as its capture, and cut out along the
// captured outline. Outlines then cost texels: a mesh that follows them takes ten times as many
// triangles.
//
// What a relief cannot show is how the outline slips over a round body as the eye moves, or what
// comes into view between two limbs. So its outline is compared with the object's, as corners of
// the cell see them, before any ray is cast (sketch.h). Of an object that is flat from everywhere
// in the cell (its self-occluding error, thesis 5.2.1, is below impostor_px) nothing can come into
// view.
#pragma once
#include "svmesh.h"

typedef struct hw_relief {
    hw_capture_window window;
    hw_capture capture; // through the window, dilated
    hw_view_mesh mesh;  // in image space, within the window without its padding
} hw_relief;

// Whether a relief is worth a try: the object's self-occluding error, pixels, is so small that it
// is flat, or that it may keep its outline. Never of an MVMesh.
bool hw_relief_is_likely(const hw_svmesh_job *job, double self_occlusion);

// *good tells whether a relief may stand for the object: its outline is off by less than relief_px
// (or the object is flat, which is not compared), its capture is not too large, and something
// shows. Else *out is empty.
HW_MUST_USE hw_status hw_relief_make(const hw_svmesh_job *job, bool flat, bool *good,
                                     hw_relief *out);
void hw_relief_free(hw_relief *relief);
