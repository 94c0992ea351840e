// Files by way of a source: from a folder, and from a web server that misbehaves.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "fixtures.h"
#include "source.h"
#include "web.h"

#include <stdatomic.h>
#include <sys/resource.h>
#include <sys/wait.h>

#define FOLDER "source-files"
#define SIZE   200000u

static uint8_t content[SIZE];

static int open_folder(void **state)
{
    (void)state;
    for (uint32_t i = 0; i < SIZE; i++)
        content[i] = (uint8_t)(i * 7 + i / 256);
    must(hw_dir_make(FOLDER "/cells"));
    must(hw_file_write(FOLDER "/cells/a.hxc", content, SIZE));
    must(hw_file_write(FOLDER "/empty", content, 0));
    return 0;
}

static int close_folder(void **state)
{
    (void)state;
    unlink(FOLDER "/cells/a.hxc");
    unlink(FOLDER "/empty");
    rmdir(FOLDER "/cells");
    return rmdir(FOLDER);
}

static hw_source *open_source(const char *location)
{
    const hw_source_desc desc = {
        .location = location, .wait_ms = 1, .wait_max_ms = 2, .retries = 2};
    hw_source *source = NULL;
    must(hw_source_open(&source, &desc));
    return source;
}

static void check_read(hw_source *source, uint64_t offset, uint64_t size, size_t wanted)
{
    hw_block block;
    hw_status status = hw_source_read(source, "cells/a.hxc", offset, size, &block);
    if (status != HW_OK)
        fail_msg("%s", hw_error_text());
    assert_int_equal(block.size, wanted);
    assert_int_equal(block.file_bytes, SIZE);
    assert_memory_equal(block.data, content + offset, wanted);
    assert_int_equal(block.data[wanted], 0);
    hw_free(block.data);
}

static void check_fails(hw_source *source, const char *name, uint64_t offset, uint64_t size,
                        hw_status wanted)
{
    hw_block block;
    assert_int_equal(hw_source_read(source, name, offset, size, &block), wanted);
    assert_null(block.data);
    if (!strstr(hw_error_text(), name))
        fail_msg("\"%s\" does not name %s", hw_error_text(), name);
}

// What every backend can do.
static void check_all_reads(hw_source *source)
{
    hw_block block;
    check_read(source, 0, 0, SIZE);
    check_read(source, 0, 4096, 4096);
    check_read(source, 1234, 77777, 77777);
    check_read(source, SIZE - 10, 10, 10);
    check_read(source, SIZE - 10, 4096, 10);
    check_read(source, 0, SIZE + 1, SIZE);
    check_fails(source, "cells/a.hxc", SIZE + 5, 10, HW_FORMAT);
    check_fails(source, "cells/b.hxc", 0, 0, HW_NOT_FOUND);
    must(hw_source_read(source, "empty", 0, 0, &block));
    assert_int_equal(block.size, 0);
    hw_free(block.data);
}

static void test_folder(void **state)
{
    (void)state;
    hw_source *source = open_source(FOLDER "/");
    assert_string_equal(hw_source_location(source), FOLDER);
    check_all_reads(source);
    hw_source_stats stats = hw_source_get_stats(source);
    assert_int_equal(stats.bytes, 2 * SIZE + 4096 + 77777 + 20);
    assert_int_equal(stats.requests, 9);
    assert_int_equal(stats.errors, 2);
    assert_int_equal(stats.retries, 0);
    hw_source_close(source);
}

static void test_unknown_scheme(void **state)
{
    (void)state;
    const hw_source_desc desc = {.location = "ftp://127.0.0.1/x"};
    hw_source *source = NULL;
    assert_int_equal(hw_source_open(&source, &desc), HW_USAGE);
    assert_null(source);
}

// Several at once, finished in another order than started, some of them cancelled.
static void check_many(hw_source *source)
{
    enum { COUNT = 40 };
    hw_request *requests[COUNT];
    for (uint32_t i = 0; i < COUNT; i++)
        must(hw_source_start(source, "cells/a.hxc", i * 100, 100 + i, &requests[i]));
    for (uint32_t i = 0; i < COUNT; i += 3)
        hw_request_cancel(requests[i]);
    for (uint32_t i = COUNT; i-- > 0;) {
        hw_block block;
        if (i % 3 == 0)
            continue;
        must(hw_request_finish(requests[i], &block));
        assert_int_equal(block.size, 100 + i);
        assert_memory_equal(block.data, content + i * 100, block.size);
        hw_free(block.data);
    }
    hw_request_cancel(NULL);
}

static void test_many(void **state)
{
    (void)state;
    for (uint32_t threads = 1; threads <= 4; threads++) {
        const hw_source_desc desc = {.location = FOLDER, .threads = threads};
        hw_source *source = NULL;
        must(hw_source_open(&source, &desc));
        check_many(source);
        hw_source_close(source);
    }
}

static void count_end(void *context)
{
    atomic_fetch_add((atomic_int *)context, 1);
}

