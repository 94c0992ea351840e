#include "file.h"
#include "alloc.h"
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#define READ_LIMIT_DEFAULT (UINT64_C(16) << 30)
#define BUFFER_BYTES       ((size_t)64 << 10)
#define IO_CHUNK_BYTES     ((size_t)1 << 30) // Linux moves at most 2 GiB - 4 KiB per call
#define TEMPORARY_TRIES    1000u

struct hw_reader {
    int fd;
    uint64_t size;
    char *path;
};

struct hw_writer {
    int fd;
    bool direct; // a device, pipe or standard output: nothing to replace
    bool failed;
    char *path;      // what the caller named
    char *target;    // what is replaced: the path with links resolved
    char *temporary; // NULL while there is no such file
    uint8_t *buffer; // BUFFER_BYTES
    size_t buffered;
};

static _Atomic uint64_t fail_at; // number of the step that fails; 0 = none
static _Atomic uint64_t counter; // steps since fail_at was set
static _Atomic uint64_t serial;  // of temporary names

void hw_file_fail_after(uint64_t n)
{
    atomic_store(&fail_at, 0);
    atomic_store(&counter, 0);
    atomic_store(&fail_at, n);
}

// True, with errno set, at the step that is to fail.
static bool injected(void)
{
    if (atomic_fetch_add(&counter, 1) + 1 != atomic_load(&fail_at))
        return false;
    errno = EIO;
    return true;
}

static hw_status fail_errno(const char *path, const char *action)
{
    int error = errno;
    char buffer[128];
    hw_status status = error == ENOENT || error == ENOTDIR ? HW_NOT_FOUND : HW_IO;
    return hw_fail(status, "%s: cannot %s: %s", path, action,
                   strerror_r(error, buffer, sizeof buffer));
}

// Output problems are always HW_IO: a folder that is missing is no missing input.
static hw_status fail_output(const char *path, const char *action)
{
    fail_errno(path, action);
    return HW_IO;
}

static void close_fd(int *fd)
{
    if (*fd >= 0)
        close(*fd);
    *fd = -1;
}

hw_status hw_reader_open(hw_reader **out, const char *path)
{
    hw_status status = HW_OK;
    struct stat info;
    *out = NULL;
    hw_reader *r = NULL;
    HW_TRY(HW_NEW(&r, 1));
    r->fd = -1;
    HW_GO(hw_strdup(&r->path, path));
    // Without O_NONBLOCK opening a pipe that nobody writes to would wait for ever.
    r->fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (r->fd < 0 || fstat(r->fd, &info) != 0) {
        status = fail_errno(path, "open");
        goto out;
    }
    if (!S_ISREG(info.st_mode)) {
        status = hw_fail(HW_IO, "%s: %s", path,
                         S_ISDIR(info.st_mode) ? "is a folder, not a file" : "not a regular file");
        goto out;
    }
    r->size = (uint64_t)info.st_size;
    *out = r;
    return HW_OK;
out:
    hw_reader_close(r);
    return status;
}

uint64_t hw_reader_size(const hw_reader *reader)
{
    return reader->size;
}

hw_status hw_reader_at(const hw_reader *reader, uint64_t offset, void *out, size_t size)
{
    uint8_t *p = out;
    if (offset > reader->size || size > reader->size - offset)
        return hw_fail(HW_FORMAT, "%s: truncated: %zu bytes expected at offset %llu of %llu",
                       reader->path, size, (unsigned long long)offset,
                       (unsigned long long)reader->size);
    while (size > 0) {
        size_t chunk = size < IO_CHUNK_BYTES ? size : IO_CHUNK_BYTES;
        ssize_t got = injected() ? -1 : pread(reader->fd, p, chunk, (off_t)offset);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0)
            return fail_errno(reader->path, "read");
        if (got == 0)
            return hw_fail(HW_FORMAT, "%s: truncated while it was being read", reader->path);
        p += got;
        offset += (uint64_t)got;
        size -= (size_t)got;
    }
    return HW_OK;
}

