#include "alloc.h"
#include "file.h"
#include "log.h"
#include "parallel.h"
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static char path[32];
static int saved;

// Standard error goes to a file until `captured` is called.
static void capture(void)
{
    snprintf(path, sizeof path, "log.XXXXXX");
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    fflush(stderr);
    saved = dup(STDERR_FILENO);
    assert_true(dup2(fd, STDERR_FILENO) >= 0);
    close(fd);
}

// The text since `capture`; free it.
static char *captured(void)
{
    uint8_t *data = NULL;
    size_t size;
    fflush(stderr);
    dup2(saved, STDERR_FILENO);
    close(saved);
    assert_int_equal(hw_file_read(path, 0, &data, &size), HW_OK);
    unlink(path);
    return (char *)data;
}

static hw_status work(void *context, uint64_t index, uint32_t thread)
{
    (void)thread;
    hw_progress_add(context, 1);
    hw_log_warning("line %llu", (unsigned long long)index);
    return HW_OK;
}

static void lines_are_written_whole(void **state)
{
    (void)state;
    hw_progress *progress = NULL;
    capture();
    assert_int_equal(hw_progress_create(&progress, "cells", 500), HW_OK);
    assert_int_equal(hw_parallel_for(500, 4, work, progress, NULL), HW_OK);
    hw_log_warning("careful");
    hw_progress_destroy(progress);
    hw_progress_destroy(NULL);
    char *text = captured();
    char line[64];
    for (int i = 0; i < 500; i++) {
        snprintf(line, sizeof line, "hexwalk: warning: line %d\n", i);
        assert_non_null(strstr(text, line));
    }
    assert_non_null(strstr(text, "hexwalk: warning: careful\n"));
    // Every addition arrived, and no bar or escape goes to what is no terminal.
    assert_non_null(strstr(text, "hexwalk: cells: 500 of 500 in 0:0"));
    assert_null(strchr(text, '\033'));
    uint32_t lines = 0;
    for (const char *p = text; *p; p++)
        lines += *p == '\n';
    assert_int_equal(lines, 502);
    hw_free(text);
}

// What needs not be done leaves the total.
static void skipped_work_does_not_count(void **state)
{
    (void)state;
    hw_progress *progress = NULL;
    capture();
    assert_int_equal(hw_progress_create(&progress, "cells", 500), HW_OK);
    hw_progress_skip(progress, 480);
    hw_progress_add(progress, 20);
    hw_progress_destroy(progress);
    char *text = captured();
    assert_non_null(strstr(text, "hexwalk: cells: 20 of 20 in 0:0"));
    hw_free(text);
}

static void quiet_writes_nothing(void **state)
{
    (void)state;
    hw_progress *progress = NULL;
    capture();
    hw_log_set_quiet(true);
    assert_true(hw_log_quiet());
    assert_int_equal(hw_progress_create(&progress, "cells", 0), HW_OK);
    hw_progress_add(progress, 3);
    hw_log_warning("nothing");
    hw_progress_destroy(progress);
    hw_log_set_quiet(false);
    char *text = captured();
    assert_string_equal(text, "");
    hw_free(text);
}

// On a terminal the bar is redrawn in its line, and a log line does not break it.
static void terminals_get_a_bar(void **state)
{
    (void)state;
    char text[4096] = "";
    hw_progress *progress = NULL;
    int master = posix_openpt(O_RDWR | O_NOCTTY);
    if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0)
        skip();
    int terminal = open(ptsname(master), O_RDWR | O_NOCTTY);
    assert_true(terminal >= 0);
    saved = dup(STDERR_FILENO);
    dup2(terminal, STDERR_FILENO);
    assert_int_equal(hw_progress_create(&progress, "cells", 4), HW_OK);
    usleep(150000); // beyond the least time between two drawings
    hw_progress_add(progress, 2);
    hw_log_warning("a line");
    hw_progress_destroy(progress);
    fflush(stderr);
    dup2(saved, STDERR_FILENO);
    close(saved);
    close(terminal);
    // A pseudo-terminal hands over what was written in pieces; with the other end closed the last
    // is followed by an error.
    size_t size = 0;
    for (ssize_t n; size < sizeof text - 1; size += (size_t)n)
        if ((n = read(master, text + size, sizeof text - 1 - size)) <= 0)
            break;
    close(master);
    assert_non_null(strstr(text, "cells [###############...............]  50 %  ETA 0:00"));
    assert_non_null(strstr(text, "\r\033[Khexwalk: warning: a line\r\n\r\033[Kcells ["));
    assert_non_null(strstr(text, "\r\033[Khexwalk: cells: 2 of 4 in 0:00\r\n"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_are_written_whole),
        cmocka_unit_test(skipped_work_does_not_count),
        cmocka_unit_test(quiet_writes_nothing),
        cmocka_unit_test(terminals_get_a_bar),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
