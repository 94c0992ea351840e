// A small deterministic generator (PCG32, O'Neill 2014): the same numbers on every machine for the
// same seed and stream.
#pragma once
#include <stdint.h>

typedef struct hw_rng {
    uint64_t state, increment;
} hw_rng;

hw_rng hw_rng_make(uint64_t seed, uint64_t stream);
uint32_t hw_rng_u32(hw_rng *rng);
// Uniform in [0, 1), 24 bits.
float hw_rng_float(hw_rng *rng);
// Uniform in [0, bound), bound > 0, without bias.
uint32_t hw_rng_below(hw_rng *rng, uint32_t bound);