void hw_reader_close(hw_reader *reader)
{
    if (!reader)
        return;
    close_fd(&reader->fd);
    hw_free(reader->path);
    hw_free(reader);
}

hw_status hw_file_read(const char *path, uint64_t limit, uint8_t **data, size_t *size)
{
    hw_status status = HW_OK;
    hw_reader *reader = NULL;
    uint8_t *bytes = NULL;
    *data = NULL;
    *size = 0;
    HW_TRY(hw_reader_open(&reader, path));
    limit = limit ? limit : READ_LIMIT_DEFAULT;
    if (reader->size > limit || reader->size >= SIZE_MAX) {
        status = hw_fail(HW_LIMIT, "%s: %llu bytes, the limit is %llu", path,
                         (unsigned long long)reader->size, (unsigned long long)limit);
        goto out;
    }
    HW_GO(HW_NEW(&bytes, (size_t)reader->size + 1));
    HW_GO(hw_reader_at(reader, 0, bytes, (size_t)reader->size));
    *data = bytes;
    *size = (size_t)reader->size;
    bytes = NULL;
out:
    hw_free(bytes);
    hw_reader_close(reader);
    return status;
}

static hw_status write_all(hw_writer *w, const uint8_t *p, size_t size)
{
    while (size > 0) {
        size_t chunk = size < IO_CHUNK_BYTES ? size : IO_CHUNK_BYTES;
        ssize_t done = injected() ? -1 : write(w->fd, p, chunk);
        if (done < 0 && errno == EINTR)
            continue;
        if (done < 0) {
            w->failed = true;
            return fail_output(w->path, "write");
        }
        p += done;
        size -= (size_t)done;
    }
    return HW_OK;
}

static hw_status flush(hw_writer *w)
{
    size_t size = w->buffered;
    w->buffered = 0;
    return write_all(w, w->buffer, size);
}

