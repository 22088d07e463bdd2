// The bytes of certificates, for the estimate of a run's memory.
#pragma once

#include <cstdint>

#include "core/mesh/mesh_counts.h"

namespace varimesh {

/// What jacobian_table() keeps for the shapes of the mesh, and what subdivisions keep beside it.
std::int64_t bytes_of_jacobian_tables(const MeshCounts& counts);

/// What the conversion in these tables takes while it is made, beside them.
std::int64_t bytes_of_making_jacobian_tables(const MeshCounts& counts);

/// What a Certifier keeps for this many cells.
std::int64_t bytes_of_certifier(std::int64_t cells);

/// The most that a thread has in use while it certifies.
std::int64_t bytes_of_certifying(const MeshCounts& counts);

}  // namespace varimesh
