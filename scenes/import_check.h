// Strict checks of model files before Assimp sees them: it believes counts in headers (and
// allocates them), overlooks truncation, and drops what it cannot read without a word. Internal to
// scenes.
#pragma once
#include "status.h"

typedef enum hw_model_kind {
    HW_MODEL_GLTF, // .gltf and .glb
    HW_MODEL_PLY,
    HW_MODEL_OBJ,
    HW_MODEL_OFF,
    HW_MODEL_STL,
    HW_MODEL_3DS,
    HW_MODEL_OTHER // left to Assimp
} hw_model_kind;

// By the file name's extension.
hw_model_kind hw_model_kind_of(const char *path);
// Structure, lengths, counts and indices; errors name the file first, then the cause. Missing,
// empty, too long (8 GiB) and irregular files are refused for every kind.
HW_MUST_USE hw_status hw_import_check(const char *path);
