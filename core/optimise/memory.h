// How much memory an optimisation will take, before it takes any.
#pragma once

#include <cstdint>

#include "core/mesh/high_order_mesh.h"
#include "core/options/options.h"

namespace varimesh {

/// The bytes that optimise() has in use at most, the mesh and its result included: an estimate, made from the counts of
/// the mesh (mesh_counts.h). It adds up what each room says it allocates and takes the largest phase. It is within −5 %
/// and +30 % of the peak, except for what cannot be known before a run:
/// - Repair::Split: how many cells are split. Coarse meshes have grown threefold, so it counts on that many.
/// - Tables of the diagnosis, which only a mesh with invalid cells needs: 9 MB for hexahedra of order 4, at most 80 MB
///   per shape and order.
/// - Nodes that are fixed by name, by number or by region_below: they count as free.
/// The program itself takes some tens of MB more.
std::int64_t memory_needed(const HighOrderMesh& mesh, const Options& options);

/// The part of these bytes that untangling has for the Hessians of cells: what Newton's method, whose arrays are freed
/// then, needs more than sweeps do, or an eighth of the rest. Untangling borrows more if it can
/// (RunControl::spare_memory), which is not in the estimate.
std::int64_t room_for_hessians(const HighOrderMesh& mesh, const Options& options);

}  // namespace varimesh
