// File access: whole-file and ranged reads, atomic replacement, directories. Every failure names
// the path and errno's text.
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stdint.h>

// Reads a whole regular file. *data is 0-terminated beyond *size and freed with hw_free. Files over
// `limit` bytes (0: 16 GiB) give HW_LIMIT. A missing file is HW_NOT_FOUND, a directory or device
// HW_IO.
HW_MUST_USE hw_status hw_file_read(const char *path, uint64_t limit, uint8_t **data, size_t *size);

// Ranged reads of an open file.
typedef struct hw_reader hw_reader;
HW_MUST_USE hw_status hw_reader_open(hw_reader **out, const char *path);
uint64_t hw_reader_size(const hw_reader *reader);
// Exactly `size` bytes at `offset`, or HW_FORMAT ("truncated") when the file ends before.
// Thread-safe (pread).
HW_MUST_USE hw_status hw_reader_at(const hw_reader *reader, uint64_t offset, void *out,
                                   size_t size);
void hw_reader_close(hw_reader *reader);

// Writes `path` atomically: a temporary name in the same folder ("<path>.<process>.<n>.tmp"),
// fsync, rename, fsync of the folder. On failure (HW_IO) the old file is untouched and the
// temporary one is removed; only if the folder's sync fails is the new file already in place,
// whole. Links are followed, permissions kept; devices, pipes and the files that standard output
// and error go to are written directly.
HW_MUST_USE hw_status hw_file_write(const char *path, const void *data, size_t size);

// The same for streamed output.
typedef struct hw_writer hw_writer;
HW_MUST_USE hw_status hw_writer_open(hw_writer **out, const char *path);
HW_MUST_USE hw_status hw_writer_put(hw_writer *writer, const void *data, size_t size);
// Syncs, renames and frees. On failure everything is removed and freed too.
HW_MUST_USE hw_status hw_writer_commit(hw_writer *writer);
// Drops the temporary file and frees. NULL is legal.
void hw_writer_abort(hw_writer *writer);

// mkdir -p.
HW_MUST_USE hw_status hw_dir_make(const char *path);
// Removes leftovers "*.<number>.tmp" of killed writers in a folder (not recursive); a missing
// folder is fine. Those of living writers, also in other processes, are left alone.
HW_MUST_USE hw_status hw_dir_clean_temporary(const char *path);
bool hw_path_exists(const char *path);
// Whether it is a folder that one may enter.
bool hw_path_is_folder(const char *path);
// dir + "/" + name into a new string (absolute `name` is returned as it is). Free with hw_free.
HW_MUST_USE hw_status hw_path_join(char **out, const char *dir, const char *name);
// The folder part of a path ("." if none) into a new string. Free with hw_free.
HW_MUST_USE hw_status hw_path_dir(char **out, const char *path);

// Fault injection (tests only): the n-th read, write, sync or rename from now fails with EIO (1 =
// the next); 0 = off.
void hw_file_fail_after(uint64_t n);