static void test_notify(void **state)
{
    (void)state;
    atomic_int ends = 0;
    const hw_source_desc desc = {.location = FOLDER, .notify = count_end, .notify_context = &ends};
    hw_source *source = NULL;
    must(hw_source_open(&source, &desc));
    check_read(source, 0, 0, SIZE);
    check_fails(source, "cells/b.hxc", 0, 0, HW_NOT_FOUND);
    hw_source_close(source);
    assert_int_equal(ends, 2);
}

// ---- bandwidth by a simulated clock ----

typedef struct simulated {
    double now_s;
} simulated;

static double simulated_now(void *context)
{
    return ((simulated *)context)->now_s;
}

static void simulated_sleep(void *context, double seconds)
{
    ((simulated *)context)->now_s += seconds;
}

static void test_bandwidth(void **state)
{
    (void)state;
    simulated time = {1000};
    const hw_source_clock clock = {simulated_now, simulated_sleep, &time};
    const hw_source_desc desc = {.location = FOLDER, .bytes_per_second = 10000, .clock = &clock};
    hw_source *source = NULL;
    must(hw_source_open(&source, &desc));
    check_read(source, 0, 0, SIZE);
    double seconds = time.now_s - 1000;
    assert_true(seconds > SIZE / 10000.0 - 0.06 && seconds <= SIZE / 10000.0 + 1e-6);
    hw_source_close(source);
}

// A cancelled read lets go of a source that would take hours.
static void test_cancel_slow(void **state)
{
    (void)state;
    const hw_source_desc desc = {.location = FOLDER, .bytes_per_second = 10};
    hw_source *source = NULL;
    hw_request *first, *second;
    must(hw_source_open(&source, &desc));
    must(hw_source_start(source, "cells/a.hxc", 0, 0, &first));
    must(hw_source_start(source, "cells/a.hxc", 0, 0, &second));
    while (hw_source_get_stats(source).bytes == 0)
        usleep(1000);
    assert_false(hw_request_done(first));
    hw_request_cancel(first);
    hw_request_cancel(second);
    hw_source_close(source);
}

// ---- a web server ----

// Without file descriptors no library can be loaded. In a process of its own, before any other has
// loaded it.
static void test_no_curl(void **state)
{
    (void)state;
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        const struct rlimit none = {0, 0};
        bool named = true;
        setrlimit(RLIMIT_NOFILE, &none); // first: threads load it as soon as they start
        hw_source *source = open_source("http://127.0.0.1:1");
        for (int i = 0; i < 2; i++) {
            hw_block block;
            hw_status status = hw_source_read(source, "a.hxc", 0, 0, &block);
            const char *text = hw_error_text(), *path = "http://127.0.0.1:1/a.hxc: web servers";
            named = named && status == HW_IO && strncmp(text, path, strlen(path)) == 0 &&
                    strstr(text, "libcurl.so.4: cannot open");
        }
        _exit(named ? 0 : 1);
    }
    int result = 0;
    assert_int_equal(waitpid(child, &result, 0), child);
    assert_int_equal(result, 0);
}

static void test_web(void **state)
{
    (void)state;
    web w;
    web_open(&w, FOLDER);
    hw_source *source = open_source(w.location);
    check_all_reads(source);
    check_many(source);
    hw_source_close(source);
    web_close(&w);
}

// A fault that comes once is mended by another attempt; one that stays is an error that names the
// file, after as many attempts as were allowed.
static void test_web_faults(void **state)
{
    (void)state;
    static const web_fault passing[] = {WEB_HANG_UP, WEB_BUSY, WEB_CUT, WEB_LONG};
    web w;
    web_open(&w, FOLDER);
    hw_source *source = open_source(w.location);
    for (size_t i = 0; i < sizeof passing / sizeof *passing; i++) {
        web_misbehave(&w, passing[i], 1);
        check_read(source, 0, 0, SIZE);
        assert_int_equal(w.requests, 2);
        web_misbehave(&w, passing[i], -1);
        check_fails(source, "cells/a.hxc", 0, 0, HW_IO);
        assert_int_equal(w.requests, 3);
        web_misbehave(&w, passing[i], 2);
        check_read(source, 50000, 1000, 1000);
        assert_int_equal(w.requests, 3);
    }
    // A body that is too short for the range it claims to be.
    web_misbehave(&w, WEB_SHORT, 1);
    check_read(source, 50000, 1000, 1000);
    assert_int_equal(w.requests, 2);
    web_misbehave(&w, WEB_GONE, -1);
    check_fails(source, "cells/a.hxc", 0, 0, HW_NOT_FOUND);
    assert_int_equal(w.requests, 1);
    web_misbehave(&w, WEB_GONE_CUT, -1);
    check_fails(source, "cells/a.hxc", 0, 0, HW_NOT_FOUND);
    assert_int_equal(w.requests, 1);
    web_misbehave(&w, WEB_RANGE, -1);
    check_fails(source, "cells/a.hxc", 50000, 1000, HW_IO);
    web_misbehave(&w, WEB_NO_RANGE, -1);
    check_read(source, 50000, 1000, 1000);
    check_read(source, SIZE - 5, 1000, 5);
    web_misbehave(&w, WEB_NO_LENGTH, -1);
    check_read(source, 0, 0, SIZE);
    assert_true(hw_source_get_stats(source).retries > 0);
    hw_source_close(source);
    web_close(&w);
}

