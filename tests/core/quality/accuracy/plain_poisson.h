// Poisson's equation on a high-order mesh, solved in the plainest way: isoparametric elements on the mesh's own nodes,
// one sparse factor. For tests of what a mesh costs a solver. tests/bench/solve/poisson.py does the same with DOLFINx.
#pragma once

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <vector>

#include "core/mesh/high_order_mesh.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"

namespace varimesh::testing {

struct SolverErrors {
  double in_value = 0;     ///< Error in L².
  double in_gradient = 0;  ///< Error in the seminorm of H¹.
};

/// The root mean square errors over the exact solutions sin(k n·x + φ) with k = 4 V^(−1/d): four directions n, φ = 0
/// and π/2. Boundary nodes have the exact values.
class PlainPoisson {
 public:
  explicit PlainPoisson(const HighOrderMesh& mesh) : mesh_(mesh), d_(mesh.dimension) {
    for (const ElementBlock& block : mesh.blocks)
      if (reference::info(block.shape).dimension == d_) add_points(block);
    find_boundary();
  }

  SolverErrors errors() const {
    double volume = 0;
    for (const Point& point : points_) volume += point.weight;
    const double k = 4 / std::pow(volume, 1.0 / d_);
    std::vector<Eigen::VectorXd> directions;
    for (int i = 0; i < 4; ++i) {
      const double angle = std::numbers::pi * (0.125 + 0.25 * i);
      if (d_ == 2) directions.emplace_back(Eigen::Vector2d(std::cos(angle), std::sin(angle)));
      if (d_ == 3)
        directions.emplace_back(Eigen::Vector3d(i == 1 ? -1 : 1, i == 2 ? -1 : 1, i == 3 ? -1 : 1) / std::sqrt(3.0));
    }
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(stiffness());
    double value = 0, gradient = 0;
    for (const Eigen::VectorXd& direction : directions)
      for (const double phase : {0.0, std::numbers::pi / 2}) {
        const auto [in_value, in_gradient] = squared_errors(factor, k * direction, phase);
        value += in_value / 8;
        gradient += in_gradient / 8;
      }
    return {std::sqrt(value), std::sqrt(gradient)};
  }

 private:
  /// A point of quadrature in one cell.
  struct Point {
    const std::int32_t* nodes;  ///< Of the cell.
    double weight;              ///< Times |det ∇χ|.
    Eigen::VectorXd x, values;  ///< Physical coordinates; shape functions.
    Eigen::MatrixXd gradients;  ///< Physical gradients of the shape functions: nodes × d.
  };

  void add_points(const ElementBlock& block) {
    const int nodes = reference::node_count(block.shape, block.order);
    const reference::Quadrature rule = reference::quadrature(block.shape, block.order, 2 * block.order + 6);
    const auto set = reference::NodeSet::Equispaced;
    const Eigen::MatrixXd values = reference::basis_values(block.shape, block.order, set, d_, rule.points);
    const auto gradients = reference::basis_gradients(block.shape, block.order, set, d_, rule.points);
    for (std::size_t cell = 0; cell < block.size(); ++cell) {
      const std::int32_t* const list = block.nodes.data() + cell * static_cast<std::size_t>(nodes);
      Eigen::MatrixXd x(nodes, d_);
      for (int n = 0; n < nodes; ++n) x.row(n) = node(list[n]).transpose();
      for (Eigen::Index q = 0; q < rule.weights.size(); ++q) {
        Eigen::MatrixXd reference_gradients(nodes, d_);
        for (int r = 0; r < d_; ++r)
          reference_gradients.col(r) = gradients[static_cast<std::size_t>(r)].row(q).transpose();
        const Eigen::MatrixXd jacobian = x.transpose() * reference_gradients;
        points_.push_back({list, rule.weights[q] * std::abs(jacobian.determinant()),
                           x.transpose() * values.row(q).transpose(), values.row(q).transpose(),
                           reference_gradients * jacobian.inverse()});
      }
    }
  }

