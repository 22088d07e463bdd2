#include "core/association/boundary_parts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "core/geometry/element_map.h"
#include "core/mesh/connectivity.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

std::size_t index(std::int32_t i) { return static_cast<std::size_t>(i); }

Eigen::Vector2d vertex(Shape shape, int k) {
  const auto& x = reference::info(shape).vertex[static_cast<std::size_t>(k)];
  return {x[0], x[1]};
}

std::vector<std::int32_t> edge_nodes(const BoundaryFacet& facet, int order, int edge) {
  std::vector<std::int32_t> nodes;
  for (const int local : reference::facet_nodes(facet.shape, order, edge)) nodes.push_back(facet.nodes[index(local)]);
  return nodes;
}

/// The cell that a facet is one of.
std::size_t cell_of(const Facets& of, std::int32_t facet) {
  return static_cast<std::size_t>(std::ranges::upper_bound(of.first, facet) - of.first.begin()) - 1;
}

/// The same line from its other end.
void turn(std::vector<std::int32_t>& line) {
  std::swap(line[0], line[1]);
  std::reverse(line.begin() + 2, line.end());
}

}  // namespace

BoundaryParts::BoundaryParts(const HighOrderMesh& mesh, double angle, const Team& team) : mesh_(mesh), angle_(angle) {
  held.assign(mesh.node_count(), false);
  if (mesh.dimension == 3)
    find_facets_of_volume(team);
  else
    find_facets_of_surface();
  find_edges();
  find_smooth_edges(team);
  find_surfaces();
  find_lines();
  find_corners();
  find_chains();
}

Eigen::Vector3d BoundaryParts::position(std::int32_t node) const {
  return Eigen::Map<const Eigen::Vector3d>(&mesh_.coordinates[3 * index(node)]);
}

Eigen::Matrix3Xd BoundaryParts::positions(const std::vector<std::int32_t>& nodes) const {
  Eigen::Matrix3Xd x(3, static_cast<Eigen::Index>(nodes.size()));
  for (std::size_t k = 0; k < nodes.size(); ++k) x.col(static_cast<Eigen::Index>(k)) = position(nodes[k]);
  return x;
}

// ===== Facets =====

void BoundaryParts::find_facets_of_volume(const Team& team) {
  const Facets of = varimesh::facets(mesh_, team);
  const Cells cells(mesh_, 3), elements(mesh_, 2);
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    for (std::int32_t f = of.first[cell]; f < of.first[cell + 1]; ++f) {
      if (of.neighbour[index(f)] >= 0) continue;
      BoundaryFacet facet = facet_of(of, cells, f);
      const auto element = std::ranges::lower_bound(of.elements, f, {}, &std::pair<std::int32_t, std::int32_t>::first);
      const bool has_element = element != of.elements.end() && element->first == f;
      facet.entity = has_element ? elements.range_of(index(element->second)).block->entity : -1;
      facets.push_back(std::move(facet));
    }
  find_interfaces(of, cells, elements);
}

/// Facets between two cells that are elements of the mesh. Facets without an element between cells of different
/// entities may be anything, since their nodes are not fixed when the mesh is optimised. So those of the boundary stay.
void BoundaryParts::find_interfaces(const Facets& of, const Cells& cells, const Cells& elements) {
  std::vector<bool> has_element(of.neighbour.size(), false);
  for (const auto& [f, element] : of.elements) {
    const std::int32_t other = of.opposite[index(f)];
    if (other < 0 || has_element[index(f)]) continue;
    has_element[index(f)] = has_element[index(other)] = true;
    // All facets between the same two entities have the sense that the first of these gives them.
    const auto entity = [&](std::int32_t facet) { return cells.range_of(cell_of(of, facet)).block->entity; };
    BoundaryFacet facet = facet_of(of, cells, entity(f) <= entity(other) ? f : other);
    if (entity(f) == entity(other)) {
      const auto nodes = elements.nodes(index(element));
      facet.nodes.assign(nodes.begin(), nodes.end());
    }
    facet.entity = elements.range_of(index(element)).block->entity;
    facet.is_inside = true;
    facets.push_back(std::move(facet));
  }
  for (std::size_t f = 0; f < of.neighbour.size(); ++f) {
    const std::int32_t next = of.neighbour[f];
    if (next < 0 || has_element[f]) continue;
    const std::size_t cell = cell_of(of, static_cast<std::int32_t>(f));
    if (cells.range_of(index(next)).block->entity == cells.range_of(cell).block->entity) continue;
    for (const std::int32_t node : facet_of(of, cells, static_cast<std::int32_t>(f)).nodes) held[index(node)] = true;
  }
}

