#include "plot.h"
#include "alloc.h"
#include "bytes.h"
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

#define WIDTH  860
#define HEIGHT 290

// ---- The script. Series are drawn in made-up colours, rgb(i + 1, 0, 0), which the finished SVG
// exchanges for the page's.

static bool is_drawn(const hw_plot *plot, double y)
{
    return isfinite(y) && (!plot->log_y || y > 0);
}

static bool has_points(const hw_plot *plot, const hw_plot_series *series)
{
    for (uint32_t i = 0; i < plot->count; i++)
        if (is_drawn(plot, series->y[(size_t)i * series->stride]))
            return true;
    return false;
}

static void put_data(hw_bytes_writer *w, const hw_plot *plot, const hw_plot_series *series)
{
    for (uint32_t i = 0; i < plot->count; i++) {
        double y = series->y[(size_t)i * series->stride];
        if (is_drawn(plot, y))
            hw_put_format(w, "%.9g %.9g\n", plot->x[i], y);
        else
            hw_put_format(w, "\n");
    }
}

static void put_axes(hw_bytes_writer *w, const hw_plot *plot)
{
    double first = plot->x[0], last = plot->x[plot->count - 1];
    double room = last > first ? 0 : 1;
    hw_put_format(w, "set terminal svg size %d,%d dynamic font 'sans-serif,14' noenhanced\n", WIDTH,
                  HEIGHT);
    hw_put_format(w, "set border 3 lw 0.7\nset tics nomirror scale 0.6\nset mytics 1\n");
    hw_put_format(w, "set grid ytics lt 1 lc rgb '#000100' lw 0.7\n");
    hw_put_format(w, "set key above horizontal right Left reverse samplen 1.6\n");
    hw_put_format(w, "set xlabel '%s'\nset ylabel '%s' offset 0.5,0\n", plot->x_label,
                  plot->y_label);
    hw_put_format(w, "set xrange [%.9g:%.9g]\n", first - room, last + room);
    if (plot->log_y)
        hw_put_format(w, "set logscale y\nset format y '%%.0s %%c'\n"); // powers of ten
    for (uint32_t i = 0; i < plot->mark_count; i++)
        if (plot->marks[i] > first && plot->marks[i] < last)
            hw_put_format(
                w,
                "set arrow from %.9g, graph 0 to %.9g, graph 1 nohead back lc rgb '#000200' lw "
                "0.7\n",
                plot->marks[i], plot->marks[i]);
}

static void put_script(hw_bytes_writer *w, const hw_plot *plot)
{
    const char *separator = "plot";
    put_axes(w, plot);
    for (uint32_t i = 0; i < plot->series_count; i++) {
        hw_put_format(w, "$d%u << END_OF_DATA\n", i);
        put_data(w, plot, &plot->series[i]);
        hw_put_format(w, "END_OF_DATA\n");
    }
    for (uint32_t i = 0; i < plot->series_count; i++) {
        if (!has_points(plot, &plot->series[i]))
            continue;
        hw_put_format(w, "%s $d%u using 1:2 with %s lw 1.8 lc rgb '#%02x0000' title '%s'",
                      separator, i, plot->count > 1 ? "lines" : "points pt 5", i + 1,
                      plot->series[i].name);
        separator = ",";
    }
    hw_put_format(w, "\n");
}

// ---- The process

// A file without a name: gone when closed.
static hw_status open_scratch(int *out)
{
    const char *folder = getenv("TMPDIR");
    char path[512];
    snprintf(path, sizeof path, "%s/hexwalk-plot-XXXXXX", folder && *folder ? folder : "/tmp");
    *out = mkostemp(path, O_CLOEXEC);
    if (*out < 0)
        return hw_fail(HW_IO, "%s: %s", path, strerror(errno));
    unlink(path);
    return HW_OK;
}

