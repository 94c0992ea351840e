// Normals and colours of a simplified mesh, fitted so that what is interpolated over its triangles
// is as close as it can be to the original's shading under them: least squares over the surface,
// instead of values picked at the vertices (the scalar part of Hoppe, Progressive Meshes, 1996,
// 4.4, with normals and for all vertices at once).
#pragma once
#include "rays.h"

// Sets mesh->normals (unit vectors) and, if the original has colours, mesh->colors; positions stay.
// `rays` is hw_rays_create_mesh of the original. What either had before is where the fit starts
// from, or the mesh's own normals and white.
HW_MUST_USE hw_status hw_fit_shading(hw_mesh *mesh, const hw_mesh *original, const hw_rays *rays);
