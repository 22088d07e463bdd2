// Each mirror maps the cell to itself.
#include "core/reference/mirrors.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "core/reference/nodes.h"
#include "tests/core/support/print.h"

namespace varimesh::reference {
namespace {

class MirrorsOf : public ::testing::TestWithParam<std::pair<Shape, int>> {};

TEST_P(MirrorsOf, TakeNodesToNodes) {
  const auto [shape, count] = GetParam();
  const Mirrors found = mirrors(shape);
  ASSERT_EQ(found.count, count);
  const int d = info(shape).dimension;
  ASSERT_GT(std::abs(found.directions.determinant()), 0.1);
  for (const int order : {1, 4, 7}) {
    const Points& all = nodes(shape, order, NodeSet::Optimised, d);
    for (int axis = 0; axis < count; ++axis)
      for (Eigen::Index n = 0; n < all.rows(); ++n) {
        // ξ = origin + directionsᵀ s
        Eigen::VectorXd s = found.directions.transpose().partialPivLu().solve(all.row(n).transpose() - found.origin);
        s[axis] = -s[axis];
        const Eigen::RowVectorXd image = (found.origin + found.directions.transpose() * s).transpose();
        EXPECT_LT((all.rowwise() - image).rowwise().norm().minCoeff(), 1e-12) << "node " << n << ", axis " << axis;
      }
  }
}

INSTANTIATE_TEST_SUITE_P(EveryShape, MirrorsOf,
                         ::testing::Values(std::pair{Shape::Triangle, 1}, std::pair{Shape::Quadrilateral, 2},
                                           std::pair{Shape::Tetrahedron, 2}, std::pair{Shape::Pyramid, 2},
                                           std::pair{Shape::Prism, 2}, std::pair{Shape::Hexahedron, 3}),
                         [](const auto& info) { return std::string(reference::info(info.param.first).name); });

}  // namespace
}  // namespace varimesh::reference
