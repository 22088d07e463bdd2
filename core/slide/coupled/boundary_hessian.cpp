#include "core/slide/coupled/boundary_hessian.h"

#include <algorithm>
#include <cassert>

#include "core/base/index.h"

namespace varimesh::detail {

void BoundaryHessian::finish() {
  std::ranges::sort(pairs_);
  pairs_.erase(std::unique(pairs_.begin(), pairs_.end()), pairs_.end());
  std::vector<Eigen::Triplet<double>> entries;
  for (const auto& [row, column] : pairs_)
    for (int r = 0; r < directions_[at(row)]; ++r)
      for (int c = 0; c < directions_[at(column)]; ++c) entries.emplace_back(3 * row + r, 3 * column + c, 0);
  pairs_ = {};
  const auto size = 3 * static_cast<Eigen::Index>(directions_.size());
  matrix_.resize(size, size);
  matrix_.setFromTriplets(entries.begin(), entries.end());
}

BoundaryHessian::Place BoundaryHessian::place(std::int32_t row, std::int32_t column) const {
  const int* const begin = matrix_.innerIndexPtr() + matrix_.outerIndexPtr()[3 * row];
  const int* const end = matrix_.innerIndexPtr() + matrix_.outerIndexPtr()[3 * row + 1];
  const int* const found = std::lower_bound(begin, end, 3 * column);
  assert(found != end && *found == 3 * column);
  return static_cast<Place>(found - begin);
}

void BoundaryHessian::set_zero() { std::fill_n(matrix_.valuePtr(), matrix_.nonZeros(), 0.0); }

void BoundaryHessian::add(std::int32_t row, std::int32_t column, Place place, const Eigen::Matrix3d& block) {
  for (int r = 0; r < directions_[at(row)]; ++r) {
    double* const values = matrix_.valuePtr() + matrix_.outerIndexPtr()[3 * row + r] + place;
    for (int c = 0; c < directions_[at(column)]; ++c) values[c] += block(r, c);
  }
}

}  // namespace varimesh::detail
