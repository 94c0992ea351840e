// The scene that a dataset was built from.
#pragma once
#include "manifest.h"
#include "scene.h"

// Imports it from where the manifest says, or from `moved_to` (may be NULL). HW_FORMAT if it is not
// the one that the dataset was built from. `dataset` is the name that errors tell.
HW_MUST_USE hw_status hw_dataset_scene_import(const char *dataset, const hw_manifest *manifest,
                                              const char *moved_to, hw_scene *out);