// Creates "<target>.<process>.<serial>.tmp" and holds a lock on it, which tells
// hw_dir_clean_temporary of another process that its writer is alive.
static hw_status open_temporary(hw_writer *w)
{
    size_t size = strlen(w->target) + 64;
    HW_TRY(HW_NEW(&w->temporary, size));
    for (uint32_t i = 0; i < TEMPORARY_TRIES; i++) {
        struct stat info;
        snprintf(w->temporary, size, "%s.%ld.%llu.tmp", w->target, (long)getpid(),
                 (unsigned long long)atomic_fetch_add(&serial, 1));
        w->fd = open(w->temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (w->fd < 0 && errno == EEXIST)
            continue;
        if (w->fd < 0)
            break;
        flock(w->fd, LOCK_EX);
        // A cleaner may have been there between open and lock.
        if (fstat(w->fd, &info) != 0 || info.st_nlink > 0)
            return HW_OK;
        close_fd(&w->fd);
    }
    hw_status status = fail_output(w->path, "create");
    hw_free(w->temporary);
    w->temporary = NULL;
    return status;
}

// A file that standard output or error is redirected to, by whatever name, would lose what is
// written there if it were replaced: it is written through a copy of that descriptor, behind it.
static int standard_of(const struct stat *file)
{
    for (int fd = STDOUT_FILENO; fd <= STDERR_FILENO; fd++) {
        struct stat info;
        if (fstat(fd, &info) == 0 && info.st_dev == file->st_dev && info.st_ino == file->st_ino)
            return fd;
    }
    return -1;
}

static hw_status open_target(hw_writer *w)
{
    struct stat info;
    if (*w->path == 0)
        return hw_fail(HW_IO, "cannot write to an empty file name");
    bool exists = stat(w->path, &info) == 0;
    if (exists && S_ISDIR(info.st_mode))
        return hw_fail(HW_IO, "%s: is a folder, cannot be written as a file", w->path);
    if (exists && !S_ISREG(info.st_mode)) {
        w->direct = true;
        w->fd = open(w->path, O_WRONLY | O_CLOEXEC);
        return w->fd < 0 ? fail_output(w->path, "open for writing") : HW_OK;
    }
    int standard = exists ? standard_of(&info) : -1;
    if (standard >= 0) {
        fflush(standard == STDOUT_FILENO ? stdout : stderr);
        w->direct = true;
        w->fd = fcntl(standard, F_DUPFD_CLOEXEC, 0);
        return w->fd < 0 ? fail_output(w->path, "open for writing") : HW_OK;
    }
    char *resolved = exists ? realpath(w->path, NULL) : NULL;
    hw_status status = hw_strdup(&w->target, resolved ? resolved : w->path);
    free(resolved);
    HW_TRY(status);
    HW_TRY(open_temporary(w));
    if (exists && fchmod(w->fd, info.st_mode & 07777) != 0)
        return fail_output(w->path, "set the permissions");
    return HW_OK;
}

hw_status hw_writer_open(hw_writer **out, const char *path)
{
    hw_status status = HW_OK;
    hw_writer *w = NULL;
    *out = NULL;
    HW_TRY(HW_NEW(&w, 1));
    w->fd = -1;
    HW_GO(hw_strdup(&w->path, path));
    HW_GO(HW_NEW(&w->buffer, BUFFER_BYTES));
    HW_GO(open_target(w));
    *out = w;
    return HW_OK;
out:
    hw_writer_abort(w);
    return status;
}

hw_status hw_writer_put(hw_writer *writer, const void *data, size_t size)
{
    if (writer->failed)
        return hw_fail(HW_IO, "%s: an earlier write failed", writer->path);
    if (size == 0)
        return HW_OK;
    if (size > BUFFER_BYTES - writer->buffered)
        HW_TRY(flush(writer));
    if (size >= BUFFER_BYTES)
        return write_all(writer, data, size);
    memcpy(writer->buffer + writer->buffered, data, size);
    writer->buffered += size;
    return HW_OK;
}

static hw_status sync_folder(const hw_writer *w)
{
    char *folder = NULL;
    HW_TRY(hw_path_dir(&folder, w->target));
    int fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    // Some file systems cannot sync folders (EINVAL), some folders may be entered but not read: the
    // file is in place then, only less sure to survive a power cut.
    bool bad = injected() || (fd >= 0 && fsync(fd) != 0 && errno != EINVAL);
    hw_status status = bad ? fail_output(w->path, "sync its folder") : HW_OK;
    close_fd(&fd);
    hw_free(folder);
    return status;
}

static hw_status commit(hw_writer *w)
{
    if (w->failed)
        return hw_fail(HW_IO, "%s: an earlier write failed", w->path);
    HW_TRY(flush(w));
    if (w->direct) {
        int fd = w->fd;
        w->fd = -1;
        return close(fd) == 0 ? HW_OK : fail_output(w->path, "close");
    }
    if (injected() || fsync(w->fd) != 0)
        return fail_output(w->path, "sync");
    if (injected() || rename(w->temporary, w->target) != 0)
        return fail_output(w->path, "rename the finished file");
    hw_free(w->temporary);
    w->temporary = NULL;
    return sync_folder(w);
}

hw_status hw_writer_commit(hw_writer *writer)
{
    hw_status status = commit(writer);
    hw_writer_abort(writer);
    return status;
}

void hw_writer_abort(hw_writer *writer)
{
    if (!writer)
        return;
    if (writer->temporary)
        unlink(writer->temporary);
    close_fd(&writer->fd);
    hw_free(writer->temporary);
    hw_free(writer->target);
    hw_free(writer->path);
    hw_free(writer->buffer);
    hw_free(writer);
}

hw_status hw_file_write(const char *path, const void *data, size_t size)
{
    hw_writer *writer = NULL;
    HW_TRY(hw_writer_open(&writer, path));
    hw_status status = hw_writer_put(writer, data, size);
    if (status == HW_OK)
        return hw_writer_commit(writer);
    hw_writer_abort(writer);
    return status;
}

// Leaves errno as it is.
static bool is_folder(const char *path)
{
    struct stat info;
    int error = errno;
    bool folder = stat(path, &info) == 0 && S_ISDIR(info.st_mode);
    errno = error;
    return folder;
}

hw_status hw_dir_make(const char *path)
{
    char *part = NULL;
    HW_TRY(hw_strdup(&part, path));
    hw_status status = HW_OK;
    size_t length = strlen(part);
    for (size_t i = 1; i <= length && status == HW_OK; i++) {
        if (part[i] != '/' && part[i] != 0)
            continue;
        char end = part[i];
        part[i] = 0;
        // A parent that may not be written but exists is fine: EROFS or EACCES come before EEXIST.
        if (mkdir(part, 0777) != 0 && !is_folder(part))
            status = errno == EEXIST ? hw_fail(HW_IO, "%s: is a file, not a folder", part)
                                     : fail_output(part, "make the folder");
        part[i] = end;
    }
    if (length == 0)
        status = hw_fail(HW_IO, "cannot make a folder with an empty name");
    hw_free(part);
    return status;
}

// Whether a name ends as those of temporary files do: ".<number>.tmp".
static bool is_temporary(const char *name)
{
    size_t length = strlen(name), end = length > 4 ? length - 4 : 0, i = end;
    while (i > 0 && name[i - 1] >= '0' && name[i - 1] <= '9')
        i--;
    return end > 0 && !strcmp(name + end, ".tmp") && i < end && i > 0 && name[i - 1] == '.';
}

// Removes a temporary file unless its writer still holds the lock, or may (network file systems
// have no locks, or only for those that may write).
static hw_status clean_one(const char *path)
{
    struct stat info;
    if (lstat(path, &info) != 0 || !S_ISREG(info.st_mode))
        return HW_OK;
    int fd = open(path, O_RDWR | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW);
    if (fd < 0)
        fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW);
    bool alive = fd >= 0 && flock(fd, LOCK_EX | LOCK_NB) != 0;
    hw_status status = HW_OK;
    if (!alive && unlink(path) != 0 && errno != ENOENT)
        status = fail_output(path, "remove");
    close_fd(&fd);
    return status;
}