static hw_status write_all(int file, const uint8_t *data, size_t size)
{
    for (size_t done = 0; done < size;) {
        ssize_t n = write(file, data + done, size - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return hw_fail(HW_IO, "temporary file: %s", strerror(errno));
        done += (size_t)n;
    }
    if (lseek(file, 0, SEEK_SET) < 0)
        return hw_fail(HW_IO, "temporary file: %s", strerror(errno));
    return HW_OK;
}

// The whole file as a string.
static hw_status read_all(int file, char **out)
{
    off_t size = lseek(file, 0, SEEK_END);
    if (size < 0)
        return hw_fail(HW_IO, "temporary file: %s", strerror(errno));
    HW_TRY(HW_NEW(out, (size_t)size + 1));
    for (off_t done = 0; done < size;) {
        ssize_t n = pread(file, *out + done, (size_t)(size - done), done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0) {
            hw_free(*out);
            *out = NULL;
            return hw_fail(HW_IO, "temporary file: %s", n < 0 ? strerror(errno) : "truncated");
        }
        done += n;
    }
    return HW_OK;
}

static hw_status run_gnuplot(const int files[3])
{
    char name[] = "gnuplot";
    char *const arguments[] = {name, NULL};
    posix_spawn_file_actions_t actions;
    pid_t child;
    int wait_status = 0;
    if (posix_spawn_file_actions_init(&actions) != 0)
        return hw_fail(HW_MEMORY, "gnuplot: out of memory");
    int error = 0;
    for (int i = 0; i < 3 && !error; i++)
        error = posix_spawn_file_actions_adddup2(&actions, files[i], i);
    if (!error)
        error = posix_spawnp(&child, name, &actions, NULL, arguments, environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error == ENOENT)
        return hw_fail(HW_NOT_FOUND, "gnuplot is not installed");
    if (error)
        return hw_fail(HW_IO, "gnuplot: %s", strerror(error));
    while (waitpid(child, &wait_status, 0) < 0)
        if (errno != EINTR)
            return hw_fail(HW_IO, "gnuplot: %s", strerror(errno));
    if (!WIFEXITED(wait_status) || WEXITSTATUS(wait_status) != 0)
        return hw_fail(HW_IO, "gnuplot failed");
    return HW_OK;
}

// ---- What comes out, made fit for a page

typedef struct exchange {
    const char *from, *to;
} exchange;

static void replace(hw_bytes_writer *w, const char *text, const exchange *list, size_t count)
{
    while (*text) {
        size_t i = 0;
        while (i < count && strncmp(text, list[i].from, strlen(list[i].from)) != 0)
            i++;
        if (i == count) {
            hw_put_u8(w, (uint8_t)*text++);
            continue;
        }
        hw_put_bytes(w, list[i].to, strlen(list[i].to));
        text += strlen(list[i].from);
    }
}

// Blanks out every element of this name (in place): definitions of point symbols and titles, which
// would show up as tooltips.
static void blank_elements(char *text, const char *name)
{
    char open[24], close[24];
    snprintf(open, sizeof open, "<%s>", name);
    snprintf(close, sizeof close, "</%s>", name);
    for (char *from = strstr(text, open); from; from = strstr(from, open)) {
        char *to = strstr(from, close);
        if (!to)
            return;
        memset(from, ' ', (size_t)(to - from) + strlen(close));
    }
}

static hw_status finish_svg(const hw_plot *plot, char *raw, char **svg)
{
    char froms[HW_PLOT_SERIES][40], tos[HW_PLOT_SERIES][80];
    exchange list[HW_PLOT_SERIES + 6] = {
        {"\"black\"", "\"currentColor\""},
        {"'black'", "'currentColor'"},
        {"id=\"gnuplot_canvas\"", ""},
        {" font-family=\"sans-serif\"", ""},
        {"stroke='rgb(  0,   1,   0)'", "style='stroke:var(--grid)'"},
        {"stroke='rgb(  0,   2,   0)'", "style='stroke:var(--mark)'"},
    };
    for (uint32_t i = 0; i < plot->series_count; i++) {
        snprintf(froms[i], sizeof froms[i], "stroke='rgb(%3u,   0,   0)'", i + 1);
        snprintf(tos[i], sizeof tos[i], "style='stroke:%s'", plot->series[i].css_color);
        list[6 + i] = (exchange){froms[i], tos[i]};
    }
    char *start = strstr(raw, "<svg");
    if (!start || !strstr(start, "</svg>"))
        return hw_fail(HW_IO, "gnuplot wrote no SVG");
    const char *unwanted[] = {"title", "desc", "defs"};
    for (int i = 0; i < 3; i++)
        blank_elements(start, unwanted[i]);
    hw_bytes_writer w = {0};
    replace(&w, start, list, 6 + plot->series_count);
    hw_put_u8(&w, 0);
    hw_status status = hw_bytes_writer_check(&w);
    if (status == HW_OK)
        status = hw_strdup(svg, (const char *)w.data);
    hw_bytes_writer_free(&w);
    return status;
}

// "gnuplot failed" with the first line that it wrote itself.
static hw_status fail_with_words(hw_status status, int errors)
{
    char *words = NULL, message[HW_ERROR_CAPACITY];
    snprintf(message, sizeof message, "%s", hw_error_text());
    if (read_all(errors, &words) != HW_OK)
        return hw_fail(status, "%s", message);
    const char *line = words + strspn(words, " \t\r\n");
    status =
        hw_fail(status, "%s%s%.*s", message, *line ? ": " : "", (int)strcspn(line, "\r\n"), line);
    hw_free(words);
    return status;
}

static bool has_any_point(const hw_plot *plot)
{
    for (uint32_t i = 0; i < plot->series_count; i++)
        if (has_points(plot, &plot->series[i]))
            return true;
    return false;
}

hw_status hw_plot_svg(const hw_plot *plot, char **svg)
{
    int files[3] = {-1, -1, -1};
    hw_bytes_writer script = {0};
    char *raw = NULL;
    hw_status status = HW_OK;
    *svg = NULL;
    if (!has_any_point(plot))
        return hw_fail(HW_NOT_FOUND, "nothing to plot");
    put_script(&script, plot);
    HW_GO(hw_bytes_writer_check(&script));
    for (int i = 0; i < 3; i++)
        HW_GO(open_scratch(&files[i]));
    HW_GO(write_all(files[0], script.data, script.size));
    status = run_gnuplot(files);
    if (status != HW_OK) {
        status = fail_with_words(status, files[2]);
        goto out;
    }
    HW_GO(read_all(files[1], &raw));
    HW_GO(finish_svg(plot, raw, svg));
out:
    for (int i = 0; i < 3; i++)
        if (files[i] >= 0)
            close(files[i]);
    hw_free(raw);
    hw_bytes_writer_free(&script);
    return status;
}
