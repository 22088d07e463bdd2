// Sums run in ascending order, lane by lane.
#include "core/kernels/dense/lane_matrix.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "core/base/index.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/dense/lane_matrix.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep

#include "core/kernels/dense/lane_matrix-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh::detail::lanes::HWY_NAMESPACE {

void Multiply(const LaneMatrix& matrix, std::size_t directions, const double* in, double* out, double* room) {
  for (std::size_t lane = 0; lane < kCellLanes; lane += hn::Lanes(Tag()))
    if (directions == 2)
      MultiplyVector<2>(matrix, in + lane, out + lane, room + lane);
    else
      MultiplyVector<3>(matrix, in + lane, out + lane, room + lane);
}

}  // namespace varimesh::detail::lanes::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace varimesh::detail {
namespace lanes {
HWY_EXPORT(Multiply);

std::vector<double> by_rows(const Eigen::MatrixXd& matrix) {
  std::vector<double> numbers;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) numbers.push_back(matrix(i, j));
  return numbers;
}

}  // namespace lanes

std::size_t LaneMatrix::room(std::size_t directions) const {
  std::size_t places = axes == 0 ? 0 : 1;
  for (std::size_t a = 0; a < axes; ++a) places *= std::max(factor_rows, factor_columns);
  return 2 * places * directions * kCellLanes;
}

LaneMatrix lane_matrix(const Eigen::MatrixXd& matrix) {
  return {at(matrix.rows()), at(matrix.cols()), lanes::by_rows(matrix), 0, 0, 0, {}, {}};
}

LaneMatrix lane_matrix(const Eigen::MatrixXd& factor, std::size_t axes, std::vector<std::size_t> row_places,
                       std::vector<std::size_t> column_places) {
  const std::size_t rows = row_places.size(), columns = column_places.size();
  return {rows,
          columns,
          lanes::by_rows(factor),
          axes,
          at(factor.rows()),
          at(factor.cols()),
          std::move(row_places),
          std::move(column_places)};
}

void multiply_lanes(const LaneMatrix& matrix, std::size_t directions, const double* in, double* out,
                    std::vector<double>& room) {
  assert(matrix.axes == 0 || matrix.axes == directions);
  if (room.size() < matrix.room(directions)) room.resize(matrix.room(directions));
  HWY_DYNAMIC_DISPATCH(lanes::Multiply)(matrix, directions, in, out, room.data());
}

}  // namespace varimesh::detail
#endif