hw_status hw_dir_clean_temporary(const char *path)
{
    hw_status status = HW_OK;
    const struct dirent *entry;
    DIR *folder = opendir(path);
    if (!folder)
        return errno == ENOENT ? HW_OK : fail_output(path, "list the folder");
    while (status == HW_OK && (entry = readdir(folder))) {
        char *name = NULL;
        if (!is_temporary(entry->d_name))
            continue;
        status = hw_path_join(&name, path, entry->d_name);
        if (status == HW_OK)
            status = clean_one(name);
        hw_free(name);
    }
    closedir(folder);
    return status;
}

bool hw_path_exists(const char *path)
{
    return access(path, F_OK) == 0;
}

bool hw_path_is_folder(const char *path)
{
    char *inside = NULL;
    bool folder = hw_path_join(&inside, path, ".") == HW_OK && hw_path_exists(inside);
    hw_free(inside);
    return folder;
}

hw_status hw_path_join(char **out, const char *dir, const char *name)
{
    if (*name == '/' || *dir == 0)
        return hw_strdup(out, name);
    size_t length = strlen(dir), size = length + strlen(name) + 2;
    bool slash = dir[length - 1] != '/';
    HW_TRY(HW_NEW(out, size));
    snprintf(*out, size, "%s%s%s", dir, slash ? "/" : "", name);
    return HW_OK;
}

hw_status hw_path_dir(char **out, const char *path)
{
    size_t end = strlen(path);
    while (end > 0 && path[end - 1] == '/') // slashes at the end belong to the name
        end--;
    while (end > 0 && path[end - 1] != '/') // the name
        end--;
    while (end > 1 && path[end - 1] == '/') // slashes before it, but not the root's
        end--;
    if (end == 0)
        return hw_strdup(out, *path == '/' ? "/" : ".");
    HW_TRY(HW_NEW(out, end + 1));
    memcpy(*out, path, end);
    return HW_OK;
}