  /// Nodes on facets that one cell has.
  void find_boundary() {
    std::map<std::set<std::int32_t>, int> cells_of;
    const auto facets = [&](const auto& visit) {
      for (const ElementBlock& block : mesh_.blocks) {
        const reference::ShapeInfo& shape = reference::info(block.shape);
        if (shape.dimension != d_) continue;
        const auto nodes = static_cast<std::size_t>(reference::node_count(block.shape, block.order));
        for (std::size_t cell = 0; cell < block.size(); ++cell)
          for (std::size_t facet = 0; facet < shape.facets.size(); ++facet) {
            std::set<std::int32_t> on_facet;
            for (const int n : reference::facet_nodes(block.shape, block.order, static_cast<int>(facet)))
              on_facet.insert(block.nodes[cell * nodes + static_cast<std::size_t>(n)]);
            visit(on_facet);
          }
      }
    };
    facets([&](const std::set<std::int32_t>& facet) { ++cells_of[facet]; });
    is_fixed_.assign(mesh_.node_count(), true);  // nodes that no cell has stay as they are
    for (const Point& point : points_)
      for (Eigen::Index n = 0; n < point.values.size(); ++n)
        is_fixed_[static_cast<std::size_t>(point.nodes[n])] = false;
    for (const auto& [facet, cells] : cells_of)
      if (cells == 1)
        for (const std::int32_t n : facet) is_fixed_[static_cast<std::size_t>(n)] = true;
  }

  /// The stiffness matrix with unit rows and columns of fixed nodes.
  Eigen::SparseMatrix<double> stiffness() const {
    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t n = 0; n < is_fixed_.size(); ++n)
      if (is_fixed_[n]) entries.emplace_back(n, n, 1.0);
    for (const Point& point : points_)
      for (Eigen::Index m = 0; m < point.values.size(); ++m)
        for (Eigen::Index n = 0; n < point.values.size(); ++n)
          if (!fixed(point, m) && !fixed(point, n))
            entries.emplace_back(point.nodes[m], point.nodes[n],
                                 point.weight * point.gradients.row(m).dot(point.gradients.row(n)));
    const auto size = static_cast<Eigen::Index>(is_fixed_.size());
    Eigen::SparseMatrix<double> matrix(size, size);
    matrix.setFromTriplets(entries.begin(), entries.end());
    return matrix;
  }

  template <class Factor>
  std::array<double, 2> squared_errors(const Factor& factor, const Eigen::VectorXd& k, double phase) const {
    const auto size = static_cast<Eigen::Index>(is_fixed_.size());
    Eigen::VectorXd right = Eigen::VectorXd::Zero(size);
    for (Eigen::Index n = 0; n < size; ++n)
      if (is_fixed_[static_cast<std::size_t>(n)])
        right[n] = std::sin(k.dot(node(static_cast<std::int32_t>(n))) + phase);
    const Eigen::VectorXd on_boundary = right;
    for (const Point& point : points_) {
      const double source = k.squaredNorm() * std::sin(k.dot(point.x) + phase);
      const Eigen::VectorXd lifted = point.gradients.transpose() * local(point, on_boundary);
      for (Eigen::Index n = 0; n < point.values.size(); ++n)
        if (!fixed(point, n))
          right[point.nodes[n]] += point.weight * (source * point.values[n] - point.gradients.row(n).dot(lifted));
    }
    const Eigen::VectorXd found = factor.solve(right);
    std::array<double, 2> squares{};
    for (const Point& point : points_) {
      const Eigen::VectorXd u = local(point, found);
      const double at = k.dot(point.x) + phase, difference = u.dot(point.values) - std::sin(at);
      squares[0] += point.weight * difference * difference;
      squares[1] += point.weight * (point.gradients.transpose() * u - k * std::cos(at)).squaredNorm();
    }
    return squares;
  }

  Eigen::VectorXd node(std::int32_t n) const {
    return Eigen::Map<const Eigen::VectorXd>(mesh_.coordinates.data() + 3 * static_cast<std::size_t>(n), d_);
  }
  bool fixed(const Point& point, Eigen::Index n) const { return is_fixed_[static_cast<std::size_t>(point.nodes[n])]; }
  static Eigen::VectorXd local(const Point& point, const Eigen::VectorXd& all) {
    Eigen::VectorXd of_cell(point.values.size());
    for (Eigen::Index n = 0; n < of_cell.size(); ++n) of_cell[n] = all[point.nodes[n]];
    return of_cell;
  }

  const HighOrderMesh& mesh_;
  int d_;
  std::vector<Point> points_;
  std::vector<bool> is_fixed_;
};

}  // namespace varimesh::testing
