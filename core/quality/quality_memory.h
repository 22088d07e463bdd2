// The bytes of a quality report, for the estimate of a run's memory.
#pragma once

#include <cstdint>

#include "core/mesh/mesh_counts.h"

namespace varimesh {

/// The most that quality() has in use, beside the certificates and the tables.
std::int64_t bytes_of_quality(const MeshCounts& counts);

/// What the tables of the lattices and of the loss of accuracy keep, and what a thread makes of them at a time.
std::int64_t bytes_of_lattice_tables(const MeshCounts& counts);

}  // namespace varimesh
