// Balls of a few tetrahedra that no movement of their inner nodes can make valid, and helpers for them.
#pragma once

#include <Eigen/LU>
#include <cmath>
#include <random>
#include <vector>

#include "core/mesh/changes/change_order.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"

namespace varimesh::testing {

/// Moves every fixed node (fixed_nodes()) onto the unit sphere around the origin.
inline void round_off(HighOrderMesh& mesh) {
  const std::vector<bool> fixed = fixed_nodes(mesh);
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    double* x = mesh.coordinates.data() + 3 * n;
    const double length = std::hypot(x[0], x[1], x[2]);
    for (int c = 0; c < 3 && fixed[n]; ++c) x[c] /= length;
  }
}

inline HighOrderMesh ball_of(std::vector<double> vertices, const std::vector<std::vector<std::int32_t>>& tetrahedra,
                             int order) {
  HighOrderMesh mesh;
  mesh.dimension = 3;
  mesh.order = 1;
  mesh.coordinates = std::move(vertices);
  for (std::size_t n = 0; n < mesh.node_count(); ++n) mesh.node_numbers.push_back(10 + static_cast<std::int64_t>(n));
  mesh.node_blocks = {{3, 1, 0, static_cast<std::int32_t>(mesh.node_count())}};
  mesh.physical_groups = {{3, 1, "near"}, {3, 2, "far"}, {3, 3, "all"}};
  mesh.entities = {{3, 1, {-1, -1, -1, 1, 1, 1}, {1, 3}, {}}, {3, 2, {-1, -1, -1, 1, 1, 1}, {2, 3}, {}}};
  const std::size_t half = tetrahedra.size() / 2;
  for (std::size_t t = 0; t < tetrahedra.size(); ++t) {
    if (t % half == 0) {
      ElementBlock& block = mesh.blocks.emplace_back();
      block.shape = Shape::Tetrahedron;
      block.entity = static_cast<int>(mesh.blocks.size());
      block.physical = {block.entity, 3};
    }
    mesh.blocks.back().numbers.push_back(100 + static_cast<std::int64_t>(t));
    mesh.blocks.back().nodes.insert(mesh.blocks.back().nodes.end(), tetrahedra[t].begin(), tetrahedra[t].end());
  }
  HighOrderMesh curved = *change_order(mesh, order);
  round_off(curved);
  return curved;
}

/// A cube of six tetrahedra around one of its diagonals, rounded off to a ball. Each has two faces on the sphere.
inline HighOrderMesh six_in_a_ball(int order) {
  std::vector<double> vertices;
  for (int n = 0; n < 8; ++n)
    for (const int bit : {1, 2, 4}) vertices.push_back((n & bit) != 0 ? 0.5 : -0.5);
  return ball_of(vertices, {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}}, order);
}

/// Two tetrahedra with one face in common, rounded off to a ball. All their edges lie on the sphere.
inline HighOrderMesh two_in_a_ball(int order) {
  const double s = std::sqrt(0.75);
  return ball_of({1, 0, 0, -0.5, s, 0, -0.5, -s, 0, 0, 0, 1, 0, 0, -1}, {{0, 1, 2, 3}, {0, 2, 1, 4}}, order);
}

/// Moves free nodes at random by up to `far` in each coordinate.
inline void shake(HighOrderMesh& mesh, double far) {
  const std::vector<bool> fixed = fixed_nodes(mesh);
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> push(-far, far);
  for (std::size_t i = 0; i < mesh.coordinates.size(); ++i)
    if (!fixed[i / 3]) mesh.coordinates[i] += push(random);
}

/// ∫ J over the mesh, exact for tetrahedra.
inline double volume(const HighOrderMesh& mesh) {
  const reference::Quadrature rule = reference::quadrature(Shape::Tetrahedron, mesh.order, 3 * mesh.order);
  const auto gradients =
      reference::basis_gradients(Shape::Tetrahedron, mesh.order, reference::NodeSet::Equispaced, 3, rule.points);
  double sum = 0;
  const Cells cells(mesh, 3);
  for (std::size_t c = 0; c < cells.count(); ++c) {
    const auto nodes = cells.nodes(c);
    Eigen::MatrixXd x(static_cast<Eigen::Index>(nodes.size()), 3);
    for (std::size_t n = 0; n < nodes.size(); ++n)
      for (int k = 0; k < 3; ++k)
        x(static_cast<Eigen::Index>(n), k) =
            mesh.coordinates[3 * static_cast<std::size_t>(nodes[n]) + static_cast<std::size_t>(k)];
    for (Eigen::Index q = 0; q < rule.points.rows(); ++q) {
      Eigen::Matrix3d jacobian;
      for (int k = 0; k < 3; ++k) jacobian.row(k) = gradients[static_cast<std::size_t>(k)].row(q) * x;
      sum += rule.weights[q] * jacobian.determinant();
    }
  }
  return sum;
}

}  // namespace varimesh::testing
