// MVMesh: the multi-view textured mesh of an object that is too deep, for its distance, to be
// textured by one capture (thesis 5.2.1). The mesh is derived like an SVMesh, culled to the whole
// cell; then further captures are taken from other points of the cell, and each triangle is told
// which captures see it.
//
// The points are corners of the cell at half its height, which nothing that is not near can hold.
// Seen from the object they are the outermost to both sides, so that every direction that a viewer
// in the cell may look from lies between two captures; the record's own capture, from the centre,
// is in the middle.
#pragma once
#include "svmesh.h"

// Where an MVMesh is captured from, at most HW_FAR_VIEWS_MAX points: the cell's centre, then its
// corners in the order in which they widen the range of directions. Returns how many.
uint32_t hw_mvmesh_eyes(const hw_svmesh_job *job, hw_vec3 eyes[HW_FAR_VIEWS_MAX]);
// The face whose window holds the object as seen from there.
int hw_mvmesh_face(const hw_svmesh_job *job, hw_vec3 eye);
// Adds views, ranges and colours to a mesh that has its own capture. Triangles are reordered by the
// set of views that see them, vertices by first use.
//
// Large triangles that no capture sees whole are split first, with their neighbours, so that what is
// partly hidden gets a border. A capture sees a triangle that faces it, is not much more oblique in it than in the best one, and
// is hidden in less than a tenth of its texels. Of the triangles that no capture sees, those that
// rays from many points of the cell do not reach either are dropped; the others get the colours
// their vertices have on the original.
HW_MUST_USE hw_status hw_mvmesh_add_views(const hw_svmesh_job *job, hw_svmesh *mesh);
