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
#include "core/terms/part/problem_part.h"

namespace varimesh {

/// Corrections of order 1 to the coarse level. Of the stiffness matrix it keeps only the coupling of each direction
/// with itself, averaged over the directions. So one scalar problem serves all directions, and one multigrid cycle of
/// it (core/preconditioner/multigrid) is the solution. Conjugate gradients take as many iterations with it as with a
/// factor of the whole matrix (docs/notes/order-1-level.md).
class LinearLevel {
 public:
  /// `above`: the space of the coarse level, in its final numbering, and `cells_above` the cells of its nodes. Only
  /// problem, team and part are kept by reference. `part`: null, or the part that a rank has of the problem. Then each
  /// rank makes the rows and restricts the residual of the vertices that it owns, all ranks get all of them, and each
  /// solves by itself.
  LinearLevel(const Problem& problem, const CoarseSpace& above, const NodeCells& cells_above, const Team& team,
              const ProblemPart* part = nullptr);

  /// From now on the nodes above are those with these numbers, which ascend. `tensors` are by place in the part.
  void take_part(const std::vector<std::int32_t>& numbers_above);

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
  /// Calls body(vertex) for the vertices that this rank owns, by several threads.
  template <class Body>
  void for_own(const Body& body) const;
  /// With ranks: all get the numbers that each has of its own vertices, those from begin(vertex) to begin(vertex + 1).
  template <class Begin>
  void gather(std::vector<double>& numbers, const Begin& begin) const;

  const Problem& problem_;
  const Team& team_;
  const ProblemPart* part_;
  std::vector<std::int32_t> own_;      ///< With ranks: the vertices that this rank owns, ascending,
  std::vector<std::int32_t> by_rank_;  ///< and those of all ranks, in their order.
  /// With ranks: by set and cell the place in the part.
  std::vector<std::vector<std::int32_t>> places_;
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
