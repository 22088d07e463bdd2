// The level of order 1 below the coarse level: one scalar problem for all directions.
#pragma once

#include <Eigen/SparseCore>
#include <array>
#include <cstdint>
#include <vector>

#include "core/base/team.h"
#include "core/newton/coarse_space.h"
#include "core/newton/linear_solver.h"
#include "core/problem/problem.h"

namespace varimesh {

/// Corrections of order 1 to the coarse level. Of the stiffness matrix it keeps only the coupling of each direction
/// with itself, averaged over the directions. So one scalar problem serves all directions (linear_solver.h), and with a
/// factor of it the conjugate gradients take as many iterations as with one of the whole matrix.
class LinearLevel {
 public:
  /// `above`: the space of the coarse level, in its final numbering. Only problem and team are kept by reference.
  LinearLevel(const Problem& problem, const CoarseSpace& above, const Team& team);

  /// Whether there is something to solve with: no if the mesh has no free vertices, or if the factorisation failed
  /// once.
  bool is_used() const { return is_used_; }

  /// Assembles the matrix and factorises it. `tensors`: by set, as HessianKernels::mean_tensors.
  void assemble(const std::vector<std::vector<float>>& tensors);

  /// Restricts a residual (padded(d) floats per node above) and solves.
  void solve(const float* residual);

  /// The solution of solve() at a node of the space above.
  template <int d>
  std::array<float, d> value(std::int32_t node) const {
    std::array<float, d> sum{};
    for (std::int64_t i = to_above_.begin[node]; i < to_above_.begin[node + 1]; ++i)
      for (int k = 0; k < d; ++k) sum[k] += static_cast<float>(to_above_.factor[i] * solution_(to_above_.column[i], k));
    return sum;
  }

  template <class Archive>
  void state(Archive& archive) {
    archive(is_used_);
  }

 private:
  /// Calls body(set, cell, i, j, row, column) for all pairs of a cell's nodes i and j in the lower triangle: the number
  /// of node i (row) is not below that of node j (column).
  template <class Body>
  void for_pairs(const Body& body) const;
  void find_pattern();
  template <int d>
  void assemble_from(const std::vector<std::vector<float>>& tensors);
  template <int d>
  void restrict_residual(const float* residual);

  const Problem& problem_;
  const Team& team_;
  CoarseSpace space_;
  SparseRows to_above_, from_above_;    ///< Values at the nodes above from those at the nodes here, and the transpose.
  Eigen::SparseMatrix<double> matrix_;  ///< Lower triangle.
  LinearSolver solver_;
  bool is_used_ = false;
  Eigen::MatrixXd right_, solution_;  ///< nodes × d
};

}  // namespace varimesh
