#include "core/layers/grow/elastic_move.h"

#include <Eigen/Dense>
#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "core/base/index.h"
#include "core/layers/facet_table.h"

namespace varimesh::detail {
namespace {

using Vector = Eigen::Vector3d;
using Corners = std::vector<std::vector<int>>;

/// Lamé's constants for a Poisson ratio of 0.3 and a Young's modulus of 1.
constexpr double kLambda = 0.577, kMu = 0.385;
/// A cell is crushed if less than this share of its quality is left.
constexpr double kCrushed = 0.15;
/// In one step a vertex is pushed by at most this share of the height of the cells around it.
constexpr double kShareOfHeight = 0.3;
constexpr int kMostSteps = 24;
/// Linear systems are solved to this share of their first residual: the places need not be exact.
constexpr double kForcing = 1e-4;

double determinant(const std::array<Vector, 3>& edges, int dimension) {
  return dimension == 2 ? edges[0].cross(edges[1])[2] : edges[0].cross(edges[1]).dot(edges[2]);
}

/// The simplices at the corners of a shape, positive in the reference cell: at each vertex with as many edges as the
/// shape has dimensions. A simplex is its own only corner.
Corners corners_of(Shape shape) {
  const reference::ShapeInfo& info = reference::info(shape);
  Corners corners;
  const bool is_simplex = shape == Shape::Triangle || shape == Shape::Tetrahedron;
  for (int v = 0; v < (is_simplex ? 1 : info.vertices); ++v) {
    std::vector<int> corner{v};
    for (const auto& edge : info.edges)
      if (edge[0] == v || edge[1] == v) corner.push_back(edge[0] == v ? edge[1] : edge[0]);
    if (static_cast<int>(corner.size()) != info.dimension + 1) continue;
    std::array<Vector, 3> edges{};
    for (int d = 0; d < info.dimension; ++d)
      for (int c = 0; c < 3; ++c)
        edges[at(d)][c] = info.vertex[at(corner[at(d + 1)])][at(c)] - info.vertex[at(v)][at(c)];
    if (determinant(edges, info.dimension) < 0) std::swap(corner[1], corner[2]);
    corners.push_back(std::move(corner));
  }
  return corners;
}

}  // namespace

ElasticMove::ElasticMove(const HighOrderMesh& mesh, const Freedoms& freedoms)
    : freedoms_(freedoms), dimension_(mesh.dimension) {
  for (std::size_t n = 0; n < mesh.node_count(); ++n) came_.push_back(point(mesh, static_cast<std::int32_t>(n)));
  const Cells cells(mesh, dimension_);
  std::array<Corners, kShapes> of_shape;
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    Corners& corners = of_shape[static_cast<std::size_t>(cells.shape(cell))];
    if (corners.empty()) corners = corners_of(cells.shape(cell));
    for (const std::vector<int>& local : corners) {
      Corner corner;
      for (std::size_t v = 0; v < local.size(); ++v) corner.nodes[v] = cells.nodes(cell)[at(local[v])];
      corner.weight = 1.0 / static_cast<double>(corners.size());
      corner.quality = quality(corner, came_);
      corners_.push_back(corner);
    }
  }
}

double ElasticMove::quality(const Corner& corner, const Places& places) const {
  std::array<Vector, 3> edges{};
  double size = 0;
  for (int a = 0; a <= dimension_; ++a)
    for (int b = 0; b < a; ++b) {
      const Vector edge = places[at(corner.nodes[at(a)])] - places[at(corner.nodes[at(b)])];
      size += edge.squaredNorm();
      if (b == 0) edges[at(a - 1)] = edge;
    }
  return determinant(edges, dimension_) / std::pow(size, 0.5 * dimension_);
}

std::vector<double> ElasticMove::heights() const {
  std::vector<double> height(came_.size(), std::numeric_limits<double>::infinity());
  for (const Corner& corner : corners_)
    for (int v = 0; v <= dimension_; ++v) {
      const auto x = [&](int k) { return came_[at(corner.nodes[at((v + k) % (dimension_ + 1))])]; };
      const Vector normal =
          dimension_ == 2 ? Vector((x(2) - x(1)).cross(Vector(0, 0, 1))) : Vector((x(2) - x(1)).cross(x(3) - x(1)));
      double& least = height[at(corner.nodes[at(v)])];
      least = std::min(least, std::abs(normal.normalized().dot(x(0) - x(1))));
    }
  return height;
}

int ElasticMove::steps(std::span<const Push> pushes) const {
  const std::vector<double> height = heights();
  double most = 1;
  for (const Push& push : pushes) most = std::max(most, push.by.norm() / (kShareOfHeight * height[at(push.vertex)]));
  return static_cast<int>(std::ceil(std::min<double>(most, kMostSteps)));
}

