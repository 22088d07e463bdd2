#include "core/slide/entity_elements.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <set>

#include "core/reference/basis.h"
#include "core/reference/quadrature.h"

namespace varimesh::detail {
namespace {

/// The weight of all lattice points together, beside 1 for the points of the rule.
constexpr double kLatticeWeight = 0.05;

using reference::NodeSet;
using reference::Points;

reference::Quadrature rule(Shape shape, int order, int degree) {
  if (shape != Shape::Line) return reference::quadrature(shape, order, degree);
  const auto [points, weights] = reference::gauss_jacobi(degree / 2 + 1, 0, 0);
  return {Points(points), weights, degree + 1};
}

/// The points where distances are measured.
void add_between(EntityTable& table, Shape shape, int order) {
  const reference::Quadrature squares = rule(shape, order, 2 * order + 4);
  const Points lattice = reference::uniform_lattice(shape, 2 * order + 1);
  const Points finer = reference::uniform_lattice(shape, 4 * (2 * order + 1));
  Points at(squares.points.rows() + lattice.rows(), lattice.cols());
  at << squares.points, lattice;
  table.between = reference::basis_values(shape, order, NodeSet::Equispaced, 3, at);
  table.finer = reference::basis_values(shape, order, NodeSet::Equispaced, 3, finer);
  table.weights_between = squares.weights / squares.weights.sum();
  table.finer_at = finer;
  // The reference shape is 2 wide. With half an interval, points beside an edge on which the distance vanishes would be
  // left out.
  const double near = 2.02 / (2 * order + 1);
  table.finer_step = near / 4;
  const auto distance = [](const auto& a, const auto& b) { return (a - b).cwiseAbs().maxCoeff(); };
  for (Eigen::Index p = 0; p < lattice.rows(); ++p) {
    std::vector<Eigen::Index>& around = table.around.emplace_back();
    for (Eigen::Index q = 0; q < finer.rows(); ++q)
      if (distance(finer.row(q), lattice.row(p)) < near) around.push_back(q);
    std::ranges::swap(around.front(), *std::ranges::min_element(around, {}, [&](Eigen::Index q) {
                        return distance(finer.row(q), lattice.row(p));
                      }));
    std::vector<Eigen::Index>& beside = table.beside.emplace_back();
    for (Eigen::Index q = 0; q < lattice.rows(); ++q)
      if (q != p && distance(lattice.row(q), lattice.row(p)) < near) beside.push_back(q);
  }
}

EntityTable make_table(Shape shape, int order) {
  const reference::Quadrature of = rule(shape, order, 2 * order);
  const Points corners = reference::uniform_lattice(shape, order);
  Points at(of.points.rows() + corners.rows(), of.points.cols());
  at << of.points, corners;
  EntityTable table;
  table.values = reference::basis_values(shape, order, NodeSet::Equispaced, 3, at);
  for (const Eigen::MatrixXd& by_point : reference::basis_gradients(shape, order, NodeSet::Equispaced, 3, at))
    table.derivatives.push_back(by_point.transpose());
  table.straight = reference::basis_gradients(shape, 1, NodeSet::Equispaced, 3, at);
  table.weights.resize(at.rows());
  table.weights << of.weights / of.weights.sum(),
      Eigen::VectorXd::Constant(corners.rows(), kLatticeWeight / static_cast<double>(corners.rows()));
  add_between(table, shape, order);
  return table;
}

bool lies_on(const EntityElement& edge, int curve, const Association& association) {
  const std::vector<int>& ends = association.geometry.curves[static_cast<std::size_t>(curve)].vertices;
  for (std::size_t k = 0; k < edge.nodes.size(); ++k) {
    const NodeEntity& entity = association.nodes[static_cast<std::size_t>(edge.nodes[k])];
    const bool on = entity.dimension == 1 && entity.entity == curve;
    const bool end = k < 2 && entity.dimension == 0 && std::ranges::find(ends, entity.entity) != ends.end();
    if (!on && !end) return false;
  }
  return true;
}

/// The edges of a mesh of order 1 that lie on curves: those where two surfaces meet or one ends, if both ends lie on a
/// curve that bounds these surfaces. Edges between two vertices do not count, because nothing slides there.
void add_straight_edges(const HighOrderMesh& mesh, const Association& association,
                        std::vector<std::vector<EntityElement>>& elements) {
  std::map<std::pair<std::int32_t, std::int32_t>, std::vector<int>> edges;
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const ElementBlock& block = mesh.blocks[b];
    const std::vector<int>& surfaces = association.surface_of_element[b];
    if (block.order > 1 || surfaces.empty()) continue;
    const auto vertices = static_cast<std::size_t>(reference::info(block.shape).vertices);
    for (std::size_t e = 0; e < surfaces.size(); ++e)
      for (std::size_t k = 0; k < vertices; ++k)
        edges[std::minmax(block.nodes[e * vertices + k], block.nodes[e * vertices + (k + 1) % vertices])].push_back(
            surfaces[e]);
  }
  for (const auto& [ends, surfaces] : edges) {
    if (surfaces.size() > 1 && std::ranges::count(surfaces, surfaces.front()) == std::ssize(surfaces)) continue;
    const EntityElement edge{Shape::Line, {ends.first, ends.second}, 0};
    for (const std::int32_t end : edge.nodes) {
      const NodeEntity& entity = association.nodes[static_cast<std::size_t>(end)];
      if (entity.dimension != 1 || !lies_on(edge, entity.entity, association)) continue;
      const std::vector<int>& around = association.geometry.curves[static_cast<std::size_t>(entity.entity)].surfaces;
      if (std::ranges::any_of(surfaces, [&](int s) { return std::ranges::find(around, s) == around.end(); })) continue;
      elements[static_cast<std::size_t>(entity.entity)].push_back(edge);
      break;
    }
  }
}

}  // namespace

