#include "core/mesh/changes/simplex_blend.h"

#include <array>
#include <cmath>
#include <utility>

#include "core/base/index.h"
#include "core/reference/basis.h"
#include "core/reference/cache.h"

namespace varimesh::detail {
namespace {

using reference::NodeSet;
using Barycentric = std::array<double, 4>;

/// The nodes of an edge from its first vertex to its second, both included.
std::vector<int> nodes_along(const Eigen::MatrixXd& linear, int a, int b, int order) {
  std::vector<int> nodes(at(order) + 1, -1);
  for (Eigen::Index n = 0; n < linear.rows(); ++n)
    if (linear(n, a) + linear(n, b) > 1 - 1e-9) nodes[at(std::lround(linear(n, b) * order))] = static_cast<int>(n);
  return nodes;
}

/// Adds factor × the contribution of the edge between vertices a and b at λ to a row of weights on nodes.
void add_edge(const Eigen::MatrixXd& linear, int a, int b, int order, const Barycentric& lambda, double factor,
              Eigen::Ref<Eigen::RowVectorXd, 0, Eigen::InnerStride<>> row) {
  const double t = (1 + lambda[at(b)] - lambda[at(a)]) / 2;
  reference::Points point(1, 1);
  point(0, 0) = 2 * t - 1;
  const Eigen::MatrixXd values = reference::basis_values(Shape::Line, order, NodeSet::Equispaced, 3, point);
  const std::vector<int> nodes = nodes_along(linear, a, b, order);
  // Gmsh lists a line's two ends, then the inner nodes from the first to the last. The ends do not deviate.
  for (int i = 1; i < order; ++i)
    row[nodes[at(i)]] += factor * lambda[at(a)] * lambda[at(b)] / (t * (1 - t)) * values(0, i + 1);
}

Barycentric at_node(const Eigen::MatrixXd& linear, int node) {
  Barycentric lambda{};
  for (Eigen::Index v = 0; v < linear.cols(); ++v) lambda[at(v)] = linear(node, v);
  return lambda;
}

void sort_nodes(Shape shape, int order, SimplexBlend& result) {
  const auto& info = reference::info(shape);
  const auto& places = reference::node_places(shape, order);
  const auto& lattice = reference::lattice(shape, order);
  const auto nodes = static_cast<Eigen::Index>(places.size());
  result.edges.resize(info.edges.size());
  result.faces.resize(info.faces.size());
  result.linear.setZero(nodes, info.vertices);
  for (Eigen::Index n = 0; n < nodes; ++n) {
    result.linear(n, 0) = 1;
    for (int v = 1; v < info.vertices; ++v) {
      result.linear(n, v) = static_cast<double>(lattice[at(n)][at(v - 1)]) / order;
      result.linear(n, 0) -= result.linear(n, v);
    }
    const auto place = places[at(n)];
    if (place.dimension == 1) result.edges[at(place.index)].push_back(static_cast<int>(n));
    if (place.dimension == 2) result.faces[at(place.index)].push_back(static_cast<int>(n));
    if (place.dimension == 3) result.inside.push_back(static_cast<int>(n));
  }
}

void blend_faces(Shape shape, int order, SimplexBlend& result) {
  const auto& info = reference::info(shape);
  const Eigen::MatrixXd& linear = result.linear;
  for (std::size_t f = 0; f < info.faces.size(); ++f) {
    const auto& v = info.faces[f].vertices;
    Eigen::MatrixXd& matrix = result.on_face.emplace_back();
    matrix.setZero(static_cast<Eigen::Index>(result.faces[f].size()), linear.rows());
    for (std::size_t i = 0; i < result.faces[f].size(); ++i)
      for (std::size_t k = 0; k < 3; ++k)
        add_edge(linear, v[k], v[(k + 1) % 3], order, at_node(linear, result.faces[f][i]), 1,
                 matrix.row(static_cast<Eigen::Index>(i)));
  }
}

void blend_inside(Shape shape, int order, SimplexBlend& result) {
  const auto& info = reference::info(shape);
  const Eigen::MatrixXd& linear = result.linear;
  result.in_cell.setZero(static_cast<Eigen::Index>(result.inside.size()), linear.rows());
  for (std::size_t i = 0; i < result.inside.size(); ++i) {
    const Barycentric lambda = at_node(linear, result.inside[i]);
    auto row = result.in_cell.row(static_cast<Eigen::Index>(i));
    for (const auto& edge : info.edges) add_edge(linear, edge[0], edge[1], order, lambda, 1, row);
    for (std::size_t f = 0; f < info.facets.size(); ++f) {
      const auto& v = info.facets[f].vertices;
      Barycentric mu{};
      double factor = 1, on_face = 0;
      for (std::size_t k = 0; k < 3; ++k) on_face += lambda[at(v[k])];
      for (std::size_t k = 0; k < 3; ++k) {
        mu[at(v[k])] = lambda[at(v[k])] + (1 - on_face) / 3;
        factor *= lambda[at(v[k])] / mu[at(v[k])];
      }
      reference::Points point(1, 2);
      point << 2 * mu[at(v[1])] - 1, 2 * mu[at(v[2])] - 1;
      const Eigen::MatrixXd values = reference::basis_values(Shape::Triangle, order, NodeSet::Equispaced, 3, point);
      const std::vector<int>& local = reference::facet_nodes(shape, order, static_cast<int>(f));
      for (std::size_t n = 0; n < local.size(); ++n) row[local[n]] += factor * values(0, static_cast<Eigen::Index>(n));
      for (std::size_t k = 0; k < 3; ++k) add_edge(linear, v[k], v[(k + 1) % 3], order, mu, -factor, row);
    }
  }
}

SimplexBlend make_blend(Shape shape, int order) {
  SimplexBlend result;
  sort_nodes(shape, order, result);
  blend_faces(shape, order, result);
  blend_inside(shape, order, result);
  return result;
}

}  // namespace

const SimplexBlend& simplex_blend(Shape shape, int order) {
  static reference::Cache<std::pair<Shape, int>, SimplexBlend> cache;
  return cache.get({shape, order}, [&] { return make_blend(shape, order); });
}

}  // namespace varimesh::detail
