// Products in lanes equal those of Eigen, whole and axis by axis.
#include "core/kernels/dense/lane_matrix.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <unsupported/Eigen/KroneckerProduct>
#include <vector>

#include "core/base/index.h"

namespace varimesh::detail {
namespace {

constexpr double kRounding = 1e-13;

/// The largest difference of multiply_lanes() from the product by Eigen, for random values that differ by lane.
double largest_difference(const LaneMatrix& lanes, const Eigen::MatrixXd& matrix, std::size_t directions) {
  const std::size_t block = directions * kCellLanes;
  const Eigen::MatrixXd in = Eigen::MatrixXd::Random(matrix.cols(), static_cast<Eigen::Index>(block));
  std::vector<double> values(at(matrix.cols()) * block), out(at(matrix.rows()) * block), room;
  for (Eigen::Index c = 0; c < in.rows(); ++c)
    for (Eigen::Index i = 0; i < in.cols(); ++i) values[at(c) * block + at(i)] = in(c, i);
  multiply_lanes(lanes, directions, values.data(), out.data(), room);
  const Eigen::MatrixXd expected = matrix * in;
  double largest = 0;
  for (Eigen::Index r = 0; r < expected.rows(); ++r)
    for (Eigen::Index i = 0; i < expected.cols(); ++i)
      largest = std::max(largest, std::abs(out[at(r) * block + at(i)] - expected(r, i)));
  return largest;
}

TEST(LaneMatrix, MultipliesAWholeMatrix) {
  for (const auto& [rows, columns] : {std::pair{1, 3}, {4, 4}, {35, 20}, {10, 21}}) {
    const Eigen::MatrixXd matrix = Eigen::MatrixXd::Random(rows, columns);
    for (const std::size_t directions : {2, 3})
      EXPECT_LT(largest_difference(lane_matrix(matrix), matrix, directions), kRounding) << rows << " " << columns;
  }
}

/// The places in another order, without the first `left_out`.
std::vector<std::size_t> mixed(Eigen::Index places, std::size_t left_out) {
  std::vector<std::size_t> all(at(places));
  std::iota(all.begin(), all.end(), std::size_t{0});
  std::ranges::rotate(all, all.begin() + 2);
  std::swap(all[0], all[1]);
  all.erase(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(left_out));
  return all;
}

TEST(LaneMatrix, MultipliesAxisByAxis) {
  for (const auto& [rows, columns] : {std::pair{2, 3}, {3, 2}, {5, 4}, {5, 5}, {11, 11}})
    for (const int axes : {2, 3})
      for (const std::size_t left_out : {0, 3}) {
        const Eigen::MatrixXd factor = Eigen::MatrixXd::Random(rows, columns);
        Eigen::MatrixXd whole = factor;
        for (int a = 1; a < axes; ++a) whole = Eigen::kroneckerProduct(factor, whole).eval();
        const std::vector<std::size_t> row_places = mixed(whole.rows(), left_out),
                                       column_places = mixed(whole.cols(), left_out);
        const LaneMatrix lanes = lane_matrix(factor, at(axes), row_places, column_places);
        const Eigen::MatrixXd matrix = whole(row_places, column_places);
        EXPECT_LT(largest_difference(lanes, matrix, at(axes)), 10 * kRounding) << rows << " " << columns << " " << axes;
      }
}

}  // namespace
}  // namespace varimesh::detail