std::vector<std::vector<EntityElement>> curve_elements(const HighOrderMesh& mesh, const Association& association) {
  std::vector<std::vector<EntityElement>> elements(association.geometry.curves.size());
  add_straight_edges(mesh, association, elements);
  std::set<std::pair<std::int32_t, std::int32_t>> seen;
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const ElementBlock& block = mesh.blocks[b];
    const std::vector<int>& surfaces = association.surface_of_element[b];
    if (block.order < 2) continue;
    const auto stride = static_cast<std::size_t>(reference::node_count(block.shape, block.order));
    const auto facets = static_cast<int>(reference::info(block.shape).facets.size());
    for (std::size_t e = 0; e < surfaces.size(); ++e)
      for (int facet = 0; facet < facets && surfaces[e] >= 0; ++facet) {
        EntityElement edge;
        for (const int local : reference::facet_nodes(block.shape, block.order, facet))
          edge.nodes.push_back(block.nodes[e * stride + static_cast<std::size_t>(local)]);
        const NodeEntity& middle = association.nodes[static_cast<std::size_t>(edge.nodes[2])];
        if (middle.dimension != 1 || !lies_on(edge, middle.entity, association)) continue;
        if (!seen.emplace(std::minmax(edge.nodes[0], edge.nodes[1])).second) continue;
        elements[static_cast<std::size_t>(middle.entity)].push_back(std::move(edge));
      }
  }
  return elements;
}

std::vector<std::vector<EntityElement>> surface_elements(const HighOrderMesh& mesh, const Association& association) {
  std::vector<std::vector<EntityElement>> elements(association.geometry.surfaces.size());
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const ElementBlock& block = mesh.blocks[b];
    const std::vector<int>& surfaces = association.surface_of_element[b];
    const auto stride = static_cast<std::size_t>(reference::node_count(block.shape, block.order));
    for (std::size_t e = 0; e < surfaces.size(); ++e) {
      if (surfaces[e] < 0) continue;
      EntityElement element{block.shape, {}, block.entity};
      element.nodes.assign(block.nodes.begin() + static_cast<std::ptrdiff_t>(e * stride),
                           block.nodes.begin() + static_cast<std::ptrdiff_t>((e + 1) * stride));
      elements[static_cast<std::size_t>(surfaces[e])].push_back(std::move(element));
    }
  }
  return elements;
}

const EntityTable& entity_table(Shape shape, int order) {
  static std::mutex mutex;
  static std::map<std::pair<Shape, int>, EntityTable> tables;
  const std::scoped_lock lock(mutex);
  const auto [at, is_new] = tables.try_emplace({shape, order});
  if (is_new) at->second = make_table(shape, order);
  return at->second;
}

}  // namespace varimesh::detail
