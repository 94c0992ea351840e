// Clusters (thesis 5.2.1): far objects near each other in the picture become one, with one capture,
// and what they hide of each other is dropped.
#pragma once
#include "svmesh.h"

// A far object as it was derived alone, or a cluster.
typedef struct hw_cluster_item {
    double azimuth; // of the object's centre, seen from the cell's
    hw_svmesh svmesh;
} hw_cluster_item;

typedef struct hw_cluster_inputs {
    const hw_cell_view *view;
    const hw_far_options *options;
    const hw_scene *scene;
    const hw_capturer *capturer;
    const hw_occlusion *occlusion; // tells what members hide of each other
    double self_occlusion_px;      // a union's self-occluding error is less
} hw_cluster_inputs;

// By the greedy rule of the thesis: objects by falling size in the picture; each joins the clusters
// with which it shares most of the picture, as long as the texture of the union is smaller than
// both together and its self-occluding error small enough. Replaces the items of a cluster by one,
// of which the record's object_idx is that of its first member. The result does not depend on the
// order of the items, but for the order of its own.
HW_MUST_USE hw_status hw_clusters_make(const hw_cluster_inputs *inputs, hw_cluster_item *items,
                                       uint32_t *count);