/// The shape and the nodes of a facet, numbered as the cell sees it.
BoundaryFacet BoundaryParts::facet_of(const Facets& of, const Cells& cells, std::int32_t facet) const {
  const std::size_t cell = cell_of(of, facet);
  const Shape shape = cells.shape(cell);
  const int local = facet - of.first[cell];
  BoundaryFacet result;
  result.shape = reference::info(shape).facets[index(local)].shape;
  for (const int k : reference::facet_nodes(shape, cells.range_of(cell).block->order, local))
    result.nodes.push_back(cells.nodes(cell)[index(k)]);
  return result;
}

void BoundaryParts::find_facets_of_surface() {
  const Cells cells(mesh_, 2);
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    const auto nodes = cells.nodes(cell);
    facets.push_back({cells.shape(cell), {nodes.begin(), nodes.end()}, cells.range_of(cell).block->entity, false, 0});
  }
}

// ===== Edges and surfaces =====

void BoundaryParts::find_edges() {
  std::vector<std::tuple<std::int32_t, std::int32_t, std::size_t, int>> all;
  for (std::size_t f = 0; f < facets.size(); ++f) {
    const auto& of = reference::info(facets[f].shape).facets;
    for (std::size_t e = 0; e < of.size(); ++e) {
      const auto ends =
          std::minmax(facets[f].nodes[index(of[e].vertices[0])], facets[f].nodes[index(of[e].vertices[1])]);
      all.emplace_back(ends.first, ends.second, f, static_cast<int>(e));
    }
  }
  std::ranges::sort(all);
  for (const auto& [low, high, facet, edge] : all) {
    if (edges_.empty() || edges_.back().low != low || edges_.back().high != high)
      edges_.push_back({low, high, {}, false});
    edges_.back().sides.emplace_back(facet, edge);
  }
}

/// The normal on the side of the straight-sided element.
Eigen::Vector3d BoundaryParts::normal(std::size_t facet, const Eigen::Vector2d& at) const {
  const BoundaryFacet& of = facets[facet];
  const geometry::ElementMap map(of.shape, mesh_.order, positions(of.nodes));
  const auto& x = map.nodes();
  const Eigen::Index last = of.shape == Shape::Triangle ? 2 : 3;
  const Eigen::Vector3d straight =
      last == 2 ? (x.col(1) - x.col(0)).cross(x.col(2) - x.col(0)) : (x.col(2) - x.col(0)).cross(x.col(3) - x.col(1));
  const Eigen::Vector3d curved = map.at(at[0], at[1]).normal();
  return curved.dot(straight) < 0 ? Eigen::Vector3d(-curved) : curved;
}

bool BoundaryParts::is_smooth(const Edge& edge) const {
  if (edge.sides.size() != 2 || edge.sides[0].first == edge.sides[1].first) return false;
  if (facets[edge.sides[0].first].entity != facets[edge.sides[1].first].entity) return false;
  std::array<std::array<Eigen::Vector2d, 2>, 2> ends;  // from low to high, by side
  double sense = -1;                                   // neighbours of one sense run along their edge in opposite ways
  for (std::size_t i = 0; i < 2; ++i) {
    const BoundaryFacet& facet = facets[edge.sides[i].first];
    const auto& vertices = reference::info(facet.shape).facets[index(edge.sides[i].second)].vertices;
    const bool upwards = facet.nodes[index(vertices[0])] == edge.low;
    ends[i] = {vertex(facet.shape, vertices[upwards ? 0 : 1]), vertex(facet.shape, vertices[upwards ? 1 : 0])};
    sense *= upwards ? 1 : -1;
  }
  if (facets[edge.sides[0].first].is_inside && sense < 0) return false;  // the pieces of a surface have one sense
  // The ends do not count: at the tip of a cone, neighbours never meet smoothly.
  double sum = 0;
  for (const double s : {0.25, 0.5, 0.75}) {
    const Eigen::Vector3d one = normal(edge.sides[0].first, (1 - s) * ends[0][0] + s * ends[0][1]);
    const Eigen::Vector3d other = normal(edge.sides[1].first, (1 - s) * ends[1][0] + s * ends[1][1]);
    const double cosine = sense * one.dot(other);
    // Where two elements of order 1 meet in a plane, one that faces the other way is folded over.
    sum += std::acos(std::clamp(mesh_.order == 1 ? std::abs(cosine) : cosine, -1.0, 1.0));
  }
  return sum / 3 < angle_;
}

void BoundaryParts::find_smooth_edges(const Team& team) {
  team.for_each(static_cast<std::int32_t>(edges_.size()), 64,
                [&](std::int32_t e) { edges_[index(e)].smooth = is_smooth(edges_[index(e)]); });
}

