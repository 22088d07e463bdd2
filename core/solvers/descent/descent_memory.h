// The bytes of a descent, for the estimate of a run's memory.
#pragma once

#include <cstdint>
#include <vector>

#include "core/solvers/newton/newton_memory.h"

namespace varimesh {

/// The most that a Descent has in use, its tables included. `sizes`: of the energy's Hessian kernels.
std::int64_t bytes_of_descent(const MeshCounts& counts, const std::vector<SetSizes>& sets, const NewtonSizes& sizes);

}  // namespace varimesh
