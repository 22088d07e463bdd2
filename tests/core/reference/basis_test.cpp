// Lagrange bases: interpolation, exact gradients, conversion between node sets.
#include "core/reference/basis.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <thread>

#include "core/reference/modal.h"
#include "core/reference/quadrature.h"
#include "tests/core/reference/common.h"

namespace varimesh::reference {
namespace {

constexpr std::array<NodeSet, 2> kSets{NodeSet::Equispaced, NodeSet::Optimised};

double largest(const Eigen::MatrixXd& matrix) { return matrix.cwiseAbs().maxCoeff(); }

TEST(Basis, IsOneAtItsOwnNodeAndZeroAtTheOthers) {
  for (const Shape shape : kCells) {
    for (int order = 1; order <= kMaxOrder; ++order) {
      const int count = node_count(shape, order);
      for (const NodeSet set : kSets) {
        const Eigen::MatrixXd values = basis_values(shape, order, set, 3, nodes(shape, order, set, 3));
        EXPECT_LT(largest(values - Eigen::MatrixXd::Identity(count, count)), 1e-12) << at(shape, order);
      }
    }
  }
}

TEST(Basis, ReproducesPolynomials) {
  for (const Shape shape : kCells) {
    const Points points = uniform_lattice(shape, 4);
    for (int order = 1; order <= kMaxOrder; ++order) {
      const Power power{order};
      for (const NodeSet set : kSets) {
        const Eigen::VectorXd nodal = power.values(nodes(shape, order, set, 3));
        const Eigen::VectorXd found = basis_values(shape, order, set, 3, points) * nodal;
        EXPECT_LT(largest(found - power.values(points)), 1e-13) << at(shape, order);
      }
    }
  }
}

TEST(Basis, DifferentiatesPolynomialsExactly) {
  for (const Shape shape : kCells) {
    const Points points = uniform_lattice(shape, 4);
    for (int order = 1; order <= kMaxOrder; ++order) {
      const Power power{order};
      const Eigen::VectorXd nodal = power.values(nodes(shape, order, NodeSet::Optimised, 3));
      const auto gradients = basis_gradients(shape, order, NodeSet::Optimised, 3, points);
      ASSERT_EQ(static_cast<int>(gradients.size()), info(shape).dimension);
      for (std::size_t d = 0; d < gradients.size(); ++d) {
        const Eigen::VectorXd expected = power.derivative(points, static_cast<int>(d));
        EXPECT_LT(largest(gradients[d] * nodal - expected), 1e-12 * (1 + largest(expected))) << at(shape, order);
      }
    }
  }
}

TEST(Basis, GradientsMatchDifferencesOfValues) {
  // Inside a pyramid the functions are not polynomials.
  for (const Shape shape : kCells) {
    const Quadrature rule = quadrature(shape, 2, 4);
    const auto gradients = basis_gradients(shape, 3, NodeSet::Optimised, 3, rule.points);
    for (int d = 0; d < info(shape).dimension; ++d) {
      constexpr double kStep = 1e-6;
      Points above = rule.points, below = rule.points;
      above.col(d).array() += kStep;
      below.col(d).array() -= kStep;
      const Eigen::MatrixXd difference = (basis_values(shape, 3, NodeSet::Optimised, 3, above) -
                                          basis_values(shape, 3, NodeSet::Optimised, 3, below)) /
                                         (2 * kStep);
      EXPECT_LT(largest(gradients[d] - difference), 1e-8) << info(shape).name;
    }
  }
}

TEST(Basis, OfProductCellsEqualsTheirModalBasis) {
  // The fast path multiplies the factors' bases. The plain path inverts the cell's own Vandermonde matrix.
  for (const Shape shape : {Shape::Quadrilateral, Shape::Prism, Shape::Hexahedron}) {
    for (const int order : {1, 2, 4}) {
      const Points points = uniform_lattice(shape, 3);
      const Eigen::MatrixXd inverse = modal_values(shape, order, nodes(shape, order, NodeSet::Optimised, 3)).inverse();
      const Eigen::MatrixXd values = basis_values(shape, order, NodeSet::Optimised, 3, points);
      EXPECT_LT(largest(values - modal_values(shape, order, points) * inverse), 1e-12) << at(shape, order);
      const auto gradients = basis_gradients(shape, order, NodeSet::Optimised, 3, points);
      const auto modal = modal_gradients(shape, order, points);
      for (std::size_t d = 0; d < modal.size(); ++d)
        EXPECT_LT(largest(gradients[d] - modal[d] * inverse), 1e-12) << at(shape, order);
    }
  }
}

TEST(Basis, OfPyramidsIsTheFacesBasisOnEveryFace) {
  const ShapeInfo& cell = info(Shape::Pyramid);
  for (int order = 1; order <= kMaxOrder; ++order) {
    for (std::size_t f = 0; f < cell.facets.size(); ++f) {
      const Shape face = cell.facets[f].shape;
      Points corners(info(face).vertices, 3);
      for (int v = 0; v < corners.rows(); ++v)
        corners.row(v) = Eigen::Map<const Eigen::RowVector3d>(cell.vertex[cell.facets[f].vertices[v]].data());
      const Points in_face = uniform_lattice(face, 5);
      const Points in_cell = basis_values(face, 1, NodeSet::Equispaced, 3, in_face) * corners;
      Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(in_face.rows(), node_count(Shape::Pyramid, order));
      const Eigen::MatrixXd own = basis_values(face, order, NodeSet::Optimised, 3, in_face);
      const auto& number = facet_nodes(Shape::Pyramid, order, static_cast<int>(f));
      for (std::size_t n = 0; n < number.size(); ++n) expected.col(number[n]) = own.col(n);
      EXPECT_LT(largest(basis_values(Shape::Pyramid, order, NodeSet::Optimised, 3, in_cell) - expected), 1e-11)
          << "order " << order << ", face " << f;
    }
  }
}

TEST(Conversion, ThereAndBackIsTheIdentity) {
  for (const Shape shape : kCells) {
    for (int order = 1; order <= kMaxOrder; ++order) {
      if (shape == Shape::Hexahedron && order > 8) continue;  // It takes seconds and shows nothing new.
      const Eigen::VectorXd start = Power{order + 2}.values(nodes(shape, order, NodeSet::Equispaced, 3));
      const Eigen::VectorXd there = conversion(shape, order, NodeSet::Equispaced, NodeSet::Optimised, 3) * start;
      const Eigen::VectorXd back = conversion(shape, order, NodeSet::Optimised, NodeSet::Equispaced, 3) * there;
      EXPECT_LT(largest(back - start), 1e-12) << at(shape, order);
    }
  }
}

TEST(Conversion, OfPlaneTrianglesUsesTheirOwnNodes) {
  const Eigen::VectorXd start = Power{7}.values(nodes(Shape::Triangle, 7, NodeSet::Equispaced, 2));
  const Eigen::VectorXd there = conversion(Shape::Triangle, 7, NodeSet::Equispaced, NodeSet::Optimised, 2) * start;
  EXPECT_LT(largest(there - Power{7}.values(nodes(Shape::Triangle, 7, NodeSet::Optimised, 2))), 1e-13);
}

TEST(Conversion, StaysInPlaceIfManyThreadsAskAtOnce) {
  std::array<const Eigen::MatrixXd*, 8> found{};
  std::vector<std::thread> threads;
  for (auto& slot : found)
    threads.emplace_back(
        [&slot] { slot = &conversion(Shape::Pyramid, 6, NodeSet::Optimised, NodeSet::Equispaced, 3); });
  for (std::thread& thread : threads) thread.join();
  for (const auto* matrix : found) EXPECT_EQ(matrix, found[0]);
}

TEST(UniformLattice, HoldsTheVerticesAndTheRightNumber) {
  EXPECT_EQ(uniform_lattice(Shape::Triangle, 30).rows(), 31 * 32 / 2);
  EXPECT_EQ(uniform_lattice(Shape::Prism, 12).rows(), 13 * 13 * 14 / 2);
  for (const Shape shape : kCells) {
    const Points points = uniform_lattice(shape, 7);
    for (int v = 0; v < info(shape).vertices; ++v) {
      const Eigen::Map<const Eigen::RowVectorXd> vertex(info(shape).vertex[v].data(), info(shape).dimension);
      const double nearest = (points.rowwise() - vertex).rowwise().norm().minCoeff();
      EXPECT_LT(nearest, shape == Shape::Pyramid && v == 4 ? 1.1e-6 : 1e-15) << info(shape).name;
    }
  }
}

}  // namespace
}  // namespace varimesh::reference
