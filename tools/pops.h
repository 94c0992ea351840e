// How much the hybrid's picture jumps where a tour crosses into another cell, with the dissolves of
// runtime/crossing.h and without, and what the dissolves cost.
#pragma once
#include "manifest.h"
#include "renderer.h"
#include "target.h"
#include "tour.h"

// One crossing: the change between the two tour frames around it, in levels of luma (0 to 255, RMS
// over the picture).
typedef struct hw_pop {
    double t; // seconds on the tour
    // The change of the hybrid's picture less that of ground truth with the same samples a pixel.
    double soft, hard; // with dissolves, without
    // The jump alone: seen from one point in one direction, with cells and levels of detail as
    // chosen for where the viewer is in the first frame and in the second. `soft` is the largest of
    // all frames near the crossing, among which dissolves share it out, less what levels of detail
    // change there without a crossing; `usual` that of two frames some way off the border, where
    // only levels of detail change (NaN: the tour has none).
    double soft_jump, hard_jump, usual_jump;
} hw_pop;

typedef struct hw_pops {
    double *crossings; // times (s) at which the tour crosses into another cell
    hw_pop *items;     // evenly over the crossings
    uint32_t crossing_count, count;
    double strip_share;   // of the tour's frames that lie where cells dissolve
    double dissolve_cost; // how much longer the mean frame of the tour takes for it, as a ratio - 1
} hw_pops;

typedef struct hw_pops_desc {
    const hw_manifest *manifest;
    const hw_tour *tour;
    uint32_t width, height;
    hw_renderer *truth, *hybrid; // B and C, with HW_CROSSING_WIDTH
    hw_target *target;
} hw_pops_desc;

void hw_pops_free(hw_pops *pops);
// The crossings between cells that the dataset has. *out has at least crossings, freed by
// hw_pops_free.
HW_MUST_USE hw_status hw_pops_find(const hw_manifest *manifest, const hw_tour *tour, hw_pops *out);
// Fills in the rest.
HW_MUST_USE hw_status hw_pops_measure(const hw_pops_desc *desc, hw_pops *pops);
