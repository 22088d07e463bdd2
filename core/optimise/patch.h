// The cells of one free node, as the kernels take them.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/optimise/aligned.h"
#include "core/optimise/cells.h"
#include "core/optimise/kernels.h"

namespace varimesh {

/// Gathers the patch of free node `rank` on the stack; only patches of more than kMostCells cells go to the heap.
class Patch {
 public:
  /// What stays in the second-level cache.
  static constexpr std::size_t kMostNumbers = 1 << 14;

  Patch(Problem& problem, std::int32_t rank) : Patch(problem, rank, 0, nullptr) {}

  /// With room in `scratch`, which has kMostNumbers, for the `line_size` numbers a point that expand() leaves for the
  /// rest of a visit (Kernels::line_size): of as many cells as it has room for.
  Patch(Problem& problem, std::int32_t rank, int line_size, double* scratch) {
    const std::int32_t first = problem.offsets[rank];
    count_ = problem.offsets[rank + 1] - first;
    if (count_ > kMostCells) on_heap_.resize(count_);
    const std::span<PatchCell> cells = this->cells();
    std::size_t used = 0;
    for (std::int32_t i = 0; i < count_; ++i) {
      const Incidence& at = problem.incidences[first + i];
      CellBlock& block = problem.blocks[at.block];
      // One matrix to read in place of one a point, which comes from farther away than it takes to use it.
      const double* uniform = block.uniform_target_of(at.cell);
      cells[i] = {block.deformation_of(at.cell),
                  block.derivatives_of(at.local),
                  uniform != nullptr ? uniform : block.inverse_target_of(at.cell),
                  block.left_factor_of(at.cell),
                  uniform != nullptr ? uniform + block.dimension * block.dimension : block.measure_of(at.cell),
                  block.weights.data(),
                  block.delta_squared[at.cell],
                  block.stride,
                  block.affine || uniform != nullptr,
                  block.jacobian_function_of(at.cell),
                  nullptr};
      const std::size_t needed = static_cast<std::size_t>(line_size) * static_cast<std::size_t>(block.stride);
      if (needed == 0 || used + needed > kMostNumbers) continue;
      cells[i].line = scratch + used;
      used += needed;
    }
  }

  std::span<PatchCell> cells() {
    return {count_ > kMostCells ? on_heap_.data() : on_stack_.data(), static_cast<std::size_t>(count_)};
  }

 private:
  static constexpr std::int32_t kMostCells = 512;

  std::int32_t count_;
  std::array<PatchCell, kMostCells> on_stack_;
  std::vector<PatchCell> on_heap_;
};

}  // namespace varimesh