// Nobody waits for the end of a body that goes on behind what is wanted.
static void test_web_endless(void **state)
{
    (void)state;
    web w;
    hw_block block;
    web_open(&w, FOLDER);
    hw_source *source = open_source(w.location);
    web_misbehave(&w, WEB_HUGE, -1);
    must(hw_source_read(source, "cells/a.hxc", 50000, 1000, &block));
    assert_int_equal(block.size, 1000);
    assert_true(block.file_bytes == WEB_HUGE_BYTES);
    assert_memory_equal(block.data, content + 50000, 1000);
    hw_free(block.data);
    check_fails(source, "cells/a.hxc", WEB_HUGE_BYTES / 2, 1000, HW_LIMIT);
    check_fails(source, "cells/a.hxc", 0, 0, HW_LIMIT);
    web_misbehave(&w, WEB_ENDLESS, -1);
    check_fails(source, "cells/a.hxc", 50000, 1000, HW_LIMIT);
    assert_int_equal(hw_source_get_stats(source).retries, 0);
    hw_source_close(source);
    web_close(&w);
}

static void test_web_stall(void **state)
{
    (void)state;
    web w;
    web_open(&w, FOLDER);
    const hw_source_desc desc = {
        .location = w.location, .timeout_ms = 300, .retries = 1, .wait_ms = 1};
    hw_source *source = NULL;
    must(hw_source_open(&source, &desc));
    web_misbehave(&w, WEB_SLOW, -1);
    check_fails(source, "cells/a.hxc", 0, 0, HW_IO);
    assert_int_equal(w.requests, 2);
    hw_source_close(source);
    web_close(&w);
}

static void test_web_refused(void **state)
{
    (void)state;
    web w;
    web_open(&w, FOLDER);
    char location[64];
    snprintf(location, sizeof location, "%s", w.location);
    web_close(&w); // nobody listens there any more
    hw_source *source = open_source(location);
    check_fails(source, "cells/a.hxc", 0, 0, HW_IO);
    assert_int_equal(hw_source_get_stats(source).retries, 2);
    hw_source_close(source);
}

static void test_cancel_web(void **state)
{
    (void)state;
    web w;
    web_open(&w, FOLDER);
    hw_source *source = open_source(w.location);
    hw_request *request;
    web_misbehave(&w, WEB_SLOW, -1);
    must(hw_source_start(source, "cells/a.hxc", 0, 0, &request));
    while (hw_source_get_stats(source).bytes == 0)
        usleep(1000);
    hw_request_cancel(request);
    hw_source_close(source);
    web_close(&w);
}

// ---- a dataset's files ----

static void test_manifest(void **state)
{
    (void)state;
    web w;
    hw_manifest manifest, got = {0};
    fixture_manifest(&manifest, 3, 4);
    must(hw_manifest_write(FOLDER, &manifest));
    web_open(&w, FOLDER);
    for (int i = 0; i < 2; i++) {
        hw_status status = hw_manifest_open(i ? w.location : FOLDER, &got);
        if (status != HW_OK)
            fail_msg("%s", hw_error_text());
        assert_int_equal(got.object_count, manifest.object_count);
        assert_int_equal(got.cell_count, manifest.cell_count);
        assert_true(got.build_seconds == manifest.build_seconds);
        hw_manifest_free(&got);
    }
    hw_source *source = open_source(w.location);
    web_misbehave(&w, WEB_CUT, 1);
    must(hw_manifest_fetch(source, &got));
    hw_manifest_free(&got);
    web_misbehave(&w, WEB_SHORT, -1);
    assert_int_equal(hw_manifest_fetch(source, &got), HW_FORMAT);
    assert_non_null(strstr(hw_error_text(), "manifest.json"));
    hw_source_close(source);
    web_close(&w);
    hw_manifest_free(&manifest);
    unlink(FOLDER "/manifest.json");
    unlink(FOLDER "/build.json");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_folder),     cmocka_unit_test(test_unknown_scheme),
        cmocka_unit_test(test_many),       cmocka_unit_test(test_notify),
        cmocka_unit_test(test_bandwidth),  cmocka_unit_test(test_cancel_slow),
        cmocka_unit_test(test_no_curl),    cmocka_unit_test(test_web),
        cmocka_unit_test(test_web_faults), cmocka_unit_test(test_web_endless),
        cmocka_unit_test(test_web_stall),  cmocka_unit_test(test_web_refused),
        cmocka_unit_test(test_cancel_web), cmocka_unit_test(test_manifest),
    };
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
