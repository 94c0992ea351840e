#include "alloc.h"
#include "file.h"
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

// Every test runs in a fresh folder of its own, which must hold nothing unexpected afterwards.
static char folder[64];

static int enter(void **state)
{
    (void)state;
    snprintf(folder, sizeof folder, "file.XXXXXX");
    return mkdtemp(folder) && chdir(folder) == 0 ? 0 : -1;
}

static int leave(void **state)
{
    (void)state;
    char command[128];
    hw_file_fail_after(0);
    hw_alloc_fail_after(0);
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return chdir("..") == 0 && system(command) == 0 ? 0 : -1;
}

static uint32_t entries(const char *path)
{
    uint32_t count = 0;
    DIR *dir = opendir(path);
    assert_non_null(dir);
    for (struct dirent *e; (e = readdir(dir));)
        count += strcmp(e->d_name, ".") && strcmp(e->d_name, "..");
    closedir(dir);
    return count;
}

static void assert_content(const char *path, const char *expected)
{
    uint8_t *data = NULL;
    size_t size = 0;
    assert_int_equal(hw_file_read(path, 0, &data, &size), HW_OK);
    assert_int_equal(size, strlen(expected));
    assert_memory_equal(data, expected, size);
    assert_int_equal(data[size], 0);
    hw_free(data);
}

static hw_status put_text(const char *path, const char *text)
{
    return hw_file_write(path, text, strlen(text));
}

static void assert_error_has(const char *a, const char *b)
{
    if (!strstr(hw_error_text(), a) || !strstr(hw_error_text(), b))
        fail_msg("'%s' names not both of '%s' and '%s'", hw_error_text(), a, b);
}

static void what_is_written_is_read(void **state)
{
    (void)state;
    assert_int_equal(put_text("a", "first"), HW_OK);
    assert_content("a", "first");
    assert_int_equal(put_text("a", "second, longer"), HW_OK);
    assert_content("a", "second, longer");
    assert_int_equal(put_text("a", ""), HW_OK);
    assert_content("a", "");
    assert_int_equal(entries("."), 1);
}

static void bad_inputs_are_named(void **state)
{
    (void)state;
    uint8_t *data = (uint8_t *)1;
    size_t size = 1;
    hw_reader *reader = NULL;
    assert_int_equal(hw_file_read("absent", 0, &data, &size), HW_NOT_FOUND);
    assert_null(data);
    assert_int_equal(size, 0);
    assert_error_has("absent", strerror(ENOENT));
    assert_int_equal(hw_file_read(".", 0, &data, &size), HW_IO);
    assert_error_has(".", "folder");
    assert_int_equal(hw_file_read("/dev/zero", 0, &data, &size), HW_IO);
    assert_int_equal(mkfifo("pipe", 0600), 0);
    assert_int_equal(hw_file_read("pipe", 0, &data, &size), HW_IO); // and does not wait
    assert_int_equal(hw_reader_open(&reader, "absent"), HW_NOT_FOUND);
    assert_null(reader);
    assert_int_equal(put_text("five", "12345"), HW_OK);
    assert_int_equal(hw_file_read("five", 4, &data, &size), HW_LIMIT);
    assert_error_has("five", "4");
    assert_int_equal(hw_file_read("five", 5, &data, &size), HW_OK);
    hw_free(data);
}

static void ranges_are_read_and_checked(void **state)
{
    (void)state;
    char out[8] = "";
    hw_reader *r = NULL;
    assert_int_equal(put_text("a", "0123456789"), HW_OK);
    assert_int_equal(hw_reader_open(&r, "a"), HW_OK);
    assert_int_equal(hw_reader_size(r), 10);
    assert_int_equal(hw_reader_at(r, 3, out, 4), HW_OK);
    assert_memory_equal(out, "3456", 4);
    assert_int_equal(hw_reader_at(r, 10, out, 0), HW_OK);
    assert_int_equal(hw_reader_at(r, 7, out, 4), HW_FORMAT);
    assert_error_has("a: ", "truncated");
    assert_int_equal(hw_reader_at(r, 11, out, 0), HW_FORMAT);
    assert_int_equal(hw_reader_at(r, UINT64_MAX, out, 4), HW_FORMAT);
    assert_int_equal(hw_reader_at(r, 4, out, SIZE_MAX), HW_FORMAT);
    // Cut behind our back.
    assert_int_equal(truncate("a", 5), 0);
    assert_int_equal(hw_reader_at(r, 4, out, 4), HW_FORMAT);
    hw_reader_close(r);
    hw_reader_close(NULL);
}

