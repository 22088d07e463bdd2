// The level of order 1 below the coarse level: one scalar problem for all directions.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/reduction.h"
#include "core/base/team.h"
#include "core/preconditioner/coarse_space.h"
#include "core/preconditioner/multigrid/multigrid.h"
#include "core/problem/problem.h"

namespace varimesh {

/// Corrections of order 1 to the coarse level. Of the stiffness matrix it keeps only the coupling of each direction
/// with itself, averaged over the directions. So one scalar problem serves all directions, and one multigrid cycle of
/// it (core/preconditioner/multigrid) is the solution. Conjugate gradients take as many iterations with it as with a
/// factor of the whole matrix (docs/notes/order-1-level.md).
class LinearLevel {
 public:
  /// `above`: the space of the coarse level, in its final numbering, and `cells_above` the cells of its nodes. Only
  /// problem and team are kept by reference.
  LinearLevel(const Problem& problem, const CoarseSpace& above, const NodeCells& cells_above, const Team& team);

  /// Whether there is something to solve: no if the mesh has no free vertices.
  bool is_used() const { return space_.count > 0; }

  /// Assembles the matrix and sets up multigrid for it. `tensors`: by set, as HessianKernels::mean_tensors.
  void assemble(const std::vector<std::vector<float>>& tensors);

  /// For those who run the cycle elsewhere: the number of vertices, the values at the nodes above from those at the
  /// vertices, the transpose, and the levels below.
  std::int32_t vertices() const { return space_.count; }
  const SparseRows& to_above() const { return to_above_; }
  const SparseRows& from_above() const { return from_above_; }
  const Multigrid& multigrid() const { return multigrid_; }

  /// Restricts a residual (padded(d) floats per node above) and solves.
  void solve(const float* residual);

  /// The solution of solve() at a node of the space above.
  template <int d>
  std::array<float, d> value(std::int32_t node) const {
    std::array<float, d> sum{};
    for (std::int64_t i = to_above_.begin[node]; i < to_above_.begin[node + 1]; ++i)
      for (int k = 0; k < d; ++k)
        sum[k] +=
            static_cast<float>(to_above_.factor[i] * solution_[static_cast<std::size_t>(to_above_.column[i]) * d + k]);
    return sum;
  }

 private:
  /// Sets the entries of one row.
  template <int d>
  void assemble_row(std::int32_t vertex, const std::vector<std::vector<float>>& tensors);
  /// The coupling between vertices i and j of a cell.
  template <int d>
  double stiffness(std::size_t set, const float* tensor, int i, int j) const;
  /// Raises the diagonal by a share of the largest entry.
  void raise_diagonal();
  template <int d>
  void restrict_residual(const float* residual);

  const Problem& problem_;
  const Team& team_;
  CoarseSpace space_;
  NodeCells cells_;                   ///< Of the vertices.
  SparseRows to_above_, from_above_;  ///< Values at the nodes above from those at the nodes here, and the transpose.
  NodePattern pattern_;               ///< Of the matrix, diagonal included.
  std::vector<double> entry_;         ///< By column of the pattern.
  Multigrid multigrid_;
  Reduction reduction_;
  std::vector<double> right_, solution_;  ///< vertices × d, d innermost
};

}  // namespace varimesh
