// Meshes whose z is up. Files in which y is up, as most glTF, are turned by their objects'
// transforms when they are read; what measures a mesh by itself, as walkers would see it, wants its
// vertices turned.
#pragma once
#include "scene.h"

// Turns each mesh so that up, as its first object stands in the world, is its z axis, and its
// objects' transforms back: in the world all stays where it was, but for rounding. Those that stand
// upright already stay as they are, bit by bit. Bounds are up to date afterwards.
// HW_MEMORY: nothing was turned.
HW_MUST_USE hw_status hw_scene_stand_upright(hw_scene *scene);
