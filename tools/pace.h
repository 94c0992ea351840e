// Frame times as a HUD shows them.
#pragma once
#include <stdbool.h>
#include <stdint.h>

#define HW_PACE_FRAMES 512u // the latest that p99 is of

// Zero-initialise.
typedef struct hw_pace {
    double start_ms, last_ms; // of the present half second; its last frame
    uint32_t frames;          // in it
    uint64_t bytes;           // loaded in it
    float times_ms[HW_PACE_FRAMES];
    uint32_t time_count;
    // Shown: of the last half second, and the 99th of 100 of the latest frames.
    double fps, frame_ms, p99_ms, bytes_s;
} hw_pace;

// A frame that ends at now_ms and loaded so many bytes. True: what is shown is new.
bool hw_pace_tick(hw_pace *pace, double now_ms, uint64_t loaded_bytes);
// A pause that is no slow frame.
void hw_pace_pause(hw_pace *pace);
