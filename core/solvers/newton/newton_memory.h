// The bytes of Newton's method, for the estimate of a run's memory.
#pragma once

#include <cstdint>
#include <vector>

#include "core/problem/problem_memory.h"

namespace varimesh {

/// What the sizes of Newton's arrays depend on besides the mesh.
struct NewtonSizes {
  int hessian_entries = 0;       ///< HessianKernels::entries().
  bool has_norm = false;         ///< Whether the p-norm is another than the sum.
  bool has_left_factor = false;  ///< As CellSet::left_factor.
};

/// What a BatchSet keeps.
std::int64_t bytes_of_batches(const SetSizes& set, const NewtonSizes& sizes);

/// What Newton's method keeps.
std::int64_t bytes_of_newton(const MeshCounts& counts, const std::vector<SetSizes>& sets, const NewtonSizes& sizes);

/// The most that it has in use beside that while it is set up. Part of what it keeps is not there yet by then.
std::int64_t bytes_of_newton_set_up(const MeshCounts& counts, const std::vector<SetSizes>& sets,
                                    const NewtonSizes& sizes);

}  // namespace varimesh
