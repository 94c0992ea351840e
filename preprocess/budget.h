// Keeps a build within a bound of memory. Meshes and their levels go to a scratch file and are read
// from there; the trees that rays are cast through are made when a ray needs them. When memory
// grows short the least recently used of both goes. What is computed is the same with any bound.
#pragma once
#include "chain.h"
#include "rays.h"
#include "spill.h"

typedef struct hw_budget hw_budget;

// `bytes` bounds the resident memory of the process. The scratch file lies, without a name, in
// `folder`.
HW_MUST_USE hw_status hw_budget_create(hw_budget **out, uint64_t bytes, const char *folder);
// Meshes that were taken are left without arrays; destroy the rays before. NULL is legal.
void hw_budget_destroy(hw_budget *budget);
// HW_LIMIT if the process needed more than the bound already; `what` is for the message.
HW_MUST_USE hw_status hw_budget_check_peak(const hw_budget *budget, const char *what);

// Moves the arrays of a scene's meshes, or of a chain's levels (of which the first shares those of
// the scene's mesh, already moved), out of the heap. The structs must stay where they are until the
// budget is destroyed. taking a chain is thread-safe.
HW_MUST_USE hw_status hw_budget_take_scene(hw_budget *budget, hw_scene *scene);
HW_MUST_USE hw_status hw_budget_take_chain(hw_budget *budget, uint32_t mesh_idx, hw_chain *chain);
// Marks a mesh and its chain as used now and sees to it that there is room to work with them. NULL
// as the budget: nothing to do. Thread-safe; HW_LIMIT as below.
HW_MUST_USE hw_status hw_budget_use(hw_budget *budget, uint32_t mesh_idx);

// Waits until `bytes` more fit and reserves them until hw_budget_release. HW_LIMIT tells the least
// bound needed. NULL as the budget: everything fits. Thread-safe.
HW_MUST_USE hw_status hw_budget_reserve(hw_budget *budget, uint64_t bytes);
void hw_budget_release(hw_budget *budget, uint64_t bytes);

// Rays that live within the bound: hw_rays_create_paged. At most two; of those made later trees go
// first.
HW_MUST_USE hw_status hw_budget_create_rays(hw_budget *budget, const hw_scene *scene,
                                            hw_rays **out);
// Of the scratch file.
uint64_t hw_budget_scratch_bytes(hw_budget *budget);
