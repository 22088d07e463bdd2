// The bytes of the guard, for the estimate of a run's memory.
#pragma once

#include <cstdint>

#include "core/mesh/mesh_counts.h"

namespace varimesh {

/// What a Guard keeps, its NodeConversion included.
std::int64_t bytes_of_guard(const MeshCounts& counts);

/// What a BestMesh keeps once it has considered a state.
std::int64_t bytes_of_best_mesh(const MeshCounts& counts);

}  // namespace varimesh
