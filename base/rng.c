#include "rng.h"
#include <assert.h>

// PCG-XSH-RR 64/32, the reference "pcg32" of O'Neill 2014, seeded as pcg32_srandom does.
uint32_t hw_rng_u32(hw_rng *rng)
{
    uint64_t old = rng->state;
    rng->state = old * 6364136223846793005u + rng->increment;
    uint32_t shifted = (uint32_t)(((old >> 18) ^ old) >> 27);
    uint32_t rotation = (uint32_t)(old >> 59);
    return (shifted >> rotation) | (shifted << (-rotation & 31));
}

hw_rng hw_rng_make(uint64_t seed, uint64_t stream)
{
    hw_rng rng = {0, (stream << 1) | 1};
    hw_rng_u32(&rng);
    rng.state += seed;
    hw_rng_u32(&rng);
    return rng;
}

float hw_rng_float(hw_rng *rng)
{
    return (float)(hw_rng_u32(rng) >> 8) * 0x1p-24f;
}

uint32_t hw_rng_below(hw_rng *rng, uint32_t bound)
{
    assert(bound > 0);
    // The lowest 2^32 mod bound values would be one too many for the low residues: draw again.
    uint32_t threshold = -bound % bound;
    for (;;) {
        uint32_t v = hw_rng_u32(rng);
        if (v >= threshold)
            return v % bound;
    }
}
