#include "core/problem/sizes.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/base/index.h"
#include "core/reference/basis.h"

namespace varimesh {
namespace {

/// The thinnest boundary layers have cells some 1e5 times longer than thick. What is thinner has no volume.
constexpr double kThinnest = 1e-6;
constexpr std::int32_t kCellsPerTask = 1024, kNodesPerTask = 16384;

/// The mean of the vertices of a reference cell, 1 × dimension.
reference::Points middle(const reference::ShapeInfo& shape) {
  reference::Points at = reference::Points::Zero(1, shape.dimension);
  for (int v = 0; v < shape.vertices; ++v)
    for (int k = 0; k < shape.dimension; ++k) at(0, k) += shape.vertex[v][k] / shape.vertices;
  return at;
}

/// For each facet the gradient of the linear function that is 0 on it and 1 at the farthest vertex of the reference
/// cell: facets × d.
template <int d>
Eigen::Matrix<double, Eigen::Dynamic, d> facet_gradients(const reference::ShapeInfo& shape) {
  Eigen::Matrix<double, Eigen::Dynamic, d> out(static_cast<Eigen::Index>(shape.facets.size()), d);
  const auto vertex = [&](int v) { return Eigen::Map<const Eigen::Vector3d>(shape.vertex[v].data()); };
  for (std::size_t f = 0; f < shape.facets.size(); ++f) {
    const auto& corners = shape.facets[f].vertices;
    const Eigen::Vector3d first = vertex(corners[0]), along = vertex(corners[1]) - first;
    const Eigen::Vector3d second = d == 3 ? Eigen::Vector3d(vertex(corners[2]) - first) : Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d normal = along.cross(second).normalized();
    double farthest = 0;
    for (int v = 0; v < shape.vertices; ++v) farthest = std::max(farthest, std::abs(normal.dot(vertex(v) - first)));
    out.row(static_cast<Eigen::Index>(f)) = normal.head<d>() / farthest;
  }
  return out;
}

template <int d>
void set_sizes_of(Problem& problem, const CellSet& set, const Team& team) {
  const reference::ShapeInfo& shape = reference::info(set.shape);
  const auto facets = facet_gradients<d>(shape);
  const auto slopes = reference::basis_gradients(set.shape, 1, reference::NodeSet::Equispaced, d, middle(shape));
  team.for_each(set.count, kCellsPerTask, [&](std::int32_t cell) {
    const std::int32_t* nodes = set.nodes.data() + static_cast<std::size_t>(cell) * set.nodes_per_cell;
    const auto position = [&](int v) {
      return Eigen::Map<const Eigen::Matrix<double, d, 1>>(problem.positions.data() + at(nodes[v]) * d);
    };
    Eigen::Matrix<double, d, 1> mean = Eigen::Matrix<double, d, 1>::Zero();
    Eigen::Matrix<double, d, d> gradient = Eigen::Matrix<double, d, d>::Zero();
    for (int v = 0; v < shape.vertices; ++v) {
      mean += position(v) / shape.vertices;
      for (int k = 0; k < d; ++k) gradient.col(k) += slopes[k](0, v) * position(v);
    }
    double reach = 0;
    for (int v = 0; v < shape.vertices; ++v) reach = std::max(reach, (position(v) - mean).norm());
    // The rows are the gradients of the facets' linear functions in space; the steepest one has the shortest height.
    const double steepest = (facets * gradient.inverse()).rowwise().norm().maxCoeff();
    const double height = std::isfinite(steepest) && steepest > 0 ? 1 / steepest : 0;
    problem.cell_size[at(set.first + cell)] = static_cast<float>(std::max(height, kThinnest * reach));
  });
}

}  // namespace

void set_sizes(Problem& problem, const Team& team) {
  problem.cell_size.resize(at(problem.cells));
  for (const CellSet& set : problem.sets)
    problem.dimension == 2 ? set_sizes_of<2>(problem, set, team) : set_sizes_of<3>(problem, set, team);
  problem.inverse_size.resize(problem.free.size());
  team.for_each(static_cast<std::int32_t>(problem.free.size()), kNodesPerTask, [&](std::int32_t rank) {
    float largest = 0;
    for (std::int64_t i = problem.offsets[at(rank)]; i < problem.offsets[at(rank) + 1]; ++i) {
      const Incidence& incidence = problem.incidences[at(i)];
      largest = std::max(largest, 1 / problem.cell_size[at(problem.sets[at(incidence.set)].first + incidence.cell)]);
    }
    problem.inverse_size[at(rank)] = largest;
  });
}

}  // namespace varimesh
