#include "spill.h"
#include "alloc.h"
#include "file.h"
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#define BLOCK_ALIGN 64u

typedef struct region {
    void *address;
    size_t size;
    uint64_t used; // by the clock of the spill
} region;

struct hw_spill {
    char *folder;
    int fd;
    pthread_mutex_t mutex;
    uint64_t size, clock;
    region *regions;
    size_t capacity;
    uint32_t count;
};

// Linux makes files without a name on most file systems; elsewhere the name is taken away at once.
static int open_nameless(const char *folder)
{
    char *path = NULL, name[64];
    int fd = open(folder, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (fd >= 0)
        return fd;
    snprintf(name, sizeof name, "scratch.%ld.tmp", (long)getpid());
    if (hw_path_join(&path, folder, name) != HW_OK)
        return -1;
    fd = open(path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (fd >= 0)
        unlink(path);
    hw_free(path);
    return fd;
}

hw_status hw_spill_create(hw_spill **out, const char *folder)
{
    hw_status status = HW_OK;
    hw_spill *spill = NULL;
    *out = NULL;
    HW_TRY(HW_NEW(&spill, 1));
    spill->fd = -1;
    pthread_mutex_init(&spill->mutex, NULL);
    HW_GO(hw_strdup(&spill->folder, folder));
    spill->fd = open_nameless(folder);
    if (spill->fd < 0)
        HW_GO(hw_fail(HW_IO, "%s: cannot make a scratch file: %s", folder, strerror(errno)));
    *out = spill;
    spill = NULL;
out:
    hw_spill_destroy(spill);
    return status;
}

void hw_spill_destroy(hw_spill *spill)
{
    if (!spill)
        return;
    for (uint32_t i = 0; i < spill->count; i++)
        munmap(spill->regions[i].address, spill->regions[i].size);
    if (spill->fd >= 0)
        close(spill->fd);
    pthread_mutex_destroy(&spill->mutex);
    hw_free(spill->regions);
    hw_free(spill->folder);
    hw_free(spill);
}

static size_t round_up(size_t size, size_t step)
{
    return (size + step - 1) / step * step;
}

static hw_status fail_scratch(const hw_spill *spill, const char *what)
{
    return hw_fail(HW_IO, "%s: cannot %s the scratch file: %s", spill->folder, what,
                   strerror(errno));
}

static hw_status write_at(const hw_spill *spill, const void *data, size_t size, uint64_t offset)
{
    const uint8_t *bytes = data;
    while (size > 0) {
        ssize_t n = pwrite(spill->fd, bytes, size, (off_t)offset);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return fail_scratch(spill, "write");
        bytes += n;
        offset += (uint64_t)n;
        size -= (size_t)n;
    }
    return HW_OK;
}

// Keeps the next `size` bytes of the file for the caller.
static hw_status allot(hw_spill *spill, size_t size, uint64_t *offset)
{
    pthread_mutex_lock(&spill->mutex);
    *offset = spill->size;
    hw_status status = ftruncate(spill->fd, (off_t)(spill->size + size)) == 0
                           ? HW_OK
                           : fail_scratch(spill, "enlarge");
    if (status == HW_OK)
        spill->size += size;
    pthread_mutex_unlock(&spill->mutex);
    return status;
}

static hw_status add_region(hw_spill *spill, void *address, size_t size, uint32_t *out)
{
    pthread_mutex_lock(&spill->mutex);
    hw_status status = HW_RESERVE(&spill->regions, &spill->capacity, spill->count + 1);
    if (status == HW_OK) {
        *out = spill->count;
        spill->regions[spill->count++] = (region){address, size, ++spill->clock};
    }
    pthread_mutex_unlock(&spill->mutex);
    return status;
}

hw_status hw_spill_put(hw_spill *spill, hw_spill_block *blocks, uint32_t count, uint32_t *out)
{
    uint64_t start, offset;
    size_t size = 0;
    for (uint32_t i = 0; i < count; i++)
        size += blocks[i].data ? round_up(blocks[i].size, BLOCK_ALIGN) : 0;
    size = round_up(size + 1, (size_t)sysconf(_SC_PAGESIZE)); // a region is never empty
    HW_TRY(allot(spill, size, &start));
    offset = start;
    for (uint32_t i = 0; i < count; i++) {
        if (!blocks[i].data)
            continue;
        HW_TRY(write_at(spill, blocks[i].data, blocks[i].size, offset));
        offset += round_up(blocks[i].size, BLOCK_ALIGN);
    }
    uint8_t *address = mmap(NULL, size, PROT_READ, MAP_SHARED, spill->fd, (off_t)start);
    if (address == MAP_FAILED)
        return fail_scratch(spill, "map");
    hw_status status = add_region(spill, address, size, out);
    if (status != HW_OK) {
        munmap(address, size);
        return status;
    }
    offset = 0;
    for (uint32_t i = 0; i < count; i++) {
        blocks[i].mapped = blocks[i].data ? address + offset : NULL;
        offset += blocks[i].data ? round_up(blocks[i].size, BLOCK_ALIGN) : 0;
    }
    return HW_OK;
}

void hw_spill_touch(hw_spill *spill, uint32_t index)
{
    pthread_mutex_lock(&spill->mutex);
    spill->regions[index].used = ++spill->clock;
    pthread_mutex_unlock(&spill->mutex);
}

static int compare_uses(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

// The use that half of the regions are older than; UINT64_MAX without memory to find out.
static uint64_t median_use(const hw_spill *spill)
{
    uint64_t *uses = NULL, median = UINT64_MAX;
    if (spill->count == 0 || HW_NEW(&uses, spill->count) != HW_OK)
        return median;
    for (uint32_t i = 0; i < spill->count; i++)
        uses[i] = spill->regions[i].used;
    qsort(uses, spill->count, sizeof *uses, compare_uses);
    median = uses[spill->count / 2];
    hw_free(uses);
    return median;
}

void hw_spill_drop(hw_spill *spill, bool all)
{
    pthread_mutex_lock(&spill->mutex);
    uint64_t until = all ? UINT64_MAX : median_use(spill);
    for (uint32_t i = 0; i < spill->count; i++)
        if (spill->regions[i].used < until)
            madvise(spill->regions[i].address, spill->regions[i].size, MADV_DONTNEED);
    pthread_mutex_unlock(&spill->mutex);
}

uint64_t hw_spill_bytes(hw_spill *spill)
{
    pthread_mutex_lock(&spill->mutex);
    uint64_t size = spill->size;
    pthread_mutex_unlock(&spill->mutex);
    return size;
}
