// Planar impostors: an object so far away that its own depth hardly shows from anywhere in the cell
// (a small self-occluding error, thesis 5.2.1) is a rectangle in the plane of its capture, cut out
// along the captured outline. Two triangles stand for what would need a hundred.
#pragma once
#include "svmesh.h"

// Fills *out with the rectangle round the object, in image space, at the object's mean parallax.
HW_MUST_USE hw_status hw_impostor_make(const hw_svmesh_job *job, hw_view_mesh *out);
