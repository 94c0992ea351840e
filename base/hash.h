// 64-bit content hashes (XXH3) that key cached results: a result belongs to its inputs, never to a
// file name.
#pragma once
#include <stddef.h>
#include <stdint.h>

// Hash of the bytes, seeded by `seed` so that calls can be chained: h = hw_hash(h, data, size).
uint64_t hw_hash(uint64_t seed, const void *data, size_t size);
