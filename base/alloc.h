// Memory through one overflow-checked door, with fault injection for tests.
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stdint.h>

// Allocates count * size bytes, zeroed, into *out. count or size of 0 gives a valid one-byte block.
// On overflow or exhaustion: HW_MEMORY and *out = NULL. Free with hw_free. Thread-safe.
HW_MUST_USE hw_status hw_alloc(void **out, size_t count, size_t size);
// Resizes *block (NULL is legal) to count * size bytes, contents kept, new bytes not zeroed. On
// failure *block is untouched.
HW_MUST_USE hw_status hw_realloc(void **block, size_t count, size_t size);
// free(); NULL is legal.
void hw_free(void *block);
// A copy of the string. Free with hw_free.
HW_MUST_USE hw_status hw_strdup(char **out, const char *text);

// Typed helpers: HW_NEW(&array, n) allocates n zeroed elements; HW_RESIZE changes the count.
#define HW_NEW(out, count)    hw_alloc((void **)(out), (count), sizeof **(out))
#define HW_RESIZE(out, count) hw_realloc((void **)(out), (count), sizeof **(out))

// Grows *array so that `needed` elements of `size` bytes fit (doubling); *capacity is updated.
HW_MUST_USE hw_status hw_reserve(void **array, size_t *capacity, size_t needed, size_t size);
#define HW_RESERVE(array, capacity, needed)                                                        \
    hw_reserve((void **)(array), (capacity), (needed), sizeof **(array))

// Fault injection (tests only): the n-th allocation from now fails (1 = the next), once; 0 switches
// it off. Process-wide.
void hw_alloc_fail_after(uint64_t n);
// Number of allocations since the last hw_alloc_fail_after.
uint64_t hw_alloc_count(void);
