#include "alloc.h"
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

static _Atomic uint64_t fail_at; // number of the allocation that fails; 0 = none
static _Atomic uint64_t counter; // allocations since fail_at was set

static bool injected(void)
{
    return atomic_fetch_add(&counter, 1) + 1 == atomic_load(&fail_at);
}

// Bytes of count * size, at least 1. False on overflow; PTRDIFF_MAX is malloc's own limit.
static bool byte_count(size_t count, size_t size, size_t *bytes)
{
    if (__builtin_mul_overflow(count, size, bytes) || *bytes > PTRDIFF_MAX)
        return false;
    if (*bytes == 0)
        *bytes = 1;
    return true;
}

static hw_status fail_memory(size_t count, size_t size)
{
    return hw_fail(HW_MEMORY, "out of memory (%zu x %zu bytes)", count, size);
}

hw_status hw_alloc(void **out, size_t count, size_t size)
{
    size_t bytes;
    *out = NULL;
    if (injected() || !byte_count(count, size, &bytes))
        return fail_memory(count, size);
    *out = calloc(1, bytes);
    return *out ? HW_OK : fail_memory(count, size);
}

hw_status hw_realloc(void **block, size_t count, size_t size)
{
    size_t bytes;
    if (injected() || !byte_count(count, size, &bytes))
        return fail_memory(count, size);
    void *moved = realloc(*block, bytes);
    if (!moved)
        return fail_memory(count, size);
    *block = moved;
    return HW_OK;
}

void hw_free(void *block)
{
    free(block);
}

hw_status hw_strdup(char **out, const char *text)
{
    size_t size = strlen(text) + 1;
    HW_TRY(HW_NEW(out, size));
    memcpy(*out, text, size);
    return HW_OK;
}

hw_status hw_reserve(void **array, size_t *capacity, size_t needed, size_t size)
{
    if (needed <= *capacity)
        return HW_OK;
    size_t grown = *capacity <= SIZE_MAX / 2 ? *capacity * 2 : SIZE_MAX;
    if (grown < 16)
        grown = 16;
    // Near the address space's end doubling overflows where the exact size would not.
    if (grown < needed || (size && grown > PTRDIFF_MAX / size))
        grown = needed;
    HW_TRY(hw_realloc(array, grown, size));
    *capacity = grown;
    return HW_OK;
}

void hw_alloc_fail_after(uint64_t n)
{
    atomic_store(&fail_at, 0);
    atomic_store(&counter, 0);
    atomic_store(&fail_at, n);
}

uint64_t hw_alloc_count(void)
{
    return atomic_load(&counter);
}
