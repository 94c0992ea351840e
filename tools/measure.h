// The measurement itself: draws chosen frames of a tour in several configurations and compares
// them. Needs no window; makes its own context.
#pragma once
#include "manifest.h"
#include "report.h"
#include "scene.h"
#include "tour.h"

typedef struct hw_measure_desc {
    const char *dataset;
    const hw_manifest *manifest;
    const hw_scene *scene;
    const hw_tour *tour;
    const hw_streaming_desc *streaming; // NULL: not measured
} hw_measure_desc;

// Reads from the report what to measure: width, height, samples (1 or 4), reference_samples, every,
// repeat, lod_error_px, near_triangles, hide, and the configurations named in configs[0 ..
// config_count). Fills in frames, samples, crossings, pops, pictures, gl_renderer, gpu_bytes_peak
// and, if asked for, streaming.
HW_MUST_USE hw_status hw_measure_run(const hw_measure_desc *desc, hw_report *report);
