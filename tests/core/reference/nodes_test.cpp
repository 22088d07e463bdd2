// Node sets: the textbook's optimised nodes, which neighbouring cells share on their common face.
#include "core/reference/nodes.h"

#include <gtest/gtest.h>

#include "core/reference/basis.h"
#include "tests/core/reference/common.h"

namespace varimesh::reference {
namespace {

int node_at(Shape shape, int order, std::array<std::int8_t, 3> position) {
  const auto& all = lattice(shape, order);
  return static_cast<int>(std::find(all.begin(), all.end(), position) - all.begin());
}

/// Sums of squares and of fourth powers of all coordinates.
std::pair<double, double> moments(const Points& points) {
  return {points.array().square().sum(), points.array().pow(4).sum()};
}

// The figures below come from separate code for the textbook's formulas, in its own coordinates (equilateral cells).

TEST(OptimisedNodes, OfTrianglesAreTheTextbooks) {
  const auto [squares5, fourths5] = moments(nodes(Shape::Triangle, 5, NodeSet::Optimised, 2));
  EXPECT_NEAR(squares5, 22.46152103804453, 1e-12);
  EXPECT_NEAR(fourths5, 18.085924952565914, 1e-12);
  const auto [squares10, fourths10] = moments(nodes(Shape::Triangle, 10, NodeSet::Optimised, 2));
  EXPECT_NEAR(squares10, 65.68229240825377, 1e-11);
  EXPECT_NEAR(fourths10, 49.97205994558507, 1e-11);
  const Points& points = nodes(Shape::Triangle, 10, NodeSet::Optimised, 2);
  EXPECT_NEAR(points(node_at(Shape::Triangle, 10, {3, 2, 0}), 0), -0.4465077249210858, 1e-13);
  EXPECT_NEAR(points(node_at(Shape::Triangle, 10, {3, 2, 0}), 1), -0.6897512314778251, 1e-13);
}

TEST(OptimisedNodes, OfTetrahedraAreTheTextbooks) {
  const auto [squares5, fourths5] = moments(nodes(Shape::Tetrahedron, 5, NodeSet::Optimised, 3));
  EXPECT_NEAR(squares5, 95.86865711943489, 1e-11);
  EXPECT_NEAR(fourths5, 79.67530996973122, 1e-11);
  const auto [squares10, fourths10] = moments(nodes(Shape::Tetrahedron, 10, NodeSet::Optimised, 3));
  EXPECT_NEAR(squares10, 448.8468517514565, 1e-10);
  EXPECT_NEAR(fourths10, 347.5985186082412, 1e-10);
  const Points& points = nodes(Shape::Tetrahedron, 10, NodeSet::Optimised, 3);
  const Eigen::RowVector3d expected(-0.4068930231109451, -0.636687910726591, -0.8203121307549501);
  EXPECT_LT((points.row(node_at(Shape::Tetrahedron, 10, {3, 2, 1})) - expected).norm(), 1e-13);
}

TEST(OptimisedNodes, OfLinesAreGaussLobatto) {
  const Points& points = nodes(Shape::Line, 4, NodeSet::Optimised, 3);
  EXPECT_NEAR(points(2, 0), -std::sqrt(3.0 / 7), 1e-15);
  EXPECT_NEAR(points(3, 0), 0, 1e-16);
  EXPECT_NEAR(points(4, 0), std::sqrt(3.0 / 7), 1e-15);
}

TEST(OptimisedNodes, OfTrianglesDependOnTheSpaceTheyAreIn) {
  const Points& plane = nodes(Shape::Triangle, 5, NodeSet::Optimised, 2);
  const Points& space = nodes(Shape::Triangle, 5, NodeSet::Optimised, 3);
  EXPECT_GT((plane - space).cwiseAbs().maxCoeff(), 1e-3);
  EXPECT_EQ(plane.topRows(15), space.topRows(15)) << "the nodes on edges are the same";
}

TEST(EquispacedNodes, LieOnTheLattice) {
  const Points& pyramid = nodes(Shape::Pyramid, 3, NodeSet::Equispaced, 3);
  EXPECT_LT((pyramid.row(node_at(Shape::Pyramid, 3, {0, 2, 1})) - Eigen::RowVector3d(-2. / 3, 2. / 3, -1. / 3)).norm(),
            1e-15);
  EXPECT_EQ(pyramid.row(4), Eigen::RowVector3d(0, 0, 1));
}

TEST(Nodes, LieInsideTheCellOrOnIt) {
  for (const Shape shape : kCells) {
    for (int order = 1; order <= kMaxOrder; ++order) {
      const Points& points = nodes(shape, order, NodeSet::Optimised, 3);
      EXPECT_GE(points.minCoeff(), -1 - 1e-15) << at(shape, order);
      EXPECT_LE(points.maxCoeff(), 1 + 1e-15) << at(shape, order);
    }
  }
}

/// The points of a facet in the physical cell whose vertices stand at `corners` (straight-sided), in the facet's order.
Points facet_points(Shape shape, int order, int facet, const Points& corners) {
  const Points& own = nodes(shape, order, NodeSet::Optimised, 3);
  const Eigen::MatrixXd straight = basis_values(shape, 1, NodeSet::Equispaced, 3, own) * corners;
  const auto& number = facet_nodes(shape, order, facet);
  Points points(number.size(), 3);
  for (std::size_t n = 0; n < number.size(); ++n) points.row(n) = straight.row(number[n]);
  return points;
}

/// Puts a cell with one of its facets on four (or three) given points, the facet's vertex v at point turn[v].
Points cell_on(Shape shape, int facet, const Points& seat, const std::vector<int>& turn) {
  Points corners(info(shape).vertices, 3);
  for (int v = 0; v < corners.rows(); ++v) corners.row(v) << 0.3 * v + 5, 7 + 0.1 * v * v, 9 - v;
  for (std::size_t v = 0; v < turn.size(); ++v) corners.row(info(shape).facets[facet].vertices[v]) = seat.row(turn[v]);
  return corners;
}

/// Largest distance from a point of one set to the nearest of the other.
double mismatch(const Points& a, const Points& b) {
  double largest = 0;
  for (int i = 0; i < a.rows(); ++i) largest = std::max(largest, (b.rowwise() - a.row(i)).rowwise().norm().minCoeff());
  return largest;
}

TEST(OptimisedNodes, AgreeOnTheFaceBetweenAnyTwoCells) {
  Points triangle(3, 3), quadrilateral(4, 3);
  triangle << 0.1, 0.2, 0.3, 1.1, 0.1, 0.2, 0.4, 0.9, 0.1;
  quadrilateral << 0, 0, 0, 1, 0.1, 0.2, 1.1, 0.9, 0.1, -0.1, 1.2, 0.3;
  double worst = 0;
  for (int order = 1; order <= kMaxOrder; ++order) {
    for (const Shape face : {Shape::Triangle, Shape::Quadrilateral}) {
      const int n = info(face).vertices;
      const Points& seat = face == Shape::Triangle ? triangle : quadrilateral;
      const Points reference =
          basis_values(face, 1, NodeSet::Equispaced, 3, nodes(face, order, NodeSet::Optimised, 3)) * seat;
      for (const Shape shape : {Shape::Tetrahedron, Shape::Pyramid, Shape::Prism, Shape::Hexahedron}) {
        for (std::size_t f = 0; f < info(shape).facets.size(); ++f) {
          if (info(shape).facets[f].shape != face) continue;
          for (int rotation = 0; rotation < n; ++rotation) {
            for (const int sense : {1, n - 1}) {
              std::vector<int> turn;
              for (int v = 0; v < n; ++v) turn.push_back((rotation + sense * v) % n);
              const int facet = static_cast<int>(f);
              const Points points = facet_points(shape, order, facet, cell_on(shape, facet, seat, turn));
              worst = std::max(worst, mismatch(points, reference));
            }
          }
        }
      }
    }
  }
  EXPECT_LT(worst, 1e-14);
}

TEST(OptimisedNodes, InterpolateBetterThanEquispacedOnes) {
  for (const Shape shape : kCells) {
    for (const int order : {5, 10}) {
      double lebesgue[2];
      for (const NodeSet set : {NodeSet::Equispaced, NodeSet::Optimised})
        lebesgue[static_cast<int>(set)] =
            basis_values(shape, order, set, 3, uniform_lattice(shape, 13)).cwiseAbs().rowwise().sum().maxCoeff();
      EXPECT_LT(lebesgue[1], lebesgue[0]) << at(shape, order);
    }
  }
}

}  // namespace
}  // namespace varimesh::reference
