#include "video.h"
#include "alloc.h"
#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#define WAIT_MS 200 // between looks at the flag that stops it

extern char **environ;

struct hw_video {
    uint32_t width, height;
    char *path, *temporary;
    char *output; // the temporary file as ffmpeg's argument
    pid_t ffmpeg; // 0: not running
    int pipe;     // its standard input; -1: closed
    const volatile sig_atomic_t *stop;
    struct sigaction old_sigpipe;
    bool ignores_sigpipe;
};

static const struct {
    const char *ending, *format; // ffmpeg's name for it
} kinds[] = {{".mp4", "mp4"}, {".mkv", "matroska"}, {".mov", "mov"}, {".webm", "webm"}};

static const char *format_of(const char *path)
{
    size_t length = strlen(path);
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        size_t ending = strlen(kinds[i].ending);
        if (length > ending && strcmp(path + length - ending, kinds[i].ending) == 0)
            return kinds[i].format;
    }
    return NULL;
}

bool hw_video_name_ok(const char *path)
{
    return format_of(path) != NULL;
}

// ---- The other program

static hw_status spawn(hw_video *v, char *const *arguments, int input)
{
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    sigset_t defaults;
    sigemptyset(&defaults);
    sigaddset(&defaults, SIGPIPE);
    if (posix_spawn_file_actions_init(&actions) != 0)
        return hw_fail(HW_MEMORY, "out of memory");
    if (posix_spawnattr_init(&attributes) != 0) {
        posix_spawn_file_actions_destroy(&actions);
        return hw_fail(HW_MEMORY, "out of memory");
    }
    int error = posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
    if (!error)
        error = posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    // A process group of its own: Ctrl-C is for us, who then stop it.
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
    posix_spawnattr_setsigdefault(&attributes, &defaults);
    posix_spawnattr_setpgroup(&attributes, 0);
    if (!error)
        error = posix_spawnp(&v->ffmpeg, arguments[0], &actions, &attributes, arguments, environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    if (!error)
        return HW_OK;
    v->ffmpeg = 0;
    if (error == ENOENT)
        return hw_fail(HW_NOT_FOUND, "a video needs the program ffmpeg, which is not installed");
    return hw_fail(HW_IO, "ffmpeg: cannot start: %s", strerror(error));
}

static hw_status start(hw_video *v, double fps)
{
    char size[32], rate[32];
    int ends[2];
    snprintf(size, sizeof size, "%ux%u", v->width, v->height);
    snprintf(rate, sizeof rate, "%.9g", fps);
    const char *const words[] = {"ffmpeg", "-nostdin", "-loglevel", "error", "-y",
                                 // what comes through the pipe
                                 "-f", "rawvideo", "-pixel_format", "rgb0", "-video_size", size,
                                 "-framerate", rate, "-i", "pipe:0",
                                 // what players take: even sides, four pixels to a colour
                                 "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p",
                                 "-f", format_of(v->path), v->output};
    enum { COUNT = sizeof words / sizeof *words };
    char *arguments[COUNT + 1] = {NULL};
    for (int i = 0; i < COUNT; i++)
        memcpy(&arguments[i], &words[i], sizeof words[i]); // posix_spawn takes them without const
    if (pipe2(ends, O_CLOEXEC) != 0)
        return hw_fail(HW_IO, "no pipe to ffmpeg: %s", strerror(errno));
    hw_status status = spawn(v, arguments, ends[0]);
    close(ends[0]);
    v->pipe = ends[1];
    // So that waiting for ffmpeg can be interrupted.
    (void)fcntl(v->pipe, F_SETFL, O_NONBLOCK);
    return status;
}

static void close_pipe(hw_video *v)
{
    if (v->pipe >= 0)
        close(v->pipe);
    v->pipe = -1;
}

static hw_status interrupted(const hw_video *v)
{
    return hw_fail(HW_INTERRUPTED, "%s: interrupted", v->path);
}

// Its exit status as of waitpid.
static hw_status wait_for_end(hw_video *v, int *state)
{
    while (waitpid(v->ffmpeg, state, 0) < 0 && errno == EINTR)
        if (*v->stop)
            return interrupted(v);
    v->ffmpeg = 0;
    return HW_OK;
}

static void stop_ffmpeg(hw_video *v)
{
    kill(v->ffmpeg, SIGKILL);
    while (waitpid(v->ffmpeg, NULL, 0) < 0 && errno == EINTR)
        continue;
    v->ffmpeg = 0;
}

// ---- The video

// Named as base/file.h names its temporary files.
static hw_status name_temporary(hw_video *v)
{
    size_t capacity = strlen(v->path) + 48;
    HW_TRY(HW_NEW(&v->temporary, capacity));
    HW_TRY(HW_NEW(&v->output, capacity));
    snprintf(v->temporary, capacity, "%s.%ld.0.tmp", v->path, (long)getpid());
    // So named, nothing in it is taken for an option or a protocol.
    snprintf(v->output, capacity, "file:%s", v->temporary);
    return HW_OK;
}

hw_status hw_video_open(hw_video **out, const char *path, uint32_t width, uint32_t height,
                        double fps, const volatile sig_atomic_t *stop)
{
    assert(hw_video_name_ok(path));
    hw_status status = HW_OK;
    hw_video *v = NULL;
    *out = NULL;
    HW_GO(HW_NEW(&v, 1));
    v->width = width;
    v->height = height;
    v->pipe = -1;
    v->stop = stop;
    HW_GO(hw_strdup(&v->path, path));
    HW_GO(name_temporary(v));
    const struct sigaction ignore = {.sa_handler = SIG_IGN};
    v->ignores_sigpipe = sigaction(SIGPIPE, &ignore, &v->old_sigpipe) == 0;
    HW_GO(start(v, fps));
    *out = v;
    v = NULL;
out:
    hw_video_abort(v);
    return status;
}

hw_status hw_video_put(hw_video *video, const hw_image *image)
{
    assert(image->width == video->width && image->height == video->height && image->channels == 4);
    size_t left = (size_t)image->width * image->height * 4;
    const uint8_t *at = image->data;
    while (left > 0) {
        ssize_t written = write(video->pipe, at, left);
        if (*video->stop)
            return interrupted(video);
        if (written < 0 && (errno == EINTR || errno == EAGAIN)) {
            struct pollfd room = {.fd = video->pipe, .events = POLLOUT};
            (void)poll(&room, 1, WAIT_MS);
            continue;
        }
        if (written < 0)
            return hw_fail(HW_IO, "%s: ffmpeg takes no more frames: %s", video->path,
                           strerror(errno));
        at += written;
        left -= (size_t)written;
    }
    return HW_OK;
}

static hw_status put_in_place(const hw_video *v)
{
    struct stat info;
    if (stat(v->temporary, &info) != 0 || info.st_size == 0)
        return hw_fail(HW_IO, "%s: ffmpeg wrote nothing", v->path);
    int file = open(v->temporary, O_RDONLY | O_CLOEXEC);
    bool synced = file >= 0 && fsync(file) == 0;
    if (file >= 0)
        close(file);
    if (!synced || rename(v->temporary, v->path) != 0)
        return hw_fail(HW_IO, "%s: cannot write: %s", v->path, strerror(errno));
    return HW_OK;
}

hw_status hw_video_commit(hw_video *video)
{
    hw_status status = HW_OK;
    int state = 0;
    close_pipe(video);
    status = wait_for_end(video, &state);
    if (status == HW_OK && WIFSIGNALED(state))
        status = hw_fail(HW_IO, "%s: ffmpeg was ended by signal %d", video->path, WTERMSIG(state));
    else if (status == HW_OK && WEXITSTATUS(state) != 0)
        status = hw_fail(HW_IO, "%s: ffmpeg failed (%d)", video->path, WEXITSTATUS(state));
    else if (status == HW_OK)
        status = put_in_place(video);
    hw_video_abort(video);
    return status;
}

void hw_video_abort(hw_video *video)
{
    if (!video)
        return;
    if (video->ffmpeg > 0)
        stop_ffmpeg(video);
    close_pipe(video);
    if (video->temporary)
        unlink(video->temporary);
    if (video->ignores_sigpipe)
        sigaction(SIGPIPE, &video->old_sigpipe, NULL);
    hw_free(video->path);
    hw_free(video->temporary);
    hw_free(video->output);
    hw_free(video);
}