static void streams_are_written_whole(void **state)
{
    (void)state;
    hw_writer *w = NULL;
    size_t block = 100000, size = 0; // beyond the writer's buffer
    char *expected = malloc(3 * block), *p = expected;
    assert_non_null(expected);
    for (size_t i = 0; i < 3 * block; i++)
        expected[i] = (char)('a' + i % 23);
    assert_int_equal(hw_writer_open(&w, "out"), HW_OK);
    static const size_t sizes[] = {1, 7, 65535, 1, 65536, 100000, 0, 3, 65529};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        assert_int_equal(hw_writer_put(w, p, sizes[i]), HW_OK);
        p += sizes[i];
        size += sizes[i];
    }
    assert_false(hw_path_exists("out")); // not before it is complete
    assert_int_equal(hw_writer_commit(w), HW_OK);
    expected[size] = 0;
    assert_content("out", expected);
    assert_int_equal(entries("."), 1);
    free(expected);
}

static void an_aborted_write_leaves_nothing(void **state)
{
    (void)state;
    hw_writer *w = NULL;
    assert_int_equal(put_text("a", "old"), HW_OK);
    assert_int_equal(hw_writer_open(&w, "a"), HW_OK);
    assert_int_equal(hw_writer_put(w, "new", 3), HW_OK);
    assert_int_equal(entries("."), 2);
    hw_writer_abort(w);
    hw_writer_abort(NULL);
    assert_content("a", "old");
    assert_int_equal(entries("."), 1);
}

// The steps of one write are write, sync, rename, sync of the folder: each fails in turn.
static void every_failing_step_keeps_a_whole_file(void **state)
{
    (void)state;
    uint64_t n = 1;
    for (;; n++) {
        hw_file_fail_after(0);
        assert_int_equal(put_text("a", "old"), HW_OK);
        hw_file_fail_after(n);
        hw_status status = put_text("a", "new");
        hw_file_fail_after(0);
        assert_int_equal(entries("."), 1); // no temporary name is left
        if (status == HW_OK)
            break;
        assert_int_equal(status, HW_IO);
        assert_error_has("a: ", strerror(EIO));
        assert_content("a", n < 4 ? "old" : "new"); // the folder's sync comes after the rename
    }
    assert_int_equal(n, 5);
    assert_content("a", "new");
}

static void every_failing_allocation_keeps_the_old_file(void **state)
{
    (void)state;
    assert_int_equal(put_text("a", "old"), HW_OK);
    uint64_t n = 1;
    for (;; n++) {
        hw_alloc_fail_after(n);
        hw_status status = put_text("a", "new");
        hw_alloc_fail_after(0);
        assert_int_equal(entries("."), 1);
        if (status == HW_OK)
            break;
        assert_int_equal(status, HW_MEMORY);
    }
    assert_true(n > 4);
    for (n = 1;; n++) {
        uint8_t *data;
        size_t size;
        hw_alloc_fail_after(n);
        hw_status status = hw_file_read("a", 0, &data, &size);
        hw_alloc_fail_after(0);
        hw_free(data);
        if (status == HW_OK)
            break;
        assert_int_equal(status, HW_MEMORY);
        assert_null(data);
    }
    assert_true(n > 2);
}

static void failing_reads_are_told(void **state)
{
    (void)state;
    uint8_t *data;
    size_t size;
    assert_int_equal(put_text("a", "text"), HW_OK);
    hw_file_fail_after(1);
    assert_int_equal(hw_file_read("a", 0, &data, &size), HW_IO);
    assert_null(data);
    assert_error_has("a: ", strerror(EIO));
    assert_content("a", "text"); // failed once
}

