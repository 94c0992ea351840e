#include "hash.h"
#include <xxhash.h>

uint64_t hw_hash(uint64_t seed, const void *data, size_t size)
{
    return XXH3_64bits_withSeed(data, size, seed);
}
