// Line plots as SVG, made by gnuplot.
#pragma once
#include "status.h"
#include <stdbool.h>
#include <stdint.h>

#define HW_PLOT_SERIES 8

typedef struct hw_plot_series {
    const char *name;
    const char *css_color; // for instance "var(--a)"
    const double *y;       // `count` values; gaps where they are not finite (or not positive, with
                           // log_y)
    uint32_t stride;       // of y, in doubles
} hw_plot_series;

typedef struct hw_plot {
    const char *x_label, *y_label;
    bool log_y;
    const double *x; // rising
    uint32_t count;  // points of each series
    uint32_t series_count;
    hw_plot_series series[HW_PLOT_SERIES];
    const double *marks; // vertical lines at these x
    uint32_t mark_count;
} hw_plot;

// An <svg> element to stand in an HTML page: it takes its text colour from there (currentColor),
// its series' colours from the page's style, scales to its container and has no ids. Free with
// hw_free. HW_NOT_FOUND when gnuplot is not installed, HW_IO with its words when it fails.
HW_MUST_USE hw_status hw_plot_svg(const hw_plot *plot, char **svg);
