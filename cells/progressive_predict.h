// Where a split is expected to put its two vertices: only the difference is written. After a
// collapse the ring tells much of it (compare Pajarola and Rossignac, Compressed Progressive
// Meshes, 2000): each vertex lies near the middle of its neighbours.
#pragma once
#include "position_grid.h"
#include "progressive_links.h"

// k, l: the kept and removed vertex before the collapse; m where they were merged.
typedef enum hw_place {
    HW_PLACE_REFLECT, // k from the rings, l = 2 m - k
    HW_PLACE_KEPT,    // k = m, l from its ring
    HW_PLACE_REMOVED, // l = m, k from its ring
    HW_PLACE_RING,    // both from the rings
    HW_PLACES
} hw_place;

// In code units; lossless: in units of the mesh.
typedef struct hw_ring_means {
    double kept[3], removed[3];
} hw_ring_means;

// Means over the neighbours that k and l will have, from the corners of k's fan (see
// fan->moved) and the third vertices of the new faces.
void hw_ring_means_find(const hw_position_grid *grid, const hw_fan *fan, const uint32_t *corners,
                        const int32_t (*codes)[3], const uint32_t *tips, uint32_t tip_count,
                        hw_ring_means *out);
// The same bits on every machine: no product is rounded before it is added.
void hw_place_kept(const hw_position_grid *grid, hw_place place, const int32_t merged[3],
                   const hw_ring_means *means, int32_t kept[3]);
void hw_place_removed(const hw_position_grid *grid, hw_place place, const int32_t merged[3],
                      const int32_t kept[3], const hw_ring_means *means, int32_t removed[3]);
