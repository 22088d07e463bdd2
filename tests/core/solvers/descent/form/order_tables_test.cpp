// The matrices in lanes are those of the bases, on quadrilaterals and hexahedra as products over the axes too.
#include "core/solvers/descent/form/order_tables.h"

#include <gtest/gtest.h>

#include "core/base/index.h"
#include "core/quality/accuracy/parts_table.h"
#include "core/reference/basis.h"

namespace varimesh::detail {
namespace {

constexpr auto kSet = reference::NodeSet::Optimised;

/// The matrix whose columns are the products with unit vectors.
Eigen::MatrixXd matrix_of(const LaneMatrix& lanes, std::size_t d) {
  const std::size_t block = d * kCellLanes;
  Eigen::MatrixXd matrix(lanes.rows, lanes.columns);
  std::vector<double> room;
  for (std::size_t c = 0; c < lanes.columns; ++c) {
    std::vector<double> in(lanes.columns * block), out(lanes.rows * block);
    in[c * block] = 1;
    multiply_lanes(lanes, d, in.data(), out.data(), room);
    for (std::size_t r = 0; r < lanes.rows; ++r)
      matrix(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c)) = out[r * block];
  }
  return matrix;
}

class OrderTablesOf : public ::testing::TestWithParam<Shape> {};

INSTANTIATE_TEST_SUITE_P(Shapes, OrderTablesOf,
                         ::testing::Values(Shape::Triangle, Shape::Quadrilateral, Shape::Tetrahedron, Shape::Pyramid,
                                           Shape::Prism, Shape::Hexahedron),
                         [](const auto& shape) { return std::string(reference::info(shape.param).name); });

TEST_P(OrderTablesOf, RaiseAsTheBasisDoes) {
  const int d = reference::info(GetParam()).dimension;
  for (int order = 1; order < 6; ++order) {
    const Eigen::MatrixXd expected =
        reference::basis_values(GetParam(), order, kSet, d, reference::nodes(GetParam(), order + 1, kSet, d));
    const LanePair raise = raising(GetParam(), order);
    EXPECT_LT((matrix_of(raise.there, at(d)) - expected).cwiseAbs().maxCoeff(), 1e-12) << order;
    EXPECT_LT((matrix_of(raise.back, at(d)) - expected.transpose()).cwiseAbs().maxCoeff(), 1e-12) << order;
  }
}

TEST_P(OrderTablesOf, GiveTheModesOfTheAccuracy) {
  const int d = reference::info(GetParam()).dimension;
  for (int order = 2; order <= 6; ++order) {
    const Eigen::MatrixXd& expected = parts_table(GetParam(), order, kSet).to_modes;
    const LanePair modes = to_modes(GetParam(), order);
    EXPECT_LT((matrix_of(modes.there, at(d)) - expected).cwiseAbs().maxCoeff(), 1e-11) << order;
    EXPECT_LT((matrix_of(modes.back, at(d)) - expected.transpose()).cwiseAbs().maxCoeff(), 1e-11) << order;
  }
}

}  // namespace
}  // namespace varimesh::detail
