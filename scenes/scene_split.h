// Oversized meshes (a terrain, a building, a scanned site) cut into pieces: an object is drawn as
// geometry from every cell that lies near its box or in it, and one that is as wide as the scene
// would be so everywhere, at full detail.
#pragma once
#include "scene.h"

// Meshes that are wider than this many pieces and have more triangles than this are cut.
#define HW_SPLIT_WIDTH     4.0
#define HW_SPLIT_TRIANGLES 2000u

// Cuts each oversized mesh (judged by its largest instance) into pieces about `size` units wide in
// the world, each a mesh of its own, and puts as many objects in the place of each instance, with
// its transform and material. The bounds of objects must be up to date and are so again afterwards.
// Objects and meshes that are not cut keep their order. Triangles stay whole; those along a cut
// belong to both pieces, at least over a fiftieth of a piece's width, so that nothing shows through
// between two that are simplified apart. Vertices keep their normals. *cut: the number of meshes
// that were. HW_LIMIT, HW_MEMORY: the scene is as it was.
HW_MUST_USE hw_status hw_scene_split(hw_scene *scene, double size, uint32_t *cut);