void BoundaryParts::find_surfaces() {
  std::vector<std::size_t> root(facets.size());
  std::iota(root.begin(), root.end(), std::size_t{0});
  const auto find = [&](std::size_t f) {
    while (root[f] != f) f = root[f] = root[root[f]];
    return f;
  };
  for (const Edge& edge : edges_) {
    if (!edge.smooth) continue;
    const std::size_t a = find(edge.sides[0].first), b = find(edge.sides[1].first);
    root[std::max(a, b)] = std::min(a, b);
  }
  for (std::size_t f = 0; f < facets.size(); ++f)
    facets[f].surface = find(f) == f ? surfaces++ : facets[find(f)].surface;
}

// ===== Curves and corners =====

void BoundaryParts::find_lines() {
  lines_at_.resize(mesh_.node_count());
  for (const Edge& edge : edges_) {
    if (edge.smooth) continue;
    Line line;
    line.nodes = edge_nodes(facets[edge.sides[0].first], mesh_.order, edge.sides[0].second);
    for (const auto& [facet, side] : edge.sides) line.surfaces.push_back(static_cast<int>(facets[facet].surface));
    std::ranges::sort(line.surfaces);
    lines_at_[index(edge.low)].push_back(lines_.size());
    lines_at_[index(edge.high)].push_back(lines_.size());
    lines_.push_back(std::move(line));
  }
}

void BoundaryParts::find_corners() {
  const auto away = [&](const Line& line, std::int32_t from) {
    const geometry::ElementMap map(Shape::Line, mesh_.order, positions(line.nodes));
    const bool begins = line.nodes[0] == from;
    const Eigen::Vector3d tangent = (begins ? 1 : -1) * map.at(begins ? -1 : 1).dt;
    const Eigen::Vector3d chord = (begins ? 1 : -1) * (map.nodes().col(1) - map.nodes().col(0));
    return Eigen::Vector3d((tangent.dot(chord) < 0 ? -1 : 1) * tangent.normalized());
  };
  for (std::size_t node = 0; node < lines_at_.size(); ++node) {
    const auto& at = lines_at_[node];
    if (at.empty()) continue;
    const auto number = static_cast<std::int32_t>(node);
    if (at.size() != 2 || lines_[at[0]].surfaces != lines_[at[1]].surfaces ||
        away(lines_[at[0]], number).dot(away(lines_[at[1]], number)) > -std::cos(angle_))
      corners.push_back(number);
  }
  find_tips();
  std::ranges::sort(corners);
}

/// Vertices inside a surface whose normals there are far apart, though those of neighbours are near: the tip of a cone.
void BoundaryParts::find_tips() {
  std::vector<Eigen::Vector3d> sum(mesh_.node_count(), Eigen::Vector3d::Zero());
  std::vector<double> least(mesh_.node_count(), 1);
  for (const bool first : {true, false})
    for (std::size_t f = 0; f < facets.size(); ++f)
      for (int k = 0; k < reference::info(facets[f].shape).vertices; ++k) {
        const std::size_t node = index(facets[f].nodes[index(k)]);
        const Eigen::Vector3d n = normal(f, vertex(facets[f].shape, k));
        if (first)
          sum[node] += n;
        else
          least[node] = std::min(least[node], n.dot(sum[node].normalized()));
      }
  for (std::size_t node = 0; node < least.size(); ++node)
    if (lines_at_[node].empty() && least[node] < std::cos(2 * angle_))
      corners.push_back(static_cast<std::int32_t>(node));
}

bool BoundaryParts::is_corner(std::int32_t node) const { return std::ranges::binary_search(corners, node); }

void BoundaryParts::find_chains() {
  for (const std::int32_t corner : corners)
    for (const std::size_t line : lines_at_[index(corner)])
      if (!lines_[line].used) follow(line, corner);
  for (std::size_t line = 0; line < lines_.size(); ++line)
    if (!lines_[line].used) follow(line, lines_[line].nodes[0]);
}

/// Adds the chain that begins with this line at this end of it.
void BoundaryParts::follow(std::size_t line, std::int32_t from) {
  BoundaryChain chain;
  chain.surfaces = lines_[line].surfaces;
  const std::int32_t start = from;
  while (true) {
    Line& now = lines_[line];
    now.used = true;
    if (now.nodes[0] != from) turn(now.nodes);
    chain.lines.push_back(now.nodes);
    from = now.nodes[1];
    if (is_corner(from)) break;
    chain.closed = from == start;
    if (chain.closed) break;
    const auto& at = lines_at_[index(from)];
    line = at[0] == line ? at[1] : at[0];
  }
  chains.push_back(std::move(chain));
}

}  // namespace varimesh::detail