ElasticMove::Outcome ElasticMove::move(std::span<const Push> pushes, const StopToken* stop) const {
  Outcome outcome;
  Places places = came_;
  const int count = steps(pushes);
  for (int step = 0; step < count && outcome.crushed.empty(); ++step) {
    look(stop);
    this->step(pushes, 1.0 / count, places);
    std::set<std::int32_t> crushed;
    for (const Corner& corner : corners_)
      if (corner.quality > 0 && !(quality(corner, places) > kCrushed * corner.quality))
        crushed.insert(corner.nodes.begin(), corner.nodes.begin() + dimension_ + 1);
    outcome.crushed.assign(crushed.begin(), crushed.end());
  }
  for (std::size_t n = 0; n < places.size(); ++n) outcome.displacements.emplace_back(places[n] - came_[n]);
  return outcome;
}

/// The equations of a step.
struct ElasticMove::System {
  Places pushed;  ///< By node.
  std::vector<char> is_pushed;
  std::vector<int> first;  ///< By node: the number of its first unknown, or −1.
  int unknowns = 0;
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::VectorXd right;
};

/// The unknowns of a vertex are its displacements along its freedoms. Vertices that move alike share theirs.
void ElasticMove::number(System& system) const {
  system.first.assign(came_.size(), -1);
  for (const Corner& corner : corners_)
    for (int v = 0; v <= dimension_; ++v) {
      const std::int32_t node = corner.nodes[at(v)], master = freedoms_.master(node);
      if (system.is_pushed[at(node)] != 0) continue;
      if (system.first[at(master)] < 0) {
        system.first[at(master)] = system.unknowns;
        system.unknowns += freedoms_.of(master).count;
      }
      system.first[at(node)] = system.first[at(master)];
    }
  system.right = Eigen::VectorXd::Zero(system.unknowns);
}

void ElasticMove::add(const Corner& corner, const Places& places, System& system) const {
  Eigen::Matrix3d edges = Eigen::Matrix3d::Identity();
  for (int v = 1; v <= dimension_; ++v)
    edges.col(v - 1) = places[at(corner.nodes[at(v)])] - places[at(corner.nodes[0])];
  const Eigen::Matrix3d inverse = edges.inverse();
  if (!inverse.allFinite()) return;
  std::array<Vector, 4> gradients{Vector::Zero(), Vector::Zero(), Vector::Zero(), Vector::Zero()};
  for (int v = 1; v <= dimension_; ++v) {
    gradients[at(v)] = inverse.row(v - 1);
    gradients[0] -= gradients[at(v)];
  }
  for (int a = 0; a <= dimension_; ++a)
    for (int b = 0; b <= dimension_; ++b) {
      const std::int32_t row = corner.nodes[at(a)], column = corner.nodes[at(b)];
      if (system.is_pushed[at(row)] != 0) continue;
      const Vector &g = gradients[at(a)], &h = gradients[at(b)];
      const Eigen::Matrix3d stiffness = corner.weight * (kLambda * g * h.transpose() + kMu * h * g.transpose() +
                                                         kMu * g.dot(h) * Eigen::Matrix3d::Identity());
      const Freedom &of_row = freedoms_.of(row), &of_column = freedoms_.of(column);
      for (int i = 0; i < of_row.count; ++i) {
        const int equation = system.first[at(row)] + i;
        const Vector force = stiffness.transpose() * of_row.along[at(i)];
        if (system.is_pushed[at(column)] != 0) system.right[equation] -= force.dot(system.pushed[at(column)]);
        for (int j = 0; system.is_pushed[at(column)] == 0 && j < of_column.count; ++j)
          system.entries.emplace_back(equation, system.first[at(column)] + j, force.dot(of_column.along[at(j)]));
      }
    }
}

void ElasticMove::step(std::span<const Push> pushes, double share, Places& places) const {
  System system;
  system.pushed.assign(places.size(), Vector::Zero());
  system.is_pushed.assign(places.size(), 0);
  for (const Push& push : pushes) {
    system.pushed[at(push.vertex)] = share * push.by;
    system.is_pushed[at(push.vertex)] = 1;
  }
  number(system);
  for (const Corner& corner : corners_) add(corner, places, system);
  Eigen::VectorXd found(system.unknowns);
  if (system.unknowns > 0) {
    Eigen::SparseMatrix<double> matrix(system.unknowns, system.unknowns);
    matrix.setFromTriplets(system.entries.begin(), system.entries.end());
    Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower | Eigen::Upper> solver;
    solver.setTolerance(kForcing);
    found = solver.compute(matrix).solve(system.right);
  }
  for (std::size_t n = 0; n < places.size(); ++n) {
    places[n] += system.pushed[n];
    const Freedom& freedom = freedoms_.of(static_cast<std::int32_t>(n));
    for (int i = 0; system.first[n] >= 0 && i < freedom.count; ++i)
      places[n] += found[system.first[n] + i] * freedom.along[at(i)];
  }
}

}  // namespace varimesh::detail
