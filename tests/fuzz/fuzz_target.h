// A fuzz target: libFuzzer's entry, and whether the last input was accepted (so that the replay of
// the corpus notices when its valid files no longer are).
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

extern bool fuzz_accepted;
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