// A file size limit fails like a full disk: in the middle of the data, by the real system call.
static void a_full_disk_keeps_the_old_file(void **state)
{
    (void)state;
    struct rlimit before, limit;
    size_t size = 1 << 20;
    char *data = calloc(1, size);
    assert_non_null(data);
    assert_int_equal(put_text("a", "old"), HW_OK);
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    limit = before;
    limit.rlim_cur = 300000;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &limit), 0);
    hw_status status = hw_file_write("a", data, size);
    hw_writer *w = NULL;
    assert_int_equal(hw_writer_open(&w, "a"), HW_OK);
    hw_status last = HW_OK;
    for (int i = 0; i < 1000; i++) // goes on although it failed
        last = hw_writer_put(w, data, 1000);
    hw_status committed = hw_writer_commit(w);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_int_equal(status, HW_IO);
    assert_int_equal(last, HW_IO);
    assert_int_equal(committed, HW_IO);
    assert_content("a", "old");
    assert_int_equal(entries("."), 1);
    assert_int_equal(put_text("/dev/full", "text"), HW_IO);
    assert_error_has("/dev/full", strerror(ENOSPC));
    free(data);
}

static void unwritable_outputs_are_named(void **state)
{
    (void)state;
    assert_int_equal(put_text("absent/a", "text"), HW_IO);
    assert_error_has("absent/a", strerror(ENOENT));
    assert_int_equal(put_text(".", "text"), HW_IO);
    assert_error_has(".", "folder");
    assert_int_equal(put_text("", "text"), HW_IO);
    assert_int_equal(put_text("/proc/a", "text"), HW_IO);
    assert_error_has("/proc/a", "cannot");
    assert_int_equal(put_text("file", "text"), HW_OK);
    assert_int_equal(put_text("file/a", "text"), HW_IO);
    assert_int_equal(entries("."), 1);
}

// Replacing a device by a file would be a disaster; so would turning a link into a file.
static void devices_and_links_stay(void **state)
{
    (void)state;
    struct stat info;
    assert_int_equal(put_text("/dev/null", "text"), HW_OK);
    assert_int_equal(stat("/dev/null", &info), 0);
    assert_true(S_ISCHR(info.st_mode));
    assert_int_equal(put_text("real", "old"), HW_OK);
    assert_int_equal(chmod("real", 0640), 0);
    assert_int_equal(symlink("real", "link"), 0);
    assert_int_equal(put_text("link", "new"), HW_OK);
    assert_content("real", "new");
    assert_int_equal(lstat("link", &info), 0);
    assert_true(S_ISLNK(info.st_mode));
    assert_int_equal(stat("real", &info), 0);
    assert_int_equal(info.st_mode & 0777, 0640);
}

// What a program that writes to /dev/stdout has printed into the same file stays.
static void redirected_output_is_not_replaced(void **state)
{
    (void)state;
    static const char *const names[] = {"/dev/stdout", "out", "./out"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        fflush(stdout);
        int fd = open("out", O_WRONLY | O_CREAT | O_TRUNC, 0600), saved = dup(STDOUT_FILENO);
        assert_true(fd >= 0 && saved >= 0);
        dup2(fd, STDOUT_FILENO);
        printf("before ");
        hw_status status = put_text(names[i], "text");
        printf(" after");
        fflush(stdout);
        dup2(saved, STDOUT_FILENO);
        close(saved);
        close(fd);
        assert_int_equal(status, HW_OK);
        assert_content("out", "before text after");
        assert_int_equal(entries("."), 1);
    }
    assert_int_equal(put_text("out", "replaced"), HW_OK);
    assert_content("out", "replaced");
}

static void leftovers_are_cleaned(void **state)
{
    (void)state;
    hw_writer *w = NULL;
    FILE *file = fopen("cell.hxc.12345.0.tmp", "w");
    assert_non_null(file);
    fclose(file);
    assert_int_equal(put_text("kept", "kept"), HW_OK);
    assert_int_equal(put_text("tmp", "kept"), HW_OK);
    assert_int_equal(put_text("mine.tmp", "kept"), HW_OK); // not of ours
    assert_int_equal(put_text("7.tmp", "kept"), HW_OK);
    assert_int_equal(mkdir("folder.tmp", 0700), 0);
    assert_int_equal(hw_dir_clean_temporary("."), HW_OK);
    assert_false(hw_path_exists("cell.hxc.12345.0.tmp"));
    assert_true(hw_path_exists("kept") && hw_path_exists("tmp") && hw_path_exists("folder.tmp"));
    assert_true(hw_path_exists("mine.tmp") && hw_path_exists("7.tmp"));
    assert_true(remove("mine.tmp") == 0 && remove("7.tmp") == 0);
    assert_int_equal(hw_dir_clean_temporary("absent"), HW_OK);
    assert_int_equal(hw_dir_clean_temporary("kept"), HW_IO);
    // A live writer's file stays, and its work comes to its end.
    assert_int_equal(hw_writer_open(&w, "alive"), HW_OK);
    assert_int_equal(hw_dir_clean_temporary("."), HW_OK);
    assert_int_equal(hw_writer_put(w, "text", 4), HW_OK);
    assert_int_equal(hw_writer_commit(w), HW_OK);
    assert_content("alive", "text");
}

