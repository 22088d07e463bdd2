// The matrix of one level: how it is kept, its products and steps of relaxation.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/index.h"
#include "core/base/team.h"
#include "core/preconditioner/multigrid/row_builder.h"
#include "core/preconditioner/multigrid/sparse_rows.h"

namespace varimesh::multigrid {

/// A symmetric matrix A. Entries off the diagonal are kept in single precision. Each diagonal entry is kept in double
/// precision, and makes up for the rounding of the other entries of its row, so that each row has the same sum as in
/// the matrix from which it came: rounding leaves A times a constant vector as it was, and changes the energy xᵀAx by a
/// sum of squares of differences, each weighted by at most 6e-8 of an entry.
///
/// A row whose diagonal entry is not positive and finite is left out: the inverse of its diagonal entry is 0, and so
/// are all entries of its row and column.
struct LevelMatrix {
  std::int32_t rows = 0;
  std::vector<std::int64_t> begin;   ///< rows + 1
  std::vector<std::int32_t> column;  ///< Off the diagonal.
  std::vector<float> value;
  std::vector<double> diagonal;
  std::vector<double> inverse;  ///< 1 / diagonal, or 0.
};

/// The matrix of the finest level.
LevelMatrix level_matrix(const Team& team, const CompressedRows& from);

/// The matrix of a coarser level. `off_diagonal` is square and has no diagonal; its lower triangle is overwritten by
/// the upper one, so that the two are the same to the last bit. The diagonal follows from the sums of the rows.
LevelMatrix level_matrix(const Team& team, FloatRows&& off_diagonal, std::span<const double> row_sums);

/// A x for one vector.
void multiply(const Team& team, const LevelMatrix& matrix, const std::vector<double>& x, std::vector<double>& product);

/// An upper bound, nearly always, of the eigenvalues of D⁻¹A, D the diagonal: the largest value that a few steps of
/// Lanczos' method find from a fixed start, and a tenth more; at most the largest sum of |entries| over the diagonal
/// entry of a row, which is a bound.
double largest_eigenvalue(const Team& team, const LevelMatrix& matrix);

inline constexpr std::size_t kRowsPerTask = 512;

/// One row of A x for d vectors at once, the diagonal left out. x: rows × d.
template <int d>
inline void row_off_diagonal(const LevelMatrix& matrix, std::size_t row, const double* x, double (&sum)[d]) {
  for (int k = 0; k < d; ++k) sum[k] = 0;
  const std::int64_t end = matrix.begin[row + 1];
  for (std::int64_t e = matrix.begin[row]; e < end; ++e) {
    const double value = matrix.value[at(e)];
    const double* from = x + at(matrix.column[at(e)]) * d;
    for (int k = 0; k < d; ++k) sum[k] += value * from[k];
  }
}

}  // namespace varimesh::multigrid
