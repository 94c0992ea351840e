// Constructors of the metrics in the table of metrics.c; the ones that other folders embed stand in
// metric.h.
#pragma once
#include "metric.h"

hw_metric hw_metric_edge(void);
hw_metric hw_metric_volume(void);
hw_metric hw_metric_uvol(void);
hw_metric hw_metric_norm(void);
hw_metric hw_metric_hybrid(void);
// kappa 0: 1e-3.
HW_MUST_USE hw_status hw_metric_pm(double kappa, hw_metric *out);
HW_MUST_USE hw_status hw_metric_silhouette(const hw_metric_setup *setup, hw_metric *out);
HW_MUST_USE hw_status hw_metric_screen(const hw_metric_setup *setup, hw_metric *out);
// The weights of the thesis from a depth image that is cast from the setup's eye.
HW_MUST_USE hw_status hw_metric_viewcell_from_eye(const hw_metric_setup *setup, hw_metric *out);