// What a writer killed between any two steps leaves is found by the cleaner's pattern.
static void writers_use_names_that_the_cleaner_knows(void **state)
{
    (void)state;
    hw_writer *w = NULL;
    uint32_t temporary = 0;
    assert_int_equal(hw_writer_open(&w, "cell"), HW_OK);
    DIR *dir = opendir(".");
    assert_non_null(dir);
    for (struct dirent *e; (e = readdir(dir));) {
        size_t length = strlen(e->d_name);
        temporary += length > 4 && !strcmp(e->d_name + length - 4, ".tmp");
    }
    closedir(dir);
    assert_int_equal(temporary, 1);
    hw_writer_abort(w);
}

static void folders_are_made(void **state)
{
    (void)state;
    assert_int_equal(hw_dir_make("a/b//c/"), HW_OK);
    assert_int_equal(hw_dir_make("a/b/c"), HW_OK);
    assert_int_equal(hw_dir_make("/"), HW_OK);
    assert_int_equal(entries("a/b"), 1);
    assert_int_equal(put_text("a/file", "text"), HW_OK);
    assert_int_equal(hw_dir_make("a/file"), HW_IO);
    assert_error_has("a/file: ", "not a folder");
    assert_int_equal(hw_dir_make("a/file/x"), HW_IO);
    assert_int_equal(hw_dir_make(""), HW_IO);
    assert_int_equal(hw_dir_make("/proc/x"), HW_IO);
}

static void assert_join(const char *dir, const char *name, const char *expected)
{
    char *joined = NULL;
    assert_int_equal(hw_path_join(&joined, dir, name), HW_OK);
    assert_string_equal(joined, expected);
    hw_free(joined);
}

static void assert_dir(const char *path, const char *expected)
{
    char *dir = NULL;
    assert_int_equal(hw_path_dir(&dir, path), HW_OK);
    assert_string_equal(dir, expected);
    hw_free(dir);
}

static void paths(void **state)
{
    (void)state;
    assert_join("a", "b", "a/b");
    assert_join("a/", "b", "a/b");
    assert_join("/", "b", "/b");
    assert_join("a", "/b", "/b");
    assert_join("", "b", "b");
    assert_dir("a/b", "a");
    assert_dir("a//b/", "a");
    assert_dir("a/b/c.x", "a/b");
    assert_dir("file", ".");
    assert_dir("", ".");
    assert_dir("/", "/");
    assert_dir("/file", "/");
    assert_dir("//file", "/");
}

#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, enter, leave)

int main(void)
{
    const struct CMUnitTest tests[] = {
        IN_FOLDER(what_is_written_is_read),
        IN_FOLDER(bad_inputs_are_named),
        IN_FOLDER(ranges_are_read_and_checked),
        IN_FOLDER(streams_are_written_whole),
        IN_FOLDER(an_aborted_write_leaves_nothing),
        IN_FOLDER(every_failing_step_keeps_a_whole_file),
        IN_FOLDER(every_failing_allocation_keeps_the_old_file),
        IN_FOLDER(failing_reads_are_told),
        IN_FOLDER(a_full_disk_keeps_the_old_file),
        IN_FOLDER(unwritable_outputs_are_named),
        IN_FOLDER(devices_and_links_stay),
        IN_FOLDER(redirected_output_is_not_replaced),
        IN_FOLDER(leftovers_are_cleaned),
        IN_FOLDER(writers_use_names_that_the_cleaner_knows),
        IN_FOLDER(folders_are_made),
        IN_FOLDER(paths),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
