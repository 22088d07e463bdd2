// The bytes of sweeps, for the estimate of a run's memory.
#pragma once

#include <cstdint>

#include "core/mesh/mesh_counts.h"

namespace varimesh {

/// What ColouredNodes keeps.
std::int64_t bytes_of_colouring(const MeshCounts& counts);

/// The most that colour_nodes() has in use beside its result.
std::int64_t bytes_of_making_colouring(const MeshCounts& counts);

/// What a Sweeper keeps from the beginning, and what it keeps after the first sweep in addition. The deformation
/// gradients are the problem's.
std::int64_t bytes_of_sweeper(const MeshCounts& counts);
std::int64_t bytes_of_first_sweep(const MeshCounts& counts);

}  // namespace varimesh
