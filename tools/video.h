// Videos, made by the program ffmpeg where it is installed: frames go to it through a pipe.
#pragma once
#include "image.h"
#include <signal.h>
#include <stdbool.h>

typedef struct hw_video hw_video;

// Whether the name ends as one of the kinds of video that can be written: .mp4, .mkv, .mov, .webm.
bool hw_video_name_ok(const char *path);
// Starts ffmpeg (found in PATH, started without a shell). It writes a temporary file beside `path`,
// which keeps what it holds until hw_video_commit. HW_NOT_FOUND if there is no ffmpeg, HW_IO if it
// cannot be started. Its own complaints go to standard error. SIGPIPE is ignored until the video is
// committed or aborted; one video at a time. Once *stop (borrowed, set by a signal's handler) is
// not 0, what waits for ffmpeg ends with HW_INTERRUPTED.
HW_MUST_USE hw_status hw_video_open(hw_video **out, const char *path, uint32_t width,
                                    uint32_t height, double fps, const volatile sig_atomic_t *stop);
// The next frame: RGBA of the video's size, alpha ignored. HW_IO once ffmpeg has gone.
HW_MUST_USE hw_status hw_video_put(hw_video *video, const hw_image *image);
// Waits for ffmpeg, then puts the file into place. Frees; on failure nothing is left.
HW_MUST_USE hw_status hw_video_commit(hw_video *video);
// Stops ffmpeg, removes what it has written and frees. NULL is legal.
void hw_video_abort(hw_video *video);
