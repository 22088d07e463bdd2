// The star of one free node, in the form that the kernels take.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/base/aligned.h"
#include "core/kernels/kernels.h"
#include "core/problem/problem.h"

namespace varimesh {

/// Gathers the star of free node `rank` on the stack. Only stars of more than kMostCells cells go to the heap.
class NodeStar {
 public:
  /// Numbers in the scratch space of a visit; they fit in the second-level cache.
  static constexpr std::size_t kMostNumbers = 1 << 14;

  NodeStar(Problem& problem, std::int32_t rank) : NodeStar(problem, rank, 0, nullptr) {}

  /// With room for StarCell::line, for as many cells as fit in `scratch` (kMostNumbers long). `line_size`:
  /// Kernels::line_size().
  NodeStar(Problem& problem, std::int32_t rank, int line_size, double* scratch) {
    const std::int64_t first = problem.offsets[rank];
    count_ = static_cast<std::int32_t>(problem.offsets[rank + 1] - first);
    if (count_ > kMostCells) on_heap_.resize(count_);
    const std::span<StarCell> cells = this->cells();
    std::size_t used = 0;
    for (std::int32_t i = 0; i < count_; ++i) {
      const Incidence& at = problem.incidences[first + i];
      CellSet& set = problem.sets[at.set];
      // One matrix per cell is faster to read than one per point, which comes from memory.
      const double* uniform = set.uniform_target_of(at.cell);
      cells[i] = {set.deformation_of(at.cell),
                  set.derivatives_of(at.local),
                  uniform != nullptr ? uniform : set.inverse_target_of(at.cell),
                  set.left_factor_of(at.cell),
                  uniform != nullptr ? uniform + set.dimension * set.dimension : set.measure_of(at.cell),
                  set.weights.data(),
                  set.delta_squared[at.cell],
                  set.stride,
                  set.affine || uniform != nullptr,
                  set.jacobian_function_of(at.cell),
                  nullptr};
      const std::size_t needed = static_cast<std::size_t>(line_size) * static_cast<std::size_t>(set.stride);
      if (needed == 0 || used + needed > kMostNumbers) continue;
      cells[i].line = scratch + used;
      used += needed;
    }
  }

  std::span<StarCell> cells() {
    return {count_ > kMostCells ? on_heap_.data() : on_stack_.data(), static_cast<std::size_t>(count_)};
  }

 private:
  static constexpr std::int32_t kMostCells = 512;

  std::int32_t count_;
  std::array<StarCell, kMostCells> on_stack_;
  std::vector<StarCell> on_heap_;
};

}  // namespace varimesh
