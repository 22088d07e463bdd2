// The Hessian of the boundary's energy by the directions in which nodes move. Internal to core/slide.
#pragma once

#include <Eigen/SparseCore>
#include <cstdint>
#include <utility>
#include <vector>

namespace varimesh::detail {

/// A sparse matrix with 3 rows and 3 columns per node, whose entries are at the same places in every step. A node that
/// moves in fewer directions has entries only in its first rows and columns.
class BoundaryHessian {
 public:
  using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;

  /// Where a block begins: in the first of its rows, after the first entry of this row.
  using Place = std::int32_t;

  /// Without entries. Then has() names the blocks, and finish() makes the matrix.
  /// @param directions  by rank: in how many directions the node moves
  explicit BoundaryHessian(std::vector<std::int8_t> directions = {}) : directions_(std::move(directions)) {}
  void has(std::int32_t row, std::int32_t column) { pairs_.emplace_back(row, column); }
  void finish();

  /// Of a block that has() has named.
  Place place(std::int32_t row, std::int32_t column) const;

  void set_zero();
  void add(std::int32_t row, std::int32_t column, Place place, const Eigen::Matrix3d& block);
  const Matrix& matrix() const { return matrix_; }

 private:
  std::vector<std::int8_t> directions_;
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs_;
  Matrix matrix_;
};

}  // namespace varimesh::detail
