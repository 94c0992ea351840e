// Checks of the files that a command is to write, before it does anything.
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stdint.h>

bool hw_path_ends_with(const char *path, const char *end);
// HW_USAGE unless the path ends in `extension` (".ply"). NULL, for an output that is not wanted, is
// fine here and below; `option` is its name without dashes.
HW_MUST_USE hw_status hw_output_extension(const char *option, const char *path,
                                          const char *extension);
// HW_USAGE if the path is one of the files that are read, by whatever name.
HW_MUST_USE hw_status hw_output_apart(const char *option, const char *path, uint32_t input_count,
                                      const char *const *inputs);
