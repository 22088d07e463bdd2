#include "core/preconditioner/multigrid/dense_factor.h"

#include "core/base/index.h"

namespace varimesh::multigrid {
namespace {

constexpr double kLeastPivot = 1e-12;  // of the diagonal entry

}  // namespace

DenseFactor::DenseFactor(const LevelMatrix& matrix) : rows_(at(matrix.rows)), lower_(rows_ * rows_), inverse_(rows_) {
  for (std::size_t i = 0; i < rows_; ++i) {
    for (std::int64_t e = matrix.begin[i]; e < matrix.begin[i + 1]; ++e)
      lower_[i * rows_ + at(matrix.column[at(e)])] = static_cast<double>(matrix.value[at(e)]);
    // Row i of L D, then of L.
    double pivot = matrix.diagonal[i];
    double* row = &lower_[i * rows_];
    for (std::size_t j = 0; j < i; ++j) {
      const double* above = &lower_[j * rows_];
      for (std::size_t k = 0; k < j; ++k) row[j] -= row[k] * above[k];
    }
    for (std::size_t j = 0; j < i; ++j) {
      const double scaled = row[j] * inverse_[j];
      pivot -= row[j] * scaled;
      row[j] = scaled;
    }
    inverse_[i] = pivot > kLeastPivot * matrix.diagonal[i] ? 1 / pivot : 0;
  }
}

void DenseFactor::solve(double* x, int columns) const {
  const std::size_t d = at(columns);
  for (std::size_t i = 0; i < rows_; ++i)
    for (std::size_t j = 0; j < i; ++j)
      for (std::size_t k = 0; k < d; ++k) x[i * d + k] -= lower_[i * rows_ + j] * x[j * d + k];
  for (std::size_t i = 0; i < rows_; ++i)
    for (std::size_t k = 0; k < d; ++k) x[i * d + k] *= inverse_[i];
  for (std::size_t i = rows_; i-- > 0;)
    for (std::size_t j = 0; j < i; ++j)
      for (std::size_t k = 0; k < d; ++k) x[j * d + k] -= lower_[i * rows_ + j] * x[i * d + k];
}

}  // namespace varimesh::multigrid
