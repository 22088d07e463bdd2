// The coarsest level: a dense Cholesky factor that also takes singular matrices.
#pragma once

#include <cstdint>
#include <vector>

#include "core/preconditioner/multigrid/level_matrix.h"

namespace varimesh::multigrid {

/// A = L D Lᵀ of a positive semidefinite matrix, L with the unit diagonal. An unknown whose pivot is below 1e-12 of its
/// diagonal entry is left out: it stays 0, as do those of a matrix' null space that come last.
class DenseFactor {
 public:
  DenseFactor() = default;
  explicit DenseFactor(const LevelMatrix& matrix);

  /// The solution in place. x: rows × columns.
  void solve(double* x, int columns) const;

  std::size_t bytes() const { return (lower_.size() + inverse_.size()) * sizeof(double); }

 private:
  std::size_t rows_ = 0;
  std::vector<double> lower_;    ///< rows × rows by rows; below the diagonal.
  std::vector<double> inverse_;  ///< Of D; 0 for an unknown that is left out.
};

}  // namespace varimesh::multigrid
