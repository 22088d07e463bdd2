// Deviations of edges and faces from the straight-sided simplex, blended into its inside.
#include "core/mesh/changes/simplex_blend.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/reference/nodes.h"
#include "tests/core/support/print.h"

namespace varimesh {
namespace {

TEST(SimplexBlend, ReproducesAQuadraticBubbleOfAnEdge) {
  // The deviation is a quadratic bubble λ_a λ_b on one edge of a tetrahedron. The blend is the same bubble everywhere.
  for (const int order : {3, 4, 5}) {
    const detail::SimplexBlend& table = detail::simplex_blend(Shape::Tetrahedron, order);
    const Eigen::VectorXd bubble = table.linear.col(0).cwiseProduct(table.linear.col(1));
    for (std::size_t f = 0; f < table.faces.size(); ++f)
      EXPECT_LT((table.on_face[f] * bubble - bubble(table.faces[f])).cwiseAbs().maxCoeff(), 1e-12);
    if (!table.inside.empty()) {
      EXPECT_LT((table.in_cell * bubble - bubble(table.inside)).cwiseAbs().maxCoeff(), 1e-12);
    }
  }
}

TEST(SimplexBlend, ListsTheInnerNodesOfEveryEdgeAndFace) {
  for (const Shape shape : {Shape::Triangle, Shape::Tetrahedron})
    for (const int order : {2, 3, 5}) {
      const detail::SimplexBlend& table = detail::simplex_blend(shape, order);
      const auto& places = reference::node_places(shape, order);
      std::size_t listed = 0;
      for (std::size_t e = 0; e < table.edges.size(); ++e)
        for (const int node : table.edges[e]) {
          EXPECT_EQ(places[std::size_t(node)].dimension, 1);
          EXPECT_EQ(places[std::size_t(node)].index, int(e));
          ++listed;
        }
      for (std::size_t f = 0; f < table.faces.size(); ++f)
        for (const int node : table.faces[f]) {
          EXPECT_EQ(places[std::size_t(node)].dimension, 2);
          EXPECT_EQ(places[std::size_t(node)].index, int(f));
          ++listed;
        }
      listed += table.inside.size();
      EXPECT_EQ(listed + std::size_t(reference::info(shape).vertices), places.size());
    }
}

TEST(SimplexBlend, LeavesAStraightSidedSimplexStraight) {
  for (const Shape shape : {Shape::Triangle, Shape::Tetrahedron}) {
    const detail::SimplexBlend& table = detail::simplex_blend(shape, 4);
    EXPECT_LT((table.linear.rowwise().sum().array() - 1).abs().maxCoeff(), 1e-14);
    // The nodes lie at equal parts: their barycentric coordinates times the order are whole numbers.
    const Eigen::MatrixXd steps = 4 * table.linear;
    EXPECT_LT((steps - steps.array().round().matrix()).cwiseAbs().maxCoeff(), 1e-13);
  }
}

TEST(SimplexBlend, TakesFacesFromTheirEdgesOnly) {
  const detail::SimplexBlend& table = detail::simplex_blend(Shape::Tetrahedron, 4);
  const auto& places = reference::node_places(Shape::Tetrahedron, 4);
  for (std::size_t f = 0; f < table.faces.size(); ++f)
    for (Eigen::Index n = 0; n < table.on_face[f].cols(); ++n) {
      const bool on_an_edge = places[std::size_t(n)].dimension == 1;
      EXPECT_TRUE(on_an_edge || table.on_face[f].col(n).norm() == 0) << "node " << n;
    }
}

}  // namespace
}  // namespace varimesh
